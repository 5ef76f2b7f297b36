//! The cross-section of a limb, felt out with a fan of rays from inside.

use bevy::math::ops;
use glam::{Vec2, Vec3};

use crate::mesh::{
    ray::{Hit, Ray},
    surface::Surface,
};

/// Directions around a circle, reused by every section.
#[derive(Debug, Clone)]
pub(super) struct Fan {
    fine: Vec<Vec2>,
}

const FINE: usize = 48;

/// A cross-section.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Section {
    pub(super) centroid: Vec3,
    /// Radius of the circle with the same area.
    pub(super) radius: f32,
    /// The part of the rays that were cut at the limit, 0 to 1.
    pub(super) open: f32,
}

impl Fan {
    pub(super) fn new() -> Self {
        let step = core::f32::consts::TAU / FINE as f32;
        let fine = (0..FINE).map(|i| i as f32 * step).map(|a| Vec2::new(ops::cos(a), ops::sin(a))).collect();
        Self { fine }
    }

    /// The section through `from` square to `normal`: the region that rays from `from` reach before they meet the surface
    /// or `limit`. Its centroid is that of the polygon of the rays' ends. `None` if the region has no area.
    pub(super) fn section(
        &self,
        surface: &Surface,
        from: Vec3,
        normal: Vec3,
        limit: f32,
        stride: usize,
        hits: &mut Vec<Hit>,
    ) -> Option<Section> {
        let (u, v) = normal.any_orthonormal_pair();
        let mut cut = 0;
        let mut ends: [Vec2; FINE] = [Vec2::ZERO; FINE];
        let mut count = 0;
        for circle in self.fine.iter().step_by(stride) {
            let ray = Ray { origin: from, direction: u * circle.x + v * circle.y };
            surface.hits(&ray, hits);
            let reach = hits.first().map_or(f32::INFINITY, |hit| hit.distance);
            if reach > limit {
                cut += 1;
            }
            ends[count] = *circle * reach.min(limit);
            count += 1;
        }
        let mut area = 0.0;
        let mut moment = Vec2::ZERO;
        for i in 0..count {
            let (a, b) = (ends[i], ends[(i + 1) % count]);
            let cross = a.perp_dot(b);
            area += cross;
            moment += (a + b) * cross;
        }
        if !(area > 0.0 && area.is_finite()) {
            return None;
        }
        let centre = moment / (3.0 * area);
        Some(Section {
            centroid: from + u * centre.x + v * centre.y,
            radius: (0.5 * area / core::f32::consts::PI).sqrt(),
            open: cut as f32 / count as f32,
        })
    }
}
