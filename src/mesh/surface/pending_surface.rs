//! A surface that answers queries before its hierarchy is built.

use std::sync::{Arc, OnceLock};

use glam::Vec3;
use rayon::prelude::*;

use super::Surface;
use super::crossing::{Crossing, Frame, resolve, usable};
use crate::mesh::ray::{Hit, Ray};

/// Collects every crossing of `ray` with the triangles by testing each of them; the hits equal those of
/// [`Surface::hits`] to the bit.
///
/// Parallel over triangles: about as fast as building a hierarchy for a handful of rays.
pub fn hits_brute(points: &[Vec3], triangles: &[[u32; 3]], ray: &Ray, out: &mut Vec<Hit>) {
    resolve(
        &mut crossings(points, triangles, ray),
        |slot| corners_of(points, &triangles[slot as usize]).unwrap_or_default(),
        out,
    );
}

fn corners_of(points: &[Vec3], triangle: &[u32; 3]) -> Option<[Vec3; 3]> {
    let [a, b, c] = triangle.map(|corner| points.get(corner as usize).copied().filter(|&p| usable(p)));
    Some([a?, b?, c?])
}

fn crossings(points: &[Vec3], triangles: &[[u32; 3]], ray: &Ray) -> Vec<Crossing> {
    let Some(frame) = Frame::new(ray) else { return Vec::new() };
    triangles
        .par_iter()
        .enumerate()
        .with_min_len(1 << 12)
        .filter_map(|(i, triangle)| {
            let (distance, entering, tolerance) = frame.cross(corners_of(points, triangle)?)?;
            Some(Crossing { distance, triangle: i as u32, slot: i as u32, entering, tolerance })
        })
        .collect()
}

/// A mesh whose hierarchy is being built elsewhere: until it is ready, queries test every triangle.
///
/// Share it in an [`Arc`], call [`PendingSurface::build`] on a background thread, and ask it from anywhere meanwhile;
/// the answers are the same before and after.
#[derive(Debug)]
pub struct PendingSurface {
    points: Arc<[Vec3]>,
    triangles: Arc<[[u32; 3]]>,
    ready: OnceLock<Surface>,
}

impl PendingSurface {
    /// Holds `points` (posed space) and `triangles` over them; builds nothing yet.
    pub fn new(points: Arc<[Vec3]>, triangles: Arc<[[u32; 3]]>) -> Self {
        Self { points, triangles, ready: OnceLock::new() }
    }

    /// Builds the hierarchy, unless that is done, and returns it. Concurrent callers wait for it.
    pub fn build(&self) -> &Surface {
        self.ready.get_or_init(|| Surface::build(&self.points, &self.triangles))
    }

    /// Sets a hierarchy that was made elsewhere (refitted from another pose). A hierarchy that is already set stays.
    pub fn set(&self, surface: Surface) {
        // An error means that another hierarchy over the same points is set, which serves as well.
        let _ = self.ready.set(surface);
    }

    /// The hierarchy, once it is ready.
    pub fn ready(&self) -> Option<&Surface> {
        self.ready.get()
    }

    /// The surface, for a refit to the next pose; `None` while it is not ready.
    pub fn into_surface(self) -> Option<Surface> {
        self.ready.into_inner()
    }

    /// Collects all hits along `ray`, as [`Surface::hits`].
    pub fn hits(&self, ray: &Ray, out: &mut Vec<Hit>) {
        match self.ready() {
            Some(surface) => surface.hits(ray, out),
            None => hits_brute(&self.points, &self.triangles, ray, out),
        }
    }

    /// The first and the last hit along `ray`, as [`Surface::near_far`].
    pub fn near_far(&self, ray: &Ray) -> Option<(Hit, Hit)> {
        match self.ready() {
            Some(surface) => surface.near_far(ray),
            None => {
                let crossings = crossings(&self.points, &self.triangles, ray);
                let order =
                    |a: &&Crossing, b: &&Crossing| a.distance.total_cmp(&b.distance).then(a.triangle.cmp(&b.triangle));
                Some((crossings.iter().min_by(order)?.hit(), crossings.iter().max_by(order)?.hit()))
            }
        }
    }

    /// The first hit along `ray`, as [`Surface::closest`].
    pub fn closest(&self, ray: &Ray) -> Option<Hit> {
        match self.ready() {
            Some(surface) => surface.closest(ray),
            None => self.near_far(ray).map(|(near, _)| near),
        }
    }
}
