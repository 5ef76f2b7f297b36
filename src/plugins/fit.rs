//! Fit: a template's skeleton moved into a mesh in the background, as one undoable edit, and corrected by moving joints.
//!
//! A [`FitRequest`] analyses a mesh in a task. An empty rig gets the template whose limbs the mesh shows; a rig that has joints
//! has them moved. From then on the rig has a [`FittedRig`]: a joint that is moved at rest is a marker, and the joints around it
//! are fitted again, until the fit is accepted or cancelled ([`EndFit`]).

mod refit;
mod work;

use std::{
    collections::BTreeMap,
    sync::{
        Arc,
        atomic::{AtomicBool, AtomicU32, Ordering},
    },
    time::Duration,
};

use bevy::{
    prelude::*,
    tasks::{AsyncComputeTaskPool, Task, futures::check_ready},
};

use self::work::Work;
use super::{
    RigSystems,
    commands::RigModules,
    configure_sets,
    document::EditRequest,
    history::RigHistory,
    landing::{HeldResult, ResultHeld},
    limits::{Deadline, LimitError, OutOfTime, RigLimits},
    surface::{RigMesh, SkinOf},
};
use crate::{
    algo::fit_template::{FitError, FitSettings, FitSymmetry, FittedSkeleton, MeshAnalysis},
    processor::{Fitting, Modules, fitted_rig},
    rig::{EditError, Rig, RigEdit, Uid, operations::Operation, step::Step, update::edits_between},
};

/// Name of the step of a fit.
pub const FIT: &str = "Fit";
/// Name of the step that fits the joints around a moved one again.
pub const FIT_AROUND: &str = "Fit around";

/// Plugin that fits templates to meshes.
pub struct FitPlugin;

impl Plugin for FitPlugin {
    fn build(&self, app: &mut App) {
        configure_sets(app);
        app.init_resource::<FitTemplates>()
            .init_resource::<RigLimits>()
            .add_message::<FitRequest>()
            .add_message::<FitAnswer>()
            .add_message::<EndFit>()
            .add_message::<ResultHeld>()
            .add_message::<super::document::EditReport>()
            .add_message::<EditRequest>()
            .add_systems(
                Update,
                (
                    (start, land, refit::end).chain().in_set(RigSystems::Gesture),
                    refit::follow_moves.after(RigSystems::Edits).before(RigSystems::Build),
                ),
            );
    }
}

/// Request to fit a template to a mesh of a rig.
#[derive(Message, Debug, Clone)]
pub struct FitRequest {
    /// The entity with the [`RigMesh`].
    pub mesh: Entity,
    /// The template, if the rig has no joints; a rig that has joints has those moved.
    pub template: FitTemplate,
    /// Up direction in the mesh's space; found if `None`.
    pub up: Option<Vec3>,
    /// Direction in which the figure faces; found if `None`.
    pub forward: Option<Vec3>,
    /// Symmetry of the result.
    pub symmetry: FitSymmetry,
    /// Positions of joints, by their labels.
    pub markers: Vec<(String, Vec3)>,
    /// Objects of the mesh to fit into; all of it if empty.
    pub objects: Vec<usize>,
}

impl FitRequest {
    /// A request that leaves everything to the fit.
    pub fn new(mesh: Entity) -> Self {
        Self {
            mesh,
            template: FitTemplate::Choose,
            up: None,
            forward: None,
            symmetry: FitSymmetry::Auto,
            markers: Vec::new(),
            objects: Vec::new(),
        }
    }
}

/// Template of a fit.
#[derive(Debug, Clone)]
pub enum FitTemplate {
    /// The one of [`FitTemplates`] whose limbs the mesh shows.
    Choose,
    /// The one of [`FitTemplates`] with this name.
    Named(String),
    /// Rig that is given.
    Rig(Arc<Rig>),
}

/// Function that gives the templates that a fit may choose; it is called in the task of the fit.
#[derive(Resource, Clone)]
pub struct FitTemplates(pub Arc<dyn Fn() -> Vec<Arc<Rig>> + Send + Sync>);

impl Default for FitTemplates {
    fn default() -> Self {
        Self(Arc::new(Vec::new))
    }
}

/// Answer to a [`FitRequest`].
#[derive(Message, Debug, Clone)]
pub struct FitAnswer {
    /// The mesh.
    pub mesh: Entity,
    /// Report of the fit, or the reason why there is none.
    pub result: Result<Arc<FitReport>, FitFailure>,
}

/// Report of a fit.
#[derive(Debug, Clone)]
pub struct FitReport {
    /// Name of the template; of the rig if its own joints were moved.
    pub template: String,
    /// Limbs that the chosen template has and that the mesh shows, in words; empty if there was no choice.
    pub choice: String,
    /// Uid and label of each joint, in the order of the fit.
    pub joints: Vec<(Uid, String)>,
    /// The fit, in the space of the mesh.
    pub fit: FittedSkeleton,
    /// Duration of analysis and fit.
    pub time: Duration,
}

impl FitReport {
    /// Confidence below which a joint is doubtful.
    pub const DOUBTFUL: f32 = 0.5;

