//! The solvers of the runtime.

mod chains;
mod expressions;
mod foot;
mod limbs;
mod motion;
mod turns;

use bevy::math::Quat;

use crate::random::Random;

/// The angle between two rotations in radians; exact for small ones.
fn angle(a: Quat, b: Quat) -> f32 {
    let d = a.conjugate() * b;
    2.0 * d.xyz().length().atan2(d.w.abs())
}

/// Numbers that no input should hold, and some that are hard.
const HARD: [f32; 9] = [0.0, -0.0, 1e-30, 1e-7, 1.0, 1e30, f32::MAX, f32::INFINITY, f32::NAN];

fn is_unit(q: Quat) -> bool {
    (q.length() - 1.0).abs() < 1e-4
}
