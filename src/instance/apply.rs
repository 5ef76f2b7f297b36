//! Instances that follow their templates.

use std::{collections::BTreeMap, sync::Arc};

use bevy::{
    asset::{AssetId, AssetLoadFailedEvent},
    ecs::entity::EntityHashMap,
    prelude::*,
    transform::components::TransformTreeChanged,
};
use rayon::prelude::*;

use super::{
    BuiltTemplate, ExposedNodes, RigBuilt, RigFailed, RigInstance, RigSource, RigTemplate, RigTemplates, RigUpdated,
    RunningTemplate, TemplateError, Users,
    clip_updates::{ClipJobs, ClipOrigin, UpdatedClips},
    exchange::{Exchange, described_otherwise},
};
use crate::{
    plugins::{
        animation::{PlayedClip, RigClips},
        commands::NamedProgramError,
        runtime::{ControlPose, InstanceMode, RigRuntime, despawn_nodes, furnish_instance, spawn_instance},
        schema::{Control, CreatedRole, Joint, NodeLabel, NodeLayer},
    },
    processor::{ClipReport, PoseNote},
    rig::{
        AttributeValues, BuiltNode, MovedNodes, PoseOffset, RestTransform, Uid,
        update::{Change, Take, update},
    },
    solve::{
        keep_pose::{Deviation, KeptPose},
        program::{ProgramError, RigProgram, RigState},
    },
};

/// Takes over what the thread has built, and tells what it could not build.
pub(super) fn take_outcomes(
    mut templates: ResMut<RigTemplates>,
    mut assets: ResMut<Assets<RigTemplate>>,
    users: Users,
    mut commands: Commands,
) {
    let outcomes = templates.bypass_change_detection().builds.outcomes();
    for outcome in outcomes {
        let id = outcome.id;
        match outcome.result {
            Ok(built) => {
                let is_used = match outcome.template {
                    Some(template) => {
                        let is_used = assets.insert(id, template.clone()).is_ok();
                        if is_used {
                            templates.own.insert(id, template);
                        }
                        is_used
                    }
                    None => assets.contains(id),
                };
                // The last handle is gone, or the asset was removed, while the thread built.
                if !is_used {
                    templates.forget(id);
                    continue;
                }
                templates.built.insert(id, built);
                templates.failed.remove(&id);
                templates.is_fresh = true;
            }
            Err(error) => {
                templates.note_failure(id, &error);
                for entity in users.of(id) {
                    commands.trigger(RigFailed { entity, error: error.clone() });
                }
            }
        }
    }
}

/// Tells instances whose template the asset server cannot load.
pub(super) fn follow_failures(
    mut failed: MessageReader<AssetLoadFailedEvent<RigTemplate>>,
    mut templates: ResMut<RigTemplates>,
    users: Users,
    mut commands: Commands,
) {
    for AssetLoadFailedEvent { id, error, .. } in failed.read() {
        let error = TemplateError::Load(error.to_string());
        templates.note_failure(*id, &error);
        for entity in users.of(*id) {
            commands.trigger(RigFailed { entity, error: error.clone() });
        }
    }
}

/// Tells instances of templates that are known to have no build: their failure was told before the instances came.
pub(super) fn tell_known_failures(
    instances: Query<(Entity, &RigInstance), Changed<RigInstance>>,
    sources: Query<(Entity, &RigSource), Added<RigSource>>,
    templates: Res<RigTemplates>,
    mut commands: Commands,
) {
    let instances = instances.iter().map(|(entity, instance)| (entity, instance.0.id()));
    let sources = sources.iter().map(|(entity, source)| (entity, source.template.id()));
    for (entity, id) in instances.chain(sources) {
        if let Some(error) = templates.failed.get(&id) {
            commands.trigger(RigFailed { entity, error: error.clone() });
        }
    }
}

impl RigTemplates {
    /// Keeps the reason for which a template has no build, for those who ask for it later.
    fn note_failure(&mut self, id: AssetId<RigTemplate>, error: &TemplateError) {
        if !self.built.contains_key(&id) {
            self.failed.insert(id, error.clone());
        }
    }
}

/// True if an instance may not run what it should.
pub(super) fn is_due(
    templates: Res<RigTemplates>,
    changed: Query<(), Or<(Changed<RigInstance>, Changed<InstanceMode>, Changed<ExposedNodes>)>>,
    unexposed: RemovedComponents<ExposedNodes>,
) -> bool {
    templates.is_fresh || !changed.is_empty() || !unexposed.is_empty()
}

