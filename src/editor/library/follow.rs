//! Templates that were loaded onto the rig: the rig follows the file of the last one, and undo brings back what it followed before.

use std::{path::PathBuf, sync::Arc};

use bevy::{ecs::message::MessageId, prelude::*};

use super::work::LOAD;
use crate::{
    editor::{files::OpenDocument, notice::Notice},
    files::TemplateBase,
    instance::RigSource,
    plugins::{
        document::{Change, EditRefusal, EditReport, EditRequest},
        fit::{FitAnswer, FitRequest},
        history::RigHistory,
    },
    rig::step::{Commit, Step},
};

/// Steps that loaded templates.
#[derive(Resource, Default)]
pub(super) struct LoadSteps {
    /// Step that was asked for.
    pub pending: Option<PendingLoad>,
    steps: Vec<Crossing>,
    /// Mesh that the skeleton of a step is being fitted into.
    fit: Option<(Entity, Entity, Arc<Step>)>,
}

/// Load that was asked for.
pub(super) struct PendingLoad {
    pub request: MessageId<EditRequest>,
    /// File of the template; `None` for one that comes with Rigsmith.
    pub template: Option<PathBuf>,
    /// The template as it was read.
    pub base: TemplateBase,
    /// Mesh that the skeleton goes into.
    pub mesh: Option<Entity>,
    /// Notice that is told once the step is made.
    pub told: String,
}

/// Template that a document follows.
#[derive(Clone, Default)]
struct FollowState {
    template: Option<PathBuf>,
    base: Option<TemplateBase>,
    source: Option<RigSource>,
}

/// A step, with the templates that the document follows before and after it.
struct Crossing {
    rig: Entity,
    step: Arc<Step>,
    before: FollowState,
    after: FollowState,
}

/// Follows loads through the history.
pub(super) fn follow_loads(
    mut reports: MessageReader<EditReport>,
    mut refused: MessageReader<EditRefusal>,
    mut commands: Commands,
) {
    for EditReport { rig, request, name, committed, .. } in reports.read() {
        let (rig, request, is_load) = (*rig, *request, *name == LOAD);
        if let Some(commit) = committed.clone().filter(|_| is_load) {
            commands.queue(move |world: &mut World| cross(world, rig, request, &commit));
        } else if is_load {
            commands.queue(move |world: &mut World| settle(world, rig, request));
        }
    }
    for request in refused.read().map(|refusal| refusal.request) {
        commands.queue(move |world: &mut World| {
            world.resource_mut::<LoadSteps>().take_pending(request);
        });
    }
}

impl LoadSteps {
    /// The load that was asked for by this request; any other one stays.
    fn take_pending(&mut self, request: Option<MessageId<EditRequest>>) -> Option<PendingLoad> {
        self.pending.take_if(|pending| Some(pending.request) == request)
    }
}

fn cross(world: &mut World, rig: Entity, request: Option<MessageId<EditRequest>>, commit: &Commit) {
    let now = followed(world, rig);
    let mut loads = world.resource_mut::<LoadSteps>();
    let step = commit.step();
    if let Commit::Done(_) = commit {
        let Some(pending) = loads.take_pending(request) else { return };
        let after = FollowState { template: pending.template, base: Some(pending.base), source: None };
        loads.fit = pending.mesh.map(|mesh| (rig, mesh, step.clone()));
        // There is one document at a time.
        loads.steps.retain(|known| known.rig == rig);
        loads.steps.push(Crossing { rig, step: step.clone(), before: now, after: after.clone() });
        set(world, rig, after);
        world.write_message(Notice::done(pending.told));
        if let Some(mesh) = pending.mesh {
            world.write_message(FitRequest::new(mesh));
        }
        return;
    }
    let is_step = |known: &&mut Crossing| known.rig == rig && Arc::ptr_eq(&known.step, step);
    let Some(crossing) = loads.steps.iter_mut().find(is_step) else { return };
    let next = match commit {
        Commit::Undone(_) => {
            crossing.after = now;
            crossing.before.clone()
        }
        _ => {
            crossing.before = now;
            crossing.after.clone()
        }
    };
    set(world, rig, next);
}

/// Follows a template that the rig was equal to already.
fn settle(world: &mut World, rig: Entity, request: Option<MessageId<EditRequest>>) {
    let mut loads = world.resource_mut::<LoadSteps>();
    let Some(pending) = loads.take_pending(request) else { return };
    set(world, rig, FollowState { template: pending.template, base: Some(pending.base), source: None });
    world.write_message(Notice::done(pending.told));
    if let Some(mesh) = pending.mesh {
        world.write_message(FitRequest::new(mesh));
    }
}

fn followed(world: &World, rig: Entity) -> FollowState {
    let document = world.get::<OpenDocument>(rig);
    FollowState {
        template: document.and_then(|document| document.template.clone()),
        base: document.and_then(|document| document.base.clone()),
        source: world.get::<RigSource>(rig).cloned(),
    }
}

fn set(world: &mut World, rig: Entity, next: FollowState) {
    if let Some(mut document) = world.get_mut::<OpenDocument>(rig) {
        document.template = next.template;
        document.base = next.base;
    }
    let Ok(mut entity) = world.get_entity_mut(rig) else { return };
    entity.remove::<crate::instance::UpdateOffer>();
    match next.source {
        Some(source) => entity.insert(source),
        // A document with a template gets a source by itself.
        None => entity.remove::<RigSource>(),
    };
}

/// Takes a load back whose skeleton the mesh does not show.
pub(super) fn watch_fits(
    mut answers: MessageReader<FitAnswer>,
    histories: Query<&RigHistory>,
    mut loads: ResMut<LoadSteps>,
    mut commands: Commands,
) {
    for FitAnswer { mesh, result, .. } in answers.read() {
        let Some((rig, _, step)) = loads.fit.take_if(|(_, of, _)| of == mesh) else { continue };
        let is_last =
            histories.get(rig).is_ok_and(|history| history.last().is_some_and(|last| Arc::ptr_eq(last, &step)));
        if result.is_err() && is_last {
            commands.write_message(EditRequest { rig, change: Change::Undo });
        }
    }
}
