//! Tags of a joint: on or off, and what became of each command in the build.

use bevy::prelude::*;
use bevy_egui::egui::{self, Checkbox, Color32, RichText, Ui};

use crate::{
    editor::{panel::Requests, panels::displayed_rig::DisplayedRig},
    plugins::{
        commands::CommandReport,
        document::{EditRequest, TagEntities},
    },
    processor::{CommandState, CommandStatus},
    rig::{
        TagData, TagKind, Uid,
        operations::{Operation, TagOperation},
    },
};

/// Draws the tags of a joint, each with a box that turns it on and off.
pub(super) fn tags(ui: &mut Ui, world: &World, shown: &DisplayedRig, joint: Uid, requests: &mut Requests) {
    let Some(data) = shown.rig.joint(joint) else { return };
    if data.data.tags.is_empty() {
        return;
    }
    ui.separator();
    ui.strong("Tags");
    let entities = world.get::<TagEntities>(shown.entity);
    for tag in &data.data.tags {
        let report = entities.and_then(|entities| world.get::<CommandReport>(entities.get(tag.uid)?));
        ui.horizontal(|ui| {
            let mut enabled = tag.enabled;
            let field = Checkbox::new(&mut enabled, name(tag));
            if ui.add(field).on_hover_text(about(tag)).clicked() {
                let operation = Operation::Tags(TagOperation::Enable(vec![tag.uid], enabled));
                requests.send(EditRequest::operation(shown.entity, operation));
            }
            if let Some(CommandReport(status)) = report {
                let (word, color) = state(ui, status);
                let label = ui.add(egui::Label::new(RichText::new(word).color(color)).truncate());
                if let Some(reason) = reason(status) {
                    label.on_hover_text(reason);
                }
            }
        });
    }
}

/// Name of a tag for people.
pub(in crate::editor::panels) fn name(tag: &TagData) -> String {
    match &tag.kind {
        TagKind::Command { module, .. } => module.clone(),
        TagKind::Feature { kind, name, switch, .. } => {
            let named: Vec<&str> = [name, switch].into_iter().map(String::as_str).filter(|it| !it.is_empty()).collect();
            if named.is_empty() { format!("feature {kind}") } else { format!("feature {}", named.join(", ")) }
        }
    }
}

/// Text that is shown over a tag: its comment, and the parameters of a command or the choice of a switch.
fn about(tag: &TagData) -> String {
    let data = match &tag.kind {
        TagKind::Command { params, .. } => params.clone(),
        TagKind::Feature { choice, .. } if choice.is_empty() => "Turns its commands on and off".to_owned(),
        TagKind::Feature { choice, .. } => format!("One of the switches of \"{choice}\", of which exactly one is on"),
    };
    if tag.comment.is_empty() { data } else { format!("{}\n{data}", tag.comment) }
}

/// Word and colour of what became of a command.
pub(in crate::editor::panels) fn state(ui: &Ui, status: &CommandStatus) -> (&'static str, Color32) {
    match status.state {
        CommandState::Done => ("built", ui.visuals().weak_text_color()),
        CommandState::Pending => ("not built yet", ui.visuals().weak_text_color()),
        CommandState::Skipped => ("passed over", ui.visuals().warn_fg_color),
        CommandState::Failed => ("failed", ui.visuals().error_fg_color),
    }
}

/// The reason why a command failed or is passed over.
pub(in crate::editor::panels) fn reason(status: &CommandStatus) -> Option<String> {
    let failed = status.error.as_ref().map(ToString::to_string);
    failed.or_else(|| status.skipped.as_ref().map(ToString::to_string))
}
