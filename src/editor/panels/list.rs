//! Lists with any number of rows, of which only the visible ones are drawn.

use std::ops::Range;

use bevy_egui::egui::{
    Align, Align2, Button, Color32, FontId, Layout, Pos2, Rect, ScrollArea, TextEdit, TextStyle, Ui, Vec2, WidgetInfo,
    WidgetType,
    scroll_area::ScrollBarVisibility,
    style::ScrollAnimation,
    text::{LayoutJob, TextWrapping},
    vec2,
};

/// A scrolled list of rows of one height.
pub(super) struct List<'a> {
    pub id: &'a str,
    pub count: usize,
    pub height: f32,
    /// Row to scroll into view.
    pub reveal: Option<usize>,
    /// Keeps the list at its end while rows are added there, if `true`.
    pub follow: bool,
}

impl List<'_> {
    /// Draws the visible rows. `draw` gets the range of visible rows and a function that gives the rectangle of any
    /// row.
    pub fn show(self, ui: &mut Ui, draw: impl FnOnce(&mut Ui, Range<usize>, &dyn Fn(usize) -> Rect)) {
        let List { id, count, height, reveal, follow } = self;
        let area = ScrollArea::vertical()
            .id_salt(id)
            .auto_shrink(false)
            .stick_to_bottom(follow)
            .scroll_bar_visibility(ScrollBarVisibility::VisibleWhenNeeded);
        area.show_viewport(ui, |ui, viewport| {
            ui.set_height(height * count as f32);
            let (corner, width) = (ui.max_rect().min, ui.max_rect().width());
            let row = |number: usize| -> Rect {
                Rect::from_min_size(corner + vec2(0.0, height * number as f32), vec2(width, height))
            };
            let first = (viewport.min.y / height).floor().max(0.0) as usize;
            let last = ((viewport.max.y / height).ceil().max(0.0) as usize).min(count);
            draw(ui, first.min(last)..last, &row);
            if let Some(reveal) = reveal {
                ui.scroll_to_rect_animation(row(reveal), None, ScrollAnimation::none());
            }
        });
    }
}

/// Draws those rows of one height that are visible in the scroll area around them.
pub(super) fn visible_rows(
    ui: &mut Ui,
    count: usize,
    height: f32,
    draw: impl FnOnce(&mut Ui, Range<usize>, &dyn Fn(usize) -> Rect),
) {
    let size = vec2(ui.available_width(), height * count as f32);
    let (_, area) = ui.allocate_space(size);
    let row = |number: usize| -> Rect {
        Rect::from_min_size(area.min + vec2(0.0, height * number as f32), vec2(area.width(), height))
    };
    let seen = ui.clip_rect();
    let first = (((seen.top() - area.top()) / height).floor().max(0.0) as usize).min(count);
    let last = (((seen.bottom() - area.top()) / height).ceil().max(0.0) as usize).min(count);
    draw(ui, first..last.max(first), &row);
}

/// Draws one line of text in a rectangle, vertically centred and cut with an ellipsis; returns `true` if it was cut.
pub(super) fn line(ui: &Ui, rect: Rect, text: &str, color: Color32) -> bool {
    let font = TextStyle::Body.resolve(ui.style());
    let mut job = LayoutJob::simple_singleline(text.to_owned(), font, color);
    job.wrap = TextWrapping::truncate_at_width(rect.width().max(1.0));
    let galley = ui.painter().layout_job(job);
    let at = Pos2::new(rect.left(), rect.center().y - galley.size().y / 2.0);
    let cut = galley.elided;
    ui.painter().galley(at, galley, color);
    cut
}

/// Draws a symbol in the middle of a rectangle.
pub(super) fn symbol(ui: &Ui, rect: Rect, symbol: &str, color: Color32) {
    let size = TextStyle::Body.resolve(ui.style()).size;
    ui.painter().text(rect.center(), Align2::CENTER_CENTER, symbol, FontId::proportional(size), color);
}

/// The height of a row of text.
pub(super) fn row_height(ui: &Ui) -> f32 {
    (ui.text_style_height(&TextStyle::Body) + 4.0).max(18.0).round()
}

/// Draws the text of an empty panel.
pub(super) fn nothing(ui: &mut Ui, text: &str) {
    ui.add_space(8.0);
    ui.vertical_centered(|ui| {
        ui.set_max_width((ui.available_width() - 12.0).max(60.0));
        ui.weak(text);
    });
}

/// Draws a small square button with a symbol.
pub(super) fn symbol_button(ui: &mut Ui, text: &str, tip: &str) -> bool {
    symbol_button_unless(ui, text, tip, None)
}

/// Draws a button with a symbol, greyed with the reason why it can do nothing, if there is one; returns `true` when it is clicked.
pub(super) fn symbol_button_unless(ui: &mut Ui, text: &str, tip: &str, why_not: Option<&str>) -> bool {
    let side = ui.spacing().interact_size.y;
    let button = Button::new(text).min_size(Vec2::splat(side));
    let can = why_not.is_none() && ui.is_enabled();
    let response = ui.add_enabled(can, button).on_hover_text(tip);
    response.widget_info(|| WidgetInfo::labeled(WidgetType::Button, can, tip));
    let is_clicked = response.clicked();
    if let Some(why_not) = why_not {
        response.on_disabled_hover_text(why_not);
    }
    is_clicked
}

/// Draws a search field with the given buttons to its right, from right to left.
pub(super) fn search_bar(ui: &mut Ui, name: &str, tip: &str, text: &mut String, buttons: impl FnOnce(&mut Ui)) {
    let size = vec2(ui.available_width(), ui.spacing().interact_size.y);
    ui.allocate_ui_with_layout(size, Layout::right_to_left(Align::Center), |ui| {
        ui.spacing_mut().button_padding.x = 4.0;
        ui.spacing_mut().item_spacing.x = 3.0;
        buttons(ui);
        if !text.is_empty() && symbol_button(ui, "✖", &format!("Clear {}", name.to_lowercase())) {
            text.clear();
        }
        let width = ui.available_width();
        let response = ui.add(TextEdit::singleline(text).hint_text(name).desired_width(width));
        response.widget_info(|| WidgetInfo::labeled(WidgetType::TextEdit, true, name));
        response.on_hover_text(tip);
    });
}
