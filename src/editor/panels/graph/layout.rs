//! Layout of a graph: columns by depth of dependency, rows in an order with few crossings, frames as bands above each
//! other.
//!
//! A node stands right of everything that it depends on. Nodes of one frame share a band, which no other node stands in,
//! so frames never overlap. Within a column of a band, sweeps sort nodes by the mean place of their neighbours
//! (barycentres; Sugiyama, Tagawa and Toda 1981). Columns that would be too long are broken into several. The time grows
//! with the number of nodes and edges, but for the sorting of columns; the same graph always gives the same places.

use std::collections::BTreeMap;

use bevy::math::ops;

/// Distance between the lines of the grid that places lie on.
pub const GRID: f32 = 20.0;

/// Free space between columns, and right of a node for its wires.
const COLUMN_GAP: f32 = 4.0 * GRID;
/// Free space between nodes of a column.
const ROW_GAP: f32 = GRID;
/// Free space between bands, in which the titles of frames stand.
const BAND_GAP: f32 = 4.0 * GRID;
/// Number of sweeps in each direction.
const SWEEPS: usize = 4;
/// Fewest nodes of a column that is broken.
const SHORTEST: usize = 6;

/// Node that is laid out.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LayoutNode {
    /// Width and height.
    pub size: [f32; 2],
    /// Frame that the node belongs to.
    pub frame: Option<usize>,
}

/// The nearest place on the grid.
pub fn snapped(place: [f32; 2]) -> [f32; 2] {
    place.map(|number| (number / GRID).round() * GRID)
}

