//! Fit in the window: a key puts a template into the mesh, doubtful joints are selected, and moving a joint corrects the fit.

use std::sync::Arc;

use bevy::prelude::*;
use bevy_egui::egui;

use super::{
    ActiveRig,
    actions::{Action, ActionRequest},
    help::{HelpShown, toggle_help},
    mode::Mode,
    notice::Notice,
    panel::{PanelApp, Requests, ViewportPainter},
    start::{self, StartPage},
};
use crate::{
    files::bundled_characters,
    plugins::{
        RigSystems,
        document::Selection,
        fit::{EndFit, FitAnswer, FitFailure, FitJob, FitReport, FitRequest, FitTemplates, FittedRig},
        history::RigHistory,
        picking::{Pick, PickRequest},
        surface::{RigMesh, RigMeshes, SkinOf},
    },
};

/// Plugin of fits in the window.
pub struct FittingPlugin;

impl Plugin for FittingPlugin {
    fn build(&self, app: &mut App) {
        app.add_message::<ActionRequest>()
            .add_message::<Notice>()
            .insert_resource(FitTemplates(Arc::new(bundled_characters)))
            .add_message::<FitRequest>()
            .add_message::<EndFit>()
            .add_message::<FitAnswer>()
            .add_message::<PickRequest>()
            .add_painter(FitBar)
            .add_systems(
                Update,
                (
                    act.before(RigSystems::Script).before(toggle_help).before(start::toggle),
                    show_result.after(RigSystems::Bind),
                ),
            );
    }
}

/// Starts, accepts and cancels fits.
fn act(
    mut actions: MessageReader<ActionRequest>,
    active: Option<Res<ActiveRig>>,
    rigs: Query<(Option<&RigMeshes>, Has<FittedRig>, &RigHistory)>,
    meshes: Query<&RigMesh>,
    jobs: Query<(Entity, &FitJob)>,
    (mode, help, start): (Option<Res<Mode>>, Option<Res<HelpShown>>, Option<Res<StartPage>>),
    mut commands: Commands,
) {
    let Some((rig, (own, is_fitted, history))) = active.and_then(|active| Some((active.0, rigs.get(active.0).ok()?)))
    else {
        return;
    };
    // A stroke that is drawn, a ghost that is placed, the help and the start page take the key for themselves.
    let is_covered = help.is_some_and(|help| help.0) || start.is_some_and(|start| start.is_shown());
    let is_free =
        !is_covered && mode.is_none_or(|mode| matches!(*mode, Mode::Select | Mode::Move | Mode::Rotate | Mode::Scale));
    for ActionRequest(action) in actions.read() {
        match action {
            Action::Fit => {
                let own = own.iter().flat_map(|meshes| meshes.iter());
                // The body is the mesh with the most points; eyes and clothes lie in it or on it.
                let body = own.max_by_key(|mesh| meshes.get(*mesh).map_or(0, |mesh| mesh.rest.points.len()));
                match body {
                    None => {
                        commands
                            .write_message(Notice::warning("There is no mesh to fit a skeleton into: open one first."));
                    }
                    Some(mesh) if jobs.contains(mesh) => {
                        commands.write_message(Notice::info("A fit is running. Wait for it, or press Esc."));
                    }
                    Some(mesh) => {
                        commands.write_message(FitRequest::new(mesh));
                    }
                }
            }
            // A drag under way takes the key for itself.
            Action::Cancel if !history.is_previewing() => {
                jobs.iter().for_each(|(_, job)| job.cancel());
                if is_fitted && is_free {
                    commands.write_message(EndFit { rig, cancel: true });
                }
            }
            Action::Accept if is_fitted => {
                commands.write_message(EndFit { rig, cancel: false });
            }
            _ => {}
        }
    }
}

