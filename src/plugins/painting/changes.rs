//! Changes of all weights of a mesh: worked out in a task, committed as one step.

use std::{collections::BTreeSet, sync::Arc};

use bevy::{
    prelude::*,
    tasks::{AsyncComputeTaskPool, Task, futures::check_ready},
};

use super::paintable_joints::locks;
use crate::{
    algo::{
        paint::{PruneError, PruneSettings, keep_locked, normalised, pruned},
        transfer::{TransferError, TransferMesh, TransferSettings, transfer_weights},
    },
    mesh::model::Model,
    plugins::{
        document::EditRequest,
        history::RigHistory,
        landing::{HeldResult, JobOutcome, Landing, ResultHeld},
        surface::{RigMesh, SkinOf},
    },
    rig::{Rig, RigEdit, SkinData, Uid, deform::replaced_joints, joint_numbers, operations::Operation, weight_edit},
};

/// Request to change the weights of a mesh.
#[derive(Message, Debug, Clone, Copy, PartialEq)]
pub struct WeightChangeRequest {
    /// The entity with the [`RigMesh`].
    pub mesh: Entity,
    /// Change of its weights.
    pub change: WeightChange,
}

/// Change of all weights of a mesh. Influences of locked joints stay.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum WeightChange {
    /// Scales influences so that those of each point sum to one.
    Normalise,
    /// Takes weak influences away, and those beyond a number.
    Prune(PruneSettings),
    /// Takes the weights of another mesh of the same rig, where that is near.
    CopyFrom(Entity),
}

impl WeightChange {
    /// Name of the step.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Normalise => "Normalise weights",
            Self::Prune(_) => "Prune weights",
            Self::CopyFrom(_) => "Copy weights",
        }
    }
}

/// Answer to a [`WeightChangeRequest`].
#[derive(Message, Debug, Clone, PartialEq)]
pub struct WeightChangeAnswer {
    /// The mesh.
    pub mesh: Entity,
    /// The change.
    pub change: WeightChange,
    /// Number of points whose influences changed, or the reason why the weights stay as they were.
    pub result: Result<usize, WeightChangeError>,
}

