//! Execution of gestures, one a frame or in runs.

use std::collections::VecDeque;

use bevy::{
    ecs::{message::MessageId, system::SystemParam},
    prelude::*,
};

use super::{
    Gesture,
    answers::Answers,
    click_run::{self, RequestedChange, RunRig},
    error::GestureError,
    operation::{check_proportion, on_selection},
    selection_run::{self, RequestedSelections},
};
use crate::{
    algo::{
        placement::PlaceSettings,
        stroke::{ChainChoice, StrokeSettings},
        view::{View, ViewPlane},
    },
    plugins::{
        commands::BuildResult,
        document::{Change, EditRequest, Selection, Symmetry, awaited_steps::AwaitedSteps, chain_labels},
        fit::{FitMarkers, FitPart, FitRequest, FitTemplate, FittedRig},
        limits::{Limit, RigLimits},
        picking::{Pick, PickRequest},
        placement::PlaceRequest,
        stroke::{StrokeParent, StrokeRequest, StrokeTips},
        surface::{RigMeshes, RigSurface},
    },
    rig::{
        Rig, Uid,
        operations::{MirrorPlane, Operation},
    },
};

/// Name of a list of gestures in errors.
const LIST: &str = "gestures";
/// Beginning of the names of parts.
const PARTS: &str = "parts/";

/// Gestures to carry out on the rig of this entity, and the answers so far.
#[derive(Component, Reflect, Default)]
#[reflect(Component, Default, from_reflect = false)]
pub struct GestureScript {
    #[reflect(ignore)]
    pub(super) waiting: VecDeque<Gesture>,
    /// Answers, one for each finished gesture, in order.
    pub answers: Vec<GestureAnswer>,
    #[reflect(ignore)]
    pub(super) state: UserState,
    pub(super) pending: bool,
    /// Answer to the last gesture that was carried out alone.
    #[reflect(ignore)]
    pub(super) awaited: Option<AwaitedAnswer>,
    /// True if gestures that follow one another are carried out in one frame where they can be.
    pub(super) is_unwatched: bool,
    /// Changes of a run that are requested, and complete its answers.
    #[reflect(ignore)]
    pub(super) requested: VecDeque<RequestedChange>,
    /// Selections that are requested.
    #[reflect(ignore)]
    pub(super) selections: RequestedSelections,
}

/// Request of a gesture, whose answer is the gesture's.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum AwaitedAnswer {
    Edit(MessageId<EditRequest>),
    Pick(MessageId<PickRequest>),
    Place(MessageId<PlaceRequest>),
    Stroke(MessageId<StrokeRequest>),
    /// Fit of this mesh.
    Fit(Entity),
}

/// Answer to a gesture.
#[derive(Reflect, Debug, Clone, PartialEq, Default, serde::Serialize)]
pub struct GestureAnswer {
    /// Number of the gesture in the list, from one.
    pub number: usize,
    /// Name of the gesture.
    pub gesture: String,
    /// Success; `false` if there was nothing to act on or the change was refused.
    pub done: bool,
    /// Description for people. Empty for settings.
    pub message: String,
    /// Number of joints that it added.
    pub joints_added: usize,
    /// True if the time was over before the gesture was done, and the gestures behind it were left out.
    #[serde(skip)]
    pub out_of_time: bool,
}

/// State of the simulated user between gestures.
pub(super) struct UserState {
    pub(super) view: View,
    pub(super) place: PlaceSettings,
    recentre: bool,
    reach: Option<f32>,
    pub(super) joints_before: usize,
}

impl Default for UserState {
    fn default() -> Self {
        Self { view: View::Front, place: PlaceSettings::default(), recentre: true, reach: None, joints_before: 0 }
    }
}

impl UserState {
    /// Takes over a setting of the view or of placing; false for any other gesture.
    pub(super) fn take_setting(&mut self, gesture: &Gesture) -> bool {
        match gesture {
            Gesture::View(view) => self.view = *view,
            Gesture::Depth(depth) => self.place.depth = *depth,
            Gesture::Volume(number) => self.place.volume = (*number > 0).then_some(*number),
            Gesture::Recentre(on) => self.recentre = *on,
            Gesture::Reach(reach) => self.reach = Some(*reach),
            _ => return false,
        }
        true
    }

    /// View plane of a model between two corners.
    pub(super) fn plane(&self, bounds: [Vec3; 2]) -> ViewPlane {
        ViewPlane::orthographic(self.view, bounds)
    }

