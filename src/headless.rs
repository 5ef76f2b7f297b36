//! Workbench: a rig and its mesh without a window, for the command line, pipelines and tests.
//!
//! A [`Workbench`] is an app with [`RigPlugins`] and a rig in it. It drives the same plugins as the window, and waits
//! for their background work.

mod held_values;
mod node_lookup;
mod posed_node;
pub mod posing;
mod reloading;

use std::{
    collections::BTreeMap,
    sync::Arc,
    time::{Duration, Instant},
};

use bevy::{
    app::MainSchedulePlugin,
    ecs::{schedule::ScheduleLabel, system::despawn_unused_registered_systems},
    prelude::*,
    time::TimeUpdateStrategy,
};

use crate::{
    algo::{
        face::auto::{AutoSettings, FaceStep},
        weights::WeightSettings,
    },
    mesh::{model::Model, shapes::Shapes},
    plugins::{
        RigPlugins,
        commands::{BuildResult, RigModules, SuppliedBuild},
        document::{ChangeError, EditRefusal, EditRequest},
        face::{
            ExpressError, ExpressRequest, ExpressionAnswer, Face, FaceExpressions, FaceJob, FacePlaced, FacePosing,
            FacePreparation, FaceReport, FaceRequest, FaceShape, PlaceFaceError, arkit_shapes, mended_shares,
            unit_shapes,
        },
        fit::{FitAnswer, FitFailure, FitJob, FitParts, FitReport, FitRequest, FitTemplates},
        gesture::{Gesture, GestureAnswer, GestureScript},
        limits::{Deadline, Limit, OutOfTime, RigLimits},
        mesh_reload::ReloadError,
        skinning::{BindAnswer, BindRequest, MeshPart, PartBinding, SkinningError, SkinningJob, SkinningReport},
        surface::{RigMesh, RigMeshes, SkinOf},
        task_pools,
    },
    processor::BuildLimits,
    rig::{
        BuiltRig, PoseOffset, Rig, RigEdit, SkinData, StoredPose, Uid, UidSource,
        character::{Character, character, import_skeleton},
        operations::Operation,
    },
};

/// An app with [`RigPlugins`], without window and renderer, before `finish`. The same seed gives the same uids.
pub fn headless_app(seed: u64) -> App {
    with_rig_plugins(App::new(), seed)
}

fn with_rig_plugins(mut app: App, seed: u64) -> App {
    app.add_plugins((MinimalPlugins.set(task_pools()), TransformPlugin, RigPlugins))
        .insert_resource(UidSource::seeded(seed));
    app
}

/// An app as [`App::new`] makes it, whose registry has only the types that plugins register themselves. Nothing here reads the
/// other types of Bevy, which take a megabyte, and the code that registers them lies in 6 MB of pages of the program.
fn app_without_derived_types() -> App {
    let mut app = App::empty();
    app.main_mut().update_schedule = Some(Main.intern());
    app.init_resource::<AppTypeRegistry>()
        .add_plugins(MainSchedulePlugin)
        .add_systems(Last, despawn_unused_registered_systems)
        .add_message::<AppExit>();
    app
}

/// App without a window, with the plugins of rigs, one rig and its meshes. Binding, fits and faces work on the mesh that
/// was opened last.
pub struct Workbench {
    app: App,
    rig: Entity,
    mesh: Option<Entity>,
    /// End of the time that work may take.
    deadline: Option<Deadline>,
}

