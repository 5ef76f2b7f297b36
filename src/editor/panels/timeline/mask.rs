//! Masks of layers: which nodes a layer concerns.

use bevy_egui::egui::{Button, Ui, WidgetInfo, WidgetType};

use super::row::RowContext;
use crate::{
    editor::{counts::counted, panels::displayed_rig::node_name},
    plugins::commands::BuildResult,
    rig::{Uid, animation::ClipLayer},
};

/// Most names that a tooltip lists.
const MOST: usize = 24;

/// Draws the button of a layer's mask: a click lets the layer concern the selected nodes alone, or all again. Returns the mask
/// that was chosen.
pub(super) fn button(ui: &mut Ui, said: &str, layer: &ClipLayer, context: &RowContext) -> Option<Vec<Uid>> {
    let selected = &context.shown.selection.0;
    let is_masked = !layer.mask.is_empty();
    let text = match layer.mask.len() {
        0 => "all".to_owned(),
        count => counted(count, "node", "nodes"),
    };
    let enabled = is_masked || !selected.is_empty();
    let response = ui.add_enabled(enabled, Button::selectable(is_masked, text.as_str()));
    let listed = if is_masked { names(layer, context) } else { text.clone() };
    let said_mask = format!("Mask of {said}: {listed}");
    response.widget_info(|| WidgetInfo::selected(WidgetType::Button, enabled, is_masked, &said_mask));
    let clicked = response.clicked();
    let tip = match is_masked {
        true => format!("The layer concerns {listed}.\nA click lets it concern all nodes"),
        false => "The layer concerns all nodes.\nA click lets it concern only the selected ones".to_owned(),
    };
    response.on_hover_text(tip).on_disabled_hover_text("The layer concerns all nodes; select some to mask the others");
    clicked.then(|| if is_masked { Vec::new() } else { selected.clone() })
}

/// Draws the entries of a layer's menu. Returns the mask that was chosen.
pub(super) fn entries(ui: &mut Ui, layer: &ClipLayer, context: &RowContext) -> Option<Vec<Uid>> {
    let selected = &context.shown.selection.0;
    let mut chosen = None;
    let is_other = !selected.is_empty() && *selected != layer.mask;
    let why_not = if selected.is_empty() { "nothing is selected" } else { "the layer concerns these already" };
    let only = ui.add_enabled(is_other, Button::new("Mask: only the selected nodes"));
    if only.on_disabled_hover_text(why_not).clicked() {
        chosen = Some(selected.clone());
        ui.close();
    }
    let all = ui.add_enabled(!layer.mask.is_empty(), Button::new("Mask: all nodes"));
    if all.on_disabled_hover_text("the layer concerns all nodes already").clicked() {
        chosen = Some(Vec::new());
        ui.close();
    }
    chosen
}

/// Names of the nodes of a mask, as part of a sentence.
fn names(layer: &ClipLayer, context: &RowContext) -> String {
    let built = context.world.get::<BuildResult>(context.open.entity).map(|built| &*built.0);
    let name = |node: &Uid| node_name(context.open.rig, built, *node);
    let mut names: Vec<String> = layer.mask.iter().take(MOST).map(name).collect();
    if layer.mask.len() > MOST {
        names.push(format!("{} more", layer.mask.len() - MOST));
    }
    names.join(", ")
}
