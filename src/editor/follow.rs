//! The open template's file: when it changes on the disk, the window says what would change, and takes it over.

use std::{sync::Arc, time::Duration};

use bevy::{prelude::*, window::RequestRedraw};

use super::{
    ActiveRig,
    counts::counted,
    files::{OpenDocument, attend},
    notice::Notice,
};
use crate::{
    instance::{AcceptUpdate, RigFailed, RigInstancePlugin, RigSource, RigUpdated, TemplateFiles, UpdateOffer},
    plugins::history::RigHistory,
    rig::{
        Rig,
        update::{Choices, Take},
    },
};

/// Time between two looks at the file.
const LOOK: Duration = Duration::from_millis(250);

/// Plugin that follows the template of the open document.
pub struct FollowPlugin;

impl Plugin for FollowPlugin {
    fn build(&self, app: &mut App) {
        app.add_plugins(RigInstancePlugin { live: true, look: LOOK, ..default() })
            .add_message::<OfferAnswer>()
            .add_message::<Notice>()
            .add_message::<RequestRedraw>()
            .add_systems(Update, (follow, answer, tell_offer).chain().after(attend))
            .add_systems(Last, draw_on)
            .add_observer(tell_update)
            .add_observer(tell_failure);
    }
}

/// Answer to the offer of the open rig's template.
#[derive(Message, Debug, Clone, PartialEq, Eq)]
pub enum OfferAnswer {
    /// Takes it over; where both changed a field, the value of this side.
    Take(Take),
    /// Takes it over; where both changed a field, the value that is chosen there.
    Choose(Choices),
    /// Takes it over, and everything that the file brings from now on.
    TakeAlways,
    /// Takes everything over that the file brings from now on, unless both changed a field; or asks from now on.
    Live(bool),
    /// Leaves the rig as it is until the file changes again.
    Leave,
}

/// Lets documents that were opened from a template follow its file.
fn follow(
    opened: Query<(Entity, &OpenDocument, &Rig, &RigHistory), Without<RigSource>>,
    files: TemplateFiles,
    mut commands: Commands,
) {
    for (entity, document, rig, history) in &opened {
        if let Some(template) = &document.template {
            // Meshes are skinned when the user says so.
            let source = RigSource::new(files.open(template.clone())).without_binding();
            // Recovered work has come from the file too, and nobody knows how the file was then.
            let is_as_opened = history.last().is_none();
            let source = match &document.base {
                Some(base) => source.with_kept_base(base, template),
                None if is_as_opened => source.with_base(Arc::new(rig.clone())),
                None => source.of_first_version(),
            };
            commands.entity(entity).try_insert(source);
        }
    }
}

fn answer(
    mut answers: MessageReader<OfferAnswer>,
    rig: Option<Res<ActiveRig>>,
    mut sources: Query<(&mut RigSource, Option<&UpdateOffer>)>,
    mut accepted: MessageWriter<AcceptUpdate>,
    mut commands: Commands,
) {
    let Some(rig) = rig.map(|rig| rig.0) else {
        answers.clear();
        return;
    };
    for answer in answers.read() {
        let mut accept = |choices: Choices| {
            accepted.write(AcceptUpdate { rig, choices });
        };
        match answer {
            OfferAnswer::Take(take) => accept((*take).into()),
            OfferAnswer::Choose(choices) => accept(choices.clone()),
            OfferAnswer::TakeAlways => {
                if let Ok((mut source, _)) = sources.get_mut(rig) {
                    source.is_live = true;
                }
                accept(Take::Mine.into());
            }
            OfferAnswer::Live(is_live) => {
                let Ok((mut source, offer)) = sources.get_mut(rig) else { continue };
                source.is_live = *is_live;
                let is_free = offer.is_some_and(|offer| offer.changes.iter().all(|change| !change.conflict));
                if *is_live && is_free {
                    accept(Take::Mine.into());
                }
            }
            OfferAnswer::Leave => {
                commands.entity(rig).try_remove::<UpdateOffer>();
            }
        }
    }
}

/// Tells that the file of the open rig has changed; the Updater lists how.
fn tell_offer(offers: Query<&UpdateOffer, Added<UpdateOffer>>, active: Option<Res<ActiveRig>>, mut commands: Commands) {
    let Some(offer) = active.and_then(|active| offers.get(active.0).ok()) else { return };
    let text = format!("The template's file has changed: {}. The Updater lists them", counts(offer));
    commands.write_message(Notice::info(text).at("Updater"));
}

/// Number of changes and conflicts of an offer, in words.
pub(super) fn counts(offer: &UpdateOffer) -> String {
    let conflicts = offer.changes.iter().filter(|change| change.conflict).count();
    let changes = counted(offer.changes.len(), "change", "changes");
    match conflicts {
        0 => changes,
        count => format!("{changes}, {}", counted(count, "conflict", "conflicts")),
    }
}

/// The open rig's offer, if its template's file has changed.
pub(super) fn offer(world: &World) -> Option<&UpdateOffer> {
    world.get::<UpdateOffer>(world.get_resource::<ActiveRig>()?.0)
}

/// Asks for another frame after one in which a template brought something: an offer is told, and an update carried out, in the
/// next frame, and a window that sleeps draws one frame when it is woken.
fn draw_on(sources: Query<(), Changed<RigSource>>, mut commands: Commands) {
    if !sources.is_empty() {
        commands.write_message(RequestRedraw);
    }
}

fn tell_update(updated: On<RigUpdated>, documents: Query<&OpenDocument>, mut notices: MessageWriter<Notice>) {
    let Ok(document) = documents.get(updated.entity) else { return };
    let count = counted(updated.changes.len(), "change", "changes");
    let text = format!("{}: {count} taken over from the file; Ctrl+Z takes it back", document.name);
    notices.write(Notice::done(text).named());
    for note in updated.poses.iter() {
        notices.write(Notice::warning(note.to_string()).named().quiet());
    }
    if !updated.poses.is_empty() {
        let text = "Some joints do not stand as before in poses; the log lists them";
        notices.write(Notice::warning(text));
    }
    for line in updated.clips.lines() {
        notices.write(Notice::warning(line).named().quiet());
    }
    if !updated.clips.notes.is_empty() {
        notices.write(Notice::warning("Some joints do not move as before in clips; the log lists them"));
    }
    if !updated.clips.set_aside.is_empty() {
        let text = "Keys of nodes that are gone are set aside until the nodes are back; the log lists them";
        notices.write(Notice::warning(text));
    }
}

fn tell_failure(failed: On<RigFailed>, documents: Query<&OpenDocument>, mut notices: MessageWriter<Notice>) {
    if documents.contains(failed.entity) {
        notices.write(Notice::error(format!("The changed file is not taken over: {}", failed.error)));
    }
}
