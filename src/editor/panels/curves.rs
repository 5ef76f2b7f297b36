//! Curves panel: values of the selected tracks over time, with keys and tangents that are dragged.
//!
//! Time is that of the [timeline](super::timeline): the same clip, layer, playhead, span and selected keys. A drag moves keys in
//! time or in value, whichever way it goes first; tangents turn on both sides of a key, with Alt on one. A drag beside the keys
//! selects those in a box.

pub mod curve;
mod edit;

use bevy::prelude::*;
use bevy_egui::egui::{
    Align2, Color32, FontId, Painter, Pos2, Rangef, Rect, Sense, Shape, Stroke, StrokeKind, Ui, UiBuilder, WidgetInfo,
    WidgetType, pos2, vec2,
};

use self::{
    curve::{Curve, CurveKey, curves},
    edit::Gesture,
};
use super::{
    displayed_rig::{DisplayedRig, node_name},
    fields, list,
    timeline::{
        KeyColors, Markers, OpenClip, TimeAxis, Timeline, lines, navigate, paint_playhead, ruler_height, show_key_menu,
        show_ruler, tell_hover,
    },
};
use crate::{
    editor::{
        panel::{EditorPanel, Requests},
        style,
    },
    plugins::commands::BuildResult,
    rig::{BuiltRig, Uid, animation::TrackTarget},
};

/// Most tracks whose curves are drawn.
const MOST_TRACKS: usize = 12;
/// Pixels from a key to the end of its tangent.
const TANGENT: f32 = 42.0;

/// The panel.
#[derive(Default)]
pub struct CurvesPanel {
    markers: Markers,
    gesture: Option<Gesture>,
    /// Visible values that a person has chosen; all of the curves are seen without.
    values: Option<[f32; 2]>,
    /// Visible values during a drag.
    held: Option<[f32; 2]>,
    /// True if the pointer was last told to be over the panel.
    is_pointed: bool,
}

/// Places of times and values on the screen.
#[derive(Debug, Clone, Copy)]
struct Plot {
    axis: TimeAxis,
    /// Lowest and highest visible value.
    values: [f32; 2],
    y: Rangef,
}

impl Plot {
    /// Pixels of a unit.
    fn scale(&self) -> f32 {
        self.y.span() / (self.values[1] - self.values[0]).max(1e-9)
    }

    fn at(&self, time: f32, value: f32) -> Pos2 {
        pos2(self.axis.at(time), self.y.max - (value - self.values[0]) * self.scale())
    }

    fn value(&self, y: f32) -> f32 {
        self.values[0] + (self.y.max - y) / self.scale()
    }

    /// Ends of the tangents of a key: before and behind it.
    fn tangents(&self, key: &CurveKey) -> Option<[Pos2; 2]> {
        let at = self.at(key.key.time, key.value);
        let end = |slope: f32, side: f32| {
            let run = vec2(self.axis.scale(), -slope * self.scale());
            at + run * (side * TANGENT / run.length().max(1e-6))
        };
        key.slopes.map(|[arrive, leave]| [end(arrive, -1.0), end(leave, 1.0)])
    }
}

