//! Values of commands: the form of their module, an element a row.

mod list_field;

use std::{collections::HashSet, sync::Arc};

use bevy_egui::egui::{
    Checkbox, CollapsingHeader, ComboBox, Key, Rect, RichText, Sense, TextEdit, TextStyle, Ui, WidgetInfo, WidgetType,
    pos2, vec2,
};

use serde::Serialize;

use super::{
    curve_field::{self, CurveDrag, CurveEdit},
    fault::Fault,
    forms::Forms,
    parameter_text::{ValueError, read, typed_number},
    pick::Picking,
    read_values::{CommandValues, ReadValues},
    references,
    stack::Entry,
    value_edit::{ValueEdit, changed},
};
use crate::{
    editor::{
        panel::Requests,
        panels::{
            displayed_rig::DisplayedRig,
            fields::{CommonValue, Look, MIXED, NumberEdit, Numbers, color_button, labelled, named},
            list,
        },
    },
    processor::{Builder, ModuleInfo, Modules, form::FormElement},
    rig::{Uid, proportion::Quantity, ron_text},
};

/// Width of the button that resets a value.
const RESET_WIDTH: f32 = 20.0;
/// Colour of a parameter that gets its first one.
const FIRST_COLOR: [f32; 3] = [1.0, 0.8, 0.1];

/// Forms of modules, with the text that a person is typing.
#[derive(Default)]
pub(super) struct Values {
    numbers: Numbers,
    draft: Option<Draft>,
    curve: Option<CurveDrag>,
    forms: Forms,
    read: ReadValues,
    /// Parameter that waits for nodes.
    pub picking: Option<Picking>,
}

/// A text being typed.
struct Draft {
    tag: Uid,
    path: String,
    text: String,
}

/// Commands whose values are shown, with their module and rig.
pub(super) struct Subject<'a> {
    pub shown: &'a DisplayedRig<'a>,
    pub builder: Option<&'a Builder>,
    pub module: &'a ModuleInfo,
    pub entry: &'a Entry,
    /// Path of the parameter that waits for nodes.
    pub picking: Option<String>,
    values: Arc<CommandValues>,
    fault: Option<&'a Fault<'a>>,
}

impl Subject<'_> {
    fn tag(&self) -> Uid {
        self.entry.first.uid
    }

    /// RON of a value in the last command, with a mark if other commands have another value.
    fn value(&self, path: &str) -> CommonValue<&str> {
        let known = self.values.get(path);
        known.map_or(CommonValue { value: "None", mixed: false }, |known| CommonValue {
            value: &known.text,
            mixed: known.mixed,
        })
    }

    /// The value without quotation marks.
    fn plain(&self, path: &str) -> &str {
        self.values.get(path).map_or("None", |known| &known.plain)
    }

    /// Parameters of all commands with the first of some texts that the module takes as the value.
    fn set(&self, path: &str, texts: &[String]) -> ValueEdit {
        self.changed(path, texts).map_or_else(ValueEdit::Refused, ValueEdit::Set)
    }

    /// Parameters of all commands with a value.
    fn set_to<T: Serialize + ?Sized>(&self, path: &str, value: &T) -> ValueEdit {
        self.set(path, &[ron_text(value)])
    }

    fn changed(&self, path: &str, texts: &[String]) -> Result<Vec<(Uid, String)>, ValueError> {
        changed(self.module, self.entry, path, texts)
    }

    fn reset(&self, path: &str) -> ValueEdit {
        // Items of lists have no defaults; they are numbers or texts.
        if path.contains('[') {
            return self.set(path, &["0.0".to_owned(), ron_text("")]);
        }
        let commands = self.entry.tags.iter().zip(&self.entry.params);
        let changed = commands.map(|((_, tag), params)| Ok((*tag, self.module.with_default(params, path)?)));
        match changed.collect::<Result<Vec<_>, crate::rig::SourceError>>() {
            Ok(changed) => ValueEdit::Set(changed),
            Err(error) => ValueEdit::Refused(ValueError::Parameters(error)),
        }
    }

    fn curve(&self, path: &str, edit: CurveEdit) -> ValueEdit {
        match edit {
            CurveEdit::Set(keys) => self.set_to(path, &keys),
            CurveEdit::Preview(keys) => {
                self.changed(path, &[ron_text(&keys)]).map_or_else(ValueEdit::Refused, ValueEdit::Preview)
            }
            CurveEdit::Commit => ValueEdit::Commit,
            CurveEdit::Cancel => ValueEdit::Cancel,
        }
    }

    fn number(&self, path: &str, edit: NumberEdit) -> ValueEdit {
        let texts = |number: f32| [ron_text(&number), ron_text(&(number.round() as i64))];
        match edit {
            NumberEdit::Set(number) => self.set(path, &texts(number)),
            NumberEdit::Preview(number) => {
                self.changed(path, &texts(number)).map_or_else(ValueEdit::Refused, ValueEdit::Preview)
            }
            NumberEdit::Commit => ValueEdit::Commit,
            NumberEdit::Cancel => ValueEdit::Cancel,
        }
    }
}

