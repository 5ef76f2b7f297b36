//! Runs of clicks: clicks, names and undone steps that follow one another, carried out in one frame.
//!
//! Nobody watches the gestures of a command. Between two clicks on a mesh at rest nothing happens that the second one
//! depends on but the joint of the first, so that entities have to follow the document once for all of them; names and
//! undone steps depend on nothing else. A run has at most as many gestures as the rig has joints: frames cost what the
//! joints of the rig cost, and a list takes time in proportion to its length.

use bevy::prelude::*;

use super::{Gesture, GestureScript, answers::told_step, error::GestureError};
use crate::{
    algo::view::ViewPlane,
    plugins::{
        document::{Change, ChangeError, EditRequest, ReportedStep, Selection},
        limits::RigLimits,
        placement::joint_at,
        surface::RigSurface,
    },
    rig::Rig,
};

/// Number of gestures that a run may have on a rig of fewer joints.
const LEAST: usize = 64;

/// Rig on which a run is carried out.
pub(super) struct RunRig<'a> {
    pub entity: Entity,
    pub rig: &'a Rig,
    pub selection: &'a Selection,
    pub surface: Option<&'a RigSurface>,
    /// Least and greatest corner of the surface.
    pub bounds: [Vec3; 2],
}

/// Changes that the gestures of a run have requested so far.
#[derive(Clone, Copy, Default)]
struct RunState {
    has_changes: bool,
    /// True after an undone or redone step, which may pose or bind the mesh.
    has_steps: bool,
}

impl RunState {
    /// True if a gesture can be the next of the run.
    fn takes(self, gesture: &Gesture) -> bool {
        match gesture {
            Gesture::View(_) | Gesture::Depth(_) | Gesture::Volume(_) | Gesture::Recentre(_) | Gesture::Reach(_) => {
                true
            }
            Gesture::Label(_) | Gesture::Undo | Gesture::Redo => true,
            Gesture::Click(_) => !self.has_steps,
            // A selection that is cleared at once is a pick, which ends the cycle of clicks at one spot, as edits do.
            Gesture::Deselect => self.has_changes,
            _ => false,
        }
    }
}

/// True if the next gestures of a script make a run: the rig is at rest, and no joint of it moves the mesh.
pub(super) fn is_due(script: &GestureScript, rig: &Rig, surface: Option<&RigSurface>) -> bool {
    script.is_unwatched
        && script.waiting.front().is_some_and(|gesture| RunState::default().takes(gesture))
        && rig.pose().is_empty()
        && rig.skins().next().is_none()
        && surface.is_none_or(|surface| !surface.is_stale())
}

/// Requests the changes of the gestures at the front of a script.
pub(super) fn carry_out(
    script: &mut GestureScript,
    run: &RunRig,
    edits: &mut MessageWriter<EditRequest>,
    limits: &RigLimits,
) {
    let mut state = RunState::default();
    for _ in 0..run.rig.len().max(LEAST) {
        if !script.waiting.front().is_some_and(|gesture| state.takes(gesture)) {
            break;
        }
        let Some(gesture) = script.begin_next(run.rig.len(), limits) else { continue };
        state.has_steps |= matches!(gesture, Gesture::Undo | Gesture::Redo);
        let Some(change) = script.run_change(gesture, run) else { continue };
        state.has_changes = true;
        if !matches!(change, Change::Select(_)) {
            script.requested.push_back(script.answers.len() - 1);
        }
        edits.write(EditRequest { rig: run.entity, change });
    }
    script.pending = !script.requested.is_empty();
}

impl GestureScript {
    /// Change that a gesture of a run requests; `None` for settings, and for clicks that meet nothing.
    fn run_change(&mut self, gesture: Gesture, run: &RunRig) -> Option<Change> {
        match gesture {
            Gesture::Click(at) => {
                let ray = ViewPlane::orthographic(self.state.view, run.bounds).ray(at.into());
                let placed = joint_at(run.rig, run.selection, run.surface, &ray, self.state.place);
                self.tell_placement(&placed.placement, None);
                placed.rest.map(Change::Place)
            }
            Gesture::Label(label) => Some(Change::LabelActive(label)),
            Gesture::Deselect => Some(Change::Select(Vec::new())),
            Gesture::Undo => Some(Change::Undo),
            Gesture::Redo => Some(Change::Redo),
            setting => {
                self.state.take_setting(&setting);
                None
            }
        }
    }

    /// Completes the answer of the first gesture of a run whose change was requested.
    pub(super) fn take_report(&mut self, step: &Result<ReportedStep, ChangeError>) {
        let Some(number) = self.requested.pop_front() else { return };
        self.pending = !self.requested.is_empty();
        let Some(answer) = self.answers.get_mut(number) else { return };
        match step {
            Ok(step) => {
                answer.joints_added = step.added;
                // A click has told where its joint is.
                if answer.message.is_empty() {
                    answer.message = told_step(&step.name, step.joints);
                }
            }
            Err(reason) => {
                answer.done = false;
                answer.message = GestureError::from(reason.clone()).to_string();
                self.refused_changes += 1;
            }
        }
    }
}