    /// Distance, in model units, up to which a point is on a joint.
    pub(super) fn reach(&self, bounds: [Vec3; 2]) -> f32 {
        self.reach.unwrap_or(0.005 * (bounds[1] - bounds[0]).max_element())
    }

    /// Request of a stroke on a rig whose model lies between two corners.
    pub(super) fn stroke(
        &self,
        rig: Entity,
        bounds: [Vec3; 2],
        points: &[(f32, f32)],
        threshold: Option<f32>,
        joints: Option<usize>,
    ) -> StrokeRequest {
        let choice = match (joints, threshold) {
            (Some(count), _) => ChainChoice::Joints(count),
            (None, Some(threshold)) => ChainChoice::Threshold(threshold),
            (None, None) => ChainChoice::Limb(0.02 * (bounds[1] - bounds[0]).max_element()),
        };
        StrokeRequest {
            rig,
            plane: self.plane(bounds),
            points: points.iter().map(|point| Vec2::from(*point)).collect(),
            choice,
            settings: StrokeSettings { place: self.place, recentre: self.recentre },
            chain_only: joints.is_some(),
            reach: self.reach(bounds),
            parent: StrokeParent::Selected,
            chain: None,
        }
    }
}

impl GestureScript {
    /// A script of these gestures.
    pub fn new(gestures: impl IntoIterator<Item = Gesture>) -> Self {
        Self { waiting: gestures.into_iter().collect(), ..Self::default() }
    }

    /// A script of these gestures in an app without a window: clicks, strokes, labels, undone and redone steps that
    /// follow one another are carried out in one frame, and so are selections. The result is that of [`GestureScript::new`].
    pub fn unwatched(gestures: impl IntoIterator<Item = Gesture>) -> Self {
        Self { is_unwatched: true, ..Self::new(gestures) }
    }

    /// Adds gestures at the end.
    pub fn extend(&mut self, gestures: impl IntoIterator<Item = Gesture>) {
        self.waiting.extend(gestures);
    }

    /// Returns `true` when every gesture has its answer.
    pub fn is_done(&self) -> bool {
        self.waiting.is_empty() && !self.pending
    }

    /// Returns `true` if the last gesture waits for this answer.
    pub(super) fn awaits(&self, answer: AwaitedAnswer) -> bool {
        self.pending && self.awaited == Some(answer)
    }

    /// Lets the next gesture begin. A refusal of this `edit` may still come.
    pub(super) fn finish(&mut self, edit: Option<MessageId<EditRequest>>) {
        self.pending = false;
        self.awaited = edit.map(AwaitedAnswer::Edit);
    }

    /// Lets go of the gestures that are not begun, and returns the first of them.
    pub(crate) fn give_up(&mut self) -> Option<Gesture> {
        let next = self.waiting.pop_front();
        self.waiting.clear();
        next
    }

    /// Answers of the gestures that were carried out before the time was over. The last one tells that for the first gesture that
    /// was begun and not finished, or else for the next one.
    pub(crate) fn cut(mut self, next: Option<&Gesture>, reason: &dyn std::error::Error) -> Vec<GestureAnswer> {
        let cut = match self.first_open() {
            Some(open) => self.answers.drain(open..).next().map(|answer| answer.gesture),
            None => next.map(name_of),
        };
        if let Some(gesture) = cut {
            let (number, message) = (self.answers.len() + 1, reason.to_string());
            self.answers.push(GestureAnswer { number, gesture, message, out_of_time: true, ..Default::default() });
        }
        self.answers
    }

    /// Index of the first answer that is not complete.
    fn first_open(&self) -> Option<usize> {
        let of_runs = [self.requested.front().map(|change| change.answer), self.selections.first_open()];
        let first = of_runs.into_iter().flatten().min();
        first.or_else(|| self.answers.len().checked_sub(1).filter(|_| self.pending))
    }
}

/// Writers of the requests that gestures become.
#[derive(SystemParam)]
pub(super) struct Requests<'w> {
    edits: MessageWriter<'w, EditRequest>,
    picks: MessageWriter<'w, PickRequest>,
    places: MessageWriter<'w, PlaceRequest>,
    strokes: MessageWriter<'w, StrokeRequest>,
    fits: MessageWriter<'w, FitRequest>,
}

/// Components of a rig with a script.
pub(super) type ScriptedRig<'a> = (
    Entity,
    &'a mut GestureScript,
    &'a Rig,
    &'a Selection,
    &'a mut Symmetry,
    Option<&'a RigSurface>,
    Option<&'a RigMeshes>,
    (Has<FittedRig>, Has<FitMarkers>),
    (Has<BuildResult>, Has<StrokeTips>),
);

