//! Target: the surface of a mesh as samples with normals that point out of its volume.

use glam::Vec3;

use super::clean::CleanMesh;
use crate::mesh::{surface::Surface, voxels::Voxels};

/// Samples of the whole surface.
const SAMPLES: usize = 2200;
/// Distance from the surface at which its two sides are looked at, in cells.
const LOOK: f32 = 1.3;

/// Step of the samples from which the nearest point of the surface is looked for on trial.
const TRIALS: usize = 8;
/// Mean number of leaves of the surface's hierarchy that a trial looks at from which on a surface is crowded. Bodies have three.
const CROWDED: usize = 24;
/// Leaves that a look for the nearest point of a crowded surface takes.
const MOST_LEAVES: usize = 32;

/// Sides of a triangle: inside or outside of the volume.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Facing {
    /// The winding's normal points out.
    Out,
    /// The winding's normal points in.
    In,
    /// Thin sheet: both sides are empty.
    Thin,
    /// Inner wall: both sides are solid.
    Inner,
}

/// A sample of the surface.
#[derive(Debug, Clone, Copy)]
pub(super) struct Sample {
    pub(super) point: Vec3,
    pub(super) normal: Vec3,
    pub(super) thin: bool,
}

/// The surface as samples.
#[derive(Debug, Clone)]
pub(super) struct Target {
    pub(super) samples: Vec<Sample>,
    /// Normal of each triangle that points out, and whether the triangle is a thin sheet; zero for inner walls.
    pub(super) normals: Vec<(Vec3, bool)>,
    areas: Vec<f64>,
    /// Leaves of the surface's hierarchy that a look for the nearest point takes; all but for a crowded surface.
    pub(super) most_leaves: usize,
}

impl Target {
    pub(super) fn new(mesh: &CleanMesh, voxels: &Voxels) -> Self {
        let reach = LOOK * voxels.cell() as f32;
        let core = |p: Vec3| voxels.cell_at(voxels.to_grid(p)).is_some_and(|c| voxels.is_core(c));
        let facing = |p: Vec3, n: Vec3| match (core(p + n * reach), core(p - n * reach)) {
            (false, true) => Facing::Out,
            (true, false) => Facing::In,
            (false, false) => Facing::Thin,
            (true, true) => Facing::Inner,
        };
        let (mut normals, mut areas) =
            (Vec::with_capacity(mesh.triangles.len()), Vec::with_capacity(mesh.triangles.len()));
        for t in &mesh.triangles {
            let [a, b, c] = t.map(|c| mesh.points[c as usize]);
            let cross = (b - a).cross(c - a);
            let normal = cross.normalize_or_zero();
            areas.push(0.5 * f64::from(cross.length()));
            normals.push(match facing((a + b + c) / 3.0, normal) {
                Facing::Out => (normal, false),
                Facing::In => (-normal, false),
                Facing::Thin => (normal, true),
                Facing::Inner => (Vec3::ZERO, false),
            });
        }
        let mut target = Self { samples: Vec::new(), normals, areas, most_leaves: usize::MAX };
        target.samples = target.sampled(mesh, SAMPLES, |_| true);
        target
    }

    /// Bounds the looks for the nearest point where thousands of triangles lie over each other, as those that share one edge or
    /// corner do: no figure is to be seen there, and an exact answer would take time in proportion to the triangles.
    pub(super) fn bound_looks(&mut self, surface: &Surface, voxels: &Voxels) {
        let reach = LOOK * voxels.cell() as f32;
        let (mut leaves, mut looks) = (0, 0);
        for sample in self.samples.iter().step_by(TRIALS) {
            for side in [-reach, reach] {
                leaves += surface.closest_point_within(sample.point + sample.normal * side, 8 * CROWDED).1;
                looks += 1;
            }
        }
        if leaves > CROWDED * looks {
            self.most_leaves = MOST_LEAVES;
        }
    }

    /// Samples spread evenly over the outer triangles that `wanted` takes (by a corner).
    pub(super) fn sampled(&self, mesh: &CleanMesh, count: usize, wanted: impl Fn(Vec3) -> bool) -> Vec<Sample> {
        let takes = |i: usize| self.normals[i].0 != Vec3::ZERO && wanted(mesh.points[mesh.triangles[i][0] as usize]);
        let whole: f64 = (0..self.areas.len()).filter(|&i| takes(i)).map(|i| self.areas[i]).sum();
        if whole.is_nan() || whole <= 0.0 {
            return Vec::new();
        }
        let each = whole / count as f64;
        let mut samples = Vec::with_capacity(count + 8);
        let mut owed = 0.5 * each;
        for i in 0..self.areas.len() {
            if !takes(i) {
                continue;
            }
            owed += self.areas[i];
            while owed >= each {
                owed -= each;
                // Places in the triangle by a sequence of low discrepancy.
                let k = samples.len() as f64 + 0.5;
                let (mut u, mut v) = ((k * 0.754_877_666_246_693) % 1.0, (k * 0.569_840_290_998_053) % 1.0);
                if u + v > 1.0 {
                    (u, v) = (1.0 - u, 1.0 - v);
                }
                let [a, b, c] = mesh.triangles[i].map(|c| mesh.points[c as usize]);
                let point = a + (b - a) * u as f32 + (c - a) * v as f32;
                samples.push(Sample { point, normal: self.normals[i].0, thin: self.normals[i].1 });
            }
        }
        samples
    }
}
