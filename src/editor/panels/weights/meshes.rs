//! Changes of all weights of a mesh.

use bevy::prelude::*;
use bevy_egui::egui::{Button, ComboBox, Ui};

use crate::{
    algo::paint::PruneSettings,
    editor::{
        notice::Notice,
        panel::Requests,
        panels::{
            displayed_rig::DisplayedRig,
            fields::{Look, NumberEdit, Numbers, labelled, named},
        },
        tools::paint::brush::PaintBrush,
    },
    plugins::{
        painting::{WeightChange, WeightChangeJob, WeightChangeRequest},
        surface::RigMesh,
    },
    rig::{Uid, proportion::Quantity},
};

/// Buttons and fields of a mesh.
#[derive(Default)]
pub(super) struct MeshForm {
    numbers: Numbers,
    before: Option<PaintBrush>,
    /// Mesh to copy from; the first other one without a choice.
    source: Option<Uid>,
}

const SHARE: Look = Look { speed: 0.001, decimals: 4, suffix: "", quantity: Quantity::Plain };
const COUNT: Look = Look { speed: 0.05, decimals: 0, suffix: "", quantity: Quantity::Plain };

impl MeshForm {
    pub fn show(
        &mut self,
        ui: &mut Ui,
        world: &World,
        shown: &DisplayedRig,
        (entity, mesh): (Entity, &RigMesh),
        meshes: &[(Entity, &RigMesh)],
        chosen: &mut Option<Uid>,
        requests: &mut Requests,
    ) {
        if meshes.len() > 1 {
            let mut next = mesh.uid;
            choose(ui, "Mesh", meshes.iter().map(|(_, mesh)| *mesh), &mut next);
            if next != mesh.uid {
                *chosen = Some(next);
            }
        }
        let job = world.get::<WeightChangeJob>(entity);
        let is_busy = job.is_some();
        let obstacle = if is_busy {
            Some("The weights of the mesh are being changed.")
        } else {
            shown.rig.skin(mesh.uid).is_none().then_some("The mesh has no weights yet: skin it first.")
        };
        let send = |requests: &mut Requests, change| requests.send(WeightChangeRequest { mesh: entity, change });
        let brush = world.get_resource::<PaintBrush>().copied().unwrap_or_default();
        ui.horizontal_wrapped(|ui| {
            let tip = "Scale influences so that those of each point sum to one; locked joints keep theirs";
            if button(ui, "Normalise", tip, obstacle) {
                send(requests, WeightChange::Normalise);
            }
            let tip = "Take influences below the threshold away, and those beyond the number";
            if button(ui, "Prune", tip, obstacle) {
                send(requests, WeightChange::Prune(brush.prune));
            }
        });
        self.pruning(ui, brush, requests);
        self.copying(ui, shown, (entity, mesh), meshes, is_busy, requests);
        if let Some(obstacle) = obstacle {
            ui.weak(obstacle);
        }
        if job.is_some_and(|job| !job.waits()) {
            ui.ctx().request_repaint_after_secs(0.1);
        }
    }

    /// Draws the settings of pruning.
    fn pruning(&mut self, ui: &mut Ui, brush: PaintBrush, requests: &mut Requests) {
        let fields = [("Prune below", brush.prune.below, SHARE), ("Prune to", brush.prune.most as f32, COUNT)];
        for (name, value, look) in fields {
            let Some(edit) = self.numbers.number(ui, name, value, look) else { continue };
            match edit {
                NumberEdit::Set(value) => match with(brush, name, value) {
                    Some(next) => requests.set(next),
                    None => requests.send(Notice::warning(format!(
                        "{name} stays as it was: use a weight from 0 to 1, or a number of influences from 1 to 16."
                    ))),
                },
                NumberEdit::Preview(value) => {
                    let before = *self.before.get_or_insert(brush);
                    with(before, name, value).into_iter().for_each(|next| requests.set(next));
                }
                NumberEdit::Commit => self.before = None,
                NumberEdit::Cancel => self.before.take().into_iter().for_each(|before| requests.set(before)),
            }
        }
        self.numbers.tell(requests);
    }

    /// Draws the mesh to copy from and its button, where there is another mesh.
    fn copying(
        &mut self,
        ui: &mut Ui,
        shown: &DisplayedRig,
        (entity, mesh): (Entity, &RigMesh),
        meshes: &[(Entity, &RigMesh)],
        is_busy: bool,
        requests: &mut Requests,
    ) {
        let others: Vec<(Entity, &RigMesh)> =
            meshes.iter().copied().filter(|(_, other)| other.uid != mesh.uid).collect();
        let known = self.source.and_then(|uid| others.iter().find(|(_, other)| other.uid == uid));
        let Some((source, other)) = known.or(others.first()).copied() else { return };
        let mut next = other.uid;
        choose(ui, "Copy from", others.iter().map(|(_, mesh)| *mesh), &mut next);
        self.source = Some(next);
        let obstacle = if is_busy {
            Some("The weights of the mesh are being changed.")
        } else {
            shown.rig.skin(other.uid).is_none().then_some("The mesh to copy from has no weights.")
        };
        let tip = "Take the weights of the other mesh where it is near; locked joints keep theirs";
        if button(ui, "Copy weights", tip, obstacle) {
            requests.send(WeightChangeRequest { mesh: entity, change: WeightChange::CopyFrom(source) });
        }
    }
}

/// Draws a button, which an obstacle greys out.
fn button(ui: &mut Ui, name: &str, tip: &str, obstacle: Option<&str>) -> bool {
    let response = ui.add_enabled(obstacle.is_none(), Button::new(name)).on_hover_text(tip);
    response.on_disabled_hover_text(obstacle.unwrap_or_default()).clicked()
}

/// Draws a choice of one of several meshes.
pub(in crate::editor::panels) fn choose<'a>(
    ui: &mut Ui,
    name: &str,
    meshes: impl Iterator<Item = &'a RigMesh>,
    chosen: &mut Uid,
) {
    let mut list: Vec<(Uid, String)> = Vec::new();
    for (number, mesh) in meshes.enumerate() {
        let name = if mesh.file.name.is_empty() { format!("Mesh {}", number + 1) } else { mesh.file.name.clone() };
        let is_taken = list.iter().any(|(_, known)| *known == name);
        list.push((mesh.uid, if is_taken { format!("{name} ({})", number + 1) } else { name }));
    }
    let text = list.iter().find(|(uid, _)| uid == chosen).map_or("", |(_, text)| text.as_str());
    labelled(ui, name, |ui| {
        let combo = ComboBox::from_id_salt(name).selected_text(text).width(ui.available_width()).truncate();
        let combo = combo.show_ui(ui, |ui| {
            for (uid, text) in &list {
                ui.selectable_value(chosen, *uid, text);
            }
        });
        named(ui, combo.response.id, name);
    });
}

/// The settings with another number of pruning; `None` for one that makes no sense.
fn with(brush: PaintBrush, name: &str, value: f32) -> Option<PaintBrush> {
    let prune = match name {
        "Prune below" => {
            PruneSettings { below: Some(value).filter(|value| (0.0..=1.0).contains(value))?, ..brush.prune }
        }
        _ => PruneSettings {
            most: Some(value.round()).filter(|value| (1.0..=16.0).contains(value))? as usize,
            ..brush.prune
        },
    };
    Some(PaintBrush { prune, ..brush })
}
