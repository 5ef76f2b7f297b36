//! Keys of nodes that are gone: they are given to nodes of the same names, or deleted.

use bevy_egui::egui::{
    Align, Button, Label, Layout, Rect, RichText, Sense, Ui, UiBuilder, WidgetInfo, WidgetType, pos2, vec2,
};

use super::{colors::KeyColors, row::RowContext};
use crate::{
    editor::{counts::counted, panel::Requests, panels::list},
    plugins::document::EditRequest,
    rig::{
        Uid,
        animation::OrphanedKeys,
        operations::{ClipOperation, KeyOperation, Operation},
    },
};

/// Draws the button that gives all keys at once, where several nodes have one of the same name.
pub(super) fn give_all(
    ui: &mut Ui,
    rect: Rect,
    split: f32,
    orphans: &[OrphanedKeys],
    context: &RowContext,
    requests: &mut Requests,
) {
    let mut nodes: Vec<[Uid; 2]> = orphans.iter().filter_map(|keys| Some([keys.node, keys.offer?])).collect();
    nodes.sort();
    nodes.dedup();
    if nodes.len() < 2 {
        return;
    }
    let right = Rect::from_min_max(pos2(split, rect.top()), rect.right_bottom());
    let builder = UiBuilder::new().id_salt("give all").max_rect(right).layout(Layout::left_to_right(Align::Center));
    ui.scope_builder(builder, |ui| {
        let button = ui.add(Button::new("Give all to nodes of their names").truncate());
        let tip = format!("{} are there under another identity", counted(nodes.len(), "node", "nodes"));
        if button.on_hover_text(tip).clicked() {
            let operation = ClipOperation::Adopt { clip: context.open.clip.uid, nodes: nodes.clone() };
            requests.send(EditRequest::operation(context.open.entity, Operation::Clips(operation)));
        }
    });
}

/// Draws the row of a node that is gone, with what can be done with its keys.
pub(super) fn orphan(
    ui: &mut Ui,
    rect: Rect,
    split: f32,
    orphan: &OrphanedKeys,
    context: &RowContext,
    requests: &mut Requests,
) {
    let name = if orphan.name.label.is_empty() {
        format!("node {:04x}", orphan.node.0 >> 48)
    } else {
        orphan.name.label.clone()
    };
    let cell = Rect::from_min_max(pos2(rect.left() + 18.0, rect.top()), pos2(split - 4.0, rect.bottom()));
    let response = ui.interact(cell, ui.id().with(("aside", orphan.layer, orphan.node)), Sense::hover());
    response.widget_info(|| WidgetInfo::labeled(WidgetType::Label, true, &name));
    list::line(ui, cell.shrink2(vec2(3.0, 0.0)), &name, ui.visuals().weak_text_color());
    response.on_hover_text("The node is gone; its keys take effect again when it is back");
    let right = Rect::from_min_max(pos2(split, rect.top()), rect.right_bottom());
    let builder = UiBuilder::new()
        .id_salt((orphan.layer, orphan.node))
        .max_rect(right)
        .layout(Layout::left_to_right(Align::Center));
    ui.scope_builder(builder, |ui| {
        let mut ask = |change: KeyOperation| {
            let operation = ClipOperation::Keys { clip: orphan.clip, layer: orphan.layer, change };
            requests.send(EditRequest::operation(context.open.entity, Operation::Clips(operation)));
        };
        if list::symbol_button(ui, "🗑", &format!("Delete the keys of {name}")) {
            let layer = context.open.clip.layer(orphan.layer);
            let tracks = layer.into_iter().flat_map(|layer| &layer.tracks);
            let own = tracks.filter(|(target, _)| target.node == orphan.node);
            let times = own.map(|(target, track)| (target.clone(), track.keys.iter().map(|key| key.time).collect()));
            ask(KeyOperation::Delete(times.collect()));
        }
        if let Some(to) = orphan.offer {
            let button = Button::new(format!("Give to {name}")).truncate();
            if ui.add(button).on_hover_text("To the node that has this name now").clicked() {
                ask(KeyOperation::Adopt { from: orphan.node, to });
            }
        }
        let text = format!("{} of {}", counted(orphan.keys, "key", "keys"), counted(orphan.tracks, "track", "tracks"));
        ui.add(Label::new(RichText::new(text).color(KeyColors::of(ui.visuals()).quiet)).truncate());
    });
}
