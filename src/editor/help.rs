//! List of keys and actions, over the whole window until it is closed.

use bevy::prelude::*;
use bevy_egui::egui;

use super::{
    actions::{Action, ActionRequest},
    keys::KeyBindings,
    panel::{EditorOverlay, PanelApp, Requests},
    style,
};

/// Plugin of the list of keys.
pub struct HelpPlugin;

impl Plugin for HelpPlugin {
    fn build(&self, app: &mut App) {
        app.init_resource::<HelpShown>().add_overlay(Help).add_systems(Update, toggle_help);
    }
}

/// Visibility of the list.
#[derive(Resource, Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct HelpShown(pub bool);

struct Help;

/// Actions of the pointer, for the list.
const POINTER: &[(&str, &str)] = &[
    ("Left", "the mode's tool"),
    ("Middle drag, or Alt + left drag", "orbit"),
    ("Right drag, or Shift + middle drag", "pan"),
    ("Wheel, or Alt + right drag", "zoom (with Ctrl while a tool has the wheel)"),
    ("Trackpad: two fingers / Shift / Ctrl", "orbit / pan / zoom"),
    ("Timeline: drag in the ruler", "scrub (with Shift between frames)"),
    ("Timeline: click, or drag a box", "select keys (with Shift more, with Ctrl one more or less)"),
    ("Timeline: drag selected keys", "move (with Alt between frames); with Ctrl scale about the playhead"),
    ("Timeline: Ctrl + wheel, Shift + wheel", "zoom, pan in time"),
];

pub(super) fn toggle_help(mut actions: MessageReader<ActionRequest>, mut shown: ResMut<HelpShown>) {
    for ActionRequest(action) in actions.read() {
        match action {
            Action::Help => shown.0 = !shown.0,
            Action::Cancel if shown.0 => shown.0 = false,
            _ => {}
        }
    }
}

/// Description of an action, in a few words.
pub fn describe(action: Action) -> String {
    let text = match action {
        Action::Mode(mode) => return format!("{} mode", mode.name()),
        Action::New => "New project",
        Action::Open => "Open",
        Action::Save => "Save",
        Action::SaveAs => "Save as",
        Action::Export => "Export",
        Action::Quit => "Quit",
        Action::Undo => "Undo",
        Action::Redo => "Redo",
        Action::Delete => "Delete, keep what hangs below",
        Action::DeleteHierarchy => "Delete with children",
        Action::SelectAll => "Select all",
        Action::SelectNone => "Select none",
        Action::MirrorSelected => "Mirror selected",
        Action::Symmetry => "Symmetry",
        Action::MoveChildren => "Move children along",
        Action::Accept => "Accept what is drawn",
        Action::Cancel => "Drop what is drawn",
        Action::NextVolume => "Next volume under the pointer",
        Action::Fit => "Fit a skeleton into the mesh",
        Action::Skin => "Skin",
        Action::ResetPose => "Reset pose",
        Action::StorePose => "Store pose",
        Action::Build => "Build the rig",
        Action::RollBack => "Roll the build back",
        Action::StepForward => "Carry out the next command",
        Action::StepBack => "Take back the last command",
        Action::GizmoSpace => "World, local or view axes",
        Action::FrameSelected => "Frame selected",
        Action::FrameAll => "Frame all",
        Action::ViewFront => "Front",
        Action::ViewBack => "Back",
        Action::ViewLeft => "Left side",
        Action::ViewRight => "Right side",
        Action::ViewTop => "Top",
        Action::ViewBottom => "Bottom",
        Action::Projection => "Perspective or orthographic",
        Action::XRay => "X-ray",
        Action::Wireframe => "Wireframe",
        Action::Labels => "Labels",
        Action::LocalAxes => "Local axes",
        Action::Grid => "Grid",
        Action::Controls => "Controls",
        Action::Help => "Keys",
        Action::Palette => "All actions",
        Action::Timeline(action) => action.name(),
    };
    text.to_owned()
}

impl EditorOverlay for Help {
    fn show(&mut self, ctx: &egui::Context, world: &World, requests: &mut Requests) {
        if !world.get_resource::<HelpShown>().is_some_and(|shown| shown.0) {
            return;
        }
        let mut open = true;
        let height = (ctx.viewport_rect().height() - 120.0).max(200.0);
        egui::Window::new("Keys")
            .open(&mut open)
            .collapsible(false)
            .resizable(false)
            .anchor(egui::Align2::CENTER_CENTER, egui::Vec2::ZERO)
            .show(ctx, |ui| {
                egui::ScrollArea::vertical().max_height(height).show(ui, |ui| {
                    egui::Grid::new("pointer").num_columns(2).striped(true).show(ui, |ui| {
                        for (what, does) in POINTER {
                            ui.colored_label(style::ACCENT, *what);
                            ui.label(*does);
                            ui.end_row();
                        }
                    });
                    ui.separator();
                    let Some(keys) = world.get_resource::<KeyBindings>() else { return };
                    let half = keys.0.len().div_ceil(2);
                    egui::Grid::new("keys").num_columns(4).striped(true).spacing([18.0, 4.0]).show(ui, |ui| {
                        for row in 0..half {
                            for (chord, action) in [keys.0.get(row), keys.0.get(row + half)].into_iter().flatten() {
                                ui.colored_label(style::ACCENT, chord.to_string());
                                ui.label(describe(*action));
                            }
                            ui.end_row();
                        }
                    });
                    ui.weak("Other keys can be bound in the settings file.");
                });
            });
        if !open {
            requests.set(HelpShown(false));
        }
    }
}
