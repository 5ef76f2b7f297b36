//! The point of a triangle nearest to a point.

use glam::Vec3;

/// Barycentric coordinates of the point of the triangle nearest to `point` (Ericson, "Real-Time Collision Detection",
/// section 5.1.5): the region of the plane decides whether a corner, an edge or the face is nearest. A triangle without
/// an area counts as its edges.
pub(super) fn barycentric(point: Vec3, [a, b, c]: [Vec3; 3]) -> Vec3 {
    let (ab, ac, bc) = (b - a, c - a, c - b);
    let (to_a, to_b, to_c) = (point - a, point - b, point - c);
    let (b_along_ab, c_along_ac) = (ab.dot(to_a), ac.dot(to_a));
    if b_along_ab <= 0.0 && c_along_ac <= 0.0 {
        return Vec3::X;
    }
    let (past_b, c_from_b) = (ab.dot(to_b), ac.dot(to_b));
    if past_b >= 0.0 && c_from_b <= past_b {
        return Vec3::Y;
    }
    let (b_from_c, past_c) = (ab.dot(to_c), ac.dot(to_c));
    if past_c >= 0.0 && b_from_c <= past_c {
        return Vec3::Z;
    }
    // Signed areas opposite the corners, times the triangle's own.
    let w = b_along_ab * c_from_b - past_b * c_along_ac;
    let v = b_from_c * c_along_ac - b_along_ab * past_c;
    let u = past_b * past_c - b_from_c * c_from_b;
    let total = u + v + w;
    if u > 0.0 && v > 0.0 && w > 0.0 && total.is_finite() {
        return Vec3::new(u, v, w) / total;
    }
    let edges = [(fraction(to_a, ab), [0, 1]), (fraction(to_a, ac), [0, 2]), (fraction(to_b, bc), [1, 2])];
    let mut best = (f32::INFINITY, Vec3::X);
    for (t, [from, to]) in edges {
        let mut weights = Vec3::ZERO;
        weights[from] += 1.0 - t;
        weights[to] += t;
        let distance = at(weights, [a, b, c]).distance_squared(point);
        if distance < best.0 {
            best = (distance, weights);
        }
    }
    best.1
}

/// The point with the barycentric coordinates `weights`.
pub(super) fn at(weights: Vec3, [a, b, c]: [Vec3; 3]) -> Vec3 {
    a * weights.x + b * weights.y + c * weights.z
}

/// Position of the foot of `offset` along `edge`, from 0 to 1.
fn fraction(offset: Vec3, edge: Vec3) -> f32 {
    let length = edge.length_squared();
    if length > 0.0 { (offset.dot(edge) / length).clamp(0.0, 1.0) } else { 0.0 }
}
