//! Placing joints with rays (Pencil Rigger, section 3.2).
//!
//! The joint goes to the midpoint of the closest and the furthest hit of a ray through the posed mesh, becomes a child
//! of the selected joint or a root, and is selected. If the ray misses the mesh, nothing happens, and [`PlaceAnswer`]
//! reports it. While the surface is behind the pose, requests wait for it.

use bevy::prelude::*;

use super::{
    RigSystems, configure_sets,
    document::{EditRequest, Selection},
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
    /// Hits of the ray, and the position of the joint.
    pub placement: Placement,
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

pub(super) fn place(
    mut requests: MessageReader<PlaceRequest>,
    mut waiting: Local<Vec<(PlaceRequest, Option<u64>)>>,
    rigs: Query<(&Rig, &Selection, Option<&RigSurface>, Has<RigMeshes>)>,
    mut edits: MessageWriter<EditRequest>,
    mut placed: MessageWriter<PlaceAnswer>,
) {
    waiting.extend(requests.read().map(|request| (request.clone(), None)));
    waiting.retain_mut(|(PlaceRequest { rig, ray, settings }, since)| {
        let Ok((document, selection, surface, has_mesh)) = rigs.get(*rig) else { return false };
        let Answer::Now(surface) = answer(since, has_mesh, surface) else { return true };
        let PlacedJoint { placement, parent, rest } = joint_at(document, selection, surface, ray, *settings);
        if let Some(position) = rest {
            edits.write(EditRequest::operation(*rig, Operation::Place { position, parent }));
        }
        placed.write(PlaceAnswer { rig: *rig, placement });
        false
    });
}
