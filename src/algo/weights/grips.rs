//! Grips: things that reach far beyond the limb which carries them, such as swords, staffs and torches in a fist. They are
//! stiff and go with the hand, though single fingers are nearest to them.

use std::collections::BTreeMap;

use glam::Vec3;

use super::{
    WeightJoint,
    bone::BoneSegment,
    bone_tree::closest_on,
    hierarchy::Hierarchy,
    islands::{HELD, SAMPLES},
};

/// Half of a carried thing lies at least this share of the limb's size away from the limb's bones.
const FAR: f32 = 0.5;

/// Limbs that may carry things.
pub(super) struct Grips<'a> {
    joints: &'a [WeightJoint],
    bones: &'a [BoneSegment],
    hierarchy: Hierarchy,
}

impl<'a> Grips<'a> {
    pub fn new(joints: &'a [WeightJoint], bones: &'a [BoneSegment]) -> Self {
        Self { joints, bones, hierarchy: Hierarchy::new(joints) }
    }

    /// Joint that carries a piece of the mesh which single branches of a limb hold, fingers say: the one at which the limb branches,
    /// if the limb holds nearly all of the piece and the piece reaches far beyond it. `sums` has the weights of joints over the
    /// piece, which lies at `places`.
    pub fn carrier(&self, sums: &BTreeMap<u32, f32>, places: &[Vec3]) -> Option<u32> {
        let whole: f32 = sums.values().sum();
        let strongest = sums.iter().max_by(|a, b| a.1.total_cmp(b.1).then(b.0.cmp(a.0)))?;
        let mut top = *strongest.0 as usize;
        let held = |top: usize| {
            let below = sums.iter().filter(|(joint, _)| self.hierarchy.has(top, **joint as usize));
            below.map(|(_, sum)| sum).sum::<f32>()
        };
        // Joints in a ring of parents have no ranges; the walk up ends with all joints in any case.
        for _ in 0..self.joints.len() {
            let parent = self.joints[top].parent?;
            // The hand is no branch of the forearm, whatever else hangs there.
            let is_branch = 2 * self.hierarchy.count(top) < self.hierarchy.count(parent);
            if is_branch && held(parent) >= HELD * whole {
                return self.reaches_beyond(parent, places).then_some(parent as u32);
            }
            top = parent;
        }
        None
    }

    /// True if at least half of some places lie far from all bones of the limb below a joint.
    fn reaches_beyond(&self, top: usize, places: &[Vec3]) -> bool {
        let of_limb = self.bones.iter().filter(|bone| self.hierarchy.has(top, bone.joint as usize));
        let bones: Vec<&BoneSegment> = of_limb.collect();
        let ends = bones.iter().flat_map(|bone| [bone.head, bone.tail]);
        let (low, high) =
            ends.fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(low, high), at| (low.min(at), high.max(at)));
        let far = FAR * (high - low).max_element();
        let samples = places.iter().step_by(places.len().div_ceil(SAMPLES).max(1));
        let count = samples.len();
        let is_far = |place: &&Vec3| bones.iter().all(|bone| closest_on(bone, **place).distance(**place) > far);
        far > 0.0 && 2 * samples.filter(is_far).count() >= count
    }
}
