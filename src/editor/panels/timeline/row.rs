//! The left cells of rows: names of nodes and tracks, layers with their weights, and nodes that are gone with their keys.

use bevy::prelude::*;
use bevy_egui::egui::{
    Align, Button, Label, Layout, Rect, Response, RichText, Sense, Ui, UiBuilder, WidgetInfo, WidgetType,
    containers::collapsing_header::paint_default_icon, pos2, vec2,
};

use super::{
    TimelinePanel,
    bar::entry,
    colors::KeyColors,
    mask, node_menu, orphaned_keys,
    sheet::Row,
    state::{OpenClip, Timeline, TimelineRequest, add, contains},
};
use crate::{
    editor::{
        counts::counted,
        panel::Requests,
        panels::{
            displayed_rig::DisplayedRig,
            fields::{self, Look, NumberEdit, Renaming},
            list,
        },
    },
    plugins::{
        document::{Change, EditRequest},
        picking::{Pick, PickRequest},
    },
    rig::{
        Uid,
        animation::{ClipLayer, LayerAbout, LayerMode},
        operations::{ClipOperation, KeyTimes, Operation},
        proportion::Quantity,
    },
};

const WEIGHT: Look = Look { speed: 0.005, decimals: 3, suffix: "", quantity: Quantity::Plain };

/// Context that all rows are drawn with.
pub(super) struct RowContext<'a> {
    pub world: &'a World,
    pub shown: &'a DisplayedRig<'a>,
    pub open: &'a OpenClip<'a>,
    pub timeline: &'a Timeline,
}

/// Draws the names of a row, and for layers and lost nodes the whole row. `split` is where the keys begin.
pub(super) fn show(
    panel: &mut TimelinePanel,
    ui: &mut Ui,
    rect: Rect,
    split: f32,
    row: Row,
    context: &RowContext,
    requests: &mut Requests,
) {
    let cell = rect.with_max_x(split - 4.0);
    match row {
        Row::Layers => header(&mut panel.choice.layers, ui, cell, "Layers"),
        Row::Aside => {
            let text = format!("Set aside ({})", panel.sheet.orphans.len());
            header(&mut panel.choice.aside, ui, cell, &text);
            orphaned_keys::give_all(ui, rect, split, &panel.sheet.orphans, context, requests);
        }
        Row::Layer(number) => {
            if let Some(layer) = context.open.clip.layers.get(number) {
                self::layer(panel, ui, rect, cell, (number, layer), context, requests);
            }
        }
        Row::All => {
            let all = cell.with_min_x(cell.left() + 18.0);
            let response = name(ui, all, "All keys", false, ui.id().with("all keys"));
            let response = response.on_hover_text("A click selects all keys of the layer");
            if response.clicked() {
                requests.send(TimelineRequest::Select(panel.sheet.keys_within(row, FOREVER)));
            }
            key_menu(panel, &response, row, context, requests);
        }
        Row::Node(number) => node(panel, ui, cell, number, context, requests),
        Row::Track(number, track) => self::track(panel, ui, cell, (number, track), context, requests),
        Row::Orphan(number) => {
            if let Some(orphan) = panel.sheet.orphans.get(number) {
                orphaned_keys::orphan(ui, rect, split, orphan, context, requests);
            }
        }
    }
}

/// Span of all times.
const FOREVER: [f32; 2] = [f32::NEG_INFINITY, f32::INFINITY];

/// Header of a part that folds.
fn header(is_open: &mut bool, ui: &mut Ui, cell: Rect, text: &str) {
    let response = ui.interact(cell, ui.id().with(text.split(' ').next()), Sense::click());
    let now = *is_open;
    response.widget_info(|| WidgetInfo::selected(WidgetType::CollapsingHeader, true, now, text));
    hover(ui, cell, &response);
    fold_icon(ui, cell, now, &response);
    list::line(ui, cell.with_min_x(cell.left() + 18.0), text, ui.visuals().weak_text_color());
    if response.clicked() {
        *is_open = !now;
    }
}

