//! Runs of clicks: clicks, strokes, names, groups, locks, operations on selected joints, picks and undone steps that follow one
//! another, carried out in one frame.
//!
//! Nobody watches the gestures of a command. Between two clicks on a mesh at rest nothing happens that the second one
//! depends on but the joint of the first, so that entities have to follow the document once for all of them; names, groups and
//! undone steps depend on nothing else, a stroke that is surely a chain only on the joint on which it starts, and a pick on
//! where the joints are. A run has at most as many gestures as the rig has joints and groups: frames cost what these cost, and a
//! list takes time in proportion to its length.

use bevy::{ecs::message::MessageId, prelude::*};

use super::{
    Gesture, GestureScript,
    answers::{told_chain, told_step},
    error::GestureError,
    operation::{is_on_selection, on_selection},
    pick_run::RunPicks,
    stroke_run::RunJoints,
};
use crate::{
    algo::{stroke::StrokeNote, view::ViewPlane},
    plugins::{
        document::{Change, ChangeError, EditRequest, JointPick, ReportedStep, Selection, SelectionOperation},
        limits::RigLimits,
        placement::joint_at,
        stroke::has_few_triangles,
        surface::RigSurface,
    },
    rig::{Rig, operations::MirrorPlane},
};

/// Number of gestures that a run may have on a rig of fewer joints and groups.
const LEAST: usize = 64;

/// Number of joints at which the mirrored operations of one run may look: each of them looks at all joints of the rig.
const MOST_LOOKS: usize = 1 << 20;

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
    /// True if nothing but the last click depends on what is picked.
    pub can_pick: bool,
    /// Plane of live mirroring, the same for all gestures of the run.
    pub symmetry: Option<MirrorPlane>,
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
    request: MessageId<EditRequest>,
    /// Index of the answer that it completes.
    pub answer: usize,
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
    /// True if a joint is selected.
    has_active: bool,
    /// True after a change of the rig, which ends the cycle of clicks at one spot.
    has_changes: bool,
    /// True if the last change is one of the rig, and not a pick.
    is_edited: bool,
    /// True after an undone or redone step, which may pose or bind the mesh, or an operation, which may move joints.
    has_steps: bool,
    /// True after an undone or redone step, which may bring joints back with their tags.
    has_undone: bool,
    /// True after a joint was added.
    has_joints: bool,
    /// True after a joint was picked.
    has_picks: bool,
    /// Number of strokes.
    strokes: usize,
    /// Number of joints that are selected, at most.
    selected: usize,
    /// Number of joints that operations were about.
    operated: usize,
    /// Number of mirrored operations.
    mirrored: usize,
}

impl RunState {
    /// True if a gesture can be the next of the run; `next` is the one behind it.
    fn takes(self, gesture: &Gesture, next: Option<&Gesture>, can_pick: bool) -> bool {
        let picks = can_pick && self.strokes == 0 && self.has_changes;
        match gesture {
            setting if setting.is_setting() => true,
            Gesture::Group(..) | Gesture::Lock(_) => true,
            // On a rig without commands and skins, an operation depends on nothing but its joints and the selection.
            operation if is_on_selection(operation) => can_pick && self.strokes == 0 && !self.has_undone,
            // The answer to a stroke names the joint that its chain hangs on.
            Gesture::Label(_) | Gesture::Labels(_) | Gesture::Undo | Gesture::Redo => self.strokes == 0,
            Gesture::Click(_) => !self.has_steps,
            Gesture::Stroke { .. } => !self.has_steps && !self.has_picks,
            // A selection that is cleared at once is a pick, which ends the cycle of clicks at one spot, as edits do.
            Gesture::Deselect => self.has_changes,
            Gesture::SelectLabel(_) => picks,
            // Between two edits no other click at that spot can follow.
            Gesture::Select(_) => {
                let is_apart = self.is_edited && !self.has_joints && !self.has_steps;
                let is_left = matches!(next, Some(Gesture::Group(..) | Gesture::Lock(_) | Gesture::Label(_)));
                picks && is_apart && is_left
            }
            _ => false,
        }
    }

    /// Takes over a change that is requested.
    fn note(&mut self, change: &Change) {
        let is_edit = match change {
            Change::Place(_) | Change::Draw { .. } => {
                (self.has_joints, self.has_active, self.selected) = (true, true, 1);
                true
            }
            Change::Undo | Change::Redo => {
                (self.has_steps, self.has_undone) = (true, true);
                true
            }
            // Joints are elsewhere then, and clicks and strokes start anew.
            Change::OperateSelected(operation) => {
                let is_edit = self.has_active;
                self.has_steps = true;
                self.operated += self.selected.max(1);
                self.mirrored += usize::from(matches!(operation, SelectionOperation::Mirror));
                self.has_active &= !matches!(operation, SelectionOperation::Delete { .. });
                is_edit
            }
            Change::Select(joints) => {
                (self.has_active, self.selected) = (!joints.is_empty(), joints.len());
                false
            }
            Change::Pick(_) => {
                (self.has_picks, self.has_active, self.selected) = (true, true, 1);
                false
            }
            _ => self.has_active,
        };
        self.has_changes |= is_edit;
        self.is_edited = is_edit;
    }
}

