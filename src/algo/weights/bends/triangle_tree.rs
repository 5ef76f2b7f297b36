//! Triangles in trees of their first corners: those near a place are found without a look at all others.

use std::collections::BTreeMap;

use glam::Vec3;

use crate::algo::point_tree::PointTree;

/// Slack of distances that are compared with sums of others, as a share of all numbers that take part.
const SLACK: f32 = 1e-5;

/// Triangles by their size, so that a large one does not widen the search among the small.
pub(super) struct TriangleTree(Vec<Level>);

/// Triangles of about one size.
struct Level {
    /// Largest distance of a corner from the first one.
    longest: f32,
    /// First corners.
    tree: PointTree,
    /// Number of the triangle of each first corner.
    numbers: Vec<usize>,
}

impl TriangleTree {
    /// Trees of triangles over points. O(n log n).
    pub fn new(points: &[Vec3], triangles: &[[u32; 3]]) -> Self {
        let mut by_size: BTreeMap<u32, (f32, Vec<usize>)> = BTreeMap::new();
        for (number, corners) in triangles.iter().enumerate() {
            let [a, b, c] = corners.map(|corner| points[corner as usize]);
            let size = a.distance(b).max(a.distance(c));
            // The exponent of the number.
            let (longest, numbers) = by_size.entry(size.to_bits() >> 23).or_default();
            *longest = longest.max(size);
            numbers.push(number);
        }
        let level = |(longest, numbers): (f32, Vec<usize>)| {
            let firsts = numbers.iter().map(|number| points[triangles[*number][0] as usize]);
            Level { longest, tree: PointTree::new(firsts), numbers }
        };
        Self(by_size.into_values().map(level).collect())
    }

    /// Numbers, rising, of the triangles whose first corner lies at most that far from a place.
    pub fn beginning(&self, place: Vec3, reach: f32) -> Vec<usize> {
        self.found(place, |_| reach)
    }

    /// Numbers, rising, of the triangles that may come as near as that to a place: all that do, and some others.
    pub fn near(&self, place: Vec3, reach: f32) -> Vec<usize> {
        self.found(place, |longest| {
            let radius = reach + longest;
            radius + SLACK * (radius + place.abs().max_element())
        })
    }

    fn found(&self, place: Vec3, radius: impl Fn(f32) -> f32) -> Vec<usize> {
        let mut found: Vec<usize> = Vec::new();
        for Level { longest, tree, numbers } in &self.0 {
            found.extend(tree.within(place, radius(*longest)).into_iter().map(|at| numbers[at]));
        }
        found.sort_unstable();
        found
    }
}
