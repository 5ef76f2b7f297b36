//! Automatic weights, computed in the background and bound as one undoable edit.

use std::{
    ops::Range,
    sync::{
        Arc,
        atomic::{AtomicBool, AtomicU32, Ordering},
    },
};

use bevy::{
    prelude::*,
    tasks::{AsyncComputeTaskPool, Task, futures::check_ready},
};

use super::{
    RigSystems, configure_sets,
    document::EditRequest,
    surface::{RigMesh, SkinOf},
};
use crate::{
    algo::weights::{Locks, WeightError, WeightJoint, WeightReport, WeightSettings, skin_weights},
    mesh::model::Weights,
    rig::{NodeKind, Rig, RigEdit, SkinData, Uid, operations::Operation},
};

/// Adds automatic skinning.
pub struct SkinningPlugin;

impl Plugin for SkinningPlugin {
    fn build(&self, app: &mut App) {
        configure_sets(app);
        app.add_message::<BindRequest>()
            .add_message::<Bound>()
            .add_systems(Update, (start_skinning, land_skinning).chain().in_set(RigSystems::Bind));
    }
}

/// Asks to compute weights for a mesh of a rig.
#[derive(Message, Debug, Clone)]
pub struct BindRequest {
    /// The entity with the [`RigMesh`].
    pub mesh: Entity,
    /// How.
    pub settings: WeightSettings,
    /// Objects that move with one joint only: the object's number in the model, and the joint.
    pub rigid: Vec<(usize, Uid)>,
}

/// The answer to a [`BindRequest`].
#[derive(Message, Debug, Clone)]
pub struct Bound {
    /// The mesh.
    pub mesh: Entity,
    /// How its points got their weights, or why they did not.
    pub result: Result<WeightReport, String>,
}

/// Skinning under way; remove the component or call [`SkinningJob::cancel`] to stop it.
#[derive(Component)]
pub struct SkinningJob {
    progress: Arc<AtomicU32>,
    cancelled: Arc<AtomicBool>,
    task: Task<Result<(Arc<SkinData>, WeightReport), WeightError>>,
}

impl SkinningJob {
    /// How much is done, 0 to 1.
    pub fn progress(&self) -> f32 {
        f32::from_bits(self.progress.load(Ordering::Relaxed))
    }

    /// Stops it; the rig stays as it was.
    pub fn cancel(&self) {
        self.cancelled.store(true, Ordering::Relaxed);
    }
}

impl Drop for SkinningJob {
    fn drop(&mut self) {
        self.cancel();
    }
}

/// What weights are computed from: the joints of a rig in the order of [`Rig::walk`].
pub struct SkinningInput {
    /// The joints.
    pub joints: Vec<WeightJoint>,
    /// Their uids.
    pub uids: Vec<Uid>,
    /// Which of them are locked.
    pub locked: Vec<bool>,
    /// The weights there are, over the same joints.
    pub existing: Option<Weights>,
    /// Points that move with one joint only.
    pub rigid: Vec<(Range<u32>, u32)>,
}

