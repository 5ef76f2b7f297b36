//! Geodesic voxel binding: weights from distances measured through the inside of the body.
//!
//! Dionne and de Lasa 2013, "Geodesic voxel binding for production character meshes": the mesh becomes solid voxels,
//! which works for any triangle soup; each bone's distance to the voxels is measured along paths inside the body, so
//! that a hand resting on a thigh is far from it; and weights fall off with that distance. Where the paper runs one
//! search a bone, `labels` runs one for all and keeps the nearest few joints of each voxel.

mod labels;

use glam::Vec3;
use rayon::prelude::*;

use super::{bone::BoneSegment, fill::Unit};
use crate::mesh::{
    model::Weights,
    voxels::{MAX_RESOLUTION, VoxelizeError, Voxels},
};
use labels::{Field, Joints, Limits};

/// Points handled at a time by one thread.
const CHUNK: usize = 1024;
/// More solid cells than this are made fewer and larger, for time and memory.
const MOST_SOLID: usize = 400_000;
/// Radius around a point, in cells, in which a solid cell is looked for when none of the eight nearest is solid.
const SEARCH: isize = 3;
/// Share that a cell of the surface layer counts if its centre lies outside, against one inside: it may belong to a
/// neighbouring finger.
const SHELL_SHARE: f32 = 0.25;
/// Weights below this are left out.
const LEAST: f32 = 1e-3;

/// Settings of [`geodesic_voxel_weights`].
#[derive(Debug, Clone, PartialEq)]
pub struct VoxelSettings {
    /// Cells along the longest side of the body (8 to 1024); coarser where memory or time call for it.
    pub resolution: usize,
    /// Number of the nearest joints that each voxel keeps (1 to 16).
    pub labels: usize,
    /// Falloff of weights with distance: λ in `w = (1 / ((1 - λ) d + λ d²))²`, from 0 (soft) to 1 (rigid).
    pub falloff: f32,
    /// `d` in [`VoxelSettings::falloff`] is the distance over that of the nearest bone, raised to this power (1 to
    /// 8). Relative distances are what makes weights independent of units and limb thickness, but they grow slowly,
    /// and without a power far bones pull too much.
    pub sharpness: u32,
    /// The largest number of influences a point gets.
    pub influences: usize,
}

impl Default for VoxelSettings {
    fn default() -> Self {
        Self { resolution: 160, labels: 4, falloff: 1.0, sharpness: 3, influences: 8 }
    }
}

impl VoxelSettings {
    /// The weight of a bone before normalising, by its distance over that of the nearest bone.
    fn weight(&self, ratio: f32) -> f32 {
        let softness = 1.0 - if self.falloff.is_nan() { 1.0 } else { self.falloff.clamp(0.0, 1.0) };
        // Whole powers by multiplication round the same everywhere.
        let d = (1..self.sharpness.clamp(1, 8)).fold(ratio, |d, _| d * ratio);
        let fall = softness * d + (1.0 - softness) * d * d;
        1.0 / (fall * fall)
    }

    /// The ratio beyond which weights are too small to count, within an eighth.
    fn reach(&self) -> f32 {
        (9..320).map(|i| i as f32 / 8.0).find(|&ratio| self.weight(ratio) < LEAST).unwrap_or(40.0)
    }
}

/// Reason why there are no weights.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum VoxelError {
    /// The mesh cannot be made into voxels.
    #[error(transparent)]
    Mesh(#[from] VoxelizeError),
    /// No bone to bind to.
    #[error("there is no bone with finite ends to bind to; place joints first")]
    NoBones,
    /// The progress callback asked to stop.
    #[error("binding was cancelled")]
    Cancelled,
}

