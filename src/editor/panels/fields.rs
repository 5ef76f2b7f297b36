//! Fields of forms: a name and a value, numbers that are dragged or typed, and "mixed" where joints differ.

use std::{cell::Cell, ops::RangeInclusive};

use bevy_egui::egui::{
    self, Align, Color32, DragValue, Id, Key, Layout, Rect, Response, RichText, Sense, Slider, SliderClamping,
    TextEdit, Ui, Widget, WidgetInfo, WidgetType,
    text::{CCursor, CCursorRange},
    text_edit::TextEditState,
    vec2,
};

use super::list;
use crate::{
    editor::{notice::Notice, panel::Requests, style},
    rig::proportion::{ProportionError, Quantity},
};

/// A value of several joints: that of the active one, and whether it differs among them.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct CommonValue<T> {
    pub value: T,
    pub mixed: bool,
}

impl<T> From<T> for CommonValue<T> {
    fn from(value: T) -> Self {
        Self { value, mixed: false }
    }
}

impl<T: PartialEq> CommonValue<T> {
    /// The last of `values` is the active one's; `None` if there is none.
    pub fn of(values: impl DoubleEndedIterator<Item = T>) -> Option<Self> {
        let mut values = values.rev();
        let value = values.next()?;
        let mixed = values.any(|other| other != value);
        Some(Self { value, mixed })
    }
}

/// Width of the number beside a slider.
const SLIDER_NUMBER: f32 = 52.0;
/// Least width of a slider.
const LEAST_SLIDER: f32 = 48.0;

/// Text for values that differ.
pub(super) const MIXED: &str = "mixed";

/// A row with a name on the left.
pub(super) fn labelled<R>(ui: &mut Ui, name: &str, add: impl FnOnce(&mut Ui) -> R) -> R {
    let row = |ui: &mut Ui| {
        let width = (ui.available_width() * 0.34).clamp(58.0, 96.0);
        let (rect, response) = ui.allocate_exact_size(vec2(width, ui.spacing().interact_size.y), Sense::hover());
        if list::line(ui, rect, name, ui.visuals().text_color()) {
            response.on_hover_text(name);
        }
        add(ui)
    };
    ui.with_layout(Layout::left_to_right(Align::Min), |ui| {
        ui.allocate_ui(vec2(ui.available_width(), 0.0), |ui| ui.horizontal(row).inner).inner
    })
    .inner
}

/// Names a widget for screen readers.
pub(super) fn named(ui: &Ui, widget: Id, name: &str) {
    ui.ctx().accesskit_node_builder(widget, |node| node.set_label(name));
}

/// Button that shows a colour and opens its picker. The colour is in sRGB, 0 to 1 each, as documents have it.
pub(super) fn color_button(ui: &mut Ui, color: &mut [f32; 3]) -> Response {
    let mut bytes = color.map(|share| (share.clamp(0.0, 1.0) * 255.0).round() as u8);
    let response = ui.color_edit_button_srgb(&mut bytes);
    if response.changed() {
        *color = bytes.map(|byte| f32::from(byte) / 255.0);
    }
    response
}

/// Result of editing a name in place.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Renaming {
    /// The field has the keyboard focus.
    Typing,
    /// Escape was pressed.
    Dropped,
    /// Enter was pressed, or a click was elsewhere.
    Accepted,
}

/// Draws a text field in place of a name, with the whole text selected at first. `focused` is set once it has had the
/// keyboard focus.
pub(super) fn rename(ui: &mut Ui, rect: Rect, id: Id, said: &str, text: &mut String, focused: &mut bool) -> Renaming {
    let field = TextEdit::singleline(text).id(id).margin(vec2(3.0, 1.0)).desired_width(rect.width());
    let response = ui.place(rect, field);
    response.widget_info(|| WidgetInfo::labeled(WidgetType::TextEdit, true, said));
    if !*focused {
        *focused = true;
        response.request_focus();
        let mut state = TextEditState::load(ui.ctx(), id).unwrap_or_default();
        let all = CCursorRange::two(CCursor::new(0), CCursor::new(text.chars().count()));
        state.cursor.set_char_range(Some(all));
        state.store(ui.ctx(), id);
        Renaming::Typing
    } else if response.has_focus() {
        Renaming::Typing
    } else if ui.input(|input| input.key_pressed(Key::Escape)) {
        Renaming::Dropped
    } else {
        Renaming::Accepted
    }
}

