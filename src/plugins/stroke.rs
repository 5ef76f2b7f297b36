//! Strokes: freehand lines that become chains, insert joints, or erase them (Pencil Rigger, section 5.3).
//!
//! Following a stroke takes some thousand rays, which on a large mesh takes longer than a frame: it runs in a
//! background task, and the chain comes a frame or two later. A preview does the same with a [`FollowedStroke`].

mod chain_preview;
mod parent;
mod plan;

use std::collections::{BTreeMap, BTreeSet};

use bevy::{
    ecs::message::MessageId,
    prelude::*,
    tasks::{AsyncComputeTaskPool, Task, futures::check_ready},
};

pub use chain_preview::FollowedStroke;
pub use parent::{ParentReason, StrokeParent, StrokeTips, nearest_parent, stroke_parent};
pub use plan::{StrokePlan, StrokeScene, plan_stroke, stroke_kind};

use super::{
    RigSystems, configure_sets,
    document::{ChangeReport, EditRequest, JointEntities, ReportedChain, Selection, Symmetry},
    history::RigHistory,
    landing::Landing,
    picking::{PickAnswer, posed_joints},
    surface::{Answer, RigMeshes, RigSurface, answer},
};
use crate::{
    algo::{
        stroke::{ChainChoice, StrokeChain, StrokeError, StrokeSettings},
        view::ViewPlane,
    },
    rig::{Rig, Uid, operations::MirrorPlane},
};

/// Plugin of strokes.
pub struct StrokePlugin;

impl Plugin for StrokePlugin {
    fn build(&self, app: &mut App) {
        configure_sets(app);
        app.init_resource::<WaitingStrokes>()
            .add_message::<StrokeRequest>()
            .add_message::<StrokeDone>()
            .add_message::<PickAnswer>()
            .add_message::<ChangeReport>()
            .add_systems(
                Update,
                (
                    stroke.in_set(RigSystems::Gesture).after(super::placement::place),
                    note_tips.in_set(RigSystems::Build),
                ),
            );
    }
}

/// Request to interpret a stroke and carry it out.
#[derive(Message, Debug, Clone)]
pub struct StrokeRequest {
    /// The rig.
    pub rig: Entity,
    /// The view it was drawn in, in the rig's space.
    pub plane: ViewPlane,
    /// Points of the stroke on the view plane.
    pub points: Vec<Vec2>,
    /// Choice of the joints along it.
    pub choice: ChainChoice,
    /// Depth, volume and recentring.
    pub settings: StrokeSettings,
    /// Forces a chain if `true`, whatever the stroke crosses.
    pub chain_only: bool,
    /// Largest distance, in model units, of a stroke from a joint that it starts or ends on.
    pub reach: f32,
    /// Rule for the parent of a chain whose stroke starts on no joint.
    pub parent: StrokeParent,
    /// The chain, if a preview has chosen it from this very stroke: it is taken unchanged.
    pub chain: Option<StrokeChain>,
}

/// Answer to a [`StrokeRequest`].
#[derive(Message, Debug, Clone)]
pub struct StrokeDone {
    /// The rig.
    pub rig: Entity,
    /// Request that is answered.
    pub request: MessageId<StrokeRequest>,
    /// Edit that the stroke became, if any.
    pub edit: Option<MessageId<EditRequest>>,
    /// Result of the stroke.
    pub result: StrokeResult,
}

/// Result of a stroke.
#[derive(Debug, Clone)]
pub enum StrokeResult {
    /// A chain was added.
    Chain {
        /// The joints, with notes for the user.
        chain: StrokeChain,
        /// The joint that the chain continues from or is attached to.
        parent: Option<Uid>,
        /// Reason for that parent.
        why: ParentReason,
    },
    /// A joint was inserted into the bone above this joint.
    Inserted {
        /// The joint at the bone's end.
        child: Uid,
    },
    /// The listed joints were deleted.
    Erased(Vec<Uid>),
    /// The stroke had no effect, for the given reason.
    Nothing(StrokeFailure),
}

