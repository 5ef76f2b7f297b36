//! Matching of joints behind a limb, such as a foot behind a hock: they turn with one control by forward kinematics and
//! with another one by inverse kinematics, which the switch of the limb weighs.

use glam::Quat;

use super::{Attempt, MatchError, angle_between, limb::Limb, number};
use crate::{
    mesh::model::Trs,
    rig::{Constraint, NodeType, Scalar, SwitchData, Uid},
};

/// Angle in degrees below which a joint counts as held.
const STILL: f32 = 1e-3;

/// Joint that turns with a node.
pub(super) struct Follower {
    pub joint: Uid,
    target: Uid,
    space: FollowSpace,
    /// Weights of this constraint and of those after it on the same joint.
    weights: Vec<Scalar>,
    /// The target was built where the joint is, so it is placed and not only turned.
    is_placed: bool,
}

/// Space in which a joint follows its target.
#[derive(Clone)]
enum FollowSpace {
    /// Space of the rig.
    Rig {
        /// Rotation of the joint relative to the target, with that which the joint's own pose adds.
        offset: Quat,
    },
    /// Space of the joint's parent, in which the joint stands as the target does in that of another node.
    Parent {
        /// The other node.
        of_target: Uid,
        /// Parent of the joint.
        of_joint: Uid,
    },
}

/// Constraint that turns a joint.
struct Turn<'a> {
    joint: Uid,
    target: Uid,
    space: FollowSpace,
    weight: &'a Scalar,
}

impl<'a> Turn<'a> {
    fn of(constraint: &'a Constraint, attempt: &Attempt<'_>) -> Option<Self> {
        match constraint {
            Constraint::Transform { driven, targets, rotate: [true, true, true], weight, keep_pose, .. } => {
                let [target] = targets.as_slice() else { return None };
                let own = if *keep_pose { attempt.offset(*driven).rotation } else { Quat::IDENTITY };
                let space = FollowSpace::Rig { offset: target.offset.rotation * own };
                Some(Self { joint: *driven, target: target.node, space, weight })
            }
            Constraint::Relative { driven, source, space, rotate: true, weight, .. } => {
                let parent = attempt.rig.node(*driven)?.parent?;
                let space = FollowSpace::Parent { of_target: *space, of_joint: attempt.rig.nodes[parent].uid };
                Some(Self { joint: *driven, target: *source, space, weight })
            }
            _ => None,
        }
    }
}

/// Followers of a switch: of joints outside of the limb that a constraint weighs by the switch's attribute, each of the
/// constraints that turn them. Nodes built within `near` of each other, in rig units, count as one place.
pub(super) fn followers(attempt: &Attempt<'_>, switch: &SwitchData, limb: &Limb<'_>, near: f32) -> Vec<Follower> {
    let is_switched = |weight: &Scalar| match weight {
        Scalar::Attribute { node, name, .. } => *node == switch.control && *name == switch.attribute,
        _ => false,
    };
    let is_behind = |joint: Uid| {
        let is_joint = attempt.rig.node(joint).is_some_and(|node| node.kind == NodeType::Joint);
        is_joint && !limb.joints.contains(&joint)
    };
    let turns = attempt.rig.constraints.iter().filter_map(|built| Turn::of(&built.constraint, attempt));
    let turns: Vec<Turn> = turns.filter(|turn| is_behind(turn.joint)).collect();
    let of_limb: Vec<Uid> = [limb.goal].into_iter().chain(limb.pole).map(|node| attempt.handle(node)).collect();
    let mut found = Vec::new();
    for (at, turn) in turns.iter().enumerate() {
        let of_joint = |from: usize| turns[from..].iter().filter(|other| other.joint == turn.joint);
        let handle = attempt.handle(turn.target);
        if of_limb.contains(&handle) || limb.fk.contains(&handle) || !of_joint(0).any(|other| is_switched(other.weight))
        {
            continue;
        }
        let is_placed = match (attempt.built(turn.joint), attempt.built(turn.target)) {
            (Some(joint), Some(target)) => joint.translation.distance(target.translation) <= near,
            _ => false,
        };
        let weights = of_joint(at).map(|other| other.weight.clone()).collect();
        let (joint, target, space) = (turn.joint, turn.target, turn.space.clone());
        found.push(Follower { joint, target, space, weights, is_placed });
    }
    found
}

impl Follower {
    /// Poses the control that carries the target so that the joint turns as wanted, where the target has an effect.
    pub fn hold(&self, attempt: &mut Attempt<'_>, wanted: &Trs, length: f32) -> Result<(), MatchError> {
        let mut effect = 1.0;
        for (at, weight) in self.weights.iter().enumerate() {
            let weight = number(attempt, weight).clamp(0.0, 1.0);
            effect *= if at == 0 { weight } else { 1.0 - weight };
        }
        if effect <= 0.0 || angle_between(&attempt.global(self.joint)?, wanted) < STILL && !self.is_placed {
            return Ok(());
        }
        let handle = attempt.handle(self.target);
        let now = attempt.global(handle)?;
        let carried = attempt.global(self.target)?.relative_to(&now);
        let target = match &self.space {
            FollowSpace::Rig { offset } => {
                Trs { rotation: (wanted.rotation * offset.conjugate()).normalize(), ..*wanted }
            }
            FollowSpace::Parent { of_target, of_joint } => {
                let inside = wanted.relative_to(&attempt.global(*of_joint)?);
                attempt.global(*of_target)? * inside
            }
        };
        let rotation = (target.rotation * carried.rotation.conjugate()).normalize();
        let translation = match self.is_placed {
            true => target.translation - rotation * (now.scale * carried.translation),
            false => now.translation,
        };
        attempt.place(handle, &Trs { translation, rotation, scale: now.scale }, Some(1e-5 * length))
    }
}