/// Number fields: during a drag the rig shows a preview, and the release makes one step.
#[derive(Default)]
pub(super) struct Numbers {
    dragged: Option<DraggedNumber>,
    /// The field left in this frame: egui returns the typed text once more in the next one.
    left: Option<Id>,
    /// The last typed text that was not taken: its field and the reason.
    refused: Option<(String, NumberError)>,
}

/// Reason why a typed number is not taken.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
enum NumberError {
    /// The text is no number.
    #[error("\"{0}\" is no number; write one such as 1.5 or -20")]
    NoNumber(String),
    /// The number is no weight.
    #[error("{0} is no weight; write one from 0 to 1")]
    NoWeight(f32),
    /// The number lies beyond the ends of its field.
    #[error("{number} is none of its numbers; write one {}", ends(low, high))]
    Outside {
        /// The number.
        number: f64,
        /// Least number of the field; minus infinity for none.
        low: f64,
        /// Largest number of the field; infinity for none.
        high: f64,
    },
    /// The number has a fraction.
    #[error("{0} is no whole number; write one such as 3")]
    NotWhole(f64),
    /// The number makes no sense on the rig.
    #[error(transparent)]
    Proportion(#[from] ProportionError),
}

/// Words for the ends of a field.
fn ends(low: &f64, high: &f64) -> String {
    match (low.is_finite(), high.is_finite()) {
        (true, false) => format!("of at least {low}"),
        (false, true) => format!("of at most {high}"),
        _ => format!("from {low} to {high}"),
    }
}

/// The number that people read for one of few digits.
pub(super) fn decimal(number: f32) -> f64 {
    number.to_string().parse().unwrap_or_else(|_| f64::from(number))
}

/// Draws a field of egui's own under a name for screen readers. Escape leaves its text behind: by itself such a field takes the
/// text over one frame after Escape, and another identity has none.
pub(in crate::editor) fn typed_field(ui: &mut Ui, said: &str, field: impl Widget) -> Response {
    let drops = ui.id().with((said, "dropped texts"));
    let dropped = ui.data(|data| data.get_temp::<u32>(drops)).unwrap_or_default();
    let response = ui.push_id((said, dropped), |ui| ui.add(field)).inner;
    named(ui, response.id, said);
    if response.lost_focus() && ui.input(|input| input.key_pressed(Key::Escape)) {
        ui.data_mut(|data| data.insert_temp(drops, dropped.wrapping_add(1)));
    }
    response
}

/// Text that was typed into a field of egui's own and not taken. By itself such a field drops wrong texts, and cuts off numbers
/// beyond its ends, without a word.
#[derive(Default)]
pub(in crate::editor) struct TypedText(Cell<Option<NumberError>>);

impl TypedText {
    /// Reader of the texts of a field with two ends and a unit. The field must not be updated while a text is typed.
    pub fn reader(&self, ends: RangeInclusive<f64>, suffix: &'static str) -> impl Fn(&str) -> Option<f64> {
        move |text| self.taken(read(text, &ends, suffix))
    }

    /// Reader as of [`Self::reader`], of a field that takes whole numbers only.
    pub fn whole_reader(&self, ends: RangeInclusive<f64>, suffix: &'static str) -> impl Fn(&str) -> Option<f64> {
        let whole = |number: f64| if number.fract() == 0.0 { Ok(number) } else { Err(NumberError::NotWhole(number)) };
        move |text| self.taken(read(text, &ends, suffix).and_then(whole))
    }

