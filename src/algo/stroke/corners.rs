//! Places of a given number of joints: the polyline with this many corners that fits the limb's centre line best.
//!
//! The centre line is fitted instead of the stroke, because it has depth, where the bend of an elbow may lie, and is
//! steadier than a hand. Where the line is straight, it does not determine the joints; a weak preference for pieces of
//! even length does.

use glam::Vec3;

use super::{axis::Axis, track::Track};

/// Weight of the preference for even pieces: the cost of pieces twice too long or of length zero, in squared deviations
/// of one radius of the limb.
const EVENNESS: f32 = 1.0;

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
