//! Calls in the main world: what is known is answered at once, what takes a frame is asked for.

use std::path::PathBuf;

use bevy::{ecs::system::RunSystemOnce, prelude::*};
use serde::{Deserialize, de::DeserializeOwned};
use serde_json::{Value, json};

use super::{
    Call, RemoteServer,
    answers::{AwaitedEvent, PendingCall},
    error::CallError,
    schema::Verb,
};
use crate::{
    files::{FileKind, PartFiles, RealDisk, read_capped, store_document_over},
    instance::{RigSource, RigTemplate, RigTemplates, RunningTemplate, TemplateError, TemplateFiles, UpdateOffer},
    plugins::{
        commands::{BuildFailure, BuildRequest, BuildResult, BuildStep, Processor, RigModules},
        document::{Change, EditRequest},
    },
    rig::{
        Rig, RigEdit,
        operations::Operation,
        template::{MAX_BYTES, write_template},
        update::Take,
    },
};

/// Name of the step that a call is in the history.
const REMOTE_EDIT: &str = "Remote edit";

/// The file that a rig was loaded from.
#[derive(Component, Debug, Clone)]
pub(super) struct RemoteFile(PathBuf);

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct NoParams {}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct DescribeParams {
    rig: RigName,
    #[serde(default)]
    text: bool,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct EditParams {
    rig: RigName,
    edits: Option<Vec<RigEdit>>,
    history: Option<History>,
}

#[derive(Deserialize, Clone, Copy)]
#[serde(rename_all = "snake_case")]
enum History {
    Undo,
    Redo,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct BuildParams {
    rig: RigName,
    #[serde(default)]
    restart: bool,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct StepParams {
    rig: RigName,
    to: StepTo,
}

#[derive(Deserialize)]
#[serde(untagged)]
enum StepTo {
    Place(usize),
    Named(NamedStep),
}

#[derive(Deserialize)]
#[serde(rename_all = "snake_case")]
enum NamedStep {
    Run,
    Forward,
    Back,
    JointForward,
    JointBack,
    RollBack,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct LoadParams {
    path: PathBuf,
    #[serde(default)]
    live: bool,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct SaveParams {
    rig: RigName,
    path: Option<PathBuf>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct UpdateParams {
    rig: RigName,
    path: Option<PathBuf>,
    #[serde(default)]
    take: Side,
    #[serde(default)]
    dry_run: bool,
}

#[derive(Deserialize, Default, Clone, Copy)]
#[serde(rename_all = "snake_case")]
enum Side {
    #[default]
    Mine,
    Theirs,
}

/// A rig as calls name it.
#[derive(Deserialize, Clone)]
#[serde(untagged)]
enum RigName {
    Number(u64),
    Text(String),
}

impl std::fmt::Display for RigName {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Number(number) => number.fmt(f),
            Self::Text(text) => write!(f, "\"{text}\""),
        }
    }
}

/// A call that is answered, or waits for its answer.
enum StartedCall {
    Answered(Value),
    Waits(AwaitedEvent),
}

/// Carries out the calls that have come.
pub(super) fn take_calls(world: &mut World) {
    let received = world.resource::<RemoteServer>().received();
    for call in received {
        if call.until <= std::time::Instant::now() {
            continue;
        }
        let Call { verb, params, reply, until } = call;
        match start(world, verb, params) {
            // Nobody waits any more if the connection's time is over.
            Ok(StartedCall::Answered(value)) => drop(reply.send(Ok(value))),
            Err(error) => drop(reply.send(Err(error))),
            Ok(StartedCall::Waits(awaited)) => {
                world.resource_mut::<RemoteServer>().pending.push(PendingCall { awaited, reply, until });
            }
        }
    }
}

fn start(world: &mut World, verb: Verb, params: Value) -> Result<StartedCall, CallError> {
    match verb {
        Verb::List => {
            let NoParams {} = read(verb, params)?;
            Ok(StartedCall::Answered(list(world)))
        }
        Verb::Describe => describe(world, read(verb, params)?).map(StartedCall::Answered),
        Verb::Edit => edit(world, read(verb, params)?).map(StartedCall::Waits),
        Verb::Build => {
            let params: BuildParams = read(verb, params)?;
            build(world, &params.rig, if params.restart { BuildStep::Restart } else { BuildStep::All })
        }
        Verb::Step => {
            let params: StepParams = read(verb, params)?;
            let step = match params.to {
                StepTo::Place(place) => BuildStep::To(place),
                StepTo::Named(NamedStep::Run) => BuildStep::Run,
                StepTo::Named(NamedStep::Forward) => BuildStep::Forward,
                StepTo::Named(NamedStep::Back) => BuildStep::Back,
                StepTo::Named(NamedStep::JointForward) => BuildStep::JointForward,
                StepTo::Named(NamedStep::JointBack) => BuildStep::JointBack,
                StepTo::Named(NamedStep::RollBack) => BuildStep::RollBack,
            };
            build(world, &params.rig, step)
        }
        Verb::Load => load(world, read(verb, params)?).map(StartedCall::Waits),
        Verb::Save => save(world, read(verb, params)?).map(StartedCall::Answered),
        Verb::Update => renew(world, read(verb, params)?),
    }
}

fn read<T: DeserializeOwned>(verb: Verb, params: Value) -> Result<T, CallError> {
    serde_json::from_value(params).map_err(|source| CallError::Params { method: verb.name(), source })
}

/// All rigs, documents and instances, in the order of their numbers.
fn rigs(world: &mut World) -> Vec<Entity> {
    let mut query = world.query_filtered::<Entity, Or<(With<Rig>, With<RunningTemplate>)>>();
    let mut found: Vec<Entity> = query.iter(world).collect();
    found.sort_unstable_by_key(|entity| entity.to_bits());
    found
}

/// The rig of a document or of an instance's template.
fn rig_of(world: &World, entity: Entity) -> Option<&Rig> {
    let template = || world.get::<RunningTemplate>(entity).map(|running| &*running.get().rig);
    world.get::<Rig>(entity).or_else(template)
}

fn find(world: &mut World, name: &RigName) -> Result<Entity, CallError> {
    let all = rigs(world);
    match name {
        RigName::Number(number) => all.into_iter().find(|entity| entity.to_bits() == *number),
        RigName::Text(text) => {
            let is_called = |rig: &Rig| rig.about().name == *text || rig.uid().to_string() == *text;
            let named: Vec<Entity> =
                all.into_iter().filter(|entity| rig_of(world, *entity).is_some_and(is_called)).collect();
            if named.len() > 1 {
                return Err(CallError::Ambiguous { name: text.clone(), count: named.len() });
            }
            named.first().copied()
        }
    }
    .ok_or_else(|| CallError::NoRig(name.to_string()))
}

/// The entity of a rig with a document, and the document.
fn document<'w>(world: &'w mut World, name: &RigName) -> Result<(Entity, &'w Rig), CallError> {
    let entity = find(world, name)?;
    let rig = world.get::<Rig>(entity).ok_or_else(|| CallError::NoDocument(name.to_string()))?;
    Ok((entity, rig))
}

fn list(world: &mut World) -> Value {
    let all = rigs(world);
    let row = |entity: Entity| {
        let rig = rig_of(world, entity)?;
        let is_document = world.get::<Rig>(entity).is_some();
        Some(json!({
            "rig": entity.to_bits(),
            "uid": rig.uid().to_string(),
            "name": rig.about().name,
            "joints": rig.len(),
            "is_document": is_document,
            "is_built": !is_document || world.get::<BuildResult>(entity).is_some(),
        }))
    };
    all.into_iter().filter_map(row).collect()
}

fn describe(world: &mut World, params: DescribeParams) -> Result<Value, CallError> {
    let entity = find(world, &params.rig)?;
    let rig = rig_of(world, entity).ok_or_else(|| CallError::NoRig(params.rig.to_string()))?;
    let joint = |joint: &crate::rig::RigJoint| json!({"parent": joint.parent, "joint": joint.data});
    let running = world.get::<RunningTemplate>(entity).map(|running| &running.get().built);
    let built = world.get::<BuildResult>(entity).map(|built| &built.0).or(running);
    let node = |node: &crate::rig::BuiltNode| {
        let is_control = node.control.is_some();
        json!({"uid": node.uid, "name": &*node.name, "label": node.label.as_deref(), "is_control": is_control})
    };
    let mut told = json!({
        "rig": entity.to_bits(),
        "uid": rig.uid(),
        "name": rig.about().name,
        "about": rig.about(),
        "joints": rig.walk().map(joint).collect::<Vec<_>>(),
        "commands": world.get::<Processor>(entity).map(commands).unwrap_or_default(),
        "nodes": built.map(|built| built.nodes.iter().map(node).collect::<Vec<_>>()).unwrap_or_default(),
        "error": world.get::<BuildFailure>(entity).map(|failure| failure.0.to_string()),
    });
    if params.text {
        told["text"] = write_template(rig).into();
    }
    Ok(told)
}

fn commands(processor: &Processor) -> Vec<Value> {
    let builder = processor.builder();
    let row = |tag| {
        let status = builder.status(tag)?;
        let error = status.error.map(|error| error.to_string());
        Some(json!({"tag": tag, "state": status.state, "error": error}))
    };
    builder.list().into_iter().filter_map(|entry| row(entry.command)).collect()
}

fn edit(world: &mut World, params: EditParams) -> Result<AwaitedEvent, CallError> {
    let (rig, _) = document(world, &params.rig)?;
    let change = match (params.edits, params.history) {
        (Some(edits), None) => Change::Do(Operation::Named { name: REMOTE_EDIT, edits }),
        (None, Some(History::Undo)) => Change::Undo,
        (None, Some(History::Redo)) => Change::Redo,
        _ => return Err(CallError::NotTogether("give either `edits` or `history`")),
    };
    let request = world.resource_mut::<Messages<EditRequest>>().write(EditRequest { rig, change });
    Ok(AwaitedEvent::Edit { request })
}

fn build(world: &mut World, name: &RigName, step: BuildStep) -> Result<StartedCall, CallError> {
    let (rig, _) = document(world, name)?;
    world.write_message(BuildRequest { rig, step });
    Ok(StartedCall::Waits(AwaitedEvent::Build { rig }))
}

fn load(world: &mut World, params: LoadParams) -> Result<AwaitedEvent, CallError> {
    let gate = world.resource::<RemoteServer>().gate.clone();
    let path = gate.folders.existing(template_path(&params.path)?)?;
    let opened = path.clone();
    let template = world.run_system_once(move |files: TemplateFiles| files.open(opened.clone()));
    let template = template.map_err(|_| CallError::Ended)?;
    let source = if params.live { RigSource::live(template) } else { RigSource::new(template) };
    let rig = world.spawn((source, RemoteFile(path))).id();
    Ok(AwaitedEvent::Load { rig })
}

fn template_path(path: &std::path::Path) -> Result<&std::path::Path, CallError> {
    let is_template = FileKind::of(path) == Some(FileKind::Template);
    if is_template { Ok(path) } else { Err(CallError::NoTemplateName(path.to_owned())) }
}

fn save(world: &mut World, params: SaveParams) -> Result<Value, CallError> {
    let gate = world.resource::<RemoteServer>().gate.clone();
    let (entity, _) = document(world, &params.rig)?;
    let own = world.get::<RemoteFile>(entity).map(|file| file.0.clone());
    let path = match (&params.path, &own) {
        (Some(path), _) => gate.folders.target(template_path(path)?)?,
        // It may be a link by now.
        (None, Some(own)) => gate.folders.target(own)?,
        (None, None) => return Err(CallError::NoFile(params.rig.to_string())),
    };
    let Some(rig) = world.get::<Rig>(entity).cloned() else { return Err(CallError::NoRig(params.rig.to_string())) };
    let sources: Vec<&std::path::Path> =
        [Some(&path), own.as_ref()].into_iter().flatten().map(|path| &**path).collect();
    let source = world.get::<RigSource>(entity);
    let base = source.map(RigSource::taken_over).unwrap_or_default();
    let notes = store_document_over(&RealDisk, &path, &rig, base, &sources)?;
    if own.as_ref() == Some(&path)
        && let Some(mut source) = world.get_mut::<RigSource>(entity)
    {
        source.rebase(rig.into());
    }
    Ok(json!({"path": path.display().to_string(), "notes": notes}))
}

fn renew(world: &mut World, params: UpdateParams) -> Result<StartedCall, CallError> {
    let gate = world.resource::<RemoteServer>().gate.clone();
    let (entity, rig) = document(world, &params.rig)?;
    let rig = rig.clone();
    let own = world.get::<RemoteFile>(entity).map(|file| file.0.clone());
    let path = match (&params.path, own) {
        (Some(path), _) => gate.folders.existing(template_path(path)?)?,
        (None, Some(own)) => gate.folders.existing(&own)?,
        (None, None) => return Err(CallError::NoFile(params.rig.to_string())),
    };
    let Some(source) = world.get::<RigSource>(entity) else {
        return Err(CallError::NoTemplate(params.rig.to_string()));
    };
    let take = match params.take {
        Side::Mine => Take::Mine,
        Side::Theirs => Take::Theirs,
    };
    let content = read_capped(&RealDisk, &path, MAX_BYTES as u64)?;
    let modules = world.resource::<RigModules>().0.clone();
    let mut files = PartFiles::with_modules(&RealDisk, modules.clone());
    let read = RigTemplate::read_with_parts(&content, &path, &mut files);
    let file = read.map_err(|source| TemplateError::Source { file: Some(path), source })?;
    if params.dry_run {
        let changes = source.changes_to(&rig, &file, &take.into());
        return Ok(StartedCall::Answered(json!({"changes": changes, "ran": [], "poses": [], "clips": []})));
    }
    let template = source.template.clone();
    let before = world.resource::<RigTemplates>().built(&template).cloned();
    let is_known = before.as_ref().is_some_and(|before| before.is_of(&file));
    if is_known && world.get::<UpdateOffer>(entity).is_none() {
        return Ok(StartedCall::Answered(json!({"changes": [], "ran": [], "poses": [], "clips": []})));
    }
    if !is_known {
        let offered = template.clone();
        let sent = world.run_system_once(move |files: TemplateFiles| files.offer(&offered, content.clone()));
        sent.map_err(|_| CallError::Ended)?;
    }
    Ok(StartedCall::Waits(AwaitedEvent::Update { rig: entity, template, before, is_known, take, changes: None }))
}
