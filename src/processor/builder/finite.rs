//! Places that commands write: they have to be ordinary numbers, even where joints are too far away or scaled to nothing.

use crate::{
    mesh::model::Trs,
    processor::{
        Builder, ModuleError,
        world::{Aspect, NodeId, Value},
    },
    rig::{AimUp, Constraint, Dependency, Target},
};

impl Builder {
    /// Refuses places that are no numbers, and constraints that close a circle; `place` is that after the command.
    pub(super) fn check_writes(
        &mut self,
        number: u32,
        writes: &[(NodeId, Aspect)],
        place: u32,
    ) -> Result<(), ModuleError> {
        let lost = writes.iter().find_map(|(node, aspect)| match self.own(number, *node, *aspect)? {
            Value::Base(base) if !is_finite(base) => Some(*node),
            // A constraint of a number has no node of its own.
            Value::Constraint(_, constraint) if !has_finite_places(constraint) => {
                let driven =
                    constraint.drives().first().map(|(Dependency::Node(uid) | Dependency::Attribute(uid, _))| *uid);
                Some(driven.and_then(|uid| self.world.id(uid)).unwrap_or(*node))
            }
            _ => None,
        });
        if let Some(node) = lost {
            return Err(ModuleError::other(format!(
                "{} would stand at no place that can be reckoned with; bring joints that are too far away nearer, and \
                 give those that are scaled to nothing or beyond measure a size",
                self.world.name(node, place)
            )));
        }
        self.check_loops(writes, place)
    }
}

fn is_finite(trs: &Trs) -> bool {
    trs.translation.is_finite() && trs.rotation.is_finite() && trs.scale.is_finite()
}

/// True if what a constraint keeps of the places of nodes are ordinary numbers.
fn has_finite_places(constraint: &Constraint) -> bool {
    let are_finite = |targets: &[Target]| targets.iter().all(|target| is_finite(&target.offset));
    match constraint {
        Constraint::Transform { targets, .. } => are_finite(targets),
        Constraint::Aim { targets, aim, up, world_up, offset, .. } => {
            let is_up_finite = match world_up {
                AimUp::Direction(direction) | AimUp::Axis(_, direction) => direction.is_finite(),
                AimUp::Node(_) => true,
            };
            are_finite(targets) && aim.is_finite() && up.is_finite() && offset.is_finite() && is_up_finite
        }
        Constraint::TwoBone { prefer, orient_end, .. } => {
            prefer.is_finite() && orient_end.is_none_or(|rotation| rotation.is_finite())
        }
        Constraint::Chain { orient_end, .. } => orient_end.is_none_or(|rotation| rotation.is_finite()),
        Constraint::Twist { axis, .. } => axis.is_finite(),
        Constraint::Stretch { rest, axis, .. } => rest.is_finite() && axis.is_finite(),
        Constraint::Cone { axis, towards, .. } => axis.is_finite() && towards.is_finite(),
        Constraint::PoseReader { poses, .. } => poses.iter().all(|(rotation, _)| rotation.is_finite()),
        Constraint::Travel { axis, factor, .. } => axis.is_finite() && factor.is_finite(),
        Constraint::Path { aim, up, .. } => {
            up.is_finite() && aim.is_none_or(|axes| axes.iter().all(|axis| axis.is_finite()))
        }
        Constraint::Rivet { shares, offset, .. } => is_finite(offset) && shares.iter().all(|share| share.is_finite()),
        Constraint::Relative { .. }
        | Constraint::Spline { .. }
        | Constraint::Limit { .. }
        | Constraint::Spring { .. }
        | Constraint::DrivenKey { .. }
        | Constraint::Expression { .. }
        | Constraint::Foot { .. } => true,
    }
}
