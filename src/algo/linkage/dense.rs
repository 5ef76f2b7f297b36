//! The last clusters: a matrix of all their mean distances.

use rayon::prelude::*;

use super::{LinkageError, engine::Cluster, history::History, moments::Tree, pair::Points};

/// Number of clusters from which the matrix is filled.
pub(super) fn clusters(points: usize) -> usize {
    LAST.min(points)
}

/// Row of a cluster in the matrix.
#[derive(Clone, Copy)]
struct Row {
    node: u32,
    size: u32,
    /// Nearest row, or [`NONE`].
    nearest: u32,
    distance: f64,
}

/// Number of clusters with few enough distances for a matrix, and small enough for sums before.
const LAST: usize = 384;
const NONE: u32 = u32::MAX;
/// Largest number of distances that are compared on one thread.
const ALONE: usize = 1 << 15;

struct Matrix {
    stride: usize,
    cells: Vec<f64>,
    rows: Vec<Row>,
}

/// Merges the clusters until one is left.
pub(super) fn finish(
    clusters: &[Cluster],
    points: &Points,
    history: &mut History,
    report: &dyn Fn(usize) -> Result<(), LinkageError>,
) -> Result<(), LinkageError> {
    let mut matrix = Matrix::fill(clusters, points);
    report(clusters.len())?;
    let mut work: Vec<u32> = (0..clusters.len() as u32).collect();
    while matrix.rows.len() > 1 {
        matrix.search(&work);
        matrix.merge_round(history, &mut work);
        matrix.close_gaps(&mut work);
    }
    Ok(())
}

/// Cuts each cluster into blocks, and sorts the points by block.
fn plant(clusters: &[Cluster], points: &Points) -> (Vec<Tree>, Points) {
    let mut order: Vec<u32> = (0..points.len() as u32).collect();
    let mut parts: Vec<&mut [u32]> = Vec::with_capacity(clusters.len());
    let mut rest = order.as_mut_slice();
    for cluster in clusters {
        let (part, next) = std::mem::take(&mut rest).split_at_mut(cluster.span.size as usize);
        parts.push(part);
        rest = next;
    }
    let trees = clusters.par_iter().zip(parts).map(|(cluster, part)| Tree::new(points, cluster.span, part)).collect();
    let mut sorted = Points::with_capacity(points.len());
    for &at in &order {
        sorted.push(points.at(at as usize));
    }
    (trees, sorted)
}

impl Matrix {
    fn fill(clusters: &[Cluster], points: &Points) -> Self {
        let stride = clusters.len();
        let rows = clusters
            .iter()
            .map(|cluster| Row { node: cluster.node, size: cluster.span.size, nearest: NONE, distance: f64::INFINITY })
            .collect();
        let mut cells = vec![f64::INFINITY; stride * stride];
        let (trees, points) = plant(clusters, points);
        // Rows get longer, so each task takes rows from both ends.
        cells.par_chunks_mut(stride).enumerate().with_max_len(4).for_each(|(at, row)| {
            for (to, cell) in row[..at].iter_mut().enumerate() {
                let count = f64::from(clusters[to].span.size) * f64::from(clusters[at].span.size);
                *cell = trees[to].sum(&trees[at], &points) / count;
            }
        });
        for at in 0..stride {
            for to in 0..at {
                cells[to * stride + at] = cells[at * stride + to];
            }
        }
        Self { stride, cells, rows }
    }

