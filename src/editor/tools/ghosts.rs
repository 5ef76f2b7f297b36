//! Ghosts: the planned results of tools, for [drawing](crate::plugins::drawing).

use bevy::prelude::*;

use super::{
    ToolSystems,
    place::PlaceTool,
    scene::{EditedRig, Scene},
    stroke::{StrokeState, StrokeTool},
};
use crate::{
    algo::placement::Placement,
    plugins::{
        drawing::{GhostJoint, Ghosts},
        stroke::StrokeRequest,
    },
    rig::{
        Uid,
        operations::{Operation, settle},
    },
};

/// Plugin that hands the planned results of tools to the drawing.
pub struct GhostsPlugin;

impl Plugin for GhostsPlugin {
    fn build(&self, app: &mut App) {
        app.init_resource::<Ghosts>().add_systems(
            PostUpdate,
            update_ghosts
                .run_if(resource_changed::<PlaceTool>.or_else(resource_changed::<StrokeTool>))
                .in_set(ToolSystems::Show)
                .after(super::stroke::show),
        );
    }
}

fn update_ghosts(place: Res<PlaceTool>, stroke: Res<StrokeTool>, scene: Scene, mut ghosts: ResMut<Ghosts>) {
    let mut next = Ghosts::default();
    if let Some(rig) = scene.rig() {
        match &stroke.state {
            StrokeState::Idle => {}
            StrokeState::Drawing(request) => next.stroke = line(request),
            StrokeState::Preview(preview) => {
                next.stroke = line(&preview.request);
                if let Some(Operation::Chain { positions, parent }) = preview.operation() {
                    next.joints = chain(positions, *parent, &rig, &scene.posed(&rig));
                }
            }
        }
        if let Some(ghost) = &place.ghost {
            let joint = |position, parent, mirrored| GhostJoint { position, parent, mirrored };
            next.joints.push(joint(ghost.position, ghost.parent_place, false));
            next.joints.extend(ghost.mirrored.map(|other| joint(other, ghost.mirrored_parent, true)));
            if let Placement::Between { near, far, .. } = ghost.placement {
                next.depth_span = Some((near, far));
            }
        }
        next.rig = Some(rig.entity).filter(|_| !next.is_empty());
    }
    ghosts.set_if_neq(next);
}

/// A stroke's points on its view plane.
fn line(request: &StrokeRequest) -> Vec<Vec3> {
    request.points.iter().map(|point| request.plane.lift(*point)).collect()
}

/// Ghost joints of a chain, each with its parent, on both sides.
fn chain(positions: &[Vec3], parent: Option<Uid>, rig: &EditedRig, posed: &[(Uid, Vec3)]) -> Vec<GhostJoint> {
    let place_of = |joint: Uid| posed.iter().find(|(uid, _)| *uid == joint).map(|(_, place)| *place);
    let other_parent = rig.other_side(parent);
    let (mut before, mut before_other) = (parent.and_then(place_of), other_parent.and_then(place_of));
    let mut joints = Vec::with_capacity(2 * positions.len());
    for (position, other) in settle(positions, rig.symmetry.0.as_ref()) {
        let position = rig.posed_below(parent, position);
        let other = other.map(|other| rig.posed_below(other_parent, other));
        joints.push(GhostJoint { position, parent: before, mirrored: false });
        joints.extend(other.map(|other| GhostJoint { position: other, parent: before_other, mirrored: true }));
        (before, before_other) = (Some(position), Some(other.unwrap_or(position)));
    }
    joints
}
