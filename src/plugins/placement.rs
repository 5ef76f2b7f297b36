//! Placing joints with rays (Pencil Rigger, section 3.2).
//!
//! The joint goes to the midpoint of the closest and the furthest hit of a ray through the posed mesh, becomes a child
//! of the selected joint or a root, and is selected. If the ray misses the mesh, nothing happens, and [`PlaceAnswer`]
//! reports it. While the surface is behind the pose, requests wait for it; steps that are undone meanwhile are not lost to
//! a request that waited, which is refused then.

use bevy::{ecs::message::MessageId, prelude::*};

use super::{
    RigSystems, configure_sets,
    document::{EditRequest, Selection},
    history::RigHistory,
    landing::Landing,
    surface::{Answer, RigMeshes, RigSurface, answer},
};
use crate::{
    algo::placement::{PlaceSettings, Placement, place_hits},
    mesh::ray::Ray,
    rig::{Rig, Uid, operations::Operation},
};

/// Plugin of placing joints.
pub struct PlacementPlugin;

impl Plugin for PlacementPlugin {
    fn build(&self, app: &mut App) {
        configure_sets(app);
        app.add_message::<PlaceRequest>()
            .add_message::<PlaceAnswer>()
            .add_systems(Update, place.in_set(RigSystems::Gesture));
    }
}

/// Request to place a joint.
#[derive(Message, Debug, Clone)]
pub struct PlaceRequest {
    /// The rig.
    pub rig: Entity,
    /// The ray, in the rig's space.
    pub ray: Ray,
    /// Depth and volume.
    pub settings: PlaceSettings,
}

/// The answer to a [`PlaceRequest`].
#[derive(Message, Debug, Clone)]
pub struct PlaceAnswer {
    /// The rig.
    pub rig: Entity,
    /// Request that is answered.
    pub request: MessageId<PlaceRequest>,
    /// Edit that places the joint; `None` where there is nothing to place.
    pub edit: Option<MessageId<EditRequest>>,
    /// Hits of the ray, and the position of the joint; [`Placement::Nothing`] for a refused request.
    pub placement: Placement,
    /// True if the request waited for the surface.
    pub waited: bool,
    /// Reason why a request that waited was refused; `None` for all others.
    pub refusal: Option<PlaceRefusal>,
}

/// Reason why a request that waited for the surface is refused; a sentence without its full stop.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum PlaceRefusal {
    /// Steps were undone while the request waited, and its step would discard them.
    #[error("steps were undone while the click waited for the mesh, and a joint would lose them; click again")]
    Undone,
}

/// Joint that a [`PlaceRequest`] adds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlacedJoint {
    /// Hits of the ray, and the position between them.
    pub placement: Placement,
    /// Parent joint: the active joint of the selection.
    pub parent: Option<Uid>,
    /// Rest position in the rig's space; `None` where the ray misses the mesh.
    pub rest: Option<Vec3>,
}

/// Joint that a ray would place. The request and its preview share this function, so that they agree.
pub fn joint_at(
    rig: &Rig,
    selection: &Selection,
    surface: Option<&RigSurface>,
    ray: &Ray,
    settings: PlaceSettings,
) -> PlacedJoint {
    let hits = surface.map(|surface| surface.hits(ray)).unwrap_or_default();
    let placement = place_hits(ray, &hits, settings);
    let parent = selection.active();
    // On a posed mesh, the rest position is the point that the parent's pose moves to the clicked point.
    let rest = placement.position().map(|position| rig.rest_from_pose(parent).transform_point3(position));
    PlacedJoint { placement, parent, rest }
}

/// Request that waits for the surface.
pub(super) struct WaitingPlace {
    request: PlaceRequest,
    id: MessageId<PlaceRequest>,
    /// State of the surface that it waits for.
    since: Option<u64>,
    landing: Landing,
    waited: bool,
}

pub(super) fn place(
    mut requests: MessageReader<PlaceRequest>,
    mut waiting: Local<Vec<WaitingPlace>>,
    rigs: Query<(&Rig, &Selection, &RigHistory, Option<&RigSurface>, Has<RigMeshes>)>,
    mut edits: MessageWriter<EditRequest>,
    mut placed: MessageWriter<PlaceAnswer>,
) {
    let arrived = requests.read_with_id().filter_map(|(request, id)| {
        let (_, _, history, ..) = rigs.get(request.rig).ok()?;
        let landing = Landing::asked(history);
        Some(WaitingPlace { request: request.clone(), id, since: None, landing, waited: false })
    });
    waiting.extend(arrived);
    waiting.retain_mut(|WaitingPlace { request: PlaceRequest { rig, ray, settings }, id, since, landing, waited }| {
        let Ok((document, selection, history, surface, has_mesh)) = rigs.get(*rig) else { return false };
        let (rig, request, is_late) = (*rig, *id, *waited);
        let mut tell = |placement, edit, refusal| {
            placed.write(PlaceAnswer { rig, request, edit, placement, waited: is_late, refusal });
        };
        if landing.would_discard(history) {
            tell(Placement::Nothing, None, Some(PlaceRefusal::Undone));
            return false;
        }
        let Answer::Now(surface) = answer(since, has_mesh, surface) else {
            *waited = true;
            return true;
        };
        let PlacedJoint { placement, parent, rest } = joint_at(document, selection, surface, ray, *settings);
        let edit = rest.map(|position| edits.write(EditRequest::operation(rig, Operation::Place { position, parent })));
        tell(placement, edit, None);
        false
    });
}
