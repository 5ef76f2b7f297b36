//! Chart of the graph: the places of everything in it, for those who check or draw it elsewhere.

use bevy_egui::egui::{Pos2, Rect, Vec2};

use super::{
    GraphPanel,
    state::GraphView,
    wires::{Readers, Spots},
};
use crate::rig::Uid;

/// Places of everything in the graph, in its own space.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct GraphChart {
    /// Commands that are shown, each with its rectangle.
    pub commands: Vec<(Uid, Rect)>,
    /// Frames, open and folded.
    pub frames: Vec<ChartFrame>,
    /// Ends of each wire on the screen: at the command that is read, then at the command that reads it.
    pub wires: Vec<[Pos2; 2]>,
}

/// Frame in a chart.
#[derive(Debug, Clone, PartialEq)]
pub struct ChartFrame {
    /// The feature tag, or the local group.
    pub uid: Uid,
    /// Title for people.
    pub title: String,
    /// Space of the frame.
    pub rect: Rect,
    /// True if its commands are shown.
    pub is_open: bool,
    /// The commands that are in it.
    pub commands: Vec<Uid>,
    /// Number of its commands that are built.
    pub built: usize,
    /// Number of its commands that failed.
    pub failed: usize,
}

impl GraphChart {
    /// Space of the whole graph.
    pub fn space(&self) -> Rect {
        let commands = self.commands.iter().map(|(_, rect)| *rect);
        commands.chain(self.frames.iter().map(|frame| frame.rect)).fold(Rect::NOTHING, Rect::union)
    }
}

impl GraphPanel {
    /// Chart of the graph as it was drawn last.
    pub fn chart(&self, view: &GraphView) -> GraphChart {
        let (rects, boxes) = (self.rects(view, Vec2::ZERO), self.boxes(view, Vec2::ZERO));
        let graph = &self.graph;
        let spots = Spots { graph, rects: &rects, boxes: &boxes };
        let shown = graph.nodes.iter().zip(&rects).filter(|(_, rect)| rect.is_finite());
        let frame = |(number, rect): (usize, Rect)| {
            let (frame, tally) = (&graph.frames[number], &self.tallies[number]);
            let inside = graph.nodes.iter().filter(|node| node.frame == Some(number));
            ChartFrame {
                uid: frame.uid,
                title: frame.title(),
                rect,
                is_open: boxes[number].is_none(),
                commands: inside.map(|node| node.tag).collect(),
                built: tally.built,
                failed: tally.failed,
            }
        };
        GraphChart {
            commands: shown.map(|(node, rect)| (node.tag, *rect)).collect(),
            frames: spots.frames().into_iter().enumerate().map(frame).collect(),
            wires: graph.wires.iter().filter_map(|wire| spots.ends(*wire)).collect(),
        }
    }

    /// Ends of the wires that were drawn in full in the last frame; all others were faded if anything was selected, or under
    /// the pointer.
    pub fn wires_in_full(&self, view: &GraphView) -> Vec<[Pos2; 2]> {
        let (rects, boxes) = (self.rects(view, Vec2::ZERO), self.boxes(view, Vec2::ZERO));
        let graph = &self.graph;
        let spots = Spots { graph, rects: &rects, boxes: &boxes };
        let full = graph.wires.iter().filter(|wire| !self.focus.fades || self.focus.has(graph, **wire));
        full.filter_map(|wire| spots.ends(*wire)).collect()
    }

    /// Ends of the wires that were cut short in the last frame, out of focus and beside many others of the same command.
    pub fn wires_cut_short(&self, view: &GraphView) -> Vec<[Pos2; 2]> {
        let (rects, boxes) = (self.rects(view, Vec2::ZERO), self.boxes(view, Vec2::ZERO));
        let graph = &self.graph;
        let spots = Spots { graph, rects: &rects, boxes: &boxes };
        let readers = Readers::of(graph);
        let short = graph.wires.iter().filter(|wire| readers.cut_short(graph, &self.focus, **wire));
        short.filter_map(|wire| spots.ends(*wire)).collect()
    }
}
