//! Parents of drawn chains.
//!
//! A stroke that starts on a joint always continues from it. For other strokes, a person who draws a spine, an arm and
//! a leg one after the other expects the leg on the pelvis, not on the hand that the last stroke left selected:
//! [`StrokeParent::Natural`] is the rule for that.

use std::collections::{BTreeSet, HashMap, HashSet};

use bevy::prelude::*;

use crate::{
    plugins::document::Selection,
    rig::{Rig, Uid, operations::MirrorPlane},
};

/// Rule for the parent of a chain whose stroke starts on no joint.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum StrokeParent {
    /// The active joint of the selection in any case; without one the chain is a root.
    #[default]
    Selected,
    /// The active joint if a person selected or placed it. If the last stroke left it selected: the joint of the bone
    /// beside which the chain starts, see [`nearest_parent`].
    Natural,
    /// The joint of the bone beside which the chain starts, whatever the selection.
    Nearest,
    /// The given joint; `None` makes a root.
    Joint(Option<Uid>),
}

/// Reason for the parent of a chain.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ParentReason {
    /// The stroke starts on the joint.
    StartsOn,
    /// The joint is selected, or was requested.
    Selected,
    /// The chain starts beside that joint's bone.
    Nearest,
    /// The chain is a root, since no joint was found to attach it to.
    Root,
}

impl ParentReason {
    /// End of a sentence for the status line, after "the chain ": `joint` is the parent's name for people.
    pub fn describe(self, joint: &str) -> String {
        match self {
            Self::StartsOn => format!("continues from {joint}, on which the stroke starts"),
            Self::Selected => format!("hangs on {joint}, which is selected"),
            Self::Nearest => {
                format!("hangs on {joint}, the nearest of the middle (select a joint first to hang it there)")
            }
            Self::Root => "starts a skeleton of its own".to_owned(),
        }
    }
}

/// The joints that strokes left selected on this rig, and that no person has picked since.
///
/// Added to a rig's entity with its first chain.
#[derive(Component, Reflect, Debug, Clone, PartialEq, Eq, Default)]
#[reflect(opaque)]
#[reflect(Component, Debug, Clone, PartialEq, Default)]
pub struct StrokeTips(pub(super) BTreeSet<Uid>);

impl StrokeTips {
    /// Returns `true` if a stroke and not a person selected the joint.
    pub fn contains(&self, joint: Uid) -> bool {
        self.0.contains(&joint)
    }
}

/// The parent of a chain whose stroke starts on no joint and whose first joint is at `start`, in the rig's space.
///
/// `joints` are all joints with their places, parents first (as [`posed_joints`](super::super::picking::posed_joints)
/// gives them), `tips` the joints that strokes left selected.
pub fn stroke_parent(
    rule: StrokeParent,
    rig: &Rig,
    selection: &Selection,
    tips: Option<&StrokeTips>,
    symmetry: Option<MirrorPlane>,
    joints: &[(Uid, Vec3)],
    start: Vec3,
) -> (Option<Uid>, ParentReason) {
    let active = selection.active().filter(|joint| rig.joint(*joint).is_some());
    let chosen = active.filter(|joint| tips.is_none_or(|tips| !tips.contains(*joint)));
    let (parent, reason) = match rule {
        StrokeParent::Selected => (active, ParentReason::Selected),
        StrokeParent::Natural if chosen.is_some() => (chosen, ParentReason::Selected),
        // An empty selection is a choice, too: that of a root.
        StrokeParent::Natural if active.is_none() => (None, ParentReason::Root),
        StrokeParent::Natural | StrokeParent::Nearest => {
            (nearest_parent(rig, symmetry, joints, start), ParentReason::Nearest)
        }
        StrokeParent::Joint(joint) => (joint, ParentReason::Selected),
    };
    (parent, if parent.is_some() { reason } else { ParentReason::Root })
}

/// The joint of the bone beside which `start` lies: the nearer of the bone's two joints, where the tip of a chain
/// counts only in the last quarter of its bone and beyond.
///
/// With a mirror plane only joints on it count, and joints with several chains already (a hand with fingers); without
/// such joints all count.
pub fn nearest_parent(rig: &Rig, symmetry: Option<MirrorPlane>, joints: &[(Uid, Vec3)], start: Vec3) -> Option<Uid> {
    let central = |joint: Uid| {
        let data = rig.joint(joint);
        data.is_some_and(|data| data.data.mirror.is_none())
            && symmetry.is_some_and(|plane| plane.distance(rig.position(joint)).abs() <= plane.tolerance)
    };
    let forks = |joint: Uid| rig.children(Some(joint)).len() > 1;
    let mut candidates: Vec<(Uid, Vec3)> = joints.iter().copied().filter(|(joint, _)| central(*joint)).collect();
    if candidates.is_empty() {
        candidates = joints.to_vec();
    } else {
        candidates.extend(joints.iter().copied().filter(|(joint, _)| !central(*joint) && forks(*joint)));
    }
    let parent_of = |joint: Uid| rig.joint(joint).and_then(|joint| joint.parent);
    let places: HashMap<Uid, Vec3> = candidates.iter().copied().collect();
    let parents: HashSet<Uid> = candidates.iter().filter_map(|(joint, _)| parent_of(*joint)).collect();
    let mut best: Option<(f32, Uid)> = None;
    for &(joint, foot) in &candidates {
        let bone = parent_of(joint).and_then(|parent| Some((parent, *places.get(&parent)?)));
        let (distance, owner) = match bone {
            Some((parent, head)) => {
                let along = foot - head;
                let t = (start - head).dot(along) / along.length_squared().max(f32::MIN_POSITIVE);
                let share = if parents.contains(&joint) { 0.5 } else { 0.75 };
                (start.distance(head + along * t.clamp(0.0, 1.0)), if t > share { joint } else { parent })
            }
            None => (start.distance(foot), joint),
        };
        // Of equally near bones, which meet in a joint, the first in the hierarchy decides.
        if best.is_none_or(|(least, _)| distance < least * (1.0 - 1e-5)) {
            best = Some((distance, owner));
        }
    }
    best.map(|(_, joint)| joint)
}
