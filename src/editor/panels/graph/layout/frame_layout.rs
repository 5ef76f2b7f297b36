//! Nodes of one frame: columns by depth of dependency, rows in an order with few crossings.
//!
//! Sweeps sort the nodes of a column by the mean place of their neighbours (barycentres; Sugiyama, Tagawa and Toda 1981).
//! Columns that would be too long are broken into several.

use std::collections::BTreeMap;

use bevy::math::ops;

use super::{COLUMN_GAP, GRID, ROW_GAP, on_grid};

/// Number of sweeps in each direction.
const SWEEPS: usize = 4;
/// Fewest nodes of a column that is broken.
const SHORTEST: usize = 4;
/// Nodes above each other for each that stands beside another, so that a broken frame is wider than high.
const STEEPNESS: f32 = 1.5;

/// Places of nodes, from the corner of what they take, and its size. Edges go from a node to a later one; others are left
/// out.
pub(super) fn columns(sizes: &[[f32; 2]], edges: &[(usize, usize)]) -> (Vec<[f32; 2]>, [f32; 2]) {
    let mut columns = Columns::new(sizes.len(), edges);
    columns.sort();
    columns.places(sizes)
}

struct Columns {
    /// Neighbours of each node before it.
    before: Vec<Vec<usize>>,
    /// Neighbours of each node after it.
    after: Vec<Vec<usize>>,
    /// Nodes in order, by depth.
    cells: Vec<Vec<usize>>,
    /// Row of each node, for the sweeps.
    rows: Vec<f32>,
}

impl Columns {
    fn new(count: usize, edges: &[(usize, usize)]) -> Self {
        let (mut before, mut after) = (vec![Vec::new(); count], vec![Vec::new(); count]);
        for (from, to) in edges.iter().filter(|(from, to)| from < to && *to < count) {
            before[*to].push(*from);
            after[*from].push(*to);
        }
        // Length of the longest path to each node.
        let mut depths: Vec<usize> = vec![0; count];
        for (node, before) in before.iter().enumerate() {
            depths[node] = before.iter().map(|other: &usize| depths[*other] + 1).max().unwrap_or(0);
        }
        let mut cells: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
        for (node, depth) in depths.iter().enumerate() {
            cells.entry(*depth).or_default().push(node);
        }
        let mut columns = Self { before, after, cells: cells.into_values().collect(), rows: vec![0.0; count] };
        (0..columns.cells.len()).for_each(|cell| columns.count(cell));
        columns
    }

    fn count(&mut self, cell: usize) {
        for (row, node) in self.cells[cell].iter().enumerate() {
            self.rows[*node] = row as f32;
        }
    }

    /// Sorts each column by the mean rows of its nodes' neighbours: forwards by those before, backwards by those after.
    fn sort(&mut self) {
        for _ in 0..SWEEPS {
            (0..self.cells.len()).for_each(|cell| self.sort_cell(cell, true));
            (0..self.cells.len()).rev().for_each(|cell| self.sort_cell(cell, false));
        }
        (0..self.cells.len()).for_each(|cell| self.sort_cell(cell, true));
    }

    fn sort_cell(&mut self, cell: usize, by_those_before: bool) {
        let neighbours = if by_those_before { &self.before } else { &self.after };
        let mean = |node: usize| match neighbours[node].len() {
            0 => self.rows[node],
            count => neighbours[node].iter().map(|other| self.rows[*other]).sum::<f32>() / count as f32,
        };
        let mut keys: Vec<(f32, usize)> = self.cells[cell].iter().map(|node| (mean(*node), *node)).collect();
        keys.sort_by(|(a, _), (b, _)| a.total_cmp(b));
        self.cells[cell] = keys.into_iter().map(|(_, node)| node).collect();
        self.count(cell);
    }

    /// Turns rows and columns into places.
    fn places(&self, sizes: &[[f32; 2]]) -> (Vec<[f32; 2]>, [f32; 2]) {
        let longest = SHORTEST.max(ops::sqrt(STEEPNESS * sizes.len() as f32).ceil() as usize);
        let height = |node: &usize| on_grid(sizes[*node][1]) + ROW_GAP;
        let tall = |column: &[usize]| column.iter().map(height).sum::<f32>();
        let columns: Vec<&[usize]> = self.cells.iter().flat_map(|cell| cell.chunks(longest)).collect();
        let tallest = columns.iter().copied().map(tall).fold(0.0, f32::max);
        let mut places = vec![[0.0; 2]; sizes.len()];
        let mut x = 0.0;
        for column in columns {
            let mut y = ((tallest - tall(column)) / (2.0 * GRID)).floor() * GRID;
            for node in column {
                places[*node] = [x, y];
                y += height(node);
            }
            let widest = column.iter().map(|node| sizes[*node][0]).fold(0.0, f32::max);
            x += on_grid(widest) + COLUMN_GAP;
        }
        (places, [(x - COLUMN_GAP).max(0.0), (tallest - ROW_GAP).max(0.0)])
    }
}
