//! Sections: intersections of a mesh with planes across an axis.
//!
//! The neck is the part where the sections of a head are narrowest, and its direction is the line through their
//! centroids.

use glam::{Vec2, Vec3};

pub mod border;

use self::border::End;

/// Intersection of a mesh with one plane.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Section {
    /// Position of the plane along the axis.
    pub at: f32,
    /// Mean of the outline, weighted by its length; on the plane.
    pub centroid: Vec3,
    /// Extent of the outline in the two directions of the plane.
    pub extent: Vec2,
    /// Length of all outlines.
    pub length: f32,
}

impl Section {
    /// The larger extent. A slanted cut through shoulders leaves shallow arcs, which would pass for a neck by their
    /// smaller extent.
    pub fn size(&self) -> f32 {
        self.extent.max_element()
    }
}

/// Two directions across `axis` (unit), which for up are +z and +x.
pub fn across(axis: Vec3) -> (Vec3, Vec3) {
    let right = if axis.x.abs() < 0.9 { Vec3::X } else { Vec3::Z };
    let first = axis.cross(-right).normalize_or_zero();
    (first, first.cross(axis))
}

/// Cuts `triangles` by `count` planes across `axis` (unit), the first at `low`, the last at `high` (as `p · axis`).
///
/// Triangles with corners past the end of `points` are ignored. Planes without an intersection are left out. Cost:
/// linear in the triangles and in the planes that they cross.
pub fn sections(
    points: &[Vec3],
    triangles: &[[u32; 3]],
    axis: Vec3,
    [low, high]: [f32; 2],
    count: usize,
) -> Vec<Section> {
    let (first, second) = across(axis);
    let step = (high - low) / count.saturating_sub(1).max(1) as f32;
    if count == 0 || !(step > 0.0 && step.is_finite()) {
        return Vec::new();
    }
    let mut sums = vec![(Vec3::ZERO, 0.0_f32, Vec2::MAX, Vec2::MIN); count];
    for triangle in triangles {
        let [Some(a), Some(b), Some(c)] = triangle.map(|corner| points.get(corner as usize).copied()) else { continue };
        let heights = [a, b, c].map(|corner| corner.dot(axis));
        let bottom = heights.iter().copied().fold(f32::MAX, f32::min);
        let top = heights.iter().copied().fold(f32::MIN, f32::max);
        let from = ((bottom - low) / step).ceil().max(0.0) as usize;
        for (plane, sum) in sums.iter_mut().enumerate().skip(from) {
            let at = low + step * plane as f32;
            if at > top {
                break;
            }
            let mut ends = [Vec3::ZERO; 3];
            let mut found = 0;
            for ((p, q), (hp, hq)) in [(a, b), (b, c), (c, a)].into_iter().zip([
                (heights[0], heights[1]),
                (heights[1], heights[2]),
                (heights[2], heights[0]),
            ]) {
                // Half open intervals: a corner on the plane counts once.
                if (hp < at) != (hq < at) {
                    ends[found] = p.lerp(q, (at - hp) / (hq - hp));
                    found += 1;
                }
            }
            if found == 2 {
                let length = ends[0].distance(ends[1]);
                sum.0 += (ends[0] + ends[1]) * 0.5 * length;
                sum.1 += length;
                for end in &ends[..2] {
                    let flat = Vec2::new(end.dot(first), end.dot(second));
                    sum.2 = sum.2.min(flat);
                    sum.3 = sum.3.max(flat);
                }
            }
        }
    }
    let section = |(plane, (sum, length, low_corner, high_corner)): (usize, &(Vec3, f32, Vec2, Vec2))| {
        (*length > 0.0 && length.is_finite()).then(|| Section {
            at: low + step * plane as f32,
            centroid: *sum / *length,
            extent: *high_corner - *low_corner,
            length: *length,
        })
    };
    sums.iter().enumerate().filter_map(section).collect()
}

/// The narrowest of some sections, the first of equals.
pub fn narrowest(sections: &[Section]) -> Option<usize> {
    (0..sections.len()).min_by(|a, b| sections[*a].size().total_cmp(&sections[*b].size()))
}

/// The neck of an upright head: horizontal sections from its open `end`, or the `bottom` of a closed mesh, to the
/// underside of the chin.
///
/// If the end is not level, planes below its highest point cut an open outline, so the neck begins at that point.
pub fn neck(points: &[Vec3], triangles: &[[u32; 3]], end: Option<&End>, bottom: f32, chin: f32) -> Vec<Section> {
    let bottom = end.map(|end| end.high.y).filter(|top| *top < chin - 0.1 * (chin - bottom)).unwrap_or(bottom);
    // The very edge is ragged.
    let edge = 0.03 * (chin - bottom);
    sections(points, triangles, Vec3::Y, [bottom + edge, chin - edge], 48)
}
