//! Shapes of controls against the rig's meshes: what would lie in the flesh is drawn and picked larger.
//!
//! Commands know no mesh, so they give shapes a size that follows from bones. Once a rig has meshes, the shapes are measured on
//! them at rest, in a background task.

use std::sync::Arc;

use bevy::{
    math::Affine3A,
    prelude::*,
    tasks::{AsyncComputeTaskPool, Task, futures::check_ready},
};

use super::outline::lines_of;
use crate::{
    algo::control_size::{clear_factor, seen_factor},
    mesh::{model::Model, surface::Surface},
    plugins::{
        commands::{BuildResult, BuiltEntities},
        surface::{RigMesh, RigMeshes},
    },
    rig::{BuiltRig, Uid},
};

/// Factor by which the shape of a control is enlarged so that it does not lie in the flesh; on controls whose shape is, or was.
#[derive(Component, Reflect, Debug, Clone, Copy, PartialEq)]
#[reflect(Component)]
pub struct ShapeFactor(pub f32);

/// Shapes of a rig's controls, measured on its meshes.
#[derive(Component, Default)]
pub struct MeasuredShapes {
    /// Measured state, or the one that is being measured.
    meshes: Vec<Arc<Model>>,
    built: Option<Arc<BuiltRig>>,
    /// Surface of these meshes at rest.
    surface: Option<Arc<Surface>>,
    task: Option<Task<MeasuredFactors>>,
}

impl MeasuredShapes {
    /// True while a task measures shapes. An app that sleeps while nothing moves must run frames until it ends.
    pub fn is_busy(&self) -> bool {
        self.task.is_some()
    }

    /// Starts the task for these meshes and this built rig.
    fn measure(&mut self, meshes: Vec<Arc<Model>>, built: &Arc<BuiltRig>) {
        (self.meshes, self.built) = (meshes.clone(), Some(built.clone()));
        let (built, surface) = (built.clone(), self.surface.clone());
        self.task = Some(AsyncComputeTaskPool::get().spawn(async move {
            let surface = surface.unwrap_or_else(|| Arc::new(surface_of(&meshes)));
            let factors = shape_factors(&built, &surface);
            MeasuredFactors { surface, factors }
        }));
    }
}

struct MeasuredFactors {
    surface: Arc<Surface>,
    /// Controls with factors above 1.
    factors: Vec<(Uid, f32)>,
}

type Rigs<'w, 's> = Query<
    'w,
    's,
    (Entity, &'static RigMeshes, &'static BuildResult, &'static BuiltEntities, Option<&'static mut MeasuredShapes>),
>;

/// Measures the shapes of rigs whose meshes or controls changed.
pub(super) fn measure_shapes(
    mut rigs: Rigs,
    without: Query<(Entity, Option<&BuiltEntities>), (With<MeasuredShapes>, Without<RigMeshes>)>,
    meshes: Query<&RigMesh>,
    factors: Query<&ShapeFactor>,
    mut commands: Commands,
) {
    for (rig, entities) in &without {
        commands.entity(rig).remove::<MeasuredShapes>();
        let measured = entities.into_iter().flat_map(|entities| entities.iter());
        for (_, entity) in measured.filter(|(_, entity)| factors.contains(*entity)) {
            commands.entity(entity).try_insert(ShapeFactor(1.0));
        }
    }
    for (rig, bound, built, entities, measured) in &mut rigs {
        let mut now: Vec<(Uid, Arc<Model>)> =
            bound.iter().filter_map(|mesh| meshes.get(mesh).ok()).map(|mesh| (mesh.uid, mesh.rest.clone())).collect();
        now.sort_by_key(|(uid, _)| *uid);
        let now: Vec<Arc<Model>> = now.into_iter().map(|(_, model)| model).collect();
        let Some(mut measured) = measured else {
            // The task runs from the first frame on, so that an app which waits for it does not sleep before.
            let mut first = MeasuredShapes::default();
            first.measure(now, &built.0);
            commands.entity(rig).insert(first);
            continue;
        };
        let unseen = measured.bypass_change_detection();
        if let Some(done) = unseen.task.as_mut().and_then(check_ready) {
            unseen.task = None;
            unseen.surface = Some(done.surface);
            write(&done.factors, entities, &factors, &mut commands);
        }
        if unseen.task.is_some() {
            continue;
        }
        let is_known =
            now.len() == unseen.meshes.len() && now.iter().zip(&unseen.meshes).all(|(a, b)| Arc::ptr_eq(a, b));
        let is_built = unseen.built.as_ref().is_some_and(|known| Arc::ptr_eq(known, &built.0));
        if is_known && is_built {
            continue;
        }
        if !is_known {
            unseen.surface = None;
        }
        unseen.measure(now, &built.0);
    }
}

/// Gives controls their factors.
fn write(found: &[(Uid, f32)], entities: &BuiltEntities, factors: &Query<&ShapeFactor>, commands: &mut Commands) {
    for (uid, entity) in entities.iter() {
        let factor = found.iter().find(|(known, _)| *known == uid).map_or(1.0, |(_, factor)| *factor);
        if factors.get(entity).map_or(1.0, |known| known.0) != factor {
            commands.entity(entity).try_insert(ShapeFactor(factor));
        }
    }
}

/// The surface of meshes at rest, in the rig's space.
fn surface_of(models: &[Arc<Model>]) -> Surface {
    let (mut points, mut triangles) = (Vec::new(), Vec::new());
    for model in models {
        let start = points.len() as u32;
        points.extend(model.points.iter().copied());
        triangles.extend(model.point_triangles().into_iter().map(|corners| corners.map(|corner| corner + start)));
    }
    Surface::build(&points, &triangles)
}

/// Factors above 1 of the controls of a built rig whose shapes would lie inside of a surface, in the order of the nodes. Shapes
/// with a size of their own stay as their author made them, unless most of such a shape lies inside: then they grow until half
/// of them is seen.
pub fn shape_factors(built: &BuiltRig, surface: &Surface) -> Vec<(Uid, f32)> {
    let mut globals: Vec<Affine3A> = Vec::with_capacity(built.nodes.len());
    let mut found = Vec::new();
    for node in &built.nodes {
        let above = node.parent.map_or(Affine3A::IDENTITY, |parent| globals[parent]);
        let place = above * node.base.affine();
        globals.push(place);
        let Some(control) = node.control.as_ref() else { continue };
        let about = (place * control.offset.affine()).translation.into();
        let lines = lines_of(control, place);
        let factor = if control.fits { clear_factor } else { seen_factor }(surface, &lines, about);
        if factor > 1.0 {
            found.push((node.uid, factor));
        }
    }
    found
}
