//! Lines of sight through a triangle soup: is a segment clear, where does a ray first meet a surface, is a point
//! inside.
//!
//! Every answer is the same for either orientation of the triangles, so shells that are inside-out cause no trouble.

use glam::Vec3;

use crate::mesh::{ray::Ray, surface::Surface};

/// Directions in which [`Sight::encloses`] looks.
const DIRECTIONS: usize = 32;
/// The share of a segment at either end in which nothing blocks it: the surface the point lies on.
const MARGIN: f32 = 1e-3;

/// A surface that answers lines of sight.
pub(crate) struct Sight(Surface);

impl Sight {
    /// Builds the hierarchy; indices must be in range and points finite. Triangles without area hide nothing.
    pub fn new(points: &[Vec3], triangles: &[[u32; 3]]) -> Self {
        Self(Surface::build(points, triangles))
    }

    /// True if no triangle crosses the segment strictly between its ends.
    pub fn clear(&self, from: Vec3, to: Vec3) -> bool {
        let way = to - from;
        let length = way.length();
        let ray = Ray { origin: from, direction: way / length };
        !self.0.crosses(&ray, MARGIN * length, (1.0 - MARGIN) * length)
    }

    /// The distance along the unit vector `direction` to the first surface.
    pub fn first(&self, origin: Vec3, direction: Vec3) -> Option<f32> {
        self.0.closest(&Ray { origin, direction }).map(|hit| hit.distance)
    }

    /// True if the surface is around `point`, by two measures over evenly spread rays, each of which some damage
    /// spoils.
    ///
    /// The mean of signed crossings is the generalised winding number (Jacobson et al. 2013), which holes weaken and
    /// shells inside each other strengthen, but which needs triangles of one orientation. The share of rays with an odd
    /// number of crossings does not.
    pub fn encloses(&self, point: Vec3) -> bool {
        let (mut winding, mut odd) = (0i32, 0usize);
        let mut hits = Vec::new();
        for direction in evenly_spread() {
            self.0.hits(&Ray { origin: point, direction }, &mut hits);
            winding += hits.iter().map(|hit| if hit.entering { -1 } else { 1 }).sum::<i32>();
            odd += hits.len() % 2;
        }
        winding.unsigned_abs() as usize * 3 > DIRECTIONS || odd * 8 > DIRECTIONS * 5
    }
}

/// Unit vectors on a spherical Fibonacci lattice. The golden angle is turned by repeated complex multiplication, so no
/// sine is needed.
fn evenly_spread() -> impl Iterator<Item = Vec3> {
    const COS: f32 = -0.737_368_9;
    const SIN: f32 = 0.675_490_3;
    let mut turn = (1.0f32, 0.0f32);
    (0..DIRECTIONS).map(move |i| {
        let y = 1.0 - (2 * i + 1) as f32 / DIRECTIONS as f32;
        let radius = (1.0 - y * y).max(0.0).sqrt();
        turn = (turn.0 * COS - turn.1 * SIN, turn.0 * SIN + turn.1 * COS);
        Vec3::new(radius * turn.0, y, radius * turn.1)
    })
}
