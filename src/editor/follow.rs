//! The open template's file: when it changes on the disk, the window says what would change, and takes it over.

use std::{sync::Arc, time::Duration};

use bevy::{prelude::*, winit::WinitSettings};
use bevy_egui::egui;

use super::{
    ActiveRig,
    files::{OpenDocument, attend},
    notice::Notice,
    panel::{EditorOverlay, PanelApp, Requests},
};
use crate::{
    instance::{AcceptUpdate, RigFailed, RigInstancePlugin, RigSource, RigUpdated, TemplateFiles, UpdateOffer},
    plugins::history::RigHistory,
    rig::{Rig, update::Take},
};

/// Time between two looks at the file, and between two frames of a window that follows one.
const LOOK: Duration = Duration::from_millis(250);
const FRAME: Duration = Duration::from_secs(1);

/// Plugin that follows the template of the open document.
pub struct FollowPlugin;

impl Plugin for FollowPlugin {
    fn build(&self, app: &mut App) {
        app.add_plugins(RigInstancePlugin { live: true, look: LOOK, ..default() })
            .add_message::<OfferAnswer>()
            .add_message::<Notice>()
            .add_overlay(OfferView)
            .add_systems(Update, (follow, answer, wake.run_if(resource_exists::<WinitSettings>)).chain().after(attend))
            .add_observer(tell_update)
            .add_observer(tell_failure);
    }
}

/// Answer to the offer of the open rig's template.
#[derive(Message, Debug, Clone, Copy, PartialEq, Eq)]
pub enum OfferAnswer {
    /// Takes it over; where both changed a field, the value of this side.
    Take(Take),
    /// Takes it over, and everything that the file brings from now on.
    TakeAlways,
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
                Some(base) => source.with_base(base.clone()),
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
    mut sources: Query<&mut RigSource>,
    mut accepted: MessageWriter<AcceptUpdate>,
    mut commands: Commands,
) {
    let Some(rig) = rig.map(|rig| rig.0) else {
        answers.clear();
        return;
    };
    for answer in answers.read() {
        match answer {
            OfferAnswer::Take(take) => drop(accepted.write(AcceptUpdate { rig, take: *take })),
            OfferAnswer::TakeAlways => {
                if let Ok(mut source) = sources.get_mut(rig) {
                    source.is_live = true;
                }
                accepted.write(AcceptUpdate { rig, take: Take::Mine });
            }
            OfferAnswer::Leave => {
                commands.entity(rig).try_remove::<UpdateOffer>();
            }
        }
    }
}

/// Draws a frame now and then while a file is followed: its changes arrive in frames.
fn wake(
    sources: Query<(), With<RigSource>>,
    mut settings: ResMut<WinitSettings>,
    mut asleep: Local<Option<WinitSettings>>,
) {
    if sources.is_empty() {
        if let Some(before) = asleep.take() {
            *settings = before;
        }
    } else if asleep.is_none() {
        *asleep = Some(settings.clone());
        let mode = bevy::winit::UpdateMode::reactive_low_power(FRAME);
        *settings = WinitSettings { focused_mode: mode, unfocused_mode: mode };
    }
}

fn tell_update(updated: On<RigUpdated>, documents: Query<&OpenDocument>, mut notices: MessageWriter<Notice>) {
    let Ok(document) = documents.get(updated.entity) else { return };
    let count = match updated.changes.len() {
        1 => "1 change".to_owned(),
        count => format!("{count} changes"),
    };
    notices.write(Notice::done(format!("{}: {count} taken over from the file; Ctrl+Z takes it back", document.name)));
    for note in updated.poses.iter() {
        notices.write(Notice::warning(note.to_string()).quiet());
    }
    if !updated.poses.is_empty() {
        let text = "Some joints do not stand as before in poses; the log lists them";
        notices.write(Notice::warning(text));
    }
}

fn tell_failure(failed: On<RigFailed>, documents: Query<&OpenDocument>, mut notices: MessageWriter<Notice>) {
    if documents.contains(failed.entity) {
        notices.write(Notice::error(format!("The changed file is not taken over: {}", failed.error)));
    }
}

/// List of what the changed file would change, with the answers.
struct OfferView;

/// Largest number of changes that are listed.
const LISTED: usize = 200;

impl EditorOverlay for OfferView {
    fn show(&mut self, ctx: &egui::Context, world: &World, requests: &mut Requests) {
        let Some(rig) = world.get_resource::<ActiveRig>() else { return };
        let Some(offer) = world.get::<UpdateOffer>(rig.0) else { return };
        let conflicts = offer.changes.iter().filter(|change| change.conflict).count();
        let version = offer.version.as_ref().map_or_else(String::new, |version| format!(", {version}"));
        let title = match conflicts {
            0 => format!("The template's file has changed{version}"),
            1 => format!("The template's file has changed{version}: 1 conflict"),
            count => format!("The template's file has changed{version}: {count} conflicts"),
        };
        let window = egui::Window::new(title).id(egui::Id::new("offer")).collapsible(true).resizable(true);
        window.default_width(380.0).anchor(egui::Align2::RIGHT_BOTTOM, [-16.0, -40.0]).show(ctx, |ui| {
            egui::ScrollArea::vertical().max_height(220.0).auto_shrink([false, true]).show(ui, |ui| {
                for change in offer.changes.iter().take(LISTED) {
                    let text = egui::RichText::new(change.to_string()).monospace().small();
                    ui.label(if change.conflict { text.color(ui.visuals().warn_fg_color) } else { text });
                }
                if offer.changes.len() > LISTED {
                    ui.label(format!("and {} more", offer.changes.len() - LISTED));
                }
                for note in offer.poses.iter().take(LISTED) {
                    ui.label(egui::RichText::new(note.to_string()).small().color(ui.visuals().warn_fg_color));
                }
            });
            ui.separator();
            ui.horizontal_wrapped(|ui| {
                let mut button = |text: &str, hint: &str, answer: OfferAnswer| {
                    if ui.button(text).on_hover_text(hint).clicked() {
                        requests.send(answer);
                    }
                };
                if conflicts == 0 {
                    button("Take over", "One step, which can be undone", OfferAnswer::Take(Take::Mine));
                    let hint = "Whenever the file is saved, unless both sides changed the same";
                    button("Always", hint, OfferAnswer::TakeAlways);
                } else {
                    button("Take over, mine stay", "In conflicts the values here stay", OfferAnswer::Take(Take::Mine));
                    button("Take over all", "In conflicts the values of the file", OfferAnswer::Take(Take::Theirs));
                }
                button("Leave", "Until the file is saved again", OfferAnswer::Leave);
            });
        });
    }
}