/// An instance that does not run what it should.
struct DueInstance {
    entity: Entity,
    built: Arc<BuiltTemplate>,
    program: Arc<RigProgram>,
    mode: InstanceMode,
    /// True if it has no nodes of that mode.
    is_fresh: bool,
    /// True if its template is another version than the one it runs.
    is_other: bool,
    /// The version that it runs.
    before: Option<Arc<BuiltTemplate>>,
    /// Clips of the instance for that version.
    clips: Option<UpdatedClips>,
}

/// An instance that goes on with another program.
struct Step<'a> {
    entity: Entity,
    runtime: Mut<'a, RigRuntime>,
    program: &'a Arc<RigProgram>,
    exchange: usize,
    /// The pose of the instance where its offsets have to change, so that its joints stand as before.
    kept: Option<KeptPose>,
    /// Nodes that have an offset for that and had none before.
    held: Vec<Uid>,
}

/// Gives every instance the program of its template: all of them in this frame, but those whose clips are being re-expressed.
pub(super) fn update_instances(world: &mut World) {
    let mut query = world.query::<(
        Entity,
        &RigInstance,
        &InstanceMode,
        Option<&ExposedNodes>,
        Option<&RunningTemplate>,
        Option<&RigRuntime>,
        Option<&RigClips>,
        Option<&ClipOrigin>,
    )>();
    let (mut due, mut failed) = (Vec::new(), Vec::new());
    let mut jobs = std::mem::take(&mut *world.resource_mut::<ClipJobs>());
    let mut is_waited_for = false;
    let templates = world.resource::<RigTemplates>();
    for (entity, instance, mode, exposed, running, runtime, clips, origin) in query.iter(world) {
        let Some(built) = templates.built.get(&instance.0.id()) else { continue };
        let is_fresh = runtime.is_none_or(|runtime| runtime.mode() != *mode);
        let is_other = running.is_none_or(|running| !Arc::ptr_eq(&running.0, built));
        let mut updated = None;
        if let (Some(running), Some(RigClips(clips)), true) = (running, clips, is_other) {
            updated = jobs.updated(&running.0, built, clips, origin, *mode);
            if updated.is_none() {
                is_waited_for = true;
                continue;
            }
        }
        let program = program(built, *mode, exposed).unwrap_or_else(|error| {
            let source = NamedProgramError::new(error, &built.rig);
            failed.push((entity, TemplateError::CannotRun { file: None, source }));
            built.lean.clone()
        });
        let runs_other = runtime.is_none_or(|runtime| !Arc::ptr_eq(runtime.state().program(), &program));
        if is_fresh || is_other || runs_other {
            let (built, mode, before) = (built.clone(), *mode, running.map(|running| running.0.clone()));
            due.push(DueInstance { entity, built, program, mode, is_fresh, is_other, before, clips: updated });
        }
    }
    jobs.tidy();
    world.insert_resource(jobs);
    world.resource_mut::<RigTemplates>().is_fresh = is_waited_for;
    for due in &due {
        give_updated_clips(world, due);
    }
    let (fresh, going): (Vec<DueInstance>, Vec<DueInstance>) = due.into_iter().partition(|due| due.is_fresh);
    for DueInstance { entity, built, program, mode, .. } in &fresh {
        despawn_nodes(world, *entity);
        spawn_instance(world, *entity, program, *mode);
        describe(world, *entity, &built.built.nodes);
        world.entity_mut(*entity).insert(RunningTemplate(built.clone()));
    }
    let (changed_nodes, mut kept, held) = exchange(world, &going);
    for ChangedNodes { entity, built, described } in &changed_nodes {
        match described {
            Some(nodes) => describe(world, *entity, nodes.iter().map(|node| &built.built.nodes[*node])),
            None => {
                furnish_instance(world, *entity);
                describe(world, *entity, &built.built.nodes);
            }
        }
    }
    for (entity, kept) in &kept {
        pose_controls(world, *entity, kept);
    }
    // What was shown of a clip is held in this frame; the next one shows the clip of this version.
    let is_re_expressed = |due: &&DueInstance| due.clips.as_ref().is_some_and(|clips| clips.origin.is_some());
    for DueInstance { entity, .. } in going.iter().filter(is_re_expressed) {
        if let Some(mut played) = world.get_mut::<PlayedClip>(*entity) {
            played.unpose(held.get(entity).map_or(&[], Vec::as_slice));
        }
    }
    for DueInstance { entity, .. } in fresh {
        world.trigger(RigBuilt { entity });
    }
    let mut known = Vec::new();
    let (as_before, same_clips): (Arc<[PoseNote]>, Arc<ClipReport>) = Default::default();
    for DueInstance { entity, built, before, clips, .. } in going.into_iter().filter(|due| due.is_other) {
        let deviations = kept.remove(&entity).map(|kept| kept.deviations).filter(|deviations| !deviations.is_empty());
        let noted = |list: Vec<Deviation>| -> Arc<[PoseNote]> {
            list.into_iter().map(|deviation| PoseNote { pose: None, deviation }).collect()
        };
        let poses = deviations.map_or_else(|| as_before.clone(), noted);
        let clips = clips.map_or_else(|| same_clips.clone(), |clips| clips.report);
        let changes = before.map_or_else(|| built.changes.clone(), |before| changes_since(&before, &built, &mut known));
        world.trigger(RigUpdated { entity, changes, ran: built.ran.clone(), poses, clips });
    }
    for (entity, error) in failed {
        world.trigger(RigFailed { entity, error });
    }
}