/// Reason why a stroke had no effect; a sentence for people without its full stop.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum StrokeFailure {
    /// The rig has no mesh.
    #[error("the rig has no mesh to draw on; open one first")]
    NoMesh,
    /// The stroke was to insert a joint, but crosses no bone.
    #[error("the stroke crosses no bone")]
    NoBone,
    /// The stroke was to become a chain, but was not followed.
    #[error("the stroke became no chain")]
    NoChain,
    /// The stroke starts and ends on the same joint.
    #[error("the stroke ends where it starts; draw it further")]
    TooShort,
    /// Steps were undone before the stroke was followed, and its step would discard them.
    #[error("steps were undone while the stroke was followed, and its joints would lose them; draw it again")]
    Undone,
    /// The stroke cannot be followed through the mesh.
    #[error(transparent)]
    Stroke(#[from] StrokeError),
}

/// Strokes without an answer yet, in the order of their requests.
#[derive(Resource, Default)]
struct WaitingStrokes(Vec<WaitingStroke>);

struct WaitingStroke {
    request: StrokeRequest,
    id: MessageId<StrokeRequest>,
    /// Number of the state of the surface on which the stroke was drawn.
    since: Option<u64>,
    /// Task that computes its chain.
    chain: Option<Task<FoundChain>>,
    landing: Landing,
}

/// Result of following a stroke.
pub type FoundChain = Result<StrokeChain, StrokeError>;

/// Components of a rig that a stroke reads.
type StrokeTarget<'a> = (
    &'a Rig,
    &'a Selection,
    &'a JointEntities,
    &'a GlobalTransform,
    &'a Symmetry,
    Option<&'a StrokeTips>,
    Option<&'a RigSurface>,
    Option<&'a RigMeshes>,
    &'a RigHistory,
);

fn stroke(
    mut requests: MessageReader<StrokeRequest>,
    mut waiting: ResMut<WaitingStrokes>,
    rigs: Query<StrokeTarget>,
    joints: Query<&GlobalTransform>,
    mut edits: MessageWriter<EditRequest>,
    mut done: MessageWriter<StrokeDone>,
) {
    if waiting.0.is_empty() && requests.is_empty() {
        return;
    }
    let arrived = requests.read_with_id().filter_map(|(request, id)| {
        let (.., history) = rigs.get(request.rig).ok()?;
        let landing = Landing::asked(history);
        Some(WaitingStroke { request: request.clone(), id, since: None, chain: None, landing })
    });
    waiting.0.extend(arrived);
    // Only one stroke of a rig is processed at a time: the next may start on a joint that it adds.
    let mut busy: Vec<Entity> = Vec::new();
    waiting.0.retain_mut(|WaitingStroke { request, id, since, chain, landing }| {
        let Ok(drawn) = rigs.get(request.rig) else { return false };
        let (rig, selection, entities, place, symmetry, tips, surface, meshes, history) = drawn;
        if busy.contains(&request.rig) {
            return true;
        }
        busy.push(request.rig);
        let found = match chain.take() {
            None => None,
            Some(mut task) => match check_ready(&mut task) {
                None => {
                    *chain = Some(task);
                    return true;
                }
                found => found,
            },
        };
        let result = match answer(since, meshes.is_some(), surface) {
            // A chain that waited would be in the way of the strokes after it.
            _ if landing.would_discard(history) => Some((StrokeResult::Nothing(StrokeFailure::Undone), None)),
            Answer::Wait => None,
            Answer::Now(None) => Some((StrokeResult::Nothing(StrokeFailure::NoMesh), None)),
            Answer::Now(Some(surface)) => {
                let posed = posed_joints(rig, entities, place, &joints);
                let scene = StrokeScene { rig, selection, symmetry, tips, surface, posed: &posed };
                match act(request, &scene, found, &mut edits) {
                    StrokeOutcome::Done(result, edit) => Some((result, edit)),
                    StrokeOutcome::Follows(task) => {
                        *chain = Some(task);
                        None
                    }
                }
            }
        };
        let is_waiting = result.is_none();
        done.write_batch(result.map(|(result, edit)| StrokeDone { rig: request.rig, request: *id, edit, result }));
        is_waiting
    });
}

/// Outcome of processing a stroke.
enum StrokeOutcome {
    Done(StrokeResult, Option<MessageId<EditRequest>>),
    Follows(Task<FoundChain>),
}

