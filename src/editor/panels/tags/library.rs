//! Library of modules: a list with a search, from which a click attaches a command.

use bevy_egui::egui::{self, Key, ScrollArea, Sense, TextStyle, Ui, WidgetInfo, WidgetType, vec2};

use crate::{
    editor::{library::DraggedModule, panels::list},
    processor::{ModuleInfo, Modules},
};

/// Modules that fit all words, the name counting more than the description; all without words.
pub(super) fn found<'m>(modules: &'m Modules, words: &str) -> Vec<&'m ModuleInfo> {
    let words: Vec<String> = words.split_whitespace().map(str::to_lowercase).collect();
    let fits = |text: &str| words.iter().all(|word| text.to_lowercase().contains(word.as_str()));
    let (named, described): (Vec<_>, Vec<_>) = modules
        .iter()
        .filter(|module| fits(&format!("{} {}", module.name, module.doc)))
        .partition(|module| fits(module.name));
    named.into_iter().chain(described).collect()
}

/// Draws the library; returns the module that was chosen. `Enter` in the search field takes the first.
pub(in crate::editor::panels) fn library(ui: &mut Ui, modules: &Modules, words: &mut String) -> Option<&'static str> {
    // The search field takes all width that there is; a wider list would cover joints that modules are dragged onto.
    ui.set_min_width(240.0);
    ui.set_max_width(300.0);
    let field = ui.add(egui::TextEdit::singleline(words).hint_text("Search modules").desired_width(f32::INFINITY));
    field.widget_info(|| WidgetInfo::labeled(WidgetType::TextEdit, true, "Search modules"));
    let entered = field.lost_focus() && ui.input(|input| input.key_pressed(Key::Enter));
    if !field.has_focus() && !entered && words.is_empty() {
        field.request_focus();
    }
    let found = found(modules, words);
    let mut chosen = found.first().filter(|_| entered).map(|module| module.name);
    if found.is_empty() {
        ui.weak("No module is called so.");
    }
    let height = list::row_height(ui) + ui.text_style_height(&TextStyle::Small);
    ScrollArea::vertical().max_height(320.0).show(ui, |ui| {
        for module in found {
            let (rect, response) = ui.allocate_exact_size(vec2(ui.available_width(), height), Sense::click_and_drag());
            response.dnd_set_drag_payload(DraggedModule(module.name));
            response.widget_info(|| WidgetInfo::labeled(WidgetType::Button, true, module.name));
            if ui.is_rect_visible(rect) {
                if response.hovered() {
                    ui.painter().rect_filled(rect, 3.0, ui.visuals().widgets.hovered.bg_fill);
                }
                let upper = egui::Rect::from_min_size(rect.min + vec2(4.0, 0.0), vec2(rect.width(), height * 0.55));
                list::line(ui, upper, module.name, ui.visuals().strong_text_color());
                let lower = egui::Rect::from_min_max(egui::pos2(upper.left(), upper.bottom()), rect.max);
                list::line(ui, lower, module.doc, ui.visuals().weak_text_color());
            }
            if response.on_hover_text(module.doc).clicked() {
                chosen = Some(module.name);
            }
        }
    });
    if chosen.is_some() {
        words.clear();
        ui.close();
    }
    chosen
}
