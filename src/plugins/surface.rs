//! The posed surface of a rig, for ray queries.
//!
//! Bevy's own `MeshRayCast` gives one hit a mesh, in the bind pose. Placing needs all hits on the mesh in its current
//! pose, so a rig has a [`RigSurface`] over all its meshes.
//!
//! The work on the main thread does not grow with the mesh. Reading the mesh, skinning its points and building or
//! refitting the hierarchy run in a background task, one at a time for a rig; meanwhile only the latest pose waits, and
//! poses in between are skipped. Until a task ends, rays meet the last finished surface: a fraction of a second behind
//! for the first one (rays meet nothing until it is ready), some hundredths for a pose. A request that changes a rig by
//! a ray's hits waits for the surface to catch up with the pose that the user saw ([`RigSurface::shows`]), so that
//! results never depend on timing; a preview need not wait. Meshes of few points are refreshed within the frame.

mod refresh;

use std::sync::Arc;

use bevy::{
    ecs::entity::EntityHashSet,
    math::Affine3A,
    prelude::*,
    tasks::{AsyncComputeTaskPool, Task, futures::check_ready},
};

use self::refresh::{PosedMesh, Refresh, RefreshedSurface, are_same, are_same_meshes, bend, is_same};
use super::{
    RigSystems,
    commands::{BuildResult, BuiltEntities},
    configure_sets,
    document::{Joint, JointEntities, NodeOf},
};
use crate::{
    mesh::{
        model::{Model, Weights},
        ray::{Hit, Ray},
        skinning::posed_model,
        surface::Surface,
    },
    rig::{
        Rig, Uid,
        deform::{DeformJoint, DeformSkeleton},
    },
};

/// Largest number of points of meshes that are refreshed at once, which takes less than a millisecond.
const FEW_POINTS: usize = 2048;

/// Plugin of the posed surface.
pub struct SurfacePlugin;

impl Plugin for SurfacePlugin {
    fn build(&self, app: &mut App) {
        configure_sets(app);
        app.add_systems(PreUpdate, land_surfaces).add_systems(PostUpdate, refresh_surfaces.in_set(RigSystems::Surface));
    }
}

/// A mesh that a rig moves; its entity also has [`SkinOf`].
#[derive(Component, Reflect, Debug, Clone)]
#[reflect(opaque)]
#[reflect(Component, Clone)]
pub struct RigMesh {
    /// Identity, by which the rig names the mesh's weights.
    pub uid: Uid,
    /// The mesh as its file has it.
    pub file: Arc<Model>,
    /// The mesh skinned to its file's joints at rest; shared with `file` if that has no skins.
    pub rest: Arc<Model>,
    /// The joint that each node of the file became.
    pub nodes: Arc<[Uid]>,
    /// Triangles over the model's points.
    pub triangles: Arc<[[u32; 3]]>,
}

impl RigMesh {
    /// Makes the component of a model; `nodes` are the joints that its nodes became.
    ///
    /// Linear in the size of the model, some tens of milliseconds for a million triangles: call it in the task that
    /// reads the file and spawn the result.
    pub fn new(uid: Uid, file: Model, nodes: Vec<Uid>) -> Self {
        let triangles = file.point_triangles().into();
        let file = Arc::new(file);
        let rest = if file.skins.is_empty() { file.clone() } else { Arc::new(file.at_rest()) };
        Self { uid, file, rest, nodes: nodes.into(), triangles }
    }
}

impl Drop for RigMesh {
    fn drop(&mut self) {
        // Freeing a large model takes longer than a frame.
        if Arc::strong_count(&self.triangles) == 1 {
            let arrays =
                (std::mem::take(&mut self.file), std::mem::take(&mut self.rest), std::mem::take(&mut self.triangles));
            discard(arrays);
        }
    }
}

/// The rig that moves a mesh.
#[derive(Component, Reflect, Debug, Clone, Copy)]
#[relationship(relationship_target = RigMeshes)]
#[reflect(Component)]
pub struct SkinOf(pub Entity);

/// The meshes that a rig moves.
#[derive(Component, Reflect, Debug, Default)]
#[relationship_target(relationship = SkinOf, linked_spawn)]
#[reflect(Component)]
pub struct RigMeshes(Vec<Entity>);

/// The surface of all meshes of a rig in their current pose, in the rig's space.
///
/// `Changed<RigSurface>` reports that another pose was requested, or that a refresh has ended. An app that sleeps while
/// nothing moves must run frames while the surface [is stale](RigSurface::is_stale).
#[derive(Component, Reflect)]
#[reflect(Component, from_reflect = false)]
pub struct RigSurface {
    /// The current surface, and the number of the state that it shows.
    #[reflect(ignore)]
    landed: Option<(Arc<Surface>, u64)>,
    /// Marks a surface that can be refitted to any pose.
    is_whole: bool,
    /// The state that it should show.
    #[reflect(ignore)]
    wanted: Vec<PosedMesh>,
    number: u64,
    /// The current refresh, and the number of the state that it will show.
    #[reflect(ignore)]
    task: Option<(Task<RefreshedSurface>, u64)>,
    /// The meshes that `landed` was built from, or that the task builds from.
    #[reflect(ignore)]
    built: Vec<PosedMesh>,
    #[reflect(ignore)]
    spare: Option<Surface>,
    #[reflect(ignore)]
    points: Vec<Vec3>,
}