/// Weights of `points` from their distances to the bones, measured through the solid voxels of the mesh.
///
/// `points`, `bones` and the result are in one space, in any unit. Joints of the result are the bones'
/// [`BoneSegment::joint`]; several segments may belong to one joint, whose distance is that of the nearest. A point
/// that no bone reaches (a loose speck, a point far from the surface or from the skeleton) has no influences; all
/// others sum to one. `progress` is called with a share of the work done, 0 to 1, and cancels with `false`.
/// Independent of the number of threads. Cost: voxels times labels, plus points times labels; about 0.1 s for a body.
///
/// # Errors
/// [`VoxelError`]: the mesh has triangles out of range or none at all, there are no bones, or it was cancelled.
pub fn geodesic_voxel_weights(
    points: &[Vec3],
    triangles: &[[u32; 3]],
    bones: &[BoneSegment],
    settings: &VoxelSettings,
    progress: &(dyn Fn(f32) -> bool + Sync),
) -> Result<Weights, VoxelError> {
    let unit = Unit::of(bones.iter().flat_map(|b| [b.head, b.tail]));
    let points = &unit.all(points);
    let bones: Vec<_> =
        bones.iter().map(|b| BoneSegment { head: unit.to(b.head), tail: unit.to(b.tail), ..*b }).collect();
    let joints = Joints::new(&bones);
    let (low, high) = joints.bounds().ok_or(VoxelError::NoBones)?;
    let step = |share: f32| if progress(share) { Ok(()) } else { Err(VoxelError::Cancelled) };
    step(0.0)?;
    // What lies a skeleton's size away from the skeleton is no part of the body and must not cost resolution.
    let reach = (high - low).length();
    let clip = (reach > 0.0).then(|| (low - reach, high + reach));
    let make = |resolution: usize| match Voxels::new(points, triangles, resolution, clip) {
        // Nothing near the skeleton: all there is will do.
        Err(VoxelizeError::NoSurface) => Voxels::new(points, triangles, resolution, None),
        other => other,
    };
    let resolution = settings.resolution.clamp(8, MAX_RESOLUTION);
    let mut voxels = make(resolution)?;
    if voxels.len() > MOST_SOLID {
        // A stout body has far more cells inside than a limb, and needs fewer.
        let share = (MOST_SOLID as f64 / voxels.len() as f64).cbrt();
        voxels = make(((resolution as f64 * share) as usize).max(8))?;
    }
    step(0.2)?;
    let limits = Limits { labels: settings.labels.clamp(1, labels::MOST), ratio: settings.reach() };
    let field =
        Field::new(&voxels, &joints, limits, &|share| progress(0.2 + 0.6 * share)).ok_or(VoxelError::Cancelled)?;
    step(0.8)?;
    let chunks: Vec<Weights> = points
        .par_chunks(CHUNK)
        .map(|chunk| {
            let mut weights = Weights { starts: vec![0], ..Weights::default() };
            let mut sampler = Sampler { voxels: &voxels, field: &field, joints: &joints, settings, found: Vec::new() };
            for &point in chunk {
                weights.push(sampler.weights(point).iter().map(|f| (joints.id(f.joint), f.value)));
            }
            weights
        })
        .collect();
    step(1.0)?;
    let mut weights = Weights { starts: vec![0], ..Weights::default() };
    for chunk in &chunks {
        for point in 0..chunk.len() {
            weights.push(chunk.of(point));
        }
    }
    Ok(weights)
}

/// A joint near a point.
#[derive(Debug, Clone, Copy)]
struct NearJoint {
    joint: u32,
    /// Share of the cells around the point that know the joint.
    share: f32,
    /// Sum of detours (path over straight distance), then the weight.
    value: f32,
}

/// Reads the field at points.
struct Sampler<'a> {
    voxels: &'a Voxels,
    field: &'a Field,
    joints: &'a Joints,
    settings: &'a VoxelSettings,
    found: Vec<NearJoint>,
}