/// Differences between two builds that do not follow each other.
struct BuildChanges {
    from: Arc<BuiltTemplate>,
    to: Arc<BuiltTemplate>,
    changes: Arc<[Change]>,
}

/// Differences of a build from the one that an instance ran: the build before it, an older one, or one of another template.
fn changes_since(from: &Arc<BuiltTemplate>, to: &Arc<BuiltTemplate>, known: &mut Vec<BuildChanges>) -> Arc<[Change]> {
    if to.way.as_ref().is_some_and(|way| way.described_since(from).is_some()) {
        return to.changes.clone();
    }
    let is_it = |known: &&BuildChanges| Arc::ptr_eq(&known.from, from) && Arc::ptr_eq(&known.to, to);
    if let Some(known) = known.iter().find(is_it) {
        return known.changes.clone();
    }
    let changes: Arc<[Change]> = update(Some(&from.rig), &from.rig, &to.rig, Take::Theirs).changes.into();
    known.push(BuildChanges { from: from.clone(), to: to.clone(), changes: changes.clone() });
    changes
}

/// Gives an instance its clips for the version of its template that it goes on with.
fn give_updated_clips(world: &mut World, due: &DueInstance) {
    let Some(UpdatedClips { clips, origin, .. }) = &due.clips else { return };
    let Ok(mut entity) = world.get_entity_mut(due.entity) else { return };
    if entity.get::<RigClips>().is_none_or(|own| !Arc::ptr_eq(&own.0, clips)) {
        entity.insert(RigClips(clips.clone()));
    }
    if let Some(origin) = origin {
        entity.insert(origin.clone());
    }
}

fn program(
    built: &BuiltTemplate,
    mode: InstanceMode,
    exposed: Option<&ExposedNodes>,
) -> Result<Arc<RigProgram>, ProgramError> {
    match (mode, exposed) {
        (InstanceMode::Hierarchy, _) => Ok(built.whole.clone()),
        (InstanceMode::Direct, None) => Ok(built.lean.clone()),
        (InstanceMode::Direct, Some(ExposedNodes(exposed))) => built.exposing(exposed),
    }
}

/// An instance whose nodes are others now, or described otherwise.
struct ChangedNodes {
    entity: Entity,
    built: Arc<BuiltTemplate>,
    /// Indices of the built nodes that are described otherwise; `None` if the nodes themselves are others.
    described: Option<Arc<[usize]>>,
}

/// Nodes that are described otherwise in one build than in an earlier one, the same for all instances that ran that one.
struct ChangedDescriptions {
    from: Arc<BuiltTemplate>,
    to: Arc<BuiltTemplate>,
    /// Indices into the built nodes.
    nodes: Arc<[usize]>,
}

