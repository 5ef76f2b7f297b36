//! Twist: the part of a rotation about one axis, and shares of it for twist joints.

use std::f32::consts::{PI, TAU};

use bevy::math::{Quat, Vec3, ops};

use crate::solve::rotate::{about, direction, unit};

/// Splits a rotation into `(swing, twist)` with `rotation = swing * twist`: the twist is about `axis` (any length), the
/// swing about an axis perpendicular to it.
///
/// For a swing of half a turn or an axis without length the twist is undetermined; it is then the identity.
#[inline]
pub fn swing_twist(rotation: Quat, axis: Vec3) -> (Quat, Quat) {
    let rotation = unit(rotation);
    let Some(axis) = direction(axis) else { return (rotation, Quat::IDENTITY) };
    let along = axis * rotation.xyz().dot(axis);
    let twist = Quat::from_xyzw(along.x, along.y, along.z, rotation.w);
    let length = twist.length_squared();
    if length < 1e-12 {
        return (rotation, Quat::IDENTITY);
    }
    let twist = twist * (1.0 / length.sqrt());
    ((rotation * twist.conjugate()).normalize(), twist)
}

/// The angle of a rotation's twist about `axis` in radians, from minus half a turn to half a turn.
///
/// A rotation holds no more than that: at half a turn the angle jumps to the other sign. Where a limb is to twist
/// further, keep the last angle and pass it to [`unwrap_angle`].
#[inline]
pub fn twist_angle(rotation: Quat, axis: Vec3) -> f32 {
    let rotation = unit(rotation);
    let Some(axis) = direction(axis) else { return 0.0 };
    let (sin, cos) = (rotation.xyz().dot(axis), rotation.w);
    if sin * sin + cos * cos < 1e-12 {
        return 0.0;
    }
    let angle = 2.0 * if cos < 0.0 { ops::atan2(-sin, -cos) } else { ops::atan2(sin, cos) };
    angle.clamp(-PI, PI)
}

/// The angle nearest to `previous` that differs from `angle` by whole turns, in radians. An angle that is unwrapped
/// each frame counts turns, as long as it moves by less than half a turn a frame.
#[inline]
pub fn unwrap_angle(angle: f32, previous: f32) -> f32 {
    if !(angle.is_finite() && previous.is_finite()) {
        return if angle.is_finite() { angle } else { 0.0 };
    }
    angle + TAU * ((previous - angle) / TAU).round()
}

/// The share `t` of a rotation's twist about `axis`: 0 none, 1 all of it, negative the other way.
#[inline]
pub fn twist_share(rotation: Quat, axis: Vec3, t: f32) -> Quat {
    let angle = twist_angle(rotation, axis) * t;
    direction(axis).filter(|_| angle.is_finite()).map_or(Quat::IDENTITY, |axis| about(axis, angle))
}

/// Divides a twist of `angle` radians among a chain of twist joints: the local twist about `axis` (any length) that
/// each joint adds to the one above, so that joint `i` of `count` is twisted by `(i + 1) / count` of the angle.
#[inline]
pub fn twist_step(axis: Vec3, angle: f32, count: usize) -> Quat {
    let step = angle / count.max(1) as f32;
    direction(axis).filter(|_| step.is_finite()).map_or(Quat::IDENTITY, |axis| about(axis, step))
}
