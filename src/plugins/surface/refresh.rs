//! Refresh of a surface: work on plain data, for a background task.

use std::sync::Arc;

use bevy::math::{Affine3A, Vec3, Vec3A};

use crate::{
    mesh::{model::Model, skinning::skin_points, surface::Surface},
    rig::SkinData,
};

/// A mesh with its pose. Cheap to copy and to compare.
#[derive(Debug, Clone)]
pub(super) struct PosedMesh {
    pub(super) rest: Arc<Model>,
    pub(super) triangles: Arc<[[u32; 3]]>,
    /// Weights, and a matrix from rest to pose for each of their joints; `None` while the mesh is at rest.
    pub(super) bend: Option<(Arc<SkinData>, Vec<Affine3A>)>,
}

impl PosedMesh {
    /// Returns `true` for the same mesh in any pose.
    fn is_same_mesh(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.rest, &other.rest) && Arc::ptr_eq(&self.triangles, &other.triangles)
    }

    fn is_same_pose(&self, other: &Self) -> bool {
        match (&self.bend, &other.bend) {
            (None, None) => true,
            (Some((skin, matrices)), Some((other_skin, others))) => {
                Arc::ptr_eq(skin, other_skin)
                    && matrices.len() == others.len()
                    && matrices.iter().zip(others).all(|(a, b)| is_same(a, b))
            }
            _ => false,
        }
    }
}

/// Returns `true` if both are lists of the same meshes.
pub(super) fn are_same_meshes(a: &[PosedMesh], b: &[PosedMesh]) -> bool {
    a.len() == b.len() && a.iter().zip(b).all(|(a, b)| a.is_same_mesh(b))
}

/// Returns `true` if both are the same meshes in the same pose.
pub(super) fn are_same(a: &[PosedMesh], b: &[PosedMesh]) -> bool {
    are_same_meshes(a, b) && a.iter().zip(b).all(|(a, b)| a.is_same_pose(b))
}

/// Weights and matrices of a mesh, if one of the joints of its weights has moved. `moves` holds the matrices from rest
/// to pose of the moved joints.
///
/// The matrices move points of the rest mesh, also for weights that came with the file and belong to its bind pose.
pub(super) fn bend(skin: &Arc<SkinData>, moves: &[Option<Affine3A>]) -> Option<(Arc<SkinData>, Vec<Affine3A>)> {
    let list = || moves.iter().map(|matrix| matrix.unwrap_or(Affine3A::IDENTITY)).collect();
    moves.iter().any(|matrix| matrix.is_some()).then(|| (skin.clone(), list()))
}

/// Input of a refresh.
pub(super) struct Refresh {
    /// The meshes, in order of their uids.
    pub(super) meshes: Vec<PosedMesh>,
    /// A surface of the same meshes that can be refitted, in any pose.
    pub(super) base: Option<Arc<Surface>>,
    /// Surface without another owner: it is refitted itself, which saves a copy.
    pub(super) spare: Option<Surface>,
    /// Buffer for points.
    pub(super) points: Vec<Vec3>,
}

/// Result of a refresh.
pub(super) struct RefreshedSurface {
    pub(super) surface: Arc<Surface>,
    /// Marks a refit of `base`.
    pub(super) is_refit: bool,
    /// Marks a surface that can be refitted to any other pose: no triangle was left out.
    pub(super) is_whole: bool,
    /// Buffer for points.
    pub(super) points: Vec<Vec3>,
}

impl Refresh {
    /// Number of points of the meshes.
    pub(super) fn size(&self) -> usize {
        self.meshes.iter().map(|mesh| mesh.rest.points.len()).sum()
    }

    /// Skins the points, then refits or builds the hierarchy.
    pub(super) fn run(self) -> RefreshedSurface {
        let Self { meshes, base, spare, points: mut memory } = self;
        let points = posed_points(&meshes, &mut memory);
        let old = spare.or_else(|| base.as_deref().cloned());
        // With a point that is not finite, the surface has to be built without its triangles.
        let refitted = old.and_then(|mut surface| surface.refit(points).ok().map(|()| surface));
        let is_refit = refitted.is_some();
        let (surface, is_whole) = match refitted {
            Some(surface) => (surface, true),
            None => build(&meshes, points),
        };
        RefreshedSurface { surface: Arc::new(surface), is_refit, is_whole, points: memory }
    }
}

fn build(meshes: &[PosedMesh], points: &[Vec3]) -> (Surface, bool) {
    if let [only] = meshes {
        let surface = Surface::build(points, &only.triangles);
        let is_whole = surface.triangle_count() == only.triangles.len();
        return (surface, is_whole);
    }
    let mut triangles: Vec<[u32; 3]> = Vec::with_capacity(meshes.iter().map(|mesh| mesh.triangles.len()).sum());
    let mut first = 0;
    for mesh in meshes {
        triangles.extend(mesh.triangles.iter().map(|triangle| triangle.map(|corner| corner + first)));
        first += mesh.rest.points.len() as u32;
    }
    let surface = Surface::build(points, &triangles);
    let is_whole = surface.triangle_count() == triangles.len();
    (surface, is_whole)
}

/// The points of all meshes, one mesh after the other. A single mesh at rest needs no copy.
fn posed_points<'a>(meshes: &'a [PosedMesh], memory: &'a mut Vec<Vec3>) -> &'a [Vec3] {
    if let [PosedMesh { rest, bend: None, .. }] = meshes {
        return &rest.points;
    }
    if let [PosedMesh { rest, bend: Some((skin, matrices)), .. }] = meshes {
        skin_points(&rest.points, &skin.weights, matrices, memory);
        return memory;
    }
    memory.clear();
    let mut own = Vec::new();
    for mesh in meshes {
        match &mesh.bend {
            None => memory.extend_from_slice(&mesh.rest.points),
            Some((skin, matrices)) => {
                skin_points(&mesh.rest.points, &skin.weights, matrices, &mut own);
                memory.extend_from_slice(&own);
            }
        }
    }
    memory
}

/// Returns `true` if two transforms are equal to within rounding.
pub(super) fn is_same(a: &Affine3A, b: &Affine3A) -> bool {
    let tolerance = 1e-6;
    let near = |a: Vec3A, b: Vec3A| (a - b).abs().max_element() <= tolerance * b.abs().max_element().max(1.0);
    near(a.translation, b.translation)
        && near(a.matrix3.x_axis, b.matrix3.x_axis)
        && near(a.matrix3.y_axis, b.matrix3.y_axis)
        && near(a.matrix3.z_axis, b.matrix3.z_axis)
}