/// Lets instances go on with the programs of their templates. Returns instances whose nodes are others now or described
/// otherwise, the poses of instances whose offsets are others now, and the nodes that have an offset only since.
fn exchange(
    world: &mut World,
    going: &[DueInstance],
) -> (Vec<ChangedNodes>, EntityHashMap<KeptPose>, EntityHashMap<Vec<Uid>>) {
    let wanted: EntityHashMap<&DueInstance> = going.iter().map(|due| (due.entity, due)).collect();
    let mut query = world.query::<(Entity, &mut RigRuntime, &mut RunningTemplate)>();
    let mut exchanges: Vec<Arc<Exchange>> = Vec::new();
    let mut descriptions: Vec<ChangedDescriptions> = Vec::new();
    let (mut steps, mut others) = (Vec::new(), Vec::new());
    for (entity, runtime, mut running) in query.iter_mut(world) {
        let Some(DueInstance { built, program: to, .. }) = wanted.get(&entity) else { continue };
        let before = std::mem::replace(&mut running.0, built.clone());
        let earlier = before.clone();
        let known =
            descriptions.iter().find(|known| Arc::ptr_eq(&known.from, &before) && Arc::ptr_eq(&known.to, built));
        let described = known.map(|known| known.nodes.clone()).unwrap_or_else(|| {
            let prepared = built.way.as_ref().and_then(|way| way.described_since(&before)).cloned();
            let nodes = prepared.unwrap_or_else(|| described_otherwise(&before.built, &built.built).into());
            descriptions.push(ChangedDescriptions { from: before, to: built.clone(), nodes: nodes.clone() });
            nodes
        });
        let from = runtime.state().program();
        // The rest of the document may have changed, and the program not.
        if Arc::ptr_eq(from, to) {
            if !described.is_empty() {
                others.push(ChangedNodes { entity, built: built.clone(), described: Some(described) });
            }
            continue;
        }
        let known = exchanges.iter().position(|known| known.is_between(from, to));
        let number = known.unwrap_or_else(|| {
            let prepared = built.way.as_ref().and_then(|way| way.exchange(from, to)).cloned();
            exchanges.push(prepared.unwrap_or_else(|| {
                let versions = ((&*earlier.rig, &*earlier.built), (&*built.rig, &*built.built));
                Arc::new(Exchange::between(from, to, &Arc::new(MovedNodes::between(versions.0, versions.1))))
            }));
            exchanges.len() - 1
        });
        let is_other = exchanges[number].is_other;
        if is_other || !described.is_empty() {
            others.push(ChangedNodes {
                entity,
                built: built.clone(),
                described: Some(described).filter(|_| !is_other),
            });
        }
        steps.push(Step { entity, runtime, program: to, exchange: number, kept: None, held: Vec::new() });
    }
    steps.par_iter_mut().for_each(|Step { runtime, program, exchange, kept, held, .. }| {
        let Exchange { carry, keeper, moved, .. } = &*exchanges[*exchange];
        let mut carried_values = AttributeValues::new();
        if let Some(keeper) = keeper {
            let (offsets, values) = pose_of(runtime.state());
            let ([staying, carried], [values, settings]) = (moved.split_offsets(&offsets), moved.split_values(&values));
            carried_values = settings;
            let mut pose = keeper.keep(&staying, &values);
            *held = pose.offsets.keys().filter(|node| !offsets.contains_key(*node)).copied().collect();
            pose.offsets.extend(carried);
            *kept = Some(pose).filter(|kept| kept.offsets != offsets || !kept.deviations.is_empty());
            if kept.is_none() {
                held.clear();
            }
        }
        // Where nodes and entities stay as they are, the run marks the instances of which something is another.
        let changed = if carry.is_aligned() { runtime.bypass_change_detection() } else { &mut **runtime };
        changed.exchange(program, carry);
        for slot in 0..program.nodes().len() {
            let Some(kept) = kept else { break };
            let offset = kept.offsets.get(&program.nodes()[slot].uid).copied().unwrap_or_default();
            runtime.state_mut().set_offset_at(slot, offset);
        }
        for (node, values) in &carried_values {
            for (name, value) in values {
                if let Some(slot) = program.attribute(*node, name) {
                    runtime.state_mut().set_attribute_at(slot, *value);
                }
            }
        }
    });
    let mut held: EntityHashMap<Vec<Uid>> = EntityHashMap::default();
    let mut kept: EntityHashMap<KeptPose> = EntityHashMap::default();
    // Most exchanges leave poses alone.
    for Step { entity, kept: pose, held: nodes, .. } in steps {
        let Some(pose) = pose else { continue };
        held.insert(entity, nodes);
        kept.insert(entity, pose);
    }
    (others, kept, held)
}

