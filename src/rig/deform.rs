//! Deform joints: the joints that move meshes, their rest transforms, and the joints that hold weights of joints that
//! are not built.
//!
//! Weights, the posed surface, the picture and the exported character all use [`DeformSkeleton`], so that a mesh
//! follows the same joints everywhere. For a built rig these are the built joints, including those that commands
//! created (twist joints, joints between others); for any other rig, the document's joints at rest.

use std::collections::{BTreeMap, BTreeSet, HashMap, HashSet};

use bevy::math::{Affine3, Vec3};

use super::{BuiltRig, Constraint, NodeKind, NodeType, RestTransform, Rig, SkinData, Uid};
use crate::mesh::model::Weights;

/// Joint or null of a [`DeformSkeleton`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DeformJoint {
    /// Uid by which weights refer to the joint.
    pub uid: Uid,
    /// Index of the parent in [`DeformSkeleton::joints`], smaller than the joint's own.
    pub parent: Option<usize>,
    /// Transform from the joint's space to the rig's, at rest.
    pub rest: Affine3,
    /// True for joints that move the mesh; false for nulls of the document, which only mark the ends of bones.
    pub deforms: bool,
    /// Node for which a command created the joint; `None` for joints of the document.
    pub subject: Option<Uid>,
    /// Bone whose twist the joint shares; `None` if it is no twist joint.
    pub twist: Option<TwistSegment>,
    /// Index of the joint whose bend the joint takes by half, if it is a half joint.
    pub halves: Option<usize>,
}

/// Role of created joints that take half of the bend of the joint they are made for, and of the skin on it.
pub const HALF: &str = "half";

/// Bone that a twist joint shares with the joint at its start.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TwistSegment {
    /// Index of the joint at the start of the bone.
    pub joint: usize,
    /// End of the bone, in the rig's space.
    pub end: Vec3,
}

/// The joints that can move a mesh, parents before children.
#[derive(Debug, Clone, Default)]
pub struct DeformSkeleton {
    joints: Vec<DeformJoint>,
    index: HashMap<Uid, usize>,
}

impl DeformSkeleton {
    /// Deform joints of a rig: the built ones if it is built. Created nulls and controls are left out; their children
    /// become children of the nearest joint above them.
    pub fn new(rig: &Rig, built: Option<&BuiltRig>) -> Self {
        let mut skeleton = Self::default();
        match built {
            Some(built) => skeleton.add_built(built),
            None => skeleton.add_document(rig),
        }
        skeleton
    }

    /// Joints and nulls, parents before children.
    pub fn joints(&self) -> &[DeformJoint] {
        &self.joints
    }

    /// Index of a joint in [`DeformSkeleton::joints`].
    pub fn index(&self, joint: Uid) -> Option<usize> {
        self.index.get(&joint).copied()
    }

    /// Index, for each joint of the weights, of the deform joint that holds its influences: the joint itself; while
    /// it is not built, the nearest joint above it, or the node that it was created for (or the nearest joint above
    /// that). `None` for deleted joints.
    pub fn holders(&self, rig: &Rig, skin: &SkinData) -> Vec<Option<usize>> {
        let mut holders: HashMap<Uid, Option<usize>> = HashMap::new();
        let mut above: HashMap<Uid, Option<usize>> = HashMap::new();
        skin.joints.iter().map(|joint| self.holder(rig, skin, *joint, (&mut holders, &mut above))).collect()
    }

    /// Holder of a joint; `holders` are those that are found, and `above` the joints above others.
    fn holder(
        &self,
        rig: &Rig,
        skin: &SkinData,
        joint: Uid,
        (holders, above): (&mut HashMap<Uid, Option<usize>>, &mut HashMap<Uid, Option<usize>>),
    ) -> Option<usize> {
        // A subject may itself be created; in a damaged file, subjects may form a cycle.
        let (mut next, mut way, mut found) = (Some(joint), Vec::new(), None);
        while let Some(joint) = next {
            if let Some(known) = holders.get(&joint) {
                found = *known;
                break;
            }
            holders.insert(joint, None);
            way.push(joint);
            found = self.index(joint).or_else(|| self.above(rig, joint, above));
            if found.is_some() {
                break;
            }
            next = skin.subjects.get(&joint).copied();
        }
        holders.extend(way.into_iter().map(|joint| (joint, found)));
        found
    }

    /// The nearest joint of the skeleton above a joint of the document; `known` are those that are found.
    fn above(&self, rig: &Rig, joint: Uid, known: &mut HashMap<Uid, Option<usize>>) -> Option<usize> {
        let (mut way, mut found) = (vec![joint], None);
        for ancestor in rig.ancestors(joint) {
            let uid = ancestor.data.uid;
            found = self.index(uid);
            if found.is_some() {
                break;
            }
            if let Some(known) = known.get(&uid) {
                found = *known;
                break;
            }
            way.push(uid);
        }
        known.extend(way.into_iter().map(|joint| (joint, found)));
        found
    }

    /// Subjects of created joints (the nodes that they were made for), for [`SkinData::subjects`].
    pub fn subjects(&self) -> BTreeMap<Uid, Uid> {
        self.joints.iter().filter_map(|joint| Some((joint.uid, joint.subject?))).collect()
    }

    fn add(&mut self, joint: DeformJoint) {
        self.index.insert(joint.uid, self.joints.len());
        self.joints.push(joint);
    }