    /// The number that was read; keeps the reason of a text that is not taken.
    fn taken(&self, read: Result<f64, NumberError>) -> Option<f64> {
        let (number, refused) = match read {
            Ok(number) => (Some(number), None),
            Err(reason) => (None, Some(reason)),
        };
        self.0.set(refused);
        number
    }

    /// True if the last text was not taken.
    pub fn is_refused(&self) -> bool {
        let refused = self.0.take();
        let is_refused = refused.is_some();
        self.0.set(refused);
        is_refused
    }

    /// Sends a notice if the text of a field was not taken.
    pub fn tell(self, field: &Response, said: &str, requests: &mut Requests) {
        let Some(reason) = self.0.into_inner() else { return };
        // egui reads a text when its field is left, and once more in the next pass.
        let (id, now) = (field.id.with("refused"), field.ctx.cumulative_pass_nr());
        let last = field.ctx.data_mut(|data| {
            let last = data.get_temp::<u64>(id);
            data.insert_temp(id, now);
            last
        });
        if last.is_none_or(|last| now > last + 1) {
            requests.send(Notice::warning(format!("{said} stays as it was: {reason}.")));
        }
    }
}

/// The number that is being dragged.
#[derive(Debug, Clone, Copy)]
struct DraggedNumber {
    id: Id,
    from: f64,
    value: f64,
}

/// Edit of a number.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum NumberEdit {
    /// A typed value.
    Set(f32),
    /// Preview of a drag.
    Preview(f32),
    /// Release after a drag.
    Commit,
    /// Cancelled drag.
    Cancel,
}

/// Display and drag settings of a number.
#[derive(Debug, Clone, Copy)]
pub(super) struct Look {
    /// Change of the value per pixel.
    pub speed: f64,
    pub decimals: usize,
    pub suffix: &'static str,
    /// Kind of the number, which limits it.
    pub quantity: Quantity,
}

impl Numbers {
    /// Sends a notice if a typed text was not taken. Panels call it after their fields.
    pub fn tell(&mut self, requests: &mut Requests) {
        if let Some((field, reason)) = self.refused.take() {
            requests.send(Notice::warning(format!("{field} stays as it was: {reason}.")));
        }
    }

    /// The edit of a number whose field has two ends: a typed number beyond them is noted for [`Self::tell`], and a drag stops
    /// at them.
    pub fn between(&mut self, field: &str, edit: NumberEdit, [low, high]: [f32; 2]) -> Option<NumberEdit> {
        match edit {
            NumberEdit::Set(number) if !(low..=high).contains(&number) => {
                let [number, low, high] = [number, low, high].map(decimal);
                self.refused = Some((field.to_owned(), NumberError::Outside { number, low, high }));
                None
            }
            NumberEdit::Preview(number) => Some(NumberEdit::Preview(number.min(high).max(low))),
            other => Some(other),
        }
    }

    /// Notes that a typed number is no weight, for [`Self::tell`].
    pub fn refuse_weight(&mut self, field: &str, number: f32) {
        self.refused = Some((field.to_owned(), NumberError::NoWeight(number)));
    }

    /// Three fields, X, Y and Z, beside each other, or below each other in a narrow panel. Returns the axis and its
    /// edit.
    pub fn vector(
        &mut self,
        ui: &mut Ui,
        name: &str,
        shown: [CommonValue<f32>; 3],
        look: Look,
    ) -> Option<(usize, NumberEdit)> {
        ui.label(name);
        let mut edited = None;
        // Three angles such as "Z -123.45°" beside each other need about 200 pixels.
        let narrow = ui.available_width() < 200.0;
        let height = ui.spacing().interact_size.y;
        let mut fields = |ui: &mut Ui| {
            ui.spacing_mut().item_spacing.x = 3.0;
            let width = if narrow { ui.available_width() } else { ((ui.available_width() - 6.0) / 3.0).floor() };
            for (axis, (letter, color)) in AXES.into_iter().enumerate() {
                let prefix = RichText::new(format!("{letter} ")).color(style::readable(ui.visuals(), color));
                let said = format!("{name} {letter}");
                if let Some(edit) = self.field(ui, &said, prefix, shown[axis], look, vec2(width, height)) {
                    edited = Some((axis, edit));
                }
            }
        };
        if narrow {
            ui.vertical(|ui| fields(ui))
        } else {
            ui.horizontal(|ui| fields(ui))
        };
        ui.add_space(2.0);
        edited
    }