impl RigSurface {
    /// Hits of a ray on the surface, nearest first; none until it is ready.
    ///
    /// Microseconds, whatever the size of the mesh.
    pub fn hits(&self, ray: &Ray) -> Vec<Hit> {
        let mut hits = Vec::new();
        if let Some(surface) = self.ready() {
            surface.hits(ray, &mut hits);
        }
        hits
    }

    /// The last finished surface; `None` while the first hierarchy is being built.
    pub fn ready(&self) -> Option<&Surface> {
        self.landed.as_ref().map(|(surface, _)| surface.as_ref())
    }

    /// The last finished surface for queries on another thread: it stays unchanged while the rig's surface is updated.
    ///
    /// For work that follows many rays ([`FollowedStroke`](super::stroke::FollowedStroke)). Drop it soon: while a clone
    /// is held, the next pose needs a copy.
    pub fn shared(&self) -> Option<Arc<Surface>> {
        self.landed.as_ref().map(|(surface, _)| surface.clone())
    }

    /// Returns `true` if the meshes or the pose have changed since the state that [`RigSurface::ready`] shows, or
    /// nothing is ready.
    pub fn is_stale(&self) -> bool {
        !self.shows(self.number)
    }

    /// The number of the state of meshes and pose that the surface should show; it rises with each change.
    pub fn wanted(&self) -> u64 {
        self.number
    }

    /// Returns `true` if the surface shows that state, or a later one.
    pub fn shows(&self, number: u64) -> bool {
        self.landed.as_ref().is_some_and(|(_, landed)| *landed >= number)
    }

    /// The meshes in the pose that the surface should show, in the order of their uids, as dual quaternions move them.
    /// Linear in the size of the meshes.
    pub fn dual_quaternion_models(&self) -> Vec<Model> {
        let posed = |mesh: &PosedMesh| match &mesh.bend {
            Some((skin, matrices)) => posed_model(&mesh.rest, &skin.weights, matrices),
            None => posed_model(&mesh.rest, &Weights::default(), &[]),
        };
        self.wanted.iter().map(posed).collect()
    }

    /// The least and greatest corner of the surface; the unit cube if it is empty or not ready.
    pub fn bounds(&self) -> [Vec3; 2] {
        let bounds = self.ready().and_then(Surface::bounds);
        bounds.map_or([Vec3::splat(-0.5), Vec3::splat(0.5)], |(low, high)| [low, high])
    }

    fn new(meshes: Vec<PosedMesh>) -> Self {
        let mut surface = Self {
            landed: None,
            is_whole: false,
            wanted: meshes,
            number: 1,
            task: None,
            built: Vec::new(),
            spare: None,
            points: Vec::new(),
        };
        surface.start();
        surface
    }

    /// Starts the pending refresh, unless one is running.
    fn start(&mut self) {
        if self.task.is_some() || !self.is_stale() {
            return;
        }
        let fits = self.is_whole && are_same_meshes(&self.built, &self.wanted);
        if !fits {
            discard((self.spare.take(), std::mem::take(&mut self.built)));
        }
        let refresh = Refresh {
            meshes: self.wanted.clone(),
            base: if fits { self.shared() } else { None },
            spare: self.spare.take(),
            points: std::mem::take(&mut self.points),
        };
        self.built.clone_from(&self.wanted);
        if refresh.size() <= FEW_POINTS {
            self.land(refresh.run(), self.number);
        } else {
            let task = AsyncComputeTaskPool::get().spawn(async move { refresh.run() });
            self.task = Some((task, self.number));
        }
    }

    fn land(&mut self, refreshed: RefreshedSurface, number: u64) {
        let RefreshedSurface { surface, is_refit, is_whole, points } = refreshed;
        let old = self.landed.replace((surface, number)).map(|(old, _)| old);
        (self.is_whole, self.points) = (is_whole, points);
        if is_refit {
            self.spare = old.and_then(|old| Arc::try_unwrap(old).ok());
        } else {
            discard(old);
        }
    }
}

impl Drop for RigSurface {
    fn drop(&mut self) {
        discard((self.landed.take(), self.spare.take(), std::mem::take(&mut self.points)));
        discard((std::mem::take(&mut self.wanted), std::mem::take(&mut self.built)));
    }
}

/// Drops a possibly large value in the background.
fn discard<T: Send + 'static>(value: T) {
    // Without a pool (no app was ever made) it is dropped right here.
    if let Some(pool) = AsyncComputeTaskPool::try_get() {
        pool.spawn(async move { drop(value) }).detach();
    }
}

