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
    /// Transform of the joint relative to the target.
    offset: Trs,
    /// Rotation that the joint's own pose adds.
    own: Quat,
    /// Weights of this constraint and of those after it on the same joint.
    weights: Vec<Scalar>,
    /// The target was built where the joint is, so it is placed and not only turned.
    is_placed: bool,
}

/// Followers of a switch: of joints outside of the limb that a constraint weighs by the switch's attribute, each of the
/// constraints that turn them. Nodes built within `near` of each other, in rig units, count as one place.
pub(super) fn followers(attempt: &Attempt<'_>, switch: &SwitchData, limb: &Limb<'_>, near: f32) -> Vec<Follower> {
    let is_switched = |weight: &Scalar| match weight {
        Scalar::Attribute { node, name, .. } => *node == switch.control && *name == switch.attribute,
        _ => false,
    };
    let turned = attempt.rig.constraints.iter().filter_map(|built| match &*built.constraint {
        Constraint::Transform { driven, targets, rotate: [true, true, true], weight, keep_pose, .. } => {
            let is_joint = attempt.rig.node(*driven).is_some_and(|node| node.kind == NodeType::Joint);
            let is_behind = is_joint && !limb.joints.contains(driven);
            let target = targets.first().filter(|_| targets.len() == 1 && is_behind)?;
            Some((*driven, target, weight, *keep_pose))
        }
        _ => None,
    });
    let turned: Vec<_> = turned.collect();
    let of_limb: Vec<Uid> = [limb.goal].into_iter().chain(limb.pole).map(|node| attempt.handle(node)).collect();
    let mut found = Vec::new();
    for (at, (joint, target, _, keeps_pose)) in turned.iter().enumerate() {
        let of_joint =
            || turned[at..].iter().filter(|(other, ..)| other == joint).map(|(_, _, weight, _)| (*weight).clone());
        let handle = attempt.handle(target.node);
        if of_limb.contains(&handle)
            || limb.fk.contains(&handle)
            || !turned.iter().any(|(other, _, weight, _)| other == joint && is_switched(weight))
        {
            continue;
        }
        let is_placed = match (attempt.built(*joint), attempt.built(target.node)) {
            (Some(joint), Some(target)) => joint.translation.distance(target.translation) <= near,
            _ => false,
        };
        let weights = of_joint().collect();
        let own = if *keeps_pose { attempt.offset(*joint).rotation } else { Quat::IDENTITY };
        found.push(Follower { joint: *joint, target: target.node, offset: target.offset, own, weights, is_placed });
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
        let target = (wanted.rotation * (self.offset.rotation * self.own).conjugate()).normalize();
        let rotation = (target * carried.rotation.conjugate()).normalize();
        let translation = match self.is_placed {
            true => wanted.translation - rotation * (now.scale * carried.translation),
            false => now.translation,
        };
        attempt.place(handle, &Trs { translation, rotation, scale: now.scale }, Some(1e-5 * length))
    }
}