fn fold_icon(ui: &mut Ui, cell: Rect, is_open: bool, response: &Response) {
    let place = Rect::from_min_size(cell.min, vec2(16.0, cell.height()));
    let small = response.clone().with_new_rect(Rect::from_center_size(place.center(), vec2(11.0, 11.0)));
    let mut painter = ui.new_child(UiBuilder::new().max_rect(place));
    paint_default_icon(&mut painter, if is_open { 1.0 } else { 0.0 }, &small);
}

fn hover(ui: &Ui, cell: Rect, response: &Response) {
    if response.hovered() {
        ui.painter().rect_filled(cell, 3.0, ui.visuals().widgets.hovered.bg_fill.gamma_multiply(0.35));
    }
}

/// A name that can be clicked.
fn name(ui: &Ui, cell: Rect, text: &str, is_selected: bool, id: bevy_egui::egui::Id) -> Response {
    let response = ui.interact(cell, id, Sense::click());
    response.widget_info(|| WidgetInfo::selected(WidgetType::SelectableLabel, true, is_selected, text));
    if is_selected {
        ui.painter().rect_filled(cell, 3.0, ui.visuals().selection.bg_fill.gamma_multiply(0.6));
    }
    hover(ui, cell, &response);
    let color = if is_selected { ui.visuals().strong_text_color() } else { ui.visuals().text_color() };
    list::line(ui, cell.shrink2(vec2(3.0, 0.0)), text, color);
    response
}

fn node(
    panel: &mut TimelinePanel,
    ui: &mut Ui,
    cell: Rect,
    number: usize,
    context: &RowContext,
    requests: &mut Requests,
) {
    let Some(node) = panel.sheet.nodes.get(number) else { return };
    let id = ui.id().with(node.uid);
    let is_open = panel.choice.unfolded.contains(&node.uid);
    let arrow = cell.with_max_x(cell.left() + 16.0);
    let fold = ui.interact(arrow, id.with("fold"), Sense::click());
    let said = format!("{} {}", if is_open { "Fold" } else { "Unfold" }, node.name);
    fold.widget_info(|| WidgetInfo::labeled(WidgetType::Button, true, &said));
    fold_icon(ui, arrow, is_open, &fold);
    let selected = &context.shown.selection.0;
    let is_selected = selected.contains(&node.uid);
    let response = name(ui, cell.with_min_x(arrow.right() + 2.0), &node.name, is_selected, id);
    let held = ui.input(|input| input.modifiers);
    if response.double_clicked() {
        requests.send(TimelineRequest::Select(panel.sheet.keys_within(Row::Node(number), FOREVER)));
    } else if response.clicked() {
        let joints: Vec<Uid> = match (held.command && is_selected, held.shift || held.command) {
            (true, _) => selected.iter().copied().filter(|other| *other != node.uid).collect(),
            (false, true) => selected.iter().copied().chain([node.uid]).collect(),
            (false, false) => vec![node.uid],
        };
        requests.send(PickRequest { rig: context.open.entity, what: Pick::Joints(joints), add: false });
    } else if response.secondary_clicked() && !is_selected {
        requests.send(PickRequest { rig: context.open.entity, what: Pick::Joints(vec![node.uid]), add: false });
    }
    let tip = "A click selects the node, a double click its keys; a right click offers its switches";
    node_menu::show(&response.on_hover_text(tip), (node.uid, node.name.as_str()), context, requests, |requests| {
        requests.send(TimelineRequest::Select(panel.sheet.keys_within(Row::Node(number), FOREVER)));
    });
    if fold.clicked() {
        let uid = node.uid;
        if is_open {
            panel.choice.unfolded.remove(&uid);
        } else {
            panel.choice.unfolded.insert(uid);
        }
    }
}

