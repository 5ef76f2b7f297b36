//! The ruler of the timeline: frames, the range of the clip, the playhead and the markers.

use bevy_egui::egui::{
    Align2, Color32, FontId, Key, PointerButton, Pos2, Rect, Response, Sense, Shape, Stroke, Ui, WidgetInfo,
    WidgetType, pos2, vec2,
};

use super::{
    action::TimelineAction,
    axis::TimeAxis,
    bar::about,
    colors::KeyColors,
    state::{OpenClip, TimelineRequest, snapped},
};
use crate::{
    editor::{
        actions::{Action, ActionRequest},
        panel::Requests,
        panels::{
            fields::{self, Renaming},
            list,
        },
    },
    plugins::document::EditRequest,
    rig::{
        animation::{ClipAbout, Marker, RigClip},
        operations::Operation,
    },
};

/// Height of the frames.
const FRAMES: f32 = 22.0;
/// Height of the markers below them.
const MARKERS: f32 = 15.0;

/// State of the markers.
#[derive(Default)]
pub(in crate::editor::panels) struct Markers {
    /// Marker that is dragged, with its time.
    dragged: Option<(usize, f32)>,
    rename: Option<Rename>,
}

/// Name of a marker that is being typed.
struct Rename {
    marker: usize,
    text: String,
    focused: bool,
}

/// Height of the ruler of a clip.
pub(in crate::editor::panels) fn height(clip: &RigClip) -> f32 {
    if clip.markers.is_empty() { FRAMES } else { FRAMES + MARKERS }
}

/// Draws the ruler; a drag in it scrubs.
pub(in crate::editor::panels) fn show(
    markers: &mut Markers,
    ui: &mut Ui,
    rect: Rect,
    axis: &TimeAxis,
    open: &OpenClip,
    requests: &mut Requests,
) {
    let frames = rect.with_max_y(rect.top() + FRAMES);
    let response = ui.interact(frames, ui.id().with("ruler"), Sense::click_and_drag());
    response.widget_info(|| WidgetInfo::slider(true, f64::from(open.frame()), "Playhead"));
    scrub(ui, &response, axis, open, requests);
    paint(ui, frames, axis, open);
    if open.clip.markers.is_empty() {
        (markers.dragged, markers.rename) = (None, None);
    } else {
        let strip = rect.with_min_y(frames.bottom());
        markers.show(ui, strip, axis, open, requests);
    }
    if response.double_clicked() {
        requests.send(ActionRequest(Action::Timeline(TimelineAction::Fit)));
    }
    response.on_hover_text("Drag to scrub, with Shift between frames; a double click shows the whole clip");
}

/// Puts the playhead to the pointer while the button is held, or pans with the middle one.
fn scrub(ui: &Ui, response: &Response, axis: &TimeAxis, open: &OpenClip, requests: &mut Requests) {
    if response.dragged_by(PointerButton::Middle) {
        requests.send(TimelineRequest::Show(axis.panned(response.drag_delta().x)));
        return;
    }
    let is_held = response.is_pointer_button_down_on() && ui.input(|input| input.pointer.primary_down());
    let Some(at) = response.interact_pointer_pos().filter(|_| is_held || response.clicked()) else { return };
    let time = axis.time(at.x.clamp(axis.x.min, axis.x.max));
    let time = if ui.input(|input| input.modifiers.shift) { time } else { snapped(open.clip, time) };
    if time != open.time {
        requests.send(TimelineRequest::Scrub(time));
    }
}

/// Frames on which the ruler has lines.
pub(in crate::editor::panels) fn lines(axis: &TimeAxis, clip: &RigClip) -> impl Iterator<Item = (i64, f32)> {
    let step = axis.step(clip.frame_rate);
    let first = (f64::from(axis.span[0]) * f64::from(clip.frame_rate) / step as f64).ceil() as i64;
    let last = (f64::from(axis.span[1]) * f64::from(clip.frame_rate) / step as f64).floor() as i64;
    let most = (axis.x.span() / 20.0) as i64;
    let axis = *axis;
    let rate = f64::from(clip.frame_rate);
    (first..=last.min(first + most)).map(move |number| {
        let frame = number * step;
        (frame, axis.at((frame as f64 / rate) as f32))
    })
}

