//! Interpretation of strokes over a rig: a chain, a joint inserted into a bone, or joints to delete.
//!
//! Strokes are judged on the view plane, on which the user draws. A stroke is a chain unless it is clearly something
//! else:
//!
//! - **Erase**: a scribble. It swings to and fro at least four times, each time over most of its width, is no thin line
//!   (its width is at least three tenths of its length; or it runs to and fro along its length), and there is a joint
//!   under it. To draw a chain over joints, draw it in one direction.
//! - **Insert**: a short straight tick across one bone. It crosses exactly one bone, steeply (45° or more) and away
//!   from its joints, is no longer than that bone, and begins and ends beside the rig. To draw a chain across a bone,
//!   draw it longer than the bone, or begin it on a joint.
//!
//! An app without the other two takes every stroke for a chain: [`StrokeKind::Chain`] with [`joint_at`] for its ends.

use glam::Vec2;

/// Interpretation of a stroke.
#[derive(Debug, Clone, PartialEq)]
pub enum StrokeKind {
    /// A chain of joints.
    Chain {
        /// The joint that the stroke starts on: the chain continues from it.
        start: Option<usize>,
        /// The joint that the stroke ends on, if it differs from the start.
        end: Option<usize>,
    },
    /// A joint to be inserted into a bone.
    Insert {
        /// The bone's lower joint; the bone runs from its parent to it.
        bone: usize,
        /// Place along the bone on the view plane, 0 at the parent and 1 at the joint.
        t: f32,
    },
    /// Joints to be deleted.
    Erase {
        /// The joints under the scribble, by rising index; not empty.
        joints: Vec<usize>,
    },
}

/// Classifies `stroke`.
///
/// `joints` are places on the view plane, each with its parent's index (an index out of range counts as none; a place
/// that is not finite is never hit). `tolerance` is the distance up to which a point is on a joint, in model units.
/// O(points · (log points + bones)).
pub fn classify(stroke: &[Vec2], joints: &[(Vec2, Option<usize>)], tolerance: f32) -> StrokeKind {
    let tolerance = if tolerance > 0.0 { tolerance } else { 0.0 };
    let points: Vec<Vec2> = stroke.iter().copied().filter(|p| p.is_finite()).collect();
    let (Some(&first), Some(&last)) = (points.first(), points.last()) else {
        return StrokeKind::Chain { start: None, end: None };
    };
    if is_scribble(&points, tolerance) {
        let hull = hull(&points);
        let under: Vec<usize> = (0..joints.len()).filter(|&i| contains(&hull, joints[i].0)).collect();
        if !under.is_empty() {
            return StrokeKind::Erase { joints: under };
        }
    }
    let start = joint_at(first, joints, tolerance);
    let end = joint_at(last, joints, tolerance).filter(|&joint| Some(joint) != start);
    if start.is_none()
        && end.is_none()
        && let Some((bone, t)) = tick(&points, joints, tolerance)
    {
        return StrokeKind::Insert { bone, t };
    }
    StrokeKind::Chain { start, end }
}

/// The joint nearest to `point` on the view plane within `tolerance`; of two equally near, the one with the lower
/// index.
pub fn joint_at(point: Vec2, joints: &[(Vec2, Option<usize>)], tolerance: f32) -> Option<usize> {
    let mut best = None;
    let mut nearest = tolerance;
    for (i, (place, _)) in joints.iter().enumerate() {
        let distance = place.distance(point);
        if distance < nearest || (distance == nearest && best.is_none()) {
            (best, nearest) = (Some(i), distance);
        }
    }
    best
}

/// Least number of turns of a scribble.
const TURNS: usize = 4;
/// Least width of a scribble, as a share of its length. The line of an unsteady hand stays below.
const WIDTH: f32 = 0.3;
/// Least length of a counted swing, as a share of the extent.
const SWING: f32 = 0.4;

/// True for a stroke that erases the joints under it, if there are any. The points are finite.
pub fn is_scribble(points: &[Vec2], tolerance: f32) -> bool {
    let [long, wide] = main_axes(points);
    let extent = |axis: Vec2| {
        let (low, high) = points
            .iter()
            .map(|p| p.dot(axis))
            .fold((f32::INFINITY, f32::NEG_INFINITY), |(l, h), x| (l.min(x), h.max(x)));
        high - low
    };
    let (length, width) = (extent(long), extent(wide));
    let swings = |axis: Vec2, extent: f32| extent > tolerance && turns(points, axis, SWING * extent) >= TURNS;
    swings(long, length) || (width >= WIDTH * length && swings(wide, width))
}

/// Number of turns of the coordinate along `axis` by at least `swing`.
fn turns(points: &[Vec2], axis: Vec2, swing: f32) -> usize {
    let mut count = 0;
    let (mut low, mut high) = (f32::INFINITY, f32::NEG_INFINITY);
    // Direction of the last swing: its sign, or 0 before the first.
    let mut direction = 0;
    for point in points {
        let x = point.dot(axis);
        (low, high) = (low.min(x), high.max(x));
        let turn = if direction != 1 && x - low >= swing {
            1
        } else if direction != -1 && high - x >= swing {
            -1
        } else {
            continue;
        };
        count += usize::from(direction != 0);
        direction = turn;
        (low, high) = (x, x);
    }
    count
}

