//! Features of a rig: local groups and the features in them, on or off, with their switches and choices. A card of the
//! Tags panel that is let go on a feature or a switch goes into it.

use bevy_egui::egui::{Checkbox, CollapsingHeader, RadioButton, Response, Stroke, StrokeKind, Ui};

use super::{
    displayed_rig::{DisplayedRig, Stamp},
    tags::DraggedCard,
};
use crate::{
    editor::panel::Requests,
    plugins::document::EditRequest,
    rig::{
        TagKind, Uid,
        feature::{CombinedFeature, FeatureState, FeatureSwitch, combined_features},
        operations::{Operation, TagOperation},
    },
};

/// List of the features of the rig that was shown last.
#[derive(Default)]
pub(super) struct Features {
    stamp: Option<Stamp>,
    list: Vec<CombinedFeature>,
}

impl Features {
    /// Draws the groups that have features, folded, each with its features: a box for a switch that stands for itself, a
    /// round button for each switch of a choice.
    pub fn show(&mut self, ui: &mut Ui, shown: &DisplayedRig, requests: &mut Requests) {
        if self.stamp != Some(shown.stamp()) {
            *self = Self { stamp: Some(shown.stamp()), list: combined_features(&shown.rig) };
        }
        if self.list.is_empty() {
            return;
        }
        ui.separator();
        CollapsingHeader::new("Features").id_salt("features").show(ui, |ui| {
            let mut send = |operation| {
                requests.send(EditRequest::operation(shown.entity, Operation::Tags(operation)));
            };
            for run in self.list.chunk_by(|a, b| a.key.group == b.key.group) {
                let Some(first) = run.first() else { continue };
                if let Some(group) = first.key.group {
                    group_box(ui, shown, group, &mut send);
                }
                ui.indent((first.key.group, "features"), |ui| {
                    run.iter().for_each(|feature| feature_boxes(ui, feature, shown, &mut send));
                });
            }
        });
    }
}

fn group_box(ui: &mut Ui, shown: &DisplayedRig, group: Uid, send: &mut impl FnMut(TagOperation)) {
    let Some(group) = shown.rig.group(group) else { return };
    let mut enabled = group.enabled;
    let field = ui.add(Checkbox::new(&mut enabled, &group.name)).on_hover_text("Builds the joints of this group");
    if field.clicked() {
        send(TagOperation::EnableGroup(group.uid, enabled));
    }
}

fn feature_boxes(ui: &mut Ui, feature: &CombinedFeature, shown: &DisplayedRig, send: &mut impl FnMut(TagOperation)) {
    let mut on = feature.state == FeatureState::On;
    let field = Checkbox::new(&mut on, &feature.key.name).indeterminate(feature.state == FeatureState::Mixed);
    let field = ui.add(field);
    // What belongs to the whole feature goes into a part of it that no switch turns off.
    let is_of_switch = |tag: &Uid| feature.switches.iter().any(|switch| switch.tags.contains(tag));
    let whole: Vec<Uid> = feature.tags.iter().copied().filter(|tag| !is_of_switch(tag)).collect();
    drop_card(ui, &field, &whole, shown, send);
    if field.on_hover_text(&feature.key.kind).clicked() {
        send(TagOperation::SetFeature(feature.key.clone(), feature.state != FeatureState::On));
    }
    if feature.switches.is_empty() {
        return;
    }
    ui.indent((feature.key.group, &feature.key.kind, &feature.key.name), |ui| {
        for switch in &feature.switches {
            let (field, on) = switch_box(ui, switch);
            drop_card(ui, &field, &switch.tags, shown, send);
            if let Some(on) = on {
                send(TagOperation::SetSwitch(feature.key.clone(), switch.name.clone(), on));
            }
        }
    });
}

/// Draws one switch; returns its box, and its state after a click that changes it.
fn switch_box(ui: &mut Ui, switch: &FeatureSwitch) -> (Response, Option<bool>) {
    let is_on = switch.state == FeatureState::On;
    if switch.choice.is_empty() {
        let mut on = is_on;
        let field = Checkbox::new(&mut on, &switch.name).indeterminate(switch.state == FeatureState::Mixed);
        let field = ui.add(field);
        let on = field.clicked().then_some(!is_on);
        return (field, on);
    }
    let field = ui.add(RadioButton::new(is_on, &switch.name)).on_hover_text(format!("One of \"{}\"", switch.choice));
    let on = (field.clicked() && !is_on).then_some(true);
    (field, on)
}

/// Marks a box under a card of the Tags panel, and puts the card's commands into one of the feature's tags when it is let
/// go: the one on the same joint, if there is one.
fn drop_card(ui: &Ui, field: &Response, features: &[Uid], shown: &DisplayedRig, send: &mut impl FnMut(TagOperation)) {
    let Some(card) = field.dnd_hover_payload::<DraggedCard>() else { return };
    let joint = |tag: Uid| shown.rig.find_tag(tag).map(|(joint, _)| joint.data.uid);
    let Some(home) = card.commands.first().and_then(|command| joint(*command)) else { return };
    let near = features.iter().find(|feature| joint(**feature) == Some(home));
    let Some(feature) = near.or(features.first()).copied() else { return };
    let is_elsewhere = |command: &Uid| {
        let tag = shown.rig.find_tag(*command).map(|(_, tag)| &tag.kind);
        matches!(tag, Some(TagKind::Command { feature: own, .. }) if *own != Some(feature))
    };
    let commands: Vec<Uid> = card.commands.iter().copied().filter(is_elsewhere).collect();
    if commands.is_empty() {
        return;
    }
    let stroke = Stroke::new(1.5, ui.visuals().selection.stroke.color);
    ui.painter().rect_stroke(field.rect, 3.0, stroke, StrokeKind::Outside);
    if field.dnd_release_payload::<DraggedCard>().is_some() {
        send(TagOperation::Attach(commands, Some(feature)));
    }
}