fn paint(ui: &Ui, rect: Rect, axis: &TimeAxis, open: &OpenClip) {
    let painter = ui.painter_at(rect);
    painter.rect_filled(rect, 0.0, ui.visuals().extreme_bg_color);
    let [start, end] = open.clip.range.map(|time| axis.at(time));
    let range = Rect::from_min_max(pos2(start, rect.bottom() - 3.0), pos2(end, rect.bottom()));
    let colors = KeyColors::of(ui.visuals());
    painter.rect_filled(range, 0.0, colors.accent.gamma_multiply(0.45));
    let quiet = ui.visuals().weak_text_color();
    for (frame, x) in lines(axis, open.clip) {
        painter.vline(x, rect.bottom() - 7.0..=rect.bottom(), Stroke::new(1.0, quiet));
        painter.text(pos2(x + 3.0, rect.center().y), Align2::LEFT_CENTER, frame, FontId::proportional(10.0), quiet);
    }
    let x = axis.at(open.time);
    let frame = fields::short(f64::from(open.frame()), 2);
    let galley = painter.layout_no_wrap(frame, FontId::proportional(11.0), colors.on_accent);
    let half = galley.size().x / 2.0 + 4.0;
    let middle = x.clamp(rect.left() + half, (rect.right() - half).max(rect.left() + half));
    let back = Rect::from_center_size(pos2(middle, rect.center().y), vec2(half * 2.0, rect.height() - 4.0));
    painter.rect_filled(back, 3.0, colors.accent);
    painter.galley(back.center() - galley.size() / 2.0, galley, colors.on_accent);
}

/// Paints the playhead and the ends of the range over the keys.
pub(in crate::editor::panels) fn paint_playhead(ui: &Ui, rect: Rect, axis: &TimeAxis, open: &OpenClip) {
    let painter = ui.painter_at(rect);
    let shade = Color32::from_black_alpha(60);
    let [start, end] = open.clip.range.map(|time| axis.at(time).clamp(rect.left(), rect.right()));
    for (from, to) in [(rect.left(), start), (end, rect.right())] {
        if to > from {
            painter.rect_filled(Rect::from_x_y_ranges(from..=to, rect.y_range()), 0.0, shade);
        }
    }
    painter.vline(axis.at(open.time), rect.y_range(), Stroke::new(1.5, KeyColors::of(ui.visuals()).accent));
}

impl Markers {
    fn show(&mut self, ui: &mut Ui, strip: Rect, axis: &TimeAxis, open: &OpenClip, requests: &mut Requests) {
        let markers = &open.clip.markers;
        self.dragged = self.dragged.filter(|(marker, _)| *marker < markers.len());
        let painter = ui.painter_at(strip);
        painter.rect_filled(strip, 0.0, ui.visuals().faint_bg_color);
        let first = markers.partition_point(|marker| axis.at(marker.time) < strip.left() - 60.0);
        let mut until = f32::NEG_INFINITY;
        let mut edit = None;
        for (number, marker) in markers.iter().enumerate().skip(first) {
            let dragged = self.dragged.filter(|(dragged, _)| *dragged == number).map(|(_, time)| time);
            let x = axis.at(dragged.unwrap_or(marker.time));
            if axis.at(marker.time) > strip.right() {
                break;
            }
            // Markers on top of each other are drawn once.
            if x < until && dragged.is_none() {
                continue;
            }
            if dragged.is_none() {
                until = x + 7.0;
            }
            let next = markers.get(number + 1).map_or(strip.right(), |next| axis.at(next.time));
            let width = (next - x - 2.0).clamp(8.0, 90.0);
            let flag = Rect::from_min_size(pos2(x - 2.0, strip.top()), vec2(width, strip.height()));
            edit = self.marker(ui, flag, (number, marker), dragged, (axis, open), requests).or(edit);
        }
        if let Some(operation) = edit {
            requests.send(EditRequest::operation(open.entity, operation));
        }
    }