/// Tells what a fit found, and selects the joints that it is not sure of.
fn show_result(
    mut answers: MessageReader<FitAnswer>,
    meshes: Query<&SkinOf>,
    selections: Query<&Selection>,
    mut commands: Commands,
) {
    for FitAnswer { mesh, result } in answers.read() {
        let report = match result {
            Ok(report) => report,
            Err(FitFailure::Fit(crate::algo::fit_template::FitError::Cancelled)) => {
                commands.write_message(Notice::info("The fit was cancelled. The rig is as it was."));
                continue;
            }
            Err(error) => {
                commands.write_message(Notice::error(format!("No skeleton was fitted: {error}.")));
                continue;
            }
        };
        let doubtful: Vec<_> = report.doubtful().collect();
        let choice = if report.choice.is_empty() { String::new() } else { format!(" ({})", report.choice) };
        let text = format!("{} fitted{choice} in {} ms", report.template, report.time.as_millis());
        commands.write_message(if report.fit.confidence < FitReport::DOUBTFUL {
            Notice::warning(format!("{text}, but the mesh may be something else: look at the ringed joints."))
        } else {
            Notice::done(format!("{text}."))
        });
        if let Ok(SkinOf(rig)) = meshes.get(*mesh)
            && selections.contains(*rig)
            && !doubtful.is_empty()
        {
            commands.write_message(PickRequest { rig: *rig, what: Pick::Joints(doubtful), add: false });
        }
        // Moving a joint corrects the fit.
        commands.insert_resource(Mode::Move);
    }
}

/// Bar of a fit that can be corrected.
struct FitBar;

impl ViewportPainter for FitBar {
    fn paint(&mut self, _: &egui::Painter, _: egui::Rect, _: &World) {}

    fn widgets(&mut self, ui: &mut egui::Ui, area: egui::Rect, world: &World, requests: &mut Requests) {
        let Some(active) = world.get_resource::<ActiveRig>() else { return };
        let meshes = world.get::<RigMeshes>(active.0);
        let job = meshes.and_then(|meshes| meshes.iter().find_map(|mesh| world.get::<FitJob>(mesh)));
        let fitted = world.get::<FittedRig>(active.0);
        if job.is_none() && fitted.is_none() {
            return;
        }
        egui::Area::new(egui::Id::new("fit bar"))
            .order(egui::Order::Middle)
            .pivot(egui::Align2::LEFT_BOTTOM)
            .fixed_pos(area.left_bottom() + egui::vec2(12.0, -12.0))
            .constrain_to(area)
            .show(ui.ctx(), |ui| {
                egui::Frame::popup(ui.style()).show(ui, |ui| {
                    ui.horizontal(|ui| match (job, fitted) {
                        (Some(job), _) => {
                            ui.add(egui::ProgressBar::new(job.progress()).text("Fitting").desired_width(160.0));
                            if ui.button("Cancel").on_hover_text("Esc").clicked() {
                                requests.send(ActionRequest(Action::Cancel));
                            }
                            if !job.waits() {
                                ui.ctx().request_repaint_after_secs(0.1);
                            }
                        }
                        (None, Some(fitted)) => corrections(ui, active.0, fitted, requests),
                        (None, None) => {}
                    });
                });
            });
    }
}

fn corrections(ui: &mut egui::Ui, rig: Entity, fitted: &FittedRig, requests: &mut Requests) {
    let doubtful = fitted.report.doubtful().count();
    let doubt = match doubtful {
        0 => "no doubt".to_owned(),
        1 => "1 doubtful joint".to_owned(),
        more => format!("{more} doubtful joints"),
    };
    let label = ui.label(format!("{}: {} joints, {doubt}", fitted.report.template, fitted.report.joints.len()));
    let reasons = fitted.report.joints.iter().zip(&fitted.report.fit.joints);
    let reasons: Vec<String> = reasons
        .filter(|(_, joint)| joint.confidence < FitReport::DOUBTFUL)
        .map(|((_, name), joint)| format!("{name}: {}", joint.reason))
        .collect();
    if !reasons.is_empty() {
        label.on_hover_text(reasons.join("\n"));
    }
    ui.separator();
    ui.weak("Move a joint: the others of its limb follow");
    ui.separator();
    for (text, key, cancel) in [("Accept", "Enter", false), ("Cancel", "Esc", true)] {
        if ui.button(text).on_hover_text(key).clicked() {
            requests.send(EndFit { rig, cancel });
        }
    }
}
