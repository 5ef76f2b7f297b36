//! Curves fitted to samples: few keys that stay within a tolerance at every sample.
//!
//! A segment begins and ends at samples and is as long as the tolerance lets it be. Between its ends runs a cubic
//! Hermite spline whose tangents fit the samples best (least squares), or a line where lines need fewer numbers.

use crate::rig::animation::{Ease, Key, Property, Track};

/// Part of a curve between two samples.
#[derive(Debug, Clone, Copy)]
struct Segment {
    /// Samples at which it begins and ends.
    ends: [usize; 2],
    /// Tangents at both ends, for the whole segment.
    tangents: [[f32; 4]; 2],
}

/// Samples of one property, with the largest difference from each: degrees for rotations.
struct Samples<'a> {
    property: &'a Property,
    times: &'a [f32],
    values: &'a [[f32; 4]],
    tolerance: &'a [f32],
    is_cubic: bool,
}

/// Keys of a curve that stays within the tolerance at every sample: degrees for rotations, whose samples lie on one
/// side each to the next. Lists have the same length. Time is nearly linear in the number of samples.
pub fn fit_curve(property: &Property, times: &[f32], values: &[[f32; 4]], tolerance: &[f32]) -> Vec<Key> {
    let Some(first) = values.first() else { return Vec::new() };
    if is_constant(property, values, tolerance) {
        return vec![Key { time: times[0], value: *first, ease: Ease::Linear }];
    }
    let samples = |is_cubic: bool| Samples { property, times, values, tolerance, is_cubic };
    let (cubic, linear) = (samples(true).keys(), samples(false).keys());
    let is_finite = |key: &Key| match key.ease {
        Ease::Cubic { arrive, leave } => [arrive, leave].as_flattened().iter().all(|number| number.is_finite()),
        Ease::Linear | Ease::Stepped => true,
    };
    if !cubic.iter().all(is_finite) {
        return linear;
    }
    let numbers = |keys: &[Key], values: usize| keys.len() * (1 + values * property.width());
    if numbers(&linear, 1) <= numbers(&cubic, 3) { linear } else { cubic }
}

/// Samples between which lines stay within the tolerance, as [`fit_curve`] has it; the first one alone for a constant.
pub(super) fn fit_lines(property: &Property, times: &[f32], values: &[[f32; 4]], tolerance: &[f32]) -> Vec<usize> {
    if values.is_empty() {
        return Vec::new();
    }
    if is_constant(property, values, tolerance) {
        return vec![0];
    }
    let samples = Samples { property, times, values, tolerance, is_cubic: false };
    std::iter::once(0).chain(samples.segments().into_iter().map(|segment| segment.ends[1])).collect()
}

/// True if one key stands for all samples.
fn is_constant(property: &Property, values: &[[f32; 4]], tolerance: &[f32]) -> bool {
    let Some(first) = values.first() else { return true };
    // Half of the tolerance is left to other tracks: a curve of one key is off on one side all the time.
    let is_same = |(value, tolerance): (&[f32; 4], &f32)| difference(property, value, first) <= 0.5 * tolerance;
    values.iter().zip(tolerance).all(is_same)
}

/// Values of keys at times.
pub fn sampled(property: &Property, times: &[f32], keys: Vec<Key>) -> Vec<[f32; 4]> {
    let track = Track { keys };
    times.iter().map(|time| track.sample(property, *time).unwrap_or_else(|| property.rest())).collect()
}

/// Difference of two values: an angle in degrees for rotations, else a distance.
pub fn difference(property: &Property, a: &[f32; 4], b: &[f32; 4]) -> f32 {
    let dot: f32 = a.iter().zip(b).map(|(a, b)| a * b).sum();
    let sign = if *property == Property::Rotation && dot < 0.0 { -1.0 } else { 1.0 };
    let square: f32 = a.iter().zip(b).map(|(a, b)| (a - b * sign) * (a - b * sign)).sum();
    if *property == Property::Rotation {
        // The chord between two unit quaternions is twice the sine of a quarter of the angle.
        return 4.0 * bevy::math::ops::asin((square.sqrt() * 0.5).min(1.0)).to_degrees();
    }
    square.sqrt()
}

