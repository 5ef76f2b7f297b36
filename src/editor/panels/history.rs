//! History panel: the steps, with a jump to any of them.

use bevy::prelude::*;
use bevy_egui::egui::{self, Button, Rect, Sense, Ui, WidgetInfo, WidgetType};

use super::{
    displayed_rig::DisplayedRig,
    list::{self, List},
};
use crate::{
    editor::panel::{EditorPanel, Requests},
    plugins::{
        document::{Change, EditRequest},
        history::RigHistory,
    },
};

/// The panel.
#[derive(Default)]
pub struct HistoryPanel {
    made_from: Option<(Entity, bevy::ecs::change_detection::Tick)>,
    /// Names of the steps, oldest first.
    steps: Vec<String>,
    /// Number of steps in effect.
    done: usize,
    /// The step that was last scrolled into view.
    revealed: Option<usize>,
}

impl EditorPanel for HistoryPanel {
    fn title(&self) -> &'static str {
        "History"
    }

    fn show(&mut self, ui: &mut Ui, world: &World, requests: &mut Requests) {
        let Some(shown) = DisplayedRig::of(world) else {
            return list::nothing(ui, "No rig is open.");
        };
        let Some(history) = world.get_entity(shown.entity).ok().and_then(|rig| rig.get_ref::<RigHistory>()) else {
            return;
        };
        let key = (shown.entity, history.last_changed());
        if self.made_from != Some(key) {
            let (steps, done) = history.steps();
            self.steps = steps.into_iter().map(str::to_owned).collect();
            self.done = done;
            self.made_from = Some(key);
        }
        ui.horizontal(|ui| {
            let width = (ui.available_width() - ui.spacing().item_spacing.x) / 2.0;
            let size = egui::vec2(width.max(40.0), ui.spacing().interact_size.y);
            let (can_undo, can_redo) = (self.done > 0, self.done < self.steps.len());
            for (text, change, enabled, why_not) in [
                ("⮪ Undo", Change::Undo, can_undo, "There is no step to undo"),
                ("⮫ Redo", Change::Redo, can_redo, "Nothing was undone"),
            ] {
                let button = ui.add_enabled(enabled, Button::new(text).min_size(size));
                if button.on_disabled_hover_text(why_not).clicked() {
                    requests.send(EditRequest { rig: shown.entity, change });
                }
            }
        });
        let reveal = (self.revealed != Some(self.done)).then_some(self.done);
        self.revealed = Some(self.done);
        let height = list::row_height(ui);
        List { id: "steps", count: self.steps.len() + 1, height, reveal, follow: false }.show(ui, |ui, range, row| {
            for number in range {
                if self.step(ui, row(number), number) {
                    jump(self.done, number, &shown, requests);
                }
            }
        });
    }
}

impl HistoryPanel {
    /// Draws the state after `number` steps; returns `true` if it was clicked.
    fn step(&self, ui: &Ui, rect: Rect, number: usize) -> bool {
        let name = number.checked_sub(1).and_then(|step| self.steps.get(step)).map_or("Start", String::as_str);
        let current = number == self.done;
        let response = ui.interact(rect, ui.id().with(number), Sense::click());
        let said = format!("{number} {name}");
        response.widget_info(|| WidgetInfo::selected(WidgetType::SelectableLabel, true, current, &said));
        let visuals = ui.visuals();
        if current {
            ui.painter().rect_filled(rect, 3.0, visuals.selection.bg_fill);
        } else if response.hovered() {
            ui.painter().rect_filled(rect, 3.0, visuals.widgets.hovered.bg_fill.gamma_multiply(0.35));
        }
        let color = match number.cmp(&self.done) {
            std::cmp::Ordering::Less => visuals.text_color(),
            std::cmp::Ordering::Equal => visuals.strong_text_color(),
            std::cmp::Ordering::Greater => visuals.weak_text_color().gamma_multiply(0.8),
        };
        let digits = self.steps.len().max(1).ilog10() as f32 + 1.0;
        let numbers = rect.with_max_x(rect.left() + 8.0 + 8.0 * digits).shrink2(egui::vec2(4.0, 0.0));
        if number > 0 {
            list::line(ui, numbers, &number.to_string(), visuals.weak_text_color());
        }
        list::line(ui, rect.with_min_x(numbers.right() + 6.0), name, color);
        response.clicked()
    }
}

/// Undoes or redoes step by step from one state to another.
fn jump(from: usize, to: usize, shown: &DisplayedRig, requests: &mut Requests) {
    let change = if to < from { Change::Undo } else { Change::Redo };
    for _ in 0..from.abs_diff(to) {
        requests.send(EditRequest { rig: shown.entity, change: change.clone() });
    }
}
