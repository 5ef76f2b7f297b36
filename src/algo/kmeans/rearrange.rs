//! Jumps of centroids: a remedy for seeds that are too close in one place and too far apart in another.

use super::{
    seeds::square_distance,
    space::{Place, Space},
};

/// Least ratio of the expected gain to the cost of a jump during the rounds.
pub(super) const CLEARLY: f64 = 2.5;

/// Moments of a group's points.
#[derive(Clone, Copy, Default)]
struct Spread {
    count: f64,
    sum: [f64; 3],
    /// Sums of xx, yy, zz, xy, xz, yz.
    squares: [f64; 6],
}

/// Returns `true` if there are enough groups that could jump, and enough points in each to judge.
pub(super) fn worth(free: usize, points: usize) -> bool {
    free >= 4 && points / free >= 8
}

/// Moves the centroids of groups whose points have the nearest other group almost as near to groups with the largest
/// gain from a split, at most `most` of them, each if its expected gain is `worth` times its cost. Fixed centroids
/// stay.
pub(super) fn rearrange(space: &Space, labels: &[u32], centroids: &mut [Place], worth: f64, most: usize) {
    let mut jumps = 0;
    let fixed = space.fixed.len();
    let mut spreads = vec![Spread::default(); centroids.len()];
    for (point, &label) in space.points.iter().zip(labels) {
        spreads[label as usize].add(*point);
    }
    // At the optimum all groups have the same square error: one group more or less then gains or costs about as much as
    // one group's error, once the neighbours have adjusted.
    let mut losses: Vec<(f64, usize, usize)> = (fixed..centroids.len())
        .filter_map(|group| {
            let other = (0..centroids.len()).filter(|&other| other != group).min_by(|&a, &b| {
                let square = |other: usize| square_distance(centroids[group], centroids[other]);
                square(a).total_cmp(&square(b))
            })?;
            Some((spreads[group].error(), group, other))
        })
        .collect();
    losses.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    // The halves are placed as if the points were spread evenly along the longest axis.
    let mut gains: Vec<(f64, usize, Place)> = (fixed..centroids.len())
        .map(|group| {
            let (axis, variance) = spreads[group].longest();
            let shift = (0.75 * variance).sqrt();
            (spreads[group].error(), group, axis.map(|value| (value * shift) as f32))
        })
        .collect();
    gains.sort_unstable_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
    let mut touched = vec![false; centroids.len()];
    let mut gains = gains.into_iter();
    for (loss, group, other) in losses {
        if touched[group] || touched[other] {
            continue;
        }
        let Some((gain, halved, shift)) = gains.find(|&(_, halved, _)| !touched[halved] && halved != group) else {
            break;
        };
        if gain <= loss * worth || jumps == most {
            break;
        }
        if halved == other {
            continue;
        }
        let middle = centroids[halved];
        centroids[halved] = [0, 1, 2].map(|axis| middle[axis] - shift[axis]);
        centroids[group] = [0, 1, 2].map(|axis| middle[axis] + shift[axis]);
        jumps += 1;
        for group in [group, other, halved] {
            touched[group] = true;
        }
    }
}

impl Spread {
    /// The sum of squared distances from the mean.
    fn error(&self) -> f64 {
        let [x, y, z] = self.sum;
        self.squares[0] + self.squares[1] + self.squares[2] - (x * x + y * y + z * z) / self.count.max(1.0)
    }

    fn add(&mut self, place: Place) {
        let [x, y, z] = place.map(f64::from);
        self.count += 1.0;
        for (sum, value) in self.sum.iter_mut().zip([x, y, z]) {
            *sum += value;
        }
        for (sum, value) in self.squares.iter_mut().zip([x * x, y * y, z * z, x * y, x * z, y * z]) {
            *sum += value;
        }
    }

    /// The axis along which the points vary most, and their variance along it.
    fn longest(&self) -> ([f64; 3], f64) {
        let share = 1.0 / self.count.max(1.0);
        let [x, y, z] = self.sum.map(|sum| sum * share);
        let own = self.squares.map(|sum| sum * share);
        let c = [own[0] - x * x, own[1] - y * y, own[2] - z * z, own[3] - x * y, own[4] - x * z, own[5] - y * z];
        let rows = [[c[0], c[3], c[4]], [c[3], c[1], c[5]], [c[4], c[5], c[2]]];
        // The power method from the longest row; a few steps are accurate enough.
        let length = |v: [f64; 3]| (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]).sqrt();
        let mut axis = rows.into_iter().max_by(|a, b| length(*a).total_cmp(&length(*b))).unwrap_or_default();
        let mut variance = 0.0;
        for _ in 0..8 {
            let size = length(axis);
            if size <= 0.0 {
                return ([1.0, 0.0, 0.0], 0.0);
            }
            axis = axis.map(|value| value / size);
            let next = rows.map(|row| row[0] * axis[0] + row[1] * axis[1] + row[2] * axis[2]);
            variance = length(next);
            axis = next;
        }
        let size = length(axis);
        if size <= 0.0 { ([1.0, 0.0, 0.0], 0.0) } else { (axis.map(|value| value / size), variance) }
    }
}