impl Samples<'_> {
    fn keys(&self) -> Vec<Key> {
        let segments = self.segments();
        let key = |sample: usize, arrive: [f32; 4], leave: [f32; 4]| Key {
            time: self.times[sample],
            value: self.values[sample],
            ease: if self.is_cubic { Ease::Cubic { arrive, leave } } else { Ease::Linear },
        };
        let span = |segment: &Segment| self.times[segment.ends[1]] - self.times[segment.ends[0]];
        let mut keys = Vec::with_capacity(segments.len() + 1);
        let mut arrive = [0.0; 4];
        for segment in &segments {
            let [leaving, arriving] = segment.tangents.map(|tangent| tangent.map(|number| number / span(segment)));
            keys.push(key(segment.ends[0], arrive, leaving));
            arrive = arriving;
        }
        keys.push(key(segments.last().map_or(0, |last| last.ends[1]), arrive, [0.0; 4]));
        keys
    }

    /// Segments from the first sample to the last, each as long as it can be: found in growing steps, then by halving.
    fn segments(&self) -> Vec<Segment> {
        let (mut segments, mut at, last) = (Vec::new(), 0, self.values.len() - 1);
        while at < last {
            let mut good = self.line(at, at + 1);
            let (mut step, mut bad) = (2, last + 1);
            while good.ends[1] < last {
                let end = (at + step).min(last);
                match self.segment(at, end) {
                    Some(found) => good = found,
                    None => {
                        bad = end;
                        break;
                    }
                }
                step *= 2;
            }
            while bad <= last && bad - good.ends[1] > 1 {
                let middle = good.ends[1].midpoint(bad);
                match self.segment(at, middle) {
                    Some(found) => good = found,
                    None => bad = middle,
                }
            }
            at = good.ends[1];
            segments.push(good);
        }
        segments
    }

    /// Segment between two samples if it stays within the tolerance.
    fn segment(&self, from: usize, to: usize) -> Option<Segment> {
        let segment = if self.is_cubic { self.fitted(from, to) } else { self.line(from, to) };
        let pair = Track { keys: self.pair(&segment) };
        let is_near = |sample: usize| {
            let value = pair.sample(self.property, self.times[sample]);
            value.is_some_and(|value| difference(self.property, &value, &self.values[sample]) <= self.tolerance[sample])
        };
        (from + 1..to).all(is_near).then_some(segment)
    }

    /// Keys at the two ends of a segment.
    fn pair(&self, segment: &Segment) -> Vec<Key> {
        let [from, to] = segment.ends;
        let span = self.times[to] - self.times[from];
        let [leave, arrive] = segment.tangents.map(|tangent| tangent.map(|number| number / span));
        let ease = |arrive, leave| if self.is_cubic { Ease::Cubic { arrive, leave } } else { Ease::Linear };
        vec![
            Key { time: self.times[from], value: self.values[from], ease: ease([0.0; 4], leave) },
            Key { time: self.times[to], value: self.values[to], ease: ease(arrive, [0.0; 4]) },
        ]
    }

    /// Segment without a bend.
    fn line(&self, from: usize, to: usize) -> Segment {
        let way = std::array::from_fn(|axis| self.values[to][axis] - self.values[from][axis]);
        Segment { ends: [from, to], tangents: [way; 2] }
    }

    /// Cubic segment whose tangents fit the samples between best.
    fn fitted(&self, from: usize, to: usize) -> Segment {
        let line = self.line(from, to);
        let (first, last) = (self.values[from], self.values[to]);
        let span = f64::from(self.times[to]) - f64::from(self.times[from]);
        // Sums of the normal equations; the matrix is that of all components.
        let (mut matrix, mut right) = ([0.0_f64; 3], [[0.0_f64; 2]; 4]);
        for sample in from + 1..to {
            let share = (f64::from(self.times[sample]) - f64::from(self.times[from])) / span;
            let (square, cube) = (share * share, share * share * share);
            let [leaving, arriving] = [cube - 2.0 * square + share, cube - square];
            let end = 3.0 * square - 2.0 * cube;
            matrix[0] += leaving * leaving;
            matrix[1] += leaving * arriving;
            matrix[2] += arriving * arriving;
            for (axis, right) in right.iter_mut().enumerate() {
                let value = f64::from(self.values[sample][axis]);
                let left = value - (1.0 - end) * f64::from(first[axis]) - end * f64::from(last[axis]);
                right[0] += leaving * left;
                right[1] += arriving * left;
            }
        }
        let determinant = matrix[0] * matrix[2] - matrix[1] * matrix[1];
        let mut tangents = line.tangents;
        if determinant > 1e-9 * matrix[0] * matrix[2] {
            for (axis, [a, b]) in right.iter().enumerate() {
                tangents[0][axis] = ((matrix[2] * a - matrix[1] * b) / determinant) as f32;
                tangents[1][axis] = ((matrix[0] * b - matrix[1] * a) / determinant) as f32;
            }
        } else if to == from + 2 {
            // One sample between: the bend is shared by both ends.
            let [leaving, arriving] = [matrix[0].sqrt(), -matrix[2].sqrt()];
            for (axis, [a, _]) in right.iter().enumerate() {
                let way = f64::from(line.tangents[0][axis]);
                let bend = (a / leaving - (leaving + arriving) * way) / (leaving - arriving);
                tangents[0][axis] = (way + bend) as f32;
                tangents[1][axis] = (way - bend) as f32;
            }
        }
        Segment { tangents, ..line }
    }
}
