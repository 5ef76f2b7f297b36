//! The command processor in an app: rigs that are built, and everything about their commands as components.
//!
//! A [`BuildRequest`] builds a rig, steps it or rolls it back; a rig that has been built follows every edit from then on
//! unless [`BuildStep::Follow`] says otherwise. State, error and time of each command are on the entity of its tag
//! ([`CommandReport`]). Created nodes and constraints are entities with [`CreatedBy`]; a node that is rolled back is
//! parked: it keeps its entity, without its components and disabled, until it comes back.

mod constraints;
mod nodes;
mod run;

use std::{collections::BTreeSet, sync::Arc};

use bevy::prelude::*;

pub use run::{Programs, RunFailure};

use super::{RigSystems, configure_sets, document::Edited};
pub use super::{
    document::{TagEntities, entities::BuiltEntities},
    schema::{
        Attributes, CommandTag, Constrains, Control, CreatedBy, CreatedNodes, CreatedRole, FeatureCommands, FeatureTag,
        InFeature, NodeLayer, Null, Parked, Tag, TagOf, Tags,
    },
};
use crate::{
    modules,
    processor::{BuildError, BuildRange, Builder, CommandStatus, Modules, RigModule, RunReport},
    rig::{BuiltRig, Rig, RigEdit, Uid, step::Committed},
};

/// Adds tags as entities, and building.
pub struct CommandsPlugin;

impl Plugin for CommandsPlugin {
    fn build(&self, app: &mut App) {
        configure_sets(app);
        if !app.world().contains_resource::<RigModules>() {
            app.insert_resource(RigModules(Arc::new(modules::all())));
        }
        app.register_required_components::<Rig, BuiltEntities>();
        app.init_resource::<Programs>().add_message::<BuildRequest>().add_message::<BuildDone>().add_systems(
            Update,
            (build_rigs, nodes::follow_nodes, constraints::follow_constraints, (run::run_built, report_commands))
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
    /// What to do.
    pub step: BuildStep,
}

/// What a [`BuildRequest`] does.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum BuildStep {
    /// All commands.
    All,
    /// On to the next breakpoint, or to the end.
    Run,
    /// To a place in the list, forwards or backwards.
    To(usize),
    /// The next command.
    Forward,
    /// Back over the last command.
    Back,
    /// The rest of the commands of the joint whose turn it is.
    JointForward,
    /// Back over the commands of the joint that was last.
    JointBack,
    /// Back over everything.
    RollBack,
    /// Which joints' commands are in the list.
    Range(BuildRange),
    /// A breakpoint on a tag, or no longer.
    Breakpoint(Uid, bool),
    /// Whether edits are followed at once.
    Follow(bool),
    /// From nothing, with the modules that are registered now.
    Restart,
}

/// A rig was built, stepped or rolled back.
#[derive(Message, Debug, Clone)]
pub struct BuildDone {
    /// The rig.
    pub rig: Entity,
    /// What ran, and what stopped it.
    pub report: RunReport,
}

/// The processor of a rig; there from its first [`BuildRequest`] on. Immutable: a [`BuildRequest`] changes what is built.
#[derive(Component)]
pub struct Processor {
    builder: Builder,
    /// The place that edits are built up to; `None` for all commands.
    goal: Option<usize>,
    follow: bool,
}

impl Processor {
    /// The commands, where they stand, breakpoints: everything that can be asked for.
    pub fn builder(&self) -> &Builder {
        &self.builder
    }

    /// True if edits are followed at once.
    pub fn follows(&self) -> bool {
        self.follow
    }
}

/// What a rig's commands have built so far; changes whenever that does.
#[derive(Component, Debug, Clone, Default)]
#[component(immutable)]
pub struct Built(pub Arc<BuiltRig>);

/// The error that a rig's build stands at; not there if there is none.
#[derive(Component, Debug, Clone, PartialEq)]
#[component(immutable)]
pub struct BuildFailure(pub BuildError);

/// Where a command stands, how long it took and why it failed: on the entity of its tag, for rigs that are built.
#[derive(Component, Debug, Clone, PartialEq)]
#[component(immutable)]
pub struct CommandReport(pub CommandStatus);

fn build_rigs(
    mut commands: Commands,
    mut requests: MessageReader<BuildRequest>,
    mut edited: MessageReader<Edited>,
    mut rigs: Query<(&Rig, Option<&mut Processor>, Option<&Built>, Has<BuildFailure>)>,
    modules: Res<RigModules>,
    mut done: MessageWriter<BuildDone>,
) {
    let mut changed: Vec<(Entity, Vec<RigEdit>, bool)> = Vec::new();
    for message in edited.read() {
        let at = changed.iter().position(|(rig, ..)| *rig == message.rig).unwrap_or_else(|| {
            changed.push((message.rig, Vec::new(), true));
            changed.len() - 1
        });
        let entry = &mut changed[at];
        match &message.committed {
            Some(Committed::Done(step) | Committed::Redone(step)) => entry.1.extend(step.forward.iter().cloned()),
            Some(Committed::Undone(step)) => entry.1.extend(step.backward.iter().cloned()),
            // A preview, or the end of one: the document says all.
            None => entry.2 = false,
        }
    }
    for (entity, edits, complete) in changed {
        let Ok((rig, Some(mut processor), built, failed)) = rigs.get_mut(entity) else { continue };
        let processor = &mut *processor;
        match complete && edits.len() < 16 {
            true => edits.iter().for_each(|edit| processor.builder.touch(rig, edit)),
            false => processor.builder.sync(rig),
        }
        if processor.follow {
            let goal = processor.goal.unwrap_or(usize::MAX);
            let report = processor.builder.run_to(goal);
            finish(&mut commands, entity, &processor.builder, (built, failed), report, &mut done);
        }
    }
    for BuildRequest { rig: entity, step } in requests.read() {
        let Ok((rig, processor, built, failed)) = rigs.get_mut(*entity) else {
            warn!("entity {entity} is no rig and cannot be built; it may have been closed");
            continue;
        };
        let mut fresh;
        let mut stored;
        let is_fresh = processor.is_none() || *step == BuildStep::Restart;
        let processor: &mut Processor = match processor {
            Some(found) if !is_fresh => {
                stored = found;
                &mut stored
            }
            _ => {
                fresh = Processor { builder: Builder::new(modules.0.clone()), goal: None, follow: true };
                fresh.builder.sync(rig);
                &mut fresh
            }
        };
        let report = carry_out(processor, rig, step);
        finish(&mut commands, *entity, &processor.builder, (built, failed), report, &mut done);
        if is_fresh {
            let processor = std::mem::replace(
                processor,
                Processor { builder: Builder::new(modules.0.clone()), goal: None, follow: true },
            );
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
    // A build that was halted goes on as soon as it can; one that was stepped stays where it is.
    if report.error.is_none() {
        processor.goal = (report.cursor < builder.len()).then_some(report.cursor);
    }
    report
}

/// Puts what was built onto the rig, if it is other than before.
fn finish(
    commands: &mut Commands,
    rig: Entity,
    builder: &Builder,
    (before, had_failed): (Option<&Built>, bool),
    report: RunReport,
    done: &mut MessageWriter<BuildDone>,
) {
    let mut entity = commands.entity(rig);
    let built = builder.built();
    if before.is_none_or(|before| *before.0 != built) {
        entity.try_insert(Built(Arc::new(built)));
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

/// Puts state, error and time of each command onto the entity of its tag.
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
