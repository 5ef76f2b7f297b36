//! Places of nodes and folded frames: laid out, or where a person moved them.

use std::collections::BTreeMap;

use bevy_egui::egui::{Pos2, Rect, Vec2, vec2};

use super::{
    GraphPanel,
    gesture::{Gesture, moved},
    layout::{LayoutNode, lay_out},
    model::Graph,
    state::GraphView,
    wires::{BOX, node_size},
};
use crate::{
    processor::{CommandState, CommandStatus},
    rig::Uid,
};

impl GraphPanel {
    /// Lays the graph out again if its shape changed, or frames were opened or folded.
    pub(super) fn arrange(&mut self, view: &GraphView) {
        let graph = &self.graph;
        let count = graph.nodes.len();
        let open: Vec<bool> = graph.frames.iter().map(|frame| view.is_open(frame.uid, count)).collect();
        if !std::mem::take(&mut self.is_stale) && self.open == open {
            return;
        }
        let links = links(graph, &self.statuses, &mut self.reads);
        let mut items: Vec<LayoutNode> = Vec::with_capacity(count);
        // Item of each command, and of each folded frame.
        let mut item_of: Vec<usize> = Vec::with_capacity(count);
        let mut boxes: BTreeMap<usize, usize> = BTreeMap::new();
        for node in &graph.nodes {
            let next = items.len();
            let item = match node.frame.filter(|frame| !open[*frame]) {
                Some(frame) => *boxes.entry(frame).or_insert(next),
                None => next,
            };
            if item == next {
                let is_folded = node.frame.is_some_and(|frame| !open[frame]);
                let size = if is_folded { BOX } else { node_size(node.inputs.len()) };
                items.push(LayoutNode { size, frame: node.frame, is_folded });
            }
            item_of.push(item);
        }
        let ends = links.into_iter().map(|(from, to)| (item_of[from], item_of[to]));
        let edges: Vec<(usize, usize)> = ends.filter(|(from, to)| from != to).collect();
        let laid_out = (items, edges);
        if self.laid_out != laid_out {
            self.laid = lay_out(&laid_out.0, &laid_out.1);
            self.laid_out = laid_out;
            self.refits = self.sees_all;
        }
        let laid = &self.laid;
        let shown = graph.nodes.iter().zip(&item_of);
        let places = shown.map(|(node, item)| node.frame.is_none_or(|frame| open[frame]).then(|| laid[*item]));
        self.places = places.collect();
        self.folded = (0..open.len()).map(|frame| boxes.get(&frame).map(|item| laid[*item])).collect();
        self.open = open;
    }

    /// Rectangles of all nodes: where the layout or a person put them, and where a drag has them; nothing in folded frames.
    pub(super) fn rects(&self, view: &GraphView, by: Vec2) -> Vec<Rect> {
        let dragged = match &self.gesture {
            Some(Gesture::Nodes(tags, _)) => Some(tags),
            _ => None,
        };
        let nodes = self.graph.nodes.iter().zip(&self.places);
        nodes
            .map(|(node, place)| {
                let Some(place) = place else { return Rect::NOTHING };
                let [width, height] = node_size(node.inputs.len());
                let place = view.moved.get(&node.tag).copied().unwrap_or(*place);
                let rect = moved(Rect::from_min_size(Pos2::ZERO, vec2(width, height)), place);
                let is_dragged = dragged.is_some_and(|tags| tags.contains(&node.tag));
                if is_dragged { rect.translate(by) } else { rect }
            })
            .collect()
    }

    /// Rectangles of folded frames: where the layout or a person put them, and where a drag has them.
    pub(super) fn boxes(&self, view: &GraphView, by: Vec2) -> Vec<Option<Rect>> {
        let dragged = match &self.gesture {
            Some(Gesture::Folded(frame, _)) => Some(*frame),
            _ => None,
        };
        let frames = self.graph.frames.iter().zip(&self.folded);
        frames
            .map(|(frame, place)| {
                let laid = (*place)?;
                let [x, y] = view.moved.get(&frame.uid).copied().unwrap_or(laid);
                let folded = Rect::from_min_size(Pos2::new(x, y), vec2(BOX[0], BOX[1]));
                Some(if dragged == Some(frame.uid) { folded.translate(by) } else { folded })
            })
            .collect()
    }
}

/// Dependencies between commands, from what is read to what reads it. A command that has failed, or waits to be run again, has
/// those of its last run besides, so that nothing moves while a build goes back and forth; `reads` remembers them.
fn links(
    graph: &Graph,
    statuses: &[Option<CommandStatus>],
    reads: &mut BTreeMap<Uid, Vec<Uid>>,
) -> Vec<(usize, usize)> {
    let mut links = Vec::with_capacity(graph.wires.len());
    let mut wires = graph.wires.as_slice();
    for (number, node) in graph.nodes.iter().enumerate() {
        let (own, rest) = wires.split_at(wires.partition_point(|wire| wire.to <= number));
        wires = rest;
        let mut sources: Vec<Uid> = own.iter().map(|wire| graph.nodes[wire.from].tag).collect();
        let state = statuses.get(number).and_then(|status| status.as_ref()).map(|status| status.state);
        if matches!(state, Some(CommandState::Done | CommandState::Skipped)) {
            reads.insert(node.tag, sources.clone());
        } else {
            let before = reads.get(&node.tag).into_iter().flatten();
            let missing: Vec<Uid> = before.filter(|source| !sources.contains(source)).copied().collect();
            sources.extend(missing);
        }
        links.extend(sources.iter().filter_map(|source| Some((*graph.at.get(source)?, number))));
    }
    reads.retain(|tag, _| graph.at.contains_key(tag));
    links
}
