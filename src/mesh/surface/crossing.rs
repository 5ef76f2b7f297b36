//! Crossing test of a ray and a triangle, without gaps between neighbours.
//!
//! After Woop, Benthin and Wald, "Watertight Ray/Triangle Intersection" (JCGT 2013): vertices are sheared so that the
//! ray becomes the third axis, which maps a vertex to the same two coordinates whatever triangle it is in; the sign of
//! three edge functions then decides. We compute the signs exactly and break ties by moving the ray an infinitesimal
//! step (ε, ε²), so that a ray through an edge or a vertex meets exactly one side, and a closed mesh is entered exactly
//! as often as it is left.

use glam::Vec3;

use crate::mesh::ray::{Hit, Ray};

/// Largest usable coordinate: products of two coordinates must stay finite.
pub(super) const LIMIT: f32 = 1e18;

/// Relative size of the errors of a sheared vertex, with a margin: boxes are tested with this much slack.
pub(super) const SLACK: f32 = 1.0 / (1 << 19) as f32;

/// Returns `true` if all coordinates are numbers of usable size.
pub(super) fn usable(point: Vec3) -> bool {
    // Written so that NaN fails.
    point.abs().max_element() <= LIMIT && !point.is_nan()
}

/// A ray prepared for many triangles.
#[derive(Debug, Clone, Copy)]
pub(super) struct Frame {
    /// Start of the ray.
    pub origin: Vec3,
    /// Direction of the ray, of any length but zero.
    pub direction: Vec3,
    /// The axes of the sheared space; the last is the longest of the direction.
    pub axes: [usize; 3],
    /// Factors of the third coordinate to subtract from the first two.
    pub shear: [f32; 2],
}

/// A crossing before crossings at a shared edge or corner are merged.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Crossing {
    /// Distance along the ray.
    pub distance: f64,
    /// The triangle, as the caller numbers them.
    pub triangle: u32,
    /// Slot of the triangle in the caller's storage.
    pub slot: u32,
    /// Direction of the crossing: `true` if the ray goes in.
    pub entering: bool,
    /// Distances less than this apart may be the same crossing.
    pub tolerance: f32,
}

impl Crossing {
    /// Sort key: distance along the ray, then triangle.
    pub fn key(&self) -> (f64, u32) {
        (self.distance, self.triangle)
    }

    /// The crossing as callers see it.
    pub fn hit(&self) -> Hit {
        Hit { distance: self.distance as f32, triangle: self.triangle, entering: self.entering }
    }
}

impl Frame {
    /// Prepares `ray`; `None` if it is not finite or goes nowhere.
    pub fn new(ray: &Ray) -> Option<Self> {
        let size = ray.direction.abs();
        let z = size.max_position();
        if !usable(ray.origin) || ray.direction.is_nan() || !(1e-9..=1e9).contains(&size[z]) {
            return None;
        }
        let axes = [(z + 1) % 3, (z + 2) % 3, z];
        let shear = [ray.direction[axes[0]] / ray.direction[z], ray.direction[axes[1]] / ray.direction[z]];
        Some(Self { origin: ray.origin, direction: ray.direction, axes, shear })
    }

    /// Crossing of the ray and the triangle: distance, whether it enters, and the largest distance of a corner from the
    /// origin.
    pub fn cross(&self, corners: [Vec3; 3]) -> Option<(f64, bool, f32)> {
        let z = self.axes[2];
        let flat = corners.map(|corner| self.flat(corner));
        let (u, u_side) = side(flat[1], flat[2]);
        let (v, v_side) = side(flat[2], flat[0]);
        let (w, w_side) = side(flat[0], flat[1]);
        if u_side != v_side || v_side != w_side || w_side == 0 {
            return None;
        }
        let depth = corners.map(|corner| f64::from(corner[z]) - f64::from(self.origin[z]));
        let along = f64::from(self.direction[z]);
        let distance = (u * depth[0] + v * depth[1] + w * depth[2]) / (u + v + w) / along;
        if distance.is_nan() || distance < 0.0 {
            return None;
        }
        let reach = corners.iter().fold(0.0, |reach: f32, &c| reach.max((c - self.origin).abs().max_element()));
        Some((distance, (w_side > 0) != (along > 0.0), SLACK * reach / along.abs() as f32))
    }

