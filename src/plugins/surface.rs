//! The posed surface of a rig: what rays meet.
//!
//! Bevy's own `MeshRayCast` gives one hit a mesh, in the bind pose. Placing needs all hits on the mesh as it stands
//! now, so a rig has a [`RigSurface`] over all its meshes, refreshed in the background when the pose changes. Rays
//! are answered at any time; while a hierarchy is being built, by testing every triangle.

use std::sync::Arc;

use bevy::{
    math::{Affine3A, Vec3A},
    prelude::*,
    tasks::{AsyncComputeTaskPool, Task, futures::check_ready},
};

use super::{
    RigSystems, configure_sets,
    document::{Joint, JointEntities},
};
use crate::{
    mesh::{
        model::Model,
        ray::{Hit, Ray},
        skinning::skin_points,
        surface::{PendingSurface, Surface},
    },
    rig::{Rig, SkinData, Uid},
};

/// Adds the posed surface.
pub struct SurfacePlugin;

impl Plugin for SurfacePlugin {
    fn build(&self, app: &mut App) {
        configure_sets(app);
        app.add_systems(PostUpdate, (refresh_surfaces, land_surfaces).chain().in_set(RigSystems::Surface));
    }
}

/// A mesh that a rig moves; beside it stands [`SkinOf`].
#[derive(Component, Debug, Clone)]
pub struct RigMesh {
    /// Identity, by which the rig names the mesh's weights.
    pub uid: Uid,
    /// The mesh as its file has it.
    pub file: Arc<Model>,
    /// The mesh where its file's joints hold it at rest.
    pub rest: Arc<Model>,
    /// The joint that each node of the file became.
    pub nodes: Arc<[Uid]>,
    /// Triangles over the model's points.
    pub triangles: Arc<[[u32; 3]]>,
}

impl RigMesh {
    /// Takes a model as it was read; `nodes` are the joints that its nodes became.
    pub fn new(uid: Uid, file: Model, nodes: Vec<Uid>) -> Self {
        let rest = Arc::new(file.at_rest());
        let triangles = file.point_triangles().into();
        Self { uid, file: Arc::new(file), rest, nodes: nodes.into(), triangles }
    }
}

/// The rig that moves a mesh.
#[derive(Component, Debug, Clone, Copy)]
#[relationship(relationship_target = RigMeshes)]
pub struct SkinOf(pub Entity);

/// The meshes that a rig moves.
#[derive(Component, Debug, Default)]
#[relationship_target(relationship = SkinOf, linked_spawn)]
pub struct RigMeshes(Vec<Entity>);

/// The surface of all meshes of a rig as they stand now, in the rig's space.
#[derive(Component)]
pub struct RigSurface {
    current: Arc<PendingSurface>,
    points: Arc<[Vec3]>,
    triangles: Arc<[[u32; 3]]>,
    task: Option<Task<Arc<PendingSurface>>>,
}

impl RigSurface {
    /// All places where a ray crosses the surface, nearest first.
    pub fn hits(&self, ray: &Ray) -> Vec<Hit> {
        let mut hits = Vec::new();
        self.current.hits(ray, &mut hits);
        hits
    }

    /// The hierarchy over the surface, once it is built.
    pub fn ready(&self) -> Option<&Surface> {
        self.current.ready()
    }

    /// The least and greatest corner of the surface; the unit cube if it is empty.
    pub fn bounds(&self) -> [Vec3; 2] {
        let finite = self.points.iter().filter(|point| point.is_finite());
        let bounds = finite.fold([Vec3::INFINITY, Vec3::NEG_INFINITY], |[low, high], p| [low.min(*p), high.max(*p)]);
        if bounds[0].cmple(bounds[1]).all() { bounds } else { [Vec3::splat(-0.5), Vec3::splat(0.5)] }
    }
}

