//! Strokes: freehand lines that become chains, insert joints, or erase them (Pencil Rigger, section 5.3).
//!
//! Following a stroke takes some thousand rays, which on a large mesh is more than a frame has: it runs in a background
//! task, and the chain comes a frame or two later. A preview does the same with a [`FollowedStroke`].

mod followed;
mod parent;

use bevy::{
    prelude::*,
    tasks::{AsyncComputeTaskPool, Task, futures::check_ready},
};

pub use followed::FollowedStroke;
pub use parent::{ParentReason, StrokeParent, StrokeTips, nearest_parent, stroke_parent};

use super::{
    RigSystems, configure_sets,
    document::{EditRequest, JointEntities, Selection, Symmetry},
    picking::{Picked, posed_joints},
    surface::{Answer, RigMeshes, RigSurface, answer},
};
use crate::{
    algo::{
        placement::{PlaceSettings, place_hits},
        stroke::{ChainChoice, StrokeChain, StrokeError, StrokeKind, StrokeSettings, classify, joint_at},
        view::ViewPlane,
    },
    rig::{Rig, Uid, operations::Operation},
};

/// Adds strokes.
pub struct StrokePlugin;

impl Plugin for StrokePlugin {
    fn build(&self, app: &mut App) {
        configure_sets(app);
        app.init_resource::<WaitingStrokes>()
            .add_message::<StrokeRequest>()
            .add_message::<StrokeDone>()
            .add_message::<Picked>()
            .add_systems(
                Update,
                (
                    stroke.in_set(RigSystems::Gesture).after(super::placement::place),
                    note_tips.in_set(RigSystems::Build),
                ),
            );
    }
}

/// Asks to turn a stroke into what it means.
#[derive(Message, Debug, Clone)]
pub struct StrokeRequest {
    /// The rig.
    pub rig: Entity,
    /// The view it was drawn in, in the rig's space.
    pub plane: ViewPlane,
    /// Its points on the view plane.
    pub points: Vec<Vec2>,
    /// Where joints go along it.
    pub choice: ChainChoice,
    /// Depth, volume and recentring.
    pub settings: StrokeSettings,
    /// True if the stroke must become a chain, whatever it crosses.
    pub chain_only: bool,
    /// How near, in model units, a stroke must come to a joint to mean it.
    pub reach: f32,
    /// What a chain hangs on whose stroke starts on no joint.
    pub parent: StrokeParent,
}

/// What became of a stroke.
#[derive(Message, Debug, Clone)]
pub struct StrokeDone {
    /// The rig.
    pub rig: Entity,
    /// What it meant.
    pub result: StrokeResult,
}

/// What a stroke meant.
#[derive(Debug, Clone)]
pub enum StrokeResult {
    /// A chain was added; `parent` is the joint it hangs on.
    Chain {
        /// The joints and what to tell the user.
        chain: StrokeChain,
        /// The joint that the chain continues or hangs on.
        parent: Option<Uid>,
        /// Why that one.
        why: ParentReason,
    },
    /// A joint was put into the bone above this joint.
    Inserted {
        /// The joint at the bone's end.
        child: Uid,
    },
    /// These joints were deleted.
    Erased(Vec<Uid>),
    /// Nothing happened, for this reason.
    Nothing(String),
}

/// Strokes that have no answer yet, in the order they came.
#[derive(Resource, Default)]
struct WaitingStrokes(Vec<WaitingStroke>);

struct WaitingStroke {
    request: StrokeRequest,
    /// The state of the surface that it was drawn on.
    since: Option<u64>,
    /// Its chain, once that is being computed.
    chain: Option<Task<FoundChain>>,
}

type FoundChain = Result<StrokeChain, StrokeError>;

/// What a stroke is drawn on.
type Drawn<'a> = (
    &'a Rig,
    &'a Selection,
    &'a JointEntities,
    &'a GlobalTransform,
    &'a Symmetry,
    Option<&'a StrokeTips>,
    Option<&'a RigSurface>,
    Option<&'a RigMeshes>,
);

