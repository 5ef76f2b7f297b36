//! Background jobs that place a face.

use std::{
    collections::{BTreeMap, BTreeSet},
    sync::{
        Arc, Mutex,
        atomic::{AtomicBool, AtomicU32, Ordering},
    },
    time::{Duration, Instant},
};

use bevy::{
    prelude::*,
    tasks::{AsyncComputeTaskPool, Task, futures::check_ready},
};

use super::{
    Face, FaceExpressions, FacePlaced, FaceReport, FaceRequest, PlaceFaceError, cut_of,
    edits::{FaceEdits, NewFace, face_edits},
    placed_bones::{FaceRig, PlacedBone},
    pose,
};
use crate::{
    algo::face::{
        auto::{AutoFace, AutoSettings, FaceAnalysis, FaceError, FaceFit, FaceProgress, FaceStep},
        bones::{FaceBone, FaceBoneKind, FixedBone, label},
        expression::{BonePose, ExpressionSet},
        grouping::HeadGroup,
        shells::MouthName,
    },
    mesh::{model::Model, shapes::Shapes},
    plugins::{
        document::EditRequest,
        history::RigHistory,
        landing::{HeldResult, JobBasis, JobOutcome, Landing, ResultHeld},
        limits::{Deadline, RigLimits},
        surface::{RigMesh, SkinOf},
    },
    rig::{PoseOffset, Rig, RigEdit, StoredPose, Uid, UidSource, operations::Operation},
};

/// A job that places a face; remove the component or call [`FaceJob::cancel`] to stop it.
#[derive(Component)]
pub struct FaceJob {
    progress: Arc<Progress>,
    /// Names of the shapes to fit.
    shapes: Option<Arc<Shapes>>,
    task: Task<Result<JobResult, FaceError>>,
    /// The part of the document that the face is placed into.
    basis: JobBasis,
    landing: Landing,
    /// A face that is finished and waits; see [`landing`](crate::plugins::landing).
    held: Option<JobResult>,
    deadline: Deadline,
}

#[derive(Default)]
struct Progress {
    part: AtomicU32,
    cancelled: AtomicBool,
    /// Steps in the order in which they began.
    steps: Mutex<Vec<(FaceStep, Instant)>>,
}

/// Result of a task.
struct JobResult {
    analysis: Arc<FaceAnalysis>,
    settings: AutoSettings,
    rest: Arc<Model>,
    face: AutoFace,
    fit: Option<FaceFit>,
    /// Bones of the rig that stay, in the order of the face's fixed places.
    kept: Vec<PlacedBone>,
    times: Vec<(&'static str, Duration)>,
}

impl FaceJob {
    /// Finished share, 0 to 1.
    pub fn progress(&self) -> f32 {
        f32::from_bits(self.progress.part.load(Ordering::Relaxed))
    }

    /// The current step.
    pub fn step(&self) -> Option<FaceStep> {
        let steps = self.progress.steps.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        steps.last().map(|(step, _)| *step)
    }

    /// True if the face is finished, and waits to be placed.
    pub fn waits(&self) -> bool {
        self.held.is_some()
    }

    /// Cancels the job; the rig stays unchanged.
    pub fn cancel(&self) {
        self.progress.cancelled.store(true, Ordering::Relaxed);
    }
}

impl Drop for FaceJob {
    fn drop(&mut self) {
        self.cancel();
    }
}

impl Progress {
    fn report(&self, step: FaceStep, part: f32) -> bool {
        self.part.store(part.to_bits(), Ordering::Relaxed);
        let mut steps = self.steps.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        if steps.last().is_none_or(|(last, _)| *last != step) {
            steps.push((step, Instant::now()));
        }
        !self.cancelled.load(Ordering::Relaxed)
    }