    /// Finds the nearest of each row in `work`.
    fn search(&mut self, work: &[u32]) {
        let nearest = |&at: &u32| {
            let cells = &self.cells[at as usize * self.stride..][..self.rows.len()];
            let least = cells.iter().copied().fold(f64::INFINITY, f64::min);
            let node = self.rows[at as usize].node;
            let mut best = NONE;
            let mut age = (u32::MAX, u32::MAX);
            for (to, &cell) in cells.iter().enumerate() {
                if cell == least && to != at as usize {
                    let other = self.rows[to].node;
                    let pair = (node.max(other), node.min(other));
                    if pair < age {
                        (best, age) = (to as u32, pair);
                    }
                }
            }
            (best, least)
        };
        let found: Vec<(u32, f64)> = if work.len() * self.rows.len() < ALONE {
            work.iter().map(nearest).collect()
        } else {
            work.par_iter().with_min_len(8).map(nearest).collect()
        };
        for (&at, found) in work.iter().zip(found) {
            let row = &mut self.rows[at as usize];
            (row.nearest, row.distance) = found;
        }
    }

    fn merge_round(&mut self, history: &mut History, work: &mut Vec<u32>) {
        let mut pairs: Vec<(u32, u32)> = Vec::new();
        for (at, row) in self.rows.iter().enumerate() {
            let near = row.nearest;
            if near as usize > at && near != NONE && self.rows[near as usize].nearest == at as u32 {
                pairs.push((at as u32, near));
            }
        }
        if pairs.is_empty() {
            let least = (0..self.rows.len()).min_by(|&a, &b| self.rows[a].distance.total_cmp(&self.rows[b].distance));
            if let Some(at) = least {
                let near = self.rows[at].nearest;
                pairs.push(((at as u32).min(near), near.max(at as u32)));
            }
        }
        for &(a, b) in &pairs {
            self.merge(a as usize, b as usize, history);
        }
        // Rows whose nearest row was merged are searched again.
        let mut merged = vec![false; self.rows.len()];
        for &(a, b) in &pairs {
            merged[a as usize] = true;
            merged[b as usize] = true;
        }
        work.clear();
        for (at, row) in self.rows.iter_mut().enumerate() {
            if row.size > 0 && (merged[at] || merged[row.nearest as usize]) {
                row.nearest = NONE;
                work.push(at as u32);
            }
        }
    }

    /// Merges row `b` into row `a`: the mean over all pairs is that of the parts, weighted by their sizes.
    fn merge(&mut self, a: usize, b: usize, history: &mut History) {
        let (first, second) = (self.rows[a], self.rows[b]);
        let size = first.size + second.size;
        let (part_a, part_b) = (f64::from(first.size) / f64::from(size), f64::from(second.size) / f64::from(size));
        let count = self.rows.len();
        for to in 0..count {
            let mean = part_a * self.cells[a * self.stride + to] + part_b * self.cells[b * self.stride + to];
            self.cells[a * self.stride + to] = mean;
            self.cells[to * self.stride + a] = mean;
            self.cells[to * self.stride + b] = f64::INFINITY;
        }
        self.cells[a * self.stride + a] = f64::INFINITY;
        let node = history.join(first.node, second.node, self.rows[a].distance.min(second.distance), size);
        self.rows[a] = Row { node, size, nearest: NONE, distance: f64::INFINITY };
        self.rows[b] = Row { node, size: 0, nearest: NONE, distance: f64::INFINITY };
    }

    /// Removes dead rows and columns.
    fn close_gaps(&mut self, work: &mut [u32]) {
        let kept: Vec<usize> = (0..self.rows.len()).filter(|&at| self.rows[at].size > 0).collect();
        let mut moved = vec![NONE; self.rows.len()];
        for (to, &at) in kept.iter().enumerate() {
            moved[at] = to as u32;
        }
        for (row, &at) in kept.iter().enumerate() {
            for (column, &to) in kept.iter().enumerate() {
                self.cells[row * self.stride + column] = self.cells[at * self.stride + to];
            }
        }
        self.rows = kept
            .iter()
            .map(|&at| {
                let row = self.rows[at];
                let nearest = if row.nearest == NONE { NONE } else { moved[row.nearest as usize] };
                Row { nearest, ..row }
            })
            .collect();
        for at in work {
            *at = moved[*at as usize];
        }
    }
}