fn track(
    panel: &TimelinePanel,
    ui: &mut Ui,
    cell: Rect,
    (number, track): (usize, usize),
    context: &RowContext,
    requests: &mut Requests,
) {
    let Some(node) = panel.sheet.nodes.get(number) else { return };
    let Some(found) = node.tracks.get(track) else { return };
    let id = ui.id().with((node.uid, &found.name));
    let cell = cell.with_min_x(cell.left() + 30.0);
    let response = ui.interact(cell, id, Sense::click());
    let said = format!("{} {}", node.name, found.name);
    response.widget_info(|| WidgetInfo::labeled(WidgetType::SelectableLabel, true, &said));
    hover(ui, cell, &response);
    list::line(ui, cell, &found.name, ui.visuals().weak_text_color());
    let response = response.on_hover_text("A click selects its keys");
    if response.clicked() {
        let mut keys = if ui.input(|input| input.modifiers.shift || input.modifiers.command) {
            context.timeline.keys.clone()
        } else {
            KeyTimes::new()
        };
        add(&mut keys, &panel.sheet.keys_within(Row::Track(number, track), FOREVER));
        requests.send(TimelineRequest::Select(keys));
    }
    key_menu(panel, &response, Row::Track(number, track), context, requests);
}

/// The menu of keys at the name of a row. A right click selects the keys of the row, unless all of them are selected.
fn key_menu(panel: &TimelinePanel, response: &Response, row: Row, context: &RowContext, requests: &mut Requests) {
    if response.secondary_clicked() {
        let own = panel.sheet.keys_within(row, FOREVER);
        if !contains(&context.timeline.keys, &own) {
            requests.send(TimelineRequest::Select(own));
        }
    }
    super::menu::show(response, context.world, requests);
}

fn layer(
    panel: &mut TimelinePanel,
    ui: &mut Ui,
    rect: Rect,
    cell: Rect,
    (number, layer): (usize, &ClipLayer),
    context: &RowContext,
    requests: &mut Requests,
) {
    let open = context.open;
    let is_active = open.layer.is_some_and(|active| active.uid == layer.uid);
    let id = ui.id().with(layer.uid);
    let said = if layer.name.is_empty() { format!("Layer {}", number + 1) } else { layer.name.clone() };
    let place = cell.with_min_x(cell.left() + 18.0);
    if !rename(&mut panel.renaming, ui, place, layer, open, requests) {
        let response = name(ui, place, &said, is_active, id);
        if response.clicked() {
            requests.send(TimelineRequest::Layer(layer.uid));
        }
        let response = response.on_hover_text("A click shows the keys of the layer; new keys go there");
        menu(panel, &response, (number, layer), &said, context, requests);
    }
    let set = |change: &dyn Fn(&mut LayerAbout)| {
        let mut about = layer.about();
        change(&mut about);
        Operation::Clips(ClipOperation::SetLayer { clip: open.clip.uid, layer: layer.uid, about: Box::new(about) })
    };
    let right = Rect::from_min_max(pos2(cell.right() + 4.0, rect.top()), rect.right_bottom());
    let builder = UiBuilder::new().id_salt(layer.uid).max_rect(right).layout(Layout::left_to_right(Align::Center));
    ui.scope_builder(builder, |ui| {
        ui.spacing_mut().item_spacing.x = 4.0;
        let height = ui.spacing().interact_size.y;
        let name = format!("Weight of {said}");
        let weight = RichText::new("weight ").color(KeyColors::of(ui.visuals()).quiet);
        let width = right.width().min(90.0);
        let edit = panel.numbers.field(ui, &name, weight, layer.weight.into(), WEIGHT, vec2(width, height));
        let edit = edit.and_then(|edit| panel.numbers.between(&name, edit, [0.0, 1.0]));
        panel.numbers.tell(requests);
        let weigh = |value: f32| set(&|about| about.weight = value.clamp(0.0, 1.0));
        let change = edit.map(|edit| match edit {
            NumberEdit::Set(value) => Change::Do(weigh(value)),
            NumberEdit::Preview(value) => Change::Preview(weigh(value)),
            NumberEdit::Commit => Change::Commit,
            NumberEdit::Cancel => Change::CancelPreview,
        });
        if let Some(change) = change {
            requests.send(EditRequest { rig: open.entity, change });
        }
        if right.width() < 210.0 {
            return;
        }
        let mode = match layer.mode {
            LayerMode::Override => "override",
            LayerMode::Additive => "additive",
        };
        let response = ui.button(mode).on_hover_text("Values in place of those below, or added to them");
        let said_mode = format!("Mode of {said}: {mode}");
        response.widget_info(|| WidgetInfo::labeled(WidgetType::Button, true, &said_mode));
        if response.clicked() {
            let other = if layer.mode == LayerMode::Override { LayerMode::Additive } else { LayerMode::Override };
            requests.send(EditRequest::operation(open.entity, set(&|about| about.mode = other)));
        }
        let mute = ui.selectable_label(layer.muted, "mute").on_hover_text("The layer has no effect");
        let said_mute = format!("Mute {said}");
        mute.widget_info(|| WidgetInfo::selected(WidgetType::Button, true, layer.muted, &said_mute));
        if mute.clicked() {
            requests.send(EditRequest::operation(open.entity, set(&|about| about.muted = !layer.muted)));
        }
        // A narrow timeline has masks in the menu of the layer alone.
        if ui.available_width() < 70.0 {
            return;
        }
        if let Some(mask) = mask::button(ui, &said, layer, context) {
            requests.send(EditRequest::operation(open.entity, set(&|about| about.mask.clone_from(&mask))));
        }
        let keys: usize = layer.tracks.values().map(|track| track.keys.len()).sum();
        let (tracks, keys) = (counted(layer.tracks.len(), "track", "tracks"), counted(keys, "key", "keys"));
        let text = RichText::new(format!("{tracks}, {keys}")).color(KeyColors::of(ui.visuals()).quiet);
        ui.add(Label::new(text).truncate());
    });
}

