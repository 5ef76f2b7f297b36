//! Answers to calls that took a frame or more.

use std::{
    sync::{Arc, mpsc::Sender},
    time::Instant,
};

use bevy::{ecs::message::MessageId, prelude::*};
use serde_json::{Value, json};

use super::{Answer, RemoteServer, error::CallError};
use crate::{
    instance::{
        AcceptUpdate, BuiltTemplate, RigBuilt, RigFailed, RigSource, RigTemplate, RigTemplates, RigUpdated,
        TemplateError, UpdateOffer,
    },
    plugins::{
        commands::BuildDone,
        document::{EditRefusal, EditReport, EditRequest},
    },
    rig::update::{Change, Take},
};

/// A call that waits for its answer.
pub(super) struct PendingCall {
    pub awaited: AwaitedEvent,
    pub reply: Sender<Answer>,
    pub until: Instant,
}

/// Event that answers a call.
pub(super) enum AwaitedEvent {
    /// A change.
    Edit { request: MessageId<EditRequest> },
    /// A run of commands.
    Build { rig: Entity },
    /// A template that is loaded and built.
    Load { rig: Entity },
    /// A file that is taken over.
    Update {
        rig: Entity,
        template: Handle<RigTemplate>,
        /// Former build of the template.
        before: Option<Arc<BuiltTemplate>>,
        /// True if that is the file's content already.
        is_known: bool,
        take: Take,
        /// Changes of the offer that was accepted.
        changes: Option<Arc<[Change]>>,
    },
}

/// An event of an instance.
pub(super) enum Sign {
    Built(Entity),
    Updated(RigUpdated),
    Failed(Entity, TemplateError),
}

impl Sign {
    fn rig(&self) -> Entity {
        match self {
            Self::Built(rig) | Self::Failed(rig, _) => *rig,
            Self::Updated(updated) => updated.entity,
        }
    }
}

pub(super) fn observe(app: &mut App) {
    app.add_observer(|built: On<RigBuilt>, server: Option<ResMut<RemoteServer>>| {
        note(server, Sign::Built(built.entity))
    })
    .add_observer(|updated: On<RigUpdated>, server: Option<ResMut<RemoteServer>>| {
        note(server, Sign::Updated(updated.clone()));
    })
    .add_observer(|failed: On<RigFailed>, server: Option<ResMut<RemoteServer>>| {
        note(server, Sign::Failed(failed.entity, failed.error.clone()));
    });
}

fn note(server: Option<ResMut<RemoteServer>>, sign: Sign) {
    if let Some(mut server) = server.filter(|server| !server.pending.is_empty()) {
        server.signs.push(sign);
    }
}

/// Answers calls whose events have come.
pub(super) fn answer_calls(
    mut server: ResMut<RemoteServer>,
    mut edited: MessageReader<EditReport>,
    mut refused: MessageReader<EditRefusal>,
    mut done: MessageReader<BuildDone>,
    sources: Query<(&RigSource, Option<&UpdateOffer>)>,
    templates: Res<RigTemplates>,
    mut accepted: MessageWriter<AcceptUpdate>,
    mut commands: Commands,
) {
    let edited: Vec<&EditReport> = edited.read().collect();
    let refused: Vec<&EditRefusal> = refused.read().collect();
    let done: Vec<&BuildDone> = done.read().collect();
    let server = server.bypass_change_detection();
    let signs = std::mem::take(&mut server.signs);
    server.pending.retain_mut(|pending| {
        let answer = match &mut pending.awaited {
            AwaitedEvent::Edit { request } => edit_answer(*request, &edited, &refused),
            AwaitedEvent::Build { rig } => {
                let report = done.iter().rfind(|done| done.rig == *rig).map(|done| &done.report);
                report.map(|report| {
                    let error = report.error.as_ref().map(ToString::to_string);
                    Ok(json!({"executed": report.executed, "cursor": report.cursor, "error": error}))
                })
            }
            AwaitedEvent::Load { rig } => signs.iter().find(|sign| sign.rig() == *rig).map(|sign| match sign {
                Sign::Failed(rig, error) => {
                    commands.entity(*rig).try_despawn();
                    Err(CallError::Template(error.clone()))
                }
                Sign::Built(_) | Sign::Updated(_) => Ok(json!({"rig": rig.to_bits()})),
            }),
            awaited @ AwaitedEvent::Update { .. } => {
                update_answer(awaited, &signs, &sources, &templates, &mut accepted)
            }
        };
        match answer {
            Some(answer) => {
                // The connection may have gone; then nobody reads it.
                let _ = pending.reply.send(answer);
                false
            }
            None if pending.until <= Instant::now() => {
                if let AwaitedEvent::Load { rig } = pending.awaited {
                    commands.entity(rig).try_despawn();
                }
                false
            }
            None => true,
        }
    });
}

fn edit_answer(request: MessageId<EditRequest>, edited: &[&EditReport], refused: &[&EditRefusal]) -> Option<Answer> {
    if let Some(edited) = edited.iter().find(|edited| edited.request == Some(request)) {
        let changed = edited.committed.is_some();
        return Some(Ok(json!({"changed": changed, "step": edited.name, "notes": edited.notes})));
    }
    let refused = refused.iter().find(|refused| refused.request == Some(request))?;
    Some(Err(CallError::Refused(refused.reason.clone())))
}

fn update_answer(
    awaited: &mut AwaitedEvent,
    signs: &[Sign],
    sources: &Query<(&RigSource, Option<&UpdateOffer>)>,
    templates: &RigTemplates,
    accepted: &mut MessageWriter<AcceptUpdate>,
) -> Option<Answer> {
    let AwaitedEvent::Update { rig, template, before, is_known, take, changes } = awaited else { return None };
    let told = |changes: &[Change], ran: Value, poses: Vec<String>, clips: Vec<String>| {
        Some(Ok(json!({"changes": changes, "ran": ran, "poses": poses, "clips": clips})))
    };
    for sign in signs.iter().filter(|sign| sign.rig() == *rig) {
        match sign {
            Sign::Failed(_, error) => return Some(Err(CallError::Template(error.clone()))),
            Sign::Updated(updated) => {
                let poses = updated.poses.iter().map(ToString::to_string).collect();
                let changes = changes.as_ref().unwrap_or(&updated.changes);
                return told(changes, json!(*updated.ran), poses, updated.clips.lines());
            }
            Sign::Built(_) => {}
        }
    }
    let Ok((source, offer)) = sources.get(*rig) else { return Some(Err(CallError::NoRig(rig.to_bits().to_string()))) };
    let built = templates.built(template)?;
    let is_new = before.as_ref().is_none_or(|before| !Arc::ptr_eq(before, built));
    if !(is_new || *is_known) || !source.has_seen(built) {
        return None;
    }
    match offer {
        Some(offer) if changes.is_none() => {
            *changes = Some(offer.changes.clone());
            accepted.write(AcceptUpdate { rig: *rig, choices: (*take).into() });
            None
        }
        Some(_) => None,
        None if source.is_settled() => told(changes.as_deref().unwrap_or_default(), json!([]), Vec::new(), Vec::new()),
        None => None,
    }
}
