//! Points in a tree, in which the nearest ones to a place are found without a look at all of them.

use std::cell::Cell;

use glam::Vec3;

/// Most points of a leaf.
const LEAF: usize = 8;

/// Points in a balanced tree whose levels divide along x, y and z in turn.
#[derive(Debug, Clone, Default)]
pub struct PointTree {
    /// Points with their numbers; the middle of each range divides it.
    points: Vec<(Vec3, usize)>,
    /// Number of points that were looked at.
    visits: Cell<u64>,
}

impl PointTree {
    /// A tree of points, numbered from zero; those that are not finite are never found. O(n log n).
    pub fn new(points: impl IntoIterator<Item = Vec3>) -> Self {
        let mut points: Vec<(Vec3, usize)> =
            points.into_iter().zip(0..).filter(|(point, _)| point.is_finite()).collect();
        let mut open = vec![(0, points.len(), 0)];
        while let Some((from, end, axis)) = open.pop() {
            if end - from <= LEAF {
                continue;
            }
            let half = (end - from) / 2;
            points[from..end].select_nth_unstable_by(half, |a, b| a.0[axis].total_cmp(&b.0[axis]).then(a.1.cmp(&b.1)));
            let next = (axis + 1) % 3;
            open.extend([(from, from + half, next), (from + half + 1, end, next)]);
        }
        Self { points, visits: Cell::new(0) }
    }

    /// The two points nearest to a place, the nearest first, each with its distance. Which of equally distant points is found
    /// is open.
    pub fn nearest_two(&self, place: Vec3) -> [Option<(f32, usize)>; 2] {
        let mut best: [Option<(f32, usize)>; 2] = [None; 2];
        let furthest = |best: &[Option<(f32, usize)>; 2]| best[1].map_or(f32::INFINITY, |(distance, _)| distance);
        let take = |best: &mut [Option<(f32, usize)>; 2], (point, number): (Vec3, usize)| {
            let found = (point.distance(place), number);
            self.visits.set(self.visits.get() + 1);
            match best[0] {
                Some((least, _)) if found.0 >= least => {
                    if found.0 < furthest(best) {
                        best[1] = Some(found);
                    }
                }
                _ => *best = [Some(found), best[0]],
            }
        };
        // Ranges with the least distance that their points can have.
        let mut open = vec![(0, self.points.len(), 0, 0.0)];
        while let Some((from, end, axis, least)) = open.pop() {
            if least >= furthest(&best) {
                continue;
            }
            if end - from <= LEAF {
                self.points[from..end].iter().for_each(|point| take(&mut best, *point));
                continue;
            }
            let middle = from + (end - from) / 2;
            let across: f32 = place[axis] - self.points[middle].0[axis];
            take(&mut best, self.points[middle]);
            let (below, above, next) = ((from, middle), (middle + 1, end), (axis + 1) % 3);
            let (near, far) = if across < 0.0 { (below, above) } else { (above, below) };
            open.push((far.0, far.1, next, across.abs().max(least)));
            open.push((near.0, near.1, next, least));
        }
        best
    }

    /// Numbers of the points that lie at most that far from a place, in no order.
    pub fn within(&self, place: Vec3, radius: f32) -> Vec<usize> {
        let mut found = Vec::new();
        let mut take = |(point, number): (Vec3, usize)| {
            self.visits.set(self.visits.get() + 1);
            if point.distance(place) <= radius {
                found.push(number);
            }
        };
        let mut open = vec![(0, self.points.len(), 0)];
        while let Some((from, end, axis)) = open.pop() {
            if end - from <= LEAF {
                self.points[from..end].iter().for_each(|point| take(*point));
                continue;
            }
            let middle = from + (end - from) / 2;
            let across: f32 = place[axis] - self.points[middle].0[axis];
            take(self.points[middle]);
            let next = (axis + 1) % 3;
            if across <= radius {
                open.push((from, middle, next));
            }
            if -across <= radius {
                open.push((middle + 1, end, next));
            }
        }
        found
    }

    /// Number of points that were looked at so far; for tests of growth.
    pub fn visits(&self) -> u64 {
        self.visits.get()
    }
}
