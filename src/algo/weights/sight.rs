//! Lines of sight through a triangle soup: is a segment clear, where does a ray first meet a surface, is a point
//! inside.
//!
//! Every answer is the same for either orientation of the triangles, so shells that are inside-out cause no trouble.
//!
//! Vectors cross into obvhs as arrays: it takes a range of glam versions, and a user's lock file may have it use another
//! than ours.

use glam::Vec3;
use obvhs::{
    BvhBuildParams,
    cwbvh::{CwBvh, builder::build_cwbvh_from_tris},
    ray::{Ray, RayHit},
    triangle::Triangle,
};

/// Directions in which [`Sight::encloses`] looks.
const DIRECTIONS: usize = 32;
/// The share of a segment at either end in which nothing blocks it: the surface the point lies on.
const MARGIN: f32 = 1e-3;

/// A hierarchy over triangles that answers lines of sight.
pub(crate) struct Sight {
    /// In the hierarchy's own order.
    triangles: Vec<Triangle>,
    bvh: Option<CwBvh>,
}

impl Sight {
    /// Builds the hierarchy; indices must be in range and points finite. Triangles without area hide nothing.
    pub fn new(points: &[Vec3], triangles: &[[u32; 3]]) -> Self {
        let soup: Vec<Triangle> = triangles
            .iter()
            .map(|t| t.map(|i| points[i as usize]))
            .filter(|[a, b, c]| (*b - *a).cross(*c - *a).length_squared() > 0.0)
            .map(|corners| corners.map(|corner| corner.to_array().into()))
            .map(|[v0, v1, v2]| Triangle { v0, v1, v2 })
            .collect();
        if soup.is_empty() {
            return Self { triangles: soup, bvh: None };
        }
        let bvh = build_cwbvh_from_tris(&soup, BvhBuildParams::very_fast_build(), &mut Default::default());
        let triangles = bvh.primitive_indices.iter().map(|&i| soup[i as usize]).collect();
        Self { triangles, bvh: Some(bvh) }
    }

    /// True if no triangle crosses the segment strictly between its ends.
    pub fn clear(&self, from: Vec3, to: Vec3) -> bool {
        let Some(bvh) = &self.bvh else { return true };
        let direction = to - from;
        if direction.length_squared() <= 0.0 {
            return true;
        }
        let ray = Ray::new(from.to_array().into(), direction.to_array().into(), MARGIN, 1.0 - MARGIN);
        bvh.ray_traverse_miss(ray, |ray, index| self.triangles[index].intersect(ray))
    }

    /// The distance along the unit vector `direction` to the first surface.
    pub fn first(&self, origin: Vec3, direction: Vec3) -> Option<f32> {
        let bvh = self.bvh.as_ref()?;
        let mut hit = RayHit::none();
        let ray = Ray::new_inf(origin.to_array().into(), direction.to_array().into());
        bvh.ray_traverse(ray, &mut hit, |ray, index| self.triangles[index].intersect(ray)).then_some(hit.t)
    }

    /// True if the surface is around `point`, by two measures over evenly spread rays, each of which some damage
    /// spoils.
    ///
    /// The mean of signed crossings is the generalised winding number (Jacobson et al. 2013), which holes weaken and
    /// shells inside each other strengthen, but which needs triangles of one orientation. The share of rays with an odd
    /// number of crossings does not.
    pub fn encloses(&self, point: Vec3) -> bool {
        let Some(bvh) = &self.bvh else { return false };
        let (mut winding, mut odd) = (0i32, 0usize);
        for direction in evenly_spread() {
            let direction = direction.to_array().into();
            let mut crossings = 0;
            bvh.ray_traverse_anyhit(Ray::new_inf(point.to_array().into(), direction), |ray, index| {
                let triangle = &self.triangles[index];
                if triangle.intersect(ray) < f32::INFINITY {
                    let normal = (triangle.v1 - triangle.v0).cross(triangle.v2 - triangle.v0);
                    winding += if normal.dot(direction) > 0.0 { 1 } else { -1 };
                    crossings += 1;
                }
            });
            odd += crossings % 2;
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
