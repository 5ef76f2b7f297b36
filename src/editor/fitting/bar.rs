//! Bars over the viewport: a fit that runs, one that can be corrected, and the choice of a part of the mesh.

use std::sync::OnceLock;

use bevy::prelude::*;
use bevy_egui::egui;

use super::{
    ShowDoubt,
    again::{FitAgain, FitWish},
    doubts::paint_rings,
};
use crate::{
    editor::{
        ActiveRig,
        actions::{Action, ActionRequest},
        counts::counted,
        library::ChosenTemplate,
        panel::{Requests, ViewportPainter},
        tools::region::{ChosenFaces, RegionSkeleton, RegionTool},
        viewport_bars::FIT_BAR,
    },
    files::{BUNDLED_CHARACTERS, TemplatePlace, bundled_parts},
    plugins::{
        document::Selection,
        fit::{EndFit, FitJob, FitMarkers, FittedRig, RemoveMarker, region::triangles_of_joints},
        surface::{RigMesh, RigMeshes},
    },
    rig::Rig,
};

/// Height of the list of doubtful joints.
const LIST_HEIGHT: f32 = 110.0;

/// Bar of fits.
pub(super) struct FitBar;

impl ViewportPainter for FitBar {
    fn paint(&mut self, painter: &egui::Painter, area: egui::Rect, world: &World) {
        paint_rings(painter, area, world);
    }

    fn widgets(&mut self, ui: &mut egui::Ui, area: egui::Rect, world: &World, requests: &mut Requests) {
        let Some(active) = world.get_resource::<ActiveRig>() else { return };
        let meshes = world.get::<RigMeshes>(active.0);
        let running_job = |mesh| world.get::<FitJob>(mesh).filter(|job| !job.waits());
        // The status line tells of a fit that is ready and waits.
        let job = meshes.and_then(|meshes| meshes.iter().find_map(running_job));
        let fitted = world.get::<FittedRig>(active.0);
        let tool = world.get_resource::<RegionTool>();
        let faces = tool.and_then(|tool| tool.faces.as_ref()).filter(|faces| faces.rig == active.0);
        if job.is_none() && fitted.is_none() && faces.is_none() {
            return;
        }
        egui::Area::new(egui::Id::new(FIT_BAR))
            .order(egui::Order::Middle)
            .pivot(egui::Align2::LEFT_BOTTOM)
            .fixed_pos(area.left_bottom() + egui::vec2(12.0, -12.0))
            .constrain_to(area)
            .show(ui.ctx(), |ui| {
                egui::Frame::popup(ui.style()).show(ui, |ui| match (job, faces, fitted) {
                    (Some(job), ..) => running(ui, job, requests),
                    (None, Some(faces), _) => region(ui, faces, world, requests),
                    (None, None, Some(fitted)) => corrections(ui, active.0, fitted, world, requests),
                    (None, None, None) => {}
                });
            });
    }
}

fn running(ui: &mut egui::Ui, job: &FitJob, requests: &mut Requests) {
    ui.horizontal(|ui| {
        ui.add(egui::ProgressBar::new(job.progress()).text("Fitting").desired_width(160.0));
        if ui.button("Cancel").on_hover_text("Esc").clicked() {
            requests.send(ActionRequest(Action::Cancel));
        }
    });
    ui.ctx().request_repaint_after_secs(0.1);
}

fn corrections(ui: &mut egui::Ui, rig: Entity, fitted: &FittedRig, world: &World, requests: &mut Requests) {
    let doubtful = fitted.report.doubts().count();
    let doubt = match doubtful {
        0 => "no doubt".to_owned(),
        more => counted(more, "doubtful joint", "doubtful joints"),
    };
    if doubtful > 0 || fitted.report.warnings().next().is_some() {
        egui::ScrollArea::vertical().max_height(LIST_HEIGHT).show(ui, |ui| {
            for note in fitted.report.warnings() {
                ui.label(note.to_string());
            }
            for (joint, name, fit) in fitted.report.doubts() {
                let text = format!("{name}: {}", fit.reason);
                if ui.link(text).on_hover_text("Select the joint and go there").clicked() {
                    requests.send(ShowDoubt(joint));
                }
            }
        });
    }
    markers(ui, rig, world, requests);
    choice(ui, rig, fitted, requests);
    ui.horizontal(|ui| {
        let joints = counted(fitted.report.joints.len(), "joint", "joints");
        ui.label(format!("{}: {joints}, {doubt}", fitted.report.template));
        if doubtful > 0 && ui.button("Next").on_hover_text("The next doubtful joint (N)").clicked() {
            requests.send(ActionRequest(Action::NextDoubt));
        }
        ui.separator();
        ui.weak("Move a joint: the others of its limb follow");
        ui.separator();
        for (text, key, cancel) in [("Accept", "Enter", false), ("Cancel", "Esc", true)] {
            if ui.button(text).on_hover_text(key).clicked() {
                requests.send(EndFit { rig, cancel });
            }
        }
    });
}

