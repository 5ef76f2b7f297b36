//! Display switches, and their application to the window.

use bevy::prelude::*;

use super::actions::{Action, ActionRequest};
use crate::plugins::{
    display::MeshDisplay,
    drawing::{LabelChoice, RigDrawing},
};

/// Adds the switches of the display.
pub struct ScreenPlugin;

impl Plugin for ScreenPlugin {
    fn build(&self, app: &mut App) {
        app.add_systems(Update, switch);
    }
}

fn switch(
    mut actions: MessageReader<ActionRequest>,
    mut display: ResMut<MeshDisplay>,
    mut drawing: ResMut<RigDrawing>,
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
            _ => {}
        }
    }
}
