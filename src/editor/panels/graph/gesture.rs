//! Gestures on the graph: nodes and folded frames that are dragged, boxes that select, wires that are pulled from a pin.

use std::collections::BTreeSet;

use bevy_egui::egui::{Key, Modifiers, PointerButton, Pos2, Rect, Response, Ui, Vec2, pos2};

use super::{
    canvas::{Canvas, Ink, NodePart},
    edits::{Bench, WireError},
    layout::snapped,
    menu::MenuTarget,
    model::{Graph, GraphWire},
    wires::{Spots, TITLE, input_pin, output_pin, wire_at},
};
use crate::rig::{Uid, operations::TagOperation};

/// Distance, in points of the screen, at which the pointer meets a pin or a wire.
const REACH: f32 = 9.0;

/// Gesture of the pointer, from the press to the release.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Gesture {
    /// Nodes that are moved, from a point of the graph.
    Nodes(BTreeSet<Uid>, Pos2),
    /// Folded frame that is moved, from a point of the graph.
    Folded(Uid, Pos2),
    /// Box, from a point of the graph.
    Box(Pos2),
    /// Wire from the output of a command.
    From(Uid),
    /// Wire to an input of a command.
    To(Uid, usize),
}

/// Result of a gesture or click.
pub(super) enum Outcome {
    Select(BTreeSet<Uid>),
    Move(Vec<(Uid, [f32; 2])>),
    Edit(TagOperation),
    Refused(WireError),
    /// Frame that opens, or is folded.
    Fold(Uid, bool),
    /// Menu at the pointer; `true` if it opens, `false` if it closes.
    Menu(MenuTarget),
    CloseMenu,
}

/// Pointer over the graph, in its space.
pub(super) struct Hand<'a> {
    pub graph: &'a Graph,
    pub rects: &'a [Rect],
    pub boxes: &'a [Option<Rect>],
    pub selected: &'a BTreeSet<Uid>,
    /// The pointer, if it is anywhere.
    pub at: Option<Pos2>,
    /// Place of the last press.
    pub pressed: Option<Pos2>,
    pub held: Modifiers,
    /// Points of the screen in a unit of the graph.
    pub scale: f32,
}