/// Offsets and attribute values of an instance.
fn pose_of(state: &RigState) -> (BTreeMap<Uid, PoseOffset>, AttributeValues) {
    let program = state.program();
    let offsets = program.nodes().iter().enumerate().map(|(slot, node)| (node.uid, state.offset_at(slot)));
    let offsets = offsets.filter(|(_, offset)| *offset != PoseOffset::IDENTITY).collect();
    let mut values = AttributeValues::new();
    for (slot, attribute) in program.attributes().iter().enumerate().filter(|(_, known)| known.is_settable) {
        let of = values.entry(program.nodes()[attribute.node].uid).or_default();
        of.insert(attribute.name.to_string(), state.attribute_at(slot));
    }
    (offsets, values)
}

/// Writes the offsets of a pose to the controls of an instance that are posed by their [`ControlPose`].
fn pose_controls(world: &mut World, instance: Entity, kept: &KeptPose) {
    let Some(runtime) = world.get::<RigRuntime>(instance) else { return };
    let nodes = runtime.state().program().clone();
    let entities: Vec<(Entity, Uid)> =
        nodes.nodes().iter().enumerate().filter_map(|(slot, node)| Some((runtime.entity(slot)?, node.uid))).collect();
    for (entity, uid) in entities {
        if let Some(mut pose) = world.get_mut::<ControlPose>(entity) {
            pose.set_if_neq(kept.offsets.get(&uid).copied().unwrap_or_default().into());
        }
    }
}

/// Writes the components that describe built nodes to the entities that an instance has of them.
fn describe<'a>(world: &mut World, instance: Entity, nodes: impl IntoIterator<Item = &'a BuiltNode>) {
    let Some(runtime) = world.get::<RigRuntime>(instance) else { return };
    let entity_of = |node: &'a BuiltNode| {
        let slot = runtime.state().program().node(node.uid)?;
        Some((runtime.entity(slot)?, node))
    };
    let described: Vec<(Entity, &BuiltNode)> = nodes.into_iter().filter_map(entity_of).collect();
    for (entity, node) in described {
        let Ok(mut entity) = world.get_entity_mut(entity) else { continue };
        if entity.get::<Name>().map(Name::as_str) != Some(&*node.name) {
            entity.insert(Name::new(node.name.to_string()));
        }
        set(&mut entity, node.label.as_deref().map(|label| NodeLabel(label.to_owned())));
        if node.origin.is_none() && !entity.contains::<Joint>() {
            // A joint of the document without weights.
            let is_local = entity.contains::<Transform>();
            entity.insert(Joint);
            if !is_local {
                entity.remove::<(Transform, TransformTreeChanged)>();
            }
        }
        // A program without a hierarchy has other parents for some nodes.
        set(&mut entity, Some(RestTransform::from(node.base)));
        set(&mut entity, node.control.as_deref().map(|control| Control(control.clone())));
        set(&mut entity, node.layer.as_deref().map(|layer| NodeLayer(layer.clone())));
        set(
            &mut entity,
            node.origin.as_ref().map(|origin| CreatedRole {
                role: origin.role.to_string(),
                subject: origin.subject,
                number: origin.number,
            }),
        );
    }
}

/// Writes a component where it differs; takes it off for `None`.
fn set<C: Component + PartialEq>(entity: &mut EntityWorldMut, wanted: Option<C>) {
    if entity.get::<C>() == wanted.as_ref() {
        return;
    }
    match wanted {
        Some(wanted) => entity.insert(wanted),
        None => entity.remove::<C>(),
    };
}

/// Despawns the nodes of an entity that is no instance any more.
pub(super) fn leave(removed: On<Remove, RigInstance>, mut commands: Commands) {
    if let Ok(mut entity) = commands.get_entity(removed.entity) {
        entity.queue_silenced(|mut entity: EntityWorldMut| {
            // Replacing the component is no leaving.
            if !entity.contains::<RigInstance>() {
                let instance = entity.id();
                entity.world_scope(|world| despawn_nodes(world, instance));
                entity.remove::<(RigRuntime, RunningTemplate)>();
            }
        });
    }
}
