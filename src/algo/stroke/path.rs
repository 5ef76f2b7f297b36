//! A cleaned stroke, measured along its length.

use glam::Vec2;

use super::StrokeError;

/// A polyline without repetitions, with the arc length of each of its points.
#[derive(Debug, Clone)]
pub(super) struct Path {
    pub(super) points: Vec<Vec2>,
    pub(super) lengths: Vec<f32>,
}

impl Path {
    /// Drops points that are not finite and points that repeat the one before.
    pub(super) fn new(points: &[Vec2]) -> Result<Self, StrokeError> {
        let mut clean: Vec<Vec2> = points.iter().copied().filter(|p| p.is_finite()).collect();
        clean.dedup();
        // Lengths are summed in double precision, so that half a million tiny steps still add up.
        let mut length = 0.0f64;
        let lengths: Vec<f32> = (0..clean.len())
            .map(|i| {
                if i > 0 {
                    length += clean[i].as_dvec2().distance(clean[i - 1].as_dvec2());
                }
                length as f32
            })
            .collect();
        if clean.len() < 2 || !lengths.last().is_some_and(|&length| length > 0.0 && length.is_finite()) {
            return Err(StrokeError::TooShort { given: points.len(), finite: clean.len() });
        }
        Ok(Self { points: clean, lengths })
    }

    pub(super) fn length(&self) -> f32 {
        self.lengths.last().copied().unwrap_or(0.0)
    }

    /// The point at an arc length, clamped to the path.
    pub(super) fn at(&self, length: f32) -> Vec2 {
        let next = self.lengths.partition_point(|&l| l < length);
        if next == 0 {
            return self.points[0];
        }
        if next == self.points.len() {
            return self.points[next - 1];
        }
        let (a, b) = (self.lengths[next - 1], self.lengths[next]);
        let t = if b > a { (length - a) / (b - a) } else { 1.0 };
        self.points[next - 1].lerp(self.points[next], t)
    }
}
