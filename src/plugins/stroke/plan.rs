//! Plans of strokes: their effect on a rig in its current state.
//!
//! Planning changes nothing and is one function, shared by preview and request, so that a preview shows exactly the
//! result.

use std::collections::HashMap;

use bevy::prelude::*;

use super::{FoundChain, ParentReason, StrokeFailure, StrokeRequest, StrokeResult, StrokeTips, stroke_parent};
use crate::{
    algo::{
        placement::{PlaceSettings, place_hits},
        stroke::{StrokeKind, classify, joint_at},
        view::ViewPlane,
    },
    plugins::{
        document::{Selection, Symmetry},
        surface::RigSurface,
    },
    rig::{Rig, Uid, operations::Operation},
};

/// Data that a stroke is planned on.
#[derive(Clone, Copy)]
pub struct StrokeScene<'a> {
    /// The rig.
    pub rig: &'a Rig,
    /// Selection of the rig.
    pub selection: &'a Selection,
    /// Live mirroring.
    pub symmetry: &'a Symmetry,
    /// Joints that strokes left selected.
    pub tips: Option<&'a StrokeTips>,
    /// The posed surface.
    pub surface: &'a RigSurface,
    /// Posed positions of the joints as [`posed_joints`](crate::plugins::picking::posed_joints) gives them.
    pub posed: &'a [(Uid, Vec3)],
}

/// Plan of a stroke.
#[derive(Debug, Clone)]
pub enum StrokePlan {
    /// A complete plan.
    Ready {
        /// The operation to request, if any.
        operation: Option<Box<Operation>>,
        /// Result to report.
        result: StrokeResult,
    },
    /// A chain, which has to be computed first by following the stroke through the surface.
    NeedsChain,
}

/// Plans a stroke on a rig in its current state. `chain` is the result of following it, if that was done.
pub fn plan_stroke(request: &StrokeRequest, scene: &StrokeScene, chain: Option<FoundChain>) -> StrokePlan {
    let StrokeScene { rig, selection, symmetry, tips, surface, posed } = *scene;
    let nothing = |why: StrokeFailure| StrokePlan::Ready { operation: None, result: StrokeResult::Nothing(why) };
    match stroke_kind(request, rig, posed) {
        StrokeKind::Erase { joints } => {
            let joints: Vec<Uid> = joints.into_iter().map(|number| posed[number].0).collect();
            let operation = Operation::Delete { joints: joints.clone(), keep_children: true };
            StrokePlan::Ready { operation: Some(Box::new(operation)), result: StrokeResult::Erased(joints) }
        }
        StrokeKind::Insert { bone, t } => {
            let (child, end) = posed[bone];
            let parent = rig.joint(child).and_then(|joint| joint.parent);
            let start = parent.and_then(|parent| posed.iter().find(|(uid, _)| *uid == parent)).map(|(_, place)| *place);
            let Some(start) = start else { return nothing(StrokeFailure::NoBone) };
            // The crossing gives the place along the bone; in depth the joint is placed like a click there, but only if
            // the bone itself runs through the volumes of the ray.
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
            let position = rig.rest_from_pose(parent).transform_point3(position);
            let operation = Operation::Insert { child, position };
            StrokePlan::Ready { operation: Some(Box::new(operation)), result: StrokeResult::Inserted { child } }
        }
        StrokeKind::Chain { start, .. } => {
            let chain = match chain {
                Some(Ok(chain)) => chain,
                Some(Err(error)) => return nothing(error.into()),
                None => return StrokePlan::NeedsChain,
            };
            let from = start.map(|number| posed[number].0);
            // A stroke that starts on a joint continues from it: that joint is the chain's first.
            let skip = usize::from(from.is_some());
            let positions: Vec<Vec3> = chain.joints.iter().skip(skip).map(|joint| joint.position).collect();
            let Some(first) = positions.first() else {
                return nothing(StrokeFailure::TooShort);
            };
            let (parent, why) = match from {
                Some(from) => (Some(from), ParentReason::StartsOn),
                None => stroke_parent(request.parent, rig, selection, tips, symmetry.0, posed, *first),
            };
            // Joints drawn on a posed mesh rest where the pose moves them to the line.
            let to_rest = rig.rest_from_pose(parent);
            let positions = positions.into_iter().map(|position| to_rest.transform_point3(position)).collect();
            let operation = Operation::Chain { positions, parent };
            StrokePlan::Ready {
                operation: Some(Box::new(operation)),
                result: StrokeResult::Chain { chain, parent, why },
            }
        }
    }
}

/// Interpretation of a stroke by its shape alone: cheap enough for every pointer event. Joints are numbered as in
/// `posed`.
pub fn stroke_kind(request: &StrokeRequest, rig: &Rig, posed: &[(Uid, Vec3)]) -> StrokeKind {
    let flat = projected(rig, posed, &request.plane);
    if request.chain_only {
        let start = request.points.first().and_then(|point| joint_at(*point, &flat, request.reach));
        StrokeKind::Chain { start, end: None }
    } else {
        classify(&request.points, &flat, request.reach)
    }
}

/// Joints on the view plane, each with its parent's index; joints behind the camera have no finite position.
fn projected(rig: &Rig, posed: &[(Uid, Vec3)], plane: &ViewPlane) -> Vec<(Vec2, Option<usize>)> {
    // In the order of the hierarchy a parent is the joint before, or one above that; in any other order it is looked up.
    let mut above: Vec<(Uid, usize)> = Vec::new();
    let mut numbers: Option<HashMap<Uid, usize>> = None;
    let project = |(number, (uid, position)): (usize, &(Uid, Vec3))| {
        let parent = rig.joint(*uid).and_then(|joint| joint.parent).and_then(|parent| {
            while above.last().is_some_and(|(last, _)| *last != parent) {
                above.pop();
            }
            let listed = || posed.iter().zip(0..).map(|((uid, _), number)| (*uid, number)).collect();
            let found = above.last().map(|(_, number)| *number);
            found.or_else(|| numbers.get_or_insert_with(listed).get(&parent).copied())
        });
        above.push((*uid, number));
        (plane.project(*position).unwrap_or(Vec2::NAN), parent)
    };
    posed.iter().enumerate().map(project).collect()
}

/// Number of the ray's entry/exit pair that holds a point (or comes nearest to it), counted from one.
fn volume_at(ray: &crate::mesh::ray::Ray, hits: &[crate::mesh::ray::Hit], point: Vec3) -> Option<u32> {
    let depth = (point - ray.origin).dot(ray.direction);
    let apart = |volume: &crate::mesh::surface::Volume| (volume.near - depth).max(depth - volume.far).max(0.0);
    let volumes = crate::mesh::surface::volumes(hits);
    let nearest = volumes.iter().enumerate().min_by(|(_, a), (_, b)| apart(a).total_cmp(&apart(b)));
    nearest.map(|(number, _)| number as u32 + 1)
}
