//! Ray queries on the posed mesh: closest, furthest and all hits, and the closest point.
//!
//! A hit is found once however many triangles share the place, no ray slips between neighbours, and a closed mesh is
//! entered exactly as often as it is left, at any unit scale. Rounding errors are relative to the distance of the
//! surface from the ray's origin, and of the ray's origin from the origin of the space.
//!
//! The hierarchy has eight children a node; a node and a packet of four triangles take 128 bytes each, since rays in a
//! large mesh mostly wait for memory. A million triangles take 50 MB.

mod build;
mod closest;
mod crossing;
mod node;
mod packet;
mod pending_surface;
mod traverse;
mod tree;
mod volumes;

use glam::Vec3;
use rayon::prelude::*;

pub use pending_surface::{PendingSurface, hits_brute};
pub use volumes::{Volume, volumes};

use crate::mesh::ray::{Hit, Ray};
use crossing::{Frame, resolve, usable};
use node::BoxRay;
use traverse::Sightline;
use tree::Tree;

/// Tangent of the angle by which a ray is tilted that runs along a flat surface.
const TILT: f32 = 1e-3;

/// Leaves that a ray may meet without a crossing. A ray through a mesh of a million triangles meets some dozens.
const MOST_LEAVES: usize = 384;

/// Leaves that a tilted ray may meet without a crossing. It starts beside what the ray ran along, so it may meet no less.
const MOST_TILTED: usize = 96;

/// A bounding volume hierarchy over triangles.
///
/// Distances and positions are in the space and unit of the points it was built from. It owns a compact copy of the
/// triangles, so that the mesh need not stay around. Equal input gives equal answers on every machine and for any
/// number of threads.
#[derive(Debug, Clone, Default)]
pub struct Surface {
    tree: Tree,
    points: usize,
    triangles: usize,
}

/// The point of a surface closest to a given point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SurfacePoint {
    /// Position on the surface.
    pub point: Vec3,
    /// The triangle it lies on, as an index into the triangles the surface was built from.
    pub triangle: u32,
    /// Barycentric weights over the triangle's three corners; they sum to one.
    pub barycentric: Vec3,
    /// Distance from the given point.
    pub distance: f32,
}

/// Error of moving a surface to other positions.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum SurfaceError {
    /// The positions are not those of the mesh that the surface was built from.
    #[error("the surface was built from {expected} points but is refitted with {found}; build it again")]
    PointCount {
        /// Number of points that the surface was built from.
        expected: usize,
        /// Number of points given.
        found: usize,
    },
    /// A position is not finite or too far from the origin to have a bounding box.
    #[error(
        "point {point} is not finite or further than 1e18 from the origin; repair the pose, or build the surface again to leave out its triangles"
    )]
    Point {
        /// Index of the first such point that a triangle of the surface uses.
        point: usize,
    },
}

impl Surface {
    /// Builds the hierarchy over `triangles`, whose corners index `points`.
    ///
    /// Triangles with a corner out of range, not finite or further than 1e18 from the origin are left out. O(n log n),
    /// in parallel.
    pub fn build(points: &[Vec3], triangles: &[[u32; 3]]) -> Self {
        let (tree, count) = Tree::build(points, triangles);
        Self { tree, points: points.len(), triangles: count }
    }

    /// Moves the surface to other positions of the same points: much cheaper than building, and as good while the
    /// shape changes little.
    ///
    /// # Errors
    /// The number of points differs, or one that a triangle uses is not finite or too far out; the surface then stays as
    /// it was.
    pub fn refit(&mut self, points: &[Vec3]) -> Result<(), SurfaceError> {
        if points.len() != self.points {
            return Err(SurfaceError::PointCount { expected: self.points, found: points.len() });
        }
        let unusable = |chunk: &[Vec3]| chunk.iter().any(|&point| !usable(point));
        if points.par_chunks(1 << 14).any(unusable)
            && let Some(point) = self.tree.points().filter(|&point| !usable(points[point])).min()
        {
            return Err(SurfaceError::Point { point });
        }
        self.tree.refit(points);
        Ok(())
    }

    /// The first hit along `ray`.
    pub fn closest(&self, ray: &Ray) -> Option<Hit> {
        let (frame, boxes) = self.prepare(ray)?;
        self.tree.nearest(&frame, &boxes).map(|crossing| crossing.hit())
    }

    /// The first and the last hit along `ray`; the same one twice if there is only one.
    ///
    /// `near` is at the distance of the first of [`Surface::hits`]. Two searches, one from each end, visit little of
    /// the surface between.
    pub fn near_far(&self, ray: &Ray) -> Option<(Hit, Hit)> {
        let (frame, boxes) = self.prepare(ray)?;
        let near = self.tree.nearest(&frame, &boxes)?;
        let far = self.tree.farthest(&frame, &boxes).unwrap_or(near);
        Some((near.hit(), far.hit()))
    }

