//! Fit in the window: a key puts a template into the mesh or into chosen faces of it, doubtful joints stand out, and moving a
//! joint corrects the fit.

pub mod again;
mod bar;
pub mod doubts;

use std::{path::Path, sync::Arc};

use bevy::prelude::*;

use super::{
    ActiveRig,
    actions::{Action, ActionRequest},
    help::{HelpShown, toggle_help},
    mode::Mode,
    notice::Notice,
    panel::PanelApp,
    start::{self, StartPage},
    tools::{
        ToolSystems,
        region::{ChosenFaces, RegionSkeleton, RegionTool},
    },
};
use crate::{
    algo::fit_template::FitError,
    files::{RealDisk, bundled_characters, bundled_part, load_template},
    plugins::{
        RigSystems,
        document::Selection,
        fit::{
            EndFit, FitAnswer, FitFailure, FitJob, FitPart, FitParts, FitRegion, FitReport, FitRequest, FitTemplate,
            FitTemplates, FittedRig, RefitFailed, RemoveMarker,
        },
        history::RigHistory,
        picking::{Pick, PickRequest},
        surface::{RigMesh, RigMeshes, SkinOf},
    },
    rig::{Rig, Uid, part::Part},
};

/// Plugin of fits in the window.
pub struct FittingPlugin;

impl Plugin for FittingPlugin {
    fn build(&self, app: &mut App) {
        app.add_message::<ActionRequest>()
            .add_message::<Notice>()
            .init_resource::<RegionTool>()
            .insert_resource(FitTemplates(Arc::new(bundled_characters)))
            .insert_resource(FitParts(Arc::new(part_of_library)))
            .add_message::<FitRequest>()
            .add_message::<EndFit>()
            .add_message::<RemoveMarker>()
            .add_message::<FitAnswer>()
            .add_message::<RefitFailed>()
            .add_message::<PickRequest>()
            .add_message::<ShowDoubt>()
            .add_message::<again::FitAgain>()
            .add_painter(bar::FitBar)
            .add_systems(
                Update,
                (
                    (act, again::begin_again, show_doubts)
                        .chain()
                        .after(ToolSystems::Tools)
                        .before(RigSystems::Script)
                        .before(toggle_help)
                        .before(start::toggle),
                    (show_result, show_refusals).chain().after(RigSystems::Bind),
                ),
            );
    }
}

/// Part that is fitted where none is chosen.
const PART: &str = "parts/hand.rig.ron";

/// Request to select a joint that the fit is not sure of, and to go there.
#[derive(Message, Debug, Clone, Copy, PartialEq, Eq)]
pub struct ShowDoubt(pub Uid);

/// A part that comes with the program, or that of a file.
fn part_of_library(name: &str) -> Option<Arc<Part>> {
    let of_file = || load_template(&RealDisk, Path::new(name)).ok();
    bundled_part(name).or_else(|| of_file().map(|template| Arc::new(Part::from(template))))
}

type FittableRig = (
    &'static Rig,
    Option<&'static RigMeshes>,
    Option<&'static FittedRig>,
    &'static RigHistory,
    Option<&'static Selection>,
);

