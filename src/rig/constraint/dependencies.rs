//! Dependencies of constraints: the nodes that they read and drive.

use std::sync::Arc;

use super::{AimUp, Constraint, Output, Scalar};
use crate::rig::Uid;

/// Data that a constraint depends on or changes.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Dependency {
    /// The final transform of a node.
    Node(Uid),
    /// The value of an attribute.
    Attribute(Uid, Arc<str>),
}

impl Constraint {
    /// Nodes and attributes that the constraint reads, besides the nodes that it drives and their parents; with
    /// repetitions.
    pub fn reads(&self) -> Vec<Dependency> {
        let mut reads = Vec::new();
        let scalar = |reads: &mut Vec<Dependency>, scalar: &Scalar| match scalar {
            Scalar::Attribute { node, name, .. } | Scalar::Choice { node, name, .. } => {
                reads.push(Dependency::Attribute(*node, name.clone()));
            }
            // A pose offset is an input: no constraint changes it.
            Scalar::Value(_) | Scalar::Channel { .. } => {}
        };
        match self {
            Self::Transform { targets, weight, .. } | Self::Aim { targets, weight, .. } => {
                for target in targets {
                    reads.push(Dependency::Node(target.node));
                    scalar(&mut reads, &target.weight);
                }
                scalar(&mut reads, weight);
                if let Self::Aim { world_up: AimUp::Node(node) | AimUp::Axis(node, _), .. } = self {
                    reads.push(Dependency::Node(*node));
                }
            }
            Self::Relative { source, space, weight, .. } => {
                reads.extend([*source, *space].map(Dependency::Node));
                scalar(&mut reads, weight);
            }
            Self::TwoBone { goal, pole, weight, soft, stretch, twist, pin, .. } => {
                reads.extend([Some(*goal), *pole].into_iter().flatten().map(Dependency::Node));
                [weight, soft, stretch, twist, pin].into_iter().for_each(|number| scalar(&mut reads, number));
            }
            Self::Chain { goal, pole, weight, .. } => {
                reads.extend([Some(*goal), *pole].into_iter().flatten().map(Dependency::Node));
                scalar(&mut reads, weight);
            }
            Self::Spline { points, stretch, twist, weight, .. } => {
                reads.extend(points.iter().copied().map(Dependency::Node));
                [stretch, twist, weight].into_iter().for_each(|number| scalar(&mut reads, number));
            }
            Self::Twist { source, reference, driven, .. } => {
                reads.extend([Some(*source), *reference].into_iter().flatten().map(Dependency::Node));
                driven.iter().for_each(|(_, share)| scalar(&mut reads, share));
            }
            Self::Stretch { start, end, volume, weight, .. } => {
                reads.extend([*start, *end].map(Dependency::Node));
                [volume, weight].into_iter().for_each(|number| scalar(&mut reads, number));
            }
            Self::Limit { .. } => {}
            Self::Spring { frequency, damping, weight, motion, colliders, .. } => {
                [frequency, damping, weight, motion].into_iter().for_each(|number| scalar(&mut reads, number));
                let nodes = colliders.iter().flat_map(|collider| [Some(collider.node), collider.end]);
                reads.extend(nodes.flatten().map(Dependency::Node));
            }
            Self::DrivenKey { driver, .. } => scalar(&mut reads, driver),
            Self::Expression { inputs, .. } => inputs.iter().for_each(|(_, number)| scalar(&mut reads, number)),
            Self::Foot { roll, break_angle, bank, toes, swivel, .. } => {
                [roll, break_angle, bank, swivel].into_iter().for_each(|number| scalar(&mut reads, number));
                toes.iter().for_each(|(_, number)| scalar(&mut reads, number));
            }
            Self::Cone { source, reference, .. }
            | Self::PoseReader { source, reference, .. }
            | Self::Travel { source, reference, .. } => {
                reads.extend([Some(*source), *reference].into_iter().flatten().map(Dependency::Node));
            }
            Self::Path { points, share, weight, .. } => {
                reads.extend(points.iter().copied().map(Dependency::Node));
                [share, weight].into_iter().for_each(|number| scalar(&mut reads, number));
            }
            Self::Rivet { corners, weight, .. } => {
                reads.extend(corners.map(Dependency::Node));
                scalar(&mut reads, weight);
            }
        }
        reads
    }

    /// Nodes and attributes that the constraint changes.
    pub fn drives(&self) -> Vec<Dependency> {
        let nodes = |nodes: &[Uid]| nodes.iter().copied().map(Dependency::Node).collect();
        match self {
            Self::Transform { driven, .. }
            | Self::Relative { driven, .. }
            | Self::Aim { driven, .. }
            | Self::Limit { driven, .. }
            | Self::Spring { driven, .. }
            | Self::Path { driven, .. }
            | Self::Rivet { driven, .. } => nodes(&[*driven]),
            Self::TwoBone { root, mid, end, .. } => nodes(&[*root, *mid, *end]),
            Self::Chain { joints, .. } | Self::Spline { joints, .. } => nodes(joints),
            Self::Twist { driven, .. } => driven.iter().map(|(node, _)| Dependency::Node(*node)).collect(),
            Self::Stretch { driven, .. } => nodes(driven),
            Self::DrivenKey { .. }
            | Self::Expression { .. }
            | Self::Cone { .. }
            | Self::PoseReader { .. }
            | Self::Travel { .. } => {
                let changed = |output: &Output| match output {
                    Output::Channel(node, _) => Some(Dependency::Node(*node)),
                    Output::Attribute(node, name) => Some(Dependency::Attribute(*node, name.clone())),
                    Output::Morph(_) => None,
                };
                self.outputs().filter_map(changed).collect()
            }
            Self::Foot { heel, toe, ball, inner, outer, toes, .. } => {
                let lifted = toes.as_ref().map(|(node, _)| *node);
                let all = [Some(*heel), Some(*toe), Some(*ball), *inner, *outer, lifted];
                all.into_iter().flatten().map(Dependency::Node).collect()
            }
        }
    }

    /// Destinations of the numbers that the constraint calculates.
    pub fn outputs(&self) -> impl Iterator<Item = &Output> {
        let (one, poses): (Option<&Output>, &[_]) = match self {
            Self::DrivenKey { output, .. }
            | Self::Expression { output, .. }
            | Self::Cone { output, .. }
            | Self::Travel { output, .. } => (Some(output), &[]),
            Self::PoseReader { poses, .. } => (None, poses),
            _ => (None, &[]),
        };
        one.into_iter().chain(poses.iter().map(|(_, output)| output))
    }
}
