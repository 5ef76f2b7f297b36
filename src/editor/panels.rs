//! The panels of the dock, one file each, and the toasts over it.
//!
//! A panel reads the active rig whenever it is drawn and keeps only state that is not part of the rig: folded entries,
//! text being typed. Long lists draw the visible rows only.

pub mod controls;
pub mod curves;
pub mod display;
pub mod face;
pub mod graph;
pub mod hierarchy;
pub mod history;
pub mod loader;
pub mod local_groups;
pub mod log;
pub mod poses;
pub mod process;
pub mod properties;
pub mod selection_sets;
pub mod skinning;
pub mod tags;
pub mod timeline;
pub mod toasts;
pub mod updater;
pub mod weights;

mod displayed_rig;
mod features;
pub(super) mod fields;
mod groups;
mod list;
mod node_menu;
mod words;

use bevy::prelude::*;

use super::panel::PanelApp;

pub use displayed_rig::joint_name;

/// Adds all panels, the toasts, and the systems behind the log and the panels of weights.
pub struct PanelsPlugin;

impl Plugin for PanelsPlugin {
    fn build(&self, app: &mut App) {
        app.add_plugins((
            log::LogPlugin,
            skinning::SkinningPanelPlugin,
            weights::WeightsPanelPlugin,
            face::FacePanelPlugin,
            poses::PosesPlugin,
            timeline::TimelinePlugin,
            graph::GraphPlugin,
            toasts::ToastsPlugin,
            super::onion::OnionPlugin,
            super::library::LibraryPlugin,
        ))
        .add_panel(hierarchy::HierarchyPanel::default())
        .add_panel(loader::LoaderPanel::default())
        .add_panel(properties::PropertiesPanel::default())
        .add_panel(tags::TagsPanel::default())
        .add_panel(controls::ControlsPanel::default())
        .add_panel(process::ProcessPanel::default())
        .add_panel(local_groups::GroupsPanel::default())
        .add_panel(skinning::SkinningPanel::default())
        .add_panel(weights::WeightsPanel::default())
        .add_panel(face::FacePanel::default())
        .add_panel(poses::PosesPanel::default())
        .add_panel(selection_sets::SelectionSetsPanel::default())
        .add_panel(history::HistoryPanel::default())
        .add_panel(updater::UpdaterPanel::default())
        .add_panel(display::DisplayPanel::default())
        .add_panel(timeline::TimelinePanel::default())
        .add_panel(curves::CurvesPanel::default())
        .add_panel(graph::GraphPanel::default())
        .add_panel(log::LogPanel::default())
        .add_overlay(toasts::Toasts::default())
        .add_painter(node_menu::NodeMenu::default());
    }
}
