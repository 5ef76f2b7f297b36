//! The status line at the bottom: effect of a click, or the reason why it has none.

use bevy::prelude::*;
use bevy_egui::egui;

use super::{
    ActiveRig,
    counts::counted,
    follow,
    next_step::next_step,
    notice::StatusLine,
    panel::Requests,
    result_queue::{DiscardResult, waiting},
    running_work::{StopWork, running},
    style,
};
use crate::{
    plugins::{
        document::Selection,
        surface::{RigMesh, RigMeshes},
    },
    rig::Rig,
};

/// Draws the status line.
pub(super) fn show(ui: &mut egui::Ui, world: &World, requests: &mut Requests) {
    ui.horizontal(|ui| {
        ui.set_min_height(18.0);
        let status = world.get_resource::<StatusLine>().cloned().unwrap_or_default();
        let held = waiting(world);
        // What waits is decided about first, and its button needs room.
        let counts = match next_step(world).filter(|_| held.is_none()) {
            Some(next) => format!("Next: {next}  ·  {}", counts(world)),
            None => counts(world),
        };
        let quiet = style::quiet(ui.visuals());
        let (accent, obstacle_color) = (style::accent(ui.visuals()), style::obstacle(ui.visuals()));
        let room = ui.available_width();
        let right = ui.painter().layout_no_wrap(counts.clone(), egui::FontId::proportional(12.0), quiet).size().x;
        let text = match (&status.banner, &status.obstacle) {
            (Some(banner), _) => egui::RichText::new(banner).color(accent).strong(),
            (None, Some(obstacle)) => egui::RichText::new(obstacle).color(obstacle_color),
            (None, None) => egui::RichText::new(&status.hint),
        };
        ui.scope(|ui| {
            ui.set_max_width((room - right - 24.0).max(80.0));
            if let Some((words, kind)) = running(world) {
                ui.add(egui::Spinner::new().size(12.0));
                // Before the words: a long name leaves no room behind it.
                if let Some(kind) = kind {
                    let button = ui.small_button("Stop").on_hover_text("Stops it; the document stays as it is");
                    if button.clicked() {
                        requests.send(StopWork(kind));
                    }
                }
                ui.label(egui::RichText::new(words).color(accent));
            } else if let Some((kind, words)) = held {
                let text = egui::RichText::new(format!("{words}: redo, or go on editing")).color(accent);
                ui.label(text).on_hover_text(kind.sentence());
                let button = ui.small_button("Discard").on_hover_text("Drops what waits; the rig stays as it is");
                if button.clicked() {
                    requests.send(DiscardResult(kind));
                }
            }
            let label = ui.add(egui::Label::new(text).truncate());
            if let Some(hover) = status.obstacle.as_ref().or(Some(&status.hint)).filter(|hint| !hint.is_empty()) {
                label.on_hover_text(hover);
            }
        });
        ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| {
            ui.label(egui::RichText::new(counts).size(12.0).color(quiet));
        });
    });
}

fn counts(world: &World) -> String {
    let Some(rig) = world.get_resource::<ActiveRig>() else { return String::new() };
    let joints = world.get::<Rig>(rig.0).map_or(0, Rig::len);
    let selected = world.get::<Selection>(rig.0).map_or(0, |selection| selection.0.len());
    let meshes = world.get::<RigMeshes>(rig.0).map(|meshes| {
        meshes.iter().filter_map(|mesh| world.get::<RigMesh>(mesh)).map(|mesh| mesh.triangles.len()).sum::<usize>()
    });
    let mut parts = Vec::new();
    if follow::offer(world).is_some() {
        parts.push("the template's file is newer".to_owned());
    }
    if selected > 0 {
        parts.push(format!("{selected} selected"));
    }
    parts.push(counted(joints, "joint", "joints"));
    if let Some(triangles) = meshes {
        parts.push(counted(triangles, "triangle", "triangles"));
    }
    parts.join("  ·  ")
}
