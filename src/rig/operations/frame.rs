//! What a pose's offset does, told in the rig's space, so that other axes can do the same.

use bevy::math::{Affine3, Mat3, Quat, Vec3};

use crate::rig::{PoseOffset, Rig, Uid};

/// Numbers this close are equal but for rounding.
const ROUNDING: f32 = 1e-6;

/// How the numbers of a joint's offset are meant in the rig's space, at rest.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Frame {
    /// Takes the offset's translation to the rig's space.
    linear: Mat3,
    /// The axes that rotation and scale are about: orthonormal, left-handed where an ancestor's scale is negative.
    axes: Mat3,
}

impl Frame {
    /// The frame of a joint; the rig's own for an unknown one.
    pub fn of(rig: &Rig, joint: Uid) -> Self {
        let Some(found) = rig.joint(joint) else { return Self { linear: Mat3::IDENTITY, axes: Mat3::IDENTITY } };
        let parent = found.parent.map_or(Affine3::IDENTITY, |parent| rig.rest_global(parent));
        let turned = parent.matrix3 * Mat3::from_quat(found.data.rest.rotation);
        Self { linear: turned * Mat3::from_diagonal(found.data.rest.scale), axes: orthonormal(turned) }
    }

    /// True if offsets mean the same here and there but for rounding.
    pub fn is_like(&self, there: &Self) -> bool {
        self.linear.abs_diff_eq(there.linear, 1e-5) && self.axes.abs_diff_eq(there.axes, 1e-5)
    }

    /// The offset that does at `there` what `offset` does here, taken to the other place by `change`: a rotation or a
    /// reflection of the rig's space.
    pub fn carried(&self, offset: &PoseOffset, there: &Self, change: Mat3) -> PoseOffset {
        let translation = there.linear.inverse() * (change * (self.linear * offset.translation));
        // An axis of rotation is turned the other way round by every reflection it passes.
        let bridge = there.axes.transpose() * change * self.axes;
        let turned = bridge * offset.rotation.xyz() * bridge.determinant().signum();
        let rotation = Quat::from_xyzw(turned.x, turned.y, turned.z, offset.rotation.w).normalize();
        // Factors along axes that are parallel to none over there are told as well as those axes can.
        let share = |row: Vec3| (row * row * offset.scale).element_sum();
        let scale = Vec3::new(share(bridge.row(0)), share(bridge.row(1)), share(bridge.row(2)));
        let even = offset.scale.max_element() - offset.scale.min_element() <= ROUNDING;
        let carried = PoseOffset {
            translation: if translation.is_finite() { translation } else { Vec3::ZERO },
            rotation,
            scale: if even { offset.scale } else { scale },
        };
        if carried.is_rest(ROUNDING) { PoseOffset::IDENTITY } else { carried }
    }
}

/// The axes of a matrix without scale and shear, the first kept in its direction; handedness stays.
fn orthonormal(matrix: Mat3) -> Mat3 {
    let Some(x) = matrix.x_axis.try_normalize() else { return Mat3::IDENTITY };
    let Some(y) = (matrix.y_axis - x * x.dot(matrix.y_axis)).try_normalize() else { return Mat3::IDENTITY };
    let hand = if matrix.determinant() < 0.0 { -1.0 } else { 1.0 };
    Mat3::from_cols(x, y, x.cross(y) * hand)
}
