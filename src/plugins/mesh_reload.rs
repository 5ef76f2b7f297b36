//! Another version of a mesh in place of the one that a rig moves: joints stay, weights are transferred.
//!
//! A [`ReloadRequest`] transfers the weights in a task and ends as one step of the history, with the mesh exchanged in the same
//! frame. Undoing the step brings both back, redoing it exchanges both again. A mesh of an instance, which has no document, gets
//! the version and its weights alone.

use std::{
    collections::HashMap,
    sync::{Arc, OnceLock},
};

use bevy::{
    prelude::*,
    tasks::{AsyncComputeTaskPool, Task, futures::check_ready},
};

use super::{
    RigSystems, configure_sets,
    document::{EditReport, EditRequest},
    history::RigHistory,
    landing::{HeldResult, JobOutcome, Landing, ResultHeld},
    skinning::InstanceSkin,
    surface::{RigMesh, SkinOf},
};
use crate::{
    algo::transfer::{TransferError, TransferMesh, TransferReport, TransferSettings, transfer_weights},
    mesh::{model::Model, surface::Surface},
    rig::{
        Rig, RigEdit, SkinData, Uid,
        operations::Operation,
        step::{Commit, Step},
    },
};

/// Name of the step of a reloaded mesh.
pub const RELOAD: &str = "Reload mesh";

/// Plugin that exchanges meshes for other versions of them.
pub struct MeshReloadPlugin;

impl Plugin for MeshReloadPlugin {
    fn build(&self, app: &mut App) {
        configure_sets(app);
        app.add_message::<ReloadRequest>()
            .add_message::<ReloadAnswer>()
            .add_message::<ResultHeld>()
            .add_message::<EditReport>()
            .add_message::<EditRequest>()
            .add_systems(
                Update,
                (
                    (start, land).chain().after(RigSystems::Gesture).before(RigSystems::Edits),
                    exchange.after(RigSystems::Edits).before(RigSystems::Build),
                ),
            );
    }
}

/// Request to exchange a mesh for another version of it.
#[derive(Message, Debug, Clone)]
pub struct ReloadRequest {
    /// The entity with the [`RigMesh`].
    pub mesh: Entity,
    /// The version that takes its place.
    pub model: Arc<Model>,
}

/// Answer to a [`ReloadRequest`].
#[derive(Message, Debug, Clone)]
pub struct ReloadAnswer {
    /// The mesh.
    pub mesh: Entity,
    /// Report of the exchange, or the reason why the mesh stays as it was.
    pub result: Result<ReloadReport, ReloadError>,
}

/// Report of an exchanged mesh.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ReloadReport {
    /// Numbers of points before and now.
    pub points: [usize; 2],
    /// Largest distance that a point has moved: from its own place where both versions have as many points, else from the
    /// surface of the version before.
    pub moved: f32,
    /// Sources of the transferred weights; `None` for a mesh without weights.
    pub weights: Option<TransferReport>,
}

/// Reason why a mesh was not exchanged.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ReloadError {
    /// The entity has no mesh, or its mesh no rig.
    #[error("the mesh belongs to no rig; it may have been closed")]
    NoRig,
    /// The new version has no points.
    #[error("the new version of the mesh has no points; the one before stays")]
    Empty,
    /// The version waited, and a person discarded it.
    #[error("the new version was discarded while it waited; the next save of the file brings another")]
    Discarded,
    /// The weights cannot be transferred.
    #[error(transparent)]
    Weights(#[from] TransferError),
}

/// Running exchange of a mesh.
#[derive(Component)]
pub struct ReloadJob {
    task: Task<Result<FinishedReload, ReloadError>>,
    /// The version, and the weights that are transferred to it.
    model: Arc<Model>,
    from: Option<Arc<SkinData>>,
    /// Landing in the history; `None` for a mesh of a rig without a document.
    landing: Option<Landing>,
    /// Finished exchange that waits to be committed.
    held: Option<FinishedReload>,
    /// True if a person discards the version that waits.
    is_discarded: bool,
}

impl ReloadJob {
    /// True if the version is ready, and waits to be taken.
    pub fn waits(&self) -> bool {
        self.held.is_some()
    }

    /// Discards a version that waits; the mesh stays as it is.
    pub fn discard(&mut self) {
        self.is_discarded = self.held.is_some();
    }
}

#[derive(Clone)]
struct FinishedReload {
    mesh: RigMesh,
    skin: Option<Arc<SkinData>>,
    report: ReloadReport,
}

