//! Cross-section of a limb, measured with a fan of rays from inside.

use bevy::math::ops;
use glam::{Vec2, Vec3};

use super::HalfSpace;
use crate::mesh::{
    ray::{Hit, Ray},
    surface::Surface,
};

/// Directions around a circle, shared by all sections.
#[derive(Debug, Clone)]
pub(super) struct Fan {
    fine: Vec<Vec2>,
}

const FINE: usize = 48;

/// Largest share of the circle without a near wall: a more open section is not a limb's.
const OPEN: f32 = 0.4;

/// A cross-section.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Section {
    pub(super) centroid: Vec3,
    /// Radius of the circle with the same area.
    pub(super) radius: f32,
    /// Share of the rays that hit no wall within the limit, 0 to 1.
    pub(super) open: f32,
}

impl Fan {
    pub(super) fn new() -> Self {
        let step = core::f32::consts::TAU / FINE as f32;
        let fine = (0..FINE).map(|i| i as f32 * step).map(|a| Vec2::new(ops::cos(a), ops::sin(a))).collect();
        Self { fine }
    }

    /// The section through `from` at right angles to `normal`: the polygon of the ends of every `stride`-th ray. A ray
    /// that hits no wall within `limit` (a hole, or the way into the torso) takes its length from its neighbours.
    /// `None` if there are too many such rays, or the polygon has no area. The border of the half-space is a wall.
    pub(super) fn section(
        &self,
        surface: &Surface,
        within: Option<HalfSpace>,
        from: Vec3,
        normal: Vec3,
        limit: f32,
        stride: usize,
        hits: &mut Vec<Hit>,
    ) -> Option<Section> {
        let (u, v) = normal.any_orthonormal_pair();
        let circle: Vec<Vec2> = self.fine.iter().copied().step_by(stride).collect();
        let mut reach: Vec<Option<f32>> = circle
            .iter()
            .map(|c| {
                let ray = Ray { origin: from, direction: u * c.x + v * c.y };
                surface.hits(&ray, hits);
                let wall = hits.first().map_or(f32::INFINITY, |hit| hit.distance);
                let border = within.map_or(f32::INFINITY, |half| half.covered(&ray)[1]);
                Some(wall.min(border)).filter(|&distance| distance <= limit)
            })
            .collect();
        let open = reach.iter().filter(|r| r.is_none()).count();
        if open as f32 > OPEN * circle.len() as f32 {
            return None;
        }
        close(&mut reach);
        let ends: Vec<Vec2> = circle.iter().zip(&reach).map(|(c, r)| *c * r.unwrap_or(limit)).collect();
        let mut area = 0.0;
        let mut moment = Vec2::ZERO;
        for i in 0..ends.len() {
            let (a, b) = (ends[i], ends[(i + 1) % ends.len()]);
            let cross = a.perp_dot(b);
            area += cross;
            moment += (a + b) * cross;
        }
        let centre = moment / (3.0 * area);
        (area > 0.0 && centre.is_finite()).then(|| Section {
            centroid: from + u * centre.x + v * centre.y,
            radius: (0.5 * area / core::f32::consts::PI).sqrt(),
            open: open as f32 / circle.len() as f32,
        })
    }
}

/// Fills the gaps of a circle by interpolating between their ends.
fn close(reach: &mut [Option<f32>]) {
    let n = reach.len();
    let Some(first) = reach.iter().position(|r| r.is_some()) else { return };
    let mut before = (0, reach[first].unwrap_or(0.0));
    for k in 1..=n {
        let Some(here) = reach[(first + k) % n] else { continue };
        for gap in before.0 + 1..k {
            let t = (gap - before.0) as f32 / (k - before.0) as f32;
            reach[(first + gap) % n] = Some(before.1 + (here - before.1) * t);
        }
        before = (k, here);
    }
}