impl Values {
    /// Follows the modules, whose forms may have been saved since; values are read for a form.
    pub fn follow(&mut self, modules: &Arc<Modules>) {
        if self.forms.follow(modules) {
            self.read = ReadValues::default();
        }
    }

    /// Sends a notice if a typed number was not taken.
    pub fn tell(&mut self, requests: &mut Requests) {
        self.numbers.tell(requests);
    }

    /// Draws the form of an entry; the text of its parameters and the reason where they cannot be read.
    pub fn show(
        &mut self,
        ui: &mut Ui,
        shown: &DisplayedRig,
        builder: Option<&Builder>,
        module: &ModuleInfo,
        entry: &Entry,
        fault: Option<&Fault>,
    ) -> Option<ValueEdit> {
        let form = self.forms.of(module);
        match self.read.of(module, &form, entry) {
            Ok(values) => {
                let waits = self.picking.as_ref().filter(|picking| picking.tag == entry.first.uid);
                let picking = waits.map(|picking| picking.path.clone());
                let subject = Subject { shown, builder, module, entry, picking, values, fault };
                let edit = self.elements(ui, &subject, &form.content);
                let source = CollapsingHeader::new("As text")
                    .id_salt((entry.first.uid, "text"))
                    .show(ui, |ui| if entry.tags.len() == 1 { self.source(ui, entry) } else { None });
                edit.or(source.body_returned.flatten())
            }
            Err(error) => {
                let reason = format!("line {}, column {}: {}", error.line, error.column, error.message);
                ui.colored_label(ui.visuals().error_fg_color, reason);
                self.source(ui, entry)
            }
        }
    }

    /// Forgets the values of cards that are not open.
    pub fn keep(&mut self, open: &HashSet<Uid>) {
        self.read.keep(open);
    }

    /// The parameters as they are written.
    fn source(&mut self, ui: &mut Ui, entry: &Entry) -> Option<ValueEdit> {
        let params = entry.params.first()?;
        let text = self.text(ui, entry.first.uid, "", "Parameters", params, true)?;
        Some(ValueEdit::Set(vec![(entry.first.uid, text)]))
    }

    fn elements(&mut self, ui: &mut Ui, subject: &Subject, elements: &[FormElement]) -> Option<ValueEdit> {
        let mut edit = None;
        for element in elements {
            let changed = match element {
                FormElement::Frame { label, open, content } => {
                    let frame = CollapsingHeader::new(RichText::new(label).strong())
                        .id_salt((subject.tag(), label))
                        .default_open(*open)
                        .open(subject.fault.is_some_and(|fault| fault.unfolds(content)).then_some(true));
                    frame.show(ui, |ui| self.elements(ui, subject, content)).body_returned.flatten()
                }
                FormElement::Separator => {
                    ui.separator();
                    None
                }
                FormElement::Comment(text) => {
                    ui.weak(text);
                    None
                }
                bound => bound.bound().and_then(|(path, _)| self.bound(ui, subject, bound, path)),
            };
            edit = edit.or(changed);
        }
        edit
    }

