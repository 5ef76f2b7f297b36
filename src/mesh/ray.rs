//! Rays and hits, shared by the surface and its callers.

use glam::Vec3;

/// A half line in the space of the surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ray {
    /// Start of the ray.
    pub origin: Vec3,
    /// Direction of the ray, of unit length.
    pub direction: Vec3,
}

impl Ray {
    /// The point at `distance` along the ray.
    pub fn at(&self, distance: f32) -> Vec3 {
        self.origin + self.direction * distance
    }
}

/// Crossing of a ray and the surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Hit {
    /// Distance from the ray's origin, not negative.
    pub distance: f32,
    /// Index of the triangle that was hit.
    pub triangle: u32,
    /// Direction of the crossing: `true` if the ray goes in (it meets the triangle's counter-clockwise side), `false`
    /// if it comes out.
    pub entering: bool,
}
