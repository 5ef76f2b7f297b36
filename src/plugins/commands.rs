//! The command processor in an app: rigs that are built from their commands, with the state of each command as
//! components.
//!
//! A [`BuildRequest`] builds a rig, steps it or rolls it back; a rig that has been built follows every edit from then
//! on unless [`BuildStep::Follow`] says otherwise. State, error and time of each command are on the entity of its tag
//! ([`CommandReport`]). Created nodes and constraints are entities with [`CreatedBy`]; a node that is rolled back is
//! parked: it keeps its entity, without its components and disabled, until it comes back, or until its command is deleted and
//! out of the history.

mod constraints;
mod guard;
mod nodes;
mod run;

use std::{collections::BTreeSet, sync::Arc};

use bevy::{ecs::message::MessageUpdateSystems, prelude::*};

pub use run::{NamedProgramError, Programs, RunFailure};

use super::{
    RigSystems, configure_sets,
    document::EditReport,
    limits::{RigLimits, limit_builds},
};
pub use super::{
    document::{TagEntities, entities::BuiltEntities},
    schema::{
        Attributes, CommandTag, Constrains, Control, CreatedBy, CreatedNodes, CreatedRole, FeatureCommands, FeatureTag,
        InFeature, NodeLayer, Null, ParkedNode, Tag, TagOf, Tags,
    },
};
use crate::{
    modules,
    processor::{BuildError, BuildRange, Builder, CommandStatus, Modules, RigModule, RunReport, with_missing_name},
    rig::{BuiltRig, Revision, Rig, RigEdit, Uid, step::Commit},
};

/// Plugin that builds rigs: runs the commands of tags and spawns entities for what they create.
pub struct CommandsPlugin;

impl Plugin for CommandsPlugin {
    fn build(&self, app: &mut App) {
        configure_sets(app);
        if !app.world().contains_resource::<RigModules>() {
            app.insert_resource(RigModules(Arc::new(modules::all())));
        }
        app.register_required_components::<Rig, BuiltEntities>();
        app.init_resource::<RigLimits>()
            .add_systems(First, limit_builds.run_if(resource_changed::<RigLimits>).before(MessageUpdateSystems));
        app.init_resource::<Programs>().add_message::<BuildRequest>().add_message::<BuildDone>().add_systems(
            Update,
            (
                build_rigs,
                guard::keep_results,
                nodes::follow_nodes,
                nodes::unsorted_rigs.pipe(nodes::order_siblings),
                nodes::despawn_parked,
                constraints::follow_constraints,
                (guard::keep_built, guard::keep_places, guard::keep_attributes, constraints::order_constraints).chain(),
                (run::run_built, report_commands),
                nodes::note_revisions,
            )
                .chain()
                .in_set(RigSystems::Build)
                .after(super::document::follow::follow_tags),
        );
    }
}

/// The modules that commands are built with.
#[derive(Resource, Clone)]
pub struct RigModules(pub Arc<Modules>);

/// Registers modules from any crate.
pub trait RegisterRigModule {
    /// Lets command tags use a module. Rigs that are built already know it after their next [`BuildStep::Restart`].
    fn register_rig_module<M: RigModule>(&mut self) -> &mut Self;
}

impl RegisterRigModule for App {
    fn register_rig_module<M: RigModule>(&mut self) -> &mut Self {
        let mut known = self.world_mut().get_resource_or_insert_with(|| RigModules(Arc::new(modules::all())));
        Arc::make_mut(&mut known.0).add::<M>();
        self
    }
}

/// Asks for a rig to be built, stepped or rolled back.
#[derive(Message, Debug, Clone)]
pub struct BuildRequest {
    /// The rig.
    pub rig: Entity,
    /// Step to carry out.
    pub step: BuildStep,
}

/// Steps of a [`BuildRequest`]. Commands are counted in the order of [`Builder::list`].
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum BuildStep {
    /// Runs all commands and ignores breakpoints.
    All,
    /// Runs up to the next breakpoint, or to the end.
    Run,
    /// Runs or rolls back to a place in the list: the commands before it are in effect afterwards.
    To(usize),
    /// Runs the next command.
    Forward,
    /// Rolls back the last command.
    Back,
    /// Runs the remaining commands of the joint that carries the next command.
    JointForward,
    /// Rolls back the commands of the joint that carries the last command.
    JointBack,
    /// Rolls back all commands.
    RollBack,
    /// Restricts the list to the commands of some joints.
    Range(BuildRange),
    /// Sets (`true`) or removes (`false`) a breakpoint on a tag.
    Breakpoint(Uid, bool),
    /// Rebuilds after each edit (`true`) or only on request (`false`).
    Follow(bool),
    /// Discards the build and runs all commands with the modules that are registered at present.
    Restart,
}

