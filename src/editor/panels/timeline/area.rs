//! The keys of the timeline: marks are painted row by row, and a press on them selects, drags, or draws a box.

use bevy::math::ops;
use bevy_egui::egui::{
    Color32, Key, Modifiers, Painter, PointerButton, Pos2, Rect, Response, Shape, Stroke, StrokeKind, Ui, pos2, vec2,
};

use super::{
    axis::TimeAxis,
    colors::KeyColors,
    drag::KeyDrag,
    marks::{Bucket, HALF, MarkKind, bucket_at, buckets, count_within},
    sheet::{Row, Sheet},
    state::{OpenClip, Timeline, TimelineRequest, add, contains, subtract},
};
use crate::{
    editor::panel::Requests,
    plugins::document::{Change, EditRequest},
    rig::operations::{ClipOperation, KeyOperation, KeyTimes, Operation},
};

/// Gesture of the pointer on the keys.
pub(super) enum Gesture {
    /// A box that selects keys, from its first corner.
    Box(Pos2),
    /// Keys that are dragged.
    Keys(KeyDrag),
    /// Time that is panned.
    Pan,
}

/// Places of the rows and of time on the screen.
pub(super) struct Grid<'a> {
    pub rows: &'a [Row],
    pub axis: TimeAxis,
    /// Upper edge of the first row, which may be scrolled out of view.
    pub top: f32,
    pub height: f32,
}

impl Grid<'_> {
    fn row_at(&self, y: f32) -> Option<Row> {
        let number = ((y - self.top) / self.height).floor();
        if number < 0.0 { None } else { self.rows.get(number as usize).copied() }
    }

    fn rows_between(&self, from: f32, to: f32) -> &[Row] {
        let place = |y: f32| ((y - self.top) / self.height).floor().max(0.0) as usize;
        let (first, last) = (place(from.min(to)), (place(from.max(to)) + 1).min(self.rows.len()));
        self.rows.get(first..last).unwrap_or_default()
    }

    /// Keys of the mark under a pixel, with the time of the first one.
    fn hit(&self, sheet: &Sheet, at: Pos2) -> Option<(KeyTimes, f32)> {
        let row = self.row_at(at.y)?;
        let bucket = bucket_at(&buckets(sheet.marks_of(row), &self.axis), at.x)?;
        Some((sheet.keys_within(row, bucket.times), bucket.times[0]))
    }
}

/// Paints the marks of a row.
pub(super) fn paint(
    painter: &Painter,
    rect: Rect,
    axis: &TimeAxis,
    (sheet, row): (&Sheet, Row),
    selected: &[f32],
    colors: &KeyColors,
) {
    let (middle, most) = (rect.center().y, rect.height() * 0.5 - 1.0);
    let quiet = matches!(row, Row::All | Row::Node(_));
    for bucket in buckets(sheet.marks_of(row), axis) {
        let chosen = count_within(selected, bucket.times);
        let plain = if quiet { colors.sum } else { colors.key };
        painter.add(shape(&bucket, (middle, most), chosen, plain, colors));
    }
}

/// Shape of a mark: squares are stepped, diamonds linear, discs cubic; bars stand for many keys, and grow with their number.
fn shape(bucket: &Bucket, (middle, most): (f32, f32), chosen: usize, plain: Color32, colors: &KeyColors) -> Shape {
    let color = match chosen {
        0 => plain,
        chosen if chosen < bucket.count => plain.lerp_to_gamma(colors.accent, 0.6),
        _ => colors.accent,
    };
    let line = Stroke::new(1.0, colors.outline);
    if bucket.count > 1 {
        let high = (3.0 + ops::log2(bucket.count as f32)).min(most);
        let corners = [pos2(bucket.x[0] - 2.0, middle - high), pos2(bucket.x[1] + 2.0, middle + high)];
        return Shape::rect_filled(Rect::from_min_max(corners[0], corners[1]), 1.0, color);
    }
    let at = pos2(bucket.x[0], middle);
    match bucket.kind {
        MarkKind::Stepped => Shape::convex_polygon(
            [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)].map(|(x, y)| at + vec2(x, y) * (HALF - 1.0)).to_vec(),
            color,
            line,
        ),
        MarkKind::Linear => Shape::convex_polygon(
            [(0.0, -1.0), (1.0, 0.0), (0.0, 1.0), (-1.0, 0.0)].map(|(x, y)| at + vec2(x, y) * HALF).to_vec(),
            color,
            line,
        ),
        MarkKind::Cubic => Shape::circle_filled(at, HALF - 0.5, color),
    }
}

