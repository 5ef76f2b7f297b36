//! Places of nodes, wires and frames, and the wire under the pointer.
//!
//! The panel draws its wires itself. Snarl would walk all wires for each pin of each node, and only knows wires between
//! nodes that are drawn, where those that leave the view are to be seen, too.

use std::collections::BTreeSet;

use bevy_egui::egui::{Color32, Mesh, Painter, Pos2, Rect, Shape, Stroke, pos2, vec2};

use super::{
    focus::Focus,
    model::{Graph, GraphWire},
};

/// Width of a node.
pub(super) const WIDTH: f32 = 220.0;
/// Height of the title and the summary.
pub(super) const HEAD: f32 = 44.0;
/// Height of an input.
pub(super) const ROW: f32 = 18.0;
/// Height from the top of a node to its output, and to what it reads besides its inputs.
const PIN_Y: f32 = 14.0;
/// Width and height of a folded frame.
pub(super) const BOX: [f32; 2] = [240.0, 60.0];
/// Height of the title of an open frame.
pub(super) const TITLE: f32 = 30.0;
/// Number of straight parts of a wire.
const PARTS: usize = 14;
/// Most wires that are drawn as curves; of more, those out of focus are straight.
const MOST_CURVES: usize = 240;
/// Strength of wires out of focus.
const FADED: f32 = 0.3;
/// Most readers of a command whose wires are drawn from end to end while they are out of focus: those of a hub would lie
/// over everything else.
pub(super) const MOST_READERS: usize = 12;
/// Length of the ends of a wire that is cut short.
const STUB: f32 = 22.0;

/// Width and height of a node with a number of inputs.
pub(super) fn node_size(inputs: usize) -> [f32; 2] {
    let room = if inputs == 0 { 0.0 } else { 6.0 };
    [WIDTH, HEAD + ROW * inputs as f32 + room]
}

/// Place of the output of a node.
pub(super) fn output_pin(node: Rect) -> Pos2 {
    pos2(node.right(), node.top() + PIN_Y)
}

/// Place of an input of a node; that of all else that the command reads behind the last.
pub(super) fn input_pin(node: Rect, input: usize, inputs: usize) -> Pos2 {
    let y = if input < inputs { HEAD + ROW * (input as f32 + 0.5) } else { PIN_Y };
    pos2(node.left(), node.top() + y)
}

/// Pins of a folded frame: what its commands read from others, and what others read from them.
pub(super) fn box_pins(folded: Rect) -> [Pos2; 2] {
    [folded.left_center(), folded.right_center()]
}

/// A graph with the places of its nodes and folded frames.
#[derive(Clone, Copy)]
pub(super) struct Spots<'a> {
    pub graph: &'a Graph,
    /// Rectangle of each command; nothing where its frame is folded.
    pub rects: &'a [Rect],
    /// Rectangle of each folded frame.
    pub boxes: &'a [Option<Rect>],
}

impl Spots<'_> {
    /// The folded frame that a command is in.
    fn folded(&self, number: usize) -> Option<(usize, Rect)> {
        let frame = self.graph.nodes[number].frame?;
        Some((frame, (*self.boxes.get(frame)?)?))
    }

    /// Rectangle of a command, or of the folded frame that it is in.
    pub fn shown(&self, number: usize) -> Rect {
        self.folded(number).map_or(self.rects[number], |(_, folded)| folded)
    }

    /// Ends of a wire; `None` inside of a folded frame.
    pub fn ends(&self, wire: GraphWire) -> Option<[Pos2; 2]> {
        let (from, to) = (self.folded(wire.from), self.folded(wire.to));
        if from.is_some() && from.map(|(frame, _)| frame) == to.map(|(frame, _)| frame) {
            return None;
        }
        let start = from.map_or_else(|| output_pin(self.rects[wire.from]), |(_, folded)| box_pins(folded)[1]);
        let inputs = self.graph.nodes[wire.to].inputs.len();
        let end =
            to.map_or_else(|| input_pin(self.rects[wire.to], wire.input, inputs), |(_, folded)| box_pins(folded)[0]);
        Some([start, end])
    }

    /// Space of each frame: that of its nodes, with room for its title, or the box of a folded one.
    pub fn frames(&self) -> Vec<Rect> {
        let mut frames = vec![Rect::NOTHING; self.graph.frames.len()];
        for (node, rect) in self.graph.nodes.iter().zip(self.rects) {
            if let Some(frame) = node.frame {
                frames[frame] = frames[frame].union(*rect);
            }
        }
        let framed = |(number, frame): (usize, Rect)| match self.boxes.get(number).copied().flatten() {
            Some(folded) => folded,
            None => Rect { min: frame.min - vec2(16.0, 34.0), max: frame.max + vec2(16.0, 16.0) },
        };
        frames.into_iter().enumerate().map(framed).collect()
    }
}

/// Points of a curve that leaves its ends level.
pub(super) fn curve([from, to]: [Pos2; 2]) -> Vec<Pos2> {
    let reach = ((to.x - from.x).abs() * 0.5).clamp(30.0, 160.0);
    let (leave, arrive) = (pos2(from.x + reach, from.y), pos2(to.x - reach, to.y));
    let at = |part: usize| {
        let t = part as f32 / PARTS as f32;
        let (a, b, c) = (from.lerp(leave, t), leave.lerp(arrive, t), arrive.lerp(to, t));
        a.lerp(b, t).lerp(b.lerp(c, t), t)
    };
    (0..=PARTS).map(at).collect()
}

/// Space that a wire can take.
fn bounds([from, to]: [Pos2; 2]) -> Rect {
    let rect = Rect::from_two_pos(from, to);
    // A curve that goes back reaches beyond its ends.
    rect.expand2(vec2(if to.x < from.x { 120.0 } else { 2.0 }, 2.0))
}

