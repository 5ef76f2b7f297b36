//! Rays and hits, shared by the surface and everything that asks it.

use glam::Vec3;

/// A half line in the space of the surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ray {
    /// Where it starts.
    pub origin: Vec3,
    /// Where it goes; unit length.
    pub direction: Vec3,
}

impl Ray {
    /// The point at `distance` along the ray.
    pub fn at(&self, distance: f32) -> Vec3 {
        self.origin + self.direction * distance
    }
}

/// Where a ray crosses the surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Hit {
    /// Distance from the ray's origin, not negative.
    pub distance: f32,
    /// Index of the triangle that was hit.
    pub triangle: u32,
    /// True if the ray goes in (it meets the triangle's counter-clockwise side), false if it comes out.
    pub entering: bool,
}
