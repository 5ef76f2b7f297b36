//! Stages of the rig, and its groups.

use bevy::prelude::World;
use bevy_egui::egui::{Button, Checkbox, Ui, WidgetInfo, WidgetType};

use crate::{
    editor::{
        panel::Requests,
        panels::{displayed_rig::DisplayedRig, process::AT_STAGE},
    },
    plugins::{
        commands::Processor,
        document::EditRequest,
        stage::{RigStage, StageRequest},
    },
    rig::operations::{Operation, TagOperation},
};

/// Reason why the rig is not brought to any stage.
const NO_JOINTS: &str = "There are no joints: load a template first";

/// Draws the four stages; a click brings the rig there.
pub(super) fn show(ui: &mut Ui, world: &World, shown: &DisplayedRig, requests: &mut Requests) {
    let stage = world.get::<RigStage>(shown.entity).copied();
    let processor = world.get::<Processor>(shown.entity);
    let is_deleted = stage == Some(RigStage::Deleted);
    let name = &shown.rig.about().name;
    ui.strong(if name.is_empty() { "Rig" } else { name });
    ui.horizontal_wrapped(|ui| {
        ui.spacing_mut().item_spacing.x = 3.0;
        for choice in RigStage::ALL {
            let is_on = stage == Some(choice);
            let why_not = if choice.is_kept(stage, processor) {
                Some(AT_STAGE)
            } else {
                (shown.rig.is_empty() && !is_deleted).then_some(NO_JOINTS)
            };
            let can = why_not.is_none();
            let (said, tip) = purpose(choice);
            let button = ui.add_enabled(can, Button::selectable(is_on, choice.name()));
            button.widget_info(|| WidgetInfo::selected(WidgetType::SelectableLabel, can, is_on, said));
            let button = button.on_hover_text(tip).on_disabled_hover_text(why_not.unwrap_or_default());
            if button.clicked() {
                requests.send(StageRequest { rig: shown.entity, stage: choice });
            }
        }
    });
}

/// Name and purpose of a stage.
fn purpose(stage: RigStage) -> (&'static str, &'static str) {
    match stage {
        RigStage::Skeleton => ("Load skeleton", "The joints in their pose; no command is in effect"),
        RigStage::Edit => ("Edit skeleton", "The joints at rest, to be moved; no command runs after an edit"),
        RigStage::Built => ("Build rig", "All commands are in effect, and follow every edit"),
        RigStage::Deleted => {
            ("Delete rig", "Nothing is left but poses, keys and weights; each stage brings the rig back")
        }
    }
}

/// Draws a box for each group.
pub(super) fn groups(ui: &mut Ui, shown: &DisplayedRig, requests: &mut Requests) {
    if shown.rig.groups().is_empty() {
        return;
    }
    ui.collapsing("Groups", |ui| {
        for group in shown.rig.groups() {
            let mut enabled = group.enabled;
            let field =
                ui.add(Checkbox::new(&mut enabled, &group.name)).on_hover_text("Builds the joints of this group");
            if field.clicked() {
                let operation = Operation::Tags(TagOperation::EnableGroup(group.uid, enabled));
                requests.send(EditRequest::operation(shown.entity, operation));
            }
        }
    });
}