/// True if the next gestures of a script make a run: the rig is at rest, and no joint of it moves the mesh.
pub(super) fn is_due(script: &GestureScript, rig: &Rig, surface: Option<&RigSurface>) -> bool {
    script.is_unwatched
        && script.waiting.front().is_some_and(|gesture| RunState::default().takes(gesture, None, true))
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
    let (mut joints, mut picks) = (RunJoints::new(run), RunPicks::default());
    let mut has_begun = false;
    let selected = run.selection.0.len();
    let mut state = RunState { has_active: run.selection.active().is_some(), selected, ..RunState::default() };
    let most = run.rig.len().max(run.rig.groups().len()).max(LEAST);
    for _ in 0..most {
        let (gesture, next) = (script.waiting.front(), script.waiting.get(1));
        let Some(gesture) = gesture.filter(|gesture| state.takes(gesture, next, run.can_pick)) else { break };
        // The time that a command has is looked at between frames.
        if is_on_selection(gesture) && state.operated > 0 && state.operated + state.selected > most {
            break;
        }
        if matches!(gesture, Gesture::MirrorSelected) && state.mirrored.saturating_mul(run.rig.len()) > MOST_LOOKS {
            break;
        }
        let mut pick = None;
        if let Gesture::Select(point) = gesture {
            let Some(found) = picks.picked(run, &script.state.plane(run.bounds), (*point).into()) else { break };
            pick = Some(found);
        }
        let mut start = None;
        if let Gesture::Stroke { points, joints: count, .. } = gesture {
            let (plane, size) = (script.state.plane(run.bounds), (run.bounds[1] - run.bounds[0]).max_element());
            let reach = script.state.reach(run.bounds);
            if !run.can_go_on(state.strokes) {
                break;
            }
            let Some(found) = joints.start(run, &plane, size, reach, points) else { break };
            if count.is_none() && !joints.is_chain(run.rig, &plane, size, reach, points, found) {
                break;
            }
            start = Some(found);
        }
        has_begun = true;
        let Some(gesture) = script.begin_next(run.rig.len(), run.surface, limits) else { continue };
        let (change, chain) = match (start, gesture) {
            (_, Gesture::Select(_)) => {
                let Some(joint) = pick else { continue };
                (Change::Pick(JointPick::Joint(joint)), None)
            }
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
        joints.note(&change, run.symmetry.as_ref());
        state.note(&change);
        let is_answered = !matches!(change, Change::Select(_));
        let request = edits.write(EditRequest { rig: run.entity, change });
        if is_answered {
            let answer = script.answers.len() - 1;
            script.requested.push_back(RequestedChange { request, answer, chain });
        }
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
            Gesture::Labels(names) => Some(Change::LabelChain(names)),
            Gesture::Group(name, color) => Some(Change::GroupSelected { name, color: color.map(<[f32; 3]>::from) }),
            Gesture::Lock(locked) => Some(Change::LockSelected(locked)),
            Gesture::SelectLabel(label) => Some(Change::Pick(JointPick::Label(label))),
            Gesture::Deselect => Some(Change::Select(Vec::new())),
            Gesture::Undo => Some(Change::Undo),
            Gesture::Redo => Some(Change::Redo),
            other => {
                if let Some(operation) = on_selection(&other, &self.state.plane(run.bounds)) {
                    return Some(Change::OperateSelected(operation));
                }
                self.state.take_setting(&other);
                None
            }
        }
    }

    /// Completes the answer of the gesture of a run that requested a change.
    pub(super) fn take_report(
        &mut self,
        request: MessageId<EditRequest>,
        step: &Result<ReportedStep, ChangeError>,
        rig: &Rig,
    ) {
        // All but undone steps that waited come in their order.
        let at = self.requested.iter().position(|change| change.request == request);
        let requested = at.and_then(|at| self.requested.remove(at));
        let Some(RequestedChange { answer: number, chain, .. }) = requested else { return };
        self.pending = !self.requested.is_empty();
        let Some(answer) = self.answers.get_mut(number) else { return };
        match step {
            Ok(step) => {
                answer.joints_added = step.added;
                if let (Some(told), Some(drawn)) = (chain, step.chain) {
                    answer.message = told_chain(rig, told.joints, drawn.parent, &told.notes);
                }
                if let Some(name) = &step.picked {
                    answer.message = format!("selected {name}");
                }
                // A click has told where its joint is.
                if answer.message.is_empty() {
                    answer.message = told_step(&step.name, step.joints);
                }
            }
            Err(reason) => {
                answer.done = false;
                answer.message = GestureError::from(reason.clone()).to_string();
            }
        }
    }
}