    fn add_document(&mut self, rig: &Rig) {
        for (joint, (uid, rest)) in rig.walk().zip(rig.rest_globals()) {
            self.add(DeformJoint {
                uid,
                parent: joint.parent.and_then(|parent| self.index(parent)),
                rest,
                deforms: joint.data.kind == NodeKind::Joint,
                subject: None,
                twist: None,
                halves: None,
            });
        }
    }

    fn add_built(&mut self, built: &BuiltRig) {
        let mut globals: Vec<Affine3> = Vec::with_capacity(built.nodes.len());
        // Index of the nearest joint of the skeleton at or above each node.
        let mut places: Vec<Option<usize>> = Vec::with_capacity(built.nodes.len());
        for node in &built.nodes {
            let above = node.parent.and_then(|parent| Some((globals.get(parent)?, places.get(parent)?)));
            let (global, parent) = above.map_or((Affine3::IDENTITY, None), |(global, place)| (*global, *place));
            let rest = global * RestTransform::from(node.base).affine();
            globals.push(rest);
            let deforms = node.kind == NodeType::Joint;
            if !deforms && node.origin.is_some() {
                places.push(parent);
                continue;
            }
            places.push(Some(self.joints.len()));
            let subject = node.origin.as_ref().map(|origin| origin.subject);
            let half = node.origin.as_ref().filter(|origin| deforms && *origin.role == *HALF);
            let halves = half.and_then(|origin| self.index(origin.subject)).filter(|joint| self.joints[*joint].deforms);
            self.add(DeformJoint { uid: node.uid, parent, rest, deforms, subject, twist: None, halves });
        }
        let mut children: Vec<Vec<usize>> = vec![Vec::new(); self.joints.len()];
        for (number, joint) in self.joints.iter().enumerate() {
            if let Some(parent) = joint.parent {
                children[parent].push(number);
            }
        }
        for constraint in &built.constraints {
            if let Constraint::Twist { driven, .. } = &*constraint.constraint {
                let driven = driven.iter().filter_map(|(joint, _)| self.index(*joint));
                let driven: Vec<usize> = driven.filter(|joint| self.joints[*joint].deforms).collect();
                self.note_twist(&driven, &children);
            }
        }
    }

    /// Sets the bone of joints that share one twist. A driven joint with descendants outside of this set is no twist
    /// joint but a bone of the limb itself.
    fn note_twist(&mut self, driven: &[usize], children: &[Vec<usize>]) {
        // Children come after their parents.
        let set: BTreeSet<usize> = driven.iter().copied().collect();
        let mut carries = HashSet::new();
        for joint in set.iter().rev() {
            if children[*joint].iter().any(|child| !set.contains(child) || carries.contains(child)) {
                carries.insert(*joint);
            }
        }
        let twists: Vec<usize> = driven.iter().copied().filter(|joint| !carries.contains(joint)).collect();
        let Some(first) = twists.first() else { return };
        let above = |joint: usize| self.joints[joint].parent;
        let owner = std::iter::successors(above(*first), |joint| above(*joint))
            .find(|joint| !set.contains(joint) && self.joints[*joint].deforms);
        let Some(owner) = owner else { return };
        let Some(end) = self.bone_end(owner, &children[owner], &twists) else { return };
        for joint in twists {
            self.joints[joint].twist = Some(TwistSegment { joint: owner, end });
        }
    }

    /// End (in the rig's space) of the bone of `owner` on which twist joints lie: the joint after them on the same
    /// line, or the position where the next of equally spaced joints would be. `None` if the bone has no length.
    fn bone_end(&self, owner: usize, children: &[usize], twists: &[usize]) -> Option<Vec3> {
        /// Least cosine of the angle between the bone and the line of its twist joints.
        const ALONG: f32 = 0.98;
        let place = |joint: usize| self.joints[joint].rest.translation;
        let start = place(owner);
        let mut line: Vec<Vec3> = twists.iter().map(|joint| place(*joint) - start).collect();
        line.sort_by(|a, b| a.length_squared().total_cmp(&b.length_squared()));
        let last = *line.last()?;
        let of_twist: HashSet<usize> = twists.iter().copied().collect();
        let ends = children
            .iter()
            .filter(|joint| !of_twist.contains(*joint))
            .map(|joint| place(*joint) - start)
            .filter(|end| end.length_squared() > 0.0);
        let direction = last.normalize_or_zero();
        let aligned = |end: &Vec3| end.normalize_or_zero().dot(direction);
        let best = ends.max_by(|a, b| aligned(a).total_cmp(&aligned(b)));
        if let Some(end) = best
            && (direction == Vec3::ZERO || aligned(&end) > ALONG && end.length() > last.length())
        {
            return Some(start + end);
        }
        let before = line.len().checked_sub(2).map_or(Vec3::ZERO, |at| line[at]);
        (last != before).then(|| start + last + (last - before))
    }
}

/// Weights over other joints: `place` gives the next index of each joint. Influences of joints with the same index add
/// up; influences of joints without one are left out.
pub fn replaced_joints(weights: &Weights, place: &[Option<usize>]) -> Weights {
    if place.iter().enumerate().all(|(number, place)| *place == Some(number)) {
        return weights.clone();
    }
    let mut result = Weights::default();
    let mut row: Vec<(u32, f32)> = Vec::new();
    for point in 0..weights.len() {
        row.clear();
        for (joint, value) in weights.of(point) {
            let Some(joint) = place.get(joint as usize).copied().flatten() else { continue };
            match row.iter_mut().find(|(other, _)| *other == joint as u32) {
                Some((_, sum)) => *sum += value,
                None => row.push((joint as u32, value)),
            }
        }
        result.push(row.iter().copied());
    }
    result
}
