//! Builds in the window: a rig with commands is built as soon as it is open, and what goes wrong is said.

use bevy::prelude::*;

use super::{
    ActiveRig,
    actions::{Action, ActionRequest},
    counts::built_commands,
    mode::Mode,
    notice::Notice,
};
use crate::{
    plugins::{
        RigSystems,
        commands::{BuildDone, BuildFailure, BuildRequest, BuildStep, Processor, RunFailure},
        controls::ControlsInUse,
        drawing::RigDrawing,
    },
    rig::{Rig, TagKind},
};

/// Plugin of builds in the window.
pub struct BuildingPlugin;

impl Plugin for BuildingPlugin {
    fn build(&self, app: &mut App) {
        app.init_resource::<ControlsInUse>().add_message::<ActionRequest>().add_message::<Notice>().add_systems(
            Update,
            (
                (build_open_rig, carry_out).chain().after(RigSystems::Edits).before(RigSystems::Build),
                use_controls.before(RigSystems::Pick),
                report_failures.after(RigSystems::Build),
            ),
        );
    }
}

/// Builds the active rig once it has commands. From then on it follows every edit.
fn build_open_rig(
    active: Option<Res<ActiveRig>>,
    rigs: Query<Ref<Rig>, Without<Processor>>,
    mut requests: MessageWriter<BuildRequest>,
) {
    let Some(active) = active else { return };
    let Ok(rig) = rigs.get(active.0) else { return };
    if !rig.is_changed() && !active.is_changed() {
        return;
    }
    let has_commands =
        rig.walk().any(|joint| joint.data.tags.iter().any(|tag| matches!(tag.kind, TagKind::Command { .. })));
    if has_commands {
        requests.write(BuildRequest { rig: active.0, step: BuildStep::All });
    }
}

/// Carries out the actions that build, step and roll back.
fn carry_out(
    mut actions: MessageReader<ActionRequest>,
    active: Option<Res<ActiveRig>>,
    mut requests: MessageWriter<BuildRequest>,
) {
    let Some(active) = active else { return };
    for ActionRequest(action) in actions.read() {
        let step = match action {
            Action::Build => BuildStep::All,
            Action::RollBack => BuildStep::RollBack,
            Action::StepForward => BuildStep::Forward,
            Action::StepBack => BuildStep::Back,
            _ => continue,
        };
        requests.write(BuildRequest { rig: active.0, step });
    }
}

/// Controls are in use where people select and pose, unless they are hidden.
pub(super) fn use_controls(
    mode: Option<Res<Mode>>,
    drawing: Option<Res<RigDrawing>>,
    mut in_use: ResMut<ControlsInUse>,
) {
    let is_mode = mode.is_none_or(|mode| matches!(*mode, Mode::Select | Mode::Pose));
    in_use.set_if_neq(ControlsInUse(is_mode && drawing.is_none_or(|drawing| drawing.controls)));
}

/// Rig whose failure changed since the last frame.
type NewFailure = (Changed<BuildFailure>, With<Rig>);
/// Rig whose program newly fails to run.
type NewRunFailure = (Changed<RunFailure>, With<Rig>);

/// Says why a build stopped, and how far a requested one came.
fn report_failures(
    active: Option<Res<ActiveRig>>,
    failures: Query<&BuildFailure, NewFailure>,
    run_failures: Query<(&RunFailure, &Rig), NewRunFailure>,
    processors: Query<&Processor>,
    mut done: MessageReader<BuildDone>,
    mut place: Local<Option<usize>>,
    mut notices: MessageWriter<Notice>,
) {
    let Some(active) = active else { return };
    if let Ok(failure) = failures.get(active.0) {
        notices.write(Notice::error(format!("The build stopped: {}", failure.0)).at("Process"));
    }
    if let Ok((failure, rig)) = run_failures.get(active.0) {
        notices.write(Notice::error(format!("The built rig cannot run: {}", failure.words(rig))).at("Process"));
    }
    let Some(done) = done.read().filter(|done| done.rig == active.0).last() else { return };
    let Ok(processor) = processors.get(active.0) else { return };
    if place.replace(done.report.cursor) != Some(done.report.cursor) && !processor.builder().is_empty() {
        notices.write(Notice::done(format!("Built {}.", built_commands(processor.builder()))).quiet());
    }
}