/// Widgets that begin the fit anew: another template in place of the one that was fitted, and the other front.
fn choice(ui: &mut egui::Ui, rig: Entity, fitted: &FittedRig, requests: &mut Requests) {
    ui.horizontal(|ui| {
        if fitted.has_own_template {
            let own = &fitted.report.template;
            egui::ComboBox::from_label("Template").selected_text(own).show_ui(ui, |ui| {
                for (name, _) in BUNDLED_CHARACTERS {
                    if ui.selectable_label(own == name, *name).clicked() && own != name {
                        requests.send(FitAgain { rig, wish: FitWish::Template((*name).to_owned()) });
                    }
                }
            });
        }
        let button = ui.button("Turn round");
        if button.on_hover_text("Fit again with the front where the back is").clicked() {
            requests.send(FitAgain { rig, wish: FitWish::TurnRound });
        }
    });
}

/// Joints that a person has placed, each with a button that lets it go.
fn markers(ui: &mut egui::Ui, rig: Entity, world: &World, requests: &mut Requests) {
    let (Some(markers), Some(data)) = (world.get::<FitMarkers>(rig), world.get::<Rig>(rig)) else { return };
    if markers.0.is_empty() {
        return;
    }
    ui.horizontal_wrapped(|ui| {
        ui.label("Placed by you:").on_hover_text("These joints stay, in this fit and in the next one");
        for joint in markers.0.keys() {
            let label = data.joint(*joint).and_then(|joint| joint.data.label.as_deref()).unwrap_or("joint");
            if ui.button(format!("{label} ×")).on_hover_text("Let the joint go: the fit places it again").clicked() {
                requests.send(RemoveMarker { rig, joint: *joint });
            }
        }
    });
}

/// Names of the parts that have a chain to fit.
fn fittable_parts() -> &'static [&'static str] {
    static NAMES: OnceLock<Vec<&'static str>> = OnceLock::new();
    NAMES.get_or_init(|| {
        let parts = bundled_parts();
        parts.iter().filter(|(_, part)| part.rig.len() > 1).map(|(name, _)| *name).collect()
    })
}

/// Name of a part for people: that of its file.
fn part_name(name: &str) -> &str {
    let file = name.rsplit(['/', '\\']).next().unwrap_or(name);
    file.strip_suffix(".rig.ron").unwrap_or(file)
}

/// The part that is chosen in the Loader, by the name that a fit finds it by.
fn chosen_part(world: &World) -> Option<String> {
    match world.get_resource::<ChosenTemplate>()?.0.as_ref()? {
        TemplatePlace::Bundled(name) => name.starts_with("parts/").then(|| (*name).to_owned()),
        place => place.path().map(|path| path.display().to_string()),
    }
}

fn region(ui: &mut egui::Ui, faces: &ChosenFaces, world: &World, requests: &mut Requests) {
    let selected = world.get::<Selection>(faces.rig).map(|selection| selection.0.as_slice()).unwrap_or_default();
    let (rig, mesh) = (world.get::<Rig>(faces.rig), world.get::<RigMesh>(faces.mesh));
    let mut next = faces.clone();
    ui.horizontal(|ui| {
        ui.label(format!("Fit a part: {}", counted(faces.triangles.len(), "face", "faces")));
        ui.weak("Click a piece, drag a box; Shift adds, Ctrl takes away");
    });
    ui.horizontal(|ui| {
        let name = |skeleton: &RegionSkeleton| match skeleton {
            RegionSkeleton::Selected => "selected joints".to_owned(),
            RegionSkeleton::Part(part) => part_name(part).to_owned(),
        };
        egui::ComboBox::from_label("into these faces").selected_text(name(&faces.skeleton)).show_ui(ui, |ui| {
            let own = (!selected.is_empty()).then_some(RegionSkeleton::Selected);
            let known = fittable_parts().iter().map(|name| RegionSkeleton::Part((*name).to_owned()));
            let chosen = chosen_part(world).filter(|name| !fittable_parts().contains(&name.as_str()));
            for skeleton in own.into_iter().chain(chosen.map(RegionSkeleton::Part)).chain(known) {
                let text = name(&skeleton);
                ui.selectable_value(&mut next.skeleton, skeleton, text);
            }
        });
        let bound = rig.zip(mesh).filter(|(rig, mesh)| !selected.is_empty() && rig.skin(mesh.uid).is_some());
        let button = ui.add_enabled(bound.is_some(), egui::Button::new("Faces of selected joints"));
        let button = button.on_disabled_hover_text("Select joints that the mesh has weights of");
        if button.clicked()
            && let Some((rig, mesh)) = bound
        {
            next.take(triangles_of_joints(mesh, rig, selected), default());
        }
        if ui.button("All faces").clicked()
            && let Some(mesh) = mesh
        {
            next.take(0..mesh.triangles.len() as u32, default());
        }
        ui.separator();
        if ui.button("Fit").on_hover_text("Enter").clicked() {
            requests.send(ActionRequest(Action::Accept));
        }
        if ui.button("Cancel").on_hover_text("Esc").clicked() {
            requests.send(ActionRequest(Action::Cancel));
        }
    });
    if next != *faces {
        requests.set(RegionTool::with(next));
    }
}
