//! Painting of the gizmo over the viewport.

use bevy::prelude::*;
use bevy_egui::egui::{self, Color32, Stroke};

use super::{GizmoTool, PoseMoves};
use crate::editor::{
    mode::Mode,
    panel::{Requests, ViewportPainter},
    tools::gizmo::{Handle, HandleLine, HandleShape, LinePaint},
};

/// Painter of handles, and of the switch for arrows in Pose mode.
pub(super) struct GizmoPainter;

/// Tip of the switch for arrows in Pose mode.
const MOVES: &str =
    "Arrows beside the rings for every joint: limbs follow and keep their lengths. Roots always have arrows.";

const AXES: [Color32; 3] =
    [Color32::from_rgb(235, 80, 75), Color32::from_rgb(120, 200, 70), Color32::from_rgb(85, 145, 245)];
const VIEW: Color32 = Color32::from_rgb(225, 228, 232);
const HOVERED: Color32 = Color32::from_rgb(255, 220, 90);

impl ViewportPainter for GizmoPainter {
    fn paint(&mut self, painter: &egui::Painter, area: egui::Rect, world: &World) {
        let Some(tool) = world.get_resource::<GizmoTool>() else { return };
        let dragged = tool.dragged();
        let hovered = dragged.or(tool.hovered);
        for shape in &tool.shapes {
            let is_hovered = hovered == Some(shape.handle);
            let fade = if dragged.is_some() && !is_hovered { 0.35 } else { 1.0 };
            paint_shape(painter, area.min, shape, is_hovered, fade);
        }
    }

    fn widgets(&mut self, ui: &mut egui::Ui, area: egui::Rect, world: &World, requests: &mut Requests) {
        let (Some(Mode::Pose), Some(moves)) = (world.get_resource::<Mode>(), world.get_resource::<PoseMoves>()) else {
            return;
        };
        let mut on = moves.0;
        egui::Area::new(egui::Id::new("pose bar"))
            .order(egui::Order::Middle)
            // The root's control is at the bottom, fits have their bar there, and the tour its card on the left.
            .pivot(egui::Align2::RIGHT_TOP)
            .fixed_pos(area.right_top() + egui::vec2(-12.0, 12.0))
            .constrain_to(area)
            .show(ui.ctx(), |ui| {
                egui::Frame::popup(ui.style()).show(ui, |ui| {
                    let switch = ui.checkbox(&mut on, "Move joints, too");
                    if switch.on_hover_text(MOVES).changed() {
                        requests.set(PoseMoves(on));
                    }
                });
            });
    }
}

fn paint_shape(painter: &egui::Painter, corner: egui::Pos2, shape: &HandleShape, is_hovered: bool, fade: f32) {
    let color = match (is_hovered, shape.handle.axis()) {
        (true, _) => HOVERED,
        (false, Some(axis)) => AXES[axis],
        (false, None) => VIEW,
    };
    let color = color.gamma_multiply(fade);
    let wide = if is_hovered { 3.0 } else { 2.0 };
    for line in &shape.lines {
        let points: Vec<egui::Pos2> = line.points.iter().map(|point| corner + egui::vec2(point.x, point.y)).collect();
        match line.paint {
            LinePaint::Line => {
                // A dark rim separates the line from a mesh of the same colour.
                let rim = Color32::from_black_alpha(90).gamma_multiply(fade);
                painter.add(egui::Shape::line(points.clone(), Stroke::new(wide + 1.5, rim)));
                let wide = if shape.handle == Handle::ViewRing && !is_hovered { 1.25 } else { wide };
                painter.add(egui::Shape::line(points, Stroke::new(wide, color)));
            }
            LinePaint::Far => {
                painter.add(egui::Shape::line(points, Stroke::new(1.0, color.gamma_multiply(0.3))));
            }
            LinePaint::Area => paint_area(painter, line, points, shape.handle, color, is_hovered),
        }
    }
}

fn paint_area(
    painter: &egui::Painter,
    line: &HandleLine,
    points: Vec<egui::Pos2>,
    handle: Handle,
    color: Color32,
    is_hovered: bool,
) {
    let is_solid = matches!(handle, Handle::MoveAxis(_) | Handle::ScaleAxis(_));
    let share = match (is_solid, is_hovered) {
        (true, _) => 1.0,
        (false, true) => 0.45,
        (false, false) => 0.22,
    };
    // The joint itself shows through the handle in the middle.
    let is_middle = matches!(handle, Handle::MoveView | Handle::ScaleAll);
    let fill = if is_middle && !is_hovered { Color32::TRANSPARENT } else { color.gamma_multiply(share) };
    debug_assert_eq!(line.points.len(), points.len());
    painter.add(egui::Shape::convex_polygon(points, fill, Stroke::new(if is_hovered { 2.0 } else { 1.5 }, color)));
}
