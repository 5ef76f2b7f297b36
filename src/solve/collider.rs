//! Bodies that springs do not enter.

use bevy::math::Vec3;

use crate::solve::rotate::{direction, perpendicular_or_any};

/// Share of a radius by which a point may be inside of a body and counts as outside.
const SKIN: f32 = 1e-5;

/// A capsule about a segment; a sphere where both ends are the same.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Capsule {
    /// Start of the segment.
    pub start: Vec3,
    /// End of the segment.
    pub end: Vec3,
    /// Radius; not above 0 is no body.
    pub radius: f32,
}

impl Capsule {
    /// The point of the segment that is nearest to a point inside the capsule; `None` for a point outside.
    fn nearest(&self, point: Vec3) -> Option<Vec3> {
        let along = self.end - self.start;
        let square = along.length_squared();
        let share = if square > 0.0 { ((point - self.start).dot(along) / square).clamp(0.0, 1.0) } else { 0.0 };
        let nearest = self.start + along * share;
        // The comparison is also false for NaN.
        let is_inside = self.radius > 0.0 && point.distance(nearest) < self.radius * (1.0 - SKIN);
        is_inside.then_some(nearest)
    }

    /// The nearest point that is not inside the capsule; a point outside comes back as it is. A point on the segment
    /// leaves it along `otherwise`.
    pub fn push_out(&self, point: Vec3, otherwise: Vec3) -> Vec3 {
        let Some(nearest) = self.nearest(point) else { return point };
        let way = direction(point - nearest).or_else(|| direction(otherwise)).unwrap_or(Vec3::Y);
        nearest + way * self.radius
    }

    /// The end of a bone from `origin`, turned by the least angle until it leaves the part of the capsule that is
    /// nearest to it; its length stays. An end outside comes back as it is, and so does that of a bone that leaves the
    /// capsule in no direction.
    pub fn turn_out(&self, origin: Vec3, end: Vec3) -> Vec3 {
        let Some(nearest) = self.nearest(end) else { return end };
        let (bone, way) = (end - origin, nearest - origin);
        let (length, distance) = (bone.length(), way.length());
        let (Some(along), true) = (direction(way), length > 0.0 && distance > 1e-6 * length) else { return end };
        let cosine = (length * length + distance * distance - self.radius * self.radius) / (2.0 * length * distance);
        if !(-1.0..1.0).contains(&cosine) {
            return end;
        }
        let aside = perpendicular_or_any(along, &[bone]);
        origin + (along * cosine + aside * (1.0 - cosine * cosine).max(0.0).sqrt()) * length
    }
}
