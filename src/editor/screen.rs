//! Display switches, and their application to the window.

use std::collections::BTreeSet;

use bevy::{prelude::*, window::PrimaryWindow};

use super::{
    ActiveRig,
    actions::{Action, ActionRequest},
    settings::EditorSettings,
};
use crate::{
    plugins::{
        RigSystems,
        display::MeshDisplay,
        drawing::{LabelChoice, RigDrawing},
        surface::{RigMesh, SkinOf},
    },
    rig::Uid,
};

/// Adds the switches of the display.
pub struct ScreenPlugin;

impl Plugin for ScreenPlugin {
    fn build(&self, app: &mut App) {
        app.init_resource::<MeshDisplay>()
            .init_resource::<RigDrawing>()
            .init_resource::<HiddenMeshes>()
            .init_resource::<EditorSettings>()
            .add_message::<ActionRequest>()
            .add_systems(
                Update,
                (switch, hide_meshes, scale_window)
                    .chain()
                    .after(super::settings::switch)
                    .before(super::files::attend)
                    .before(RigSystems::Script),
            );
    }
}

/// Meshes that the viewport does not show.
#[derive(Resource, Debug, Clone, PartialEq, Eq, Default)]
pub struct HiddenMeshes {
    /// Hides every mesh if `true`.
    pub all: bool,
    /// Meshes that are hidden one by one.
    pub meshes: BTreeSet<Uid>,
}

impl HiddenMeshes {
    /// True if the viewport does not show a mesh.
    pub fn hides(&self, mesh: Uid) -> bool {
        self.all || self.meshes.contains(&mesh)
    }
}

fn switch(
    mut actions: MessageReader<ActionRequest>,
    mut display: ResMut<MeshDisplay>,
    mut drawing: ResMut<RigDrawing>,
    mut hidden: ResMut<HiddenMeshes>,
) {
    for ActionRequest(action) in actions.read() {
        match action {
            Action::XRay => display.xray = !display.xray,
            Action::Wireframe => display.wireframe = !display.wireframe,
            Action::Labels => {
                drawing.labels = match drawing.labels {
                    LabelChoice::All => LabelChoice::None,
                    _ => LabelChoice::All,
                }
            }
            Action::LocalAxes => drawing.axes = !drawing.axes,
            Action::Controls => drawing.controls = !drawing.controls,
            Action::Grid => drawing.grid = !drawing.grid,
            Action::Bones => drawing.bones = !drawing.bones,
            Action::Deforming => drawing.deforming = !drawing.deforming,
            // Meshes that were hidden one by one are shown as well.
            Action::Meshes => *hidden = HiddenMeshes { all: !hidden.all && hidden.meshes.is_empty(), ..default() },
            _ => {}
        }
    }
}

/// Hides and shows the meshes of the open rig.
fn hide_meshes(
    hidden: Res<HiddenMeshes>,
    active: Option<Res<ActiveRig>>,
    mut meshes: Query<(&RigMesh, &SkinOf, &mut Visibility)>,
) {
    for (mesh, of, mut visibility) in &mut meshes {
        let is_open = active.as_ref().is_some_and(|active| active.0 == of.0);
        let hides = is_open && hidden.hides(mesh.uid);
        visibility.set_if_neq(if hides { Visibility::Hidden } else { Visibility::Inherited });
    }
}

/// Gives the window the size of the interface: logical pixels, in which panels, pointer and viewport measure, become larger.
fn scale_window(settings: Res<EditorSettings>, mut windows: Query<&mut Window, With<PrimaryWindow>>) {
    for mut window in &mut windows {
        let scale = settings.ui_scale;
        let wanted = (scale != 1.0).then(|| scale * window.resolution.base_scale_factor());
        if window.resolution.scale_factor_override() != wanted {
            window.resolution.set_scale_factor_override(wanted);
        }
    }
}
