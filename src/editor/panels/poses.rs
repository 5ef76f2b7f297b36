//! Stored poses.

use bevy::prelude::*;
use bevy_egui::egui::Ui;

use super::{list, shown::Shown};
use crate::editor::panel::{EditorPanel, Requests};

/// The panel.
#[derive(Default)]
pub struct PosesPanel {}

impl EditorPanel for PosesPanel {
    fn title(&self) -> &'static str {
        "Poses"
    }

    fn show(&mut self, ui: &mut Ui, world: &World, _requests: &mut Requests) {
        let Some(_shown) = Shown::of(world) else {
            return list::nothing(ui, "No rig is open.");
        };
        list::nothing(ui, "No pose is stored.");
    }
}
