//! Limits of translations, rotations and scales.

use std::f32::consts::{PI, TAU};

use bevy::math::{Quat, Vec3, ops};

use crate::solve::{
    rotate::{EulerOrder, about, direction, unit},
    twist::{swing_twist, twist_angle},
};

/// Bounds for each axis; an infinite bound does not limit. Where the minimum exceeds the maximum, the minimum counts.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Bounds {
    /// The least values.
    pub min: Vec3,
    /// The greatest values.
    pub max: Vec3,
}

impl Default for Bounds {
    fn default() -> Self {
        Self::NONE
    }
}

impl Bounds {
    /// Bounds that limit nothing.
    pub const NONE: Self = Self { min: Vec3::NEG_INFINITY, max: Vec3::INFINITY };

    /// Bounds from optional values per axis.
    pub fn new(min: [Option<f32>; 3], max: [Option<f32>; 3]) -> Self {
        let or = |value: [Option<f32>; 3], none: f32| Vec3::from(value.map(|v| v.unwrap_or(none)));
        Self { min: or(min, f32::NEG_INFINITY), max: or(max, f32::INFINITY) }
    }

    /// The nearest translation or scale within the bounds. A value that is not a number counts as zero; a bound that is
    /// not a number does not limit.
    #[inline]
    pub fn clamp(&self, value: Vec3) -> Vec3 {
        let value = Vec3::select(value.is_nan_mask(), Vec3::ZERO, value);
        Vec3::new(
            clamp(value.x, self.min.x, self.max.x),
            clamp(value.y, self.min.y, self.max.y),
            clamp(value.z, self.min.z, self.max.z),
        )
    }

    /// The rotation with its Euler angles within the bounds (in radians).
    ///
    /// Of the two triples of angles that make a rotation, and of angles that differ by a turn, the solver takes those
    /// that lie furthest within the bounds, so a knee may bend by 150° about any axis of the order. A rotation within
    /// its bounds is returned unchanged.
    pub fn clamp_rotation(&self, rotation: Quat, order: EulerOrder) -> Quat {
        let rotation = unit(rotation);
        let angles = order.angles(rotation);
        let (first, outside) = self.nearest(angles);
        let (second, outside_second) = self.nearest(order.other(angles));
        let (angles, outside) =
            if outside_second < outside - 1e-4 { (second, outside_second) } else { (first, outside) };
        let clamped = order.rotation(self.clamp(angles));
        if outside <= 0.0 || !clamped.is_finite() { rotation } else { clamped }
    }

    /// Angles shifted by whole turns to where they exceed the bounds least, and the sum of these excesses.
    fn nearest(&self, angles: Vec3) -> (Vec3, f32) {
        let mut nearest = angles;
        let mut sum = 0.0;
        for axis in 0..3 {
            let outside = |angle: f32| (angle - clamp(angle, self.min[axis], self.max[axis])).abs();
            for turned in [angles[axis] - TAU, angles[axis] + TAU, angles[axis] - 2.0 * TAU] {
                if outside(turned) < outside(nearest[axis]) {
                    nearest[axis] = turned;
                }
            }
            sum += outside(nearest[axis]);
        }
        (nearest, sum)
    }
}

#[inline]
fn clamp(value: f32, min: f32, max: f32) -> f32 {
    // Comparisons instead of `clamp`: they handle NaN, and `clamp` panics where bounds cross.
    let value = if value > max { max } else { value };
    if value < min { min } else { value }
}

/// Range of a joint's rotation from its rest rotation.
#[derive(Debug, Clone, Copy, PartialEq, Default, serde::Serialize, serde::Deserialize)]
pub enum JointLimit {
    /// No limit.
    #[default]
    Free,
    /// Swing within a cone about an axis, and twist about that axis within bounds, as for hips and shoulders.
    Cone {
        /// The axis in the joint's own space, any length.
        axis: Vec3,
        /// The greatest swing in radians, 0 to half a turn.
        swing: f32,
        /// The least twist in radians, not over 0.
        twist_min: f32,
        /// The greatest twist in radians, not under 0.
        twist_max: f32,
    },
    /// Euler angles within bounds, as for knees and fingers; see [`Bounds::clamp_rotation`].
    Euler {
        /// The order of the angles.
        order: EulerOrder,
        /// Bounds in radians.
        bounds: Bounds,
    },
}

impl JointLimit {
    /// The nearest allowed rotation to `rotation`, which is relative to the joint's rest.
    pub fn clamp(&self, rotation: Quat) -> Quat {
        match *self {
            Self::Free => unit(rotation),
            Self::Euler { order, bounds } => bounds.clamp_rotation(rotation, order),
            Self::Cone { axis, swing, twist_min, twist_max } => {
                let rotation = unit(rotation);
                let Some(axis) = direction(axis) else { return rotation };
                let (swung, twisted) = swing_twist(rotation, axis);
                let swung = if swung.w < 0.0 { -swung } else { swung };
                let sin = swung.xyz().length();
                let angle = 2.0 * ops::atan2(sin, swung.w);
                let most = clamp(swing, 0.0, PI);
                let swung = match direction(swung.xyz()) {
                    Some(about_axis) if angle > most => about(about_axis, most),
                    _ => swung,
                };
                let angle = twist_angle(twisted, axis);
                let twist = clamp(angle, twist_min, twist_max);
                let twisted = if twist == angle { twisted } else { about(axis, twist) };
                (swung * twisted).normalize()
            }
        }
    }
}
