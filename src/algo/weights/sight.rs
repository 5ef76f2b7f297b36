//! Lines of sight through a triangle soup: is a segment clear, where does a ray first meet a surface, is a point inside.
//!
//! Every answer is the same for either orientation of the triangles, so shells that are inside-out cause no trouble.

use glam::{Vec3, Vec3A};
use obvhs::{
    BvhBuildParams,
    cwbvh::{CwBvh, builder::build_cwbvh_from_tris},
    ray::{Ray, RayHit},
    triangle::Triangle,
};

/// Directions for the winding estimate: a spherical Fibonacci lattice with this many points.
const WINDING_RAYS: usize = 32;

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
            .map(|t| t.map(|i| Vec3A::from(points[i as usize])))
            .filter(|[a, b, c]| (*b - *a).cross(*c - *a).length_squared() > 0.0)
            .map(|[v0, v1, v2]| Triangle { v0, v1, v2 })
            .collect();
        if soup.is_empty() {
            return Self { triangles: soup, bvh: None };
        }
        let bvh = build_cwbvh_from_tris(&soup, BvhBuildParams::very_fast_build(), &mut Default::default());
        let triangles = bvh.primitive_indices.iter().map(|&i| soup[i as usize]).collect();
        Self { triangles, bvh: Some(bvh) }
    }

    /// True if no triangle crosses the segment strictly between its ends (`margin` is the share left out at either end).
    pub fn clear(&self, from: Vec3, to: Vec3, margin: f32) -> bool {
        let Some(bvh) = &self.bvh else { return true };
        let direction = Vec3A::from(to - from);
        if direction.length_squared() <= 0.0 {
            return true;
        }
        let ray = Ray::new(from.into(), direction, margin, 1.0 - margin);
        bvh.ray_traverse_miss(ray, |ray, index| self.triangles[index].intersect(ray))
    }

    /// The distance along the unit vector `direction` to the first surface further away than `from`.
    pub fn first(&self, origin: Vec3, direction: Vec3, from: f32) -> Option<f32> {
        let bvh = self.bvh.as_ref()?;
        let mut hit = RayHit::none();
        let ray = Ray::new(origin.into(), direction.into(), from, f32::INFINITY);
        bvh.ray_traverse(ray, &mut hit, |ray, index| self.triangles[index].intersect(ray)).then_some(hit.t)
    }

    /// An estimate of the generalised winding number of `point`: 1 inside, 0 outside, in between near holes. Its sign
    /// is dropped. The mean of signed crossings over evenly spread rays is that number (Jacobson et al. 2013).
    pub fn winding(&self, point: Vec3) -> f32 {
        let Some(bvh) = &self.bvh else { return 0.0 };
        let mut sum = 0i32;
        for direction in fibonacci_sphere() {
            let direction = Vec3A::from(direction);
            bvh.ray_traverse_anyhit(Ray::new_inf(point.into(), direction), |ray, index| {
                let triangle = &self.triangles[index];
                if triangle.intersect(ray) < f32::INFINITY {
                    let normal = (triangle.v1 - triangle.v0).cross(triangle.v2 - triangle.v0);
                    sum += if normal.dot(direction) > 0.0 { 1 } else { -1 };
                }
            });
        }
        sum.unsigned_abs() as f32 / WINDING_RAYS as f32
    }
}

/// Evenly spread unit vectors. The golden angle is turned by repeated complex multiplication, so no sine is needed.
fn fibonacci_sphere() -> impl Iterator<Item = Vec3> {
    const COS: f32 = -0.737_368_9;
    const SIN: f32 = 0.675_490_3;
    let mut turn = (1.0f32, 0.0f32);
    (0..WINDING_RAYS).map(move |i| {
        let y = 1.0 - (2 * i + 1) as f32 / WINDING_RAYS as f32;
        let radius = (1.0 - y * y).max(0.0).sqrt();
        turn = (turn.0 * COS - turn.1 * SIN, turn.0 * SIN + turn.1 * COS);
        // Off the axes, so that rays do not run along the edges of boxy models.
        Vec3::new(radius * turn.0, y, radius * turn.1)
    })
}
