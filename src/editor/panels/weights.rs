//! Weights panel: the brush, changes of whole meshes, the joints with their locks and colours, and a table of points.

mod brush;
mod joints;
pub(super) mod meshes;
mod points;

use bevy::prelude::*;
use bevy_egui::egui::{ScrollArea, Ui, UiBuilder, vec2};

use super::{
    displayed_rig::DisplayedRig,
    list,
    log::LogSystems,
    skinning::{mesh_name, tell_held},
};
use crate::{
    editor::{
        counts::counted,
        notice::Notice,
        panel::{EditorPanel, Requests},
        tools::paint::brush::BrushPlugin,
    },
    plugins::{
        painting::{WeightChange, WeightChangeAnswer, WeightChangeError},
        surface::{RigMesh, RigMeshes},
    },
    rig::Uid,
};

/// Plugin of the brush's settings, and of notices about changed weights.
pub struct WeightsPanelPlugin;

impl Plugin for WeightsPanelPlugin {
    fn build(&self, app: &mut App) {
        if !app.is_plugin_added::<BrushPlugin>() {
            app.add_plugins(BrushPlugin);
        }
        app.add_message::<WeightChangeAnswer>()
            .add_message::<Notice>()
            .add_systems(Last, tell_answers.after(tell_held).before(LogSystems));
    }
}

/// Sends notices about the results of normalising, pruning and copying.
fn tell_answers(
    mut answers: MessageReader<WeightChangeAnswer>,
    meshes: Query<&RigMesh>,
    mut notices: MessageWriter<Notice>,
) {
    for WeightChangeAnswer { mesh, change, result } in answers.read() {
        let name = meshes.get(*mesh).map_or("The mesh", |mesh| mesh_name(mesh));
        let what = match change {
            WeightChange::Normalise => "normalised",
            WeightChange::Prune(_) => "pruned",
            WeightChange::CopyFrom(_) => "copied",
        };
        notices.write(match result {
            Ok(0) => Notice::info(format!("The weights of {name} are {what} already; nothing changed.")),
            Ok(count) => {
                let points = counted(*count, "point", "points");
                Notice::done(format!("The weights of {name} are {what}: {points} changed."))
            }
            Err(error @ (WeightChangeError::Discarded | WeightChangeError::Stopped)) => {
                Notice::info(format!("The weights of {name} were not {what}: {error}."))
            }
            Err(error) => Notice::warning(format!("The weights of {name} were not {what}: {error}.")).at("Weights"),
        });
    }
}

/// The panel.
#[derive(Default)]
pub struct WeightsPanel {
    brush: brush::BrushForm,
    meshes: meshes::MeshForm,
    joints: joints::JointList,
    points: points::PointTable,
    /// Mesh that people chose; the first one without a choice.
    mesh: Option<Uid>,
}

impl EditorPanel for WeightsPanel {
    fn title(&self) -> &'static str {
        "Weights"
    }

    fn show(&mut self, ui: &mut Ui, world: &World, requests: &mut Requests) {
        let Some(shown) = DisplayedRig::of(world) else {
            return list::nothing(ui, "No rig is open.");
        };
        let meshes = meshes_of(world, shown.entity);
        let chosen = self.mesh.and_then(|uid| meshes.iter().find(|(_, mesh)| mesh.uid == uid));
        let Some((entity, mesh)) = chosen.or(meshes.first()).copied() else {
            return list::nothing(ui, "There is no mesh: open one first.");
        };
        ScrollArea::vertical().id_salt("weights").auto_shrink(false).show(ui, |ui| {
            self.brush.show(ui, world, &shown, requests);
            ui.separator();
            self.meshes.show(ui, world, &shown, (entity, mesh), &meshes, &mut self.mesh, requests);
            ui.separator();
            self.joints.show(ui, world, &shown, mesh, requests);
            ui.separator();
            self.points.show(ui, world, &shown, &meshes, requests);
        });
    }
}

/// Meshes of a rig in the order of their uids.
fn meshes_of(world: &World, rig: Entity) -> Vec<(Entity, &RigMesh)> {
    let meshes = world.get::<RigMeshes>(rig);
    let meshes = meshes.iter().flat_map(|meshes| meshes.iter());
    let mut list: Vec<(Entity, &RigMesh)> =
        meshes.filter_map(|mesh| Some((mesh, world.get::<RigMesh>(mesh)?))).collect();
    list.sort_by_key(|(_, mesh)| mesh.uid);
    list
}

/// Draws a list in an area of its own height within a scrolled panel.
fn in_area(ui: &mut Ui, salt: &str, height: f32, draw: impl FnOnce(&mut Ui)) {
    let (_, rect) = ui.allocate_space(vec2(ui.available_width(), height));
    draw(&mut ui.new_child(UiBuilder::new().id_salt(salt).max_rect(rect)));
}