    /// Duration of each step until `end`; steps that ran several times are summed.
    fn times(&self, end: Instant) -> Vec<(&'static str, Duration)> {
        let steps = self.steps.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        let ends = steps.iter().skip(1).map(|(_, at)| *at).chain([end]);
        let mut times: Vec<(&'static str, Duration)> = Vec::new();
        for ((step, begin), end) in steps.iter().zip(ends) {
            let took = end.duration_since(*begin);
            match times.iter_mut().find(|(name, _)| *name == step.name()) {
                Some((_, time)) => *time += took,
                None => times.push((step.name(), took)),
            }
        }
        times
    }
}

pub(super) fn start(
    mut commands: Commands,
    mut requests: MessageReader<FaceRequest>,
    meshes: Query<(&RigMesh, &SkinOf, Option<&Face>)>,
    rigs: Query<(&Rig, &RigHistory)>,
    (expressions, limits): (Res<FaceExpressions>, Res<RigLimits>),
    mut placed: MessageWriter<FacePlaced>,
) {
    for FaceRequest { mesh: entity, settings, fit } in requests.read() {
        let found = meshes.get(*entity).ok().and_then(|(mesh, of, face)| Some((mesh, rigs.get(of.0).ok()?, face)));
        let Some((mesh, (rig, history), face)) = found else {
            placed.write(FacePlaced { mesh: *entity, result: Err(PlaceFaceError::NoRig) });
            continue;
        };
        if let Err(error) = limits.check_open(mesh) {
            placed.write(FacePlaced { mesh: *entity, result: Err(error.into()) });
            continue;
        }
        let (basis, landing) = (JobBasis::of(rig, mesh.uid), Landing::asked(history));
        let ready = face.filter(|face| face.serves(&mesh.rest, settings)).map(|face| face.analysis.clone());
        let work = JobInput {
            rig: rig.clone(),
            mesh: mesh.clone(),
            settings: settings.clone(),
            shapes: fit.clone(),
            expressions: expressions.0.clone(),
            ready,
        };
        let progress = Arc::new(Progress::default());
        let told = progress.clone();
        let task = AsyncComputeTaskPool::get().spawn(async move { work.run(&told) });
        let deadline = limits.deadline();
        let shapes = fit.clone();
        commands.entity(*entity).insert(FaceJob { progress, shapes, task, basis, landing, held: None, deadline });
    }
}

/// Analysis of a mesh, with what the names of its objects tell.
pub(super) fn analysed(
    mesh: &Model,
    triangles: &[[u32; 3]],
    settings: &AutoSettings,
    progress: FaceProgress,
) -> Result<FaceAnalysis, FaceError> {
    let mut names: BTreeMap<u32, MouthName> = BTreeMap::new();
    for part in &mesh.parts {
        let name = mesh.objects.get(part.object).and_then(|object| MouthName::of(&object.name));
        names.extend(name.into_iter().flat_map(|name| part.vertices.iter().map(move |point| (*point, name))));
    }
    let analysis = FaceAnalysis::new(&mesh.points, triangles, settings, progress)?;
    let name_of = |point: usize| names.get(&u32::try_from(point).ok()?).copied();
    Ok(if names.is_empty() { analysis } else { analysis.with_names(&name_of) })
}

/// Input of a task.
struct JobInput {
    rig: Rig,
    mesh: RigMesh,
    settings: AutoSettings,
    shapes: Option<Arc<Shapes>>,
    expressions: Arc<ExpressionSet>,
    ready: Option<Arc<FaceAnalysis>>,
}

impl JobInput {
    fn run(self, progress: &Progress) -> Result<JobResult, FaceError> {
        let Self { rig, mesh, settings, shapes, expressions, ready } = self;
        let report = |step: FaceStep, part: f32| progress.report(step, part);
        let analysis = match ready {
            Some(analysis) => analysis,
            None => Arc::new(analysed(&mesh.rest, &mesh.triangles, &settings, &report)?),
        };
        let known = FaceRig::read(&rig);
        let turn = analysis.axes.rotation();
        // A fit begins with all existing bones; a placement keeps the bones that a person has edited.
        let kept: Vec<PlacedBone> =
            known.bones.iter().filter(|bone| bone.touched || shapes.is_some()).cloned().collect();
        let fixed: Vec<FixedBone> =
            kept.iter().map(|bone| FixedBone { position: turn * bone.position, kind: bone.kind }).collect();
        let bones = match &shapes {
            // Jaw and eyes come on top of the requested bones.
            Some(_) if !kept.is_empty() => kept.iter().filter(|b| b.kind == FaceBoneKind::Skin).count().max(1),
            _ => settings.bones,
        };
        let how = AutoSettings { bones, ..settings.clone() };
        let mut face = analysis.rig(&fixed, &how, &expressions, &report)?;
        let fit = match &shapes {
            None => None,
            Some(shapes) => {
                let locked = |bone: &FaceBone| {
                    let joint = bone.fixed.and_then(|fixed| rig.joint(kept.get(fixed)?.uid));
                    joint.is_some_and(|joint| joint.data.locked)
                };
                let locked: Vec<bool> = face.bones.iter().map(locked).collect();
                let fit = analysis.refit(&face, &shapes.displacements, &locked, settings.influences, &report)?;
                face = fit.face.clone();
                Some(fit)
            }
        };
        rename(&mut face.bones, &kept);
        let times = progress.times(Instant::now());
        Ok(JobResult { analysis, settings, rest: mesh.rest.clone(), face, fit, kept, times })
    }
}

/// Gives bones that stay their labels, and the others free labels; pairs get a common number.
fn rename(bones: &mut [FaceBone], kept: &[PlacedBone]) {
    let stays = |bone: &FaceBone| bone.fixed.and_then(|fixed| kept.get(fixed));
    let mut taken: BTreeSet<String> = kept.iter().map(|bone| bone.label.clone()).collect();
    for at in 0..bones.len() {
        if let Some(kept) = stays(&bones[at]) {
            bones[at].label.clone_from(&kept.label);
            continue;
        }
        let pair = bones[at].pair.filter(|pair| *pair > at && stays(&bones[*pair]).is_none());
        let named = |bone: &FaceBone, number: usize| label(bone.region, bone.side, number, bone.kind);
        let mut found = bones[at].label.clone();
        let mut other = pair.map(|pair| bones[pair].label.clone());
        let mut number = 1;
        while taken.contains(&found) || other.as_ref().is_some_and(|other| taken.contains(other)) {
            if bones[at].kind != FaceBoneKind::Skin || number > bones.len() + kept.len() {
                break;
            }
            found = named(&bones[at], number);
            other = pair.map(|pair| named(&bones[pair], number));
            number += 1;
        }
        taken.insert(found.clone());
        bones[at].label = found;
        if let (Some(pair), Some(other)) = (pair, other) {
            bones[pair].label = other;
        }
    }
}

pub(super) fn land(
    mut commands: Commands,
    mut jobs: Query<(Entity, &mut FaceJob, &RigMesh, &SkinOf)>,
    rigs: Query<(&Rig, &RigHistory)>,
    mut uids: ResMut<UidSource>,
    mut placed: MessageWriter<FacePlaced>,
) {
    for (entity, mut job, mesh, of) in &mut jobs {
        let job = &mut *job;
        let finished = match (job.held.take(), job.deadline.check("placing the face").err()) {
            (Some(_), _) if job.progress.cancelled.load(Ordering::Relaxed) => Some(Err(FaceError::Cancelled.into())),
            (Some(held), _) => Some(Ok(held)),
            (None, Some(late)) => Some(Err(late.into())),
            // A computation that ends before it notices the wish to stop has no result either.
            (None, None) => check_ready(&mut job.task).map(|result| {
                let result = result.map_err(PlaceFaceError::from);
                let is_cancelled = job.progress.cancelled.load(Ordering::Relaxed);
                if is_cancelled { result.and(Err(FaceError::Cancelled.into())) } else { result }
            }),
        };
        let Some(finished) = finished else { continue };
        let result = match (finished, rigs.get(of.0)) {
            (Ok(done), Ok((rig, history))) => {
                match job.landing.decide(history, || JobBasis::of(rig, mesh.uid) == job.basis) {
                    JobOutcome::Commit => Ok(done),
                    JobOutcome::Drop => Err(PlaceFaceError::Changed),
                    JobOutcome::Hold { is_news } => {
                        job.held = Some(done);
                        if is_news {
                            commands.write_message(ResultHeld { mesh: entity, reason: HeldResult::Face });
                        }
                        continue;
                    }
                }
            }
            (result, _) => result,
        };
        let shapes = job.shapes.clone();
        commands.entity(entity).remove::<FaceJob>();
        let result = result.and_then(|done| {
            let (rig, _) = rigs.get(of.0).map_err(|_| PlaceFaceError::Closed)?;
            if done.kept.iter().any(|bone| rig.joint(bone.uid).is_none()) {
                return Err(PlaceFaceError::Deleted);
            }
            let (edits, report) = done.edits(rig, mesh, shapes.as_deref(), &mut uids);
            commands.entity(entity).insert(Face {
                analysis: done.analysis.clone(),
                settings: done.settings.clone(),
                rest: done.rest.clone(),
            });
            let name = if shapes.is_some() { "Fit face" } else { "Place face" };
            commands.write_message(EditRequest::operation(of.0, Operation::Named { name, edits }));
            Ok(report)
        });
        placed.write(FacePlaced { mesh: entity, result });
    }
}

impl JobResult {
    fn edits(
        &self,
        rig: &Rig,
        mesh: &RigMesh,
        shapes: Option<&Shapes>,
        uids: &mut UidSource,
    ) -> (Vec<RigEdit>, FaceReport) {
        let known = FaceRig::read(rig);
        let new = NewFace { analysis: &self.analysis, face: &self.face, kept: &self.kept, mesh: mesh.uid };
        let FaceEdits { mut edits, joints } = face_edits(rig, &known, &new, uids);
        if let (Some(fit), Some(shapes)) = (&self.fit, shapes) {
            edits.extend(self.moved(rig, &joints));
            edits.extend(self.poses(rig, fit, shapes, &joints, uids));
        }
        let cut = cut_of(&self.settings);
        if rig.face_cut(mesh.uid) != cut {
            edits.push(RigEdit::SetFaceCut(mesh.uid, cut));
        }
        (edits, self.report())
    }

