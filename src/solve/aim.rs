//! Aiming: a rotation that points one axis at a target and keeps another one up.

use bevy::math::{Quat, Vec3};

use crate::solve::rotate::{between_frames, direction, perpendicular_or_any, unit};

/// Direction that the up axis of an aimed joint turns to.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Up {
    /// The current direction of the up axis, as far as the aim allows.
    Keep,
    /// A direction in the rig's space, any length.
    Vector(Vec3),
    /// The direction from the joint to a point in the rig's space.
    Point(Vec3),
}

/// An aim constraint: the local axes, any length.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Aim {
    /// The axis of the joint that points at the target.
    pub axis: Vec3,
    /// The axis of the joint that turns up.
    pub up_axis: Vec3,
}

impl Default for Aim {
    /// Y along the bone and Z up.
    fn default() -> Self {
        Self { axis: Vec3::Y, up_axis: Vec3::Z }
    }
}

impl Aim {
    /// The rotation (rig space) of a joint at `position`, now turned by `current`, that aims at `target`.
    ///
    /// With the target on the joint, or input that is not finite, the result is `current`. An up direction in line with
    /// the aim counts as [`Up::Keep`]; if the current up axis is in line, too, any perpendicular direction is used. An
    /// aim axis without length counts as Y; the up axis is used as far as it is perpendicular to the aim axis.
    #[inline]
    pub fn solve(&self, position: Vec3, target: Vec3, up: Up, current: Quat) -> Quat {
        let current = unit(current);
        let Some(aim) = direction(target - position) else { return current };
        let axis = direction(self.axis).unwrap_or(Vec3::Y);
        let up_axis = perpendicular_or_any(axis, &[self.up_axis]);
        let wanted = match up {
            Up::Keep => Vec3::ZERO,
            Up::Vector(vector) => vector,
            Up::Point(point) => point - position,
        };
        // The last candidate is the previous aim axis: perpendicular whenever the current up axis is not.
        let up = perpendicular_or_any(aim, &[wanted, current * up_axis, current * axis]);
        between_frames([axis, up_axis], [aim, up])
    }
}