/// The directions of greatest and least extent (principal axes of the points).
fn main_axes(points: &[Vec2]) -> [Vec2; 2] {
    let mean = points.iter().map(|p| p.as_dvec2()).sum::<glam::DVec2>() / points.len() as f64;
    let (mut xx, mut xy, mut yy) = (0.0, 0.0, 0.0);
    for p in points {
        let d = p.as_dvec2() - mean;
        (xx, xy, yy) = (xx + d.x * d.x, xy + d.x * d.y, yy + d.y * d.y);
    }
    let half = 0.5 * (xx - yy);
    let root = (half * half + xy * xy).sqrt();
    // The form of the eigenvector without cancellation is used.
    let long = if half >= 0.0 { glam::DVec2::new(half + root, xy) } else { glam::DVec2::new(xy, root - half) };
    let long = long.try_normalize().unwrap_or(glam::DVec2::X).as_vec2();
    [long, long.perp()]
}

/// The convex hull, counter-clockwise.
fn hull(points: &[Vec2]) -> Vec<Vec2> {
    let mut sorted = points.to_vec();
    sorted.sort_by(|a, b| a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y)));
    sorted.dedup();
    let half = |points: &mut dyn Iterator<Item = Vec2>| {
        let mut chain: Vec<Vec2> = Vec::new();
        for p in points {
            while let [.., a, b] = chain[..] {
                if (b - a).perp_dot(p - a) > 0.0 {
                    break;
                }
                chain.pop();
            }
            chain.push(p);
        }
        chain.pop();
        chain
    };
    let mut hull = half(&mut sorted.iter().copied());
    hull.extend(half(&mut sorted.iter().rev().copied()));
    hull
}

fn contains(hull: &[Vec2], point: Vec2) -> bool {
    hull.len() > 2
        && point.is_finite()
        && (0..hull.len()).all(|i| {
            let (a, b) = (hull[i], hull[(i + 1) % hull.len()]);
            (b - a).perp_dot(point - a) >= 0.0
        })
}

/// True for a stroke that inserts a joint if it crosses one bone that is no shorter than it.
pub fn is_straight(points: &[Vec2]) -> bool {
    let (Some(&first), Some(&last)) = (points.first(), points.last()) else { return false };
    let chord = last - first;
    let length = chord.length();
    let straight = points.iter().all(|&p| {
        let along = (p - first).dot(chord) / length;
        (p - first).perp_dot(chord).abs() <= 0.15 * length * length && along > -0.15 * length && along < 1.15 * length
    });
    length > 0.0 && straight
}

/// A short straight stroke across one bone: the bone and the place of the crossing.
fn tick(points: &[Vec2], joints: &[(Vec2, Option<usize>)], tolerance: f32) -> Option<(usize, f32)> {
    if !is_straight(points) {
        return None;
    }
    let (first, last) = (*points.first()?, *points.last()?);
    let chord = last - first;
    let length = chord.length();
    let mut found = None;
    for (bone, &(foot, parent)) in joints.iter().enumerate() {
        let Some(&(head, _)) = parent.and_then(|parent| joints.get(parent)) else { continue };
        let Some((t, _)) = crossing(head, foot, first, last) else { continue };
        if found.replace((bone, head, foot, t)).is_some() {
            return None;
        }
    }
    let (bone, head, foot, t) = found?;
    let along = foot - head;
    let bone_length = along.length();
    let at = head + along * t;
    let away = tolerance.max(0.1 * bone_length);
    let clear = |p: Vec2| p.distance(head) > tolerance && p.distance(foot) > tolerance;
    let steep = along.perp_dot(chord).abs() >= core::f32::consts::FRAC_1_SQRT_2 * bone_length * length;
    let off_the_rig = beside(first, head, along) && beside(last, head, along);
    (length <= bone_length
        && at.distance(head) > away
        && at.distance(foot) > away
        && steep
        && clear(first)
        && clear(last)
        && off_the_rig)
        .then_some((bone, t))
}

/// Returns `true` unless the point lies on the line itself.
fn beside(point: Vec2, head: Vec2, along: Vec2) -> bool {
    (point - head).perp_dot(along) != 0.0
}

/// Crossing of the segments `a`-`b` and `c`-`d`, as parameters of both.
fn crossing(a: Vec2, b: Vec2, c: Vec2, d: Vec2) -> Option<(f32, f32)> {
    let (ab, cd, ac) = (b - a, d - c, c - a);
    let det = ab.perp_dot(cd);
    let (t, s) = (ac.perp_dot(cd) / det, ac.perp_dot(ab) / det);
    (det != 0.0 && (0.0..=1.0).contains(&t) && (0.0..=1.0).contains(&s)).then_some((t, s))
}
