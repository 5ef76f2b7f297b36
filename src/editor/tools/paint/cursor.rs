//! The ring of the brush on the surface.

use std::f32::consts::TAU;

use bevy::{math::ops, prelude::*};
use bevy_egui::egui::{self, Color32, Stroke};

use super::PaintTool;
use crate::{
    algo::paint::Brush,
    editor::{camera::ViewportSight, panel::ViewportPainter, tools::scene::EditedRig},
    plugins::viewport::Sight,
};

/// The brush on the surface, in the rig's space.
#[derive(Debug, Clone, PartialEq)]
pub struct BrushCursor {
    /// Middle of the brush.
    pub middle: Vec3,
    /// Points of the ring where the effect ends, all round.
    pub outer: Vec<Vec3>,
    /// Points of the ring where the effect begins to fade; empty if it fades from the middle.
    pub inner: Vec<Vec3>,
}

/// Number of points of a ring.
const POINTS: usize = 40;
/// Distance in pixels of the rays from which the slope of the surface follows.
const ASIDE: f32 = 4.0;
/// Largest distance of a ring from the surface, as a share of its radius; beyond it the ring stays flat.
const LIFT: f32 = 0.6;

impl BrushCursor {
    pub(super) fn new(rig: &EditedRig, sight: &Sight, at: Vec2, middle: Vec3, brush: &Brush) -> Self {
        let normal = slope(rig, sight, at, middle).unwrap_or_else(|| sight.towards(middle));
        let across = normal.any_orthonormal_vector();
        let up = normal.cross(across);
        let surface = rig.surface.as_deref().and_then(|surface| surface.ready());
        let ring = |radius: f32| -> Vec<Vec3> {
            if !(radius > 0.0 && radius.is_finite()) {
                return Vec::new();
            }
            let point = |number: usize| {
                let angle = TAU * number as f32 / POINTS as f32;
                let flat = middle + (across * ops::cos(angle) + up * ops::sin(angle)) * radius;
                let near = surface.and_then(|surface| surface.closest_point(flat));
                near.filter(|near| near.distance <= LIFT * radius).map_or(flat, |near| near.point)
            };
            (0..POINTS).map(point).collect()
        };
        let core = brush.radius - brush.falloff;
        let inner = if core > 1e-3 * brush.radius { ring(core) } else { Vec::new() };
        Self { middle, outer: ring(brush.radius), inner }
    }
}

/// Normal of the surface at a pixel, from the places that two rays beside it meet.
fn slope(rig: &EditedRig, sight: &Sight, at: Vec2, middle: Vec3) -> Option<Vec3> {
    let surface = rig.surface.as_deref()?.ready()?;
    let met = |aside: Vec2| {
        let ray = sight.ray(at + aside);
        Some(ray.at(surface.closest(&ray)?.distance))
    };
    let near = 8.0 * ASIDE * sight.pixel_at(middle);
    let [right, up] = [met(Vec2::X * ASIDE)?, met(Vec2::NEG_Y * ASIDE)?].map(|place| place - middle);
    let is_near = right.length() < near && up.length() < near;
    right.cross(up).try_normalize().filter(|_| is_near)
}

/// Painter of the ring, and of its middle.
pub(super) struct CursorPainter;

impl ViewportPainter for CursorPainter {
    fn paint(&mut self, painter: &egui::Painter, area: egui::Rect, world: &World) {
        let Some(cursor) = world.get_resource::<PaintTool>().and_then(|tool| tool.cursor.as_ref()) else { return };
        let Some(sight) = world.get_resource::<ViewportSight>().and_then(|sight| sight.0) else { return };
        let pixel = |place: &Vec3| sight.project(*place).map(|at| area.min + egui::vec2(at.x, at.y));
        let color = Color32::from_rgb(255, 255, 255);
        for (ring, width, color) in [(&cursor.outer, 1.5, color), (&cursor.inner, 1.0, color.gamma_multiply(0.6))] {
            let points: Vec<egui::Pos2> = ring.iter().filter_map(pixel).collect();
            if points.len() == ring.len() && points.len() > 2 {
                // A dark rim separates the ring from a mesh of the same colour.
                painter.add(egui::Shape::closed_line(
                    points.clone(),
                    Stroke::new(width + 1.5, Color32::from_black_alpha(110)),
                ));
                painter.add(egui::Shape::closed_line(points, Stroke::new(width, color)));
            }
        }
        if let Some(middle) = pixel(&cursor.middle) {
            painter.circle_filled(middle, 2.0, color);
        }
    }
}
