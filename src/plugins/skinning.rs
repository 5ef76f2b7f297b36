//! Automatic weights, computed in the background and bound as one undoable edit.

mod bends;
mod body;
mod carriers;
mod late_joints;
mod parts;
mod report;

use std::{collections::BTreeMap, ops::Range, sync::Arc};

use bevy::{
    prelude::*,
    tasks::{AsyncComputeTaskPool, Task, futures::check_ready},
};

pub use self::{
    bends::FittedPush,
    body::{BodyBasis, InstanceBody, InstanceSkin},
    parts::{MeshPart, MeshParts},
    report::{IdleJoint, RigidPart, SkinningReport},
};
use self::{
    bends::{TriedBend, push_edits, tried_bends},
    carriers::{joints_at_nodes, named_slots},
    parts::{object_points, runs_by_value},
};
use super::{
    RigSystems,
    commands::{BuildResult, RigModules},
    configure_sets,
    document::EditRequest,
    history::RigHistory,
    job_control::JobControl,
    landing::{BindStart, HeldResult, JobOutcome, Landing, ResultHeld},
    limits::{Deadline, LimitError, OutOfTime, RigLimits},
    surface::{RigMesh, SkinOf},
};
use crate::{
    algo::weights::{Locks, TwistBone, WeightError, WeightJoint, WeightSettings, skin_weights},
    mesh::model::Weights,
    processor::Modules,
    rig::{
        BuiltRig, Rig, RigEdit, SkinData, Uid,
        deform::{DeformSkeleton, replaced_joints},
        operations::Operation,
    },
};

/// Plugin of automatic skinning.
pub struct SkinningPlugin;

impl Plugin for SkinningPlugin {
    fn build(&self, app: &mut App) {
        configure_sets(app);
        app.init_resource::<RigLimits>()
            .add_message::<BindRequest>()
            .add_message::<BindAnswer>()
            .add_message::<ResultHeld>()
            .add_systems(
                Update,
                (start_skinning, late_joints::start_late_shares, land_skinning).chain().in_set(RigSystems::Bind),
            );
    }
}

/// Request to compute weights for a mesh of a rig.
#[derive(Message, Debug, Clone)]
pub struct BindRequest {
    /// The entity with the [`RigMesh`].
    pub mesh: Entity,
    /// Settings of the computation.
    pub settings: WeightSettings,
    /// Parts of the mesh that a person decided about, and how each is bound. A piece of an object is bound as is chosen for
    /// the piece; otherwise later choices count.
    pub parts: Vec<(MeshPart, PartBinding)>,
    /// Joints that claim skin although they hang outside of the mesh or do not deform.
    pub claims: Vec<Uid>,
}

impl BindRequest {
    /// A request that leaves everything to the computation.
    pub fn new(mesh: Entity) -> Self {
        Self { mesh, settings: WeightSettings::default(), parts: Vec::new(), claims: Vec::new() }
    }
}

/// Binding of one part of a mesh, in place of what the computation would choose for it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PartBinding {
    /// The part moves with one joint only.
    Rigid(Uid),
    /// The part bends, also if one joint holds all of it or it hangs on a joint in its file.
    Bends,
}

/// The answer to a [`BindRequest`].
#[derive(Message, Debug, Clone)]
pub struct BindAnswer {
    /// The mesh.
    pub mesh: Entity,
    /// Report of the computation, or the reason why it failed.
    pub result: Result<SkinningReport, SkinningError>,
}