    /// Joints that the fit is not sure of.
    pub fn doubtful(&self) -> impl Iterator<Item = Uid> + '_ {
        let pairs = self.joints.iter().zip(&self.fit.joints);
        pairs.filter(|(_, joint)| joint.confidence < Self::DOUBTFUL).map(|((uid, _), _)| *uid)
    }
}

/// Reason why a template was not fitted; a sentence for people without its full stop.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum FitFailure {
    /// The entity of the request has no mesh, or its mesh no rig.
    #[error("the mesh belongs to no rig; it may have been closed")]
    NoRig,
    /// The rig and the request have no joints.
    #[error("there is no skeleton to fit; name a template")]
    NoTemplate,
    /// No template has the name.
    #[error("there is no template \"{name}\"{nearest}")]
    NoName {
        /// Requested name.
        name: String,
        /// Nearest names, as the rest of a sentence.
        nearest: String,
    },
    /// A marker names no joint.
    #[error("no joint of \"{template}\" is called \"{label}\"{nearest}")]
    NoJoint {
        /// Name of the template.
        template: String,
        /// Requested label.
        label: String,
        /// Nearest labels, as the rest of a sentence.
        nearest: String,
    },
    /// The mesh does not show the template.
    #[error(transparent)]
    Fit(#[from] FitError),
    /// The joints cannot be put there.
    #[error(transparent)]
    Edit(#[from] EditError),
    /// The rig was changed meanwhile.
    #[error("the joints were changed while the template was fitted; fit again")]
    Changed,
    /// The mesh has more points or triangles than [`RigLimits`] allows.
    #[error(transparent)]
    Limit(#[from] LimitError),
    /// The fit took longer than [`RigLimits`] allows.
    #[error(transparent)]
    OutOfTime(#[from] OutOfTime),
}

/// Running fit of a mesh; remove the component or call [`FitJob::cancel`] to stop it.
#[derive(Component)]
pub struct FitJob {
    progress: Arc<AtomicU32>,
    cancelled: Arc<AtomicBool>,
    task: Task<Result<FinishedFit, FitFailure>>,
    /// The rig that the fit started from.
    from: Arc<Rig>,
    /// Last step and number of undone steps when the fit was asked for.
    history: HistoryState,
    /// Finished fit that waits to be committed.
    held: Option<FinishedFit>,
    deadline: Deadline,
}

/// Last step of a history and its number of undone steps: a new step discards those.
type HistoryState = (Option<Arc<Step>>, usize);

fn state_of(history: &RigHistory) -> HistoryState {
    (history.last().cloned(), history.undone())
}

fn is_same_state(a: &HistoryState, b: &HistoryState) -> bool {
    let is_same = match (&a.0, &b.0) {
        (Some(a), Some(b)) => Arc::ptr_eq(a, b),
        (a, b) => a.is_none() && b.is_none(),
    };
    is_same && a.1 == b.1
}

impl FitJob {
    /// Finished share, 0 to 1.
    pub fn progress(&self) -> f32 {
        f32::from_bits(self.progress.load(Ordering::Relaxed))
    }

    /// True if the fit is finished, and waits to be committed.
    pub fn waits(&self) -> bool {
        self.held.is_some()
    }

    /// Stops the fit; the rig stays as it was.
    pub fn cancel(&self) {
        self.cancelled.store(true, Ordering::Relaxed);
    }
}

impl Drop for FitJob {
    fn drop(&mut self) {
        self.cancel();
    }
}

/// Fit that can still be corrected, on the rig's entity: moving a joint at rest fits the joints around it again.
#[derive(Component, Reflect, Clone)]
#[reflect(opaque)]
#[reflect(Component, Clone)]
pub struct FittedRig {
    /// Report of the present fit.
    pub report: Arc<FitReport>,
    /// Places that a person chose, by joint.
    pub markers: BTreeMap<Uid, Vec3>,
    analysis: Arc<MeshAnalysis>,
    settings: FitSettings,
    /// Skeleton of the template at rest, before it was fitted.
    template: Arc<Rig>,
    /// Report of the fit before corrections, from which every correction starts.
    first: Arc<FitReport>,
    /// Positions of the joints after the last edit, in the order of the report.
    places: Vec<Option<Vec3>>,
    floor: f32,
    /// Last step before the fit.
    before: Option<Arc<Step>>,
}

/// Request to end a fit: joints that are moved from then on move alone.
#[derive(Message, Debug, Clone, Copy)]
pub struct EndFit {
    /// The rig.
    pub rig: Entity,
    /// True to undo the fit with all corrections.
    pub cancel: bool,
}

struct FinishedFit {
    fitted: FittedRig,
    target: Rig,
}

fn start(
    mut commands: Commands,
    mut requests: MessageReader<FitRequest>,
    meshes: Query<(&RigMesh, &SkinOf)>,
    rigs: Query<(&Rig, &RigHistory)>,
    (modules, templates, limits): (Res<RigModules>, Res<FitTemplates>, Res<RigLimits>),
    mut fitted: MessageWriter<FitAnswer>,
) {
    for request in requests.read() {
        let found = meshes.get(request.mesh).ok().and_then(|(mesh, of)| Some((mesh, rigs.get(of.0).ok()?)));
        let Some((mesh, (rig, history))) = found else {
            fitted.write(FitAnswer { mesh: request.mesh, result: Err(FitFailure::NoRig) });
            continue;
        };
        if let Err(error) = limits.check_open(mesh) {
            fitted.write(FitAnswer { mesh: request.mesh, result: Err(error.into()) });
            continue;
        }
        let from = Arc::new(rig.clone());
        let work = Work {
            from: from.clone(),
            mesh: mesh.clone(),
            request: request.clone(),
            modules: modules.0.clone(),
            templates: templates.clone(),
        };
        let progress = Arc::new(AtomicU32::new(0));
        let cancelled = Arc::new(AtomicBool::new(false));
        let (share, stop) = (progress.clone(), cancelled.clone());
        let task = AsyncComputeTaskPool::get().spawn(async move {
            work.run(&|part| {
                share.store(part.to_bits(), Ordering::Relaxed);
                !stop.load(Ordering::Relaxed)
            })
        });
        commands.entity(request.mesh).insert(FitJob {
            progress,
            cancelled,
            task,
            from,
            history: state_of(history),
            held: None,
            deadline: Deadline::new(&limits),
        });
    }
}

fn land(
    mut commands: Commands,
    mut jobs: Query<(Entity, &mut FitJob, &SkinOf)>,
    rigs: Query<(&Rig, &RigHistory)>,
    modules: Res<RigModules>,
    mut answers: MessageWriter<FitAnswer>,
) {
    for (entity, mut job, of) in &mut jobs {
        let was_held = job.held.is_some();
        let finished = match job.deadline.passed() {
            _ if was_held => job.held.take().map(Ok),
            Some(late) => Some(Err(late.into())),
            None => check_ready(&mut job.task),
        };
        let Some(result) = finished else { continue };
        let result = match (result, rigs.get(of.0)) {
            (Err(error), _) => Err(error),
            (Ok(_), Err(_)) => Err(FitFailure::NoRig),
            // Steps that were undone while the fit ran are not lost to it; those from before are, as to any other edit.
            (Ok(finished), Ok((_, history)))
                if history.is_previewing()
                    || history.can_redo() && !is_same_state(&job.history, &state_of(history)) =>
            {
                job.held = Some(finished);
                if !was_held && history.can_redo() {
                    commands.write_message(ResultHeld { mesh: entity, reason: HeldResult::Fit });
                }
                continue;
            }
            (Ok(_), Ok((rig, _))) if !is_same_skeleton(rig, &job.from) => Err(FitFailure::Changed),
            (Ok(FinishedFit { mut fitted, target }), Ok((rig, history))) => {
                match fitted.edits(rig, &target, &modules.0) {
                    Ok(changes) => {
                        let report = fitted.report.clone();
                        fitted.before = history.last().cloned();
                        let operation = Operation::Named { name: FIT, edits: changes };
                        commands.write_message(EditRequest::operation(of.0, operation));
                        commands.entity(of.0).try_insert(fitted);
                        Ok(report)
                    }
                    Err(error) => Err(error.into()),
                }
            }
        };
        answers.write(FitAnswer { mesh: entity, result });
        commands.entity(entity).try_remove::<FitJob>();
    }
}

/// True if two rigs have the same joints at the same places.
fn is_same_skeleton(a: &Rig, b: &Rig) -> bool {
    a.len() == b.len()
        && a.walk()
            .zip(b.walk())
            .all(|(a, b)| (a.data.uid, a.parent, a.data.rest) == (b.data.uid, b.parent, b.data.rest))
}

impl FittedRig {
    /// The template in the body.
    fn target(&self, modules: &Modules) -> Result<Rig, EditError> {
        self.placed(&self.template, modules)
    }

    /// The edits that put the template into a rig without joints, or the rig's own joints to their places. Whatever else
    /// the rig has, or has got while the fit ran, stays.
    fn edits(&self, rig: &Rig, target: &Rig, modules: &Modules) -> Result<Vec<RigEdit>, EditError> {
        if !rig.is_empty() {
            return edits_between(rig, &self.placed(rig, modules)?);
        }
        let mut edits = edits_between(rig, target)?;
        edits.retain(|edit| !matches!(edit, RigEdit::RemoveLocalGroup(_) | RigEdit::RemoveStoredPose(_)));
        Ok(edits)
    }

    fn placed(&self, rig: &Rig, modules: &Modules) -> Result<Rig, EditError> {
        let FittedSkeleton { up, forward, joints, .. } = &self.report.fit;
        let places = self.report.joints.iter().zip(joints).map(|((uid, _), joint)| (*uid, joint.position)).collect();
        let left = up.cross(*forward).normalize_or(Vec3::X);
        let turn = Quat::from_mat3(&Mat3::from_cols(left, *up, left.cross(*up))).normalize();
        fitted_rig(rig, &Fitting { places, turn, floor: self.floor }, modules)
    }
}