impl Hand<'_> {
    fn reach(&self) -> f32 {
        REACH / self.scale.max(1e-3)
    }

    fn spots(&self) -> Spots<'_> {
        Spots { graph: self.graph, rects: self.rects, boxes: self.boxes }
    }

    /// The frame that a click at a point opens or folds: a folded one, or the title of an open one.
    fn fold_at(&self, at: Pos2) -> Option<(Uid, bool)> {
        let spaces = self.spots().frames();
        let hit = |number: usize, space: &Rect| match self.boxes.get(number).copied().flatten() {
            Some(folded) => folded.contains(at).then_some(true),
            None => (space.contains(at) && at.y <= space.top() + TITLE).then_some(false),
        };
        let mut found = spaces.iter().enumerate().filter_map(|(number, space)| Some((number, hit(number, space)?)));
        found.next().map(|(number, opens)| (self.graph.frames[number].uid, opens))
    }

    /// The folded frame at a point.
    fn folded_at(&self, at: Pos2) -> Option<Uid> {
        let is_there = |folded: &Option<Rect>| folded.is_some_and(|folded| folded.contains(at));
        self.boxes.iter().position(is_there).map(|number| self.graph.frames[number].uid)
    }

    /// The topmost node at a point.
    pub fn node_at(&self, at: Pos2) -> Option<usize> {
        self.rects.iter().rposition(|rect| rect.contains(at))
    }

    /// Commands under the pointer: that of a node, or all of a folded frame.
    pub fn commands_at(&self) -> BTreeSet<Uid> {
        let Some(at) = self.at else { return BTreeSet::new() };
        if let Some(number) = self.node_at(at) {
            return BTreeSet::from([self.graph.nodes[number].tag]);
        }
        let Some(folded) = self.folded_at(at) else { return BTreeSet::new() };
        let is_inside = |frame: Option<usize>| frame.is_some_and(|frame| self.graph.frames[frame].uid == folded);
        self.graph.nodes.iter().filter(|node| is_inside(node.frame)).map(|node| node.tag).collect()
    }

    /// The wire under the pointer, where no node is.
    pub fn wire_at(&self) -> Option<GraphWire> {
        let at = self.at.filter(|at| self.node_at(*at).is_none())?;
        wire_at(self.spots(), at, self.reach() * 0.8)
    }

    /// Subject under the pointer: a node, a wire, a frame, or the ground.
    pub fn target(&self, node: Option<Uid>) -> MenuTarget {
        let tag = |number: usize| self.graph.nodes[number].tag;
        let node = node.or_else(|| self.at.and_then(|at| self.node_at(at)).map(tag));
        let wire = || self.wire_at().map(|wire| MenuTarget::Wire(tag(wire.to), wire.input, tag(wire.from)));
        let frame = || {
            let at = self.at?;
            let place = self.spots().frames().iter().position(|frame| frame.contains(at))?;
            Some(MenuTarget::Frame(self.graph.frames[place].uid))
        };
        node.map(MenuTarget::Node).or_else(wire).or_else(frame).unwrap_or(MenuTarget::Ground)
    }

    fn number(&self, tag: Uid) -> Option<usize> {
        self.graph.at.get(&tag).copied()
    }

    /// Distance by which nodes are moved, on the grid.
    pub fn shift(&self, from: Pos2) -> Vec2 {
        let by = self.at.map_or(Vec2::ZERO, |at| at - from);
        let [x, y] = snapped([by.x, by.y]);
        Vec2::new(x, y)
    }

    /// Shape that a gesture shows.
    pub fn ink(&self, gesture: &Gesture) -> Option<Ink> {
        let at = self.at?;
        match gesture {
            Gesture::Nodes(..) | Gesture::Folded(..) => None,
            Gesture::Box(from) => Some(Ink::Box(Rect::from_two_pos(*from, at))),
            Gesture::From(tag) => Some(Ink::Wire([output_pin(self.rects[self.number(*tag)?]), at])),
            Gesture::To(tag, input) => {
                let number = self.number(*tag)?;
                let count = self.graph.nodes[number].inputs.len();
                Some(Ink::Wire([at, input_pin(self.rects[number], *input, count)]))
            }
        }
    }

    /// Selection after a click on a node: that alone, or with Shift besides what is selected, or with Ctrl one more or less.
    fn with(&self, tag: Uid) -> BTreeSet<Uid> {
        let mut selected = self.selected.clone();
        match (self.held.command, self.held.shift) {
            (true, _) if selected.remove(&tag) => {}
            (true, _) | (_, true) => {
                selected.insert(tag);
            }
            _ => selected = BTreeSet::from([tag]),
        }
        selected
    }

    /// Gesture that begins with a drag of a part of a node, or of the ground.
    fn begin(&self, part: Option<NodePart>) -> Option<Gesture> {
        let from = self.pressed?;
        let tag = |number: usize| self.graph.nodes[number].tag;
        Some(match part {
            Some(NodePart::Output(number)) => Gesture::From(tag(number)),
            Some(NodePart::Input(number, input)) => Gesture::To(tag(number), input),
            Some(NodePart::Body(number)) => {
                let is_selected = self.selected.contains(&tag(number));
                let tags = if is_selected { self.selected.clone() } else { BTreeSet::from([tag(number)]) };
                Gesture::Nodes(tags, from)
            }
            // With a key held the frame is selected, as everything else is.
            None => match self.folded_at(from).filter(|_| self.held.is_none()) {
                Some(frame) => Gesture::Folded(frame, from),
                None => Gesture::Box(from),
            },
        })
    }

    /// Takes in what the pointer does to a part of a node, or to the ground.
    pub fn touch(
        &self,
        part: Option<NodePart>,
        response: &Response,
        gesture: &mut Option<Gesture>,
        outcomes: &mut Vec<Outcome>,
    ) {
        // Rectangles in place of nodes are part of the ground.
        let part = part.or_else(|| {
            let at = if response.drag_started() { self.pressed } else { self.at };
            at.and_then(|at| self.node_at(at)).map(NodePart::Body)
        });
        let tag = part.map(|part| match part {
            NodePart::Body(number) | NodePart::Output(number) | NodePart::Input(number, _) => {
                self.graph.nodes[number].tag
            }
        });
        if response.drag_started_by(PointerButton::Primary) {
            *gesture = self.begin(part);
            // A node that is dragged is a selected one.
            if let (Some(NodePart::Body(_)), Some(tag)) = (part, tag)
                && !self.selected.contains(&tag)
            {
                outcomes.push(Outcome::Select(BTreeSet::from([tag])));
            }
        }
        let is_clicked = response.clicked_by(PointerButton::Primary);
        let can_fold = is_clicked && tag.is_none() && self.held.is_none();
        let fold = self.at.filter(|_| can_fold).and_then(|at| self.fold_at(at));
        if let Some((frame, opens)) = fold {
            outcomes.extend([Outcome::Fold(frame, opens), Outcome::CloseMenu]);
        } else if is_clicked {
            let selected = tag.map_or_else(BTreeSet::new, |tag| self.with(tag));
            let adds = self.held.shift || self.held.command;
            if tag.is_some() || !adds && !self.selected.is_empty() {
                outcomes.push(Outcome::Select(selected));
            }
            outcomes.push(Outcome::CloseMenu);
        }
        if response.secondary_clicked() {
            if let Some(tag) = tag.filter(|tag| !self.selected.contains(tag)) {
                outcomes.push(Outcome::Select(BTreeSet::from([tag])));
            }
            let target = self.target(tag);
            outcomes.push(Outcome::Menu(target));
        }
    }

    /// Ends a gesture.
    pub fn end(&self, gesture: Gesture, bench: &Bench) -> Option<Outcome> {
        match gesture {
            Gesture::Nodes(tags, from) => {
                if self.shift(from) == Vec2::ZERO {
                    return None;
                }
                // The rectangles are where the gesture has brought them.
                // Selected commands in folded frames have none, and stay.
                let place = |tag: &Uid| {
                    let rect = self.rects[self.number(*tag)?];
                    rect.is_finite().then_some((*tag, [rect.min.x, rect.min.y]))
                };
                Some(Outcome::Move(tags.iter().filter_map(place).collect()))
            }
            Gesture::Folded(frame, from) => {
                if self.shift(from) == Vec2::ZERO {
                    return None;
                }
                let number = self.graph.frames.iter().position(|known| known.uid == frame)?;
                let folded = (*self.boxes.get(number)?)?;
                Some(Outcome::Move(vec![(frame, [folded.min.x, folded.min.y])]))
            }
            Gesture::Box(from) => {
                let space = Rect::from_two_pos(from, self.at?);
                let (nodes, spots) = (self.graph.nodes.iter().enumerate(), self.spots());
                // With a folded frame all of its commands are meant.
                let inside =
                    nodes.filter(|(number, _)| spots.shown(*number).intersects(space)).map(|(_, node)| node.tag);
                let mut selected = if self.held.shift { self.selected.clone() } else { BTreeSet::new() };
                for tag in inside {
                    if self.held.command && self.selected.contains(&tag) {
                        selected.remove(&tag);
                    } else {
                        selected.insert(tag);
                    }
                }
                Some(Outcome::Select(selected))
            }
            Gesture::From(tag) => {
                let (from, to) = (self.number(tag)?, self.node_at_end()?);
                let count = self.graph.nodes[to].inputs.len();
                let input = (0..count).find(|input| self.is_near(input_pin(self.rects[to], *input, count)));
                Some(self.connect(bench, from, to, input))
            }
            Gesture::To(tag, input) => {
                let (to, from) = (self.number(tag)?, self.node_at_end()?);
                Some(self.connect(bench, from, to, Some(input)))
            }
        }
    }

    /// The node at which a wire is let go: pins reach a little beyond their nodes.
    fn node_at_end(&self) -> Option<usize> {
        let at = self.at?;
        let reach = self.reach();
        self.node_at(at).or_else(|| self.rects.iter().rposition(|rect| rect.expand(reach).contains(at)))
    }

    fn is_near(&self, pin: Pos2) -> bool {
        // Inputs of a node stand above each other: the whole row counts.
        self.at.is_some_and(|at| (at.y - pin.y).abs() <= super::wires::ROW * 0.5)
    }

    fn connect(&self, bench: &Bench, from: usize, to: usize, input: Option<usize>) -> Outcome {
        let wire = bench.input_of(to, input).map(|input| GraphWire { to, input, from });
        match wire.and_then(|wire| bench.connected(wire, self.held.shift)) {
            Ok(operation) => Outcome::Edit(operation),
            Err(error) => Outcome::Refused(error),
        }
    }
}

/// The pointer in the space of a canvas.
pub(super) fn pointer(ui: &Ui, canvas: &Canvas) -> (Option<Pos2>, Option<Pos2>) {
    let inverse = canvas.transform.inverse();
    let (at, pressed) = ui.input(|input| (input.pointer.latest_pos(), input.pointer.press_origin()));
    (at.map(|at| inverse * at), pressed.map(|at| inverse * at))
}

/// True if a gesture is dropped.
pub(super) fn is_dropped(ui: &Ui) -> bool {
    ui.input(|input| input.key_pressed(Key::Escape))
}

/// Upper left corner of a rectangle as a place.
pub(super) fn moved(rect: Rect, place: [f32; 2]) -> Rect {
    Rect::from_min_size(pos2(place[0], place[1]), rect.size())
}
