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
    panel::Requests,
    panels::timeline::TimelineAction,
    settings::EditorSettings,
    toolbar,
    tools::paint::brush::BrushAction,
};

/// Draws the menu bar.
pub(super) fn show(
    ui: &mut egui::Ui,
    world: &World,
    layout: &Layout,
    panels: &[&'static str],
    requests: &mut Requests,
) {
    let keys = world.get_resource::<KeyBindings>();
    let mut entries = |ui: &mut egui::Ui, list: &[Option<(&str, Action)>]| {
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
            if ui.add(button).clicked() {
                requests.send(ActionRequest(*action));
                ui.close();
            }
        }
    };
    let mut recent: Option<PathBuf> = None;
    let mut toggled: Option<&'static str> = None;
    let (mut reset, mut updates) = (false, false);
    egui::MenuBar::new().ui(ui, |ui| {
        ui.menu_button("File", |ui| {
            entries(
                ui,
                &[
                    Some(("Start page", Action::StartPage)),
                    None,
                    Some(("New", Action::New)),
                    Some(("Open…", Action::Open)),
                ],
            );
            let list =
                world.get_resource::<EditorSettings>().map(|settings| settings.recent.clone()).unwrap_or_default();
            ui.add_enabled_ui(!list.is_empty(), |ui| {
                ui.menu_button("Open recent", |ui| {
                    for path in &list {
                        let name = path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
                        if ui.button(name).on_hover_text(path.display().to_string()).clicked() {
                            recent = Some(path.clone());
                            ui.close();
                        }
                    }
                });
            });
            entries(
                ui,
                &[
                    None,
                    Some(("Save", Action::Save)),
                    Some(("Save as…", Action::SaveAs)),
                    Some(("Export…", Action::Export)),
                    None,
                    Some(("Quit", Action::Quit)),
                ],
            );
        });
        ui.menu_button("Edit", |ui| {
            entries(
                ui,
                &[
                    Some(("Undo", Action::Undo)),
                    Some(("Redo", Action::Redo)),
                    None,
                    Some(("Select all", Action::SelectAll)),
                    Some(("Select none", Action::SelectNone)),
                    None,
                    Some(("Delete", Action::Delete)),
                    Some(("Delete with children", Action::DeleteHierarchy)),
                    Some(("Mirror selected", Action::MirrorSelected)),
                ],
            );
        });
        ui.menu_button("Mode", |ui| {
            for mode in Mode::ALL {
                entries(ui, &[Some((mode.name(), Action::Mode(mode)))]);
            }
            entries(
                ui,
                &[None, Some(("Symmetry", Action::Symmetry)), Some(("Move children along", Action::MoveChildren))],
            );
        });
        ui.menu_button("Rig", |ui| {
            entries(
                ui,
                &[
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
                ],
            );
        });
        ui.menu_button("Library", |ui| {
            let entry = |name: &'static str, action: LibraryAction| Some((name, Action::Library(action)));
            entries(
                ui,
                &[
                    entry("Loader", LibraryAction::Loader),
                    entry("Updater", LibraryAction::Updater),
                    None,
                    entry("Load skeleton", LibraryAction::LoadSkeleton),
                    entry("Edit skeleton", LibraryAction::EditSkeleton),
                    entry("Build rig", LibraryAction::BuildRig),
                    entry("Delete rig", LibraryAction::DeleteRig),
                    None,
                    entry("Load chosen", LibraryAction::Load),
                    entry("Fit chosen onto the mesh", LibraryAction::Fit),
                    entry("Merge chosen", LibraryAction::Merge),
                    entry("Inject chosen", LibraryAction::Inject),
                    entry("Add chosen part", LibraryAction::Part),
                    None,
                    entry("Save as template…", LibraryAction::Save),
                    entry("Live updates", LibraryAction::Live),
                ],
            );
        });
        ui.menu_button("Animate", |ui| {
            let list = |list: &[TimelineAction]| -> Vec<Option<(&'static str, Action)>> {
                list.iter().map(|action| Some((action.name(), Action::Timeline(*action)))).collect()
            };
            entries(ui, &list(&[TimelineAction::NewClip, TimelineAction::DuplicateClip, TimelineAction::DeleteClip]));
            entries(ui, &[Some(("Import motion…", Action::Timeline(TimelineAction::Import)))]);
            entries(ui, &list(&[TimelineAction::ImportOwn]));
            ui.separator();
            entries(ui, &list(&[TimelineAction::Play, TimelineAction::Loop]));
            entries(ui, &list(&[TimelineAction::NextKey, TimelineAction::PreviousKey]));
            ui.separator();
            entries(ui, &list(&[TimelineAction::Key, TimelineAction::KeyAll, TimelineAction::AutoKey]));
            entries(ui, &list(&[TimelineAction::Marker, TimelineAction::NewLayer]));
            ui.separator();
            entries(ui, &list(&[TimelineAction::Copy, TimelineAction::Paste, TimelineAction::Mirror]));
            ui.separator();
            entries(ui, &list(&[TimelineAction::BakeClip, TimelineAction::ReduceClip]));
            entries(ui, &list(&[TimelineAction::Longer, TimelineAction::Shorter]));
            entries(ui, &list(&[TimelineAction::SwitchKinematics, TimelineAction::SwitchSpace]));
        });
        ui.menu_button("View", |ui| {
            entries(
                ui,
                &[
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
                ],
            );
        });
        ui.menu_button("Window", |ui| {
            for panel in panels {
                // One that stands behind others is looked for, not to be hidden.
                if ui.selectable_label(layout.is_forward(panel), *panel).clicked() {
                    toggled = Some(panel);
                    ui.close();
                }
            }
            ui.separator();
            if ui.button("Reset layout").clicked() {
                reset = true;
                ui.close();
            }
            entries(
                ui,
                &[
                    None,
                    Some(("Larger", Action::UiLarger)),
                    Some(("Smaller", Action::UiSmaller)),
                    Some(("As large as usual", Action::UiUsual)),
                    Some(("Dark or light", Action::Theme)),
                    Some(("High contrast", Action::Contrast)),
                ],
            );
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
