//! Regions: the part of a mesh that a template is fitted into.

use std::collections::HashSet;

use bevy::prelude::*;

use crate::{
    mesh::{adjacency, model::Weights},
    plugins::surface::RigMesh,
    rig::{Rig, Uid},
};

/// Share of the weights of a triangle's corners from which on it follows some joints.
const HELD: f32 = 0.5;

/// Part of a mesh that a template is fitted into.
#[derive(Debug, Clone, PartialEq, Default)]
pub enum FitRegion {
    /// The whole mesh; of a skinned character without gear that hangs on a bone.
    #[default]
    Whole,
    /// Objects of the mesh, by their numbers.
    Objects(Vec<usize>),
    /// Triangles of the mesh, by their numbers.
    Triangles(Vec<u32>),
    /// Triangles whose middle lies between two corners, in the mesh's space.
    Box([Vec3; 2]),
    /// Triangles that follow joints of the rig, and those below them, more than all others.
    Joints(Vec<Uid>),
}

impl FitRegion {
    /// Numbers of the triangles in a mesh of a rig; `None` for all. The second value counts objects that were left out
    /// because they hang on a bone.
    pub(super) fn triangles(&self, mesh: &RigMesh, rig: &Rig) -> (Option<Vec<u32>>, usize) {
        match self {
            Self::Whole => {
                // The model at rest has no skins any more.
                let gear = mesh.file.gear();
                match gear.len() {
                    0 => (None, 0),
                    count => (Some(mesh.rest.triangles_of(|object| !gear.contains(&object))), count),
                }
            }
            Self::Objects(objects) => (Some(mesh.rest.triangles_of(|object| objects.contains(&object))), 0),
            Self::Triangles(triangles) => (Some(triangles.clone()), 0),
            Self::Box(corners) => (Some(triangles_in_box(&mesh.rest.points, &mesh.triangles, *corners)), 0),
            Self::Joints(joints) => (Some(triangles_of_joints(mesh, rig, joints)), 0),
        }
    }
}

/// Middle of a triangle; `None` if a corner does not exist.
pub fn middle(points: &[Vec3], corners: &[u32; 3]) -> Option<Vec3> {
    let [a, b, c] = corners.map(|corner| points.get(corner as usize));
    Some((*a? + *b? + *c?) / 3.0)
}

/// Numbers of the triangles whose middle lies between two corners of a box.
pub fn triangles_in_box(points: &[Vec3], triangles: &[[u32; 3]], [a, b]: [Vec3; 2]) -> Vec<u32> {
    let (low, high) = (a.min(b), a.max(b));
    let is_inside = |place: Vec3| place.cmpge(low).all() && place.cmple(high).all();
    numbers(triangles, |corners| middle(points, corners).is_some_and(is_inside))
}

/// Numbers of the triangles that follow some joints of the weights more than all others.
pub fn triangles_held(triangles: &[[u32; 3]], weights: &Weights, is_wanted: impl Fn(u32) -> bool) -> Vec<u32> {
    let share = |corner: &u32| {
        let point = *corner as usize;
        let of_point = (point < weights.len()).then(|| weights.of(point));
        of_point.into_iter().flatten().filter(|(joint, _)| is_wanted(*joint)).map(|(_, weight)| weight).sum::<f32>()
    };
    numbers(triangles, |corners| corners.iter().map(share).sum::<f32>() > HELD * 3.0)
}

/// Numbers of the triangles that the weights of a mesh bind to the joints or to descendants of the joints; empty without
/// weights.
pub fn triangles_of_joints(mesh: &RigMesh, rig: &Rig, joints: &[Uid]) -> Vec<u32> {
    let Some(skin) = rig.skin(mesh.uid) else { return Vec::new() };
    let wanted: HashSet<Uid> =
        joints.iter().flat_map(|joint| rig.hierarchy(*joint)).map(|joint| joint.data.uid).collect();
    // Joints that commands made belong to the joint that they were made for.
    let is_of = |joint: &Uid| wanted.contains(joint) || skin.subjects.get(joint).is_some_and(|of| wanted.contains(of));
    let is_wanted: Vec<bool> = skin.joints.iter().map(is_of).collect();
    triangles_held(&mesh.triangles, &skin.weights, |joint| is_wanted.get(joint as usize).copied().unwrap_or(false))
}

/// Connected pieces of a mesh: a number for each triangle, equal for triangles that touch. Near linear time.
pub fn triangle_pieces(mesh: &RigMesh) -> Vec<u32> {
    let (place, count) = adjacency::weld(&mesh.rest.points);
    let welded: Vec<[u32; 3]> = mesh.triangles.iter().map(|t| t.map(|p| place[p as usize])).collect();
    let (islands, _) = adjacency::islands(&welded, count);
    welded.iter().map(|corners| islands[corners[0] as usize]).collect()
}

fn numbers(triangles: &[[u32; 3]], is_wanted: impl Fn(&[u32; 3]) -> bool) -> Vec<u32> {
    let wanted = triangles.iter().enumerate().filter(|(_, corners)| is_wanted(corners));
    wanted.map(|(number, _)| number as u32).collect()
}
