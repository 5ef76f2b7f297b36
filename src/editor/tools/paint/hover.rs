//! Places of meshes under the pointer.

use std::sync::Arc;

use bevy::{ecs::system::SystemParam, prelude::*};

use crate::{
    algo::paint::{BrushError, Canvas, Spot},
    editor::tools::scene::EditedRig,
    plugins::{
        painting::{PaintCanvas, PaintableError},
        surface::{RigMesh, RigMeshes},
        viewport::Sight,
    },
    rig::Uid,
};

/// Meshes of rigs, with what is prepared of them for brushes.
#[derive(SystemParam)]
pub struct PaintMeshes<'w, 's> {
    rigs: Query<'w, 's, &'static RigMeshes>,
    meshes: Query<'w, 's, (&'static RigMesh, Option<&'static PaintCanvas>)>,
}

/// Place of a mesh under the pointer.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PointedPlace {
    /// Entity of the mesh.
    pub mesh: Entity,
    /// Uid of the mesh.
    pub uid: Uid,
    /// Triangle of the mesh.
    pub triangle: u32,
    /// Barycentric coordinates on the triangle.
    pub barycentric: Vec3,
    /// The place as posed, in the rig's space.
    pub place: Vec3,
}

/// Reason why a stroke would paint nothing; a sentence without its full stop.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum PaintObstacle {
    /// The rig has no mesh.
    #[error("the rig has no mesh to paint on; open one first (Ctrl+O)")]
    NoMesh,
    /// The mesh is still being prepared.
    #[error("the mesh is still being prepared; wait a moment")]
    Preparing,
    /// The ray misses the mesh.
    #[error("the pointer is beside the mesh; move it over the mesh")]
    Beside,
    /// The mesh has no weights.
    #[error("the mesh has no weights yet; compute them first (B)")]
    NoWeights,
    /// No joint is selected.
    #[error("no joint is selected; choose one in the Weights panel or the Hierarchy")]
    NoJoint,
    /// The joint is locked.
    #[error("the weights of {0} are locked; unlock it in the Weights panel, or choose another joint")]
    Locked(String),
    /// A node that is no joint.
    #[error(transparent)]
    Joint(#[from] PaintableError),
    /// A brush that cannot paint.
    #[error(transparent)]
    Brush(#[from] BrushError),
}

impl PaintMeshes<'_, '_> {
    /// The place of a rig's meshes under a pixel.
    ///
    /// # Errors
    /// The reason if there is none.
    pub fn at(&self, rig: &EditedRig, sight: &Sight, at: Vec2) -> Result<PointedPlace, PaintObstacle> {
        let surface = rig.surface.as_deref().and_then(|surface| surface.ready());
        let surface = surface.ok_or(if rig.has_mesh { PaintObstacle::Preparing } else { PaintObstacle::NoMesh })?;
        let ray = sight.ray(at);
        let hit = surface.closest(&ray).ok_or(PaintObstacle::Beside)?;
        let found = surface.closest_point(ray.at(hit.distance)).ok_or(PaintObstacle::Beside)?;
        // The surface has the triangles of all meshes, one mesh after the other in the order of their uids.
        let own = self.rigs.get(rig.entity).map_err(|_| PaintObstacle::NoMesh)?;
        let mut meshes: Vec<(Entity, &RigMesh)> =
            own.iter().filter_map(|mesh| Some((mesh, self.meshes.get(mesh).ok()?.0))).collect();
        meshes.sort_by_key(|(_, mesh)| mesh.uid);
        let mut triangle = found.triangle as usize;
        for (entity, mesh) in meshes {
            if let Some(left) = triangle.checked_sub(mesh.triangles.len()) {
                triangle = left;
                continue;
            }
            return Ok(PointedPlace {
                mesh: entity,
                uid: mesh.uid,
                triangle: triangle as u32,
                barycentric: found.barycentric,
                place: found.point,
            });
        }
        Err(PaintObstacle::Preparing)
    }

    /// The canvas of a mesh, if it is ready.
    pub fn canvas(&self, mesh: Entity) -> Option<&Arc<Canvas>> {
        let (mesh, canvas) = self.meshes.get(mesh).ok()?;
        canvas.filter(|canvas| canvas.is_of(mesh)).map(|canvas| &canvas.canvas)
    }

    /// The place on the mesh at rest, with its canvas.
    pub fn spot(&self, place: &PointedPlace) -> Option<(&Arc<Canvas>, Spot)> {
        let canvas = self.canvas(place.mesh)?;
        Some((canvas, canvas.spot(place.triangle, place.barycentric)?))
    }

    /// The point nearest to a place, among the corners of its triangle.
    pub fn point(&self, place: &PointedPlace) -> Option<u32> {
        let (canvas, spot) = self.spot(place)?;
        canvas.point_at(&spot)
    }
}
