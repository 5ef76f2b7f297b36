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
    /// Least and greatest corner of all points.
    bounds: [Vec3; 2],
    /// True if levels divide along x and y alone.
    is_flat: bool,
    /// Number of points that were looked at.
    visits: Cell<u64>,
}

impl PointTree {
    /// A tree of points, numbered from zero; those that are not finite are never found. O(n log n).
    pub fn new(points: impl IntoIterator<Item = Vec3>) -> Self {
        Self::divided(points, false)
    }

    /// A tree of points with one z, numbered from zero; those that are not finite are never found. O(n log n).
    pub fn flat(points: impl IntoIterator<Item = Vec3>) -> Self {
        Self::divided(points, true)
    }

    fn divided(points: impl IntoIterator<Item = Vec3>, is_flat: bool) -> Self {
        let mut points: Vec<(Vec3, usize)> =
            points.into_iter().zip(0..).filter(|(point, _)| point.is_finite()).collect();
        let mut open = vec![(0, points.len(), 0)];
        while let Some((from, end, axis)) = open.pop() {
            if end - from <= LEAF {
                continue;
            }
            let half = (end - from) / 2;
            points[from..end].select_nth_unstable_by(half, |a, b| a.0[axis].total_cmp(&b.0[axis]).then(a.1.cmp(&b.1)));
            let next = following(axis, is_flat);
            open.extend([(from, from + half, next), (from + half + 1, end, next)]);
        }
        let all = points.iter().map(|(point, _)| *point);
        let bounds = [Vec3::min, Vec3::max].map(|side| all.clone().reduce(side).unwrap_or_default());
        Self { points, bounds, is_flat, visits: Cell::new(0) }
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
        // Ranges with the least distance that their points can have along each axis.
        let mut open = vec![(0, self.points.len(), 0, self.beside(place))];
        while let Some((from, end, axis, least)) = open.pop() {
            if least.length() >= furthest(&best) {
                continue;
            }
            if end - from <= LEAF {
                self.points[from..end].iter().for_each(|point| take(&mut best, *point));
                continue;
            }
            let middle = from + (end - from) / 2;
            let across: f32 = place[axis] - self.points[middle].0[axis];
            take(&mut best, self.points[middle]);
            let (below, above, next) = ((from, middle), (middle + 1, end), following(axis, self.is_flat));
            let (near, far) = if across < 0.0 { (below, above) } else { (above, below) };
            open.push((far.0, far.1, next, beyond(least, axis, across)));
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
        let mut open = vec![(0, self.points.len(), 0, self.beside(place))];
        while let Some((from, end, axis, least)) = open.pop() {
            if least.length() > radius {
                continue;
            }
            if end - from <= LEAF {
                self.points[from..end].iter().for_each(|point| take(*point));
                continue;
            }
            let middle = from + (end - from) / 2;
            let across: f32 = place[axis] - self.points[middle].0[axis];
            take(self.points[middle]);
            let (below, above, next) = ((from, middle), (middle + 1, end), following(axis, self.is_flat));
            let (near, far) = if across < 0.0 { (below, above) } else { (above, below) };
            open.push((far.0, far.1, next, beyond(least, axis, across)));
            open.push((near.0, near.1, next, least));
        }
        found
    }

    /// Least distances of all points from a place along the axes.
    fn beside(&self, place: Vec3) -> Vec3 {
        let [low, high] = self.bounds;
        (low - place).max(place - high).max(Vec3::ZERO)
    }

    /// Number of points that were looked at so far; for tests of growth.
    pub fn visits(&self) -> u64 {
        self.visits.get()
    }
}

/// Axis along which the level below one divides.
fn following(axis: usize, is_flat: bool) -> usize {
    (axis + 1) % if is_flat { 2 } else { 3 }
}

/// Least distances along the axes of what lies beyond a point that is `across` away along one of them.
fn beyond(least: Vec3, axis: usize, across: f32) -> Vec3 {
    let mut beyond = least;
    beyond[axis] = beyond[axis].max(across.abs());
    beyond
}