/// Upper left corners of nodes, on the grid. An edge goes from a node to a later one that depends on it; others are left
/// out.
pub fn lay_out(nodes: &[LayoutNode], edges: &[(usize, usize)]) -> Vec<[f32; 2]> {
    let links = Links::new(nodes.len(), edges);
    let mut columns = Columns::new(nodes, &links);
    columns.sort(&links);
    columns.places(nodes)
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

/// Neighbours of each node, before and after it.
struct Links {
    before: Vec<Vec<usize>>,
    after: Vec<Vec<usize>>,
}

impl Links {
    fn new(count: usize, edges: &[(usize, usize)]) -> Self {
        let mut links = Self { before: vec![Vec::new(); count], after: vec![Vec::new(); count] };
        for (from, to) in edges.iter().filter(|(from, to)| from < to && *to < count) {
            links.before[*to].push(*from);
            links.after[*from].push(*to);
        }
        links
    }

    /// Length of the longest path to each node.
    fn depths(&self) -> Vec<usize> {
        let mut depths = vec![0; self.before.len()];
        for node in 0..depths.len() {
            depths[node] = self.before[node].iter().map(|before| depths[*before] + 1).max().unwrap_or(0);
        }
        depths
    }
}

/// Nodes by band and column.
struct Columns {
    /// Nodes in order, by band and depth.
    cells: BTreeMap<(usize, usize), Vec<usize>>,
    /// Most nodes of an unbroken column.
    longest: usize,
    /// Row of each node, counted through all bands, for the sweeps.
    rows: Vec<f32>,
    /// First row of each band.
    starts: Vec<f32>,
}

impl Columns {
    fn new(nodes: &[LayoutNode], links: &Links) -> Self {
        let depths = links.depths();
        // Bands in the order of their first nodes.
        let mut bands: BTreeMap<Option<usize>, usize> = BTreeMap::new();
        let mut cells: BTreeMap<(usize, usize), Vec<usize>> = BTreeMap::new();
        for (number, node) in nodes.iter().enumerate() {
            let next = bands.len();
            let band = *bands.entry(node.frame).or_insert(next);
            cells.entry((band, depths[number])).or_default().push(number);
        }
        let longest = SHORTEST.max(ops::sqrt(nodes.len() as f32).ceil() as usize);
        let mut lengths = vec![0; bands.len()];
        for ((band, _), cell) in &cells {
            lengths[*band] = cell.len().max(lengths[*band]);
        }
        let mut starts = Vec::with_capacity(lengths.len());
        let mut next = 0.0;
        for length in lengths {
            starts.push(next);
            next += length as f32;
        }
        let mut columns = Self { cells, longest, rows: vec![0.0; nodes.len()], starts };
        let all: Vec<(usize, usize)> = columns.cells.keys().copied().collect();
        all.into_iter().for_each(|cell| columns.count(cell));
        columns
    }

    /// Numbers the rows of a cell, about the middle of its band.
    fn count(&mut self, cell: (usize, usize)) {
        let Some(nodes) = self.cells.get(&cell) else { return };
        for (row, node) in nodes.iter().enumerate() {
            self.rows[*node] = self.starts[cell.0] + row as f32;
        }
    }

    /// Sorts each cell by the mean rows of its nodes' neighbours: forwards by those before, backwards by those after.
    fn sort(&mut self, links: &Links) {
        let mut order: Vec<(usize, usize)> = self.cells.keys().copied().collect();
        order.sort_by_key(|(band, depth)| (*depth, *band));
        for _ in 0..SWEEPS {
            for cell in &order {
                self.sort_cell(*cell, &links.before);
            }
            for cell in order.iter().rev() {
                self.sort_cell(*cell, &links.after);
            }
        }
        for cell in &order {
            self.sort_cell(*cell, &links.before);
        }
    }

    fn sort_cell(&mut self, cell: (usize, usize), neighbours: &[Vec<usize>]) {
        let Some(mut nodes) = self.cells.remove(&cell) else { return };
        let mean = |node: usize| {
            let list = &neighbours[node];
            match list.len() {
                0 => self.rows[node],
                count => list.iter().map(|other| self.rows[*other]).sum::<f32>() / count as f32,
            }
        };
        let mut keys: Vec<(f32, usize)> = nodes.iter().map(|node| (mean(*node), *node)).collect();
        keys.sort_by(|(a, _), (b, _)| a.total_cmp(b));
        nodes.clear();
        nodes.extend(keys.into_iter().map(|(_, node)| node));
        self.cells.insert(cell, nodes);
        self.count(cell);
    }

    /// Turns rows and columns into places.
    fn places(&self, nodes: &[LayoutNode]) -> Vec<[f32; 2]> {
        let on_grid = |length: f32| (length / GRID).ceil() * GRID;
        // Left edges of the columns of each depth: as many as the band with most nodes there needs.
        let mut counts: BTreeMap<usize, usize> = BTreeMap::new();
        for ((_, depth), cell) in &self.cells {
            let count = counts.entry(*depth).or_default();
            *count = cell.len().div_ceil(self.longest).max(*count);
        }
        let widest = nodes.iter().map(|node| node.size[0]).fold(0.0, f32::max);
        let step = on_grid(widest) + COLUMN_GAP;
        let mut lefts: BTreeMap<usize, f32> = BTreeMap::new();
        let mut next = 0.0;
        for (depth, count) in counts {
            lefts.insert(depth, next);
            next += step * count as f32;
        }
        let mut places = vec![[0.0; 2]; nodes.len()];
        let height = |node: &usize| on_grid(nodes[*node].size[1]) + ROW_GAP;
        let mut top = 0.0;
        for band in 0..self.starts.len() {
            let cells = || self.cells.range((band, 0)..(band + 1, 0));
            let columns = || cells().flat_map(|(_, cell)| cell.chunks(self.longest));
            let tallest = columns().map(|column| column.iter().map(height).sum::<f32>()).fold(0.0, f32::max);
            for ((_, depth), cell) in cells() {
                for (number, column) in cell.chunks(self.longest).enumerate() {
                    let x = lefts[depth] + step * number as f32;
                    let rest = tallest - column.iter().map(height).sum::<f32>();
                    let mut y = top + (rest / (2.0 * GRID)).floor() * GRID;
                    for node in column {
                        places[*node] = [x, y];
                        y += height(node);
                    }
                }
            }
            top += tallest + BAND_GAP;
        }
        places
    }
}
