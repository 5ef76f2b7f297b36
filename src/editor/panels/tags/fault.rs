//! Parameter at fault: its field in the form of a failed command is marked and brought into sight.

use std::cell::Cell;

use bevy_egui::egui::{Align, Response, Sense, Stroke, StrokeKind, Ui, WidgetInfo, WidgetType};

use crate::processor::{CommandStatus, form::FormElement};

/// Parameter that the error of a command names.
pub(super) struct Fault<'a> {
    /// The parameter as the module names it: a field, or a value in one, such as `names[2]`.
    parameter: &'a str,
    /// True to bring the field into sight.
    reveals: bool,
    /// True once a field was brought into sight.
    is_shown: Cell<bool>,
}

impl<'a> Fault<'a> {
    /// The parameter at fault of a command that failed; `None` if its error names no parameter.
    pub fn of(status: &'a CommandStatus, reveals: bool) -> Option<Self> {
        let parameter = status.error.as_ref()?.parameter()?;
        Some(Self { parameter, reveals, is_shown: Cell::new(false) })
    }

    /// True once a field was brought into sight.
    pub fn is_shown(&self) -> bool {
        self.is_shown.get()
    }

    /// True if elements have to be unfolded, for a field that is to be brought into sight is among them.
    pub fn unfolds(&self, elements: &[FormElement]) -> bool {
        self.reveals && self.is_in(elements)
    }

    fn is_in(&self, elements: &[FormElement]) -> bool {
        elements.iter().any(|element| match element {
            FormElement::Frame { content, .. } => self.is_in(content),
            other => other.bound().is_some_and(|(path, _)| self.concerns(path)),
        })
    }

    /// True for the field of the parameter, for a part of it, and for what it is a part of.
    fn concerns(&self, path: &str) -> bool {
        is_within(self.parameter, path) || is_within(path, self.parameter)
    }

    /// True if the parameter at fault is a value, or a part of it.
    pub fn is_within(&self, value: &str) -> bool {
        is_within(self.parameter, value)
    }

    /// Marks the field of the parameter at fault, and scrolls to the field if a person asked for it.
    pub fn mark(&self, ui: &Ui, field: &Response, path: &str, label: &str) {
        if !self.concerns(path) {
            return;
        }
        let visuals = ui.visuals();
        let rect = field.rect.expand(1.0);
        ui.painter().rect_filled(rect, 3.0, visuals.error_fg_color.gamma_multiply(0.12));
        ui.painter().rect_stroke(rect, 3.0, Stroke::new(1.5, visuals.error_fg_color), StrokeKind::Inside);
        let mark = ui.interact(rect, field.id.with("fault"), Sense::hover());
        let said = format!("{label} is wrong");
        mark.widget_info(|| WidgetInfo::labeled(WidgetType::Other, true, &said));
        if self.reveals && !self.is_shown.replace(true) {
            field.scroll_to_me(Some(Align::Center));
        }
    }
}

/// True if a path is that of a value, or of a part of it.
fn is_within(path: &str, value: &str) -> bool {
    path.strip_prefix(value).is_some_and(|rest| rest.is_empty() || rest.starts_with([',', ' ', '[', '.']))
}
