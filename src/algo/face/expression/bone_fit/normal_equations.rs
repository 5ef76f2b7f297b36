//! Normal equations of the bones' motions: least squares over samples of the skin.
//!
//! A bone's motion has six unknowns, its shift and a small turn. The skin of a sample moves by
//! `Σ w (shift + turn × arm)`, where `w` is the weight of a bone and `arm` the way from the bone to the sample.

use glam::{DMat3, DVec3};

use super::samples::{Mark, Sample};

/// Weight of the pull of a bone's shift towards the mean of the field over its patch, as a share of the patch's weight.
const HOLD: f64 = 0.02;
/// Weight of the pull of a bone's turn towards none, as a share of the patch's weight.
const UPRIGHT: f64 = 0.02;
/// Stiffness between the shifts of bones with common skin.
const STIFF: f64 = 0.01;
/// Unknowns of a bone.
const UNKNOWNS: usize = 6;

/// Motion of a skin bone.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct Motion {
    /// Movement, in units of the mesh.
    pub shift: DVec3,
    /// Turn about the bone's own position: the axis, as long as the angle in radians.
    pub turn: DVec3,
}

impl Motion {
    /// Adds another motion, scaled.
    pub fn add(&mut self, other: &Self, share: f64) {
        self.shift += other.shift * share;
        self.turn += other.turn * share;
    }
}

/// Normal equations with fixed weights, factorised once for all right-hand sides.
#[derive(Default)]
pub(super) struct NormalEquations {
    bones: usize,
    /// Length that a turn of one radian counts as.
    length: f64,
    /// The Cholesky factor, L in the lower triangle.
    factor: Vec<f64>,
}

impl NormalEquations {
    /// Sums and factorises the equations of `bones` skin bones. A turn of one radian counts as a shift of `length`.
    pub fn new(samples: &[Sample], bones: usize, length: f64) -> Self {
        let size = bones * UNKNOWNS;
        let mut matrix = vec![0.0; size * size];
        let mut patch = vec![0.0; bones];
        let mut common = vec![0.0; bones * bones];
        for sample in samples {
            for a in &sample.influences {
                let (at, arm) = (a.unknown as usize, a.arm / length);
                if sample.minus.is_none() {
                    patch[at] += sample.counts * a.weight;
                }
                for b in sample.influences.iter().filter(|b| b.unknown <= a.unknown) {
                    let (other, other_arm) = (b.unknown as usize, b.arm / length);
                    let both = sample.counts * a.weight * b.weight;
                    common[at * bones + other] += both;
                    if at != other {
                        common[other * bones + at] += both;
                    }
                    let mut block = |row: usize, column: usize, values: DMat3| {
                        for i in 0..3 {
                            for j in 0..3 {
                                let index = (at * UNKNOWNS + row + i) * size + other * UNKNOWNS + column + j;
                                matrix[index] += sample.counts * values.col(j)[i];
                            }
                        }
                    };
                    block(0, 0, DMat3::from_diagonal(DVec3::splat(a.weight * b.weight)));
                    block(0, 3, -cross(other_arm) * a.weight);
                    block(3, 0, cross(arm) * b.weight);
                    block(3, 3, -(cross(arm) * cross(other_arm)));
                }
            }
        }
        let floor = 1e-6 / bones.max(1) as f64;
        let mut add = |row: usize, column: usize, value: f64| {
            for axis in 0..3 {
                matrix[(row * UNKNOWNS + axis) * size + column * UNKNOWNS + axis] += value;
            }
        };
        for a in 0..bones {
            add(a, a, HOLD * patch[a] + floor);
            for b in (0..bones).filter(|b| *b != a) {
                add(a, a, STIFF * common[a * bones + b]);
                if b < a {
                    add(a, b, -STIFF * common[a * bones + b]);
                }
            }
        }
        for (a, patch) in patch.iter().enumerate() {
            for axis in 3..UNKNOWNS {
                let index = a * UNKNOWNS + axis;
                matrix[index * size + index] += UPRIGHT * patch + floor;
            }
        }
        factorise(&mut matrix, size);
        Self { bones, length, factor: matrix }
    }

