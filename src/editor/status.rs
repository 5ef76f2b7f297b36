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

/// Share of the line that what a click does may take from the words on the right.
const LEFT_SHARE: f32 = 0.6;
/// Least distance between what a click does and the words on the right, in points.
const GAP: f32 = 24.0;

/// Draws the status line.
pub(super) fn show(ui: &mut egui::Ui, world: &World, requests: &mut Requests) {
    ui.horizontal(|ui| {
        ui.set_min_height(18.0);
        let status = world.get_resource::<StatusLine>().cloned().unwrap_or_default();
        let (held, work) = (waiting(world), running(world));
        let quiet = style::quiet(ui.visuals());
        let (accent, obstacle_color) = (style::accent(ui.visuals()), style::obstacle(ui.visuals()));
        let width = |text: &str, font| ui.painter().layout_no_wrap(text.to_owned(), font, quiet).size().x;
        // What waits is decided about first, and its button needs room.
        let next = next_step(world).filter(|_| held.is_none()).map(|next| format!("Next: {next}"));
        let counts = counts(world);
        let mut ends = match next {
            Some(next) => vec![format!("{next}  ·  {counts}"), next],
            None => vec![counts],
        };
        let end_widths: Vec<f32> = ends.iter().map(|end| width(end, egui::FontId::proportional(12.0))).collect();
        let said = status.banner.as_ref().or(status.obstacle.as_ref()).unwrap_or(&status.hint);
        let said_width = match (held.is_some(), work.is_some()) {
            (false, false) => width(said, egui::TextStyle::Body.resolve(ui.style())),
            _ => f32::INFINITY,
        };
        let (left, end) = shares(ui.available_width(), said_width, &end_widths);
        let end = ends.swap_remove(end);
        let text = match (&status.banner, &status.obstacle) {
            (Some(banner), _) => egui::RichText::new(banner).color(accent).strong(),
            (None, Some(obstacle)) => egui::RichText::new(obstacle).color(obstacle_color),
            (None, None) => egui::RichText::new(&status.hint),
        };
        ui.scope(|ui| {
            ui.set_max_width(left);
            if let Some((words, kind)) = work {
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
            let text = egui::RichText::new(end).size(12.0).color(quiet);
            ui.add(egui::Label::new(text).truncate().halign(egui::Align::LEFT));
        });
    });
}

/// Room for what a click does in a line of the width `room`, and the number of the words on the right that are shown beside it.
/// `said` is the width of the former, `ends` are those of the latter, the fullest first: the first that fit, or else the last,
/// cut off. The two never meet.
fn shares(room: f32, said: f32, ends: &[f32]) -> (f32, usize) {
    let least = ends.last().copied().unwrap_or_default();
    let left = said.min((room * LEFT_SHARE).max(room - GAP - least));
    let fitting = ends.iter().position(|end| left + GAP + end <= room);
    (left, fitting.unwrap_or(ends.len().saturating_sub(1)))
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_make_room_before_the_next_step_does() {
        assert_eq!(shares(1000.0, 300.0, &[500.0, 400.0]), (300.0, 0));
        assert_eq!(shares(1000.0, 500.0, &[500.0, 400.0]), (500.0, 1));
        // Neither fits: both are cut off.
        assert_eq!(shares(600.0, 500.0, &[500.0, 400.0]), (360.0, 1));
        // Work in the background takes what the counts leave.
        assert_eq!(shares(1000.0, f32::INFINITY, &[200.0]), (776.0, 0));
        for room in [200.0, 640.0, 1008.0, 1264.0, 3840.0] {
            for said in [0.0, 150.0, 700.0, 5000.0] {
                let (left, _) = shares(room, said, &[670.0, 470.0]);
                assert!(left + GAP <= room, "{said} in {room} takes {left}");
            }
        }
    }
}