    /// Draws an element, and beside it a button that resets its value if it is not the default.
    fn bound(&mut self, ui: &mut Ui, subject: &Subject, element: &FormElement, path: &str) -> Option<ValueEdit> {
        let name = path.split('.').next().unwrap_or(path);
        let about = subject.module.parameters.iter().find(|parameter| parameter.name == name);
        let is_changed = subject.values.get(path).is_some_and(|known| !known.is_default);
        let right = ui.available_rect_before_wrap().right();
        let row = ui.scope(|ui| {
            if is_changed {
                ui.set_max_width((ui.available_width() - RESET_WIDTH).max(60.0));
            }
            self.element(ui, subject, element, path)
        });
        if let Some(fault) = subject.fault {
            fault.mark(ui, &row.response, path, &element.label());
        }
        if let Some(about) = about.filter(|about| !about.doc.is_empty()) {
            row.response.clone().on_hover_text(about.doc);
        }
        let is_reset = is_changed && {
            let corner = pos2(right - RESET_WIDTH, row.response.rect.top());
            let place = Rect::from_min_size(corner, vec2(RESET_WIDTH, ui.spacing().interact_size.y));
            reset_button(ui, place, (subject.tag(), path), &element.label())
        };
        if is_reset { Some(subject.reset(path)) } else { row.inner }
    }

    fn element(&mut self, ui: &mut Ui, subject: &Subject, element: &FormElement, path: &str) -> Option<ValueEdit> {
        let label = element.label();
        let CommonValue { value, mixed } = subject.value(path);
        match element {
            FormElement::Check(_) => {
                let mut on = value == "true";
                let clicked = ui.add(Checkbox::new(&mut on, &label).indeterminate(mixed)).clicked();
                clicked.then(|| subject.set_to(path, &(mixed || on)))
            }
            FormElement::Menu { options, .. } => {
                let now = subject.plain(path);
                let shown = match now {
                    _ if mixed => MIXED.to_owned(),
                    "None" => "—".to_owned(),
                    now => now.replace('_', " "),
                };
                let mut chosen = None;
                labelled(ui, &label, |ui| {
                    let combo = ComboBox::from_id_salt((subject.tag(), path)).selected_text(shown).truncate();
                    let response = combo.width(ui.available_width()).show_ui(ui, |ui| {
                        for option in options {
                            let is_it = !mixed && now == option;
                            if ui.selectable_label(is_it, option.replace('_', " ")).clicked() {
                                chosen = Some(option.clone());
                            }
                        }
                    });
                    let said = label.clone();
                    response.response.widget_info(move || WidgetInfo::labeled(WidgetType::ComboBox, true, &said));
                });
                chosen.map(|option| subject.set(path, &[ron_text(&option), option]))
            }
            FormElement::Slider { step, unit, .. } | FormElement::Number { step, unit, .. } => {
                let label = if unit.is_empty() { label } else { format!("{label} ({unit})") };
                match value.parse::<f32>() {
                    Ok(number) => {
                        let look = Look { speed: f64::from(*step), decimals: 4, suffix: "", quantity: Quantity::Plain };
                        let shown = CommonValue { value: number, mixed };
                        let edit = match element {
                            FormElement::Slider { min, max, .. } => {
                                self.numbers.slider(ui, &label, shown, [*min, *max], look)?
                            }
                            _ => self.numbers.number(ui, &label, shown, look)?,
                        };
                        Some(subject.number(path, edit))
                    }
                    Err(_) => self.optional_number(ui, subject, path, &label),
                }
            }
            FormElement::Vector(_) => match subject.values.get(path).and_then(|known| known.vector) {
                Some(shown) => {
                    let look = Look { speed: 0.01, decimals: 4, suffix: "", quantity: Quantity::Plain };
                    let (axis, edit) = self.numbers.vector(ui, &label, shown, look)?;
                    Some(axis_edit(subject, path, axis, edit))
                }
                None => boxes(ui, subject, path, &label),
            },
            FormElement::Limits(_) => self.limits(ui, subject, path, &label),
            FormElement::Color(_) => self.color(ui, subject, path, &label),
            FormElement::Node(_) => {
                let text = if mixed { "" } else { subject.plain(path) };
                let typed = self.text(ui, subject.tag(), path, &label, text, false);
                let picks = references::about(ui, subject, &label, path, (!mixed).then_some(text));
                let typed = typed.map(|text| subject.set_to(path, &text));
                typed.or_else(|| picks.then(|| ValueEdit::Pick(path.to_owned())))
            }
            FormElement::Text(_) | FormElement::Amount(_) => {
                let shown = if mixed || value == "None" { "" } else { subject.plain(path) };
                let text = self.text(ui, subject.tag(), path, &label, shown, false)?;
                let text = text.trim();
                Some(match (element, text.parse::<f32>()) {
                    (FormElement::Amount(_), Ok(number)) => subject.set_to(path, &number),
                    _ if text.is_empty() => subject.reset(path),
                    _ => subject.set_to(path, text),
                })
            }
            FormElement::Curve(_) => {
                let drawn = subject.values.get(path).and_then(|known| known.curve.as_deref()).filter(|_| !mixed);
                let field = (subject.tag(), path);
                let edit = drawn.and_then(|keys| curve_field::show(ui, field, &label, keys, &mut self.curve));
                let text = self.text(ui, subject.tag(), path, &label, if mixed { "" } else { value }, true);
                let edit = edit.map(|edit| subject.curve(path, edit));
                edit.or_else(|| text.map(|text| subject.set(path, &[text])))
            }
            FormElement::List(_) => self.list(ui, subject, &label, path),
            FormElement::Frame { .. } | FormElement::Separator | FormElement::Comment(_) => None,
        }
    }

