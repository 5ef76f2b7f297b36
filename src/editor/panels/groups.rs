//! Choice of a local group, or creation of one by typing its name.

use bevy_egui::egui::{Color32, Key, Rect, Response, Sense, TextEdit, Ui, WidgetInfo, WidgetType, vec2};

use super::{displayed_rig::color, list};
use crate::rig::Rig;

/// Draws the rig's groups with their colours, "None", and a field for another name. Returns the chosen name, empty for
/// none. `draft` is the text typed so far.
pub(super) fn choose(ui: &mut Ui, rig: &Rig, current: Option<&str>, draft: &mut String) -> Option<String> {
    let mut chosen = None;
    if entry(ui, "None", None, current == Some("")).clicked() {
        chosen = Some(String::new());
    }
    for group in rig.groups() {
        if entry(ui, &group.name, Some(color(group.color)), current == Some(&group.name)).clicked() {
            chosen = Some(group.name.clone());
        }
    }
    let field = ui.add(TextEdit::singleline(draft).hint_text("New group").desired_width(120.0));
    field.widget_info(|| WidgetInfo::labeled(WidgetType::TextEdit, true, "New group"));
    let name = draft.trim();
    if field.lost_focus() && ui.input(|input| input.key_pressed(Key::Enter)) && !name.is_empty() {
        chosen = Some(name.to_owned());
    }
    if chosen.is_some() {
        draft.clear();
        ui.close();
    }
    chosen
}

fn entry(ui: &mut Ui, name: &str, color: Option<Color32>, selected: bool) -> Response {
    let height = list::row_height(ui);
    let (rect, response) = ui.allocate_exact_size(vec2(ui.available_width().max(120.0), height), Sense::click());
    response.widget_info(|| WidgetInfo::selected(WidgetType::SelectableLabel, true, selected, name));
    let visuals = ui.style().interact_selectable(&response, selected);
    if selected || response.hovered() {
        ui.painter().rect_filled(rect, 3.0, visuals.bg_fill);
    }
    dot(ui, Rect::from_min_size(rect.min, vec2(height, height)), color);
    let text = Rect::from_min_max(rect.min + vec2(height, 0.0), rect.max);
    list::line(ui, text, name, visuals.text_color());
    response
}

/// A dot in a group's colour; a small ring for no group.
pub(super) fn dot(ui: &Ui, rect: Rect, color: Option<Color32>) {
    match color {
        Some(color) => ui.painter().circle_filled(rect.center(), 4.0, color),
        None => ui.painter().circle_stroke(rect.center(), 3.0, (1.0, ui.visuals().weak_text_color())),
    };
}