    /// Edits of bones that stayed as joints but were moved by a fit.
    fn moved(&self, rig: &Rig, joints: &[Uid]) -> Vec<RigEdit> {
        let to_rig = self.analysis.to_mesh();
        let all = self.face.bones.iter().zip(joints);
        all.filter_map(|(bone, uid)| {
            let joint = rig.joint(*uid)?;
            let mut global = rig.rest_global(*uid);
            global.translation = to_rig * bone.position;
            // The jaw that carries the tongue is moved by an edit of its own.
            let jaw = self.face.bones.iter().zip(joints).find(|(_, uid)| Some(**uid) == joint.parent);
            if let Some((jaw, above)) = jaw {
                global.translation -= to_rig * jaw.position - rig.position(*above);
            }
            let rest = rig.local_rest(joint.parent, &global);
            let rest = crate::rig::RestTransform { translation: rest.translation, ..joint.data.rest };
            (rest != joint.data.rest).then_some(RigEdit::SetRest(*uid, rest))
        })
        .collect()
    }

    /// Edits that store a pose for each shape; poses of the same name are replaced.
    fn poses(&self, rig: &Rig, fit: &FaceFit, shapes: &Shapes, joints: &[Uid], uids: &mut UidSource) -> Vec<RigEdit> {
        let carriers = self.carriers(rig, joints);
        let frames: Vec<pose::Frame> = joints.iter().map(|uid| pose::Frame::of(rig, *uid, &self.analysis)).collect();
        let mut added = rig.stored_poses().len();
        let mut edits = Vec::new();
        for (name, transforms) in shapes.names.iter().zip(&fit.poses) {
            let bones = self.face.bones.iter().zip(&carriers).zip(transforms);
            let own = bones.map(|((bone, carrier), pose)| match carrier {
                Some(jaw) => pose.below(bone.position, &transforms[*jaw], self.face.bones[*jaw].position),
                None => *pose,
            });
            let transforms: Vec<BonePose> = own.collect();
            let offset = |((uid, frame), transform): ((&Uid, &pose::Frame), &BonePose)| {
                let offset = frame.offset(transform);
                (!offset.is_rest(1e-7)).then_some((*uid, offset))
            };
            let offsets: BTreeMap<Uid, PoseOffset> =
                joints.iter().zip(&frames).zip(&transforms).filter_map(offset).collect();
            let same = rig.stored_poses().iter().find(|pose| pose.name == *name);
            let stored = |uid: Uid| StoredPose { uid, name: name.clone(), offsets, ..StoredPose::default() };
            edits.push(match same {
                Some(same) => RigEdit::SetStoredPose(Box::new(stored(same.uid))),
                None => {
                    added += 1;
                    RigEdit::AddStoredPose(Box::new(stored(uids.next_uid())), added - 1)
                }
            });
        }
        edits
    }