    /// A number that may be left out.
    fn optional_number(&mut self, ui: &mut Ui, subject: &Subject, path: &str, label: &str) -> Option<ValueEdit> {
        let text = self.text(ui, subject.tag(), path, label, "", false)?;
        Some(match typed_number(&text) {
            Ok(number) => subject.number(path, NumberEdit::Set(number)),
            Err(error) => ValueEdit::Refused(error),
        })
    }

    /// Three pairs of lowest and highest values; empty fields are open, and so are limits that are left out.
    fn limits(&mut self, ui: &mut Ui, subject: &Subject, path: &str, label: &str) -> Option<ValueEdit> {
        let limits = subject.values.get(path).map(|known| known.limits).unwrap_or_default();
        let mut pairs = limits.map(|(low, high)| [low, high]);
        ui.label(label);
        let mut edit = None;
        for (number, axis) in ["X", "Y", "Z"].into_iter().enumerate() {
            for (end, side) in ["from", "to"].into_iter().enumerate() {
                let (row, said) = (format!("{axis} {side}"), format!("{label} {axis} {side}"));
                let field = format!("{path}.{axis}.{side}");
                let now = pairs[number][end].map_or_else(String::new, |bound| ron_text(&bound));
                let Some(text) = self.named_text(ui, (subject.tag(), &field), (&row, &said), &now, false) else {
                    continue;
                };
                let typed = if text.trim().is_empty() { Ok(None) } else { typed_number(&text).map(Some) };
                edit = Some(typed.map_or_else(ValueEdit::Refused, |bound| {
                    pairs[number][end] = bound;
                    subject.set_to(path, &pairs.map(|[low, high]| (low, high)))
                }));
            }
        }
        edit
    }

    fn color(&mut self, ui: &mut Ui, subject: &Subject, path: &str, label: &str) -> Option<ValueEdit> {
        let id = ui.make_persistent_id((subject.tag(), path, "colour"));
        let stored = subject.values.get(path).and_then(|known| known.color);
        let kept: Option<[f32; 3]> = ui.data(|data| data.get_temp(id));
        let mut edit = None;
        labelled(ui, label, |ui| {
            let Some(mut rgb) = kept.or(stored) else {
                if ui.button("Choose").clicked() {
                    edit = Some(subject.set_to(path, &FIRST_COLOR));
                }
                return;
            };
            let field = color_button(ui, &mut rgb);
            named(ui, field.id, label);
            if field.changed() {
                ui.data_mut(|data| data.insert_temp(id, rgb));
            }
            let holding = ui.input(|input| input.pointer.any_down());
            if let Some(rgb) = ui.data(|data| data.get_temp::<[f32; 3]>(id)).filter(|_| !holding) {
                ui.data_mut(|data| data.remove_temp::<[f32; 3]>(id));
                edit = Some(subject.set_to(path, &rgb));
            }
        });
        edit
    }

