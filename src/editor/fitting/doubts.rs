//! Rings around joints that a fit is not sure of, and marks at joints that a person has placed.

use bevy::prelude::*;
use bevy_egui::egui;

use crate::{
    editor::{ActiveRig, camera::ViewportSight},
    plugins::fit::{FitMarkers, FittedRig},
    rig::{Rig, Uid},
};

/// Mark of a fit at a joint.
#[derive(Debug, Clone, PartialEq)]
pub struct FitMark {
    /// The joint.
    pub joint: Uid,
    /// Place in pixels of the viewport.
    pub at: Vec2,
    /// Kind of the mark.
    pub kind: FitMarkKind,
}

/// Kind of a mark.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FitMarkKind {
    /// Ring around a joint that the fit is not sure of.
    Doubt,
    /// Square at a joint that a person has placed.
    Placed,
}

/// Radius of rings, in pixels.
const RADIUS: f32 = 10.0;

/// The marks of a fit that can be corrected.
pub fn fit_marks(world: &World) -> Vec<FitMark> {
    let Some(rig) = world.get_resource::<ActiveRig>().map(|active| active.0) else { return Vec::new() };
    let sight = world.get_resource::<ViewportSight>().and_then(|sight| sight.0);
    let (Some(sight), Some(data), Some(fitted)) = (sight, world.get::<Rig>(rig), world.get::<FittedRig>(rig)) else {
        return Vec::new();
    };
    let mark = |joint: Uid, kind: FitMarkKind| {
        let place = data.joint(joint).map(|_| data.position(joint))?;
        Some(FitMark { joint, at: sight.project(place)?, kind })
    };
    let doubts = fitted.report.doubtful().filter_map(|joint| mark(joint, FitMarkKind::Doubt));
    let markers = world.get::<FitMarkers>(rig);
    let placed = markers.iter().flat_map(|markers| markers.0.keys());
    doubts.chain(placed.filter_map(|joint| mark(*joint, FitMarkKind::Placed))).collect()
}

pub(super) fn paint_rings(painter: &egui::Painter, area: egui::Rect, world: &World) {
    let doubt = egui::Color32::from_rgb(255, 170, 60);
    let placed = egui::Color32::from_rgb(90, 200, 250);
    for FitMark { at, kind, .. } in fit_marks(world) {
        let at = area.min + egui::vec2(at.x, at.y);
        match kind {
            FitMarkKind::Doubt => {
                painter.circle_stroke(at, RADIUS, egui::Stroke::new(2.0, doubt));
                let above = at + egui::vec2(RADIUS, -RADIUS);
                painter.text(above, egui::Align2::LEFT_BOTTOM, "?", egui::FontId::proportional(14.0), doubt);
            }
            FitMarkKind::Placed => {
                let square = egui::Rect::from_center_size(at, egui::Vec2::splat(RADIUS));
                painter.rect_stroke(square, 0.0, egui::Stroke::new(2.0, placed), egui::StrokeKind::Middle);
            }
        }
    }
}
