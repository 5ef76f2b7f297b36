//! Places of a given number of joints: the polyline with this many corners that fits the limb's centre line best.
//!
//! The centre line is fitted instead of the stroke, because it has depth, where the bend of an elbow may lie, and is
//! steadier than a hand. Where the line is straight, it does not determine the joints; a weak preference for pieces of
//! even length does.

use glam::{Vec2, Vec3};

use super::{axis::Axis, path::Path, split, track::Track};

/// Weight of the preference for even pieces: the cost of pieces twice too long or of length zero, in squared deviations
/// of one radius of the limb.
const EVENNESS: f32 = 1.0;
/// Distance in radii of the limb within which two bends are one, and a drawn joint goes to the bend of the limb.
const NEAR: f32 = 1.5;
/// Weight of the distance from the place that was drawn, in mean squared deviations of one radius.
const HOLD: f32 = 0.02;
/// Least angle of a bend of the centre line that becomes a joint.
const SHARP: f32 = 40.0 * core::f32::consts::PI / 180.0;
/// Least angle by which mild corners of a stroke turn together to be a curve and not an unsteady hand.
const CURVED: f32 = 60.0 * core::f32::consts::PI / 180.0;
/// Rounds in which joints go to bends.
const ROUNDS: usize = 3;
/// Share of a limb's length above which a piece gets a joint to bend at.
const MOST: f32 = 0.6;

/// Arc lengths of exactly `count` joints, ends included, rising.
pub(super) fn choose(track: &Track, axis: Option<&Axis>, count: usize) -> Vec<f32> {
    let [first, last] = track.covered();
    let even = || (0..count).map(|i| first + (last - first) * (i as f32 / (count - 1) as f32)).collect();
    let Some(axis) = axis else { return even() };
    let points: Vec<Vec3> = axis.stations.iter().map(|s| s.centre).collect();
    if count == 2 || count > points.len() / 2 {
        return even();
    }
    let chosen = fit(&points, axis.radius, count);
    chosen.into_iter().map(|i| axis.stations[i].at).collect()
}

/// Arc lengths of the joints of an automatic chain, ends included, rising.
///
/// Firm corners of the stroke become joints. Bends of the centre line that are further than `threshold` from the line
/// between their neighbours become joints, too: seen from the front an ankle bends in depth. Each of these goes to the
/// bend of the centre line near it. A piece that is most of the chain gets a joint to bend at, where it fits best.
pub(super) fn automatic(path: &Path, track: &Track, axis: Option<&Axis>, threshold: f32) -> Vec<f32> {
    let drawn = split::by_threshold(path, threshold);
    let Some(axis) = axis.filter(|axis| axis.stations.len() > 2) else {
        return if drawn.len() < 3 { choose(track, axis, 3) } else { drawn };
    };
    let line = Line::new(axis);
    let [first, last] = track.covered();
    let inner = firm(path, &drawn).into_iter().filter(|at| *at > first && *at < last);
    let mut joints: Vec<usize> = inner.map(|at| line.nearest(axis, at)).collect();
    joints.extend([0, line.last()]);
    joints.sort_unstable();
    joints.dedup();
    for bend in line.bends(threshold) {
        // An ankle is thinner than most of the leg, and the foot shorter than its thigh is wide.
        let near = NEAR * axis.radius.min(axis.stations[bend].radius);
        if joints.iter().all(|&joint| line.length(joint, bend) > near) {
            joints.push(bend);
        }
    }
    joints.sort_unstable();
    line.settle(&mut joints, axis.radius);
    let piece = (1..joints.len()).max_by(|&a, &b| line.piece(&joints, a).total_cmp(&line.piece(&joints, b)));
    if let Some(piece) = piece.filter(|&piece| line.piece(&joints, piece) > MOST * line.length(0, line.last())) {
        let start = joints[piece - 1];
        let chosen = fit(&line.points[start..=joints[piece]], axis.radius, 3);
        joints.insert(piece, start + chosen[1]);
    }
    joints.into_iter().map(|joint| axis.stations[joint].at).collect()
}

/// The corners of a stroke that an unsteady hand does not make: sharp ones, and all between two sharp ones (or ends) that
/// turn far enough together, like those of a curved tail.
fn firm(path: &Path, corners: &[f32]) -> Vec<f32> {
    let places: Vec<Vec2> = corners.iter().map(|&at| path.at(at)).collect();
    let turn = |i: usize| (places[i] - places[i - 1]).angle_to(places[i + 1] - places[i]);
    let mut firm = Vec::new();
    let mut run = Vec::new();
    for i in 1..corners.len() {
        let is_end = i + 1 == corners.len();
        if !is_end && turn(i).abs() < SHARP {
            run.push(i);
            continue;
        }
        if run.iter().map(|&i| turn(i)).sum::<f32>().abs() >= CURVED {
            firm.extend(run.iter().map(|&i| corners[i]));
        }
        run.clear();
        if !is_end {
            firm.push(corners[i]);
        }
    }
    firm
}

/// A centre line, measured along its length.
struct Line {
    points: Vec<Vec3>,
    along: Vec<f32>,
}

impl Line {
    fn new(axis: &Axis) -> Self {
        let points: Vec<Vec3> = axis.stations.iter().map(|station| station.centre).collect();
        let mut along = vec![0.0; points.len()];
        for i in 1..points.len() {
            along[i] = along[i - 1] + points[i].distance(points[i - 1]);
        }
        Self { points, along }
    }

    fn last(&self) -> usize {
        self.points.len() - 1
    }

