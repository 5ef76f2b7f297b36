//! Sample points spread evenly over a surface.

use glam::Vec3;

/// Number of points.
const SAMPLES: usize = 2000;

/// Points spread evenly over the area of triangles, the same every time.
///
/// Equal steps along the summed area choose the triangles, a sequence of low discrepancy the places within. Corners have
/// to exist. Empty if the triangles have no area.
pub fn over(points: &[Vec3], triangles: &[[u32; 3]]) -> Vec<Vec3> {
    let corners = |triangle: &[u32; 3]| triangle.map(|corner| points[corner as usize]);
    let area = |triangle: &[u32; 3]| {
        let [a, b, c] = corners(triangle);
        f64::from((b - a).cross(c - a).length())
    };
    let total: f64 = triangles.iter().map(area).sum();
    if !(total > 0.0 && total.is_finite()) {
        return Vec::new();
    }
    let mut samples = Vec::with_capacity(SAMPLES);
    let mut passed = 0.0;
    for triangle in triangles {
        passed += area(triangle);
        let [a, b, c] = corners(triangle);
        while samples.len() < SAMPLES && (samples.len() as f64 + 0.5) * total < passed * SAMPLES as f64 {
            let index = samples.len() as f64 + 0.5;
            let [mut u, mut v] = [(index * 0.754_877_666_246_69).fract(), (index * 0.569_840_290_998_05).fract()];
            if u + v > 1.0 {
                (u, v) = (1.0 - u, 1.0 - v);
            }
            samples.push(a + (b - a) * u as f32 + (c - a) * v as f32);
        }
    }
    samples
}
