//! Chains along a curve: spines, tails, tentacles.
//!
//! Curves are uniform cubics through four neighbouring control points (Catmull and Rom 1974; the uniform cubic
//! B-spline), measured by Gauss-Legendre quadrature into a table of fixed size. Frames are carried along by the
//! shortest rotation from bone to bone (parallel transport), so they never flip, and twist is added on top.

use bevy::math::{Quat, Vec3};
use wide::f32x4;

use crate::solve::rotate::{about, arc, between_frames, direction, perpendicular_or_any};

/// Shape of a curve near its control points. Both begin at the first and end at the last.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize, serde::Deserialize)]
pub enum SplineKind {
    /// Catmull-Rom: passes through all control points; its direction is continuous.
    #[default]
    Through,
    /// Uniform cubic B-spline: passes near inner control points; its curvature is continuous.
    Near,
}

/// A curve over any number of control points: none gives the origin, one that point, two a straight line.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Spline<'a> {
    /// Kind of the curve.
    pub kind: SplineKind,
    /// The control points.
    pub points: &'a [Vec3],
}

impl Spline<'_> {
    /// Weights of the four control points (for the value, or for the derivative by the segment's parameter) at `t` in a
    /// segment.
    #[inline]
    fn weights(&self, t: f32, derivative: bool) -> [f32; 4] {
        let (s, tt) = (1.0 - t, t * t);
        match (self.kind, derivative) {
            (SplineKind::Through, false) => {
                [-0.5 * t * s * s, 1.0 + tt * (1.5 * t - 2.5), 0.5 * t * (1.0 + t * (4.0 - 3.0 * t)), -0.5 * tt * s]
            }
            (SplineKind::Through, true) => {
                [0.5 * s * (3.0 * t - 1.0), t * (4.5 * t - 5.0), 0.5 + t * (4.0 - 4.5 * t), t * (1.5 * t - 1.0)]
            }
            (SplineKind::Near, false) => [
                s * s * s / 6.0,
                (4.0 + tt * (3.0 * t - 6.0)) / 6.0,
                (1.0 + 3.0 * t * (1.0 + t - tt)) / 6.0,
                tt * t / 6.0,
            ],
            (SplineKind::Near, true) => [-0.5 * s * s, t * (1.5 * t - 2.0), 0.5 + t * (1.0 - 1.5 * t), 0.5 * tt],
        }
    }

    /// The four control points of a segment. Beyond the ends the neighbour is mirrored: the curve ends on its last
    /// point, without curvature.
    #[inline]
    fn neighbours(&self, segment: usize) -> [Vec3; 4] {
        let (points, count) = (self.points, self.points.len());
        let before = if segment == 0 { 2.0 * points[0] - points[1] } else { points[segment - 1] };
        let after = if segment + 2 < count { points[segment + 2] } else { 2.0 * points[count - 1] - points[count - 2] };
        [before, points[segment], points[segment + 1], after]
    }

    /// The derivative in a segment as a polynomial of the segment's parameter, by rising powers.
    fn slopes(&self, segment: usize) -> [Vec3; 3] {
        let neighbours = self.neighbours(segment);
        let [start, middle, end] = [0.0, 0.5, 1.0].map(|t| weighted(&neighbours, &self.weights(t, true)));
        let scale = (self.points.len() - 1) as f32;
        [start * scale, (4.0 * middle - 3.0 * start - end) * scale, (2.0 * (start + end) - 4.0 * middle) * scale]
    }

    /// The weighted sum of control points at parameter `t`, 0 to 1 over the whole curve.
    #[inline]
    fn sum(&self, t: f32, derivative: bool) -> Vec3 {
        let count = self.points.len();
        if count < 2 {
            return if derivative { Vec3::ZERO } else { self.points.first().copied().unwrap_or(Vec3::ZERO) };
        }
        let segments = count - 1;
        let along = if t > 0.0 { t.min(1.0) * segments as f32 } else { 0.0 };
        let segment = (along as usize).min(segments - 1);
        let weights = self.weights(along - segment as f32, derivative);
        let sum = weighted(&self.neighbours(segment), &weights);
        if derivative { sum * segments as f32 } else { sum }
    }

    /// The point at parameter `t`, 0 to 1 over the whole curve (clamped).
    #[inline]
    pub fn point(&self, t: f32) -> Vec3 {
        self.sum(t, false)
    }

    /// The derivative by `t`; zero for a curve of fewer than two points.
    #[inline]
    pub fn derivative(&self, t: f32) -> Vec3 {
        self.sum(t, true)
    }

    /// The unit direction at `t`; where the derivative is zero, the direction from first to last point, else X.
    pub fn tangent(&self, t: f32) -> Vec3 {
        let ends = self.points.first().zip(self.points.last()).map_or(Vec3::ZERO, |(first, last)| *last - *first);
        direction(self.derivative(t)).or_else(|| direction(ends)).unwrap_or(Vec3::X)
    }
}

