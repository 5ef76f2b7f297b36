//! Runs of clicks: clicks, strokes, names and undone steps that follow one another, carried out in one frame.
//!
//! Nobody watches the gestures of a command. Between two clicks on a mesh at rest nothing happens that the second one
//! depends on but the joint of the first, so that entities have to follow the document once for all of them; names and
//! undone steps depend on nothing else, and a stroke that is surely a chain only on the joint on which it starts. A run
//! has at most as many gestures as the rig has joints: frames cost what the joints of the rig cost, and a list takes time in
//! proportion to its length.

use bevy::prelude::*;

use super::{
    Gesture, GestureScript,
    answers::{told_chain, told_step},
    error::GestureError,
    stroke_run::RunJoints,
};
use crate::{
    algo::{stroke::StrokeNote, view::ViewPlane},
    plugins::{
        document::{Change, ChangeError, EditRequest, ReportedStep, Selection},
        limits::RigLimits,
        placement::joint_at,
        stroke::has_few_triangles,
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
    /// True if strokes depend on nothing but the mesh at rest and the joints on which they start.
    pub can_draw: bool,
}

impl RunRig<'_> {
    /// True if the run can go on with a stroke after so many others. Strokes through a large mesh take milliseconds each, and
    /// the time that a command has is looked at between frames.
    fn can_go_on(&self, strokes: usize) -> bool {
        self.can_draw && (strokes < LEAST || self.surface.is_some_and(has_few_triangles))
    }
}

/// Change of a run that is requested.
pub(super) struct RequestedChange {
    /// Index of the answer that it completes.
    answer: usize,
    /// Chain of a stroke.
    chain: Option<ChainAnswer>,
}

/// Chain of a stroke, as its answer tells it.
pub(super) struct ChainAnswer {
    /// Number of joints along the stroke.
    pub joints: usize,
    pub notes: Vec<StrokeNote>,
}

/// Changes that the gestures of a run have requested so far.
#[derive(Clone, Copy, Default)]
struct RunState {
    has_changes: bool,
    /// True after an undone or redone step, which may pose or bind the mesh.
    has_steps: bool,
    /// Number of strokes.
    strokes: usize,
}

impl RunState {
    /// True if a gesture can be the next of the run.
    fn takes(self, gesture: &Gesture) -> bool {
        match gesture {
            Gesture::View(_) | Gesture::Depth(_) | Gesture::Volume(_) | Gesture::Recentre(_) | Gesture::Reach(_) => {
                true
            }
            // The answer to a stroke names the joint that its chain hangs on.
            Gesture::Label(_) | Gesture::Undo | Gesture::Redo => self.strokes == 0,
            Gesture::Click(_) | Gesture::Stroke { .. } => !self.has_steps,
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

/// Requests the changes of the gestures at the front of a script; false if the first of them is none of a run.
pub(super) fn carry_out(
    script: &mut GestureScript,
    run: &RunRig,
    edits: &mut MessageWriter<EditRequest>,
    limits: &RigLimits,
) -> bool {
    let mut joints = RunJoints::new(run);
    let mut has_begun = false;
    let mut state = RunState::default();
    for _ in 0..run.rig.len().max(LEAST) {
        let Some(gesture) = script.waiting.front().filter(|gesture| state.takes(gesture)) else { break };
        let mut start = None;
        if let Gesture::Stroke { points, joints: count, .. } = gesture {
            let (plane, size) = (script.state.plane(run.bounds), (run.bounds[1] - run.bounds[0]).max_element());
            let reach = script.state.reach(run.bounds);
            if !run.can_go_on(state.strokes) {
                break;
            }
            let Some(found) = joints.start(run.rig, &plane, size, reach, points) else { break };
            if count.is_none() && !joints.is_chain(run.rig, &plane, size, reach, points, found) {
                break;
            }
            start = Some(found);
        }
        has_begun = true;
        let Some(gesture) = script.begin_next(run.rig.len(), limits) else { continue };
        state.has_steps |= matches!(gesture, Gesture::Undo | Gesture::Redo);
        let (change, chain) = match (start, gesture) {
            (Some(start), Gesture::Stroke { points, threshold, joints }) => {
                let request = script.state.stroke(run.entity, run.bounds, &points, threshold, joints);
                let Some((change, chain)) = script.drawn_chain(&request, start, run) else { continue };
                state.strokes += 1;
                (change, Some(chain))
            }
            (_, gesture) => {
                let Some(change) = script.run_change(gesture, run) else { continue };
                (change, None)
            }
        };
        joints.note(&change);
        state.has_changes = true;
        if !matches!(change, Change::Select(_)) {
            script.requested.push_back(RequestedChange { answer: script.answers.len() - 1, chain });
        }
        edits.write(EditRequest { rig: run.entity, change });
    }
    script.pending = !script.requested.is_empty();
    has_begun
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
    pub(super) fn take_report(&mut self, step: &Result<ReportedStep, ChangeError>, rig: &Rig) {
        let Some(RequestedChange { answer: number, chain }) = self.requested.pop_front() else { return };
        self.pending = !self.requested.is_empty();
        let Some(answer) = self.answers.get_mut(number) else { return };
        match step {
            Ok(step) => {
                answer.joints_added = step.added;
                if let (Some(told), Some(drawn)) = (chain, step.chain) {
                    answer.message = told_chain(rig, told.joints, drawn.parent, &told.notes);
                }
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
