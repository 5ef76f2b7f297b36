//! Stretch: the scale of a bone along and across its length.

use bevy::math::{Vec3, ops};

/// Response of a bone to a change of its length.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Stretch {
    /// The least factor of the length, over 0.
    pub min: f32,
    /// The greatest factor of the length.
    pub max: f32,
    /// Volume preservation: 0 none (no scale across), 1 full (a bone twice as long is 1/√2 as thick), more exaggerates,
    /// negative swells.
    pub volume: f32,
}

impl Default for Stretch {
    /// Any length, with full volume preservation.
    fn default() -> Self {
        Self { min: 0.0, max: f32::INFINITY, volume: 1.0 }
    }
}

/// Factors of a stretched bone.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StretchFactors {
    /// Factor along the bone.
    pub along: f32,
    /// Factor along both axes across the bone: `along` to the power of `-volume / 2`.
    pub across: f32,
}

impl Stretch {
    /// Least factor, which keeps scales from becoming zero.
    const LEAST: f32 = 1e-4;

    /// The factors of a bone of length `rest` that is `length` long now. A bone without length at rest, and input that
    /// is not finite, gives factors of one. A limit `max` under `min` counts as `min`.
    #[inline]
    pub fn solve(&self, rest: f32, length: f32) -> StretchFactors {
        let factor = length / rest;
        if !(rest > 0.0 && length >= 0.0 && factor.is_finite()) {
            return StretchFactors { along: 1.0, across: 1.0 };
        }
        let least = self.min.max(Self::LEAST);
        let along = factor.min(self.max).max(least);
        let along = if along.is_finite() { along } else { factor };
        let across = if self.volume == 0.0 { 1.0 } else { ops::powf(along, -0.5 * self.volume) };
        StretchFactors { along, across: if across.is_finite() { across } else { 1.0 } }
    }
}

impl StretchFactors {
    /// Scale along the axes of a joint whose bone lies along axis `along` (0 X, 1 Y, 2 Z; more counts as Z).
    #[inline]
    pub fn scale(&self, along: usize) -> Vec3 {
        let mut scale = Vec3::splat(self.across);
        scale[along.min(2)] = self.along;
        scale
    }
}
