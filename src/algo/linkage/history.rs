//! Merge history: merges as they are found, then sorted by height.

use rayon::prelude::*;

use super::{Dendrogram, Merge};

/// Merges in the order in which they were found. Node numbers count points first, then merges in this order.
pub(super) struct History {
    points: usize,
    joins: Vec<Join>,
}

#[derive(Clone, Copy)]
struct Join {
    first: u32,
    second: u32,
    size: u32,
    height: f32,
}

impl History {
    pub(super) fn new(points: usize) -> Self {
        Self { points, joins: Vec::with_capacity(points.saturating_sub(1)) }
    }

    /// Notes a merge and returns the node it makes.
    ///
    /// The height is at least that of both parts, whatever the rounding.
    pub(super) fn join(&mut self, first: u32, second: u32, height: f64, size: u32) -> u32 {
        let height = (height as f32).min(f32::MAX).max(self.height(first)).max(self.height(second));
        self.joins.push(Join { first, second, size, height });
        (self.points + self.joins.len() - 1) as u32
    }

    /// Number of merges.
    pub(super) fn len(&self) -> usize {
        self.joins.len()
    }

    fn height(&self, node: u32) -> f32 {
        match (node as usize).checked_sub(self.points) {
            Some(join) => self.joins[join].height,
            None => 0.0,
        }
    }

    /// The merges sorted by height and renumbered.
    ///
    /// Heights are multiplied by `unit`. Parts were found before their wholes and are never higher, so a stable sort
    /// keeps them before.
    pub(super) fn finish(self, unit: f64) -> Dendrogram {
        let points = self.points;
        // Heights are not negative, so the order of their bits is that of the numbers.
        let mut order: Vec<u64> = self
            .joins
            .iter()
            .enumerate()
            .map(|(at, join)| u64::from(join.height.to_bits()) << 32 | at as u64)
            .collect();
        order.par_sort_unstable();
        let mut rank = vec![0_u32; order.len()];
        for (at, &key) in order.iter().enumerate() {
            rank[key as u32 as usize] = at as u32;
        }
        let number = |node: u32| match (node as usize).checked_sub(points) {
            Some(join) => points as u32 + rank[join],
            None => node,
        };
        let merges = order
            .iter()
            .map(|&key| {
                let join = self.joins[key as u32 as usize];
                let (first, second) = (number(join.first), number(join.second));
                Merge {
                    first: first.min(second),
                    second: first.max(second),
                    height: (f64::from(join.height) * unit).min(f64::from(f32::MAX)) as f32,
                    size: join.size,
                }
            })
            .collect();
        Dendrogram { points, merges }
    }
}
