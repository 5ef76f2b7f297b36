//! Posing with gizmos: conversion of rotations and movements in the rig's space to offsets from rest.

use bevy::{
    math::{Affine3, Mat3, Quat, Vec3, ops},
    prelude::*,
};

use super::{gizmo::Delta, scene::EditedRig};
use crate::rig::{PoseOffset, RestTransform, Uid};

/// A joint or control in its pose at the start of a drag.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PosedJoint {
    /// The joint.
    pub joint: Uid,
    rest: RestTransform,
    offset: PoseOffset,
    /// Posed transform from the parent's space to the rig's.
    parent: Affine3,
    /// Posed axes of the joint in the rig's space.
    axes: [Vec3; 3],
    /// Marks a joint below another dragged one, which moves it along.
    carried: bool,
}

impl PosedJoint {
    /// Collects the current poses of joints and controls: those of the running program where the rig is built, else those
    /// of the document. Nodes that are in neither, or cannot be posed, are left out.
    pub fn gather(rig: &EditedRig, joints: &[Uid]) -> Vec<Self> {
        let posed = |&joint: &Uid| {
            if let Some((state, slot)) = rig.built_slot(joint) {
                let nodes = state.program().nodes();
                let node = &nodes[slot];
                let above = std::iter::successors(node.parent, |above| nodes[*above].parent);
                let mut above = above.map(|above| nodes[above].uid);
                return node.is_posable().then(|| Self {
                    joint,
                    rest: node.base.into(),
                    offset: state.offset_at(slot),
                    parent: node.parent.map_or(Affine3::IDENTITY, |parent| state.global_at(parent).affine().into()),
                    axes: own_axes(&state.global_at(slot).affine().into()),
                    carried: above.any(|above| joints.contains(&above)),
                });
            }
            let found = rig.rig.joint(joint)?;
            Some(Self {
                joint,
                rest: found.data.rest,
                offset: rig.shown_offset(joint).unwrap_or_default(),
                parent: found.parent.map_or(Affine3::IDENTITY, |parent| rig.posed_global(parent)),
                axes: own_axes(&rig.posed_global(joint)),
                carried: rig.rig.ancestors(joint).any(|above| joints.contains(&above.data.uid)),
            })
        };
        joints.iter().filter_map(posed).collect()
    }

    /// The joint's offset after a drag. Every joint turns about itself, about its own axis number `own` if given;
    /// joints below a dragged one are moved by it already.
    pub fn dragged(&self, delta: &Delta, own: Option<usize>) -> PoseOffset {
        match delta {
            Delta::Turn { axis, angle } => {
                let axis = own.map_or(*axis, |own| self.axes[own]);
                PoseOffset { rotation: self.turned(self.parent.matrix3, axis, *angle), ..self.offset }
            }
            Delta::Move(by) if !self.carried => {
                let turned = Affine3::from_scale_rotation_translation(self.rest.scale, self.rest.rotation, Vec3::ZERO);
                let moved = (self.parent.matrix3 * turned.matrix3).inverse() * *by;
                let translation = self.offset.translation + if moved.is_finite() { moved } else { Vec3::ZERO };
                PoseOffset { translation, ..self.offset }
            }
            Delta::Move(_) | Delta::Scale(_) => self.offset,
        }
    }

    /// The joint's offset after the joints above have turned it by `carried`, and itself by `turn` beyond; both in the rig's
    /// space.
    pub fn carried(&self, carried: Quat, turn: Quat) -> PoseOffset {
        let sine = turn.xyz().length();
        let Some(axis) = turn.xyz().try_normalize() else { return self.offset };
        let angle = 2.0 * ops::atan2(sine, turn.w);
        let linear = Mat3::from_quat(carried) * self.parent.matrix3;
        PoseOffset { rotation: self.turned(linear, axis, angle), ..self.offset }
    }

    /// Rotation of the offset after a turn about an axis in the rig's space, below a parent with the matrix `linear`.
    fn turned(&self, linear: Mat3, axis: Vec3, angle: f32) -> Quat {
        // A mirrored parent reverses the rotation.
        let angle = if linear.determinant() < 0.0 { -angle } else { angle };
        let Some(axis) = (linear.inverse() * axis).try_normalize() else { return self.offset.rotation };
        let local = (self.rest.rotation * self.offset.rotation).normalize();
        (self.rest.rotation.inverse() * (Quat::from_axis_angle(axis, angle) * local)).normalize()
    }
}

/// The axes of a transform: unit length, perpendicular, right-handed, the first one kept in its direction.
pub fn own_axes(global: &Affine3) -> [Vec3; 3] {
    let columns = global.matrix3;
    let x = columns.x_axis.normalize_or(Vec3::X);
    let aside = columns.y_axis - x * x.dot(columns.y_axis);
    let y = aside.try_normalize().unwrap_or_else(|| x.any_orthonormal_vector());
    [x, y, x.cross(y)]
}
