//! Visibility of the facial mask from the front.

use glam::Vec3;

use crate::algo::face::{
    bones::{extent, map::scale},
    landmarks::Landmarks,
};

/// Cells along the longer side of the grid of depths.
const CELLS: usize = 160;
/// Depth behind the front from which skin counts as hidden, as a share of the face's scale.
const HIDDEN: f32 = 0.06;

/// Marks points of a facial mask that are visible from the front, not the inner walls of mouth, nose and sockets.
///
/// `points`, which `mask` marks, and `landmarks` are in head space. Linear in the triangles: they are laid into a grid of
/// depths.
pub fn visible_mask(points: &[Vec3], triangles: &[[u32; 3]], mask: &[bool], landmarks: &Landmarks) -> Vec<bool> {
    let scale = scale(landmarks, extent(points));
    let mut seen: Vec<bool> = (0..points.len()).map(|i| mask.get(i).copied().unwrap_or(false)).collect();
    let (mut low, mut high) = (Vec3::splat(f32::INFINITY), Vec3::splat(f32::NEG_INFINITY));
    for (p, _) in points.iter().zip(&seen).filter(|(_, seen)| **seen) {
        (low, high) = (low.min(*p), high.max(*p));
    }
    let size = (high - low).truncate().max_element();
    if !(size > 0.0 && size.is_finite()) {
        return seen;
    }
    let cell = size / CELLS as f32;
    let of = |p: Vec3| (((p.x - low.x) / cell) as usize, ((p.y - low.y) / cell) as usize);
    let mut front = vec![f32::NEG_INFINITY; (CELLS + 1) * (CELLS + 1)];
    for t in triangles {
        let c = t.map(|i| i as usize);
        if !c.iter().all(|&i| seen.get(i).copied().unwrap_or(false)) {
            continue;
        }
        let c = c.map(|i| points[i]);
        let (a, b) = (c[0].min(c[1]).min(c[2]), c[0].max(c[1]).max(c[2]));
        let ((x0, y0), (x1, y1)) = (of(a), of(b));
        let area = (c[1] - c[0]).truncate().perp_dot((c[2] - c[0]).truncate());
        for y in y0..=y1.min(CELLS) {
            for x in x0..=x1.min(CELLS) {
                let at = glam::Vec2::new(low.x + (x as f32 + 0.5) * cell, low.y + (y as f32 + 0.5) * cell);
                let u = (c[1].truncate() - at).perp_dot(c[2].truncate() - at) / area;
                let v = (c[2].truncate() - at).perp_dot(c[0].truncate() - at) / area;
                if u >= 0.0 && v >= 0.0 && u + v <= 1.0 {
                    let z = u * c[0].z + v * c[1].z + (1.0 - u - v) * c[2].z;
                    let slot = &mut front[y * (CELLS + 1) + x];
                    *slot = slot.max(z);
                }
            }
        }
    }
    for (p, seen) in points.iter().zip(&mut seen).filter(|(_, seen)| **seen) {
        let (x, y) = of(*p);
        // The shallowest of the cells around is compared: skin that falls away steeply does not hide itself.
        let mut least = f32::INFINITY;
        for y in y.saturating_sub(1)..=(y + 1).min(CELLS) {
            for x in x.saturating_sub(1)..=(x + 1).min(CELLS) {
                least = least.min(front[y * (CELLS + 1) + x]);
            }
        }
        *seen = !(least.is_finite() && p.z < least - HIDDEN * scale);
    }
    seen
}