/// Notices that a rig's meshes, weights or pose changed, and starts to build the surface for it.
fn refresh_surfaces(
    mut commands: Commands,
    rigs: Query<(Entity, Ref<Rig>, Ref<RigMeshes>, &JointEntities, &GlobalTransform)>,
    mut surfaces: Query<&mut RigSurface>,
    meshes: Query<Ref<RigMesh>>,
    joints: Query<Ref<GlobalTransform>, With<Joint>>,
) {
    for (entity, rig, bound, entities, place) in &rigs {
        let mut models: Vec<Ref<RigMesh>> = bound.iter().filter_map(|mesh| meshes.get(mesh).ok()).collect();
        models.sort_by_key(|mesh| mesh.uid);
        let known = surfaces.get_mut(entity).ok();
        let meshes_changed = bound.is_changed() || models.iter().any(|mesh| mesh.is_changed());
        let pose_changed = || {
            rig.skins().flat_map(|(_, skin)| &skin.joints).any(|uid| {
                entities.get(*uid).and_then(|joint| joints.get(joint).ok()).is_some_and(|place| place.is_changed())
            })
        };
        if known.is_some() && !meshes_changed && !rig.is_changed() && !pose_changed() {
            continue;
        }
        let to_rig = place.affine().inverse();
        let pose = |uid: Uid| {
            let joint = entities.get(uid).and_then(|joint| joints.get(joint).ok());
            joint.map(|place| to_rig * place.affine())
        };
        let mut points: Vec<Vec3> = Vec::new();
        let mut triangles: Vec<[u32; 3]> = Vec::new();
        for mesh in &models {
            let first = points.len() as u32;
            points.extend(posed_points(mesh, rig.skin(mesh.uid), &rig, &pose));
            triangles.extend(mesh.triangles.iter().map(|t| t.map(|corner| corner + first)));
        }
        match known {
            Some(mut surface) if !meshes_changed && surface.points.len() == points.len() => {
                if surface.points.iter().zip(&points).all(|(a, b)| a == b) {
                    continue;
                }
                surface.repose(points.into());
            }
            _ => {
                let surface = RigSurface::build(points.into(), triangles.into());
                commands.entity(entity).insert(surface);
            }
        }
    }
}

impl RigSurface {
    fn build(points: Arc<[Vec3]>, triangles: Arc<[[u32; 3]]>) -> Self {
        let current = Arc::new(PendingSurface::new(points.clone(), triangles.clone()));
        let building = current.clone();
        let task = AsyncComputeTaskPool::get().spawn(async move {
            building.build();
            building
        });
        Self { current, points, triangles, task: Some(task) }
    }

    /// Answers for other positions at once, and refits the hierarchy to them in the background.
    fn repose(&mut self, points: Arc<[Vec3]>) {
        let old = self.current.clone();
        self.points = points.clone();
        self.current = Arc::new(PendingSurface::new(points.clone(), self.triangles.clone()));
        let current = self.current.clone();
        self.task = Some(AsyncComputeTaskPool::get().spawn(async move {
            let refitted = old.ready().cloned().and_then(|mut surface| surface.refit(&points).ok().map(|()| surface));
            match refitted {
                Some(surface) => current.set(surface),
                None => {
                    current.build();
                }
            }
            current
        }));
    }
}

/// Drops the tasks that are done.
fn land_surfaces(mut surfaces: Query<&mut RigSurface>) {
    for mut surface in &mut surfaces {
        let done = surface.bypass_change_detection().task.as_mut().is_some_and(|task| check_ready(task).is_some());
        if done {
            surface.task = None;
        }
    }
}

/// A mesh's points where the pose holds them, in the rig's space. `pose` gives a joint's transform to the rig's space.
pub fn posed_points(
    mesh: &RigMesh,
    skin: Option<&Arc<SkinData>>,
    rig: &Rig,
    pose: &dyn Fn(Uid) -> Option<Affine3A>,
) -> Vec<Vec3> {
    let Some(skin) = skin else { return mesh.rest.points.clone() };
    // Rest to pose. Weights that came with the file hold its bind pose; as long as nobody moves a joint that is the
    // mesh at rest, and from there on the rest mesh follows its joints.
    let matrices: Vec<Affine3A> = skin
        .joints
        .iter()
        .map(|uid| match pose(*uid) {
            Some(pose) => {
                let rest: Affine3A = rig.rest_global(*uid).into();
                if same(&pose, &rest) { Affine3A::IDENTITY } else { pose * rest.inverse() }
            }
            None => Affine3A::IDENTITY,
        })
        .collect();
    if matrices.iter().all(|matrix| *matrix == Affine3A::IDENTITY) {
        return mesh.rest.points.clone();
    }
    let mut points = Vec::new();
    skin_points(&mesh.rest.points, &skin.weights, &matrices, &mut points);
    points
}

fn same(a: &Affine3A, b: &Affine3A) -> bool {
    let tolerance = 1e-6;
    let near = |a: Vec3A, b: Vec3A| (a - b).abs().max_element() <= tolerance * b.abs().max_element().max(1.0);
    near(a.translation, b.translation)
        && near(a.matrix3.x_axis, b.matrix3.x_axis)
        && near(a.matrix3.y_axis, b.matrix3.y_axis)
        && near(a.matrix3.z_axis, b.matrix3.z_axis)
}
