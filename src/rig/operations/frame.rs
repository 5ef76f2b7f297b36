//! Frames of pose offsets: the effect of an offset in the rig's space, so that it can be expressed in other axes.

use bevy::math::{Affine3, Mat3, Quat, Vec3};

use crate::rig::{BuiltRig, PoseOffset, Rig, Uid, animation::Property};

/// Largest difference by rounding between equal numbers.
const ROUNDING: f32 = 1e-6;

/// Meaning of a joint's pose offset in the rig's space, at rest.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Frame {
    /// Map of the offset's translation to the rig's space.
    linear: Mat3,
    /// Axes of rotation and scale: orthonormal, left-handed if an ancestor's scale is negative.
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

    /// The frame of a built node at its base; `None` for an unknown one.
    pub fn built(built: &BuiltRig, node: Uid) -> Option<Self> {
        let found = built.node(node)?;
        let mut parent = Affine3::IDENTITY;
        let mut above = found.parent;
        // Parents have smaller numbers, so this ends.
        while let Some(node) = above.and_then(|above| built.nodes.get(above)) {
            let base =
                Affine3::from_scale_rotation_translation(node.base.scale, node.base.rotation, node.base.translation);
            parent = base * parent;
            above = node.parent.filter(|next| above.is_some_and(|above| *next < above));
        }
        let turned = parent.matrix3 * Mat3::from_quat(found.base.rotation);
        Some(Self { linear: turned * Mat3::from_diagonal(found.base.scale), axes: orthonormal(turned) })
    }

    /// The value of one property of an offset, or a tangent of it, in the frame `there`: see [`Self::carried`].
    pub fn carried_value(
        &self,
        property: &Property,
        value: [f32; 4],
        there: &Self,
        change: Mat3,
        is_tangent: bool,
    ) -> [f32; 4] {
        let vector = Vec3::new(value[0], value[1], value[2]);
        let bridge = there.axes.transpose() * change * self.axes;
        let list = |vector: Vec3, last: f32| [vector.x, vector.y, vector.z, last];
        match property {
            Property::Translation => {
                let carried = there.linear.inverse() * (change * (self.linear * vector));
                list(if carried.is_finite() { carried } else { Vec3::ZERO }, 0.0)
            }
            Property::Rotation => {
                let turned = bridge * vector * bridge.determinant().signum();
                let rotation = Quat::from_xyzw(turned.x, turned.y, turned.z, value[3]);
                if is_tangent { rotation.to_array() } else { rotation.normalize().to_array() }
            }
            Property::Scale => {
                let share = |row: Vec3| (row * row * vector).element_sum();
                let even = vector.max_element() - vector.min_element() <= ROUNDING;
                let carried = Vec3::new(share(bridge.row(0)), share(bridge.row(1)), share(bridge.row(2)));
                list(if even { vector } else { carried }, 0.0)
            }
            Property::Attribute(_) => value,
        }
    }

    /// Returns `true` if offsets mean the same in both frames but for rounding.
    pub fn is_like(&self, there: &Self) -> bool {
        self.linear.abs_diff_eq(there.linear, 1e-5) && self.axes.abs_diff_eq(there.axes, 1e-5)
    }

    /// The offset in the frame `there` with the effect of `offset` in this frame, mapped by `change`: a rotation or a
    /// reflection of the rig's space.
    pub fn carried(&self, offset: &PoseOffset, there: &Self, change: Mat3) -> PoseOffset {
        let translation = there.linear.inverse() * (change * (self.linear * offset.translation));
        // Each reflection reverses the axis of a rotation.
        let bridge = there.axes.transpose() * change * self.axes;
        let turned = bridge * offset.rotation.xyz() * bridge.determinant().signum();
        let rotation = Quat::from_xyzw(turned.x, turned.y, turned.z, offset.rotation.w).normalize();
        // Factors along axes that are parallel to none of the other frame's are approximated by its axes.
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
