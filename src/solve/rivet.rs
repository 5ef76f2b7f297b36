//! Rivets: frames that ride on a triangle.

use bevy::math::{Mat3, Quat, Vec3};

use crate::solve::rotate::direction;

/// Frame of a triangle: X along its first side, Z along its normal.
///
/// `shares` are those of the corners in the frame's origin. `None` for a triangle without area.
pub fn triangle_frame(corners: [Vec3; 3], shares: [f32; 3]) -> Option<(Vec3, Quat)> {
    let [a, b, c] = corners;
    let x = direction(b - a)?;
    let normal = (b - a).cross(c - a);
    let z = direction(normal).filter(|_| normal.length() > 1e-12 * (b - a).length_squared())?;
    let origin = corners.iter().zip(shares).map(|(corner, share)| *corner * share).sum();
    Some((origin, Quat::from_mat3(&Mat3::from_cols(x, z.cross(x), z)).normalize()))
}

/// Shares of the corners in the foot of a point on the plane of a triangle; their sum is 1. `None` for a triangle
/// without area.
pub fn corner_shares([a, b, c]: [Vec3; 3], point: Vec3) -> Option<[f32; 3]> {
    let normal = (b - a).cross(c - a);
    let area = normal.length_squared();
    if area.is_nan() || area <= 0.0 || !area.is_finite() {
        return None;
    }
    let second = (point - a).cross(c - a).dot(normal) / area;
    let third = (b - a).cross(point - a).dot(normal) / area;
    Some([1.0 - second - third, second, third])
}