/// A rig was built, stepped or rolled back.
#[derive(Message, Debug, Clone)]
pub struct BuildDone {
    /// The rig.
    pub rig: Entity,
    /// Commands that ran, and the error that stopped the run, if any.
    pub report: RunReport,
}

/// Command processor of a rig, inserted by the first [`BuildRequest`]. Other code reads it; a [`BuildRequest`] changes
/// what is built.
#[derive(Component, Reflect)]
#[reflect(Component, from_reflect = false)]
pub struct Processor {
    #[reflect(ignore)]
    builder: Builder,
    /// Number of commands that an edit rebuilds up to; `None` for all commands.
    goal: Option<usize>,
    follow: bool,
    /// Revision of the document that the builder follows.
    #[reflect(ignore)]
    revision: Revision,
}

impl Processor {
    fn new(modules: &RigModules) -> Self {
        let builder = Builder::new(modules.0.clone());
        Self { builder, goal: None, follow: true, revision: Revision::default() }
    }

    /// The builder, for queries: list of commands, their states, breakpoints.
    pub fn builder(&self) -> &Builder {
        &self.builder
    }

    /// True if each edit of the rig rebuilds it.
    pub fn follows(&self) -> bool {
        self.follow
    }
}

/// Result of the commands that a rig has run so far (nodes, constraints, switches); replaced only when it differs. A
/// result that other code inserts is put back in the same frame, and told.
#[derive(Component, Reflect, Debug, Clone, Default)]
#[component(immutable)]
#[reflect(opaque)]
#[reflect(Component, Debug, Clone, Default)]
pub struct BuildResult(pub Arc<BuiltRig>);

/// Marks a rig whose [`BuildResult`] comes from a caller, who built it elsewhere, and not from its processor.
#[derive(Component)]
pub(crate) struct SuppliedBuild;

/// Error that stopped a rig's build; absent if the build has no error.
#[derive(Component, Reflect, Debug, Clone, PartialEq)]
#[component(immutable)]
#[reflect(opaque)]
#[reflect(Component, Debug, Clone, PartialEq)]
pub struct BuildFailure(pub BuildError);

/// State of a command, duration of its last run and error, if any; on the entity of the command's tag, for rigs that
/// are built.
#[derive(Component, Reflect, Debug, Clone, PartialEq)]
#[component(immutable)]
#[reflect(opaque)]
#[reflect(Component, Debug, Clone, PartialEq)]
pub struct CommandReport(pub CommandStatus);

fn build_rigs(
    mut commands: Commands,
    mut requests: MessageReader<BuildRequest>,
    mut edited: MessageReader<EditReport>,
    mut rigs: Query<(&Rig, Option<&mut Processor>, Option<&BuildResult>, Has<BuildFailure>)>,
    modules: Res<RigModules>,
    limits: Res<RigLimits>,
    mut done: MessageWriter<BuildDone>,
) {
    let mut changed: Vec<(Entity, Vec<RigEdit>, bool)> = Vec::new();
    for message in edited.read() {
        if !rigs.get(message.rig).is_ok_and(|(_, processor, ..)| processor.is_some()) {
            continue;
        }
        let at = changed.iter().position(|(rig, ..)| *rig == message.rig).unwrap_or_else(|| {
            changed.push((message.rig, Vec::new(), true));
            changed.len() - 1
        });
        let entry = &mut changed[at];
        match &message.committed {
            Some(Commit::Done(step) | Commit::Redone(step)) => entry.1.extend(step.forward.iter().cloned()),
            Some(Commit::Undone(step)) => entry.1.extend(step.backward.iter().cloned()),
            // A preview, or its end, lists no edits: the builder compares the whole document.
            None => entry.2 = false,
        }
    }
    for (entity, edits, complete) in changed {
        let Ok((rig, Some(mut processor), built, failed)) = rigs.get_mut(entity) else { continue };
        if processor.revision.is_same(rig.revision()) {
            continue;
        }
        let processor = &mut *processor;
        processor.revision = rig.revision().clone();
        // A step of motion may have reverted a preview of other things, which no message lists.
        match complete && edits.len() < 16 && !edits.iter().all(RigEdit::is_of_motion) {
            true => edits.iter().for_each(|edit| processor.builder.touch(rig, edit)),
            false => processor.builder.sync(rig),
        }
        if processor.follow {
            let goal = processor.goal.unwrap_or(usize::MAX);
            processor.builder.set_deadline(limits.deadline());
            let report = named(processor.builder.run_to(goal), rig, &modules);
            finish(&mut commands, entity, &mut processor.builder, (built, failed), report, &mut done);
        }
    }
    for BuildRequest { rig: entity, step } in requests.read() {
        let Ok((rig, processor, built, failed)) = rigs.get_mut(*entity) else {
            warn!("entity {entity} is no rig and cannot be built; it may have been closed");
            continue;
        };
        let mut fresh;
        let mut stored;
        let is_fresh = processor.is_none();
        let begun = || {
            let mut processor = Processor::new(&modules);
            processor.builder.sync(rig);
            processor.revision = rig.revision().clone();
            processor
        };
        let processor: &mut Processor = match processor {
            Some(mut found) => {
                // In its place, so that further requests of this frame go on with it.
                if *step == BuildStep::Restart {
                    *found = begun();
                }
                stored = found;
                &mut stored
            }
            None => {
                fresh = begun();
                &mut fresh
            }
        };
        processor.builder.set_deadline(limits.deadline());
        let report = named(carry_out(processor, rig, step), rig, &modules);
        finish(&mut commands, *entity, &mut processor.builder, (built, failed), report, &mut done);
        if is_fresh {
            let processor = std::mem::replace(processor, Processor::new(&modules));
            commands.entity(*entity).try_insert(processor);
        }
    }
}

