//! Keys of a curve as points on lines: a drag moves one, a double click beside them adds one, a right click removes one.

use bevy_egui::egui::{
    CursorIcon, Id, Key, Pos2, Rect, Sense, Shape, Stroke, StrokeKind, Ui, Vec2, WidgetInfo, WidgetType, pos2, vec2,
};

use crate::{editor::style, rig::Uid};

/// Height of the drawing.
const HEIGHT: f32 = 84.0;
/// Fewest keys that a curve is left with.
const FEWEST: usize = 2;

/// Pairs of driving and driven value.
pub(super) type Keys = Vec<(f32, f32)>;

/// Key that is dragged.
pub(super) struct CurveDrag {
    field: Id,
    number: usize,
    before: Keys,
    now: Keys,
}

/// Change of a curve.
pub(super) enum CurveEdit {
    /// Other keys.
    Set(Keys),
    /// Preview of keys while one is dragged.
    Preview(Keys),
    /// Release after a drag.
    Commit,
    /// Cancelled drag.
    Cancel,
}

/// Scale of a drawing.
struct Plot {
    area: Rect,
    /// Least and greatest values.
    values: Rect,
}

impl Plot {
    fn of(area: Rect, keys: &[(f32, f32)]) -> Self {
        let points: Vec<Pos2> = keys.iter().map(|(x, y)| pos2(*x, *y)).collect();
        let mut values = Rect::from_points(&points);
        if values.width() <= 0.0 {
            values.max.x = values.min.x + 1.0;
        }
        if values.height() <= 0.0 {
            values.max.y = values.min.y + 1.0;
        }
        Self { area, values }
    }

    fn at(&self, (x, y): (f32, f32)) -> Pos2 {
        let across = (x - self.values.min.x) / self.values.width();
        let up = (y - self.values.min.y) / self.values.height();
        pos2(self.area.left() + across * self.area.width(), self.area.bottom() - up * self.area.height())
    }

    /// The values at a place, in thousandths.
    fn values_at(&self, at: Pos2) -> (f32, f32) {
        let across = (at.x - self.area.left()) / self.area.width().max(1.0);
        let up = (self.area.bottom() - at.y) / self.area.height().max(1.0);
        let rounded = |value: f32| (value * 1000.0).round() / 1000.0;
        let [x, y] = [self.values.min.x + across * self.values.width(), self.values.min.y + up * self.values.height()];
        (rounded(x), rounded(y))
    }

    /// The place that a key is dragged to: between its neighbours.
    fn moved(&self, keys: &[(f32, f32)], number: usize, at: Pos2) -> (f32, f32) {
        let gap = 1e-3 * self.values.width();
        let (x, y) = self.values_at(at);
        let before = number.checked_sub(1).and_then(|before| keys.get(before));
        let x = before.map_or(x, |before| x.max(before.0 + gap));
        let x = keys.get(number + 1).map_or(x, |after| x.min(after.0 - gap));
        (x, y)
    }
}

/// Draws the keys of a parameter; returns the change that a person makes.
pub(super) fn show(
    ui: &mut Ui,
    field: (Uid, &str),
    label: &str,
    keys: &[(f32, f32)],
    drag: &mut Option<CurveDrag>,
) -> Option<CurveEdit> {
    let id = ui.id().with((field, "curve"));
    let (rect, _) = ui.allocate_exact_size(vec2(ui.available_width(), HEIGHT), Sense::hover());
    let ground = ui.interact(rect, id, Sense::click());
    ground.widget_info(|| WidgetInfo::labeled(WidgetType::Other, true, format!("{label} as a curve")));
    let held = drag.as_ref().filter(|drag| drag.field == id);
    let plot = Plot::of(rect.shrink2(vec2(12.0, 10.0)), held.map_or(keys, |held| held.before.as_slice()));
    let shown: Keys = held.map_or(keys, |held| held.now.as_slice()).to_vec();
    draw(ui, rect, &plot, &shown);
    let (mut edit, mut is_dragged) = (None, false);
    for (number, key) in shown.iter().enumerate() {
        let place = Rect::from_center_size(plot.at(*key), Vec2::splat(14.0));
        let handle = ui.interact(place, id.with(number), Sense::click_and_drag());
        let said = format!("{label} key {}: {}, {}", number + 1, key.0, key.1);
        handle.widget_info(|| WidgetInfo::labeled(WidgetType::Other, true, &said));
        let is_lit = handle.hovered() || handle.dragged();
        let color = if is_lit { style::accent(ui.visuals()) } else { ui.visuals().strong_text_color() };
        ui.painter().circle_filled(place.center(), if is_lit { 5.0 } else { 4.0 }, color);
        if handle.drag_started() {
            *drag = Some(CurveDrag { field: id, number, before: shown.clone(), now: shown.clone() });
        }
        is_dragged |= handle.dragged();
        let at = handle.interact_pointer_pos().filter(|_| handle.dragged());
        let held = drag.as_mut().filter(|drag| drag.field == id && drag.number == number);
        if let (Some(at), Some(held)) = (at, held) {
            let to = plot.moved(&held.now, number, at);
            if held.now[number] != to {
                held.now[number] = to;
                edit = Some(CurveEdit::Preview(held.now.clone()));
            }
        }
        if handle.secondary_clicked() && shown.len() > FEWEST {
            let others = shown.iter().enumerate().filter(|(other, _)| *other != number);
            edit = Some(CurveEdit::Set(others.map(|(_, key)| *key).collect()));
        }
        handle.on_hover_cursor(CursorIcon::Grab).on_hover_text(said);
    }
    if let Some(held) = drag.take_if(|drag| drag.field == id && !is_dragged) {
        let is_dropped = ui.input(|input| input.key_pressed(Key::Escape)) || held.now == held.before;
        return Some(if is_dropped { CurveEdit::Cancel } else { CurveEdit::Commit });
    }
    if let Some(at) = ground.interact_pointer_pos().filter(|_| ground.double_clicked()) {
        let added = plot.values_at(at);
        let place = shown.partition_point(|key| key.0 < added.0);
        if shown.get(place).is_none_or(|next| next.0 > added.0) {
            let mut keys = shown;
            keys.insert(place, added);
            edit = Some(CurveEdit::Set(keys));
        }
    }
    ground.on_hover_text("Drag keys; a double click adds one, a right click on one removes it");
    edit
}

/// Draws the lines between keys, level before the first and after the last.
fn draw(ui: &Ui, rect: Rect, plot: &Plot, keys: &[(f32, f32)]) {
    let visuals = ui.visuals();
    let edge = Stroke::new(1.0, visuals.widgets.noninteractive.bg_stroke.color);
    ui.painter().rect(rect, 3.0, visuals.extreme_bg_color, edge, StrokeKind::Inside);
    let mut points: Vec<Pos2> = keys.iter().map(|key| plot.at(*key)).collect();
    if let (Some(first), Some(last)) = (points.first().copied(), points.last().copied()) {
        points.insert(0, pos2(rect.left(), first.y));
        points.push(pos2(rect.right(), last.y));
    }
    let line = Shape::line(points, Stroke::new(1.5, visuals.text_color()));
    ui.painter().with_clip_rect(rect.intersect(ui.clip_rect())).add(line);
}
