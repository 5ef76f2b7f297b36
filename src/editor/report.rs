//! Report of the window's state, as a line of JSON in a file: for programs that drive the window with mouse and
//! keyboard.
//!
//! The report is off unless `RIGSMITH_WINDOW_REPORT` names the file. Every change replaces the file in one rename. While it
//! is on, panels tell their widgets as they tell screen readers, so that a program finds a button by its name.

mod handles;

use std::{collections::BTreeMap, path::PathBuf};

use bevy::{ecs::system::SystemParam, prelude::*, window::PrimaryWindow};
use bevy_egui::{EguiContext, EguiOutput, PrimaryEguiContext, egui::accesskit};
use serde::{Deserialize, Serialize};

use self::handles::ControlHandles;
use super::{
    ActiveRig,
    camera::ViewportSight,
    files::{LoadJob, dialog::Dialog},
    mode::Mode,
    notice::StatusLine,
    pointer::ViewportArea,
};
use crate::{
    instance::UpdateOffer,
    plugins::{
        commands::{BuildDone, Processor},
        document::{JointEntities, Selection},
        fit::FitJob,
        history::RigHistory,
        skinning::SkinningJob,
        surface::{RigMeshes, RigSurface},
    },
    rig::{Rig, Uid, animation::RigClip},
};

/// Plugin that writes the report if the environment requests it.
pub struct ReportPlugin;