/// Reads the answers to the last gesture of each script and carries out the next one.
pub(super) fn run_scripts(
    mut scripts: Query<ScriptedRig>,
    mut requests: Requests,
    mut answers: Answers,
    limits: Res<RigLimits>,
    awaited: Option<Res<AwaitedSteps>>,
) {
    answers.collect(&mut scripts);
    let awaits = |rig: &Entity| {
        awaited.as_ref().is_some_and(|awaited| awaited.computed.contains(rig) || awaited.landed.contains(rig))
    };
    for (entity, mut script, rig, selection, mut symmetry, surface, meshes, is_fitted, (is_built, has_tips)) in
        &mut scripts
    {
        // A gesture comes after a step that is computed, whose words are no answer to it.
        if script.pending
            || script.waiting.is_empty()
            || awaits(&entity)
            || (meshes.is_some() && surface.and_then(RigSurface::ready).is_none())
        {
            continue;
        }
        let bounds = surface.map_or([Vec3::splat(-0.5), Vec3::splat(0.5)], RigSurface::bounds);
        // Joints of a fit follow each edit.
        if is_fitted == (false, false) && click_run::is_due(&script, rig, surface) {
            let has_mesh = meshes.is_some() && surface.and_then(RigSurface::ready).is_some();
            let is_known = selection.active().is_none_or(|active| rig.joint(active).is_some());
            // Commands that were built, and clips, may move joints away from their rest.
            let is_still = (!rig.has_tags() || !is_built) && rig.clips().is_empty();
            let can_draw = has_mesh && is_known && is_still;
            // Controls are picked before joints, and strokes go on from joints that nobody picked.
            let can_pick = can_draw && !rig.has_tags() && !is_built && !has_tips;
            let run = RunRig { entity, rig, selection, surface, bounds, can_draw, can_pick, symmetry: symmetry.0 };
            if click_run::carry_out(&mut script, &run, &mut requests.edits, &limits) {
                continue;
            }
        }
        if selection_run::is_due(&script) {
            selection_run::carry_out(&mut script, (entity, rig, bounds), &mut requests.picks, &limits);
            continue;
        }
        let Some(gesture) = script.begin_next(rig.len(), surface, &limits) else { continue };
        let mesh = meshes.and_then(|meshes| meshes.iter().next());
        let (state, symmetry) = (&mut script.state, &mut symmetry);
        let mut act = GestureRun { entity, mesh, rig, selection, bounds, state, symmetry };
        match act.make(gesture, &mut requests) {
            Ok(awaited) => (script.pending, script.awaited) = (awaited.is_some(), awaited),
            Err(error) => script.fail(&error),
        }
    }
}

impl GestureScript {
    /// Takes the next gesture of the script of a rig with so many joints and this surface, and begins its answer; `None` where
    /// the list or the gesture is too long, or its numbers are out of all proportion.
    pub(super) fn begin_next(
        &mut self,
        joints: usize,
        surface: Option<&RigSurface>,
        limits: &RigLimits,
    ) -> Option<Gesture> {
        self.state.joints_before = joints;
        let gesture = self.waiting.pop_front()?;
        let number = self.answers.len() + 1;
        self.answers.push(GestureAnswer { number, gesture: name_of(&gesture), done: true, ..Default::default() });
        if let Err(error) = limits.check(Limit::Gestures, number, LIST, "the list") {
            // What is behind it is too much as well.
            self.waiting.clear();
            self.fail(&error.into());
            return None;
        }
        if let Err(error) = limits.check_gesture(LIST, number, &gesture) {
            self.fail(&error.into());
            return None;
        }
        if let Err(error) = check_proportion(&gesture, surface) {
            self.fail(&error.into());
            return None;
        }
        Some(gesture)
    }
}

/// Name of a gesture in answers.
fn name_of(gesture: &Gesture) -> String {
    let text = format!("{gesture:?}");
    text.split(['(', ' ', '{']).next().unwrap_or_default().to_owned()
}

/// Execution of one gesture.
struct GestureRun<'a, 'w> {
    entity: Entity,
    mesh: Option<Entity>,
    rig: &'a Rig,
    selection: &'a Selection,
    bounds: [Vec3; 2],
    state: &'a mut UserState,
    symmetry: &'a mut Mut<'w, Symmetry>,
}

impl GestureRun<'_, '_> {
    fn plane(&self) -> ViewPlane {
        self.state.plane(self.bounds)
    }

