//! Features of a rig: local groups and the features in them, on or off, with their switches and choices.

use bevy_egui::egui::{Checkbox, CollapsingHeader, RadioButton, Ui};

use super::displayed_rig::{DisplayedRig, Stamp};
use crate::{
    editor::panel::Requests,
    plugins::document::EditRequest,
    rig::{
        Uid,
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
                    run.iter().for_each(|feature| feature_boxes(ui, feature, &mut send));
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

fn feature_boxes(ui: &mut Ui, feature: &CombinedFeature, send: &mut impl FnMut(TagOperation)) {
    let mut on = feature.state == FeatureState::On;
    let field = Checkbox::new(&mut on, &feature.key.name).indeterminate(feature.state == FeatureState::Mixed);
    if ui.add(field).on_hover_text(&feature.key.kind).clicked() {
        send(TagOperation::SetFeature(feature.key.clone(), feature.state != FeatureState::On));
    }
    if feature.switches.is_empty() {
        return;
    }
    ui.indent((feature.key.group, &feature.key.kind, &feature.key.name), |ui| {
        for switch in &feature.switches {
            if let Some(on) = switch_box(ui, switch) {
                send(TagOperation::SetSwitch(feature.key.clone(), switch.name.clone(), on));
            }
        }
    });
}

/// Draws one switch; returns its state after a click that changes it.
fn switch_box(ui: &mut Ui, switch: &FeatureSwitch) -> Option<bool> {
    let is_on = switch.state == FeatureState::On;
    if switch.choice.is_empty() {
        let mut on = is_on;
        let field = Checkbox::new(&mut on, &switch.name).indeterminate(switch.state == FeatureState::Mixed);
        return ui.add(field).clicked().then_some(!is_on);
    }
    let field = ui.add(RadioButton::new(is_on, &switch.name));
    (field.on_hover_text(format!("One of \"{}\"", switch.choice)).clicked() && !is_on).then_some(true)
}