/// Versions of a mesh around the steps that exchanged it, and the one that waits for its step.
#[derive(Component, Default)]
pub(super) struct MeshVersions {
    steps: Vec<(Arc<Step>, RigMesh, RigMesh)>,
    next: Option<RigMesh>,
}

/// Exchange that several requests of a frame ask for: those of the instances of a crowd, which share their mesh.
struct SharedReload {
    mesh: RigMesh,
    model: Arc<Model>,
    from: Option<Arc<SkinData>>,
    result: Arc<OnceLock<Result<FinishedReload, ReloadError>>>,
}

impl SharedReload {
    fn is_of(&self, mesh: &RigMesh, model: &Arc<Model>, from: Option<&Arc<SkinData>>) -> bool {
        self.mesh.uid == mesh.uid
            && Arc::ptr_eq(&self.mesh.file, &mesh.file)
            && Arc::ptr_eq(&self.mesh.rest, &mesh.rest)
            && Arc::ptr_eq(&self.mesh.nodes, &mesh.nodes)
            && Arc::ptr_eq(&self.model, model)
            && is_same_skin(self.from.as_ref(), from)
    }
}

fn is_same_skin(a: Option<&Arc<SkinData>>, b: Option<&Arc<SkinData>>) -> bool {
    match (a, b) {
        (Some(a), Some(b)) => Arc::ptr_eq(a, b),
        (a, b) => a.is_none() && b.is_none(),
    }
}

fn start(
    mut commands: Commands,
    mut requests: MessageReader<ReloadRequest>,
    meshes: Query<(&RigMesh, &SkinOf, Option<&InstanceSkin>)>,
    rigs: Query<(&Rig, &RigHistory)>,
    mut answers: MessageWriter<ReloadAnswer>,
) {
    let mut shared: Vec<SharedReload> = Vec::new();
    for ReloadRequest { mesh: entity, model } in requests.read() {
        let Ok((mesh, of, own)) = meshes.get(*entity) else {
            answers.write(ReloadAnswer { mesh: *entity, result: Err(ReloadError::NoRig) });
            continue;
        };
        // An instance has no document, and so no steps that could be undone.
        let (from, landing) = match rigs.get(of.0) {
            // A file that was saved asks for it, not the person who undoes steps.
            Ok((rig, history)) => (rig.skin(mesh.uid).cloned(), Some(Landing::unasked(history))),
            Err(_) => (own.map(|own| own.0.clone()), None),
        };
        let known = shared.iter().find(|known| known.is_of(mesh, model, from.as_ref()));
        let result = known.map(|known| known.result.clone()).unwrap_or_default();
        if known.is_none() {
            let (mesh, model, from) = (mesh.clone(), model.clone(), from.clone());
            shared.push(SharedReload { mesh, model, from, result: result.clone() });
        }
        let (mesh, next, skin) = (mesh.clone(), model.clone(), from.clone());
        let task = AsyncComputeTaskPool::get()
            .spawn(async move { result.get_or_init(|| reloaded(&mesh, &next, skin.as_deref())).clone() });
        let model = model.clone();
        commands.entity(*entity).insert(ReloadJob { task, model, from, landing, held: None, is_discarded: false });
    }
}

fn reloaded(before: &RigMesh, model: &Model, skin: Option<&SkinData>) -> Result<FinishedReload, ReloadError> {
    if model.points.is_empty() {
        return Err(ReloadError::Empty);
    }
    // Nodes of the file are found by their names; those that are not there any more move nothing.
    let by_name = before.file.nodes.iter().enumerate().rev().map(|(place, node)| (node.name.as_str(), place));
    let places: HashMap<&str, usize> = by_name.collect();
    let joint = |name: &str| places.get(name).and_then(|node| before.nodes.get(*node).copied());
    let nodes = model.nodes.iter().map(|node| joint(&node.name).unwrap_or(Uid(0))).collect();
    let mesh = RigMesh::new(before.uid, model.clone(), nodes);
    let (old, new) = (&before.rest.points, &mesh.rest.points);
    let moved = if old.len() == new.len() {
        old.iter().zip(new).map(|(a, b)| a.distance(*b)).fold(0.0, f32::max)
    } else {
        let surface = Surface::build(old, &before.triangles);
        new.iter().filter_map(|point| Some(surface.closest_point(*point)?.distance)).fold(0.0, f32::max)
    };
    let mut report = ReloadReport { points: [old.len(), new.len()], moved, weights: None };
    let skin = match skin {
        None => None,
        Some(skin) => {
            let source = TransferMesh { points: old, triangles: &before.triangles };
            let target = TransferMesh { points: new, triangles: &mesh.triangles };
            let (weights, sources) = transfer_weights(source, &skin.weights, target, &TransferSettings::default())?;
            report.weights = Some(sources);
            Some(Arc::new(SkinData { weights, at_rest: true, ..skin.clone() }))
        }
    };
    Ok(FinishedReload { mesh, skin, report })
}