    /// Collects all hits along `ray`, sorted by distance; `out` is overwritten.
    ///
    /// A crossing at an edge or corner that several triangles share counts once. A closed mesh of consistent winding
    /// is entered as often as it is left.
    pub fn hits(&self, ray: &Ray, out: &mut Vec<Hit>) {
        let mut crossings = Vec::new();
        if let Some((frame, boxes)) = self.prepare(ray) {
            self.tree.all(&frame, &boxes, usize::MAX, &mut crossings);
        }
        resolve(&mut crossings, |slot| self.tree.slot(slot).1, out);
    }

    /// Collects the [`hits`](Self::hits) of a ray that meets few triangles. False, and no hits, for one that comes near to
    /// those of more than `most` leaves of the hierarchy (of up to eight triangles each), so that the time of a ray is
    /// bounded in a soup of long triangles, too.
    pub fn hits_within(&self, ray: &Ray, most: usize, out: &mut Vec<Hit>) -> bool {
        let mut crossings = Vec::new();
        let is_whole = match self.prepare(ray) {
            Some((frame, boxes)) => self.tree.all(&frame, &boxes, most, &mut crossings),
            None => true,
        };
        if !is_whole {
            crossings.clear();
        }
        resolve(&mut crossings, |slot| self.tree.slot(slot).1, out);
        is_whole
    }

    /// True if a triangle crosses `ray` at a distance from `from` to `to`: cheaper than asking for the first hit. A ray that
    /// runs along a flat surface, or along hundreds of triangles, is tilted a little.
    pub fn crosses(&self, ray: &Ray, from: f32, to: f32) -> bool {
        self.crosses_counted(ray, from, to).0
    }

    /// The answer of [`Surface::crosses`], and the number of leaves of the hierarchy that were looked at for it.
    pub fn crosses_counted(&self, ray: &Ray, from: f32, to: f32) -> (bool, usize) {
        let aside = ray.direction.any_orthonormal_vector();
        let tilts = [(Vec3::ZERO, MOST_LEAVES), (aside, MOST_TILTED), (ray.direction.cross(aside), MOST_TILTED)];
        let mut leaves = 0;
        for (tilt, most) in tilts {
            let is_tilted = tilt != Vec3::ZERO;
            let tilted = Ray { direction: (ray.direction + tilt * TILT).normalize(), ..*ray };
            let Some((frame, boxes)) = self.prepare(if is_tilted { &tilted } else { ray }) else { break };
            match self.tree.crosses((&frame, &boxes), (from, to), most, &mut leaves) {
                Sightline::Crossed => return (true, leaves),
                Sightline::Clear => break,
                // Another tilt would meet as many.
                Sightline::Crowded if is_tilted => break,
                Sightline::EdgeOn | Sightline::Crowded => {}
            }
        }
        (false, leaves)
    }

    /// The point of the surface closest to `point`; `None` if the surface is empty or `point` is not finite. Of
    /// several triangles equally close, the one with the lowest index.
    pub fn closest_point(&self, point: Vec3) -> Option<SurfacePoint> {
        self.closest_point_within(point, usize::MAX).0
    }

    /// A point of the surface near to `point`, and the number of leaves of the hierarchy (of up to eight triangles each) that
    /// were looked at for it: the answer of [`Surface::closest_point`] if these are fewer than `most`, and the best one of
    /// `most` leaves otherwise, so that the time is bounded where thousands of triangles are equally close, too.
    pub fn closest_point_within(&self, point: Vec3, most: usize) -> (Option<SurfacePoint>, usize) {
        let (found, leaves) = if usable(point) { self.tree.nearest_point(point, most) } else { (None, 0) };
        let found = found.map(|(squared, slot, barycentric)| {
            let (triangle, corners) = self.tree.slot(slot);
            let closest = closest::at(barycentric, corners);
            SurfacePoint { point: closest, triangle, barycentric, distance: squared.sqrt() }
        });
        (found, leaves)
    }

    /// The lowest and highest coordinates; `None` if the surface is empty.
    pub fn bounds(&self) -> Option<(Vec3, Vec3)> {
        let bounds = self.tree.bounds;
        (!bounds.is_empty()).then_some((bounds.low, bounds.high))
    }

    /// Number of triangles in the surface; triangles that were left out are not counted.
    pub fn triangle_count(&self) -> usize {
        self.triangles
    }

    fn prepare(&self, ray: &Ray) -> Option<(Frame, BoxRay)> {
        let frame = Frame::new(ray)?;
        Some((frame, BoxRay::new(&frame, &self.tree.bounds)))
    }
}