    /// Number of the bone whose joint each bone's joint hangs on, if it is not the head's: the jaw's, for the tongue.
    fn carriers(&self, rig: &Rig, joints: &[Uid]) -> Vec<Option<usize>> {
        let jaw = self.face.bones.iter().position(|bone| bone.kind == FaceBoneKind::Jaw);
        let carrier = |(bone, uid): (&FaceBone, &Uid)| {
            let jaw = jaw.filter(|_| bone.kind == FaceBoneKind::Tongue)?;
            let hangs_on_it = rig.joint(*uid).is_none_or(|joint| joint.parent == Some(joints[jaw]));
            hangs_on_it.then_some(jaw)
        };
        self.face.bones.iter().zip(joints).map(carrier).collect()
    }

    fn report(&self) -> FaceReport {
        let Self { analysis, face, .. } = self;
        let count = |group: HeadGroup| analysis.groups.of.iter().filter(|of| **of == group).count();
        let to_rig = analysis.to_mesh();
        let mut bones = face.bones.clone();
        for bone in &mut bones {
            bone.position = to_rig * bone.position;
        }
        FaceReport {
            groups: [HeadGroup::Face, HeadGroup::Middle, HeadGroup::Back].map(count),
            cut: analysis.groups.groups,
            heights: analysis.groups.depth.heights(12),
            mask: analysis.groups.mask.iter().filter(|inside| **inside).count(),
            points: [analysis.points.len(), analysis.mesh_points],
            is_part: analysis.part.is_some(),
            certain: analysis.certain,
            confidence: analysis.landmarks.confidence,
            bones,
            square_error: face.square_error,
            rounds: face.rounds,
            folds: face.folds,
            tolerated_folds: analysis.tolerated_folds(),
            kept: self.kept.len(),
            fit_error: self.fit.as_ref().map(|fit| fit.error),
            times: self.times.clone(),
        }
    }
}
