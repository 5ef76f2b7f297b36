//! Report of the window's state, as a line of JSON in a file: for programs that drive the window with mouse and
//! keyboard.
//!
//! The report is off unless `RIGSMITH_WINDOW_REPORT` names the file. Every change replaces the file in one rename.

use std::{collections::BTreeMap, path::PathBuf};

use bevy::prelude::*;
use serde::{Deserialize, Serialize};

use super::{
    ActiveRig,
    camera::ViewportSight,
    files::{LoadJob, dialog::Dialog},
    mode::Mode,
    notice::StatusLine,
    pointer::ViewportArea,
};
use crate::{
    plugins::{
        document::{JointEntities, Selection},
        fit::FitJob,
        history::RigHistory,
        skinning::SkinningJob,
        surface::{RigMeshes, RigSurface},
    },
    rig::Rig,
};

/// Plugin that writes the report if the environment requests it.
pub struct ReportPlugin;

impl Plugin for ReportPlugin {
    fn build(&self, app: &mut App) {
        if let Some(path) = std::env::var_os("RIGSMITH_WINDOW_REPORT").filter(|path| !path.is_empty()) {
            app.insert_resource(ReportFile { path: path.into(), written: None }).add_systems(Last, write);
        }
    }
}

/// State of the window.
#[derive(Serialize, Deserialize, Debug, Clone, PartialEq, Default)]
#[serde(default)]
pub struct WindowReport {
    /// The mode's name.
    pub mode: String,
    /// Marks that a file is being opened, weights are computed, a template is fitted or the surface is being prepared.
    pub busy: bool,
    /// Marks an open question: a file to save to, or unsaved work.
    pub asked: bool,
    /// Number of joints of the rig.
    pub joints: usize,
    /// Number of selected joints.
    pub selected: usize,
    /// Names of the steps.
    pub steps: Vec<String>,
    /// Number of steps in effect.
    pub head: usize,
    /// Number of meshes with weights.
    pub skinned: usize,
    /// Number of joints that are not at rest.
    pub posed: usize,
    /// Positions of joints in pixels of the window, by uid.
    pub places: BTreeMap<String, [f32; 2]>,
    /// The viewport in the window: left, top, width and height.
    pub viewport: [f32; 4],
    /// Positions in pixels of the window of the corners (0,0,0), (1,0,0), (0,1,0) and (0,0,1) of the unit cube at the
    /// rig's origin. They are enough to aim in an orthographic view.
    pub axes: [Option<[f32; 2]>; 4],
    /// The status line.
    pub status: String,
}

/// File of the report.
#[derive(Resource)]
struct ReportFile {
    path: PathBuf,
    written: Option<WindowReport>,
}

fn write(
    mut file: ResMut<ReportFile>,
    rig: Option<Res<ActiveRig>>,
    rigs: Query<(&Rig, &Selection, &RigHistory, &JointEntities, Option<&RigMeshes>, Option<&RigSurface>)>,
    places: Query<&GlobalTransform>,
    jobs: Query<(), Or<(With<SkinningJob>, With<FitJob>)>>,
    (mode, loading, status): (Res<Mode>, Res<LoadJob>, Res<StatusLine>),
    (area, sight, dialog): (Res<ViewportArea>, Res<ViewportSight>, Res<Dialog>),
) {
    let mut report = WindowReport {
        mode: mode.name().to_owned(),
        asked: dialog.question().is_some(),
        viewport: [area.min.x, area.min.y, area.size.x, area.size.y],
        status: status.obstacle.clone().unwrap_or_else(|| status.hint.clone()),
        ..default()
    };
    let mut surface_busy = false;
    if let Some((rig, selection, history, entities, meshes, surface)) = rig.and_then(|rig| rigs.get(rig.0).ok()) {
        let (steps, head) = history.steps();
        report.joints = rig.len();
        report.selected = selection.0.len();
        report.steps = steps.into_iter().map(|name| name.to_string()).collect();
        report.head = head;
        report.skinned = rig.skins().count();
        report.posed = rig.pose().len();
        surface_busy = match surface {
            Some(surface) => surface.is_stale() || surface.ready().is_none(),
            None => meshes.is_some_and(|meshes| meshes.iter().next().is_some()),
        };
        if let Some(sight) = sight.0 {
            let pixel = |place: Vec3| sight.project(place).map(|at| (at + area.min).round().to_array());
            report.axes = [Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z].map(pixel);
            for joint in rig.walk() {
                let place = entities.get(joint.data.uid).and_then(|entity| places.get(entity).ok());
                if let Some(at) = place.and_then(|place| pixel(place.translation())) {
                    report.places.insert(joint.data.uid.to_string(), at);
                }
            }
        }
    }
    report.busy = loading.what().is_some() || !jobs.is_empty() || surface_busy;
    if file.written.as_ref() == Some(&report) {
        return;
    }
    let Ok(text) = serde_json::to_string(&report) else { return };
    let beside = file.path.with_extension("part");
    let written = std::fs::write(&beside, text).and_then(|()| std::fs::rename(&beside, &file.path));
    if let Err(error) = written {
        warn!("{}: {error}", file.path.display());
    }
    file.written = Some(report);
}