#[inline]
fn weighted(points: &[Vec3; 4], weights: &[f32; 4]) -> Vec3 {
    points[0] * weights[0] + points[1] * weights[1] + points[2] * weights[2] + points[3] * weights[3]
}

/// Entries of a table of lengths.
const STEPS: usize = 64;

/// The length of a curve up to each of 65 evenly spaced parameters. Each change of the control points costs a new
/// table: 192 lengths of derivatives.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ArcTable {
    lengths: [f32; STEPS + 1],
}

impl ArcTable {
    /// Measures a curve, by Gauss-Legendre quadrature with three points a step.
    pub fn new(spline: &Spline) -> Self {
        let mut lengths = [0.0; STEPS + 1];
        if spline.points.len() < 2 {
            return Self { lengths };
        }
        let width = 1.0 / STEPS as f32;
        let off = 0.5 * width * 0.774_596_7;
        let segments = spline.points.len() - 1;
        let segment_at = |t: f32| ((t * segments as f32) as usize).min(segments - 1);
        let (mut segment, mut slopes) = (0, spline.slopes(0));
        for first in (0..STEPS).step_by(4) {
            let middles = [0.5, 1.5, 2.5, 3.5].map(|step| (first as f32 + step) * width);
            let mut means = [0.0; 4];
            let at = segment_at(middles[0] - off);
            if at == segment_at(middles[3] + off) {
                if at != segment {
                    (segment, slopes) = (at, spline.slopes(at));
                }
                let middles = f32x4::from(middles);
                let [before, middle, after] = [middles - off, middles, middles + off].map(|t| {
                    let along = t * segments as f32 - at as f32;
                    let [x, y, z] = [0, 1, 2].map(|axis| {
                        let [constant, linear, square] = slopes.map(|slope| slope[axis]);
                        (along * square + linear) * along + constant
                    });
                    (x * x + y * y + z * z).sqrt()
                });
                means = ((before + after) * 5.0 + middle * 8.0).to_array();
            } else {
                // The step is split at the control point inside it.
                for (mean, middle) in means.iter_mut().zip(middles) {
                    let [before, middle, after] = [middle - off, middle, middle + off].map(|t| {
                        let at = segment_at(t);
                        if at != segment {
                            (segment, slopes) = (at, spline.slopes(at));
                        }
                        let along = t * segments as f32 - at as f32;
                        (slopes[0] + (slopes[1] + slopes[2] * along) * along).length()
                    });
                    *mean = 5.0 * (before + after) + 8.0 * middle;
                }
            }
            for (step, mean) in means.into_iter().enumerate() {
                let length = mean * (width / 18.0);
                lengths[first + step + 1] = lengths[first + step] + if length.is_finite() { length } else { 0.0 };
            }
        }
        Self { lengths }
    }

    /// The length of the whole curve.
    #[inline]
    pub fn length(&self) -> f32 {
        self.lengths[STEPS]
    }

    /// The parameter (0 to 1) at a length along the curve, clamped to it.
    #[inline]
    pub fn parameter(&self, length: f32) -> f32 {
        if length.is_nan() || length <= 0.0 {
            return 0.0;
        }
        if length >= self.length() {
            return 1.0;
        }
        let step = self.lengths.partition_point(|l| *l <= length).clamp(1, STEPS) - 1;
        let (low, high) = (self.lengths[step], self.lengths[step + 1]);
        let share = if high > low { (length - low) / (high - low) } else { 0.0 };
        (step as f32 + share) / STEPS as f32
    }

    /// The point at a length along the curve; before its start and past its end, on straight lines along the tangents.
    #[inline]
    pub fn point(&self, spline: &Spline, length: f32) -> Vec3 {
        let point = spline.point(self.parameter(length));
        let past = if length > self.length() { length - self.length() } else { length.min(0.0) };
        if past == 0.0 { point } else { point + spline.tangent(if past > 0.0 { 1.0 } else { 0.0 }) * past }
    }
}

/// Settings of a chain along a curve.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SplineIk {
    /// Stretch. 0: bones keep their lengths. 1: bones divide the curve's length in the ratio of their own lengths.
    pub stretch: f32,
    /// Length along the curve at which the first joint sits, in units of the rig's space.
    pub start: f32,
    /// Direction to which the first joint's up axis turns; any length, rig space. Zero: any.
    pub up: Vec3,
    /// Twist about the bone at the first joint, in radians.
    pub twist_start: f32,
    /// Twist at the last joint, in radians; joints in between twist in proportion to their distance along the chain.
    pub twist_end: f32,
    /// The axis of the joints that lies along their bone, in their own space.
    pub axis: Vec3,
    /// The axis of the joints that turns up.
    pub up_axis: Vec3,
}

