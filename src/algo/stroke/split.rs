//! Subdivision of a stroke at its bends, after Pencil Rigger, section 5.3.

use std::collections::VecDeque;

use glam::Vec2;

use super::{MAX_JOINTS, path::Path};

/// Arc lengths of the joints, ends included, rising.
///
/// While a point of the stroke is further than `threshold` from the segment between two neighbouring joints, the furthest
/// point on each side of that segment that is too far becomes a joint, until there are [`MAX_JOINTS`].
/// O(points · depth of the recursion); no deeper than there are joints.
pub(super) fn by_threshold(path: &Path, threshold: f32) -> Vec<f32> {
    let threshold = threshold.max(0.0);
    let last = path.points.len() - 1;
    let mut joint = vec![false; path.points.len()];
    joint[0] = true;
    joint[last] = true;
    let mut count = 2;
    // No recursion: a spiral of a million points must not exhaust the thread's stack. Pieces come in the order of their making,
    // so that a stroke of more bends than joints has the large ones.
    let mut pieces = VecDeque::from([(0, last)]);
    'pieces: while let Some((from, to)) = pieces.pop_front() {
        let mut cuts = [None; 2];
        let mut furthest = [threshold; 2];
        let (a, b) = (path.points[from], path.points[to]);
        for i in from + 1..to {
            let (distance, side) = from_segment(path.points[i], a, b);
            if distance > furthest[side] {
                furthest[side] = distance;
                cuts[side] = Some(i);
            }
        }
        let mut start = from;
        let mut inner: Vec<usize> = cuts.into_iter().flatten().collect();
        inner.sort_unstable();
        if inner.is_empty() {
            continue;
        }
        for cut in inner {
            if count >= MAX_JOINTS {
                break 'pieces;
            }
            joint[cut] = true;
            count += 1;
            pieces.push_back((start, cut));
            start = cut;
        }
        pieces.push_back((start, to));
    }
    joint.iter().zip(&path.lengths).filter_map(|(&is_joint, &length)| is_joint.then_some(length)).collect()
}

/// Distance of a point from a segment, and the side of its line (points beyond an end in line with it: 0).
fn from_segment(point: Vec2, a: Vec2, b: Vec2) -> (f32, usize) {
    let along = b - a;
    let t = ((point - a).dot(along) / along.length_squared().max(f32::MIN_POSITIVE)).clamp(0.0, 1.0);
    let side = usize::from(along.perp_dot(point - a) < 0.0);
    (point.distance(a + along * t), side)
}