/// Carries out a stroke; the chain of a chain stroke must be `found` first.
fn act(
    request: &StrokeRequest,
    scene: &StrokeScene,
    found: Option<FoundChain>,
    edits: &mut MessageWriter<EditRequest>,
) -> StrokeOutcome {
    let known = found.or_else(|| request.chain.clone().map(Ok));
    let plan = match plan_stroke(request, scene, known) {
        StrokePlan::NeedsChain => match find_chain(request, scene.surface, scene.symmetry.0) {
            ChainSearch::Now(chain) => plan_stroke(request, scene, Some(chain)),
            ChainSearch::Later(task) => return StrokeOutcome::Follows(task),
        },
        ready => ready,
    };
    match plan {
        StrokePlan::Ready { operation, result } => {
            let edit = operation.map(|operation| edits.write(EditRequest::operation(request.rig, *operation)));
            StrokeOutcome::Done(result, edit)
        }
        StrokePlan::NeedsChain => StrokeOutcome::Done(StrokeResult::Nothing(StrokeFailure::NoChain), None),
    }
}

enum ChainSearch {
    Now(FoundChain),
    Later(Task<FoundChain>),
}

/// Largest number of triangles of a surface that answers the rays of a stroke in less than a millisecond.
const FEW_TRIANGLES: usize = 4096;

/// True for a surface that answers the rays of a stroke at once.
pub(super) fn has_few_triangles(surface: &RigSurface) -> bool {
    surface.ready().is_some_and(|surface| surface.triangle_count() <= FEW_TRIANGLES)
}

/// Chain of a stroke, followed through the surface on this thread.
pub(super) fn followed_chain(
    request: &StrokeRequest,
    surface: &RigSurface,
    symmetry: Option<MirrorPlane>,
) -> FoundChain {
    let StrokeRequest { plane, settings, choice, ref points, .. } = *request;
    let surface = surface.shared().unwrap_or_default();
    let followed = FollowedStroke::with_symmetry(surface, &plane, points, settings, symmetry);
    followed.map(|stroke| stroke.chain(choice))
}

fn find_chain(request: &StrokeRequest, surface: &RigSurface, symmetry: Option<MirrorPlane>) -> ChainSearch {
    let surface = surface.shared().unwrap_or_default();
    let is_small = surface.triangle_count() <= FEW_TRIANGLES;
    let StrokeRequest { plane, settings, choice, .. } = *request;
    let points = request.points.clone();
    let find = move || {
        let followed = FollowedStroke::with_symmetry(surface, &plane, &points, settings, symmetry);
        followed.map(|stroke| stroke.chain(choice))
    };
    if is_small {
        ChainSearch::Now(find())
    } else {
        ChainSearch::Later(AsyncComputeTaskPool::get().spawn(async move { find() }))
    }
}

/// Records the joints that strokes left selected, until a person picks them.
fn note_tips(
    mut commands: Commands,
    mut done: MessageReader<StrokeDone>,
    mut picked: MessageReader<PickAnswer>,
    mut reported: MessageReader<ChangeReport>,
    mut rigs: Query<(&Selection, Option<&mut StrokeTips>)>,
) {
    let mut drawn: BTreeMap<Entity, BTreeSet<Uid>> = BTreeMap::new();
    for PickAnswer { rig, joints, .. } in picked.read() {
        let Ok((_, Some(mut tips))) = rigs.get_mut(*rig) else { continue };
        if joints.iter().any(|joint| tips.contains(*joint)) {
            tips.0.retain(|tip| !joints.contains(tip));
        }
    }
    for StrokeDone { rig, result, .. } in done.read() {
        let (StrokeResult::Chain { parent, .. }, Ok((selection, _))) = (result, rigs.get(*rig)) else { continue };
        // The parent is still selected if the chain was refused.
        if let Some(tip) = selection.active().filter(|active| Some(*active) != *parent) {
            drawn.entry(*rig).or_default().insert(tip);
        }
    }
    for ChangeReport { rig, step, .. } in reported.read() {
        if let Some(ReportedChain { parent, tip: Some(tip) }) = step.as_ref().ok().and_then(|step| step.chain)
            && Some(tip) != parent
        {
            drawn.entry(*rig).or_default().insert(tip);
        }
    }
    for (rig, drawn) in drawn {
        match rigs.get_mut(rig) {
            Ok((_, Some(mut tips))) => tips.0.extend(drawn),
            Ok((_, None)) => {
                commands.entity(rig).insert(StrokeTips(drawn));
            }
            Err(_) => {}
        }
    }
}