/// Colour and width of wires.
pub(super) struct WireInk<'a> {
    pub reference: Color32,
    /// Colour of wires that no reference makes.
    pub besides: Color32,
    /// Colour of the wires of commands in focus.
    pub selected: Color32,
    pub focus: &'a Focus,
    /// Wire under the pointer.
    pub hovered: Option<GraphWire>,
    /// Units of the graph in a point of the screen.
    pub unit: f32,
}

impl WireInk<'_> {
    fn is_lit(&self, graph: &Graph, wire: GraphWire) -> bool {
        self.hovered == Some(wire) || self.focus.has(graph, wire)
    }

    fn stroke(&self, graph: &Graph, wire: GraphWire) -> Stroke {
        let is_reference = wire.input < graph.nodes[wire.to].inputs.len();
        let usual = if is_reference { self.reference } else { self.besides };
        let color = if self.is_lit(graph, wire) {
            self.selected
        } else if self.focus.fades {
            usual.gamma_multiply(FADED)
        } else {
            usual
        };
        let width = if self.hovered == Some(wire) { 3.0 } else { 1.5 };
        Stroke::new(width * self.unit.max(1.0), color)
    }
}

/// Number of readers of each command.
pub(super) struct Readers(Vec<usize>);

impl Readers {
    pub fn of(graph: &Graph) -> Self {
        let mut counts = vec![0; graph.nodes.len()];
        for wire in &graph.wires {
            counts[wire.from] += 1;
        }
        Self(counts)
    }

    /// True for a wire that is cut short: out of focus, and one of many that leave a command.
    pub fn cut_short(&self, graph: &Graph, focus: &Focus, wire: GraphWire) -> bool {
        focus.fades && self.0[wire.from] > MOST_READERS && !focus.has(graph, wire)
    }
}

/// Draws the wires that cross the view, those in focus above all others: curves, or straight lines in one shape where there
/// are many out of focus. Of wires that are cut short the ends alone are drawn.
pub(super) fn draw(painter: &Painter, view: Rect, spots: Spots, ink: &WireInk) {
    let graph = spots.graph;
    // Of the wires between two folded frames one is drawn, and one in focus before others.
    let mut drawn: BTreeSet<[u32; 4]> = BTreeSet::new();
    let mut seen = |are_lit: bool| -> Vec<(GraphWire, [Pos2; 2])> {
        let mut is_new = |[from, to]: [Pos2; 2]| drawn.insert([from.x, from.y, to.x, to.y].map(f32::to_bits));
        let wires = graph.wires.iter().copied().filter(|wire| ink.is_lit(graph, *wire) == are_lit);
        let placed = wires.filter_map(|wire| Some((wire, spots.ends(wire)?)));
        placed.filter(|(_, ends)| bounds(*ends).intersects(view) && is_new(*ends)).collect()
    };
    let (lit, others) = (seen(true), seen(false));
    let readers = Readers::of(graph);
    let is_short = |(wire, _): &(GraphWire, [Pos2; 2])| readers.cut_short(graph, ink.focus, *wire);
    let (short, others): (Vec<_>, Vec<_>) = others.into_iter().partition(is_short);
    let mut mesh = Mesh::default();
    let mut stubs: BTreeSet<[u32; 2]> = BTreeSet::new();
    for (wire, [from, to]) in short {
        for [start, end] in [[from, from + vec2(STUB, 0.0)], [to, to - vec2(STUB, 0.0)]] {
            if stubs.insert([start.x, start.y].map(f32::to_bits)) {
                add_line(&mut mesh, [start, end], ink.stroke(graph, wire));
            }
        }
    }
    let curved = |(wire, ends): (GraphWire, [Pos2; 2])| Shape::line(curve(ends), ink.stroke(graph, wire));
    if lit.len() + others.len() <= MOST_CURVES {
        painter.extend(others.into_iter().map(curved));
    } else {
        for (wire, ends) in others {
            add_line(&mut mesh, ends, ink.stroke(graph, wire));
        }
    }
    painter.add(Shape::mesh(mesh));
    painter.extend(lit.into_iter().map(curved));
}

/// Adds a straight line to a mesh.
fn add_line(mesh: &mut Mesh, [from, to]: [Pos2; 2], stroke: Stroke) {
    let along = to - from;
    let side = along.rot90() * (stroke.width / (2.0 * along.length().max(1e-3)));
    let first = mesh.vertices.len() as u32;
    for corner in [from + side, from - side, to - side, to + side] {
        mesh.colored_vertex(corner, stroke.color);
    }
    mesh.add_triangle(first, first + 1, first + 2);
    mesh.add_triangle(first, first + 2, first + 3);
}

/// The wire that is nearest to a point, within a reach.
pub(super) fn wire_at(spots: Spots, at: Pos2, reach: f32) -> Option<GraphWire> {
    let mut nearest: Option<(f32, GraphWire)> = None;
    for wire in &spots.graph.wires {
        let Some(ends) = spots.ends(*wire) else { continue };
        if !bounds(ends).expand(reach).contains(at) {
            continue;
        }
        let distance = curve(ends).windows(2).map(|part| distance(at, [part[0], part[1]])).fold(f32::MAX, f32::min);
        if distance <= reach && nearest.is_none_or(|(least, _)| distance < least) {
            nearest = Some((distance, *wire));
        }
    }
    nearest.map(|(_, wire)| wire)
}

fn distance(at: Pos2, [from, to]: [Pos2; 2]) -> f32 {
    let along = to - from;
    let t = ((at - from).dot(along) / along.length_sq().max(1e-6)).clamp(0.0, 1.0);
    at.distance(from + along * t)
}
