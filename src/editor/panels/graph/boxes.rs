//! Frames as they are drawn: a title over the nodes of an open one, a box with counts and pins in place of a folded one.

use bevy_egui::egui::{Color32, Painter, Rect, Stroke, StrokeKind, Visuals, pos2, vec2};

use super::{
    canvas::Scene,
    letters,
    model::Graph,
    wires::{Spots, box_pins},
};
use crate::{
    editor::{counts::counted, panels::process, style},
    processor::{CommandState, CommandStatus},
};

/// Height of a line as a multiple of the size of its letters.
const LINE: f32 = 1.3;
/// Length in the graph of a point of the screen from which on a folded frame has its title alone.
const FAR: f32 = 1.6;

/// Numbers of the commands of a frame by their states.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub(super) struct Tally {
    /// Number of commands.
    pub commands: usize,
    /// Number of built commands.
    pub built: usize,
    /// Number of failed commands.
    pub failed: usize,
    /// Command whose state is the frame's: the first that failed, or else that is not built, or else that is.
    first: Option<usize>,
}

impl Tally {
    /// Tallies of all frames of a graph.
    pub fn all(graph: &Graph, statuses: &[Option<CommandStatus>]) -> Vec<Self> {
        let mut tallies = vec![Self::default(); graph.frames.len()];
        let mut ranks = vec![0; graph.frames.len()];
        for (number, node) in graph.nodes.iter().enumerate() {
            let Some(frame) = node.frame else { continue };
            let state = statuses.get(number).and_then(|status| status.as_ref()).map(|status| status.state);
            let tally = &mut tallies[frame];
            tally.commands += 1;
            tally.built += usize::from(state == Some(CommandState::Done));
            tally.failed += usize::from(state == Some(CommandState::Failed));
            let rank = match state {
                Some(CommandState::Failed) => 4,
                Some(CommandState::Pending) | None => 3,
                Some(CommandState::Done) => 2,
                Some(CommandState::Skipped) => 1,
            };
            if rank > ranks[frame] {
                (ranks[frame], tally.first) = (rank, Some(number));
            }
        }
        tallies
    }

    /// The counts in words.
    pub fn words(&self) -> String {
        let failed = if self.failed == 0 { String::new() } else { format!(", {} failed", self.failed) };
        format!("{}, {} built{failed}", counted(self.commands, "command", "commands"), self.built)
    }
}

/// Name of a frame for screen readers, with its state.
pub(super) fn said(scene: &Scene, number: usize) -> String {
    let state = if scene.boxes[number].is_some() { "folded" } else { "open" };
    format!("Frame {}, {state}, {}", scene.graph.frames[number].title(), scene.tallies[number].words())
}

/// Draws frames that are in view. `unit` is the length in the graph of a point of the screen.
pub(super) fn draw(painter: &Painter, view: Rect, scene: &Scene, visuals: &Visuals, unit: f32) {
    let spots = Spots { graph: scene.graph, rects: scene.rects, boxes: scene.boxes };
    for (number, space) in spots.frames().into_iter().enumerate().filter(|(_, space)| space.intersects(view)) {
        if scene.boxes[number].is_some() {
            continue;
        }
        let frame = &scene.graph.frames[number];
        let off = if frame.enabled { "" } else { " (off)" };
        let stroke = Stroke::new(unit.max(1.0), visuals.widgets.noninteractive.bg_stroke.color);
        painter.rect(space, 6.0, visuals.faint_bg_color, stroke, StrokeKind::Inside);
        let size = 14.0f32.max(11.0 * unit).min(40.0);
        let color = style::quiet(visuals);
        let title = format!("⏷ {}{off}   {}", frame.title(), scene.tallies[number].words());
        let place = Rect::from_min_size(space.min + vec2(10.0, 6.0), vec2(space.width() - 20.0, LINE * size));
        letters::line(painter, place, &title, size, color, 1.0 / unit);
    }
}

/// Draws folded frames that are in view, above the wires.
pub(super) fn draw_folded(painter: &Painter, view: Rect, scene: &Scene, visuals: &Visuals, unit: f32) {
    let mut has_selected = vec![false; scene.boxes.len()];
    let mut glow = vec![0.0_f32; scene.boxes.len()];
    for (number, node) in scene.graph.nodes.iter().enumerate() {
        if let Some(frame) = node.frame {
            has_selected[frame] |= scene.selected.contains(&node.tag);
            glow[frame] = glow[frame].max(scene.glow[number]);
        }
    }
    for (number, folded) in scene.boxes.iter().enumerate() {
        let Some(folded) = folded.filter(|folded| folded.intersects(view)) else { continue };
        let (frame, tally) = (&scene.graph.frames[number], &scene.tallies[number]);
        let accent = style::accent(visuals);
        if glow[number] > 0.0 {
            painter.rect_filled(folded.expand(3.0 * unit.max(1.0)), 8.0, accent.gamma_multiply(0.8 * glow[number]));
        }
        let edge = match has_selected[number] {
            true => Stroke::new(2.0 * unit.max(1.0), accent),
            false => Stroke::new(unit.max(1.0), visuals.widgets.noninteractive.bg_stroke.color),
        };
        painter.rect(folded, 6.0, visuals.widgets.inactive.bg_fill, edge, StrokeKind::Inside);
        let status = tally.first.and_then(|number| scene.statuses[number].as_ref());
        let strip = Rect::from_min_max(folded.min, pos2(folded.left() + 8.0, folded.bottom())).shrink(1.0);
        painter.rect_filled(strip, 4.0, process::color(visuals, status));
        let strong = if frame.enabled { visuals.strong_text_color() } else { style::quiet(visuals) };
        let (corner, room) = (folded.min + vec2(16.0, 6.0), folded.width() - 28.0);
        let row = |top: f32, size: f32| Rect::from_min_size(corner + vec2(0.0, top), vec2(room, LINE * size));
        // From afar the title alone is to be read, as large as the box.
        if unit > FAR {
            let size = (11.0 * unit).min(folded.height() * 0.62);
            let place =
                Rect::from_center_size(pos2(corner.x + 0.5 * room, folded.center().y), vec2(room, folded.height()));
            letters::title(painter, place, &frame.title(), size, strong, 1.0 / unit);
        } else {
            let off = if frame.enabled { "" } else { " (off)" };
            letters::line(painter, row(0.0, 16.0), &format!("⏵ {}{off}", frame.title()), 16.0, strong, 1.0 / unit);
            letters::line(painter, row(26.0, 13.0), &tally.words(), 13.0, style::quiet(visuals), 1.0 / unit);
        }
        for pin in box_pins(folded) {
            painter.circle(pin, 4.0, visuals.text_color(), Stroke::new(1.0, Color32::from_gray(60)));
        }
    }
}