impl SkinningInput {
    /// Gathers what a rig says about a mesh. Objects that hang on a joint in their file are rigid, too.
    pub fn new(rig: &Rig, mesh: &RigMesh, rigid: &[(usize, Uid)]) -> Self {
        let globals = rig.rest_globals();
        let uids: Vec<Uid> = globals.iter().map(|(uid, _)| *uid).collect();
        let number = |uid: Uid| uids.iter().position(|other| *other == uid);
        let numbers: std::collections::HashMap<Uid, usize> =
            uids.iter().enumerate().map(|(number, uid)| (*uid, number)).collect();
        let joints = rig.walk().zip(&globals).map(|(joint, (_, global))| WeightJoint {
            head: global.translation,
            parent: joint.parent.and_then(|parent| numbers.get(&parent).copied()),
            tail: None,
            deforms: joint.data.kind == NodeKind::Joint,
        });
        let joints = joints.collect();
        let locked = rig.walk().map(|joint| joint.data.locked).collect();
        let carried = mesh.rest.objects.iter().enumerate().filter_map(|(object, data)| {
            let joint = mesh.nodes.get(data.node?)?;
            Some((object, *joint))
        });
        let chosen: Vec<(usize, Uid)> = rigid.to_vec();
        let carried: Vec<(usize, Uid)> =
            carried.filter(|(object, _)| chosen.iter().all(|(other, _)| other != object)).collect();
        let mut ranges = Vec::new();
        for (object, joint) in chosen.into_iter().chain(carried) {
            let Some(joint) = number(joint) else { continue };
            let points = mesh.rest.parts.iter().filter(|part| part.object == object).flat_map(|part| &part.vertices);
            let mut points: Vec<u32> = points.copied().collect();
            points.sort_unstable();
            points.dedup();
            for run in points.chunk_by(|a, b| a + 1 == *b) {
                ranges.push((run[0]..run[run.len() - 1] + 1, joint as u32));
            }
        }
        let existing = rig.skin(mesh.uid).map(|skin| {
            let node_of: Vec<Option<usize>> = skin.joints.iter().map(|uid| numbers.get(uid).copied()).collect();
            let mut weights = Weights::default();
            for point in 0..skin.weights.len() {
                let influences = skin.weights.of(point);
                weights.push(influences.filter_map(|(joint, w)| Some((node_of[joint as usize]? as u32, w))));
            }
            weights
        });
        Self { joints, uids, locked, existing, rigid: ranges }
    }

    /// Computes the weights of a mesh.
    pub fn compute(
        &self,
        mesh: &RigMesh,
        settings: &WeightSettings,
        progress: &(dyn Fn(f32) -> bool + Sync),
    ) -> Result<(Arc<SkinData>, WeightReport), WeightError> {
        let any_locked = self.locked.iter().any(|locked| *locked);
        let locks = self.existing.as_ref().filter(|_| any_locked);
        let locks = locks.map(|weights| Locks { weights, joints: &self.locked });
        let (weights, report) =
            skin_weights(&mesh.rest.points, &mesh.triangles, &self.joints, &self.rigid, locks, settings, progress)?;
        Ok((Arc::new(SkinData { joints: self.uids.clone(), weights, at_rest: true }), report))
    }
}

fn start_skinning(
    mut commands: Commands,
    mut requests: MessageReader<BindRequest>,
    meshes: Query<(&RigMesh, &SkinOf)>,
    rigs: Query<&Rig>,
    mut bound: MessageWriter<Bound>,
) {
    for request in requests.read() {
        let found = meshes.get(request.mesh).ok().and_then(|(mesh, of)| Some((mesh, rigs.get(of.0).ok()?)));
        let Some((mesh, rig)) = found else {
            let result = Err("the mesh belongs to no rig; it may have been closed".to_owned());
            bound.write(Bound { mesh: request.mesh, result });
            continue;
        };
        let (rig, mesh, request) = (rig.clone(), mesh.clone(), request.clone());
        let entity = request.mesh;
        let progress = Arc::new(AtomicU32::new(0));
        let cancelled = Arc::new(AtomicBool::new(false));
        let (told, stop) = (progress.clone(), cancelled.clone());
        let task = AsyncComputeTaskPool::get().spawn(async move {
            let input = SkinningInput::new(&rig, &mesh, &request.rigid);
            input.compute(&mesh, &request.settings, &|part| {
                told.store(part.to_bits(), Ordering::Relaxed);
                !stop.load(Ordering::Relaxed)
            })
        });
        commands.entity(entity).insert(SkinningJob { progress, cancelled, task });
    }
}

fn land_skinning(
    mut commands: Commands,
    mut jobs: Query<(Entity, &mut SkinningJob, &RigMesh, &SkinOf)>,
    mut edits: MessageWriter<EditRequest>,
    mut bound: MessageWriter<Bound>,
) {
    for (entity, mut job, mesh, of) in &mut jobs {
        let Some(result) = check_ready(&mut job.task) else { continue };
        let result = result.map_err(|error| error.to_string()).map(|(skin, report)| {
            let edit = RigEdit::SetSkin(mesh.uid, Some(skin));
            edits.write(EditRequest::operation(of.0, Operation::Edits(vec![edit])));
            report
        });
        bound.write(Bound { mesh: entity, result });
        commands.entity(entity).remove::<SkinningJob>();
    }
}