    /// One number beside its name.
    pub fn number(
        &mut self,
        ui: &mut Ui,
        name: &str,
        shown: impl Into<CommonValue<f32>>,
        look: Look,
    ) -> Option<NumberEdit> {
        labelled(ui, name, |ui| {
            let size = vec2(ui.available_width(), ui.spacing().interact_size.y);
            self.field(ui, name, RichText::new(""), shown.into(), look, size)
        })
    }

    /// One number beside its name, with a slider between two ends where there is room for it. Numbers beyond the ends can be
    /// typed.
    pub fn slider(
        &mut self,
        ui: &mut Ui,
        name: &str,
        shown: CommonValue<f32>,
        ends: [f32; 2],
        look: Look,
    ) -> Option<NumberEdit> {
        labelled(ui, name, |ui| {
            let (width, height) = (ui.available_width(), ui.spacing().interact_size.y);
            let room = width - SLIDER_NUMBER - ui.spacing().item_spacing.x;
            if room < LEAST_SLIDER {
                return self.field(ui, name, RichText::new(""), shown, look, vec2(width, height));
            }
            ui.spacing_mut().slider_width = room;
            let slid = self.slide(ui, name, shown.value, ends, look.speed);
            let typed = self.field(ui, name, RichText::new(""), shown, look, vec2(SLIDER_NUMBER, height));
            slid.or(typed)
        })
    }

    /// Draws the slider of a number. Escape drops the dragged value.
    fn slide(&mut self, ui: &mut Ui, name: &str, now: f32, [low, high]: [f32; 2], step: f64) -> Option<NumberEdit> {
        let id = ui.id().with((name, "slider"));
        let held = self.dragged.filter(|dragged| dragged.id == id);
        let mut value = held.map_or(f64::from(now), |held| held.value);
        let slider = Slider::new(&mut value, f64::from(low)..=f64::from(high)).step_by(step);
        let response = ui.add(slider.clamping(SliderClamping::Edits).show_value(false));
        named(ui, response.id, &format!("{name} slider"));
        let is_held = response.dragged() || response.is_pointer_button_down_on();
        if is_held && response.changed() {
            let from = held.map_or(f64::from(now), |held| held.from);
            self.dragged = Some(DraggedNumber { id, from, value });
            return Some(NumberEdit::Preview(value as f32));
        }
        if let Some(DraggedNumber { from, value, .. }) = held.filter(|_| !is_held) {
            self.dragged = None;
            let is_escaped = ui.input(|input| input.key_pressed(Key::Escape));
            let is_dropped = is_escaped || !response.drag_stopped() || value == from;
            return Some(if is_dropped { NumberEdit::Cancel } else { NumberEdit::Commit });
        }
        // Keys move it, too.
        response.changed().then_some(NumberEdit::Set(value as f32))
    }

