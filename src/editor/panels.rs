//! The panels of the dock, one file each, and the toasts over it.
//!
//! Each panel reads the active rig anew whenever it is drawn and keeps only what the rig does not know: what is folded,
//! what is being typed. Long lists draw the rows that can be seen and nothing else.

pub mod face;
pub mod hierarchy;
pub mod history;
pub mod log;
pub mod poses;
pub mod properties;
pub mod skinning;
pub mod toasts;

mod fields;
mod groups;
mod list;
mod shown;

use bevy::prelude::*;

use super::panel::PanelApp;

pub use shown::joint_name;

/// Adds all panels, the toasts, and the systems behind the log and the skinning panel.
pub struct PanelsPlugin;

impl Plugin for PanelsPlugin {
    fn build(&self, app: &mut App) {
        app.add_plugins((
            log::LogPlugin,
            skinning::SkinningPanelPlugin,
            face::FacePanelPlugin,
            poses::PosesPlugin,
            toasts::ToastsPlugin,
        ))
        .add_panel(hierarchy::HierarchyPanel::default())
        .add_panel(properties::PropertiesPanel::default())
        .add_panel(skinning::SkinningPanel::default())
        .add_panel(face::FacePanel::default())
        .add_panel(poses::PosesPanel::default())
        .add_panel(history::HistoryPanel::default())
        .add_panel(log::LogPanel::default())
        .add_overlay(toasts::Toasts::default());
    }
}
