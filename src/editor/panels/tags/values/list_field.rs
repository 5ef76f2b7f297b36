//! Lists in forms: a row for each item with the elements of its type, which is moved and removed by buttons beside it.

use bevy_egui::egui::{Align, Button, Label, Layout, Ui, WidgetInfo, WidgetType, vec2};

use super::{Subject, Values};
use crate::{
    editor::panels::{
        list,
        tags::{read_values::Rows, value_edit::ValueEdit},
    },
    processor::form::FormElement,
    rig::list_items,
};

/// Change of the order or number of items.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum RowEdit {
    Up,
    Down,
    Remove,
}

impl Values {
    /// Draws a list as rows; as text where commands have different lists, or the items have no elements.
    pub(super) fn list(&mut self, ui: &mut Ui, subject: &Subject, label: &str, path: &str) -> Option<ValueEdit> {
        let known = subject.values.get(path);
        let Some((text, rows)) = known.and_then(|known| Some((known.text.as_str(), known.rows.as_ref()?))) else {
            let shown = subject.value(path);
            let text = self.text(ui, subject.tag(), path, label, if shown.mixed { "" } else { shown.value }, true)?;
            return Some(subject.set(path, &[text]));
        };
        ui.label(label);
        let mut edit = None;
        let mut changed = None;
        for (number, elements) in rows.elements.iter().enumerate() {
            let ends = [number == 0, number + 1 == rows.elements.len()];
            let row = ui.scope(|ui| self.row(ui, subject, (label, number), elements, ends));
            if let Some(fault) = subject.fault.filter(|fault| fault.is_within(&format!("{path}[{number}]"))) {
                fault.mark(ui, &row.response, &format!("{path}[{number}]"), &format!("{label} {}", number + 1));
            }
            let (value, order) = row.inner;
            edit = edit.or(value);
            changed = changed.or(order.map(|order| (number, order)));
        }
        let added = ui.add(Button::new("Add").small()).on_hover_text(format!("Add an item to {label}"));
        added.widget_info(|| WidgetInfo::labeled(WidgetType::Button, true, format!("Add to {label}")));
        if let Some((number, order)) = changed {
            edit = Some(subject.set(path, &[reordered(text, number, order)]));
        } else if added.clicked() {
            edit = Some(subject.set(path, &[with_another(text, rows)]));
        }
        edit
    }

    /// Draws an item: one plain value in the line of its buttons, anything else below them.
    fn row(
        &mut self,
        ui: &mut Ui,
        subject: &Subject,
        (label, number): (&str, usize),
        elements: &[FormElement],
        ends: [bool; 2],
    ) -> (Option<ValueEdit>, Option<RowEdit>) {
        let size = vec2(ui.available_width(), ui.spacing().interact_size.y);
        let plain = match elements {
            [element] if is_one_line(element) => element.bound().map(|(path, _)| (element, path)),
            _ => None,
        };
        let line = ui.allocate_ui_with_layout(size, Layout::right_to_left(Align::Center), |ui| {
            let order = order_buttons(ui, label, number, ends);
            let value = ui.with_layout(Layout::left_to_right(Align::Center), |ui| match plain {
                Some((element, path)) => self.element(ui, subject, element, path),
                None => {
                    ui.add(Label::new(format!("{label} {}", number + 1)).truncate());
                    None
                }
            });
            (value.inner, order)
        });
        let (mut value, order) = line.inner;
        if plain.is_none() {
            ui.indent((subject.tag(), label, number), |ui| {
                for element in elements {
                    let Some((path, _)) = element.bound() else { continue };
                    let edit = self.element(ui, subject, element, path);
                    value = value.take().or(edit);
                }
            });
        }
        (value, order)
    }
}

/// True for an element that is drawn in one line.
fn is_one_line(element: &FormElement) -> bool {
    matches!(
        element,
        FormElement::Text(_)
            | FormElement::Check(_)
            | FormElement::Menu { .. }
            | FormElement::Number { .. }
            | FormElement::Amount(_)
    )
}

/// Draws the buttons that remove and move an item, from right to left. `ends` tells if it is the first, and the last.
fn order_buttons(ui: &mut Ui, label: &str, number: usize, ends: [bool; 2]) -> Option<RowEdit> {
    ui.spacing_mut().button_padding.x = 2.0;
    ui.spacing_mut().item_spacing.x = 3.0;
    let number = number + 1;
    let [is_first, is_last] = ends;
    let mut edit = None;
    if list::symbol_button(ui, "✖", &format!("Remove {number} of {label}")) {
        edit = Some(RowEdit::Remove);
    }
    let last = is_last.then_some("It is the last one");
    let first = is_first.then_some("It is the first one");
    for (sign, side, why_not, moved) in [("⏷", "down", last, RowEdit::Down), ("⏶", "up", first, RowEdit::Up)] {
        let said = format!("Move {number} of {label} {side}");
        if list::symbol_button_unless(ui, sign, &said, why_not) {
            edit = Some(moved);
        }
    }
    edit
}

/// RON of a list after a change of its order; the same text if there is no such item.
fn reordered(text: &str, number: usize, edit: RowEdit) -> String {
    let mut items: Vec<&str> = list_items(text).into_iter().map(|place| &text[place]).collect();
    match edit {
        RowEdit::Remove if number < items.len() => {
            items.remove(number);
        }
        RowEdit::Up if number > 0 && number < items.len() => items.swap(number, number - 1),
        RowEdit::Down if number + 1 < items.len() => items.swap(number, number + 1),
        RowEdit::Remove | RowEdit::Up | RowEdit::Down => {}
    }
    format!("[{}]", items.join(", "))
}

/// RON of a list with one more item: the last number once more, for numbers of a list are mostly alike, else a fresh item.
fn with_another(text: &str, rows: &Rows) -> String {
    let mut items: Vec<&str> = list_items(text).into_iter().map(|place| &text[place]).collect();
    let is_number = matches!(rows.elements.first().map(Vec::as_slice), Some([FormElement::Number { .. }]));
    let next = items.last().copied().filter(|_| is_number).unwrap_or(&rows.fresh);
    items.push(next);
    format!("[{}]", items.join(", "))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn items_are_moved_removed_and_added() {
        let text = "[(name:\"a, b\"),(name:\"c\"),2]";
        assert_eq!(reordered(text, 0, RowEdit::Down), "[(name:\"c\"), (name:\"a, b\"), 2]");
        assert_eq!(reordered(text, 2, RowEdit::Up), "[(name:\"a, b\"), 2, (name:\"c\")]");
        assert_eq!(reordered(text, 1, RowEdit::Remove), "[(name:\"a, b\"), 2]");
        assert_eq!(reordered("[]", 0, RowEdit::Remove), "[]");
        let rows = Rows { elements: Vec::new(), fresh: "\"\"".to_owned() };
        assert_eq!(with_another("[]", &rows), "[\"\"]");
        assert_eq!(with_another("[\"a\"]", &rows), "[\"a\", \"\"]");
    }
}
