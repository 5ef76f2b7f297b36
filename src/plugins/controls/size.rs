//! Shapes of controls against the rig's meshes: what would lie in the flesh is drawn and picked larger.
//!
//! Commands know no mesh, so they give shapes a size that follows from bones. Once a rig has meshes, the shapes are measured on
//! them at rest, in a background task.

use std::{collections::HashMap, hash::Hash, sync::Arc};

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
    let of_each = factor_of_each(found, entities.iter().map(|(uid, _)| uid));
    for ((_, entity), factor) in entities.iter().zip(of_each) {
        if factors.get(entity).map_or(1.0, |known| known.0) != factor {
            commands.entity(entity).try_insert(ShapeFactor(factor));
        }
    }
}

/// Factor of each node, in their order; 1 for those that are not among the found ones.
fn factor_of_each<K: Copy + Eq + Hash>(
    found: &[(K, f32)],
    nodes: impl Iterator<Item = K>,
) -> impl Iterator<Item = f32> {
    let found: HashMap<K, f32> = found.iter().copied().collect();
    nodes.map(move |node| found.get(&node).copied().unwrap_or(1.0))
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

#[cfg(test)]
mod tests {
    use std::{cell::Cell, hash::Hasher};

    use super::*;

    /// Uid that counts how often it is compared.
    #[derive(Clone, Copy)]
    struct CountedUid<'a>(u64, &'a Cell<usize>);

    impl PartialEq for CountedUid<'_> {
        fn eq(&self, other: &Self) -> bool {
            self.1.set(self.1.get() + 1);
            self.0 == other.0
        }
    }

    impl Eq for CountedUid<'_> {}

    impl Hash for CountedUid<'_> {
        fn hash<H: Hasher>(&self, state: &mut H) {
            self.0.hash(state);
        }
    }

    #[test]
    fn factors_of_many_controls_are_found_at_once() {
        let compared = |count: u64| {
            let compared = Cell::new(0);
            let found: Vec<_> = (0..count).map(|number| (CountedUid(2 * number, &compared), 2.0)).collect();
            let nodes = (0..2 * count).map(|number| CountedUid(number, &compared));
            for (number, factor) in factor_of_each(&found, nodes).enumerate() {
                assert_eq!(factor, if number % 2 == 0 { 2.0 } else { 1.0 }, "{number}");
            }
            compared.get()
        };
        let (few, many) = (compared(1000), compared(4000));
        // Once for each found one, and now and then for two of one hash.
        assert!((1000..1500).contains(&few) && (4000..6000).contains(&many), "{few} and {many}");
    }
}
