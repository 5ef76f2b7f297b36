//! Picking: the joint that a click refers to.
//!
//! A click picks the joint nearest in space to the first hit of its ray on the mesh (Pencil Rigger, section 3.1), so
//! small joints are easy to hit. Clicking the same spot again cycles through the next nearest joints, which that paper
//! leaves to the future. If the ray misses the mesh, distances are measured on the view plane instead.

mod pick_tree;

use std::collections::HashSet;

use glam::{Vec2, Vec3};

pub use self::pick_tree::PickTree;
use super::view::ViewPlane;
use crate::mesh::surface::Surface;

/// The joints that a click at `point` may pick, nearest first; empty only without joints.
///
/// `joints` are positions in the surface's space; joints that are not finite are never picked. `reach` is a length in
/// model units (some pixels at the current zoom): the list holds the nearest joint, the next nearest, and all joints
/// within twice the nearest one's distance plus `reach`. One ray; O(joints · log joints).
pub fn candidates(surface: &Surface, plane: &ViewPlane, point: Vec2, joints: &[Vec3], reach: f32) -> Vec<usize> {
    let ray = plane.ray(point);
    let mut hits = Vec::new();
    surface.hits(&ray, &mut hits);
    candidates_at(hits.first().map(|hit| ray.at(hit.distance)), plane, point, joints, reach)
}

/// Candidates as [`candidates`] gives them, for a known first hit of the ray.
pub fn candidates_at(
    first_hit: Option<Vec3>,
    plane: &ViewPlane,
    point: Vec2,
    joints: &[Vec3],
    reach: f32,
) -> Vec<usize> {
    match first_hit {
        Some(hit) => nearest(joints.iter().map(|joint| joint.distance(hit)), reach),
        None => nearest_on_plane(plane, point, joints, reach),
    }
}

/// Candidates as [`candidates`] gives them, measured on the view plane: for a click beside the mesh.
pub fn nearest_on_plane(plane: &ViewPlane, point: Vec2, joints: &[Vec3], reach: f32) -> Vec<usize> {
    let distance = |joint: &Vec3| plane.project(*joint).map_or(f32::NAN, |place| place.distance(point));
    nearest(joints.iter().map(distance), reach)
}

/// Indices of the joints whose place on the view plane lies in the box between two opposite `corners`, rising.
pub fn in_box(plane: &ViewPlane, corners: [Vec2; 2], joints: &[Vec3]) -> Vec<usize> {
    let (low, high) = (corners[0].min(corners[1]), corners[0].max(corners[1]));
    let inside = |place: Vec2| place.cmpge(low).all() && place.cmple(high).all();
    (0..joints.len()).filter(|&i| plane.project(joints[i]).is_some_and(inside)).collect()
}

/// Indices by rising distance up to the limit; equal distances by index.
fn nearest(distances: impl Iterator<Item = f32>, reach: f32) -> Vec<usize> {
    in_order(distances.enumerate().map(|(i, d)| (d, i)).filter(|(d, _)| d.is_finite()).collect(), reach)
}

/// Indices by rising distance up to the limit that follows from the least of them; equal distances by index.
fn in_order(mut order: Vec<(f32, usize)>, reach: f32) -> Vec<usize> {
    order.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    let limit = order.first().map_or(0.0, |&(least, _)| limit(least, reach));
    // The second nearest is always included, so that a second click always has an effect.
    let near = order.partition_point(|&(d, _)| d <= limit).max(2).min(order.len());
    order.into_iter().take(near).map(|(_, i)| i).collect()
}

/// Furthest distance of a candidate where the nearest joint is so far.
fn limit(least: f32, reach: f32) -> f32 {
    2.0 * least + reach.max(0.0)
}

/// State of repeated clicks: a click at the same spot as the last one picks the next joint.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct PickCycle {
    last: Option<(Vec2, Vec<usize>, usize)>,
}

impl PickCycle {
    /// The joint that a click at `point` picks from `candidates` (nearest first).
    ///
    /// A click within `same_spot` of the last one, with the same candidates in any order, picks the candidate after the
    /// last picked one in the order of the first click, and starts over after the furthest. Any other click picks the
    /// nearest.
    pub fn click(&mut self, point: Vec2, same_spot: f32, candidates: &[usize]) -> Option<usize> {
        let next = self.next(point, same_spot, candidates);
        match (&mut self.last, next) {
            (Some((_, _, picked)), Some(next)) => *picked = next,
            _ => self.last = candidates.first().map(|_| (point, candidates.to_vec(), 0)),
        }
        self.last.as_ref().map(|(_, order, picked)| order[*picked])
    }

    /// The joint that [`PickCycle::click`] would pick.
    pub fn peek(&self, point: Vec2, same_spot: f32, candidates: &[usize]) -> Option<usize> {
        match (&self.last, self.next(point, same_spot, candidates)) {
            (Some((_, order, _)), Some(next)) => Some(order[next]),
            _ => candidates.first().copied(),
        }
    }

    /// True if a click at `point` is at the same spot as the last one.
    pub fn is_at(&self, point: Vec2, same_spot: f32) -> bool {
        self.last.as_ref().is_some_and(|(spot, ..)| spot.distance(point) <= same_spot)
    }

    /// The index in the order of the last click that the next click picks; `None` if it is not at the same spot.
    fn next(&self, point: Vec2, same_spot: f32, candidates: &[usize]) -> Option<usize> {
        let (_, order, picked) = self.last.as_ref()?;
        let same = self.is_at(point, same_spot)
            && order.len() == candidates.len()
            && (order == candidates || is_among(order, candidates));
        (same && !order.is_empty()).then(|| (picked + 1) % order.len())
    }

    /// Forgets the last click: after an edit, a change of view or a deselection.
    pub fn reset(&mut self) {
        self.last = None;
    }
}

/// True if all joints are among others.
fn is_among(joints: &[usize], others: &[usize]) -> bool {
    let others: HashSet<usize> = others.iter().copied().collect();
    joints.iter().all(|joint| others.contains(joint))
}
