//! The solvers of the runtime.

mod chains;
mod expressions;
mod foot;
mod limbs;
mod motion;
mod turns;

use bevy::math::{Quat, Vec3};

/// Seeded numbers.
struct Random(u64);

impl Random {
    fn unit(&mut self) -> f32 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 40) as f32 / (1 << 24) as f32
    }

    fn between(&mut self, low: f32, high: f32) -> f32 {
        low + (high - low) * self.unit()
    }

    /// In a box from -1 to 1.
    fn point(&mut self) -> Vec3 {
        Vec3::new(self.between(-1.0, 1.0), self.between(-1.0, 1.0), self.between(-1.0, 1.0))
    }

    fn direction(&mut self) -> Vec3 {
        loop {
            let v = self.point();
            if (0.01..1.0).contains(&v.length_squared()) {
                return v.normalize();
            }
        }
    }

    fn rotation(&mut self) -> Quat {
        Quat::from_axis_angle(self.direction(), self.between(-3.1, 3.1))
    }
}

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
