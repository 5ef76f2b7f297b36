//! Layout of a graph: nodes of one frame in columns by depth of dependency, frames beside each other in rows, so that the
//! whole has about the shape of a panel.
//!
//! Within a frame a node stands right of everything there that it depends on, and sweeps sort each column by the mean place
//! of the neighbours (`frame_layout`). Frames stand in columns by the depth of their dependencies, too, and the columns are
//! broken into rows (`packing`). A frame that is folded is one node. Nodes that are in no frame share a block without a
//! title. The time grows with the number of nodes and edges, but for the sorting of columns; the same graph always gives
//! the same places.

mod frame_layout;
mod packing;

use std::collections::BTreeMap;

use packing::{Block, pack};

/// Distance between the lines of the grid that places lie on.
pub const GRID: f32 = 20.0;

/// Free space between columns, and right of a node for its wires.
const COLUMN_GAP: f32 = 4.0 * GRID;
/// Free space between nodes of a column.
const ROW_GAP: f32 = GRID;
/// Free space in a frame left of its nodes and above them, where its title stands.
const CORNER: [f32; 2] = [GRID, 2.0 * GRID];
/// Free space in a frame right of its nodes and below them.
const MARGIN: f32 = GRID;

/// Node that is laid out.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LayoutNode {
    /// Width and height.
    pub size: [f32; 2],
    /// Frame that the node belongs to.
    pub frame: Option<usize>,
    /// True for a frame that is folded: the node is all of it, and needs no room for a title.
    pub is_folded: bool,
}

/// The nearest place on the grid.
pub fn snapped(place: [f32; 2]) -> [f32; 2] {
    place.map(|number| (number / GRID).round() * GRID)
}

/// Upper left corners of nodes, on the grid. An edge goes from a node to one that depends on it, and counts as often as it is
/// listed; within a frame those that do not go to a later node are left out.
pub fn lay_out(nodes: &[LayoutNode], edges: &[(usize, usize)]) -> Vec<[f32; 2]> {
    // Blocks in the order of their first nodes.
    let mut numbers: BTreeMap<Option<usize>, usize> = BTreeMap::new();
    let mut members: Vec<Vec<usize>> = Vec::new();
    // Block of each node, and its number there.
    let mut at: Vec<(usize, usize)> = Vec::with_capacity(nodes.len());
    for (number, node) in nodes.iter().enumerate() {
        let block = *numbers.entry(node.frame).or_insert_with(|| {
            members.push(Vec::new());
            members.len() - 1
        });
        at.push((block, members[block].len()));
        members[block].push(number);
    }
    let mut links: BTreeMap<(usize, usize), usize> = BTreeMap::new();
    let mut within: Vec<Vec<(usize, usize)>> = vec![Vec::new(); members.len()];
    for (from, to) in edges {
        let (Some((of_from, from)), Some((of_to, to))) = (at.get(*from), at.get(*to)) else { continue };
        if of_from == of_to {
            within[*of_from].push((*from, *to));
        } else {
            *links.entry((*of_from, *of_to)).or_default() += 1;
        }
    }
    let mut blocks = Vec::with_capacity(members.len());
    let mut inner = Vec::with_capacity(members.len());
    for (members, edges) in members.iter().zip(&within) {
        let sizes: Vec<[f32; 2]> = members.iter().map(|node| nodes[*node].size).collect();
        let (places, size) = frame_layout::columns(&sizes, edges);
        let is_framed = members.iter().any(|node| nodes[*node].frame.is_some() && !nodes[*node].is_folded);
        let corner = if is_framed { CORNER } else { [0.0; 2] };
        let margin = if is_framed { MARGIN } else { 0.0 };
        let mean = members.iter().map(|node| *node as f32).sum::<f32>() / members.len().max(1) as f32;
        blocks.push(Block { size: [0, 1].map(|axis| size[axis] + corner[axis] + margin), mean });
        inner.push((places, corner));
    }
    let corners = pack(&blocks, &links);
    let place = |(block, number): &(usize, usize)| {
        let (places, corner) = &inner[*block];
        [0, 1].map(|axis| corners[*block][axis] + corner[axis] + places[*number][axis])
    };
    at.iter().map(place).collect()
}

/// Number of crossings between edges whose ends stand in the same two columns: a measure for tests. The time grows
/// with the square of the number of edges.
pub fn crossings(places: &[[f32; 2]], edges: &[(usize, usize)]) -> usize {
    let mut count = 0;
    for (number, (a, b)) in edges.iter().enumerate() {
        for (c, d) in &edges[..number] {
            let is_alike = places[*a][0] == places[*c][0] && places[*b][0] == places[*d][0];
            let (from, to) = (places[*a][1] - places[*c][1], places[*b][1] - places[*d][1]);
            count += usize::from(is_alike && from * to < 0.0);
        }
    }
    count
}

/// The length, up to the next line of the grid.
fn on_grid(length: f32) -> f32 {
    (length / GRID).ceil() * GRID
}
