//! Sets panel: selections under names, stored in the document and selected again with a click.

use bevy::prelude::*;
use bevy_egui::egui::{self, Align, Button, Key, Layout, Rect, Sense, TextEdit, Ui, UiBuilder, WidgetInfo, WidgetType};

use super::{
    displayed_rig::DisplayedRig,
    list::{self, List},
};
use crate::{
    editor::panel::{EditorPanel, Requests},
    plugins::{
        commands::BuildResult,
        document::EditRequest,
        picking::{Pick, PickRequest},
    },
    rig::{BuiltRig, Rig, RigEdit, SelectionSet, Uid, operations::Operation},
};

/// The panel.
#[derive(Default)]
pub struct SelectionSetsPanel {
    /// The name typed for the next set.
    name: String,
}

impl EditorPanel for SelectionSetsPanel {
    fn title(&self) -> &'static str {
        "Sets"
    }

    fn show(&mut self, ui: &mut Ui, world: &World, requests: &mut Requests) {
        let Some(shown) = DisplayedRig::of(world) else {
            return list::nothing(ui, "No rig is open.");
        };
        let built = world.get::<BuildResult>(shown.entity).map(|built| &*built.0);
        let mut edit = self.store(ui, &shown);
        let sets = shown.rig.selection_sets();
        if sets.is_empty() {
            list::nothing(ui, "No selection is stored. Select controls or joints, and store them above.");
        }
        let height = ui.spacing().interact_size.y + 4.0;
        List { id: "selection sets", count: sets.len(), height, reveal: None, follow: false }.show(
            ui,
            |ui, range, row| {
                for number in range {
                    let rect = row(number).shrink2(egui::vec2(0.0, 1.0));
                    let asked = set_row(ui, rect, number, &sets[number], &shown, built, requests);
                    edit = asked.or(edit.take());
                }
            },
        );
        if let Some((name, edit)) = edit {
            let operation = Operation::Named { name, edits: vec![edit] };
            requests.send(EditRequest::operation(shown.entity, operation));
        }
    }
}

/// Request that selects the nodes of a set that are there; with `add` to what is selected already.
pub(super) fn recall(rig: Entity, set: &SelectionSet, add: bool) -> PickRequest {
    PickRequest { rig, what: Pick::Joints(set.nodes.clone()), add }
}

/// The first free name of "Set 1", "Set 2" and so on.
pub(super) fn free_name(rig: &Rig) -> String {
    let taken = |name: &String| rig.selection_sets().iter().any(|set| set.name == *name);
    let names = (1..).map(|number| format!("Set {number}"));
    names.into_iter().find(|name| !taken(name)).unwrap_or_default()
}

impl SelectionSetsPanel {
    /// Draws a name field and a button that stores the selection under it.
    fn store(&mut self, ui: &mut Ui, shown: &DisplayedRig) -> Option<(&'static str, RigEdit)> {
        let free = free_name(&shown.rig);
        let name = self.name.trim();
        let replaces = shown.rig.selection_sets().iter().any(|set| set.name == name);
        let can_store = !shown.selection.0.is_empty();
        let is_accepted = ui
            .horizontal(|ui| {
                let width = (ui.available_width() - 62.0 - ui.spacing().item_spacing.x).max(40.0);
                let field = ui.add(TextEdit::singleline(&mut self.name).hint_text(free.as_str()).desired_width(width));
                field.widget_info(|| WidgetInfo::labeled(WidgetType::TextEdit, true, "Set name"));
                let entered = field.lost_focus() && ui.input(|input| input.key_pressed(Key::Enter));
                let text = if replaces { "Replace" } else { "Store" };
                let size = egui::vec2(ui.available_width(), ui.spacing().interact_size.y);
                let button = ui.add_enabled(can_store, Button::new(text).min_size(size));
                entered && can_store || button.on_disabled_hover_text("nothing is selected").clicked()
            })
            .inner;
        is_accepted.then(|| {
            let name = std::mem::take(&mut self.name);
            let name = if name.trim().is_empty() { free } else { name.trim().to_owned() };
            ("Store selection set", shown.rig.with_selection_set(&name, shown.selection.0.clone()))
        })
    }
}

/// Draws a set: a click selects it, with Shift in addition.
fn set_row(
    ui: &mut Ui,
    rect: Rect,
    number: usize,
    set: &SelectionSet,
    shown: &DisplayedRig,
    built: Option<&BuiltRig>,
    requests: &mut Requests,
) -> Option<(&'static str, RigEdit)> {
    let is_there =
        |node: &&Uid| shown.rig.joint(**node).is_some() || built.is_some_and(|built| built.node(**node).is_some());
    let there = set.nodes.iter().filter(is_there).count();
    let is_selected = there > 0 && set.nodes.iter().filter(is_there).eq(shown.selection.0.iter());
    let response = ui.interact(rect, ui.id().with(("set", number)), Sense::click());
    response.widget_info(|| WidgetInfo::selected(WidgetType::SelectableLabel, true, is_selected, &set.name));
    if is_selected {
        ui.painter().rect_filled(rect, 3.0, ui.visuals().selection.bg_fill.gamma_multiply(0.6));
    } else if response.hovered() {
        ui.painter().rect_filled(rect, 3.0, ui.visuals().widgets.hovered.bg_fill.gamma_multiply(0.35));
    }
    let mut edit = None;
    let builder = UiBuilder::new().id_salt(("set", number)).max_rect(rect);
    ui.scope_builder(builder.layout(Layout::right_to_left(Align::Center)), |ui| {
        ui.spacing_mut().item_spacing.x = 3.0;
        if list::symbol_button(ui, "🗑", "Delete set") {
            edit = Some(("Delete selection set", shown.rig.without_selection_set(&set.name)));
        }
        let count = match set.nodes.len() - there {
            0 => there.to_string(),
            gone => format!("{there}, {gone} gone"),
        };
        ui.weak(count);
        let name = ui.available_rect_before_wrap().shrink2(egui::vec2(4.0, 0.0));
        list::line(ui, name, &set.name, ui.visuals().text_color());
    });
    let add = ui.input(|input| input.modifiers.shift);
    if response.on_hover_text("Click selects these nodes, with Shift in addition").clicked() {
        requests.send(recall(shown.entity, set, add));
    }
    edit
}