    /// True if the ray lies in the plane of the triangle, or the triangle is none.
    pub fn is_edge_on(&self, corners: [Vec3; 3]) -> bool {
        let [a, b, c] = corners.map(|corner| self.flat(corner));
        [(a, b), (b, c), (c, a)].into_iter().all(|(a, b)| side(a, b).0 == 0.0)
    }

    /// Coordinates of a corner across the ray.
    fn flat(&self, corner: Vec3) -> [f32; 2] {
        let [x, y, z] = self.axes;
        let from = corner - self.origin;
        [from[x] - self.shear[0] * from[z], from[y] - self.shear[1] * from[z]]
    }
}

/// Twice the area of the triangle of the origin and the edge `a` → `b`, and the side of the edge on which the origin
/// lies: never zero unless the ends coincide, and exactly opposite for the opposite edge.
fn side(a: [f32; 2], b: [f32; 2]) -> (f64, i32) {
    // Products of two f32 are exact in f64, so the sign of their difference is as well.
    let area = f64::from(a[0]) * f64::from(b[1]) - f64::from(a[1]) * f64::from(b[0]);
    let sign = |positive: bool, negative: bool| i32::from(positive) - i32::from(negative);
    let mut side = sign(area > 0.0, area < 0.0);
    if side == 0 {
        side = sign(a[1] > b[1], a[1] < b[1]);
    }
    if side == 0 {
        side = sign(b[0] > a[0], b[0] < a[0]);
    }
    (area, side)
}

/// Sorts crossings and writes them as hits; a crossing that several triangles share becomes one hit.
///
/// Crossings at one place whose triangles share a corner cancel in pairs of opposite directions while more than one is
/// left; a touch, which goes in and out at one place, stays as two hits in the order that continues the ones before.
pub(super) fn resolve(crossings: &mut [Crossing], corners: impl Fn(u32) -> [Vec3; 3], out: &mut Vec<Hit>) {
    out.clear();
    crossings.sort_unstable_by(|a, b| a.distance.total_cmp(&b.distance).then(a.triangle.cmp(&b.triangle)));
    let mut rest = &crossings[..];
    while let Some(first) = rest.first() {
        let mut len = 1;
        while len < rest.len()
            && rest[len].distance - rest[len - 1].distance
                <= f64::from(rest[len].tolerance.min(rest[len - 1].tolerance))
            && rest[..len].iter().any(|other| touch(&corners(other.slot), &corners(rest[len].slot)))
        {
            len += 1;
        }
        let (group, after) = rest.split_at(len);
        rest = after;
        if let [only] = group {
            out.push(only.hit());
            continue;
        }
        let ins = group.iter().filter(|c| c.entering).count();
        let outs = group.len() - ins;
        let (ins, outs) = if ins == outs { (1, 1) } else { (ins.saturating_sub(outs), outs.saturating_sub(ins)) };
        let inside = out.last().is_some_and(|hit| hit.entering);
        let start = out.len();
        for entering in [!inside, inside] {
            let count = if entering { ins } else { outs };
            out.extend(group.iter().filter(|c| c.entering == entering).take(count).map(Crossing::hit));
        }
        out[start].distance = first.distance as f32;
    }
    // Swapping a touch may have put its farther half first.
    let mut least = 0.0_f32;
    for hit in out.iter_mut() {
        least = least.max(hit.distance);
        hit.distance = least;
    }
}

/// Returns `true` if two triangles have a corner in common, by position.
fn touch(a: &[Vec3; 3], b: &[Vec3; 3]) -> bool {
    a.iter().any(|a| b.contains(a))
}
