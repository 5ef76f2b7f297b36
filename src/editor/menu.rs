//! The menu bar: all actions, with their keys.

use std::path::PathBuf;

use bevy::prelude::*;
use bevy_egui::egui;

use super::{
    actions::{Action, ActionRequest},
    dock::Layout,
    files::OpenRequest,
    keys::KeyBindings,
    library::LibraryAction,
    mode::Mode,
    palette,
    panel::Requests,
    panels::timeline::TimelineAction,
    settings::EditorSettings,
    toolbar,
    tools::paint::brush::BrushAction,
};

/// Entry of a menu: its name and action, or `None` for a line across.
type Entry = Option<(&'static str, Action)>;

const fn library(name: &'static str, action: LibraryAction) -> Entry {
    Some((name, Action::Library(action)))
}

/// First entries of the File menu, above the recent files.
const FILE_FIRST: &[Entry] =
    &[Some(("Start page", Action::StartPage)), None, Some(("New", Action::New)), Some(("Open…", Action::Open))];

/// Last entries of the File menu, below the recent files.
const FILE_LAST: &[Entry] = &[
    Some(("Add mesh…", Action::AddMesh)),
    None,
    Some(("Save", Action::Save)),
    Some(("Save as…", Action::SaveAs)),
    Some(("Export…", Action::Export)),
    None,
    Some(("Quit", Action::Quit)),
];

/// Entries of the Edit menu.
const EDIT: &[Entry] = &[
    Some(("Undo", Action::Undo)),
    Some(("Redo", Action::Redo)),
    None,
    Some(("Select all", Action::SelectAll)),
    Some(("Select none", Action::SelectNone)),
    None,
    Some(("Delete", Action::Delete)),
    Some(("Delete with children", Action::DeleteHierarchy)),
    Some(("Mirror selected", Action::MirrorSelected)),
];

/// Entries of the Rig menu.
const RIG: &[Entry] = &[
    Some(("Build", Action::Build)),
    Some(("Roll back", Action::RollBack)),
    Some(("Next command", Action::StepForward)),
    Some(("Last command back", Action::StepBack)),
    None,
    Some(("Fit", Action::Fit)),
    Some(("Fit into a part of the mesh", Action::FitPart)),
    Some(("Next doubtful joint", Action::NextDoubt)),
    Some(("Skin", Action::Skin)),
    Some(("Normalise weights", Action::Brush(BrushAction::Normalise))),
    Some(("Prune weights", Action::Brush(BrushAction::Prune))),
    None,
    Some(("Reset pose", Action::ResetPose)),
    Some(("Mirror pose", Action::MirrorPose)),
    Some(("Store pose", Action::StorePose)),
];

/// Entries of the Library menu.
const LIBRARY: &[Entry] = &[
    library("Loader", LibraryAction::Loader),
    library("Updater", LibraryAction::Updater),
    None,
    library("Load skeleton", LibraryAction::LoadSkeleton),
    library("Edit skeleton", LibraryAction::EditSkeleton),
    library("Build rig", LibraryAction::BuildRig),
    library("Delete rig", LibraryAction::DeleteRig),
    None,
    library("Load chosen", LibraryAction::Load),
    library("Fit chosen onto the mesh", LibraryAction::Fit),
    library("Merge chosen", LibraryAction::Merge),
    library("Inject chosen", LibraryAction::Inject),
    library("Add chosen part", LibraryAction::Part),
    None,
    library("Save as template…", LibraryAction::Save),
    library("Live updates", LibraryAction::Live),
];

/// Entries of the View menu.
const VIEW: &[Entry] = &[
    Some(("Frame selected", Action::FrameSelected)),
    Some(("Frame all", Action::FrameAll)),
    None,
    Some(("Front", Action::ViewFront)),
    Some(("Back", Action::ViewBack)),
    Some(("Left side", Action::ViewLeft)),
    Some(("Right side", Action::ViewRight)),
    Some(("Top", Action::ViewTop)),
    Some(("Bottom", Action::ViewBottom)),
    Some(("Perspective or orthographic", Action::Projection)),
    None,
    Some(("X-ray", Action::XRay)),
    Some(("Wireframe", Action::Wireframe)),
    Some(("Labels", Action::Labels)),
    Some(("Local axes", Action::LocalAxes)),
    Some(("Grid", Action::Grid)),
    Some(("Controls", Action::Controls)),
    None,
    Some(("Bones", Action::Bones)),
    Some(("Meshes", Action::Meshes)),
    Some(("Joints that deform", Action::Deforming)),
    Some(("Onion skin", Action::OnionSkin)),
];

/// Last entries of the Window menu, below the panels.
const WINDOW_LAST: &[Entry] = &[
    None,
    Some(("Larger", Action::UiLarger)),
    Some(("Smaller", Action::UiSmaller)),
    Some(("As large as usual", Action::UiUsual)),
    Some(("Dark or light", Action::Theme)),
    Some(("High contrast", Action::Contrast)),
];

/// Draws entries; a click sends the action and closes the menu. Actions that can do nothing at present are greyed, and say why.
fn show_entries(ui: &mut egui::Ui, world: &World, list: &[Entry], requests: &mut Requests) {
    let keys = world.get_resource::<KeyBindings>();
    for entry in list {
        let Some((name, action)) = entry else {
            ui.separator();
            continue;
        };
        let button = egui::Button::new(*name);
        let button = match keys.and_then(|keys| keys.key(*action)) {
            Some(key) => button.shortcut_text(key.to_string()),
            None => button,
        };
        let why_not = palette::obstacle(world, *action);
        let entry = ui.add_enabled(why_not.is_none(), button);
        if entry.clicked() {
            requests.send(ActionRequest(*action));
            ui.close();
        }
        if let Some(why_not) = why_not {
            entry.on_disabled_hover_text(why_not);
        }
    }
}

/// Draws the menu of recent files, and returns the one that was clicked.
fn show_recent(ui: &mut egui::Ui, world: &World) -> Option<PathBuf> {
    let list = world.get_resource::<EditorSettings>().map(|settings| settings.recent.clone()).unwrap_or_default();
    let mut chosen = None;
    ui.add_enabled_ui(!list.is_empty(), |ui| {
        let menu = ui.menu_button("Open recent", |ui| {
            for path in &list {
                let name = path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
                if ui.button(name).on_hover_text(path.display().to_string()).clicked() {
                    chosen = Some(path.clone());
                    ui.close();
                }
            }
        });
        menu.response.on_disabled_hover_text("No file was opened or saved yet");
    });
    chosen
}

/// Entries with the names of the timeline's actions.
fn timeline_entries(list: &[TimelineAction]) -> Vec<Entry> {
    list.iter().map(|action| Some((action.name(), Action::Timeline(*action)))).collect()
}

/// Draws the Animate menu by a function that draws entries.
fn show_animate(ui: &mut egui::Ui, mut entries: impl FnMut(&mut egui::Ui, &[Entry])) {
    entries(
        ui,
        &timeline_entries(&[TimelineAction::NewClip, TimelineAction::DuplicateClip, TimelineAction::DeleteClip]),
    );
    entries(ui, &[Some(("Import motion…", Action::Timeline(TimelineAction::Import)))]);
    entries(ui, &timeline_entries(&[TimelineAction::ImportOwn]));
    ui.separator();
    entries(ui, &timeline_entries(&[TimelineAction::Play, TimelineAction::Loop]));
    entries(ui, &timeline_entries(&[TimelineAction::NextKey, TimelineAction::PreviousKey]));
    ui.separator();
    entries(ui, &timeline_entries(&[TimelineAction::Key, TimelineAction::KeyAll, TimelineAction::AutoKey]));
    entries(ui, &timeline_entries(&[TimelineAction::Marker, TimelineAction::NewLayer]));
    ui.separator();
    entries(ui, &timeline_entries(&[TimelineAction::Copy, TimelineAction::Paste, TimelineAction::Mirror]));
    ui.separator();
    entries(ui, &timeline_entries(&[TimelineAction::BakeClip, TimelineAction::ReduceClip]));
    entries(ui, &timeline_entries(&[TimelineAction::Longer, TimelineAction::Shorter]));
    entries(ui, &timeline_entries(&[TimelineAction::SwitchKinematics, TimelineAction::SwitchSpace]));
}

/// Draws the panels of the Window menu, and returns the one that was clicked.
fn show_panels(ui: &mut egui::Ui, layout: &Layout, panels: &[&'static str]) -> Option<&'static str> {
    let mut chosen = None;
    for panel in panels {
        // One that stands behind others is looked for, not to be hidden.
        if ui.selectable_label(layout.is_forward(panel), *panel).clicked() {
            chosen = Some(*panel);
            ui.close();
        }
    }
    chosen
}

/// Draws the menu bar.
pub(super) fn show(
    ui: &mut egui::Ui,
    world: &World,
    layout: &Layout,
    panels: &[&'static str],
    requests: &mut Requests,
) {
    let mut entries = |ui: &mut egui::Ui, list: &[Entry]| show_entries(ui, world, list, requests);
    let mut recent: Option<PathBuf> = None;
    let mut toggled: Option<&'static str> = None;
    let (mut reset, mut updates) = (false, false);
    egui::MenuBar::new().ui(ui, |ui| {
        ui.menu_button("File", |ui| {
            entries(ui, FILE_FIRST);
            recent = show_recent(ui, world);
            entries(ui, FILE_LAST);
        });
        ui.menu_button("Edit", |ui| entries(ui, EDIT));
        ui.menu_button("Mode", |ui| {
            for mode in Mode::ALL {
                entries(ui, &[Some((mode.name(), Action::Mode(mode)))]);
            }
            entries(
                ui,
                &[None, Some(("Symmetry", Action::Symmetry)), Some(("Move children along", Action::MoveChildren))],
            );
        });
        ui.menu_button("Rig", |ui| entries(ui, RIG));
        ui.menu_button("Library", |ui| entries(ui, LIBRARY));
        ui.menu_button("Animate", |ui| show_animate(ui, &mut entries));
        ui.menu_button("View", |ui| entries(ui, VIEW));
        ui.menu_button("Window", |ui| {
            toggled = show_panels(ui, layout, panels);
            ui.separator();
            if ui.button("Reset layout").clicked() {
                reset = true;
                ui.close();
            }
            entries(ui, WINDOW_LAST);
        });
        ui.menu_button("Help", |ui| {
            entries(ui, &[Some(("All actions", Action::Palette)), Some(("Help", Action::Help))])
        });
        let right = egui::Layout::right_to_left(egui::Align::Center);
        updates = ui.with_layout(right, |ui| toolbar::update(ui, world)).inner;
    });
    if let Some(path) = recent {
        requests.send(OpenRequest::File(path));
    }
    if updates {
        requests.send(ActionRequest(Action::Library(LibraryAction::Updater)));
    }
    if reset {
        requests.set(Layout::default());
    } else if let Some(panel) = toggled {
        let mut next = layout.clone();
        if next.is_forward(panel) {
            next.toggle(panel);
        } else {
            next.bring_forward(panel);
        }
        requests.set(next);
    }
}