impl Sampler<'_> {
    /// The influences of a point, strongest first, summing to one, or none.
    fn weights(&mut self, point: Vec3) -> &[NearJoint] {
        self.found.clear();
        if !point.is_finite() {
            return &self.found;
        }
        let total = self.gather(point);
        if self.found.is_empty() || total <= 0.0 {
            self.found.clear();
            return &self.found;
        }
        let floor = self.voxels.cell() as f32 * 0.25;
        // Distances to the point itself, not to centres of cells, stretched by the detour that paths take.
        let mut nearest = f32::INFINITY;
        for found in &mut self.found {
            let detour = found.value / found.share;
            found.value = self.joints.distance(found.joint, point).max(floor) * detour;
            nearest = nearest.min(found.value);
        }
        for found in &mut self.found {
            found.value = found.share / total * self.settings.weight(found.value / nearest);
        }
        self.found.sort_by(|a, b| b.value.total_cmp(&a.value).then(a.joint.cmp(&b.joint)));
        self.found.truncate(self.settings.influences.max(1));
        let sum: f32 = self.found.iter().map(|f| f.value).sum();
        self.found.retain(|f| f.value > LEAST * sum);
        let sum: f32 = self.found.iter().map(|f| f.value).sum();
        for found in &mut self.found {
            found.value /= sum;
        }
        &self.found
    }

    /// Collects joints and detours of the cells around a point; returns the weight of those cells.
    fn gather(&mut self, point: Vec3) -> f32 {
        let at = self.voxels.to_grid(point);
        let dims = self.voxels.dims();
        // One cell of slack on each side, then plain casts are safe.
        if !(0..3).all(|a| at[a] >= 1.0 && at[a] < dims[a] as f64 - 1.0) {
            return 0.0;
        }
        let base = at.map(|g| (g - 0.5).floor());
        let mut total = 0.0;
        for corner in 0..8 {
            let step = [corner & 1, corner >> 1 & 1, corner >> 2 & 1];
            let cell = [0, 1, 2].map(|a| base[a] as usize + step[a]);
            let mut share = 1.0;
            for a in 0..3 {
                let high = (at[a] - 0.5 - base[a]) as f32;
                share *= if step[a] == 1 { high } else { 1.0 - high };
            }
            // A cell that the point only just touches would divide by zero below.
            if share > 1e-6 {
                total += self.add(cell, share);
            }
        }
        if total > 0.0 {
            return total;
        }
        self.found.clear();
        let middle = at.map(|g| g as isize);
        let mut best: Option<(f64, [usize; 3])> = None;
        for dz in -SEARCH..=SEARCH {
            for dy in -SEARCH..=SEARCH {
                for dx in -SEARCH..=SEARCH {
                    let cell = [middle[0] + dx, middle[1] + dy, middle[2] + dz];
                    if cell.iter().any(|&c| c < 0) {
                        continue;
                    }
                    let cell = cell.map(|c| c as usize);
                    let known = self.voxels.solid_index(cell).is_some_and(|i| self.field.is_reached(i));
                    let far: f64 = (0..3).map(|a| (cell[a] as f64 + 0.5 - at[a]).powi(2)).sum();
                    if known && best.is_none_or(|(least, _)| far < least) {
                        best = Some((far, cell));
                    }
                }
            }
        }
        best.map_or(0.0, |(_, cell)| self.add(cell, 1.0))
    }

    /// Adds what a cell knows; returns its weight, 0 if it knows nothing.
    fn add(&mut self, cell: [usize; 3], share: f32) -> f32 {
        let Some(index) = self.voxels.solid_index(cell).filter(|&i| self.field.is_reached(i)) else { return 0.0 };
        let share = if self.voxels.is_core(cell) { share } else { share * SHELL_SHARE };
        let center = self.voxels.center(cell);
        for (joint, cost) in self.field.of(index) {
            let detour = self.joints.detour(joint, center, cost, self.voxels.cell() as f32);
            match self.found.iter_mut().find(|f| f.joint == joint) {
                Some(found) => {
                    found.share += share;
                    found.value += share * detour;
                }
                None => self.found.push(NearJoint { joint, share, value: share * detour }),
            }
        }
        share
    }
}