    /// Motions of the skin bones whose skin follows a displacement best.
    ///
    /// `targets` has a displacement for each sample, for pairs the difference of the displacements of its two ends.
    pub fn motions(&self, samples: &[Sample], targets: impl Iterator<Item = DVec3>) -> Vec<Motion> {
        let mut right = vec![0.0; self.bones * UNKNOWNS];
        for (sample, target) in samples.iter().zip(targets) {
            // The mean of the field over a bone's patch is a target of the shift, too.
            let hold = if sample.minus.is_none() { HOLD } else { 0.0 };
            for influence in &sample.influences {
                let shift = target * (sample.counts * influence.weight * (1.0 + hold));
                let turn = (influence.arm / self.length).cross(target) * sample.counts;
                let at = influence.unknown as usize * UNKNOWNS;
                for axis in 0..3 {
                    right[at + axis] += shift[axis];
                    right[at + 3 + axis] += turn[axis];
                }
            }
        }
        substitute(&self.factor, &mut right);
        let (bones, _) = right.as_chunks::<UNKNOWNS>();
        let motion = |[x, y, z, a, b, c]: &[f64; UNKNOWNS]| Motion {
            shift: DVec3::new(*x, *y, *z),
            turn: DVec3::new(*a, *b, *c) / self.length,
        };
        bones.iter().map(motion).collect()
    }
}

/// Displacement of a sample by motions of the skin bones, for pairs the difference of its two ends.
pub(super) fn moved(sample: &Sample, motions: &[Motion]) -> DVec3 {
    let by = |influence: &super::samples::Influence| {
        let motion = motions.get(influence.unknown as usize).copied().unwrap_or_default();
        motion.shift * influence.weight + motion.turn.cross(influence.arm)
    };
    sample.influences.iter().map(by).sum()
}

/// Target of a sample under a displacement field.
pub(super) fn target(sample: &Sample, displacement: impl Fn(&Mark) -> DVec3) -> DVec3 {
    let own = displacement(&sample.mark);
    sample.minus.as_ref().map_or(own, |minus| own - displacement(minus))
}

/// The matrix of the cross product `v × ·`.
fn cross(v: DVec3) -> DMat3 {
    DMat3::from_cols(DVec3::new(0.0, v.z, -v.y), DVec3::new(-v.z, 0.0, v.x), DVec3::new(v.y, -v.x, 0.0))
}

/// Factorises a symmetric positive matrix in place, L in the lower triangle. A pivot lost to rounding becomes 1.
fn factorise(matrix: &mut [f64], size: usize) {
    for row in 0..size {
        let (before, rest) = matrix.split_at_mut(row * size);
        for column in 0..=row {
            let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
            if row == column {
                let sum = rest[row] - dot(&rest[..row], &rest[..row]);
                rest[row] = if sum > 0.0 { sum.sqrt() } else { 1.0 };
            } else {
                let other = &before[column * size..column * size + column + 1];
                rest[column] = (rest[column] - dot(&rest[..column], other)) / other[column];
            }
        }
    }
}

/// Solves for a right-hand side, in place.
fn substitute(factor: &[f64], right: &mut [f64]) {
    let size = right.len();
    for row in 0..size {
        let own = &factor[row * size..row * size + row + 1];
        let sum: f64 = own.iter().zip(right.iter()).take(row).map(|(entry, value)| entry * value).sum();
        right[row] = (right[row] - sum) / own[row];
    }
    for row in (0..size).rev() {
        let own = &factor[row * size..row * size + row + 1];
        let value = right[row] / own[row];
        right[row] = value;
        for (right, entry) in right.iter_mut().zip(own).take(row) {
            *right -= value * entry;
        }
    }
}