    fn marker(
        &mut self,
        ui: &mut Ui,
        flag: Rect,
        (number, marker): (usize, &Marker),
        dragged: Option<f32>,
        (axis, open): (&TimeAxis, &OpenClip),
        requests: &mut Requests,
    ) -> Option<Operation> {
        let id = ui.id().with(("marker", number));
        if let Some(rename) = self.rename.as_mut().filter(|rename| rename.marker == number) {
            let field = Rect::from_min_size(flag.min, vec2(110.0, flag.height() + 4.0));
            let id = id.with("rename");
            match fields::rename(ui, field, id, "Rename marker", &mut rename.text, &mut rename.focused) {
                Renaming::Typing => {}
                Renaming::Dropped => self.rename = None,
                Renaming::Accepted => {
                    let name = self.rename.take()?.text.trim().to_owned();
                    let is_other = !name.is_empty() && name != marker.name;
                    return is_other.then(|| about(open.clip, |about| about.markers[number].name = name));
                }
            }
            return None;
        }
        let response = ui.interact(flag, id, Sense::click_and_drag());
        response.widget_info(|| WidgetInfo::labeled(WidgetType::Button, true, format!("Marker {}", marker.name)));
        paint_flag(ui, flag, &marker.name, response.hovered() || dragged.is_some());
        if response.double_clicked() {
            self.start_rename(number, marker);
        } else if response.clicked() {
            requests.send(TimelineRequest::Scrub(marker.time));
        }
        let mut edit = None;
        if response.dragged_by(PointerButton::Primary)
            && let (Some(at), Some(press)) =
                (response.interact_pointer_pos(), ui.input(|input| input.pointer.press_origin()))
        {
            let time = marker.time + axis.time(at.x) - axis.time(press.x);
            let free = ui.input(|input| input.modifiers.alt);
            self.dragged = Some((number, if free { time } else { snapped(open.clip, time) }));
        } else if let Some((_, time)) = self.dragged.take_if(|(dragged, _)| *dragged == number) {
            let is_moved = response.drag_stopped() && !ui.input(|input| input.key_pressed(Key::Escape));
            edit = (is_moved && time != marker.time).then(|| about(open.clip, |about| place(about, number, time)));
        }
        let mut chosen = None;
        let tip =
            format!("{} at frame {}", marker.name, fields::short(f64::from(marker.time * open.clip.frame_rate), 2));
        response.on_hover_text(tip).context_menu(|ui| {
            if ui.button("Rename marker").clicked() {
                self.start_rename(number, marker);
                ui.close();
            }
            if ui.button("Delete marker").clicked() {
                chosen = Some(about(open.clip, |about| {
                    about.markers.remove(number);
                }));
                ui.close();
            }
        });
        chosen.or(edit)
    }

    fn start_rename(&mut self, number: usize, marker: &Marker) {
        self.rename = Some(Rename { marker: number, text: marker.name.clone(), focused: false });
    }
}

/// Puts a marker to a time; markers stay in the order of their times.
fn place(about: &mut ClipAbout, number: usize, time: f32) {
    let marker = Marker { time, ..about.markers.remove(number) };
    let place = about.markers.partition_point(|other| other.time <= time);
    about.markers.insert(place, marker);
}

fn paint_flag(ui: &Ui, flag: Rect, name: &str, is_hovered: bool) {
    let colors = KeyColors::of(ui.visuals());
    let color = if is_hovered { colors.accent } else { colors.marker };
    let at: Pos2 = flag.left_top() + vec2(2.0, 2.0);
    let points = vec![at, at + vec2(6.0, 3.0), at + vec2(0.0, 6.0)];
    ui.painter().add(Shape::convex_polygon(points, color, Stroke::NONE));
    ui.painter().vline(at.x, flag.top()..=flag.bottom(), Stroke::new(1.0, color));
    if flag.width() > 20.0 {
        list::line(ui, flag.with_min_x(flag.left() + 10.0), name, ui.visuals().weak_text_color());
    }
}