/// Reason why the weights of a mesh were not changed; a sentence without its full stop.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum WeightChangeError {
    /// The entity has no mesh, or its mesh no rig.
    #[error("the mesh belongs to no rig; it may have been closed")]
    NoRig,
    /// The mesh has no weights.
    #[error("the mesh has no weights; skin it first (B)")]
    NoWeights,
    /// The mesh to copy from has no weights.
    #[error("the mesh to copy from has no weights; skin it first, or choose another")]
    NoSource,
    /// A mesh is to be copied to itself, or from another rig.
    #[error("weights are copied from another mesh of the same rig; choose one")]
    OtherRig,
    /// The weights, their locks or the mesh were changed during the computation.
    #[error(
        "the weights, their locks or the mesh were changed meanwhile; the weights stay as they are now: do it again"
    )]
    Changed,
    /// The finished change waited, and a person discarded it.
    #[error("the change was discarded while it waited; the weights stay as they are")]
    Discarded,
    /// A person stopped the change.
    #[error("the change was stopped; the weights stay as they are")]
    Stopped,
    /// Another change of the same mesh is being worked out.
    #[error("the weights of the mesh are being changed already; wait for it")]
    Running,
    /// Settings of pruning that make no sense.
    #[error(transparent)]
    Prune(#[from] PruneError),
    /// The weights cannot be transferred.
    #[error(transparent)]
    Transfer(#[from] TransferError),
}

/// Running change of the weights of a mesh.
#[derive(Component)]
pub struct WeightChangeJob {
    change: WeightChange,
    task: Task<ChangedSkin>,
    /// Weights that the change started from.
    from: Option<Arc<SkinData>>,
    /// Mesh and locked joints that it started from.
    rest: Arc<Model>,
    locked: BTreeSet<Uid>,
    landing: Landing,
    /// Finished change that waits to be committed.
    held: Option<ChangedSkin>,
}

impl WeightChangeJob {
    /// True if the change is finished, and waits to be committed.
    pub fn waits(&self) -> bool {
        self.held.is_some()
    }

    /// Stops the change; the weights stay as they are.
    pub fn stop(&mut self) {
        self.held = Some(Err(WeightChangeError::Stopped));
    }

    /// Discards a change that waits; the weights stay as they are.
    pub fn discard(&mut self) {
        if self.held.is_some() {
            self.held = Some(Err(WeightChangeError::Discarded));
        }
    }
}

/// Changed weights: the edit and the number of points that it changes, or nothing to do.
type ChangedSkin = Result<Option<(RigEdit, usize)>, WeightChangeError>;

pub(super) fn start(
    mut commands: Commands,
    mut requests: MessageReader<WeightChangeRequest>,
    meshes: Query<(&RigMesh, &SkinOf, Has<WeightChangeJob>)>,
    rigs: Query<(&Rig, &RigHistory)>,
    mut answers: MessageWriter<WeightChangeAnswer>,
) {
    let mut begun: Vec<Entity> = Vec::new();
    for WeightChangeRequest { mesh: entity, change } in requests.read() {
        let mut answer = |error| {
            answers.write(WeightChangeAnswer { mesh: *entity, change: *change, result: Err(error) });
        };
        let found = meshes.get(*entity).ok().and_then(|(mesh, of, busy)| Some((mesh, of, busy, rigs.get(of.0).ok()?)));
        let Some((mesh, of, is_busy, (rig, history))) = found else {
            answer(WeightChangeError::NoRig);
            continue;
        };
        if is_busy || begun.contains(entity) {
            answer(WeightChangeError::Running);
            continue;
        }
        let from = rig.skin(mesh.uid).cloned();
        let (rest, locked) = (mesh.rest.clone(), locked_joints(rig));
        let task = match change {
            WeightChange::CopyFrom(source) => {
                let other = meshes.get(*source).ok().filter(|(_, other, _)| other.0 == of.0 && source != entity);
                let Some((other, ..)) = other else {
                    answer(WeightChangeError::OtherRig);
                    continue;
                };
                let Some(skin) = rig.skin(other.uid).cloned() else {
                    answer(WeightChangeError::NoSource);
                    continue;
                };
                let (mesh, other, from, rig) = (mesh.clone(), other.clone(), from.clone(), rig.clone());
                AsyncComputeTaskPool::get()
                    .spawn(async move { copied(&rig, (&mesh, from.as_deref()), (&other, &skin)) })
            }
            WeightChange::Normalise | WeightChange::Prune(_) => {
                let Some(skin) = from.clone() else {
                    answer(WeightChangeError::NoWeights);
                    continue;
                };
                let (uid, locked, change) = (mesh.uid, locks(rig, listed(&skin)), *change);
                AsyncComputeTaskPool::get().spawn(async move { tidied(uid, &skin, &locked, change) })
            }
        };
        begun.push(*entity);
        let landing = Landing::asked(history);
        let job = WeightChangeJob { change: *change, task, from, rest, locked, landing, held: None };
        commands.entity(*entity).try_insert(job);
    }
}

/// Joints whose weights are locked.
fn locked_joints(rig: &Rig) -> BTreeSet<Uid> {
    rig.walk().filter(|joint| joint.data.locked).map(|joint| joint.data.uid).collect()
}

/// Joints of weights with the nodes that commands made them for.
fn listed(skin: &SkinData) -> impl Iterator<Item = (Uid, Option<Uid>)> {
    skin.joints.iter().map(|joint| (*joint, skin.subjects.get(joint).copied()))
}

fn tidied(mesh: Uid, skin: &SkinData, locked: &[bool], change: WeightChange) -> ChangedSkin {
    let weights = match change {
        WeightChange::Prune(settings) => pruned(&skin.weights, locked, &settings)?,
        _ => normalised(&skin.weights, locked),
    };
    Ok(edit(mesh, Some(skin), SkinData { weights, ..skin.clone() }))
}

/// Weights of a mesh taken from another one.
fn copied(
    rig: &Rig,
    (mesh, before): (&RigMesh, Option<&SkinData>),
    (other, skin): (&RigMesh, &SkinData),
) -> ChangedSkin {
    let source = TransferMesh { points: &other.rest.points, triangles: &other.triangles };
    let target = TransferMesh { points: &mesh.rest.points, triangles: &mesh.triangles };
    let (weights, _) = transfer_weights(source, &skin.weights, target, &TransferSettings::default())?;
    let Some(before) = before else {
        return Ok(edit(mesh.uid, None, SkinData { weights, at_rest: true, ..skin.clone() }));
    };
    // The list of joints only grows, so that locked joints keep their places.
    let joints: Vec<(Uid, Option<Uid>)> = listed(skin).collect();
    let (numbers, added) = joint_numbers(before, &joints);
    let places: Vec<Option<usize>> = numbers.iter().map(|number| Some(*number as usize)).collect();
    let weights = replaced_joints(&weights, &places);
    let mut after = SkinData { at_rest: true, ..before.clone() };
    after.joints.extend(added.iter().map(|(joint, _)| *joint));
    after.subjects.extend(added.iter().filter_map(|(joint, subject)| Some((*joint, (*subject)?))));
    let locked = locks(rig, listed(&after));
    after.weights = keep_locked(&before.weights, &weights, &locked);
    Ok(edit(mesh.uid, Some(before), after))
}

fn edit(mesh: Uid, before: Option<&SkinData>, after: SkinData) -> Option<(RigEdit, usize)> {
    let count = match before {
        None => after.weights.len(),
        Some(before) => {
            let is_other = |point: &usize| {
                *point >= before.weights.len() || !before.weights.of(*point).eq(after.weights.of(*point))
            };
            (0..after.weights.len()).filter(is_other).count()
        }
    };
    let edit = match before {
        None => Some(RigEdit::SetSkin(mesh, Some(Arc::new(after)))),
        Some(before) => weight_edit(mesh, before, after),
    };
    edit.map(|edit| (edit, count))
}

pub(super) fn land(
    mut commands: Commands,
    mut jobs: Query<(Entity, &mut WeightChangeJob, &RigMesh, &SkinOf)>,
    rigs: Query<(&Rig, &RigHistory)>,
    mut answers: MessageWriter<WeightChangeAnswer>,
) {
    for (entity, mut job, mesh, of) in &mut jobs {
        let job = &mut *job;
        let finished = if job.held.is_some() { job.held.take() } else { check_ready(&mut job.task) };
        let Some(changed) = finished else { continue };
        let is_same = |rig: &Rig| {
            let has_same_weights = match (rig.skin(mesh.uid), &job.from) {
                (Some(now), Some(then)) => Arc::ptr_eq(now, then),
                (now, then) => now.is_none() && then.is_none(),
            };
            has_same_weights && Arc::ptr_eq(&mesh.rest, &job.rest) && locked_joints(rig) == job.locked
        };
        let result = match (changed, rigs.get(of.0)) {
            (_, Err(_)) => Err(WeightChangeError::NoRig),
            (Err(error), _) => Err(error),
            (Ok(None), _) => Ok(0),
            (Ok(Some((edit, count))), Ok((rig, history))) => match job.landing.decide(history, || is_same(rig)) {
                JobOutcome::Hold { is_news } => {
                    job.held = Some(Ok(Some((edit, count))));
                    if is_news {
                        commands.write_message(ResultHeld { mesh: entity, reason: HeldResult::Weights });
                    }
                    continue;
                }
                JobOutcome::Drop => Err(WeightChangeError::Changed),
                JobOutcome::Commit => {
                    let operation = Operation::Named { name: job.change.name(), edits: vec![edit] };
                    commands.write_message(EditRequest::operation(of.0, operation));
                    Ok(count)
                }
            },
        };
        answers.write(WeightChangeAnswer { mesh: entity, change: job.change, result });
        commands.entity(entity).try_remove::<WeightChangeJob>();
    }
}