/// The menu of a layer.
fn menu(
    panel: &mut TimelinePanel,
    response: &Response,
    (number, layer): (usize, &ClipLayer),
    said: &str,
    context: &RowContext,
    requests: &mut Requests,
) {
    let open = context.open;
    response.context_menu(|ui| {
        if ui.button("Rename layer").clicked() {
            panel.renaming = Some(LayerRename { layer: layer.uid, text: said.to_owned(), focused: false });
            ui.close();
        }
        let count = open.clip.layers.len();
        let operate = |operation: ClipOperation| EditRequest::operation(open.entity, Operation::Clips(operation));
        let (clip, uid) = (open.clip.uid, layer.uid);
        for (text, enabled, index, why_not) in [
            ("Move up", number + 1 < count, number + 1, "It is the highest layer"),
            ("Move down", number > 0, number.saturating_sub(1), "It is the lowest layer"),
        ] {
            if ui.add_enabled(enabled, Button::new(text)).on_disabled_hover_text(why_not).clicked() {
                requests.send(operate(ClipOperation::MoveLayer { clip, layer: uid, index }));
                ui.close();
            }
        }
        if let Some(mask) = mask::entries(ui, layer, context) {
            let about = Box::new(LayerAbout { mask, ..layer.about() });
            requests.send(operate(ClipOperation::SetLayer { clip, layer: uid, about }));
        }
        entry(ui, context.world, super::TimelineAction::NewLayer, requests);
        let delete = ui.add_enabled(count > 1, Button::new("Delete layer"));
        if delete.on_disabled_hover_text("A clip has one layer at least").clicked() {
            requests.send(operate(ClipOperation::DeleteLayer { clip, layer: uid }));
            ui.close();
        }
    });
}

/// Name of a layer that is being typed.
pub(super) struct LayerRename {
    layer: Uid,
    text: String,
    focused: bool,
}

/// Draws the field of a layer's name while it is typed; `false` while it is not.
fn rename(
    renaming: &mut Option<LayerRename>,
    ui: &mut Ui,
    rect: Rect,
    layer: &ClipLayer,
    open: &OpenClip,
    requests: &mut Requests,
) -> bool {
    let Some(typed) = renaming.as_mut().filter(|typed| typed.layer == layer.uid) else { return false };
    let id = ui.id().with((layer.uid, "rename"));
    match fields::rename(ui, rect, id, "Rename layer", &mut typed.text, &mut typed.focused) {
        Renaming::Typing => {}
        Renaming::Dropped => *renaming = None,
        Renaming::Accepted => {
            let name = typed.text.trim().to_owned();
            *renaming = None;
            if !name.is_empty() && name != layer.name {
                let about = Box::new(LayerAbout { name, ..layer.about() });
                let operation = ClipOperation::SetLayer { clip: open.clip.uid, layer: layer.uid, about };
                requests.send(EditRequest::operation(open.entity, Operation::Clips(operation)));
            }
        }
    }
    true
}