    fn active(&self) -> Result<Uid, GestureError> {
        self.selection.active().ok_or(GestureError::NoSelection)
    }

    fn selected(&self) -> Result<Vec<Uid>, GestureError> {
        self.active().map(|_| self.selection.0.clone())
    }

    /// Sends the requests of a gesture; gives the answer that it has to wait for.
    fn make(&mut self, gesture: Gesture, requests: &mut Requests) -> Result<Option<AwaitedAnswer>, GestureError> {
        if self.state.take_setting(&gesture) {
            return Ok(None);
        }
        let rig = self.entity;
        let mut operation = None;
        let mut pick = None;
        match gesture {
            Gesture::Mirror(on) => {
                let height = self.bounds[1].y - self.bounds[0].y;
                self.symmetry.0 = on.then(|| MirrorPlane::sagittal(height));
            }
            Gesture::Click(at) => {
                let ray = self.plane().ray(at.into());
                let request = requests.places.write(PlaceRequest { rig, ray, settings: self.state.place });
                return Ok(Some(AwaitedAnswer::Place(request)));
            }
            Gesture::Stroke { points, threshold, joints } => {
                let stroke = self.state.stroke(rig, self.bounds, &points, threshold, joints);
                return Ok(Some(AwaitedAnswer::Stroke(requests.strokes.write(stroke))));
            }
            Gesture::Select(at) => pick = Some((self.click(at), false)),
            Gesture::Add(at) => pick = Some((self.click(at), true)),
            Gesture::Box(a, b) => {
                pick = Some((Pick::Box { plane: self.plane(), corners: [a.into(), b.into()] }, false));
            }
            Gesture::SelectLabel(label) => {
                let joint = self.rig.labelled(&label).ok_or(GestureError::NoLabel(label))?;
                pick = Some((Pick::Joints(vec![joint]), false));
            }
            Gesture::SelectAll => pick = Some((Pick::All, false)),
            Gesture::Deselect => {
                requests.picks.write(PickRequest { rig, what: Pick::None, add: false });
            }
            Gesture::Fit { template } => {
                let mesh = self.mesh.ok_or(GestureError::NoMesh)?;
                let template = match template {
                    // A part comes besides what there is, below the selected joint.
                    Some(name) if name.starts_with(PARTS) => {
                        FitTemplate::Part { part: FitPart::Named(name), parent: self.selection.active() }
                    }
                    template => template.map_or(FitTemplate::Choose, FitTemplate::Named),
                };
                requests.fits.write(FitRequest { template, ..FitRequest::new(mesh) });
                return Ok(Some(AwaitedAnswer::Fit(mesh)));
            }
            Gesture::Undo => {
                let request = requests.edits.write(EditRequest { rig, change: Change::Undo });
                return Ok(Some(AwaitedAnswer::Edit(request)));
            }
            Gesture::Redo => {
                let request = requests.edits.write(EditRequest { rig, change: Change::Redo });
                return Ok(Some(AwaitedAnswer::Edit(request)));
            }
            other => operation = Some(self.operation(other)?),
        }
        if let Some((what, add)) = pick {
            let request = requests.picks.write(PickRequest { rig, what, add });
            return Ok(Some(AwaitedAnswer::Pick(request)));
        }
        if let Some(operation) = operation {
            let request = requests.edits.write(EditRequest::operation(rig, operation));
            return Ok(Some(AwaitedAnswer::Edit(request)));
        }
        Ok(None)
    }

    fn click(&self, at: (f32, f32)) -> Pick {
        Pick::Click { plane: self.plane(), point: at.into(), reach: self.state.reach(self.bounds) }
    }

    /// The operation of a gesture on the selected joints.
    fn operation(&self, gesture: Gesture) -> Result<Operation, GestureError> {
        let active = self.active()?;
        if let Some(operation) = on_selection(&gesture, &self.plane()) {
            return operation.on(self.rig, self.selection).ok_or(GestureError::NoSelection);
        }
        let joints = self.selected()?;
        Ok(match gesture {
            Gesture::Label(label) => Operation::Labels(vec![(active, label)]),
            Gesture::Labels(labels) => chain_labels(self.rig, active, &labels)?,
            Gesture::Group(name, color) => Operation::Group { joints, name, color: color.map(<[f32; 3]>::from) },
            Gesture::Lock(locked) => Operation::Lock(joints, locked),
            _ => return Err(GestureError::NoOperation),
        })
    }
}