/// Answer to a request that queries the surface.
pub(super) enum Answer<'a> {
    /// The surface shows the state that the user saw; `None` if the rig has no mesh.
    Now(Option<&'a RigSurface>),
    /// The surface is behind: the request has to ask again in the next frame.
    Wait,
}

/// Decides whether a request can be answered. `since` belongs to the request and is `None` at first.
pub(super) fn answer<'a>(since: &mut Option<u64>, has_mesh: bool, surface: Option<&'a RigSurface>) -> Answer<'a> {
    match surface {
        Some(surface) => {
            // The numbers start again after the last mesh was closed and another opened.
            let since = (*since.get_or_insert(surface.wanted())).min(surface.wanted());
            if surface.shows(since) { Answer::Now(Some(surface)) } else { Answer::Wait }
        }
        None if has_mesh => Answer::Wait,
        None => Answer::Now(None),
    }
}

/// Takes over finished background tasks, before any query.
fn land_surfaces(mut surfaces: Query<&mut RigSurface>) {
    for mut surface in &mut surfaces {
        let running = &mut surface.bypass_change_detection().task;
        let done = running.as_mut().and_then(|(task, number)| Some((check_ready(task)?, *number)));
        if let Some((refreshed, number)) = done {
            surface.task = None;
            surface.land(refreshed, number);
            surface.start();
        }
    }
}

type FollowedRigs<'a> = (
    Entity,
    Ref<'a, Rig>,
    Ref<'a, RigMeshes>,
    &'a JointEntities,
    Option<Ref<'a, BuildResult>>,
    Option<Ref<'a, BuiltEntities>>,
    &'a GlobalTransform,
    Option<&'a mut RigSurface>,
);

/// Notices that a rig's meshes, weights or pose changed, and has the surface follow.
fn refresh_surfaces(
    mut commands: Commands,
    mut rigs: Query<FollowedRigs>,
    without: Query<Entity, (With<RigSurface>, Without<RigMeshes>)>,
    meshes: Query<Ref<RigMesh>>,
    moved: Query<&NodeOf, (With<Joint>, Changed<GlobalTransform>)>,
    joints: Query<Ref<GlobalTransform>, With<Joint>>,
) {
    for rig in &without {
        commands.entity(rig).remove::<RigSurface>();
    }
    let moved: EntityHashSet = moved.iter().map(|of| of.0).collect();
    for (entity, rig, bound, entities, built, created, place, surface) in &mut rigs {
        let models = || bound.iter().filter_map(|mesh| meshes.get(mesh).ok());
        let has_moved = |(_, created)| joints.get(created).is_ok_and(|place| place.is_changed());
        let is_changed = rig.is_changed()
            || bound.is_changed()
            || moved.contains(&entity)
            || built.as_ref().is_some_and(|built| built.is_changed())
            || created.as_ref().is_some_and(|created| created.is_changed() || created.iter().any(has_moved));
        if surface.is_some() && !is_changed && !models().any(|mesh| mesh.is_changed()) {
            continue;
        }
        let mut models: Vec<Ref<RigMesh>> = models().collect();
        models.sort_by_key(|mesh| mesh.uid);
        let is_skinned = models.iter().any(|mesh| rig.skin(mesh.uid).is_some());
        let pose = is_skinned.then(|| {
            let skeleton = DeformSkeleton::new(&rig, built.as_ref().map(|built| &*built.0));
            let entity = |joint| entities.get(joint).or_else(|| created.as_ref()?.get(joint));
            let moves = moves(&skeleton, entity, place, &joints);
            (skeleton, moves)
        });
        let wanted = models.iter().map(|mesh| PosedMesh {
            rest: mesh.rest.clone(),
            triangles: mesh.triangles.clone(),
            bend: rig.skin(mesh.uid).zip(pose.as_ref()).and_then(|(skin, (skeleton, moves))| {
                let holders = skeleton.holders(&rig, skin);
                bend(skin, &holders.iter().map(|holder| moves[(*holder)?]).collect::<Vec<_>>())
            }),
        });
        let wanted: Vec<PosedMesh> = wanted.collect();
        match surface {
            Some(surface) if are_same(&surface.wanted, &wanted) => {}
            Some(mut surface) => {
                surface.wanted = wanted;
                surface.number += 1;
                surface.start();
            }
            None => {
                commands.entity(entity).insert(RigSurface::new(wanted));
            }
        }
    }
}

/// Matrices from rest to pose, in the rig's space, of the joints of a skeleton; `None` for those that have not moved.
fn moves(
    skeleton: &DeformSkeleton,
    entity: impl Fn(Uid) -> Option<Entity>,
    place: &GlobalTransform,
    joints: &Query<Ref<GlobalTransform>, With<Joint>>,
) -> Vec<Option<Affine3A>> {
    let to_rig = place.affine().inverse();
    let moved = |joint: &DeformJoint| {
        let pose = to_rig * joints.get(entity(joint.uid)?).ok()?.affine();
        let rest = Affine3A::from(joint.rest);
        (!is_same(&pose, &rest)).then(|| pose * rest.inverse())
    };
    skeleton.joints().iter().map(moved).collect()
}