/// Error of the workbench.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum WorkbenchError {
    /// A change was refused.
    #[error(transparent)]
    Refused(#[from] ChangeError),
    /// The mesh was not bound.
    #[error(transparent)]
    Skinning(#[from] SkinningError),
    /// The face was not placed.
    #[error(transparent)]
    Face(#[from] PlaceFaceError),
    /// The face shows no expression.
    #[error(transparent)]
    Expression(#[from] ExpressError),
    /// The template was not fitted.
    #[error(transparent)]
    Fit(#[from] FitFailure),
    /// The mesh was not exchanged for another version.
    #[error(transparent)]
    Reload(#[from] ReloadError),
    /// Work took longer than it may.
    #[error(transparent)]
    OutOfTime(#[from] OutOfTime),
    /// The workbench has no mesh.
    #[error("no mesh is open; open one first")]
    NoMesh,
}

/// Pauses between two looks at a job in the background, which needs the processors more than whoever waits: a sixteenth of
/// the time that the job has taken.
struct Pause(Instant);

impl Pause {
    fn new() -> Self {
        Self(Instant::now())
    }

    fn rest(&self) {
        std::thread::sleep((self.0.elapsed() / 16).clamp(Duration::from_micros(500), Duration::from_millis(10)));
    }
}

impl Workbench {
    /// A workbench with an empty rig. The same seed gives the same uids.
    pub fn new(seed: u64, name: &str) -> Self {
        let mut app = with_rig_plugins(app_without_derived_types(), seed);
        // Time passes only where frames are requested, so that springs give the same result on every machine.
        app.insert_resource(TimeUpdateStrategy::ManualDuration(Duration::ZERO));
        app.finish();
        app.cleanup();
        let uid = app.world_mut().resource_mut::<UidSource>().next_uid();
        let rig = app.world_mut().spawn(Rig::new(uid, name)).id();
        Self { app, rig, mesh: None, deadline: None }
    }

    /// A workbench with a loaded rig.
    pub fn with_rig(seed: u64, rig: Rig) -> Self {
        let mut bench = Self::new(UidSource::seed_beside(seed, &rig), "");
        let entity = bench.rig;
        bench.app.world_mut().entity_mut(entity).insert(rig);
        bench
    }

    /// Sets limits of what builds may make, and of the time that gestures, binding, fits and faces may take from now on.
    pub fn set_limits(&mut self, build: BuildLimits, time: Duration) {
        let mut modules = self.app.world_mut().resource_mut::<RigModules>();
        if modules.0.limits != build {
            Arc::make_mut(&mut modules.0).limits = build;
        }
        self.deadline = Some(Deadline::after(time));
        let mut limits = self.app.world_mut().resource_mut::<RigLimits>();
        for (limit, value) in [
            (Limit::Nodes, build.made as u64),
            (Limit::Attributes, build.attributes as u64),
            (Limit::Work, build.work),
            (Limit::Seconds, time.as_secs()),
        ] {
            limits.set(limit, value);
        }
    }

    /// Sets all limits of the app; their time counts from now on, for everything together.
    pub fn set_rig_limits(&mut self, limits: RigLimits) {
        let (build, time) = (limits.build(), limits.time());
        self.app.insert_resource(limits);
        self.set_limits(build, time);
    }

    fn check_time(&self, work: &'static str) -> Result<(), WorkbenchError> {
        Ok(self.deadline.map_or(Ok(()), |deadline| deadline.check(work))?)
    }

    /// Opens a mesh below the rig. Its own skeleton and weights are imported, unless `mesh_only`.
    pub fn open(&mut self, model: Model, mesh_only: bool) -> Result<(), WorkbenchError> {
        let world = self.app.world_mut();
        let mut uids = world.resource_mut::<UidSource>();
        let uid = uids.next_uid();
        let mut nodes = Vec::new();
        let mut edits = Vec::new();
        if !mesh_only {
            let skeleton = import_skeleton(&model, &mut uids);
            edits = skeleton.edits;
            nodes = skeleton.nodes;
            edits.extend(skeleton.skin.map(|skin| RigEdit::SetSkin(uid, Some(skin))));
        }
        let mesh = world.spawn((RigMesh::new(uid, model, nodes), SkinOf(self.rig))).id();
        self.mesh = Some(mesh);
        if edits.is_empty() { Ok(()) } else { self.operate(Operation::Edits(edits)) }
    }

    /// Attaches a mesh whose weights are in the rig already, such as a mesh of a project.
    pub fn attach(&mut self, mesh: RigMesh) {
        self.mesh = Some(self.app.world_mut().spawn((mesh, SkinOf(self.rig))).id());
    }

    /// Runs one operation as one step of the history.
    pub fn operate(&mut self, operation: Operation) -> Result<(), WorkbenchError> {
        let request = self.app.world_mut().write_message(EditRequest::operation(self.rig, operation));
        self.app.update();
        // Writes to entities may be refused in the same frame.
        let mut refusals = self.app.world_mut().resource_mut::<Messages<EditRefusal>>();
        let refused = refusals.drain().find(|refusal| refusal.request.is_some() && refusal.request == request);
        refused.map_or(Ok(()), |refusal| Err(refusal.reason.into()))
    }

    /// Carries out gestures and returns an answer for each. Where the time of [`Workbench::set_limits`] is over,
    /// the last answer is [`GestureAnswer::out_of_time`], and the gestures behind it are left out.
    pub fn gestures(&mut self, gestures: Vec<Gesture>) -> Vec<GestureAnswer> {
        self.app.world_mut().entity_mut(self.rig).insert(GestureScript::unwatched(gestures));
        loop {
            self.app.update();
            let Some(script) = self.app.world().get::<GestureScript>(self.rig) else { return Vec::new() };
            if script.is_done() {
                return script.answers.clone();
            }
            if let Err(error) = self.check_time("the gesture") {
                return self.cut_gestures(&error);
            }
        }
    }

    /// Gives up gestures: those that were carried out in the last frame are answered in one more.
    fn cut_gestures(&mut self, reason: &WorkbenchError) -> Vec<GestureAnswer> {
        let script = self.app.world_mut().get_mut::<GestureScript>(self.rig);
        let next = script.and_then(|mut script| script.give_up());
        self.app.update();
        let script = self.app.world_mut().entity_mut(self.rig).take::<GestureScript>();
        script.map_or_else(Vec::new, |script| script.cut(next.as_ref(), reason))
    }

    /// Sets the result of the rig's commands, so that meshes are bound to the built joints and exported with them.
    pub fn set_built(&mut self, built: Arc<BuiltRig>) {
        self.app.world_mut().entity_mut(self.rig).insert((BuildResult(built), SuppliedBuild));
        self.app.update();
    }

    /// Computes weights for the mesh; `parts` are the parts that a person decided about. `progress` is called with the finished
    /// share, 0 to 1, now and then.
    pub fn skin(
        &mut self,
        settings: WeightSettings,
        parts: Vec<(MeshPart, PartBinding)>,
        progress: &mut dyn FnMut(f32),
    ) -> Result<SkinningReport, WorkbenchError> {
        self.skin_with(|request| (request.settings, request.parts) = (settings, parts), progress)
    }

    /// Computes weights for the mesh, as [`Workbench::skin`] does. `ask` completes the request.
    pub fn skin_with(
        &mut self,
        ask: impl FnOnce(&mut BindRequest),
        progress: &mut dyn FnMut(f32),
    ) -> Result<SkinningReport, WorkbenchError> {
        let mesh = self.mesh.ok_or(WorkbenchError::NoMesh)?;
        self.check_time("binding the mesh")?;
        self.forget_refusals();
        let mut request = BindRequest::new(mesh);
        ask(&mut request);
        self.app.world_mut().write_message(request);
        let bound: BindAnswer = self.await_answer("binding the mesh", |world| {
            if let Some(job) = world.get::<SkinningJob>(mesh) {
                progress(job.progress());
            }
        })?;
        let report = bound.result?;
        self.refused().map_or(Ok(report), Err)
    }

    /// Offers templates that fits may choose.
    pub fn offer_templates(&mut self, templates: FitTemplates) {
        self.app.insert_resource(templates);
    }

    /// Offers parts that fits may name.
    pub fn offer_parts(&mut self, parts: FitParts) {
        self.app.insert_resource(parts);
    }

    /// Fits a template to the mesh. `ask` completes the request; `progress` is called with the finished share, 0 to 1.
    ///
    /// # Errors
    /// See [`FitFailure`].
    pub fn fit(
        &mut self,
        ask: impl FnOnce(&mut FitRequest),
        progress: &mut dyn FnMut(f32),
    ) -> Result<Arc<FitReport>, WorkbenchError> {
        let mesh = self.mesh.ok_or(WorkbenchError::NoMesh)?;
        self.forget_refusals();
        let mut request = FitRequest::new(mesh);
        ask(&mut request);
        self.app.world_mut().write_message(request);
        let fitted: FitAnswer = self.await_answer("fitting the template", |world| {
            if let Some(job) = world.get::<FitJob>(mesh) {
                progress(job.progress());
            }
        })?;
        let report = fitted.result?;
        self.refused().map_or(Ok(report), Err)
    }

    /// Places a face in the mesh, or moves the face's bones to fit shapes. `progress` is called with the current step
    /// and the finished share, 0 to 1, now and then.
    pub fn face(
        &mut self,
        settings: AutoSettings,
        fit: Option<Arc<Shapes>>,
        progress: &mut dyn FnMut(FaceStep, f32),
    ) -> Result<FaceReport, WorkbenchError> {
        let mesh = self.mesh.ok_or(WorkbenchError::NoMesh)?;
        self.forget_refusals();
        self.app.world_mut().write_message(FaceRequest { mesh, settings, fit });
        let placed: FacePlaced = self.await_answer("placing the face", |world| {
            if let Some(job) = world.get::<FaceJob>(mesh)
                && let Some(step) = job.step()
            {
                progress(step, job.progress());
            }
        })?;
        let report = placed.result?;
        let pause = Pause::new();
        while self.app.world().get::<FacePreparation>(mesh).is_some() {
            pause.rest();
            self.app.update();
        }
        self.refused().map_or(Ok(report), Err)
    }

    /// Shows expressions and units by name, each with a strength from 0 to 1.5, in place of the current ones.
    pub fn express(&mut self, strengths: BTreeMap<String, f32>) -> Result<(), WorkbenchError> {
        let mesh = self.mesh.ok_or(WorkbenchError::NoMesh)?;
        self.forget_refusals();
        self.app.world_mut().write_message(ExpressRequest { mesh, strengths, preview: false });
        let pause = Pause::new();
        let mut answer = None;
        loop {
            self.app.update();
            let world = self.app.world_mut();
            answer = world.resource_mut::<Messages<ExpressionAnswer>>().drain().last().or(answer);
            let is_posing = world.get::<FacePosing>(mesh).is_some_and(FacePosing::is_running);
            if !is_posing && (answer.is_some() || world.get::<FacePreparation>(mesh).is_none()) {
                answer.map_or(Ok(()), |answer| answer.result)?;
                return self.refused().map_or(Ok(()), Err);
            }
            pause.rest();
        }
    }

    /// Largest share of each unit's movement that mending of folds takes, by the unit's name; see [`mended_shares`].
    pub fn mended_shares(&self) -> BTreeMap<String, f32> {
        self.mesh.map(|mesh| mended_shares(self.app.world(), mesh)).unwrap_or_default()
    }

    /// Analysis of the mesh's face, if there is one.
    pub fn placed_face(&self) -> Option<&Face> {
        self.app.world().get::<Face>(self.mesh?)
    }

    /// Blend shapes of ARKit, baked from the placed face with the strongest `influences` of each point.
    ///
    /// # Errors
    /// No face was placed; see [`arkit_shapes`].
    pub fn arkit_shapes(&self, influences: usize) -> Result<Vec<FaceShape>, WorkbenchError> {
        let mesh = self.mesh().ok_or(WorkbenchError::NoMesh)?;
        let face = self.placed_face().ok_or(ExpressError::NoBones)?;
        let set = &self.app.world().resource::<FaceExpressions>().0;
        Ok(arkit_shapes(self.rig(), mesh, &face.analysis, set, influences)?)
    }

    /// Shapes of units without a name in ARKit, baked from the placed face with the strongest `influences` of each point.
    ///
    /// # Errors
    /// No face was placed; see [`unit_shapes`].
    pub fn unit_shapes(&self, influences: usize) -> Result<Vec<FaceShape>, WorkbenchError> {
        let mesh = self.mesh().ok_or(WorkbenchError::NoMesh)?;
        let face = self.placed_face().ok_or(ExpressError::NoBones)?;
        let set = &self.app.world().resource::<FaceExpressions>().0;
        Ok(unit_shapes(self.rig(), mesh, &face.analysis, set, influences)?)
    }

    /// Stores poses by name, as one step; poses of the same names are replaced.
    pub fn store_poses(&mut self, poses: Vec<(String, BTreeMap<Uid, PoseOffset>)>) -> Result<(), WorkbenchError> {
        let mut edits = Vec::with_capacity(poses.len());
        for (name, offsets) in poses {
            let known = self.rig().stored_poses().iter().find(|pose| pose.name == name).map(|pose| pose.uid);
            let uid = known.unwrap_or_else(|| self.app.world_mut().resource_mut::<UidSource>().next_uid());
            let pose = Box::new(StoredPose { uid, name, offsets, ..StoredPose::default() });
            edits.push(match known {
                Some(_) => RigEdit::SetStoredPose(pose),
                None => RigEdit::AddStoredPose(pose, usize::MAX),
            });
        }
        self.operate(Operation::Named { name: "Store poses", edits })
    }

    /// Runs frames until the answer to a request comes, and one more for the edit that it makes. `look` is called between
    /// them.
    fn await_answer<A: Message>(
        &mut self,
        work: &'static str,
        mut look: impl FnMut(&World),
    ) -> Result<A, WorkbenchError> {
        let pause = Pause::new();
        loop {
            self.app.update();
            let answer = self.app.world_mut().resource_mut::<Messages<A>>().drain().last();
            if let Some(answer) = answer {
                // The edit is applied in this frame or in the next one.
                self.app.update();
                return Ok(answer);
            }
            look(self.app.world());
            self.check_time(work)?;
            pause.rest();
        }
    }

    /// Drops refusals of earlier edits, which gestures have answered already, so that none is taken for the next
    /// result.
    fn forget_refusals(&mut self) {
        self.app.world_mut().resource_mut::<Messages<EditRefusal>>().clear();
    }

    fn refused(&mut self) -> Option<WorkbenchError> {
        let refused = self.app.world_mut().resource_mut::<Messages<EditRefusal>>().drain().last();
        refused.map(|refused| WorkbenchError::Refused(refused.reason))
    }

    /// Binds the mesh with given weights.
    pub fn bind(&mut self, skin: SkinData) -> Result<(), WorkbenchError> {
        let uid = self.mesh().ok_or(WorkbenchError::NoMesh)?.uid;
        self.operate(Operation::Edits(vec![RigEdit::SetSkin(uid, Some(Arc::new(skin)))]))
    }

    /// The rig in its current state.
    pub fn rig(&self) -> &Rig {
        static EMPTY: std::sync::LazyLock<Rig> = std::sync::LazyLock::new(Rig::default);
        self.app.world().get::<Rig>(self.rig).unwrap_or(&EMPTY)
    }

    /// The mesh that was opened last.
    pub fn mesh(&self) -> Option<&RigMesh> {
        self.app.world().get::<RigMesh>(self.mesh?)
    }

    /// All meshes, in the order in which they were opened.
    pub fn meshes(&self) -> impl Iterator<Item = &RigMesh> {
        let world = self.app.world();
        let meshes = world.get::<RigMeshes>(self.rig).into_iter().flat_map(|meshes| meshes.iter());
        meshes.filter_map(move |mesh| world.get::<RigMesh>(mesh))
    }

    /// The mesh's weights.
    pub fn weights(&self) -> Option<&SkinData> {
        self.rig().skin(self.mesh()?.uid).map(Arc::as_ref)
    }

    /// Result of the rig's commands; `None` if the rig is not built.
    pub fn built(&self) -> Option<&BuiltRig> {
        self.app.world().get::<BuildResult>(self.rig).map(|built| &*built.0)
    }

    /// Meshes with the rig's joints (the built ones if the rig is built) and weights, for export: several as one model,
    /// which has the name of the first.
    pub fn character(&self) -> Model {
        let (rig, built) = (self.rig(), self.built());
        let model_of = |mesh: &RigMesh| {
            let skin = rig.skin(mesh.uid).map(Arc::as_ref);
            character(&Character { rig, built, file: &mesh.file, rest: &mesh.rest, nodes: &mesh.nodes, skin })
        };
        let mut models = self.meshes().map(model_of);
        let Some(mut model) = models.next() else {
            let empty = Model { name: rig.about().name.clone(), ..default() };
            return character(&Character { rig, built, file: &empty, rest: &empty, nodes: &[], skin: None });
        };
        models.for_each(|more| model.append(more));
        model
    }

    /// The app, for functions that the workbench does not offer.
    pub fn app_mut(&mut self) -> &mut App {
        &mut self.app
    }

    /// The rig's entity.
    pub fn rig_entity(&self) -> Entity {
        self.rig
    }
}
