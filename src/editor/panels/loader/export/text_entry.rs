//! Text fields whose text is taken once they are left.

use bevy::prelude::Entity;
use bevy_egui::egui::{TextEdit, Ui, WidgetInfo, WidgetType};

/// Typed text that is not as many numbers as a field takes.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("\"{0}\" is not the numbers that the field takes; separate them by commas")]
pub(super) struct NoNumbers(pub String);

/// Fields of a form, of which one is being typed.
#[derive(Default)]
pub(super) struct TypedFields {
    /// The rig, the name of the field, and its text so far.
    typed: Option<(Entity, String, String)>,
}

impl TypedFields {
    /// Draws a field with a name for screen readers; returns another text once the field is left.
    pub fn text(&mut self, ui: &mut Ui, rig: Entity, name: &str, now: &str, width: f32) -> Option<String> {
        let mut text = match &self.typed {
            Some((of, field, text)) if *of == rig && field == name => text.clone(),
            _ => now.to_owned(),
        };
        let response = ui.add(TextEdit::singleline(&mut text).hint_text(name).desired_width(width));
        response.widget_info(|| WidgetInfo::labeled(WidgetType::TextEdit, true, name));
        let response = response.on_hover_text(name);
        // The next field has the focus before this one is drawn without it, so the focus alone replaces no typed text.
        if response.changed() {
            self.typed = Some((rig, name.to_owned(), text));
        }
        if response.has_focus() {
            return None;
        }
        let typed = self.typed.take_if(|(of, field, _)| *of == rig && field.as_str() == name);
        typed.map(|(_, _, text)| text).filter(|text| text != now)
    }

    /// Draws a field with numbers that are separated by commas; returns them once the field is left, or the typed text if it
    /// is not so many numbers.
    pub fn numbers<const N: usize>(
        &mut self,
        ui: &mut Ui,
        rig: Entity,
        name: &str,
        now: [f32; N],
        width: f32,
    ) -> Option<Result<[f32; N], NoNumbers>> {
        let shown = now.map(|number| number.to_string()).join(", ");
        let text = self.text(ui, rig, name, &shown, width)?;
        let numbers: Result<Vec<f32>, _> = text.split([',', ';']).map(|part| part.trim().parse::<f32>()).collect();
        match numbers.map(<[f32; N]>::try_from) {
            Ok(Ok(numbers)) if numbers.iter().all(|number| number.is_finite()) => Some(Ok(numbers)),
            _ => Some(Err(NoNumbers(text))),
        }
    }
}