    /// Draws one field. Escape drops the typed or dragged value.
    pub fn field(
        &mut self,
        ui: &mut Ui,
        said: &str,
        prefix: RichText,
        shown: CommonValue<f32>,
        look: Look,
        size: egui::Vec2,
    ) -> Option<NumberEdit> {
        let id = ui.id().with(said);
        let dragged = self.dragged.filter(|dragged| dragged.id == id);
        let mut value = dragged.map_or(f64::from(shown.value), |dragged| dragged.value);
        let typed: Cell<Option<f64>> = Cell::new(None);
        let wrong: Cell<Option<String>> = Cell::new(None);
        let mixed = shown.mixed && dragged.is_none();
        let field = DragValue::new(&mut value)
            .speed(look.speed)
            .max_decimals(look.decimals)
            .prefix(prefix)
            .suffix(look.suffix)
            .update_while_editing(false)
            .custom_formatter(|number, _| if mixed { MIXED.to_owned() } else { short(number, look.decimals) })
            .custom_parser(|text| {
                let number = parse(text, look.suffix);
                match number {
                    Some(_) => typed.set(number),
                    None => wrong.set(Some(text.trim().to_owned()).filter(|text| text != MIXED)),
                }
                number
            });
        let response = ui.push_id(said, |ui| ui.add_sized(size, field)).inner;
        ui.ctx().accesskit_node_builder(response.id, |node| node.set_label(said));
        let escaped = ui.input(|input| input.key_pressed(Key::Escape));
        if response.dragged() && response.changed() && value.is_finite() {
            let from = dragged.map_or(f64::from(shown.value), |dragged| dragged.from);
            self.dragged = Some(DraggedNumber { id, from, value });
            // A drag passes over numbers that make no sense, such as a scale of zero.
            return look.quantity.check(value as f32).is_ok().then_some(NumberEdit::Preview(value as f32));
        }
        if let Some(DraggedNumber { from, value, .. }) = dragged.filter(|_| !response.dragged()) {
            self.dragged = None;
            // Escape, a lost pointer, or a return to the first value cancels the drag.
            let dropped = escaped || !response.drag_stopped() || value == from;
            return Some(if dropped { NumberEdit::Cancel } else { NumberEdit::Commit });
        }
        let is_repeated = self.left.take_if(|left| *left == id).is_some();
        let wrong = wrong.take();
        let is_read = typed.get().is_some() || wrong.is_some();
        if response.lost_focus() && !is_repeated && (escaped || is_read) {
            self.left = Some(id);
        }
        if escaped || is_repeated {
            return None;
        }
        // While a text is being typed the field has changed, but not its number: of several numbers it shows the first.
        let other = (value != f64::from(shown.value)).then_some(value);
        let Some(number) = typed.get().or(other) else {
            if let Some(text) = wrong {
                self.refused = Some((said.to_owned(), NumberError::NoNumber(text)));
            }
            return None;
        };
        let number = number as f32;
        // Confirming the visible digits keeps the hidden ones.
        if !shown.mixed && short(number.into(), look.decimals) == short(shown.value.into(), look.decimals) {
            return None;
        }
        if let Err(reason) = look.quantity.check(number) {
            self.refused = Some((said.to_owned(), reason.into()));
            return None;
        }
        Some(NumberEdit::Set(number))
    }
}

const AXES: [(&str, Color32); 3] = [
    ("X", Color32::from_rgb(230, 96, 96)),
    ("Y", Color32::from_rgb(120, 190, 80)),
    ("Z", Color32::from_rgb(90, 150, 240)),
];

/// A number without trailing zeros.
pub(super) fn short(number: f64, decimals: usize) -> String {
    let text = format!("{number:.decimals$}");
    let text = if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.') } else { &text };
    if text == "-0" { "0".to_owned() } else { text.to_owned() }
}

/// The number of a text, between two ends.
fn read(text: &str, ends: &RangeInclusive<f64>, suffix: &str) -> Result<f64, NumberError> {
    let number = parse(text, suffix).ok_or_else(|| NumberError::NoNumber(text.trim().to_owned()))?;
    match ends.contains(&number) {
        true => Ok(number),
        false => Err(NumberError::Outside { number, low: *ends.start(), high: *ends.end() }),
    }
}

/// A typed number: with a comma or a point, with or without its unit.
fn parse(text: &str, suffix: &str) -> Option<f64> {
    let text = text.trim().trim_end_matches(suffix.trim()).trim().replace(',', ".").replace('−', "-");
    text.parse::<f64>().ok().filter(|number| number.is_finite())
}
