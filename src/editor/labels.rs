//! Joint labels over the viewport, in the window's font.

use bevy::prelude::*;
use bevy_egui::egui;

use super::{
    ActiveRig,
    panel::{PanelApp, ViewportPainter},
};
use crate::plugins::drawing::{RigDrawing, RigLabels};

/// Paints labels.
pub struct LabelsPlugin;

impl Plugin for LabelsPlugin {
    fn build(&self, app: &mut App) {
        app.add_painter(Labels).add_systems(Startup, leave_labels_to_window);
    }
}

struct Labels;

fn leave_labels_to_window(mut drawing: ResMut<RigDrawing>) {
    drawing.write_labels = false;
}

impl ViewportPainter for Labels {
    fn paint(&mut self, painter: &egui::Painter, area: egui::Rect, world: &World) {
        let labels = world.get_resource::<ActiveRig>().and_then(|rig| world.get::<RigLabels>(rig.0));
        let font = egui::FontId::proportional(12.0);
        for (at, text) in labels.map(|labels| labels.0.as_slice()).unwrap_or_default() {
            let at = area.min + egui::vec2(at.x, at.y);
            for offset in [egui::vec2(1.0, 1.0), egui::vec2(-1.0, 1.0), egui::vec2(1.0, -1.0), egui::vec2(-1.0, -1.0)] {
                painter.text(
                    at + offset,
                    egui::Align2::LEFT_CENTER,
                    text,
                    font.clone(),
                    egui::Color32::from_black_alpha(150),
                );
            }
            painter.text(at, egui::Align2::LEFT_CENTER, text, font.clone(), egui::Color32::from_rgb(236, 238, 242));
        }
    }
}