fn stroke(
    mut requests: MessageReader<StrokeRequest>,
    mut waiting: ResMut<WaitingStrokes>,
    rigs: Query<Drawn>,
    joints: Query<&GlobalTransform>,
    mut edits: MessageWriter<EditRequest>,
    mut done: MessageWriter<StrokeDone>,
) {
    if waiting.0.is_empty() && requests.is_empty() {
        return;
    }
    let arrived = requests.read().map(|request| WaitingStroke { request: request.clone(), since: None, chain: None });
    waiting.0.extend(arrived);
    // One stroke a rig at a time: the next may start on a joint of the last.
    let mut busy: Vec<Entity> = Vec::new();
    waiting.0.retain_mut(|WaitingStroke { request, since, chain }| {
        let Ok(drawn) = rigs.get(request.rig) else { return false };
        let (rig, _, entities, place, _, _, surface, meshes) = drawn;
        let found = chain.as_mut().map(check_ready);
        if busy.contains(&request.rig) || matches!(found, Some(None)) {
            busy.push(request.rig);
            return true;
        }
        let result = match answer(since, meshes.is_some(), surface) {
            Answer::Wait => None,
            Answer::Now(None) => {
                Some(StrokeResult::Nothing("the rig has no mesh to draw on; open one first".to_owned()))
            }
            Answer::Now(Some(surface)) => {
                let posed = posed_joints(rig, entities, place, &joints);
                match act(request, drawn, &posed, surface, found.flatten(), &mut edits) {
                    Acted::Done(result) => Some(result),
                    Acted::Follows(task) => {
                        *chain = Some(task);
                        None
                    }
                }
            }
        };
        busy.push(request.rig);
        let is_waiting = result.is_none();
        done.write_batch(result.map(|result| StrokeDone { rig: request.rig, result }));
        is_waiting
    });
}

/// What came of looking at a stroke.
enum Acted {
    Done(StrokeResult),
    Follows(Task<FoundChain>),
}

/// Does what a stroke means; if that is a chain, it must be `found` first.
fn act(
    request: &StrokeRequest,
    (rig, selection, _, _, symmetry, tips, ..): Drawn,
    posed: &[(Uid, Vec3)],
    surface: &RigSurface,
    found: Option<FoundChain>,
    edits: &mut MessageWriter<EditRequest>,
) -> Acted {
    let mut send = |operation| {
        edits.write(EditRequest::operation(request.rig, operation));
    };
    let flat = projected(rig, posed, &request.plane);
    let kind = if request.chain_only {
        let start = request.points.first().and_then(|point| joint_at(*point, &flat, request.reach));
        StrokeKind::Chain { start, end: None }
    } else {
        classify(&request.points, &flat, request.reach)
    };
    match kind {
        StrokeKind::Erase { joints } => {
            let joints: Vec<Uid> = joints.into_iter().map(|number| posed[number].0).collect();
            send(Operation::Delete { joints: joints.clone(), keep_children: true });
            Acted::Done(StrokeResult::Erased(joints))
        }
        StrokeKind::Insert { bone, t } => {
            let (child, end) = posed[bone];
            let parent = rig.joint(child).and_then(|joint| joint.parent);
            let start = parent.and_then(|parent| posed.iter().find(|(uid, _)| *uid == parent)).map(|(_, place)| *place);
            let Some(start) = start else {
                return Acted::Done(StrokeResult::Nothing("the stroke crosses no bone".to_owned()));
            };
            // The crossing tells where along the bone; in depth the joint is placed like a click there, but only if
            // the bone itself runs through what the ray meets.
            let along = start.lerp(end, t);
            let position = match request.plane.project(along) {
                Some(point) if request.settings.recentre => {
                    let ray = request.plane.ray(point);
                    let hits = surface.hits(&ray);
                    let settings = PlaceSettings { volume: volume_at(&ray, &hits, along), ..request.settings.place };
                    place_hits(&ray, &hits, settings).position().unwrap_or(along)
                }
                _ => along,
            };
            send(Operation::Insert { child, position });
            Acted::Done(StrokeResult::Inserted { child })
        }
        StrokeKind::Chain { start, .. } => {
            let chain = match found.map_or_else(|| find_chain(request, surface), Found::Now) {
                Found::Now(Ok(chain)) => chain,
                Found::Now(Err(error)) => return Acted::Done(StrokeResult::Nothing(error.to_string())),
                Found::Later(task) => return Acted::Follows(task),
            };
            let from = start.map(|number| posed[number].0);
            // A stroke that starts on a joint continues from it: that joint is the chain's first.
            let skip = usize::from(from.is_some());
            let positions: Vec<Vec3> = chain.joints.iter().skip(skip).map(|joint| joint.position).collect();
            if positions.is_empty() {
                let why = "the stroke ends where it starts; draw it further".to_owned();
                return Acted::Done(StrokeResult::Nothing(why));
            }
            let (parent, why) = match from {
                Some(from) => (Some(from), ParentReason::StartsOn),
                None => stroke_parent(request.parent, rig, selection, tips, symmetry.0, posed, positions[0]),
            };
            send(Operation::Chain { positions, parent });
            Acted::Done(StrokeResult::Chain { chain, parent, why })
        }
    }
}