/// Starts, accepts and cancels fits, of the mesh and of chosen faces.
fn act(
    mut actions: MessageReader<ActionRequest>,
    active: Option<Res<ActiveRig>>,
    rigs: Query<FittableRig>,
    meshes: Query<&RigMesh>,
    jobs: Query<(Entity, &FitJob)>,
    (mode, help, start): (Option<Res<Mode>>, Option<Res<HelpShown>>, Option<Res<StartPage>>),
    mut region: ResMut<RegionTool>,
    mut commands: Commands,
) {
    let Some((rig, (data, own, fitted, history, selection))) =
        active.and_then(|active| Some((active.0, rigs.get(active.0).ok()?)))
    else {
        return;
    };
    // A stroke that is drawn, a ghost that is placed, the help and the start page take the key for themselves.
    let is_covered = help.is_some_and(|help| help.0) || start.is_some_and(|start| start.is_shown());
    let is_free =
        !is_covered && mode.is_none_or(|mode| matches!(*mode, Mode::Select | Mode::Move | Mode::Rotate | Mode::Scale));
    let selected = selection.map(|selection| selection.0.as_slice()).unwrap_or_default();
    let active = selected.last().copied().filter(|joint| data.joint(*joint).is_some());
    for ActionRequest(action) in actions.read() {
        match action {
            Action::Fit | Action::FitPart => {
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
                    Some(mesh) if *action == Action::FitPart => {
                        let skeleton = match active {
                            Some(_) => RegionSkeleton::Selected,
                            None => RegionSkeleton::Part(PART.to_owned()),
                        };
                        *region = RegionTool::open(rig, mesh, skeleton);
                        // Faces are chosen at rest.
                        commands.insert_resource(Mode::Move);
                    }
                    Some(mesh) => {
                        *region = RegionTool::default();
                        commands.write_message(FitRequest::new(mesh));
                    }
                }
            }
            Action::Cancel if region.is_open() && !is_covered => *region = RegionTool::default(),
            Action::Accept if region.is_open() && !is_covered => {
                let request = region.faces.as_ref().map(|faces| request_of(faces, selected, active));
                match request {
                    Some(Ok(request)) => {
                        *region = RegionTool::default();
                        commands.write_message(request);
                    }
                    Some(Err(missing)) => {
                        commands.write_message(Notice::warning(missing.to_string()));
                    }
                    None => {}
                }
            }
            // A drag under way takes the key for itself.
            Action::Cancel if !history.is_previewing() => {
                jobs.iter().for_each(|(_, job)| job.cancel());
                if fitted.is_some() && is_free {
                    commands.write_message(EndFit { rig, cancel: true });
                }
            }
            Action::Accept if fitted.is_some() => {
                commands.write_message(EndFit { rig, cancel: false });
            }
            Action::NextDoubt => {
                let doubts: Vec<Uid> = fitted.iter().flat_map(|fitted| fitted.report.doubtful()).collect();
                let at = selected.last().and_then(|joint| doubts.iter().position(|doubt| doubt == joint));
                let next = at.map_or(0, |at| (at + 1) % doubts.len());
                match doubts.get(next) {
                    Some(joint) => commands.write_message(ShowDoubt(*joint)),
                    None => commands.write_message(Notice::info("No fit has doubtful joints.")),
                };
            }
            _ => {}
        }
    }
}

/// Reason why chosen faces are for no fit.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
enum RegionError {
    /// No faces.
    #[error("No face is chosen: click a piece of the mesh, or drag a box.")]
    NoFaces,
    /// No joints.
    #[error("No joint is selected: select the joints to move, or choose a part.")]
    NoJoints,
}

/// The request that chosen faces are for, or the reason why there is none.
fn request_of(faces: &ChosenFaces, selected: &[Uid], active: Option<Uid>) -> Result<FitRequest, RegionError> {
    if faces.triangles.is_empty() {
        return Err(RegionError::NoFaces);
    }
    let mut request = FitRequest::new(faces.mesh);
    request.region = FitRegion::Triangles(faces.triangles.iter().copied().collect());
    match &faces.skeleton {
        RegionSkeleton::Selected if selected.is_empty() => {
            return Err(RegionError::NoJoints);
        }
        RegionSkeleton::Selected => request.joints = selected.to_vec(),
        RegionSkeleton::Part(name) => {
            request.template = FitTemplate::Part { part: FitPart::Named(name.clone()), parent: active };
        }
    }
    Ok(request)
}

/// Selects doubtful joints, and frames them once they are selected.
fn show_doubts(
    mut requests: MessageReader<ShowDoubt>,
    active: Option<Res<ActiveRig>>,
    mut is_selected: Local<bool>,
    mut commands: Commands,
) {
    if std::mem::take(&mut *is_selected) {
        commands.write_message(ActionRequest(Action::FrameSelected));
    }
    let (Some(ShowDoubt(joint)), Some(active)) = (requests.read().last(), active) else { return };
    commands.write_message(PickRequest { rig: active.0, what: Pick::Joints(vec![*joint]), add: false });
    *is_selected = true;
}

/// Tells why joints around a moved one stayed where they are.
fn show_refusals(mut failures: MessageReader<RefitFailed>, mut commands: Commands) {
    for RefitFailed { reason, .. } in failures.read() {
        commands.write_message(Notice::error(format!("The joints around it were not fitted again: {reason}.")));
    }
}

/// Tells what a fit found, and selects the joints that it is not sure of.
fn show_result(
    mut answers: MessageReader<FitAnswer>,
    meshes: Query<&SkinOf>,
    selections: Query<&Selection>,
    mut commands: Commands,
) {
    for FitAnswer { mesh, result, .. } in answers.read() {
        let report = match result {
            Ok(report) => report,
            Err(FitFailure::Fit(FitError::Cancelled)) => {
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
            let warnings: Vec<String> = report.warnings().take(2).map(ToString::to_string).collect();
            let reason = if warnings.is_empty() { String::new() } else { format!(" ({})", warnings.join("; ")) };
            Notice::warning(format!("{text}, but the mesh may be something else{reason}: look at the ringed joints."))
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