/// Reason why a mesh was not bound; a sentence for people without its full stop.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum SkinningError {
    /// The entity of the request has no mesh, or its mesh no rig.
    #[error("the mesh belongs to no rig; it may have been closed")]
    NoRig,
    /// The rig was closed during the computation.
    #[error("the rig was closed meanwhile")]
    Closed,
    /// The joints, or the weights of the mesh, were changed during the computation.
    #[error(
        "the joints or weights were changed while others were computed; the computed weights were dropped: skin the mesh \
         again"
    )]
    Changed,
    /// The computation failed or was cancelled.
    #[error(transparent)]
    Weights(#[from] WeightError),
    /// The mesh has more points or triangles than [`RigLimits`] allows.
    #[error(transparent)]
    Limit(#[from] LimitError),
    /// The computation took longer than [`RigLimits`] allows.
    #[error(transparent)]
    OutOfTime(#[from] OutOfTime),
}

/// Running computation of weights; remove the component or call [`SkinningJob::cancel`] to stop it.
#[derive(Component)]
pub struct SkinningJob {
    control: JobControl,
    task: Task<SkinningResult>,
    /// State of the document that the weights are computed for.
    start: BindStart,
    landing: Landing,
    /// Finished weights that wait to be committed; see [`landing`](super::landing).
    held: Option<SkinningResult>,
    /// True if a [`BindRequest`] asked for it, which [`BindAnswer`] answers.
    is_asked: bool,
    deadline: Deadline,
}

type SkinningResult = Result<BoundSkin, WeightError>;

/// Weights of a mesh, and what binding it showed.
#[derive(Debug, Clone)]
pub struct BoundSkin {
    /// Weights over the joints of the rig.
    pub skin: Arc<SkinData>,
    /// Report of the computation.
    pub report: SkinningReport,
    /// Lengths by which half joints leave a bend to keep the volume of the mesh.
    pub pushes: Vec<FittedPush>,
}

impl SkinningJob {
    /// Finished share, 0 to 1.
    pub fn progress(&self) -> f32 {
        self.control.progress()
    }

    /// True if the weights are finished, and wait to be committed.
    pub fn waits(&self) -> bool {
        self.held.is_some()
    }

    /// True if a [`BindRequest`] asked for the weights; shares of late joints are computed unasked.
    pub fn is_asked(&self) -> bool {
        self.is_asked
    }

    /// Stops the computation, or drops weights that wait; the rig stays as it was.
    pub fn cancel(&self) {
        self.control.cancel();
    }
}

/// Input of a computation of weights: the joints of a [`DeformSkeleton`], in its order.
pub struct SkinningInput {
    /// Joints of the skeleton.
    pub joints: Vec<WeightJoint>,
    /// Uids of `joints`.
    pub uids: Vec<Uid>,
    /// Node that each created joint was made for.
    pub subjects: BTreeMap<Uid, Uid>,
    /// Locks of `joints`: locked joints keep their weights.
    pub locked: Vec<bool>,
    /// Present weights of the mesh, over the same joints.
    pub existing: Option<Weights>,
    /// Ranges of points that move with one joint only, each with the joint's index.
    pub rigid: Vec<(Range<u32>, u32)>,
    /// Ranges of points of objects that bend in any case.
    pub bending: Vec<Range<u32>>,
    /// Indices of joints that claim skin although they would be idle.
    pub claims: Vec<usize>,
    /// Indices of joints that carry or steer things, by their labels: sockets, props, targets, poles, controls.
    pub slots: Vec<usize>,
    /// Parts of `rigid` with their number of points and the joint's index.
    given: Vec<(MeshPart, usize, usize)>,
    /// Parts of `bending`.
    bending_parts: Vec<MeshPart>,
    bends: Vec<TriedBend>,
}

impl SkinningInput {
    /// Collects the input for a mesh from a rig and its build. Objects that hang on a joint in their file are rigid,
    /// too, as are those of a mesh without its skeleton that hang on a node which the rig has a joint for; joints that commands created are locked with the node that they were made for.
    ///
    /// `modules` tells which commands take lengths that follow from the mesh; without it none does.
    pub fn new(
        rig: &Rig,
        built: Option<&BuiltRig>,
        modules: Option<&Modules>,
        mesh: &RigMesh,
        parts: &[(MeshPart, PartBinding)],
    ) -> Self {
        let skeleton = DeformSkeleton::new(rig, built);
        let joints = skeleton.joints().iter().map(|joint| WeightJoint {
            head: joint.rest.translation,
            parent: joint.parent,
            tail: None,
            deforms: joint.deforms,
            twist: joint.twist.map(|twist| TwistBone { joint: twist.joint, end: twist.end }),
            halves: joint.halves,
        });
        let joints = joints.collect();
        let uids = skeleton.joints().iter().map(|joint| joint.uid).collect();
        let is_locked = |uid: Uid| rig.joint(uid).is_some_and(|joint| joint.data.locked);
        let locked = skeleton.joints().iter().map(|joint| is_locked(joint.subject.unwrap_or(joint.uid))).collect();
        let existing = rig.skin(mesh.uid).map(|skin| replaced_joints(&skin.weights, &skeleton.holders(rig, skin)));
        let subjects = skeleton.subjects();
        let bends = built.map_or_else(Vec::new, |built| tried_bends(rig, built, &skeleton, modules));
        let mut input = Self {
            joints,
            uids,
            subjects,
            locked,
            existing,
            rigid: Vec::new(),
            bending: Vec::new(),
            claims: Vec::new(),
            slots: named_slots(rig, &skeleton),
            given: Vec::new(),
            bending_parts: Vec::new(),
            bends,
        };
        input.choose(mesh, &skeleton, &bindings(rig, mesh, parts));
        input
    }

    /// Lets joints claim skin although they would be idle; joints that are not in the skeleton are left out.
    pub fn claim(&mut self, joints: &[Uid]) {
        let index = |joint: &Uid| self.uids.iter().position(|uid| uid == joint);
        self.claims.extend(joints.iter().filter_map(index));
    }

    /// Takes the bindings of parts; of several for a point the last one counts.
    fn choose(&mut self, mesh: &RigMesh, skeleton: &DeformSkeleton, bindings: &[(MeshPart, PartBinding)]) {
        if bindings.is_empty() {
            return;
        }
        let is_piece = |(part, _): &(MeshPart, PartBinding)| matches!(part, MeshPart::Piece(_));
        let pieces = bindings.iter().any(is_piece).then(|| MeshParts::new(mesh));
        let mut binding_of = vec![u32::MAX; mesh.rest.points.len()];
        for (number, (part, _)) in bindings.iter().enumerate() {
            let runs = match (part, &pieces) {
                (MeshPart::Object(object), _) => object_points(mesh, *object),
                (part, pieces) => pieces.as_ref().map_or_else(Vec::new, |pieces| pieces.points(mesh, *part)),
            };
            runs.into_iter().for_each(|run| binding_of[run.start as usize..run.end as usize].fill(number as u32));
        }
        let mut runs_of = runs_by_value(&binding_of, bindings.len());
        for (number, (part, binding)) in bindings.iter().enumerate() {
            let runs = std::mem::take(&mut runs_of[number]);
            match binding {
                _ if runs.is_empty() => {}
                PartBinding::Bends => {
                    self.bending_parts.push(*part);
                    self.bending.extend(runs);
                }
                PartBinding::Rigid(joint) => {
                    let Some(joint) = skeleton.index(*joint) else { continue };
                    self.given.push((*part, runs.iter().map(Range::len).sum(), joint));
                    self.rigid.extend(runs.into_iter().map(|run| (run, joint as u32)));
                }
            }
        }
    }

    /// Computes the weights of a mesh.
    pub fn compute(
        &self,
        mesh: &RigMesh,
        settings: &WeightSettings,
        progress: &(dyn Fn(f32) -> bool + Sync),
    ) -> Result<BoundSkin, WeightError> {
        let any_locked = self.locked.iter().any(|locked| *locked);
        let locks = self.existing.as_ref().filter(|_| any_locked);
        let locks = locks.map(|weights| Locks { weights, joints: &self.locked });
        let claims = settings.claims.iter().chain(&self.claims).copied().collect();
        let slots = settings.slots.iter().chain(&self.slots).copied().collect();
        let settings = &WeightSettings { bending: self.bending.clone(), claims, slots, ..settings.clone() };
        let (weights, report) =
            skin_weights(&mesh.rest.points, &mesh.triangles, &self.joints, &self.rigid, locks, settings, progress)?;
        let (weights, pushes) = self.try_bends(mesh, weights, settings, &|_| false, &|_| true);
        let (joints, subjects) = (self.uids.clone(), self.subjects.clone());
        let skin = Arc::new(SkinData { joints, weights, at_rest: true, subjects });
        Ok(BoundSkin { skin, report: self.report(mesh, report), pushes })
    }
}

/// Bindings of parts in the order in which they count: objects that hang on a joint in their file, unless a person decided
/// about them, objects that a person decided about, and pieces.
fn bindings(rig: &Rig, mesh: &RigMesh, parts: &[(MeshPart, PartBinding)]) -> Vec<(MeshPart, PartBinding)> {
    let alike = if mesh.nodes.is_empty() { joints_at_nodes(rig, &mesh.file) } else { BTreeMap::new() };
    let carried = mesh.rest.objects.iter().enumerate().filter_map(|(object, data)| {
        let node = data.node?;
        let joint = mesh.nodes.get(node).or_else(|| alike.get(&node))?;
        Some((MeshPart::Object(object), PartBinding::Rigid(*joint)))
    });
    let carried = carried.filter(|(object, _)| parts.iter().all(|(other, _)| other != object));
    let is_object = |part: &MeshPart| matches!(part, MeshPart::Object(_));
    let objects = parts.iter().filter(|(part, _)| is_object(part));
    let pieces = parts.iter().filter(|(part, _)| !is_object(part));
    carried.chain(objects.chain(pieces).copied()).collect()
}

/// Joint that holds all points of an object, for each object of a mesh: the head for a helmet, the hand for a sword. `None`
/// for an object that several joints hold.
pub fn held_objects(mesh: &RigMesh, skin: &SkinData) -> Vec<Option<Uid>> {
    let holder = |object: usize| {
        let mut holder = None;
        for point in object_points(mesh, object).into_iter().flatten() {
            let point = point as usize;
            let mut influences = (point < skin.weights.len()).then(|| skin.weights.of(point))?;
            let (joint, _) = influences.next().filter(|_| influences.len() == 0)?;
            if *holder.get_or_insert(joint) != joint {
                return None;
            }
        }
        skin.joints.get(holder? as usize).copied()
    };
    (0..mesh.rest.objects.len()).map(holder).collect()
}

fn start_skinning(
    mut commands: Commands,
    mut requests: MessageReader<BindRequest>,
    meshes: Query<(&RigMesh, &SkinOf)>,
    rigs: Query<(&Rig, &RigHistory, Option<&BuildResult>)>,
    (modules, limits): (Option<Res<RigModules>>, Res<RigLimits>),
    mut bound: MessageWriter<BindAnswer>,
) {
    for request in requests.read() {
        let found = meshes.get(request.mesh).ok().and_then(|(mesh, of)| Some((mesh, rigs.get(of.0).ok()?)));
        let Some((mesh, (rig, history, built))) = found else {
            bound.write(BindAnswer { mesh: request.mesh, result: Err(SkinningError::NoRig) });
            continue;
        };
        if let Err(error) = limits.check_open(mesh) {
            bound.write(BindAnswer { mesh: request.mesh, result: Err(error.into()) });
            continue;
        }
        let (start, landing) = (BindStart::of(rig, mesh.uid), Landing::asked(history));
        let (rig, mesh, request) = (rig.clone(), mesh.clone(), request.clone());
        let built = built.map(|built| built.0.clone());
        let modules = modules.as_deref().map(|modules| modules.0.clone());
        let entity = request.mesh;
        let control = JobControl::default();
        let reporter = control.reporter();
        let task = AsyncComputeTaskPool::get().spawn(async move {
            let mut input = SkinningInput::new(&rig, built.as_deref(), modules.as_deref(), &mesh, &request.parts);
            input.claim(&request.claims);
            input.compute(&mesh, &request.settings, &|part| reporter.report(part))
        });
        let deadline = limits.deadline();
        commands.entity(entity).insert(SkinningJob {
            control,
            task,
            start,
            landing,
            held: None,
            is_asked: true,
            deadline,
        });
    }
}

fn land_skinning(
    mut commands: Commands,
    mut jobs: Query<(Entity, &mut SkinningJob, &RigMesh, &SkinOf)>,
    rigs: Query<(&Rig, &RigHistory, Option<&BuildResult>)>,
    (modules, limits): (Option<Res<RigModules>>, Res<RigLimits>),
    mut edits: MessageWriter<EditRequest>,
    mut bound: MessageWriter<BindAnswer>,
    mut held: MessageWriter<ResultHeld>,
) {
    for (entity, mut job, mesh, of) in &mut jobs {
        let job = &mut *job;
        let was_held = job.held.is_some();
        let late = job.deadline.check("binding the mesh").err().filter(|_| !was_held);
        let finished = match late {
            Some(late) => Some(Err(late.into())),
            None if was_held && job.control.is_cancelled() => Some(Err(WeightError::Cancelled.into())),
            None if was_held => job.held.take().map(|held| held.map_err(SkinningError::from)),
            // A computation that ends before it notices the wish to stop has no result either.
            None => check_ready(&mut job.task).map(|result| {
                let result = result.map_err(SkinningError::from);
                if job.control.is_cancelled() { result.and(Err(WeightError::Cancelled.into())) } else { result }
            }),
        };
        let Some(result) = finished else { continue };
        let result = match (result, rigs.get(of.0)) {
            (Err(error), _) => Err(error),
            (Ok(_), Err(_)) => Err(SkinningError::Closed),
            (Ok(computed), Ok((rig, history, built))) => {
                match job.landing.decide(history, || job.start.holds(rig, mesh.uid)) {
                    JobOutcome::Hold { is_news } => {
                        job.held = Some(Ok(computed));
                        if is_news && job.is_asked {
                            held.write(ResultHeld { mesh: entity, reason: HeldResult::Weights });
                        }
                        continue;
                    }
                    JobOutcome::Drop => {
                        // Nobody asked for shares of late joints, so nobody would ask again.
                        let again = built.filter(|_| !job.is_asked);
                        let again = again.and_then(|built| {
                            late_joints::late_job((rig, history, built), mesh, modules.as_deref(), &limits)
                        });
                        if let Some(again) = again {
                            *job = again;
                            continue;
                        }
                        Err(SkinningError::Changed)
                    }
                    JobOutcome::Commit => {
                        let mut changes = Vec::new();
                        if let Some(modules) = &modules {
                            changes = push_edits(rig, &modules.0, mesh.uid, &computed);
                        }
                        changes.push(RigEdit::SetSkin(mesh.uid, Some(computed.skin)));
                        edits.write(EditRequest::operation(of.0, Operation::Edits(changes)));
                        Ok(computed.report)
                    }
                }
            }
        };
        if job.is_asked {
            bound.write(BindAnswer { mesh: entity, result });
        }
        commands.entity(entity).remove::<SkinningJob>();
    }
}