impl Plugin for ReportPlugin {
    fn build(&self, app: &mut App) {
        if let Some(path) = std::env::var_os("RIGSMITH_WINDOW_REPORT").filter(|path| !path.is_empty()) {
            app.insert_resource(ReportFile { path: path.into(), written: None, ran: 0 })
                .add_systems(PostStartup, tell_widgets)
                .add_systems(Last, write);
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
    /// Uids of joints by their labels.
    pub labels: BTreeMap<String, String>,
    /// Pixels of the window at which a press takes a control, by the control's name, in Pose mode. Selected nodes have handles
    /// of their own, which come first.
    pub controls: BTreeMap<String, [f32; 2]>,
    /// The viewport in the window: left, top, width and height.
    pub viewport: [f32; 4],
    /// Positions in pixels of the window of the corners (0,0,0), (1,0,0), (0,1,0) and (0,0,1) of the unit cube at the
    /// rig's origin. They are enough to aim in an orthographic view.
    pub axes: [Option<[f32; 2]>; 4],
    /// The status line.
    pub status: String,
    /// Number of commands in effect, and of all.
    pub commands: [usize; 2],
    /// Number of commands that the last build carried out.
    pub ran: usize,
    /// Number of keys of all clips.
    pub keys: usize,
    /// Number of changes that the file of the rig's template offers.
    pub offered: usize,
    /// Labels of the selected joints, and names of the selected nodes; the uid of one without.
    pub selection: Vec<String>,
    /// Place of the pointer in pixels of the window, whole; `None` outside of the window.
    pub pointer: Option<[f32; 2]>,
    /// Marks that a button of the mouse is pressed.
    pub pressed: bool,
    /// Widgets of the last frame that have a name, in the order of drawing.
    pub widgets: Vec<ReportedWidget>,
}

/// Widget of the window, as screen readers know it.
#[derive(Serialize, Deserialize, Debug, Clone, PartialEq, Default)]
#[serde(default)]
pub struct ReportedWidget {
    /// Name.
    pub name: String,
    /// Value of a field.
    pub value: String,
    /// Left, top, width and height in pixels of the window.
    pub place: [f32; 4],
    /// Marks a widget that can be used.
    pub enabled: bool,
}

/// File of the report.
#[derive(Resource)]
struct ReportFile {
    path: PathBuf,
    written: Option<WindowReport>,
    ran: usize,
}

/// Lets panels tell their widgets.
fn tell_widgets(mut contexts: Query<&mut EguiContext, With<PrimaryEguiContext>>) {
    for mut context in &mut contexts {
        context.get_mut().enable_accesskit();
    }
}

/// Widgets of the panels, from what they tell.
fn widgets(output: &EguiOutput) -> Vec<ReportedWidget> {
    let update = output.platform_output.accesskit_update.as_ref();
    let nodes = update.map_or(&[] as &[_], |update| update.nodes.as_slice());
    nodes.iter().filter_map(|(_, node)| reported(node)).collect()
}

fn reported(node: &accesskit::Node) -> Option<ReportedWidget> {
    let bounds = node.bounds()?;
    let (name, value) = (node.label().unwrap_or_default(), node.value().unwrap_or_default());
    let place = [bounds.x0, bounds.y0, bounds.x1 - bounds.x0, bounds.y1 - bounds.y0].map(|side| side.round() as f32);
    let is_told = !(name.is_empty() && value.is_empty());
    is_told.then(|| ReportedWidget {
        name: name.to_owned(),
        value: value.to_owned(),
        place,
        enabled: !node.is_disabled(),
    })
}

/// Builds, panels and the hand on the mouse, for the report.
#[derive(SystemParam)]
struct Progress<'w, 's> {
    rigs: Query<'w, 's, (Option<&'static Processor>, Option<&'static UpdateOffer>)>,
    builds: MessageReader<'w, 's, BuildDone>,
    handles: ControlHandles<'w, 's>,
    outputs: Query<'w, 's, &'static EguiOutput, With<PrimaryEguiContext>>,
    windows: Query<'w, 's, &'static Window, With<PrimaryWindow>>,
    buttons: Option<Res<'w, ButtonInput<MouseButton>>>,
}

fn write(
    mut file: ResMut<ReportFile>,
    rig: Option<Res<ActiveRig>>,
    rigs: Query<(&Rig, &Selection, &RigHistory, &JointEntities, Option<&RigMeshes>, Option<&RigSurface>)>,
    places: Query<&GlobalTransform>,
    jobs: Query<(), Or<(With<SkinningJob>, With<FitJob>)>>,
    (mode, loading, status): (Res<Mode>, Res<LoadJob>, Res<StatusLine>),
    (area, sight, dialog): (Res<ViewportArea>, Res<ViewportSight>, Res<Dialog>),
    mut progress: Progress,
) {
    let mut report = WindowReport {
        mode: mode.name().to_owned(),
        asked: dialog.question().is_some(),
        viewport: [area.min.x, area.min.y, area.size.x, area.size.y],
        status: status.obstacle.clone().unwrap_or_else(|| status.hint.clone()),
        ..default()
    };
    if let Some(done) = progress.builds.read().last() {
        file.ran = done.report.executed.len();
    }
    report.ran = file.ran;
    let pointer = progress.windows.single().ok().and_then(Window::cursor_position);
    report.pointer = pointer.map(|at| at.round().to_array());
    report.pressed = progress.buttons.as_ref().is_some_and(|buttons| buttons.get_pressed().next().is_some());
    report.widgets = progress.outputs.iter().next().map(widgets).unwrap_or_default();
    let mut surface_busy = false;
    let active = rig.map(|rig| rig.0);
    if let Some((processor, offer)) = active.and_then(|rig| progress.rigs.get(rig).ok()) {
        report.commands = processor.map_or([0; 2], |processor| {
            let builder = processor.builder();
            [builder.cursor(), builder.len()]
        });
        report.offered = offer.map_or(0, |offer| offer.changes.len());
    }
    let active = active.and_then(|entity| Some((entity, rigs.get(entity).ok()?)));
    if let Some((entity, (rig, selection, history, entities, meshes, surface))) = active {
        report.keys = rig.clips().iter().map(RigClip::key_count).sum();
        let label = |node: &Uid| match rig.joint(*node) {
            Some(joint) => joint.data.label.clone(),
            None => progress.handles.name(entity, *node),
        };
        report.selection = selection.0.iter().map(|node| label(node).unwrap_or_else(|| node.to_string())).collect();
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
            if *mode == Mode::Pose {
                let handles = progress.handles.pixels(entity, &sight).into_iter();
                report.controls = handles.map(|(name, at)| (name, (at + area.min).round().to_array())).collect();
            }
            report.axes = [Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z].map(pixel);
            for joint in rig.walk() {
                if let Some(label) = &joint.data.label {
                    report.labels.insert(label.clone(), joint.data.uid.to_string());
                }
                let place = entities.get(joint.data.uid).and_then(|entity| places.get(entity).ok());
                if let Some(at) = place.and_then(|place| pixel(place.translation())) {
                    report.places.insert(joint.data.uid.to_string(), at);
                }
            }
        }
    }
    report.busy = loading.name().is_some() || !jobs.is_empty() || surface_busy;
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
