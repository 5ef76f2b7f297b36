//! Created joints that are built after a mesh was bound: when a feature or group is switched on, its twist and half joints take
//! their shares from the weights that the mesh has.

use std::{collections::HashSet, sync::Arc};

use bevy::{prelude::*, tasks::AsyncComputeTaskPool};

use super::{BoundSkin, SkinningInput, SkinningJob, SkinningReport, held_objects, parts::object_points};
use crate::{
    algo::weights::{WeightReport, WeightSettings, held_pieces, late_shares},
    plugins::{
        commands::{BuildResult, RigModules},
        document::EditReport,
        history::RigHistory,
        job_control::JobControl,
        landing::{BindStart, Landing},
        limits::RigLimits,
        surface::{RigMesh, SkinOf},
    },
    rig::{
        BuiltRig, Rig, RigEdit, SkinData, Uid,
        deform::DeformSkeleton,
        step::{Commit, Step},
    },
};

/// Most influences of a point whose mesh has no more at any point.
const MOST: usize = 4;

/// Starts jobs for the meshes of rigs in which a step switched something on, where the weights lack joints that are built now.
///
/// Undone and redone steps bring their weights with them.
pub(super) fn start_late_shares(
    mut commands: Commands,
    mut edited: MessageReader<EditReport>,
    meshes: Query<(Entity, &RigMesh, &SkinOf), Without<SkinningJob>>,
    rigs: Query<(&Rig, &RigHistory, &BuildResult)>,
    (modules, limits): (Option<Res<RigModules>>, Res<RigLimits>),
) {
    let mut switched: Vec<Entity> = Vec::new();
    for message in edited.read() {
        if let Some(Commit::Done(step)) = &message.committed
            && switches_on(step)
            && !switched.contains(&message.rig)
        {
            switched.push(message.rig);
        }
    }
    for rig_entity in switched {
        let Ok(found) = rigs.get(rig_entity) else { continue };
        for (entity, mesh, _) in meshes.iter().filter(|(_, _, of)| of.0 == rig_entity) {
            if let Some(job) = late_job(found, mesh, modules.as_deref(), &limits) {
                commands.entity(entity).insert(job);
            }
        }
    }
}

/// The job for a mesh whose weights lack joints that are built now; `None` where they lack none.
pub(super) fn late_job(
    (rig, history, built): (&Rig, &RigHistory, &BuildResult),
    mesh: &RigMesh,
    modules: Option<&RigModules>,
    limits: &RigLimits,
) -> Option<SkinningJob> {
    let skin = rig.skin(mesh.uid).filter(|skin| skin.at_rest && lacks_joints(rig, &built.0, skin))?;
    let (start, landing) = (BindStart::of(rig, mesh.uid), Landing::unasked(history));
    let (rig, built, mesh, skin) = (rig.clone(), Arc::clone(&built.0), mesh.clone(), Arc::clone(skin));
    let modules = modules.map(|modules| modules.0.clone());
    let task = AsyncComputeTaskPool::get().spawn(async move {
        let input = SkinningInput::new(&rig, Some(&built), modules.as_deref(), &mesh, &[]);
        Ok(input.late_shares(&mesh, &skin))
    });
    let (control, deadline) = (JobControl::default(), limits.deadline());
    Some(SkinningJob { control, task, start, landing, held: None, is_asked: false, deadline })
}

/// True if a step enables a command, a feature or a local group.
fn switches_on(step: &Step) -> bool {
    fn states(edits: &[RigEdit], into: &mut Vec<(Uid, bool)>) {
        for edit in edits {
            match edit {
                RigEdit::SetTag(_, tag) => into.push((tag.uid, tag.enabled)),
                RigEdit::SetLocalGroup(group) => into.push((group.uid, group.enabled)),
                RigEdit::Batch(edits) => states(edits, into),
                _ => {}
            }
        }
    }
    let (mut now, mut before) = (Vec::new(), Vec::new());
    states(&step.forward, &mut now);
    states(&step.backward, &mut before);
    now.into_iter().any(|(uid, enabled)| enabled && before.contains(&(uid, false)))
}

/// True if twist or half joints are built that the weights do not name.
fn lacks_joints(rig: &Rig, built: &BuiltRig, skin: &SkinData) -> bool {
    let skeleton = DeformSkeleton::new(rig, Some(built));
    let mut created =
        skeleton.joints().iter().filter(|joint| joint.twist.is_some() || joint.halves.is_some()).peekable();
    if created.peek().is_none() {
        return false;
    }
    let named: HashSet<Uid> = skin.joints.iter().copied().collect();
    created.any(|joint| !named.contains(&joint.uid))
}

impl SkinningInput {
    /// The weights that a mesh has, with shares for the created joints that they do not name.
    fn late_shares(&self, mesh: &RigMesh, skin: &SkinData) -> BoundSkin {
        let created = self.joints.iter().map(|joint| joint.twist.is_some() || joint.halves.is_some());
        let named: HashSet<Uid> = skin.joints.iter().copied().collect();
        let is_late =
            |((uid, is_created), is_locked): ((&Uid, bool), &bool)| is_created && !is_locked && !named.contains(uid);
        let is_late: Vec<bool> = self.uids.iter().zip(created).zip(&self.locked).map(is_late).collect();
        let points = &mesh.rest.points;
        let mut is_fixed = vec![false; points.len()];
        let rigid = held_objects(mesh, skin).into_iter().enumerate().filter(|(_, holder)| holder.is_some());
        for run in rigid.flat_map(|(object, _)| object_points(mesh, object)) {
            is_fixed[run.start as usize..run.end as usize].fill(true);
        }
        let existing = self.existing.clone().unwrap_or_default();
        let most = (0..existing.len()).map(|point| existing.of(point).len()).fold(MOST, usize::max);
        let middles = held_pieces(points, &mesh.triangles, &existing, &self.bending);
        let weights = late_shares(points, &self.joints, &is_late, &existing, &middles, |point| is_fixed[point], most);
        let settings = WeightSettings { max_influences: most, prune: 0.0, ..WeightSettings::default() };
        let is_rigid = |point: usize| is_fixed[point];
        let (weights, pushes) = self.try_bends(mesh, weights, &settings, &is_rigid, &|bend| is_late[bend.half]);
        let weights_report = WeightReport { points: points.len(), given: points.len(), ..WeightReport::default() };
        let report = SkinningReport { weights: weights_report, ..SkinningReport::default() };
        let (joints, subjects) = (self.uids.clone(), self.subjects.clone());
        let skin = Arc::new(SkinData { joints, weights, at_rest: true, subjects });
        BoundSkin { skin, report, pushes }
    }
}
