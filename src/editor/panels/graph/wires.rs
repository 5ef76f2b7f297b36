//! Shapes of wires and frames, and the wire under the pointer.
//!
//! The panel draws its wires itself. Snarl would walk all wires for each pin of each node, and only knows wires between
//! nodes that are drawn, where those that leave the view are to be seen, too.

use bevy_egui::egui::{Color32, Mesh, Painter, Pos2, Rect, Shape, Stroke, pos2, vec2};

use super::model::{Graph, GraphWire};

/// Width of a node.
pub(super) const WIDTH: f32 = 220.0;
/// Height of the title and the summary.
pub(super) const HEAD: f32 = 44.0;
/// Height of an input.
pub(super) const ROW: f32 = 18.0;
/// Height from the top of a node to its output, and to what it reads besides its inputs.
const PIN_Y: f32 = 14.0;
/// Number of straight parts of a wire.
const PARTS: usize = 14;
/// Most wires that are drawn as curves; more are straight.
const MOST_CURVES: usize = 240;

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

/// Ends of a wire.
pub(super) fn ends(graph: &Graph, rects: &[Rect], wire: GraphWire) -> [Pos2; 2] {
    [output_pin(rects[wire.from]), input_pin(rects[wire.to], wire.input, graph.nodes[wire.to].inputs.len())]
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
    /// Colour of the wires of selected commands.
    pub selected: Color32,
    pub is_selected: &'a dyn Fn(usize) -> bool,
    /// Wire under the pointer.
    pub hovered: Option<GraphWire>,
    /// Units of the graph in a point of the screen.
    pub unit: f32,
}

impl WireInk<'_> {
    fn stroke(&self, graph: &Graph, wire: GraphWire) -> Stroke {
        let is_reference = wire.input < graph.nodes[wire.to].inputs.len();
        let color = match is_reference {
            _ if self.hovered == Some(wire) => self.selected,
            _ if (self.is_selected)(wire.from) || (self.is_selected)(wire.to) => self.selected,
            true => self.reference,
            false => self.besides,
        };
        let width = if self.hovered == Some(wire) { 3.0 } else { 1.5 };
        Stroke::new(width * self.unit.max(1.0), color)
    }
}

/// Draws the wires that cross the view: curves, or straight lines in one shape where there are many.
pub(super) fn draw(painter: &Painter, view: Rect, graph: &Graph, rects: &[Rect], ink: &WireInk) {
    let seen: Vec<(GraphWire, [Pos2; 2])> = graph
        .wires
        .iter()
        .map(|wire| (*wire, ends(graph, rects, *wire)))
        .filter(|(_, ends)| bounds(*ends).intersects(view))
        .collect();
    if seen.len() <= MOST_CURVES {
        painter.extend(seen.into_iter().map(|(wire, ends)| Shape::line(curve(ends), ink.stroke(graph, wire))));
        return;
    }
    let mut mesh = Mesh::default();
    for (wire, ends) in seen {
        add_line(&mut mesh, ends, ink.stroke(graph, wire));
    }
    painter.add(Shape::mesh(mesh));
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
pub(super) fn wire_at(graph: &Graph, rects: &[Rect], at: Pos2, reach: f32) -> Option<GraphWire> {
    let mut nearest: Option<(f32, GraphWire)> = None;
    for wire in &graph.wires {
        let ends = ends(graph, rects, *wire);
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

/// Space of each frame: that of its nodes, with room for its title.
pub(super) fn frames(graph: &Graph, rects: &[Rect]) -> Vec<Rect> {
    let mut frames = vec![Rect::NOTHING; graph.frames.len()];
    for (node, rect) in graph.nodes.iter().zip(rects) {
        if let Some(frame) = node.frame {
            frames[frame] = frames[frame].union(*rect);
        }
    }
    frames
        .into_iter()
        .map(|frame| Rect { min: frame.min - vec2(16.0, 34.0), max: frame.max + vec2(16.0, 16.0) })
        .collect()
}
