//! Content of a node: its title, its parameters in words, its state, and its pins.

use bevy_egui::egui::{Pos2, Rect, Stroke, StrokeKind, Ui, pos2, vec2};

use super::{
    canvas::{NodePart, Scene},
    letters,
    model::GraphWire,
    wires::{HEAD, ROW, input_pin, output_pin},
};
use crate::{
    editor::{
        panels::{process, properties},
        style,
    },
    processor::CommandState,
};

/// Size of letters, in the graph's units.
const TEXT: f32 = 13.0;

/// Draws a node in its space; `scale` is that of the view.
pub(super) fn draw(ui: &Ui, scene: &Scene, number: usize, scale: f32) {
    let (node, rect) = (&scene.graph.nodes[number], scene.rects[number]);
    let visuals = ui.visuals();
    let status = scene.statuses[number].as_ref();
    let color = process::color(visuals, status);
    let accent = style::accent(visuals);
    let painter = ui.painter();
    let glow = scene.glow[number];
    if glow > 0.0 {
        painter.rect_filled(rect.expand(3.0), 7.0, accent.gamma_multiply(0.8 * glow));
    }
    let edge = match scene.selected.contains(&node.tag) {
        true => Stroke::new(2.0, accent),
        false => Stroke::new(1.0, visuals.widgets.noninteractive.bg_stroke.color),
    };
    painter.rect(rect, 5.0, visuals.widgets.inactive.bg_fill, edge, StrokeKind::Inside);
    painter.circle_filled(rect.min + vec2(16.0, 14.0), 4.5, color);
    let is_off = status.is_some_and(|status| status.state == CommandState::Skipped) || !node.enabled;
    let quiet = style::quiet(visuals);
    let strong = if is_off { quiet } else { visuals.strong_text_color() };
    let line = |top: f32, left: f32, height: f32| {
        Rect::from_min_max(rect.min + vec2(left, top), pos2(rect.right() - 12.0, rect.top() + top + height))
    };
    letters::title(painter, line(4.0, 26.0, 20.0), &node.title, TEXT, strong, scale);
    if !node.summary.is_empty() {
        letters::line(painter, line(22.0, 12.0, 18.0), &node.summary, TEXT, quiet, scale);
    }
    for (number, input) in node.inputs.iter().enumerate() {
        let row = line(HEAD + ROW * number as f32, 12.0, ROW);
        letters::line(painter, row, input, TEXT, visuals.text_color(), scale);
    }
}

/// Pins of a node with their places and names: its output, its inputs, and what it reads besides if there is any.
pub(super) fn pins(scene: &Scene, number: usize) -> Vec<(NodePart, Pos2, String)> {
    let (node, rect) = (&scene.graph.nodes[number], scene.rects[number]);
    let count = node.inputs.len();
    let mut pins = vec![(NodePart::Output(number), output_pin(rect), format!("{}: output", node.title))];
    for (input, name) in node.inputs.iter().enumerate() {
        let said = format!("{}: {}", node.title, name.replace('_', " "));
        pins.push((NodePart::Input(number, input), input_pin(rect, input, count), said));
    }
    let first = GraphWire { to: number, input: count, from: 0 };
    let place = scene.graph.wires.partition_point(|wire| *wire < first);
    if scene.graph.wires.get(place).is_some_and(|wire| wire.to == number) {
        let said = format!("{}: what it reads besides", node.title);
        pins.push((NodePart::Input(number, count), input_pin(rect, count, count), said));
    }
    pins
}

/// Name of a node with its state.
pub(super) fn said(scene: &Scene, number: usize) -> String {
    let status = scene.statuses[number].as_ref();
    format!("{}, {}", scene.graph.nodes[number].title, process::state_word(status))
}

/// Draws what is known about a node: its state with the reason, and its parameters in words.
pub(super) fn about(ui: &mut Ui, scene: &Scene, number: usize) {
    let node = &scene.graph.nodes[number];
    let status = scene.statuses[number].as_ref();
    ui.strong(&node.title);
    ui.colored_label(process::color(ui.visuals(), status), process::state_word(status));
    if let Some(reason) = status.and_then(properties::tags::reason) {
        ui.colored_label(process::color(ui.visuals(), status), reason);
    }
    if !node.summary.is_empty() {
        ui.weak(&node.summary);
    }
    if let Some(frame) = node.frame.and_then(|frame| scene.graph.frames.get(frame)) {
        ui.weak(format!("In {}", frame.title()));
    }
}
