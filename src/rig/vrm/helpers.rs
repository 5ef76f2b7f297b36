//! Joints that only follow other joints: half joints and twist joints, as constraints of nodes.

use std::collections::BTreeMap;

use glam::Vec3;

use super::AvatarSource;
use crate::{
    mesh::{
        model::{Model, Trs},
        vrm::{ConstraintKind, NodeConstraint, RollAxis, SPEC_VERSION},
    },
    rig::{Constraint, Scalar, Uid, deform::HALF},
};

/// Half the sine of the angle by which the axes of a joint and of its half joint may differ.
const ALIKE: f32 = 1e-3;

/// Cosine of the largest angle between an axis of a twist and one of the node's own.
const ALONG: f32 = 0.97;

/// Hangs the half joints of a model beside the joints whose bends they take by half, so that a constraint can turn them. They
/// stay where they are. Clips have to be baked for the model afterwards.
pub fn hang_half_joints(model: &mut Model, source: &AvatarSource) {
    for (half, joint, _) in half_joints(source) {
        let is_parent = model.nodes.iter().any(|node| node.parent == Some(half));
        let (Some(own), Some(above)) = (model.nodes.get(half), model.nodes.get(joint)) else { continue };
        let Some(parent) = above.parent.filter(|_| own.parent == Some(joint) && !is_parent) else { continue };
        let rest = above.rest * own.rest;
        model.nodes[half].parent = Some(parent);
        model.nodes[half].rest = rest;
    }
}

/// Constraints that turn half joints and twist joints of a model as the rig does, for programs that pose the bones of a human
/// alone: a half joint takes its share of the rotation of its joint, a twist joint of the roll of the next bone. Joints
/// that take a twist back have none, because the format has no such constraint. `globals` are the nodes as they were bound.
pub fn node_constraints(model: &Model, globals: &[Trs], source: &AvatarSource) -> BTreeMap<usize, NodeConstraint> {
    let mut found = BTreeMap::new();
    let mut add = |node: usize, constraint: ConstraintKind| {
        found.insert(node, NodeConstraint { spec_version: SPEC_VERSION.to_owned(), constraint });
    };
    let parent_of = |node: usize| model.nodes.get(node).and_then(|node| node.parent);
    for (half, joint, weight) in half_joints(source) {
        let (Some(own), Some(of_joint)) = (globals.get(half), globals.get(joint)) else { continue };
        let turned = own.rotation.inverse() * of_joint.rotation;
        if parent_of(half) == parent_of(joint) && turned.xyz().length() < ALIKE {
            add(half, ConstraintKind::Rotation { source: joint, weight });
        }
    }
    let places = source.places();
    let constraints = source.built.map_or(&[][..], |built| &built.constraints);
    for constraint in constraints {
        let Constraint::Twist { source: twisted, reference: None, axis, driven } = &*constraint.constraint else {
            continue;
        };
        let (Some(twisted), Some(roll_axis)) = (places.get(twisted), nearest_axis(*axis)) else { continue };
        for (node, share) in driven {
            let (Some(node), Scalar::Value(weight)) = (places.get(node), share) else { continue };
            let is_beside = node != twisted && parent_of(*node) == parent_of(*twisted);
            if is_beside && *weight > 0.0 && *weight <= 1.0 {
                add(*node, ConstraintKind::Roll { source: *twisted, roll_axis, weight: *weight });
            }
        }
    }
    found
}

/// Half joints with the joint that each is made for, and their shares.
fn half_joints(source: &AvatarSource) -> Vec<(usize, usize, f32)> {
    let places = source.places();
    let Some(built) = source.built else { return Vec::new() };
    let made: BTreeMap<Uid, Uid> = built
        .nodes
        .iter()
        .filter_map(|node| {
            let origin = node.origin.as_ref().filter(|origin| *origin.role == *HALF)?;
            Some((node.uid, origin.subject))
        })
        .collect();
    let half = |constraint: &Constraint| {
        let Constraint::Transform { driven, targets, .. } = constraint else { return None };
        let joint = made.get(driven)?;
        let share = targets.iter().find(|target| target.node == *joint).map(|target| &target.weight)?;
        let Scalar::Value(share) = share else { return None };
        Some((*places.get(driven)?, *places.get(joint)?, *share))
    };
    built.constraints.iter().filter_map(|constraint| half(&constraint.constraint)).collect()
}

/// Axis of a node that lies along a direction in its space.
fn nearest_axis(direction: Vec3) -> Option<RollAxis> {
    let along = direction.normalize_or_zero().abs();
    [(along.x, RollAxis::X), (along.y, RollAxis::Y), (along.z, RollAxis::Z)]
        .into_iter()
        .find_map(|(cosine, axis)| (cosine >= ALONG).then_some(axis))
}
