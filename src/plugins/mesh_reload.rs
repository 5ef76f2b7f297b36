//! Another version of a mesh in place of the one that a rig moves: joints stay, weights are transferred.
//!
//! A [`ReloadRequest`] transfers the weights in a task and ends as one step of the history, with the mesh exchanged in the same
//! frame. Undoing the step brings both back, redoing it exchanges both again.

use std::sync::Arc;

use bevy::{
    prelude::*,
    tasks::{AsyncComputeTaskPool, Task, futures::check_ready},
};

use super::{
    RigSystems, configure_sets,
    document::{EditReport, EditRequest},
    history::RigHistory,
    landing::{HeldResult, JobOutcome, Landing, ResultHeld},
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
    landing: Landing,
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

fn start(
    mut commands: Commands,
    mut requests: MessageReader<ReloadRequest>,
    meshes: Query<(&RigMesh, &SkinOf)>,
    rigs: Query<(&Rig, &RigHistory)>,
    mut answers: MessageWriter<ReloadAnswer>,
) {
    for ReloadRequest { mesh: entity, model } in requests.read() {
        let found = meshes.get(*entity).ok().and_then(|(mesh, of)| Some((mesh, rigs.get(of.0).ok()?)));
        let Some((mesh, (rig, history))) = found else {
            answers.write(ReloadAnswer { mesh: *entity, result: Err(ReloadError::NoRig) });
            continue;
        };
        let from = rig.skin(mesh.uid).cloned();
        let (mesh, next, skin) = (mesh.clone(), model.clone(), from.clone());
        let task = AsyncComputeTaskPool::get().spawn(async move { reloaded(&mesh, &next, skin.as_deref()) });
        // A file that was saved asks for it, not the person who undoes steps.
        let (model, landing) = (model.clone(), Landing::unasked(history));
        commands.entity(*entity).insert(ReloadJob { task, model, from, landing, held: None, is_discarded: false });
    }
}

fn reloaded(before: &RigMesh, model: &Model, skin: Option<&SkinData>) -> Result<FinishedReload, ReloadError> {
    if model.points.is_empty() {
        return Err(ReloadError::Empty);
    }
    // Nodes of the file are found by their names; those that are not there any more move nothing.
    let named = |name: &str| before.file.nodes.iter().position(|node| node.name == name);
    let joint = |name: &str| named(name).and_then(|node| before.nodes.get(node).copied());
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

fn land(
    mut commands: Commands,
    mut jobs: Query<(Entity, &mut ReloadJob, &RigMesh, &SkinOf, Option<&mut MeshVersions>)>,
    rigs: Query<(&Rig, &RigHistory)>,
    mut answers: MessageWriter<ReloadAnswer>,
) {
    for (entity, mut job, mesh, of, versions) in &mut jobs {
        let job = &mut *job;
        let finished = match job.held.take() {
            Some(_) if job.is_discarded => Some(Err(ReloadError::Discarded)),
            Some(held) => Some(Ok(held)),
            None => check_ready(&mut job.task),
        };
        let Some(result) = finished else { continue };
        if let (Ok(finished), Ok((rig, history))) = (&result, rigs.get(of.0)) {
            let has_same_weights = || match (rig.skin(mesh.uid), &job.from) {
                (Some(now), Some(then)) => Arc::ptr_eq(now, then),
                (now, then) => now.is_none() && then.is_none(),
            };
            match job.landing.decide(history, has_same_weights) {
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