    fn length(&self, a: usize, b: usize) -> f32 {
        (self.along[b] - self.along[a]).abs()
    }

    /// Length of the piece that ends at a joint.
    fn piece(&self, joints: &[usize], end: usize) -> f32 {
        self.length(joints[end - 1], joints[end])
    }

    /// The inner station nearest to an arc length of the stroke.
    fn nearest(&self, axis: &Axis, at: f32) -> usize {
        let next = axis.stations.partition_point(|station| station.at < at).clamp(1, self.last());
        let before_is_nearer = at - axis.stations[next - 1].at < axis.stations[next].at - at;
        (next - usize::from(before_is_nearer)).clamp(1, self.last() - 1)
    }

    /// Points that are further than `threshold` from the segment between two neighbours, recursively.
    fn bends(&self, threshold: f32) -> Vec<usize> {
        let mut bends = Vec::new();
        let mut pieces = vec![(0, self.last())];
        while let Some((from, to)) = pieces.pop() {
            let distance = |i: &usize| from_segment(self.points[*i], self.points[from], self.points[to]);
            let furthest = (from + 1..to).max_by(|a, b| distance(a).total_cmp(&distance(b)));
            if let Some(bend) = furthest.filter(|bend| distance(bend) > threshold) {
                bends.push(bend);
                pieces.extend([(from, bend), (bend, to)]);
            }
        }
        // Flesh makes the line of a straight limb curve a little: only sharp bends are joints.
        bends.extend([0, self.last()]);
        bends.sort_unstable();
        let mut next = 1;
        while next + 1 < bends.len() {
            let [a, b, c] = [next - 1, next, next + 1].map(|i| self.points[bends[i]]);
            if (b - a).angle_between(c - b) < SHARP {
                bends.remove(next);
                next = next.saturating_sub(1).max(1);
            } else {
                next += 1;
            }
        }
        bends[1..bends.len() - 1].to_vec()
    }

    /// Moves each inner joint to the bend of the line near it.
    fn settle(&self, joints: &mut [usize], radius: f32) {
        for _ in 0..ROUNDS {
            for i in 1..joints.len() - 1 {
                let (before, drawn, after) = (joints[i - 1], joints[i], joints[i + 1]);
                let reach = (NEAR * radius).min(0.4 * self.length(before, drawn)).min(0.4 * self.length(drawn, after));
                let cost = |at: usize| {
                    let away = self.length(at, drawn) / (NEAR * radius);
                    (self.deviation(before, at) + self.deviation(at, after)) / (radius * radius) + HOLD * away * away
                };
                let near = (before + 1..after).filter(|&at| self.length(at, drawn) <= reach);
                joints[i] = near.min_by(|&a, &b| cost(a).total_cmp(&cost(b))).unwrap_or(drawn);
            }
        }
    }

    /// Mean squared distance of the points between two joints from the segment between these.
    fn deviation(&self, from: usize, to: usize) -> f32 {
        let segment = (self.points[from], self.points[to]);
        let squared = |i: usize| from_segment(self.points[i], segment.0, segment.1).powi(2);
        (from + 1..to).map(squared).sum::<f32>() / self.points.len() as f32
    }
}

fn from_segment(point: Vec3, a: Vec3, b: Vec3) -> f32 {
    let along = b - a;
    let t = ((point - a).dot(along) / along.length_squared().max(f32::MIN_POSITIVE)).clamp(0.0, 1.0);
    point.distance(a + along * t)
}

/// Indices of `count` points, the first and last among them, whose polyline has the least mean squared distance from
/// all points, in squared radii, plus the cost of uneven pieces. O(points³ + count · points²).
fn fit(points: &[Vec3], radius: f32, count: usize) -> Vec<usize> {
    let n = points.len();
    let mut along = vec![0.0; n];
    for i in 1..n {
        along[i] = along[i - 1] + points[i].distance(points[i - 1]);
    }
    let total = along[n - 1].max(f32::MIN_POSITIVE);
    let weight: Vec<f32> =
        (0..n).map(|i| 0.5 * (along[(i + 1).min(n - 1)] - along[i.saturating_sub(1)]) / total).collect();
    let pieces = (count - 1) as f32;
    let price = |i: usize, j: usize| {
        let (a, b) = (points[i], points[j]);
        let chord = b - a;
        let squared = chord.length_squared().max(f32::MIN_POSITIVE);
        let deviation: f32 = (i + 1..j)
            .map(|k| {
                let t = ((points[k] - a).dot(chord) / squared).clamp(0.0, 1.0);
                weight[k] * points[k].distance_squared(a + chord * t)
            })
            .sum();
        let uneven = (along[j] - along[i]) / total * pieces - 1.0;
        deviation / (radius * radius) + EVENNESS * uneven * uneven / pieces
    };
    let mut prices = vec![0.0; n * n];
    for i in 0..n {
        for j in i + 1..n {
            prices[i * n + j] = price(i, j);
        }
    }
    // best[k][j]: the least cost of k pieces from the first point to point j.
    let mut best = vec![f32::INFINITY; count * n];
    let mut from = vec![0; count * n];
    best[0] = 0.0;
    for k in 1..count {
        for j in k..n {
            for i in k - 1..j {
                let sum = best[(k - 1) * n + i] + prices[i * n + j];
                if sum < best[k * n + j] {
                    best[k * n + j] = sum;
                    from[k * n + j] = i;
                }
            }
        }
    }
    let mut chosen = vec![n - 1; count];
    for k in (1..count).rev() {
        chosen[k - 1] = from[k * n + chosen[k]];
    }
    chosen
}
