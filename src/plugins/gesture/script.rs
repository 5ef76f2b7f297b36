//! Execution of gestures, one a frame, and their answers.

use std::collections::VecDeque;

use bevy::{ecs::system::SystemParam, prelude::*};

use super::{Gesture, error::GestureError};
use crate::{
    algo::{
        placement::{PlaceSettings, Placement},
        stroke::{ChainChoice, StrokeNote, StrokeSettings},
        view::{View, ViewPlane},
    },
    plugins::{
        document::{Change, EditRefusal, EditReport, EditRequest, Selection, Symmetry},
        fit::{FIT_AROUND, FitAnswer, FitPart, FitRequest, FitTemplate},
        limits::{Limit, RigLimits},
        picking::{Pick, PickAnswer, PickRequest},
        placement::{PlaceAnswer, PlaceRequest},
        stroke::{StrokeDone, StrokeParent, StrokeRequest, StrokeResult},
        surface::{RigMeshes, RigSurface, SkinOf},
    },
    rig::{
        Rig, Uid,
        operations::{MirrorPlane, Operation},
        step::Commit,
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
    waiting: VecDeque<Gesture>,
    /// Answers, one for each finished gesture, in order.
    pub answers: Vec<GestureAnswer>,
    #[reflect(ignore)]
    state: UserState,
    pending: bool,
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
struct UserState {
    view: View,
    place: PlaceSettings,
    recentre: bool,
    reach: Option<f32>,
    joints_before: usize,
}

impl Default for UserState {
    fn default() -> Self {
        Self { view: View::Front, place: PlaceSettings::default(), recentre: true, reach: None, joints_before: 0 }
    }
}

impl GestureScript {
    /// A script of these gestures.
    pub fn new(gestures: impl IntoIterator<Item = Gesture>) -> Self {
        Self { waiting: gestures.into_iter().collect(), ..Self::default() }
    }

    /// Adds gestures at the end.
    pub fn extend(&mut self, gestures: impl IntoIterator<Item = Gesture>) {
        self.waiting.extend(gestures);
    }

    /// Returns `true` when every gesture has its answer.
    pub fn is_done(&self) -> bool {
        self.waiting.is_empty() && !self.pending
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

/// Readers of the answers.
#[derive(SystemParam)]
pub(super) struct Answers<'w, 's> {
    edited: MessageReader<'w, 's, EditReport>,
    refused: MessageReader<'w, 's, EditRefusal>,
    picked: MessageReader<'w, 's, PickAnswer>,
    placed: MessageReader<'w, 's, PlaceAnswer>,
    drawn: MessageReader<'w, 's, StrokeDone>,
    fitted: MessageReader<'w, 's, FitAnswer>,
    meshes: Query<'w, 's, &'static SkinOf>,
}

type ScriptedRig<'a> = (
    Entity,
    &'a mut GestureScript,
    &'a Rig,
    &'a Selection,
    &'a mut Symmetry,
    Option<&'a RigSurface>,
    Option<&'a RigMeshes>,
);

/// Reads the answers to the last gesture of each script and carries out the next one.
pub(super) fn run_scripts(
    mut scripts: Query<ScriptedRig>,
    mut requests: Requests,
    mut answers: Answers,
    limits: Res<RigLimits>,
) {
    answers.collect(&mut scripts);
    for (entity, mut script, rig, selection, mut symmetry, surface, meshes) in &mut scripts {
        if script.pending
            || script.waiting.is_empty()
            || (meshes.is_some() && surface.and_then(RigSurface::ready).is_none())
        {
            continue;
        }
        script.state.joints_before = rig.len();
        let Some(gesture) = script.waiting.pop_front() else { continue };
        let number = script.answers.len() + 1;
        let name = format!("{gesture:?}");
        let name = name.split(['(', ' ', '{']).next().unwrap_or_default().to_owned();
        script.answers.push(GestureAnswer { number, gesture: name, done: true, ..Default::default() });
        if let Err(error) = limits.check(Limit::Gestures, number, LIST, "the list") {
            // What is behind it is too much as well.
            script.waiting.clear();
            script.fail(&error.into());
            continue;
        }
        if let Err(error) = limits.check_gesture(LIST, number, &gesture) {
            script.fail(&error.into());
            continue;
        }
        let bounds = surface.map_or([Vec3::splat(-0.5), Vec3::splat(0.5)], RigSurface::bounds);
        let mesh = meshes.and_then(|meshes| meshes.iter().next());
        let (state, symmetry) = (&mut script.state, &mut symmetry);
        let mut act = GestureRun { entity, mesh, rig, selection, bounds, state, symmetry };
        match act.make(gesture, &mut requests) {
            Ok(pending) => script.pending = pending,
            Err(error) => script.fail(&error),
        }
    }
}

impl GestureScript {
    fn fail(&mut self, error: &GestureError) {
        if let Some(answer) = self.answers.last_mut() {
            answer.done = false;
            answer.message = error.to_string();
        }
    }

    fn say(&mut self, message: String) {
        if let Some(answer) = self.answers.last_mut() {
            answer.message = message;
        }
    }
}

impl Answers<'_, '_> {
    fn collect(&mut self, scripts: &mut Query<ScriptedRig>) {
        for PickAnswer { rig: entity, joints } in self.picked.read() {
            let Ok((_, mut script, rig, ..)) = scripts.get_mut(*entity) else { continue };
            match joints.as_slice() {
                _ if !script.pending => continue,
                [] => script.fail(&GestureError::NothingToPick),
                [joint] => script.say(format!("selected {}", name_of(rig, *joint))),
                joints => script.say(format!("selected {} joints", joints.len())),
            }
            script.pending = false;
        }
        for PlaceAnswer { rig: entity, placement, refusal, .. } in self.placed.read() {
            let Ok((_, mut script, rig, ..)) = scripts.get_mut(*entity) else { continue };
            script.note_added(rig);
            match placement {
                Placement::Nothing => {
                    script.fail(&refusal.map_or(GestureError::NothingThere, GestureError::from));
                }
                Placement::Single { position } => {
                    script.say(format!("placed a joint on the surface at {}", point(*position)));
                }
                Placement::Between { position, volumes, volume, .. } => {
                    let volumes = match volume {
                        None if *volumes > 1 => format!(", spanning {volumes} volumes (Volume(1) takes the near one)"),
                        Some(number) if *volumes > 1 => format!(", in volume {number} of {volumes}"),
                        _ => String::new(),
                    };
                    script.say(format!("placed a joint at {}{volumes}", point(*position)));
                }
            }
            script.pending = false;
        }
        for StrokeDone { rig: entity, result } in self.drawn.read() {
            let Ok((_, mut script, rig, ..)) = scripts.get_mut(*entity) else { continue };
            script.note_added(rig);
            match result {
                StrokeResult::Nothing(why) => script.fail(&why.clone().into()),
                StrokeResult::Inserted { child } => {
                    script.say(format!("put a joint into the bone that ends at {}", name_of(rig, *child)));
                }
                StrokeResult::Erased(joints) => script.say(format!("deleted {} joints", joints.len())),
                StrokeResult::Chain { chain, parent, .. } => {
                    let on = parent.map_or("as a root".to_owned(), |parent| format!("below {}", name_of(rig, parent)));
                    let notes: String = chain.notes.iter().map(|note| format!("; {}", heard(note))).collect();
                    script.say(format!("drew a chain of {} joints {on}{notes}", chain.joints.len()));
                }
            }
            script.pending = false;
        }
        for FitAnswer { mesh, result } in self.fitted.read() {
            let Ok(SkinOf(rig)) = self.meshes.get(*mesh) else { continue };
            let Ok((_, mut script, ..)) = scripts.get_mut(*rig) else { continue };
            // The edit of a fit answers for it.
            if let Err(failure) = result {
                script.fail(&failure.clone().into());
                script.pending = false;
            }
        }
        // Joints around a moved one are fitted again by themselves, in answer to no gesture.
        let follows =
            |edited: &EditReport| edited.name == FIT_AROUND && matches!(edited.committed, Some(Commit::Done(_)));
        let own = |edited: &&EditReport| !edited.preview && !follows(edited);
        for EditReport { rig: entity, name, .. } in self.edited.read().filter(own) {
            let Ok((_, mut script, rig, ..)) = scripts.get_mut(*entity) else { continue };
            if script.pending {
                script.note_added(rig);
                script.say(format!("{}: {} joints now", within_sentence(name), rig.len()));
                script.pending = false;
            }
        }
        for EditRefusal { rig: entity, reason } in self.refused.read() {
            let Ok((_, mut script, ..)) = scripts.get_mut(*entity) else { continue };
            script.fail(&reason.clone().into());
            script.pending = false;
        }
    }
}

impl GestureScript {
    fn note_added(&mut self, rig: &Rig) {
        let before = self.state.joints_before;
        if let Some(answer) = self.answers.last_mut() {
            answer.joints_added = rig.len().saturating_sub(before);
        }
    }
}

fn name_of(rig: &Rig, joint: Uid) -> String {
    let label = rig.joint(joint).and_then(|joint| joint.data.label.clone());
    label.map_or_else(|| format!("joint {joint}"), |label| format!("\"{label}\""))
}

fn point(position: Vec3) -> String {
    format!("({:.4}, {:.4}, {:.4})", position.x, position.y, position.z)
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
    fn size(&self) -> f32 {
        (self.bounds[1] - self.bounds[0]).max_element()
    }

    fn plane(&self) -> ViewPlane {
        ViewPlane::orthographic(self.state.view, self.bounds)
    }

    fn reach(&self) -> f32 {
        self.state.reach.unwrap_or(0.005 * self.size())
    }

    fn active(&self) -> Result<Uid, GestureError> {
        self.selection.active().ok_or(GestureError::NoSelection)
    }

    fn selected(&self) -> Result<Vec<Uid>, GestureError> {
        self.active().map(|_| self.selection.0.clone())
    }

    /// Sends the requests of a gesture; returns `true` if it has to wait for an answer.
    fn make(&mut self, gesture: Gesture, requests: &mut Requests) -> Result<bool, GestureError> {
        let rig = self.entity;
        let mut operation = None;
        let mut pick = None;
        match gesture {
            Gesture::View(view) => self.state.view = view,
            Gesture::Depth(depth) => self.state.place.depth = depth,
            Gesture::Volume(number) => self.state.place.volume = (number > 0).then_some(number),
            Gesture::Recentre(on) => self.state.recentre = on,
            Gesture::Reach(reach) => self.state.reach = Some(reach),
            Gesture::Mirror(on) => {
                let height = self.bounds[1].y - self.bounds[0].y;
                self.symmetry.0 = on.then(|| MirrorPlane::sagittal(height));
            }
            Gesture::Click(at) => {
                let ray = self.plane().ray(at.into());
                requests.places.write(PlaceRequest { rig, ray, settings: self.state.place });
                return Ok(true);
            }
            Gesture::Stroke { points, threshold, joints } => {
                requests.strokes.write(self.stroke(&points, threshold, joints));
                return Ok(true);
            }
            Gesture::Select(at) => pick = Some((self.click(at), false)),
            Gesture::Add(at) => pick = Some((self.click(at), true)),
            Gesture::Box(a, b) => {
                pick = Some((Pick::Box { plane: self.plane(), corners: [a.into(), b.into()] }, false));
            }
            Gesture::SelectLabel(label) => {
                let joint = self.rig.find_label(&label).ok_or(GestureError::NoLabel(label))?;
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
                return Ok(true);
            }
            Gesture::Undo => {
                requests.edits.write(EditRequest { rig, change: Change::Undo });
                return Ok(true);
            }
            Gesture::Redo => {
                requests.edits.write(EditRequest { rig, change: Change::Redo });
                return Ok(true);
            }
            other => operation = Some(self.operation(other)?),
        }
        if let Some((what, add)) = pick {
            requests.picks.write(PickRequest { rig, what, add });
            return Ok(true);
        }
        if let Some(operation) = operation {
            requests.edits.write(EditRequest::operation(rig, operation));
            return Ok(true);
        }
        Ok(false)
    }

    fn click(&self, at: (f32, f32)) -> Pick {
        Pick::Click { plane: self.plane(), point: at.into(), reach: self.reach() }
    }

    fn stroke(&self, points: &[(f32, f32)], threshold: Option<f32>, joints: Option<usize>) -> StrokeRequest {
        let choice = match (joints, threshold) {
            (Some(count), _) => ChainChoice::Joints(count),
            (None, Some(threshold)) => ChainChoice::Threshold(threshold),
            (None, None) => ChainChoice::Limb(0.02 * self.size()),
        };
        StrokeRequest {
            rig: self.entity,
            plane: self.plane(),
            points: points.iter().map(|point| Vec2::from(*point)).collect(),
            choice,
            settings: StrokeSettings { place: self.state.place, recentre: self.state.recentre },
            chain_only: joints.is_some(),
            reach: self.reach(),
            parent: StrokeParent::Selected,
            chain: None,
        }
    }

    /// The operation of a gesture on the selected joints.
    fn operation(&self, gesture: Gesture) -> Result<Operation, GestureError> {
        let plane = self.plane();
        let active = self.active()?;
        let joints = self.selected()?;
        let here = self.rig.position(active);
        // A drag in an orthographic view keeps the depth.
        let at_depth_of_active = |at: (f32, f32)| {
            let from = plane.project(here).unwrap_or_default();
            let delta = Vec2::from(at) - from;
            here + plane.right * delta.x + plane.up * delta.y
        };
        Ok(match gesture {
            Gesture::Label(label) => Operation::Labels(vec![(active, label)]),
            Gesture::Labels(labels) => {
                let chain: Vec<Uid> = std::iter::once(active)
                    .chain(self.rig.ancestors(active).map(|joint| joint.data.uid))
                    .take(labels.len())
                    .collect();
                if chain.len() < labels.len() {
                    return Err(GestureError::LongChain { names: labels.len(), joints: chain.len() });
                }
                Operation::Labels(chain.into_iter().rev().zip(labels).collect())
            }
            Gesture::Move(at) => Operation::Move { to: vec![(active, at_depth_of_active(at))], with_children: false },
            Gesture::MoveTo(to) => {
                Operation::Move { to: vec![(active, <[f32; 3]>::from(to).into())], with_children: false }
            }
            Gesture::Rotate(degrees) => Operation::Rotate {
                joints,
                rotation: turn(plane.towards(), degrees),
                pivot: Some(here),
                with_children: true,
            },
            Gesture::Scale(factor) => Operation::Scale {
                joints,
                scale: Vec3::splat(factor),
                axes: Quat::IDENTITY,
                pivot: Some(here),
                with_children: true,
            },
            Gesture::Insert(at) => Operation::Insert { child: active, position: at_depth_of_active(at) },
            Gesture::Delete => Operation::Delete { joints, keep_children: true },
            Gesture::DeleteHierarchy => Operation::Delete { joints, keep_children: false },
            Gesture::Parent => {
                let joints = joints.into_iter().filter(|joint| *joint != active).collect();
                Operation::Reparent { joints, parent: Some(active) }
            }
            Gesture::Unparent => Operation::Reparent { joints, parent: None },
            Gesture::Orient(along) => Operation::Orient { joints, along },
            Gesture::MirrorSelected => Operation::Mirror { joints },
            Gesture::Group(name, color) => Operation::Group { joints, name, color: color.map(<[f32; 3]>::from) },
            Gesture::Lock(locked) => Operation::Lock(joints, locked),
            _ => return Err(GestureError::NoOperation),
        })
    }
}

/// The title of a step in the middle of a sentence; names in it keep their letters.
fn within_sentence(title: &str) -> String {
    let mut letters = title.chars();
    letters.next().map_or_else(String::new, |first| first.to_lowercase().chain(letters).collect())
}

fn heard(note: &StrokeNote) -> String {
    match note {
        StrokeNote::EndMoved { start: true } => "its start lies beside the mesh and was moved onto it".to_owned(),
        StrokeNote::EndMoved { start: false } => "its end lies beside the mesh and was moved onto it".to_owned(),
        StrokeNote::VolumeChosen { volume, of } => format!("in volume {volume} of {of} (Volume(n) takes another)"),
        StrokeNote::JointsLeftOut { count } => format!("{count} joints fell into a gap of the mesh and were left out"),
    }
}

fn turn(axis: Vec3, degrees: f32) -> Quat {
    let half = 0.5 * degrees.to_radians();
    let [x, y, z] = (axis * bevy::math::ops::sin(half)).to_array();
    Quat::from_xyzw(x, y, z, bevy::math::ops::cos(half)).normalize()
}