fn carry_out(processor: &mut Processor, rig: &Rig, step: &BuildStep) -> RunReport {
    let builder = &mut processor.builder;
    let report = match step {
        BuildStep::All | BuildStep::Restart => builder.run_all(),
        BuildStep::Run => builder.run(),
        BuildStep::To(place) => builder.run_to(*place),
        BuildStep::Forward => builder.step_forward(),
        BuildStep::Back => builder.step_back(),
        BuildStep::JointForward => builder.joint_forward(),
        BuildStep::JointBack => builder.joint_back(),
        BuildStep::RollBack => builder.roll_back(),
        BuildStep::Range(range) => {
            builder.set_range(range.clone());
            builder.sync(rig);
            builder.run_to(processor.goal.unwrap_or(usize::MAX))
        }
        BuildStep::Breakpoint(tag, on) => {
            builder.set_breakpoint(*tag, *on);
            return RunReport { cursor: builder.cursor(), ..RunReport::default() };
        }
        BuildStep::Follow(follow) => {
            processor.follow = *follow;
            if !follow {
                return RunReport { cursor: builder.cursor(), ..RunReport::default() };
            }
            builder.run_to(processor.goal.unwrap_or(usize::MAX))
        }
    };
    // After an error the goal stays, so that the build continues once it can. A build that was stepped to a place stays
    // there.
    if report.error.is_none() {
        processor.goal = (report.cursor < builder.len()).then_some(report.cursor);
    }
    report
}

/// The report of a run whose error tells the name that the rig lacks.
fn named(report: RunReport, rig: &Rig, modules: &RigModules) -> RunReport {
    let error = report.error.map(|error| with_missing_name(rig, &modules.0, error));
    RunReport { error, ..report }
}

/// Writes the built rig to the rig's entity if it differs from before, updates the error, and reports the run.
fn finish(
    commands: &mut Commands,
    rig: Entity,
    builder: &mut Builder,
    (before, had_failed): (Option<&BuildResult>, bool),
    report: RunReport,
    done: &mut MessageWriter<BuildDone>,
) {
    let mut entity = commands.entity(rig);
    let built = builder.shared_built();
    if before.is_none_or(|before| !Arc::ptr_eq(&before.0, &built) && before.0 != built) {
        entity.try_insert(BuildResult(built)).try_remove::<SuppliedBuild>();
    }
    match &report.error {
        Some(error) => {
            entity.try_insert(BuildFailure(error.clone()));
        }
        None if had_failed => {
            entity.try_remove::<BuildFailure>();
        }
        None => {}
    }
    done.write(BuildDone { rig, report });
}

/// Writes the state, error and duration of each command to the entity of its tag.
fn report_commands(
    mut commands: Commands,
    mut done: MessageReader<BuildDone>,
    rigs: Query<(&Processor, &TagEntities)>,
    reports: Query<&CommandReport>,
) {
    let built: BTreeSet<Entity> = done.read().map(|done| done.rig).collect();
    for (processor, tags) in built.into_iter().filter_map(|rig| rigs.get(rig).ok()) {
        for entry in processor.builder.list() {
            let Some(entity) = tags.get(entry.command) else { continue };
            let Some(status) = processor.builder.status(entry.command) else { continue };
            let report = CommandReport(status);
            if reports.get(entity).ok() != Some(&report) {
                commands.entity(entity).try_insert(report);
            }
        }
    }
}