    /// A line or several lines of text; the text once it is entered.
    fn text(&mut self, ui: &mut Ui, tag: Uid, path: &str, name: &str, now: &str, lines: bool) -> Option<String> {
        self.named_text(ui, (tag, path), (name, name), now, lines)
    }

    fn named_text(
        &mut self,
        ui: &mut Ui,
        (tag, path): (Uid, &str),
        (label, said): (&str, &str),
        now: &str,
        lines: bool,
    ) -> Option<String> {
        let is_own = |draft: &&Draft| draft.tag == tag && draft.path == path;
        let mut text = self.draft.as_ref().filter(is_own).map_or_else(|| now.to_owned(), |draft| draft.text.clone());
        let mut field = |ui: &mut Ui| {
            let width = ui.available_width();
            let response = if lines {
                let rows = text.lines().count().clamp(1, 12);
                ui.add(
                    TextEdit::multiline(&mut text).font(TextStyle::Monospace).desired_rows(rows).desired_width(width),
                )
            } else {
                ui.add(TextEdit::singleline(&mut text).desired_width(width))
            };
            response.widget_info(|| WidgetInfo::labeled(WidgetType::TextEdit, true, said));
            response
        };
        let response = if lines {
            ui.label(label);
            field(ui)
        } else {
            labelled(ui, label, field)
        };
        if response.changed() {
            self.draft = Some(Draft { tag, path: path.to_owned(), text });
        }
        if response.has_focus() {
            return None;
        }
        let draft = self.draft.take_if(|draft| draft.tag == tag && draft.path == path)?;
        let dropped = ui.input(|input| input.key_pressed(Key::Escape));
        (!dropped && draft.text != now).then_some(draft.text)
    }
}

/// Draws a button that resets a value. Its name does not depend on what else is drawn, so that fields below keep the
/// keyboard when it comes or goes.
fn reset_button(ui: &Ui, place: Rect, of: (Uid, &str), label: &str) -> bool {
    let button = ui.interact(place, ui.id().with((of, "reset")), Sense::click());
    let said = format!("Reset {label} to default");
    button.widget_info(|| WidgetInfo::labeled(WidgetType::Button, true, &said));
    let visuals = ui.visuals();
    let is_lit = button.hovered() || button.has_focus();
    let color = if is_lit { visuals.strong_text_color() } else { visuals.weak_text_color() };
    list::symbol(ui, place, "⮪", color);
    button.on_hover_text("Reset to default").clicked()
}

fn axis_edit(subject: &Subject, path: &str, axis: usize, edit: NumberEdit) -> ValueEdit {
    let each = |number: f32| -> Result<Vec<(Uid, String)>, ValueError> {
        let mut changed = Vec::new();
        for (((_, tag), params), values) in
            subject.entry.tags.iter().zip(&subject.entry.params).zip(&subject.values.commands)
        {
            let mut vector: [f32; 3] = values.get(path).and_then(read).unwrap_or_default();
            vector[axis] = number;
            changed.push((*tag, subject.module.with_value(params, path, &ron_text(&vector))?));
        }
        Ok(changed)
    };
    match edit {
        NumberEdit::Set(number) => each(number).map_or_else(ValueEdit::Refused, ValueEdit::Set),
        NumberEdit::Preview(number) => each(number).map_or_else(ValueEdit::Refused, ValueEdit::Preview),
        NumberEdit::Commit => ValueEdit::Commit,
        NumberEdit::Cancel => ValueEdit::Cancel,
    }
}

/// Three boxes to check; the text of a value that is no vector.
fn boxes(ui: &mut Ui, subject: &Subject, path: &str, label: &str) -> Option<ValueEdit> {
    let text = subject.value(path).value;
    let mut boxes = subject.values.get(path).and_then(|known| known.boxes);
    let mut changed = false;
    labelled(ui, label, |ui| match &mut boxes {
        Some(boxes) => {
            for (on, axis) in boxes.iter_mut().zip(["X", "Y", "Z"]) {
                changed |= ui.checkbox(on, axis).clicked();
            }
        }
        None => {
            let row = ui.available_rect_before_wrap();
            list::line(ui, row, text, ui.visuals().weak_text_color());
        }
    });
    boxes.filter(|_| changed).map(|boxes| subject.set_to(path, &boxes))
}
