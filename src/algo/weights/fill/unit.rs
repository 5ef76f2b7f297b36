//! A common unit: squares of distances must neither overflow nor vanish, whatever unit a mesh is in.

use glam::Vec3;

/// Coordinates beyond this, in multiples of the size of what they belong to, are moved in to it.
const FAR: f32 = 1e15;

/// A power of two that brings the largest coordinate near one; multiplying by it loses nothing.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Unit(f32);

impl Unit {
    /// The unit of some points; those that are not finite do not count.
    pub(crate) fn of(points: impl Iterator<Item = Vec3>) -> Self {
        let largest = points.filter(|p| p.is_finite()).fold(0.0f32, |m, p| m.max(p.abs().max_element()));
        let exponent = (largest.to_bits() >> 23) as i32 - 127;
        let scale = if largest > 0.0 { (-exponent).clamp(-126, 126) } else { 0 };
        Self(f32::from_bits(((scale + 127) as u32) << 23))
    }

    /// A point in this unit; one that is not finite stays so.
    pub(crate) fn to(self, point: Vec3) -> Vec3 {
        if point.is_finite() { (point * self.0).clamp(Vec3::splat(-FAR), Vec3::splat(FAR)) } else { point }
    }

    /// Points in this unit.
    pub(crate) fn all(self, points: &[Vec3]) -> Vec<Vec3> {
        points.iter().map(|&p| self.to(p)).collect()
    }
}
