//! Fit: a template's skeleton moved into a mesh in the background, as one undoable edit, and corrected by moving joints.
//!
//! A [`FitRequest`] analyses a mesh in a task. An empty rig gets the template whose limbs the mesh shows; a rig that has joints
//! has them moved. From then on the rig has a [`FittedRig`]: a joint that is moved at rest is a marker, and the joints around it
//! are fitted again, until the fit is accepted or cancelled ([`EndFit`]).

mod fitted_rig;
mod part;
mod refit;
pub mod region;
mod report;
mod work;

use std::sync::Arc;

use bevy::{
    ecs::message::MessageId,
    prelude::*,
    tasks::{AsyncComputeTaskPool, Task, futures::check_ready},
};

use self::{fitted_rig::PendingFit, work::Work};
pub use self::{
    fitted_rig::{FitMarkers, FittedRig},
    region::FitRegion,
    report::{FitFailure, FitReport},
};
use super::{
    RigSystems,
    commands::RigModules,
    configure_sets,
    document::EditRequest,
    history::RigHistory,
    job_control::JobControl,
    landing::{HeldResult, JobOutcome, Landing, ResultHeld},
    limits::{Deadline, RigLimits},
    surface::{RigMesh, SkinOf},
};
use crate::{
    algo::fit_template::{FitError, FitSymmetry},
    rig::{Rig, Uid, operations::Operation, part::Part},
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
            .init_resource::<FitParts>()
            .init_resource::<RigLimits>()
            .add_message::<FitRequest>()
            .add_message::<FitAnswer>()
            .add_message::<EndFit>()
            .add_message::<RemoveMarker>()
            .add_message::<RefitFailed>()
            .add_message::<ResultHeld>()
            .add_message::<super::document::EditReport>()
            .add_message::<EditRequest>()
            .add_systems(
                Update,
                (
                    (start, land, refit::end, refit::remove_markers).chain().in_set(RigSystems::Gesture),
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
    /// Part of the mesh to fit into.
    pub region: FitRegion,
    /// Joints of the rig to move, with those below them; all if empty. The others stay.
    pub joints: Vec<Uid>,
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
            region: FitRegion::Whole,
            joints: Vec::new(),
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
    /// Part, mirrored where the mesh shows the other side; a rig that has joints gets those of the part besides.
    Part {
        /// The part.
        part: FitPart,
        /// Joint of the rig that the part hangs on.
        parent: Option<Uid>,
    },
}

/// Part of a fit.
#[derive(Debug, Clone)]
pub enum FitPart {
    /// The part that [`FitParts`] gives for this name, such as `parts/hand`.
    Named(String),
    /// Part that is given.
    Given(Arc<Part>),
}

/// Function that gives a part by its name; it is called in the task of the fit.
#[derive(Resource, Clone)]
pub struct FitParts(pub Arc<dyn Fn(&str) -> Option<Arc<Part>> + Send + Sync>);

impl Default for FitParts {
    fn default() -> Self {
        Self(Arc::new(|_| None))
    }
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
    /// Edit that the fit became; `None` for a failed one.
    pub edit: Option<MessageId<EditRequest>>,
    /// Report of the fit, or the reason why there is none.
    pub result: Result<Arc<FitReport>, FitFailure>,
}

/// Running fit of a mesh; remove the component or call [`FitJob::cancel`] to stop it.
#[derive(Component)]
pub struct FitJob {
    control: JobControl,
    task: Task<Result<FinishedFit, FitFailure>>,
    /// The rig that the fit started from.
    from: Arc<Rig>,
    landing: Landing,
    /// Finished fit that waits to be committed.
    held: Option<FinishedFit>,
    deadline: Deadline,
}

impl FitJob {
    /// Finished share, 0 to 1.
    pub fn progress(&self) -> f32 {
        self.control.progress()
    }

    /// True if the fit is finished, and waits to be committed.
    pub fn waits(&self) -> bool {
        self.held.is_some()
    }

    /// Stops the fit; the rig stays as it was.
    pub fn cancel(&self) {
        self.control.cancel();
    }
}

/// Request to end a fit: joints that are moved from then on move alone.
#[derive(Message, Debug, Clone, Copy)]
pub struct EndFit {
    /// The rig.
    pub rig: Entity,
    /// True to undo the fit with all corrections.
    pub cancel: bool,
}

/// Request to take a marker away: the joint may move again.
#[derive(Message, Debug, Clone, Copy)]
pub struct RemoveMarker {
    /// The rig.
    pub rig: Entity,
    /// The joint.
    pub joint: Uid,
}

/// Message that the joints around a moved one were not fitted again; the moved joint stays where it was put.
#[derive(Message, Debug, Clone)]
pub struct RefitFailed {
    /// The rig.
    pub rig: Entity,
    /// Reason of the failure.
    pub reason: FitFailure,
}

struct FinishedFit {
    fitted: FittedRig,
    target: Rig,
}

fn start(
    mut commands: Commands,
    mut requests: MessageReader<FitRequest>,
    meshes: Query<(&RigMesh, &SkinOf)>,
    rigs: Query<(&Rig, &RigHistory, Option<&FitMarkers>)>,
    (modules, templates, parts, limits): (Res<RigModules>, Res<FitTemplates>, Res<FitParts>, Res<RigLimits>),
    mut fitted: MessageWriter<FitAnswer>,
) {
    for request in requests.read() {
        let found = meshes.get(request.mesh).ok().and_then(|(mesh, of)| Some((mesh, rigs.get(of.0).ok()?)));
        let Some((mesh, (rig, history, markers))) = found else {
            fitted.write(FitAnswer { mesh: request.mesh, edit: None, result: Err(FitFailure::NoRig) });
            continue;
        };
        if let Err(error) = limits.check_open(mesh) {
            fitted.write(FitAnswer { mesh: request.mesh, edit: None, result: Err(error.into()) });
            continue;
        }
        let from = Arc::new(rig.clone());
        let work = Work {
            from: from.clone(),
            mesh: mesh.clone(),
            request: request.clone(),
            modules: modules.0.clone(),
            templates: templates.clone(),
            parts: parts.clone(),
            markers: markers.map(|markers| markers.held(rig)).unwrap_or_default(),
        };
        let control = JobControl::default();
        let reporter = control.reporter();
        let task = AsyncComputeTaskPool::get().spawn(async move { work.run(&|part| reporter.report(part)) });
        commands.entity(request.mesh).insert(FitJob {
            control,
            task,
            from,
            landing: Landing::asked(history),
            held: None,
            deadline: limits.deadline(),
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
        let job = &mut *job;
        let was_held = job.held.is_some();
        let finished = match job.deadline.check("fitting the template").err() {
            _ if was_held && job.control.is_cancelled() => Some(Err(FitError::Cancelled.into())),
            _ if was_held => job.held.take().map(Ok),
            Some(late) => Some(Err(late.into())),
            // A computation that ends before it notices the wish to stop has no result either.
            None => check_ready(&mut job.task).map(|result| {
                if job.control.is_cancelled() { result.and(Err(FitError::Cancelled.into())) } else { result }
            }),
        };
        let Some(result) = finished else { continue };
        let failure = match (result, rigs.get(of.0)) {
            (Err(error), _) => Some(error),
            (Ok(_), Err(_)) => Some(FitFailure::NoRig),
            (Ok(finished), Ok((rig, history))) => {
                match job.landing.decide(history, || is_same_skeleton(rig, &job.from)) {
                    JobOutcome::Hold { is_news } => {
                        job.held = Some(finished);
                        if is_news {
                            commands.write_message(ResultHeld { mesh: entity, reason: HeldResult::Fit });
                        }
                        continue;
                    }
                    JobOutcome::Drop => Some(FitFailure::Changed),
                    JobOutcome::Commit => {
                        commit((entity, of.0), finished, (rig, history), &modules, &mut commands).err()
                    }
                }
            }
        };
        answers.write_batch(failure.map(|failure| FitAnswer { mesh: entity, edit: None, result: Err(failure) }));
        commands.entity(entity).try_remove::<FitJob>();
    }
}

/// Requests the edits of a finished fit of a mesh of a rig, and answers with its report.
fn commit(
    (mesh, rig_entity): (Entity, Entity),
    FinishedFit { mut fitted, target }: FinishedFit,
    (rig, history): (&Rig, &RigHistory),
    modules: &RigModules,
    commands: &mut Commands,
) -> Result<(), FitFailure> {
    let edits = fitted.edits(rig, &target, &modules.0)?;
    let report = fitted.report.clone();
    fitted.before = history.last().cloned();
    let request = EditRequest::operation(rig_entity, Operation::Named { name: FIT, edits });
    commands.queue(move |world: &mut World| {
        let edit = world.write_message(request);
        world.write_message(FitAnswer { mesh, edit, result: Ok(report) });
    });
    commands.entity(rig_entity).try_insert(PendingFit(fitted));
    Ok(())
}

/// True if two rigs have the same joints at the same places.
fn is_same_skeleton(a: &Rig, b: &Rig) -> bool {
    a.len() == b.len()
        && a.walk()
            .zip(b.walk())
            .all(|(a, b)| (a.data.uid, a.parent, a.data.rest) == (b.data.uid, b.parent, b.data.rest))
}
