//! Degrees of freedom of a control: the channels that a pose may use, and their limits.

use bevy::math::{Quat, Vec3};

use crate::{
    rig::{AngleLimits, Channels, ControlData, Limits, PoseOffset},
    solve::{limit::Bounds, rotate::EulerOrder},
};

/// Bounds of a pose offset, channel by channel. A locked channel has both bounds at its value at rest.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Freedom {
    /// Units of the parent.
    translate: Bounds,
    /// Radians, angles about X, Y and Z in that order.
    rotate: Bounds,
    scale: Bounds,
}

impl Freedom {
    /// The freedom of a control; `None` if nothing is locked or limited.
    pub(super) fn of(control: &ControlData) -> Option<Self> {
        if control.channels == Channels::default() && control.limits == Limits::default() {
            return None;
        }
        let bounds = |free: [bool; 3], ends: AngleLimits, at_rest: f32| {
            let end = |axis: usize, end: Option<f32>| if free[axis] { end } else { Some(at_rest) };
            let (low, high) = (ends.map(|ends| ends.0), ends.map(|ends| ends.1));
            Bounds::new(
                std::array::from_fn(|axis| end(axis, low[axis])),
                std::array::from_fn(|axis| end(axis, high[axis])),
            )
        };
        let radians = control.limits.rotate.map(|(low, high)| (low.map(f32::to_radians), high.map(f32::to_radians)));
        Some(Self {
            translate: bounds(control.channels.translate, control.limits.translate, 0.0),
            rotate: bounds(control.channels.rotate, radians, 0.0),
            scale: bounds(control.channels.scale, control.limits.scale, 1.0),
        })
    }

    /// The nearest offset within the bounds; one within them comes back as it is.
    pub(super) fn clamp(&self, offset: PoseOffset) -> PoseOffset {
        let rotation = if self.rotate.min == Vec3::ZERO && self.rotate.max == Vec3::ZERO {
            Quat::IDENTITY
        } else if self.rotate == Bounds::NONE {
            offset.rotation
        } else {
            self.rotate.clamp_rotation(offset.rotation, EulerOrder::Xyz)
        };
        PoseOffset {
            translation: self.translate.clamp(offset.translation),
            rotation,
            scale: self.scale.clamp(offset.scale),
        }
    }
}