impl EditorPanel for CurvesPanel {
    fn title(&self) -> &'static str {
        "Curves"
    }

    fn show(&mut self, ui: &mut Ui, world: &World, requests: &mut Requests) {
        let Some(shown) = DisplayedRig::of(world) else {
            return list::nothing(ui, "No rig is open.");
        };
        tell_hover(ui, self.title(), &mut self.is_pointed, world, requests);
        let (Some(open), Some(timeline)) = (OpenClip::of(world), world.get_resource::<Timeline>()) else {
            self.gesture = None;
            return list::nothing(ui, "No clip is open: choose or make one in the Timeline.");
        };
        let targets = targets(&open, timeline, &shown.selection.0);
        if targets.is_empty() {
            self.gesture = None;
            return list::nothing(ui, "Select keys in the Timeline, or a control that has keys, to see its curves.");
        }
        let rect = ui.available_rect_before_wrap();
        if rect.width() < 60.0 || rect.height() < 60.0 {
            return;
        }
        let split = rect.left() + (rect.width() * 0.22).clamp(60.0, 190.0).min(rect.width() * 0.6);
        let below = rect.top() + ruler_height(open.clip);
        let axis = TimeAxis { span: timeline.span, x: Rangef::new(split, rect.right()) };
        let over = Rect::from_min_max(pos2(split, rect.top()), pos2(rect.right(), below));
        show_ruler(&mut self.markers, ui, over, &axis, &open, requests);
        let area = Rect::from_min_max(pos2(split, below), rect.max);
        navigate(ui, over, &axis, requests);
        let built = world.get::<BuildResult>(open.entity).map(|built| &*built.0);
        let all = drawn(&open, built, &targets, &axis);
        let legend = Rect::from_min_max(rect.min, pos2(split - 6.0, rect.bottom()));
        self.legend(ui, legend, &all);
        let plot = Plot { axis, values: self.visible(&all), y: area.y_range() };
        let response = ui.interact(area, ui.id().with("curves"), Sense::click_and_drag());
        response.widget_info(|| WidgetInfo::labeled(WidgetType::Other, true, "Curves of the selected tracks"));
        edit::gestures(&mut self.gesture, ui, &response, &plot, &all, &open, timeline, requests);
        show_key_menu(&response, world, requests);
        self.held = self.gesture.as_ref().map(|_| plot.values);
        self.zoom(ui, area, &plot, requests);
        let painter = ui.painter_at(area);
        grid(ui, &painter, area, &plot, &open);
        let colors = KeyColors::of(ui.visuals());
        for curve in &all {
            let color = style::readable(ui.visuals(), curve.color);
            paint(&painter, (curve, color), &plot, timeline, &colors);
        }
        if let Some(Gesture::Box(corners)) = &self.gesture {
            let chosen = Rect::from_two_pos(corners[0], corners[1]);
            painter.rect_filled(chosen, 0.0, colors.accent.gamma_multiply(0.12));
            painter.rect_stroke(chosen, 0.0, Stroke::new(1.0, colors.accent), StrokeKind::Inside);
        }
        paint_playhead(ui, area, &axis, &open);
        ui.advance_cursor_after_rect(rect);
    }
}

impl CurvesPanel {
    /// Visible values: those that were chosen, or the range of all curves with some room.
    fn visible(&self, all: &[Curve]) -> [f32; 2] {
        if let Some(values) = self.held.or(self.values) {
            return values;
        }
        let values = || all.iter().flat_map(|curve| &curve.points).map(|(_, value)| *value);
        let (low, high) = (values().fold(f32::INFINITY, f32::min), values().fold(f32::NEG_INFINITY, f32::max));
        if !low.is_finite() || !high.is_finite() {
            return [-1.0, 1.0];
        }
        // Curves that are level, or nearly so, are seen as such.
        let room = ((high - low) * 0.12).max(high.abs().max(low.abs()) * 1e-3).max(1e-3);
        [low - room, high + room]
    }

    /// Zooms values with the wheel, and time with Control as well.
    fn zoom(&mut self, ui: &Ui, area: Rect, plot: &Plot, requests: &mut Requests) {
        let scroll = ui.input(|input| input.smooth_scroll_delta());
        let Some(pointer) = ui.input(|input| input.pointer.hover_pos()) else { return };
        if !ui.rect_contains_pointer(area) {
            return;
        }
        navigate(ui, area, &plot.axis, requests);
        if scroll.y != 0.0 {
            let factor = bevy::math::ops::exp2(-scroll.y / 120.0);
            let fixed = plot.value(pointer.y);
            self.values = Some(plot.values.map(|value| fixed + (value - fixed) * factor));
        }
    }