type LandingMesh = (
    Entity,
    &'static mut ReloadJob,
    &'static RigMesh,
    &'static SkinOf,
    Option<&'static InstanceSkin>,
    Option<&'static mut MeshVersions>,
);

fn land(
    mut commands: Commands,
    mut jobs: Query<LandingMesh>,
    rigs: Query<(&Rig, &RigHistory)>,
    mut answers: MessageWriter<ReloadAnswer>,
) {
    for (entity, mut job, mesh, of, own, versions) in &mut jobs {
        let job = &mut *job;
        let finished = match job.held.take() {
            Some(_) if job.is_discarded => Some(Err(ReloadError::Discarded)),
            Some(held) => Some(Ok(held)),
            None => check_ready(&mut job.task),
        };
        let Some(result) = finished else { continue };
        let document = rigs.get(of.0).ok();
        if let Ok(finished) = &result {
            let now = document.map_or(own.map(|own| &own.0), |(rig, _)| rig.skin(mesh.uid));
            let has_same_weights = || is_same_skin(now, job.from.as_ref());
            let outcome = match (document, &mut job.landing) {
                (Some((_, history)), Some(landing)) => landing.decide(history, has_same_weights),
                _ if has_same_weights() => JobOutcome::Commit,
                _ => JobOutcome::Drop,
            };
            match outcome {
                JobOutcome::Hold { is_news } => {
                    job.held = Some(finished.clone());
                    if is_news {
                        commands.write_message(ResultHeld { mesh: entity, reason: HeldResult::Mesh });
                    }
                    continue;
                }
                // Weights that were computed or painted meanwhile are transferred instead.
                JobOutcome::Drop => {
                    commands.write_message(ReloadRequest { mesh: entity, model: job.model.clone() });
                    continue;
                }
                JobOutcome::Commit => {}
            }
        }
        commands.entity(entity).try_remove::<ReloadJob>();
        let result = result.map(|FinishedReload { mesh, skin, report }| {
            match skin {
                Some(skin) if document.is_none() => {
                    commands.entity(entity).try_insert((mesh, InstanceSkin(skin)));
                }
                Some(skin) => {
                    let edits = vec![RigEdit::SetSkin(mesh.uid, Some(skin))];
                    commands.write_message(EditRequest::operation(of.0, Operation::Named { name: RELOAD, edits }));
                    match versions {
                        Some(mut versions) => versions.next = Some(mesh),
                        None => {
                            commands.entity(entity).try_insert(MeshVersions { next: Some(mesh), ..default() });
                        }
                    }
                }
                // Without weights there is nothing to undo but the file.
                None => {
                    commands.entity(entity).try_insert(mesh);
                }
            }
            report
        });
        answers.write(ReloadAnswer { mesh: entity, result });
    }
}

/// Exchanges meshes together with their weights, in whatever direction the history goes.
fn exchange(
    mut edited: MessageReader<EditReport>,
    mut meshes: Query<(Entity, &RigMesh, &SkinOf, &mut MeshVersions)>,
    mut commands: Commands,
) {
    for EditReport { rig, name, committed, .. } in edited.read() {
        let Some(committed) = committed else { continue };
        for (entity, mesh, _, mut versions) in meshes.iter_mut().filter(|(_, _, of, _)| of.0 == *rig) {
            let step = committed.step();
            let is_own = |edit: &RigEdit| matches!(edit, RigEdit::SetSkin(uid, _) if *uid == mesh.uid);
            if *name == RELOAD && matches!(committed, Commit::Done(_)) && step.forward.iter().any(is_own) {
                let Some(next) = versions.next.take() else { continue };
                versions.steps.push((step.clone(), mesh.clone(), next.clone()));
                commands.entity(entity).try_insert(next);
                continue;
            }
            let Some((_, before, after)) = versions.steps.iter().find(|(known, ..)| Arc::ptr_eq(known, step)) else {
                continue;
            };
            let version = if matches!(committed, Commit::Undone(_)) { before } else { after };
            commands.entity(entity).try_insert(version.clone());
        }
    }
}
