//! Canvases: meshes prepared for brushes, in the background, and only while somebody paints.

use std::sync::Arc;

use bevy::{
    prelude::*,
    tasks::{AsyncComputeTaskPool, Task, futures::check_ready},
};

use crate::{
    algo::paint::Canvas,
    mesh::model::Model,
    plugins::surface::{RigMesh, SkinOf},
};

/// Rig whose meshes are prepared for brushes; those of others are not kept.
#[derive(Resource, Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct CanvasUse(pub Option<Entity>);

/// Mesh prepared for brushes; on the entity with the [`RigMesh`].
#[derive(Component, Reflect, Clone)]
#[reflect(opaque)]
#[reflect(Component, Clone)]
pub struct PaintCanvas {
    /// The prepared mesh.
    pub canvas: Arc<Canvas>,
    rest: Arc<Model>,
}

impl PaintCanvas {
    /// True if the canvas is of this version of the mesh.
    pub fn is_of(&self, mesh: &RigMesh) -> bool {
        Arc::ptr_eq(&self.rest, &mesh.rest)
    }
}

/// Running preparation of a mesh.
#[derive(Component)]
pub struct CanvasJob {
    task: Task<Canvas>,
    rest: Arc<Model>,
}

pub(super) fn prepare(
    mut commands: Commands,
    wanted: Res<CanvasUse>,
    mut meshes: Query<(Entity, &RigMesh, &SkinOf, Option<&PaintCanvas>, Option<&mut CanvasJob>)>,
) {
    for (entity, mesh, of, canvas, job) in &mut meshes {
        if wanted.0 != Some(of.0) {
            if canvas.is_some() || job.is_some() {
                commands.entity(entity).try_remove::<(PaintCanvas, CanvasJob)>();
            }
            continue;
        }
        match job {
            Some(mut job) if Arc::ptr_eq(&job.rest, &mesh.rest) => {
                if let Some(canvas) = check_ready(&mut job.bypass_change_detection().task) {
                    let canvas = PaintCanvas { canvas: Arc::new(canvas), rest: mesh.rest.clone() };
                    commands.entity(entity).try_insert(canvas).try_remove::<CanvasJob>();
                }
            }
            _ if canvas.is_some_and(|canvas| canvas.is_of(mesh)) => {}
            _ => {
                let (rest, triangles) = (mesh.rest.clone(), mesh.triangles.clone());
                let task = AsyncComputeTaskPool::get().spawn(async move { Canvas::new(&rest.points, &triangles) });
                commands.entity(entity).try_insert(CanvasJob { task, rest: mesh.rest.clone() });
            }
        }
    }
}