impl Default for SplineIk {
    fn default() -> Self {
        Self {
            stretch: 0.0,
            start: 0.0,
            up: Vec3::Z,
            twist_start: 0.0,
            twist_end: 0.0,
            axis: Vec3::Y,
            up_axis: Vec3::Z,
        }
    }
}

/// Passes to place a joint on the curve.
const PASSES: usize = 12;

impl SplineIk {
    /// Lays a chain along a curve: positions and rotations of its joints in the rig's space.
    ///
    /// `lengths[i]` is the length of the bone from joint `i` to `i + 1`; a missing one counts as zero. Without stretch
    /// each bone keeps its length exactly and a chain longer than the curve goes straight on. Joints look along their
    /// bone, the last along the curve. Lists of joints are used as far as the shorter goes. `O(joints)`.
    pub fn solve(
        &self,
        spline: &Spline,
        table: &ArcTable,
        lengths: &[f32],
        positions: &mut [Vec3],
        rotations: &mut [Quat],
    ) {
        let count = positions.len().min(rotations.len());
        if count == 0 {
            return;
        }
        let length = |i: usize| lengths.get(i).copied().filter(|l| *l > 0.0 && l.is_finite()).unwrap_or(0.0);
        let total: f32 = (0..count - 1).map(length).sum();
        let start = if self.start.is_finite() { self.start } else { 0.0 };
        let stretch = if self.stretch > 0.0 { self.stretch.min(1.0) } else { 0.0 };
        // Kept lengths and a divided curve give two chains; the pose lies between.
        let share = if total > 0.0 { (table.length() - start).max(0.0) / total } else { 0.0 };
        let (mut kept, mut at) = (table.point(spline, start), start);
        let mut along = 0.0;
        for (i, position) in positions.iter_mut().enumerate().take(count) {
            *position = kept + (table.point(spline, start + along * share) - kept) * stretch;
            along += length(i);
            if i + 1 < count && stretch < 1.0 {
                (kept, at) = next(spline, table, kept, at, length(i));
            }
        }
        self.frames(spline, table, total, at, stretch, positions, rotations, length);
    }

    /// Rotations of joints at their positions.
    #[inline]
    fn frames(
        &self,
        spline: &Spline,
        table: &ArcTable,
        total: f32,
        end: f32,
        stretch: f32,
        positions: &[Vec3],
        rotations: &mut [Quat],
        length: impl Fn(usize) -> f32,
    ) {
        let count = positions.len().min(rotations.len());
        let axis = direction(self.axis).unwrap_or(Vec3::Y);
        let up_axis = perpendicular_or_any(axis, &[self.up_axis]);
        let last = spline.tangent(if stretch >= 1.0 { 1.0 } else { table.parameter(end) });
        let mut look = (1..count).find_map(|i| direction(positions[i] - positions[i - 1])).unwrap_or(last);
        let mut up = perpendicular_or_any(look, &[self.up]);
        let mut along = 0.0;
        for i in 0..count {
            let to = if i + 1 < count { direction(positions[i + 1] - positions[i]).unwrap_or(look) } else { last };
            up = perpendicular_or_any(to, &[arc(look, to, up) * up]);
            look = to;
            let share = if total > 0.0 { (along / total).min(1.0) } else { 0.0 };
            let twist = self.twist_start + (self.twist_end - self.twist_start) * share;
            let twisted = if twist.is_finite() && twist != 0.0 { about(look, twist) * up } else { up };
            rotations[i] = between_frames([axis, up_axis], [look, perpendicular_or_any(look, &[twisted, up])]);
            along += length(i);
        }
    }
}

/// The next joint of a chain that keeps its lengths: the first point on the curve at the distance `length` from `from`,
/// which lies at `at` along it. Returns the point and its length along the curve.
fn next(spline: &Spline, table: &ArcTable, from: Vec3, at: f32, length: f32) -> (Vec3, f32) {
    // A chord is never longer than its arc, so the missing distance can be added without overshooting.
    let mut to = at + length;
    let mut point = table.point(spline, to);
    for _ in 0..PASSES {
        let missing = length - point.distance(from);
        if missing <= 1e-6 * length {
            break;
        }
        to += missing;
        point = table.point(spline, to);
    }
    let way = direction(point - from).unwrap_or_else(|| spline.tangent(table.parameter(to)));
    (from + way * length, to)
}
