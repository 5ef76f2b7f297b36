//! Operations on the joints that are selected when a request is carried out.

use bevy::prelude::*;

use super::{ChangeError, Selection};
use crate::{
    algo::view::ViewPlane,
    rig::{
        Rig, Uid,
        operations::{Axis, Operation},
    },
};

/// Operation of a [`Change::OperateSelected`](super::Change::OperateSelected). Points are on a view plane, at the depth of the
/// active joint.
#[derive(Debug, Clone, PartialEq)]
pub enum SelectionOperation {
    /// Movement of the active joint to a point of the plane; its children stay.
    MoveAlong(ViewPlane, Vec2),
    /// Movement of the active joint to a place of the rig's space; its children stay.
    MoveTo(Vec3),
    /// Rotation of the selected joints about the active one, with their hierarchies.
    Rotate(Quat),
    /// Scale of the selected joints about the active one, with their hierarchies.
    Scale(f32),
    /// Joint in the bone above the active joint, at a point of the plane.
    Insert(ViewPlane, Vec2),
    /// Deletion of the selected joints; with `keep_children`, their children move up.
    Delete {
        /// True to keep the children.
        keep_children: bool,
    },
    /// Parent of all selected joints but the active one: the active joint.
    Parent,
    /// Roots in place of the selected joints.
    Unparent,
    /// Orientation of the selected joints, with this axis along their bone.
    Orient(Axis),
    /// Other side of the selected joints and of their hierarchies.
    Mirror,
}

impl SelectionOperation {
    /// The operation on a rig of which joints are selected; `None` without an active one.
    pub(in crate::plugins) fn on(&self, rig: &Rig, selection: &Selection) -> Option<Operation> {
        let active = selection.active()?;
        let (joints, here) = (selection.0.clone(), rig.position(active));
        // A drag in an orthographic view keeps the depth.
        let at_depth_of_active = |plane: &ViewPlane, at: Vec2| {
            let delta = at - plane.project(here).unwrap_or_default();
            here + plane.right * delta.x + plane.up * delta.y
        };
        Some(match self {
            Self::MoveAlong(plane, at) => {
                Operation::Move { to: vec![(active, at_depth_of_active(plane, *at))], with_children: false }
            }
            Self::MoveTo(to) => Operation::Move { to: vec![(active, *to)], with_children: false },
            Self::Rotate(rotation) => {
                Operation::Rotate { joints, rotation: *rotation, pivot: Some(here), with_children: true }
            }
            Self::Scale(factor) => Operation::Scale {
                joints,
                scale: Vec3::splat(*factor),
                axes: Quat::IDENTITY,
                pivot: Some(here),
                with_children: true,
            },
            Self::Insert(plane, at) => Operation::Insert { child: active, position: at_depth_of_active(plane, *at) },
            Self::Delete { keep_children } => Operation::Delete { joints, keep_children: *keep_children },
            Self::Parent => {
                let joints = joints.into_iter().filter(|joint| *joint != active).collect();
                Operation::Reparent { joints, parent: Some(active) }
            }
            Self::Unparent => Operation::Reparent { joints, parent: None },
            Self::Orient(along) => Operation::Orient { joints, along: *along },
            Self::Mirror => Operation::Mirror { joints },
        })
    }
}

/// Operation that names the joints of the chain that ends at a joint, first to last.
///
/// # Errors
/// [`ChangeError::LongChain`] for more names than the chain has joints.
pub(in crate::plugins) fn chain_labels(rig: &Rig, end: Uid, names: &[String]) -> Result<Operation, ChangeError> {
    let upwards = std::iter::once(end).chain(rig.ancestors(end).map(|joint| joint.data.uid));
    let chain: Vec<Uid> = upwards.take(names.len()).collect();
    if chain.len() < names.len() {
        return Err(ChangeError::LongChain { names: names.len(), joints: chain.len() });
    }
    Ok(Operation::Labels(chain.into_iter().rev().zip(names.iter().cloned()).collect()))
}
