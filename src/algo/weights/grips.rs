//! Grips: things that reach far beyond the limb which carries them, such as swords, staffs and torches in a fist. They are
//! stiff and go with the hand, though single fingers are nearest to them.

use std::collections::BTreeMap;

use glam::Vec3;

use super::{
    WeightJoint,
    bone::BoneSegment,
    bone_tree::{BoneTree, closest_on},
    hierarchy::Hierarchy,
    islands::{HELD, SAMPLES},
    roots::parents_first,
};

/// Half of a carried thing lies at least this share of the limb's size away from the limb's bones.
const FAR: f32 = 0.5;

/// Limbs that may carry things.
pub(super) struct Grips<'a> {
    bones: &'a [BoneSegment],
    tree: BoneTree,
    hierarchy: Hierarchy,
    /// The joint above the nearest branch of each joint: the joint itself or one above it that has less than half of the joints
    /// of its parent below it. The hand is no branch of the forearm, whatever else hangs there.
    above_branch: Vec<Option<usize>>,
    /// Corners of the box around the bones of each joint and of the joints below it.
    corners: Vec<[Vec3; 2]>,
}

impl<'a> Grips<'a> {
    pub fn new(joints: &[WeightJoint], bones: &'a [BoneSegment]) -> Self {
        let hierarchy = Hierarchy::new(joints);
        let (order, _) = parents_first(joints);
        let mut above_branch = vec![None; joints.len()];
        for &joint in &order {
            let Some(parent) = joints[joint].parent else { continue };
            let is_branch = 2 * hierarchy.count(joint) < hierarchy.count(parent);
            above_branch[joint] = if is_branch { Some(parent) } else { above_branch[parent] };
        }
        let union = |a: [Vec3; 2], b: [Vec3; 2]| [a[0].min(b[0]), a[1].max(b[1])];
        let mut corners = vec![[Vec3::INFINITY, Vec3::NEG_INFINITY]; joints.len()];
        for bone in bones {
            let own = &mut corners[bone.joint as usize];
            *own = union(*own, [bone.head.min(bone.tail), bone.head.max(bone.tail)]);
        }
        for &joint in order.iter().rev() {
            if let Some(parent) = joints[joint].parent {
                corners[parent] = union(corners[parent], corners[joint]);
            }
        }
        Self { bones, tree: BoneTree::new(bones), hierarchy, above_branch, corners }
    }

    /// Joint that carries a piece of the mesh which single branches of a limb hold, fingers say: the one at which the limb branches,
    /// if the limb holds nearly all of the piece and the piece reaches far beyond it. `sums` has the weights of joints over the
    /// piece, which lies at `places`.
    pub fn carrier(&self, sums: &BTreeMap<u32, f32>, places: &[Vec3]) -> Option<u32> {
        let whole: f32 = sums.values().sum();
        let strongest = sums.iter().max_by(|a, b| a.1.total_cmp(b.1).then(b.0.cmp(a.0)))?;
        let held = |top: usize| {
            let below = sums.iter().filter(|(joint, _)| self.hierarchy.has(top, **joint as usize));
            below.map(|(_, sum)| sum).sum::<f32>()
        };
        let mut limb = self.above_branch[*strongest.0 as usize]?;
        // Each limb has more than twice as many joints as the one before.
        while held(limb) < HELD * whole {
            limb = self.above_branch[limb]?;
        }
        self.reaches_beyond(limb, places).then_some(limb as u32)
    }

    /// True if at least half of some places lie far from all bones of the limb below a joint.
    fn reaches_beyond(&self, top: usize, places: &[Vec3]) -> bool {
        let [low, high] = self.corners[top];
        let far = FAR * (high - low).max_element();
        let samples = places.iter().step_by(places.len().div_ceil(SAMPLES).max(1));
        let count = samples.len();
        let is_far = |place: &&Vec3| {
            !self.tree.any_within(**place, far, |bone| {
                let bone = &self.bones[bone as usize];
                let is_of_limb = self.hierarchy.has(top, bone.joint as usize);
                is_of_limb && closest_on(bone, **place).distance(**place) <= far
            })
        };
        far > 0.0 && 2 * samples.filter(is_far).count() >= count
    }
}