enum Found {
    Now(FoundChain),
    Later(Task<FoundChain>),
}

/// Surfaces of no more triangles answer the rays of a stroke in less than a millisecond.
const FEW_TRIANGLES: usize = 4096;

fn find_chain(request: &StrokeRequest, surface: &RigSurface) -> Found {
    let surface = surface.shared().unwrap_or_default();
    let is_small = surface.triangle_count() <= FEW_TRIANGLES;
    let StrokeRequest { plane, settings, choice, .. } = *request;
    let points = request.points.clone();
    let find = move || FollowedStroke::new(surface, &plane, &points, settings).map(|stroke| stroke.chain(choice));
    if is_small { Found::Now(find()) } else { Found::Later(AsyncComputeTaskPool::get().spawn(async move { find() })) }
}

/// Remembers which joints strokes left selected, until somebody picks them.
fn note_tips(
    mut commands: Commands,
    mut done: MessageReader<StrokeDone>,
    mut picked: MessageReader<Picked>,
    mut rigs: Query<(&Selection, Option<&mut StrokeTips>)>,
) {
    for Picked { rig, joints } in picked.read() {
        let Ok((_, Some(mut tips))) = rigs.get_mut(*rig) else { continue };
        if joints.iter().any(|joint| tips.contains(*joint)) {
            tips.0.retain(|tip| !joints.contains(tip));
        }
    }
    for StrokeDone { rig, result } in done.read() {
        let (StrokeResult::Chain { parent, .. }, Ok((selection, tips))) = (result, rigs.get_mut(*rig)) else {
            continue;
        };
        // The parent is still selected if the chain was refused.
        let Some(tip) = selection.active().filter(|active| Some(*active) != *parent) else { continue };
        match tips {
            Some(mut tips) => {
                tips.0.insert(tip);
            }
            None => {
                commands.entity(*rig).insert(StrokeTips([tip].into()));
            }
        }
    }
}

/// Joints on the view plane, each with its parent's number; those behind the camera are nowhere.
fn projected(rig: &Rig, posed: &[(Uid, Vec3)], plane: &ViewPlane) -> Vec<(Vec2, Option<usize>)> {
    let numbers: std::collections::HashMap<Uid, usize> =
        posed.iter().enumerate().map(|(n, (uid, _))| (*uid, n)).collect();
    let project = |(uid, position): &(Uid, Vec3)| {
        let parent = rig.joint(*uid).and_then(|joint| joint.parent).and_then(|parent| numbers.get(&parent).copied());
        (plane.project(*position).unwrap_or(Vec2::NAN), parent)
    };
    posed.iter().map(project).collect()
}

/// Which entry/exit pair of a ray holds a point (or comes nearest to it), counted from one.
fn volume_at(ray: &crate::mesh::ray::Ray, hits: &[crate::mesh::ray::Hit], point: Vec3) -> Option<u32> {
    let depth = (point - ray.origin).dot(ray.direction);
    let apart = |volume: &crate::mesh::surface::Volume| (volume.near - depth).max(depth - volume.far).max(0.0);
    let volumes = crate::mesh::surface::volumes(hits);
    let nearest = volumes.iter().enumerate().min_by(|(_, a), (_, b)| apart(a).total_cmp(&apart(b)));
    nearest.map(|(number, _)| number as u32 + 1)
}