/// Handles the pointer on the keys. Returns true while a gesture lasts that changes the shown keys.
pub(super) fn gestures(
    gesture: &mut Option<Gesture>,
    ui: &Ui,
    response: &Response,
    grid: &Grid,
    sheet: &Sheet,
    open: &OpenClip,
    timeline: &Timeline,
    requests: &mut Requests,
) -> bool {
    let held = ui.input(|input| input.modifiers);
    let at = response.interact_pointer_pos().or_else(|| ui.input(|input| input.pointer.latest_pos()));
    if response.drag_started()
        && let Some(press) = ui.input(|input| input.pointer.press_origin())
    {
        *gesture = begin(response, grid, sheet, open, timeline, press, held, requests);
    }
    let escaped = ui.input(|input| input.key_pressed(Key::Escape));
    let is_over = response.drag_stopped() || !response.dragged();
    let mut is_changed = false;
    match gesture {
        Some(Gesture::Pan) => requests.send(TimelineRequest::Show(grid.axis.panned(response.drag_delta().x))),
        Some(Gesture::Keys(drag)) => {
            if let Some(at) = at.filter(|_| !escaped)
                && drag.to(open.clip, grid.axis.time(at.x), held.alt)
            {
                is_changed = true;
                requests.send(preview(open, drag.shown.clone()));
            }
        }
        Some(Gesture::Box(from)) => {
            if let Some(at) = at {
                let rect = Rect::from_two_pos(*from, at);
                let painter = ui.painter_at(response.rect);
                let accent = KeyColors::of(ui.visuals()).accent;
                painter.rect_filled(rect, 0.0, accent.gamma_multiply(0.12));
                painter.rect_stroke(rect, 0.0, Stroke::new(1.0, accent), StrokeKind::Inside);
            }
        }
        None => {}
    }
    if is_over && let Some(over) = gesture.take() {
        is_changed = true;
        let was_dropped = escaped || !response.drag_stopped();
        end(over, grid, sheet, open, timeline, at.filter(|_| !was_dropped), held.shift || held.command, requests);
    }
    if gesture.is_none() {
        click(response, grid, sheet, timeline, (held.shift, held.command), requests);
    }
    is_changed
}

/// The gesture of a press that has become a drag.
fn begin(
    response: &Response,
    grid: &Grid,
    sheet: &Sheet,
    open: &OpenClip,
    timeline: &Timeline,
    press: Pos2,
    held: Modifiers,
    requests: &mut Requests,
) -> Option<Gesture> {
    if response.dragged_by(PointerButton::Middle) {
        return Some(Gesture::Pan);
    }
    if !response.dragged_by(PointerButton::Primary) {
        return None;
    }
    let Some((keys, time)) = grid.hit(sheet, press) else { return Some(Gesture::Box(press)) };
    let keys = match contains(&timeline.keys, &keys) {
        true => timeline.keys.clone(),
        false => {
            let mut next = if held.shift { timeline.keys.clone() } else { KeyTimes::new() };
            add(&mut next, &keys);
            requests.send(TimelineRequest::Select(next.clone()));
            next
        }
    };
    let pivot = held.command.then_some(open.time);
    Some(Gesture::Keys(KeyDrag::new(keys, time, grid.axis.time(press.x), pivot)))
}

/// Request for the preview of a drag, or for its end where the keys are back in their places.
pub(in crate::editor::panels) fn preview(open: &OpenClip, change: Option<KeyOperation>) -> EditRequest {
    let change = match (change, open.layer) {
        (Some(change), Some(layer)) => {
            let operation = ClipOperation::Keys { clip: open.clip.uid, layer: layer.uid, change };
            Change::Preview(Operation::Clips(operation))
        }
        _ => Change::CancelPreview,
    };
    EditRequest { rig: open.entity, change }
}

/// Ends a gesture; `at` is the place of the release, or `None` if the gesture was dropped.
fn end(
    gesture: Gesture,
    grid: &Grid,
    sheet: &Sheet,
    open: &OpenClip,
    timeline: &Timeline,
    at: Option<Pos2>,
    more: bool,
    requests: &mut Requests,
) {
    match (gesture, at) {
        (Gesture::Keys(drag), at) => {
            let is_moved = drag.shown.is_some() && at.is_some();
            let change = if is_moved { Change::Commit } else { Change::CancelPreview };
            requests.send(EditRequest { rig: open.entity, change });
            if is_moved {
                requests.send(TimelineRequest::Select(drag.moved));
            }
        }
        (Gesture::Box(from), Some(at)) => {
            let span = [grid.axis.time(from.x.min(at.x)), grid.axis.time(from.x.max(at.x))];
            let mut keys = if more { timeline.keys.clone() } else { KeyTimes::new() };
            for row in grid.rows_between(from.y, at.y) {
                add(&mut keys, &sheet.keys_within(*row, span));
            }
            requests.send(TimelineRequest::Select(keys));
        }
        (Gesture::Box(_), None) | (Gesture::Pan, _) => {}
    }
}

/// Clicks select the key under them, with Shift more and with Control one more or less; beside the keys they select none.
fn click(
    response: &Response,
    grid: &Grid,
    sheet: &Sheet,
    timeline: &Timeline,
    (shift, command): (bool, bool),
    requests: &mut Requests,
) {
    if !response.clicked() && !response.secondary_clicked() {
        return;
    }
    let Some(at) = response.interact_pointer_pos() else { return };
    let hit = grid.hit(sheet, at).map(|(keys, _)| keys);
    let is_selected = hit.as_ref().is_some_and(|keys| contains(&timeline.keys, keys));
    if response.secondary_clicked() && (is_selected || hit.is_none()) {
        return;
    }
    let next = match hit {
        None if shift || command => return,
        None => KeyTimes::new(),
        Some(keys) if command && is_selected => {
            let mut next = timeline.keys.clone();
            subtract(&mut next, &keys);
            next
        }
        Some(keys) if shift || command => {
            let mut next = timeline.keys.clone();
            add(&mut next, &keys);
            next
        }
        Some(keys) => keys,
    };
    requests.send(TimelineRequest::Select(next));
}