    /// Names of the curves in their colours, and a button that shows all of them.
    fn legend(&mut self, ui: &mut Ui, rect: Rect, all: &[Curve]) {
        let builder = UiBuilder::new().id_salt("legend").max_rect(rect);
        ui.scope_builder(builder, |ui| {
            ui.set_clip_rect(rect.intersect(ui.clip_rect()));
            let is_chosen = self.values.is_some();
            let fit = ui.add_enabled(is_chosen, bevy_egui::egui::Button::new("Fit values").truncate());
            let fit = fit.on_hover_text("Shows all values of the curves; the wheel zooms them");
            if fit.on_disabled_hover_text("All values are shown; the wheel zooms them").clicked() {
                self.values = None;
            }
            let height = list::row_height(ui);
            let room = ((rect.bottom() - ui.cursor().top()) / height).floor().max(0.0) as usize;
            for curve in all.iter().take(room) {
                let (row, response) = ui.allocate_exact_size(vec2(rect.width(), height), Sense::hover());
                response.widget_info(|| WidgetInfo::labeled(WidgetType::Label, true, &curve.name));
                list::line(ui, row, &curve.name, style::readable(ui.visuals(), curve.color));
            }
        });
    }
}

/// Tracks whose curves are drawn: those with selected keys, or those of the selected nodes.
fn targets(open: &OpenClip, timeline: &Timeline, selected: &[Uid]) -> Vec<TrackTarget> {
    let tracks = || open.layer.into_iter().flat_map(|layer| layer.tracks.keys());
    let mut found: Vec<TrackTarget> =
        tracks().filter(|target| timeline.keys.contains_key(target)).take(MOST_TRACKS).cloned().collect();
    if found.is_empty() {
        found = tracks().filter(|target| selected.contains(&target.node)).take(MOST_TRACKS).cloned().collect();
    }
    found
}

fn drawn(open: &OpenClip, built: Option<&BuiltRig>, targets: &[TrackTarget], axis: &TimeAxis) -> Vec<Curve> {
    let Some(layer) = open.layer else { return Vec::new() };
    let of = |target: &TrackTarget| curves(layer, target, &node_name(open.rig, built, target.node), axis);
    targets.iter().flat_map(of).collect()
}

/// Lines of time and of values.
fn grid(ui: &Ui, painter: &Painter, area: Rect, plot: &Plot, open: &OpenClip) {
    painter.rect_filled(area, 0.0, ui.visuals().extreme_bg_color);
    let line = Stroke::new(1.0, ui.visuals().faint_bg_color);
    for (_, x) in lines(&plot.axis, open.clip) {
        painter.vline(x, area.y_range(), line);
    }
    let span = plot.values[1] - plot.values[0];
    let power =
        bevy::math::ops::powf(10.0, bevy::math::ops::log10(span.max(1e-9) * 40.0 / plot.y.span().max(1.0)).ceil());
    let step = [0.2, 0.5, 1.0].into_iter().map(|part| part * power).find(|step| step * plot.scale() >= 30.0);
    let step = step.unwrap_or(power);
    let first = (plot.values[0] / step).ceil();
    for number in 0..(area.height() / 20.0) as usize {
        let value = (first + number as f32) * step;
        if value > plot.values[1] {
            break;
        }
        let y = plot.at(0.0, value).y;
        painter.hline(area.x_range(), y, line);
        let text = fields::short(f64::from(value), 4);
        let at = pos2(area.left() + 3.0, y);
        painter.text(at, Align2::LEFT_BOTTOM, text, FontId::proportional(10.0), ui.visuals().weak_text_color());
    }
}

fn paint(painter: &Painter, (curve, line): (&Curve, Color32), plot: &Plot, timeline: &Timeline, colors: &KeyColors) {
    let points = curve.points.iter().map(|(time, value)| plot.at(*time, *value)).collect();
    painter.add(Shape::line(points, Stroke::new(1.5, line)));
    let selected = timeline.keys.get(&curve.target);
    for key in &curve.keys {
        let at = plot.at(key.key.time, key.value);
        let is_selected = selected.is_some_and(|times| times.contains(&key.key.time));
        if let Some(ends) = plot.tangents(key).filter(|_| is_selected) {
            for end in ends {
                painter.line_segment([at, end], Stroke::new(1.0, colors.quiet));
                painter.circle_filled(end, 3.0, colors.quiet);
            }
        }
        let color = if is_selected { colors.accent } else { line };
        painter.add(Shape::convex_polygon(
            [(0.0, -1.0), (1.0, 0.0), (0.0, 1.0), (-1.0, 0.0)].map(|(x, y)| at + vec2(x, y) * 4.0).to_vec(),
            color,
            Stroke::new(1.0, colors.outline),
        ));
    }
}
