//! Landmarks: the 68 points of the Multi-PIE scheme, found on a head mesh.

use glam::Vec3;

/// The 68 landmarks of a face, in head space.
#[derive(Debug, Clone, PartialEq)]
pub struct Landmarks {
    /// In Multi-PIE order, on the skin.
    pub points: [Vec3; 68],
    /// Where the plane of symmetry meets the x axis.
    pub middle: f32,
    /// True if the head is the same on both sides.
    pub symmetric: bool,
    /// How sure the search is, 0 to 1.
    pub confidence: f32,
    /// True if the lips are apart in the mesh (a border or a slit between them), so that the mouth can open.
    pub mouth_open: bool,
}

impl Landmarks {
    /// The distance of the outer corners of the eyes.
    pub fn eye_distance(&self) -> f32 {
        self.points[36].distance(self.points[45])
    }
}
