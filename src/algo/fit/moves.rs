//! Rigid transforms of all bones, given the weights.
//!
//! Everything that the transforms depend on is a sum over points of weight times weight times position times position
//! (one 4×4 block for each pair of bones that share points), or of weight times position times displacement. With these
//! sums at hand, the cost of a round no longer depends on the number of points. Bones move in two ways: one after the
//! other to the best transform for the residual of the others (Le and Deng 2012, "Smooth skinning decomposition with
//! rigid bones", section 4.2), and all at once by Gauss-Newton steps, whose equations are solved by conjugate
//! gradients; the former never fails, the latter converges where bones overlap widely.

use glam::{DMat3, DVec3};
use rayon::prelude::*;

use super::{
    problem::{LANES, Problem},
    rotation::{best_rotation, orthonormal, turn},
};

/// A rigid transform about the origin: `rotation * p + translation`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Rigid {
    pub rotation: DMat3,
    pub translation: DVec3,
}

impl Rigid {
    pub const IDENTITY: Self = Self { rotation: DMat3::IDENTITY, translation: DVec3::ZERO };

    /// Displacement of a point as a linear map of `(x, y, z, 1)`: the images of the four unit vectors.
    pub fn map(&self) -> Map {
        let [x, y, z] = [self.rotation.x_axis, self.rotation.y_axis, self.rotation.z_axis];
        [x - DVec3::X, y - DVec3::Y, z - DVec3::Z, self.translation]
    }
}

/// A linear map from `(x, y, z, 1)` to 3-D.
pub(super) type Map = [DVec3; 4];

/// A symmetric 4×4 matrix: xx, yy, zz, xy, xz, yz, x, y, z, 1.
pub(super) type Square = [f64; 10];

/// The products of `(x, y, z, 1)` with itself.
pub(super) fn square(p: DVec3) -> Square {
    [p.x * p.x, p.y * p.y, p.z * p.z, p.x * p.y, p.x * p.z, p.y * p.z, p.x, p.y, p.z, 1.0]
}

fn times(w: &Square, u: &Map) -> Map {
    [
        u[0] * w[0] + u[1] * w[3] + u[2] * w[4] + u[3] * w[6],
        u[0] * w[3] + u[1] * w[1] + u[2] * w[5] + u[3] * w[7],
        u[0] * w[4] + u[1] * w[5] + u[2] * w[2] + u[3] * w[8],
        u[0] * w[6] + u[1] * w[7] + u[2] * w[8] + u[3] * w[9],
    ]
}

/// Influences of each moving point: bone (the head is not among them) and weight.
pub(super) type Influences = [Vec<(u32, f64)>];

/// The sums over points that the transforms depend on.
pub(super) struct Moments {
    /// Bones that share points with each bone, itself first, and their blocks.
    pairs: Vec<Vec<(u32, Square)>>,
    /// Sums of weight times position times displacement, for each bone and shape.
    targets: Vec<Vec<Map>>,
    /// Mean position of each bone's points (by squared weight).
    centers: Vec<DVec3>,
    /// Spread of each bone's points about it (squared, by axis).
    spread: Vec<DMat3>,
    /// Squared displacements of each shape.
    energy: Vec<f64>,
    shapes: usize,
}

impl Moments {
    /// Sums over all moving points. `stiffness` holds a bone at rest, as a share of its own mass.
    pub fn new(problem: &Problem, influences: &Influences, bones: usize, stiffness: f64) -> Self {
        let mut members = vec![Vec::new(); bones];
        for (point, row) in influences.iter().enumerate() {
            row.iter().for_each(|&(bone, weight)| members[bone as usize].push((point as u32, weight)));
        }
        let shapes = problem.shapes;
        let (pairs, targets): (Vec<_>, Vec<_>) = members
            .par_iter()
            .enumerate()
            .map(|(bone, members)| {
                (blocks(problem, influences, bones, bone, members, stiffness), targets(problem, members))
            })
            .unzip();
        let mut energy = vec![0.0; shapes];
        for point in 0..problem.points.len() {
            for (sum, d) in energy.iter_mut().zip(problem.row(point).chunks_exact(3)) {
                *sum += d.iter().map(|&d| f64::from(d) * f64::from(d)).sum::<f64>();
            }
        }
        let own = |bone: &Vec<(u32, Square)>| bone[0].1;
        let centers: Vec<DVec3> = pairs.iter().map(|bone| center(&own(bone))).collect();
        let spread = pairs.iter().map(|bone| covariance(&own(bone))).collect();
        Self { pairs, targets, centers, spread, energy, shapes }
    }

    /// Weight of a bone, and the mean position of its points.
    pub fn center(&self, bone: usize) -> (f64, DVec3) {
        (self.pairs[bone][0].1[9], self.centers[bone])
    }

    /// Improves the transforms of all bones (`moves[bone][shape]`): `sweeps` times one after the other, then `steps`
    /// times all at once. Returns the remaining sum of squared distances.
    pub fn improve(&self, moves: &mut [Vec<Rigid>], sweeps: usize, steps: usize) -> f64 {
        let bones = moves.len();
        let solved: Vec<(Vec<Rigid>, f64)> = (0..self.shapes)
            .into_par_iter()
            .map(|shape| {
                let mut rigid: Vec<Rigid> = (0..bones).map(|bone| moves[bone][shape]).collect();
                let mut maps: Vec<Map> = rigid.iter().map(Rigid::map).collect();
                for _ in 0..sweeps {
                    self.sweep(shape, &mut rigid, &mut maps);
                }
                for _ in 0..steps {
                    if !self.step(shape, &mut rigid, &mut maps) {
                        break;
                    }
                }
                let cost = self.cost(shape, &maps);
                (rigid, cost)
            })
            .collect();
        let mut total = 0.0;
        for (shape, (rigid, cost)) in solved.into_iter().enumerate() {
            rigid.into_iter().enumerate().for_each(|(bone, rigid)| moves[bone][shape] = rigid);
            total += cost;
        }
        total
    }

    /// The sum of squared distances of one shape, plus the cost of holding bones at rest.
    fn cost(&self, shape: usize, maps: &[Map]) -> f64 {
        let mut sum = self.energy[shape];
        for (bone, map) in maps.iter().enumerate() {
            let pulled = self.apply(bone, maps);
            let target = &self.targets[bone][shape];
            sum += (0..4).map(|a| map[a].dot(pulled[a] - target[a] * 2.0)).sum::<f64>();
        }
        sum
    }

    /// Product of one row of blocks and a vector.
    fn apply(&self, bone: usize, maps: &[Map]) -> Map {
        let mut sum = [DVec3::ZERO; 4];
        for (other, block) in &self.pairs[bone] {
            let part = times(block, &maps[*other as usize]);
            (0..4).for_each(|a| sum[a] += part[a]);
        }
        sum
    }

    /// Gives each bone in turn its best transform for the residual of the others.
    fn sweep(&self, shape: usize, rigid: &mut [Rigid], maps: &mut [Map]) {
        for bone in 0..rigid.len() {
            let mass = self.pairs[bone][0].1[9];
            if mass <= 0.0 {
                continue;
            }
            let own = &self.pairs[bone][0].1;
            let mut left = self.targets[bone][shape];
            for (other, block) in &self.pairs[bone][1..] {
                let part = times(block, &maps[*other as usize]);
                (0..4).for_each(|a| left[a] -= part[a]);
            }
            // Displacements become positions.
            let rest = times(own, &[DVec3::X, DVec3::Y, DVec3::Z, DVec3::ZERO]);
            (0..4).for_each(|a| left[a] += rest[a]);
            let center = self.centers[bone];
            let wanted = left[3] / mass;
            let turned = [0, 1, 2].map(|a| left[a] - left[3] * center[a]);
            let rotation = best_rotation(turned, rigid[bone].rotation);
            rigid[bone] = Rigid { rotation, translation: wanted - rotation * center };
            maps[bone] = rigid[bone].map();
        }
    }

    /// Takes one Gauss-Newton step of all bones of a shape; returns `false` if it does not improve the cost.
    fn step(&self, shape: usize, rigid: &mut [Rigid], maps: &mut [Map]) -> bool {
        let bones = rigid.len();
        let pivots: Vec<DVec3> = (0..bones).map(|bone| rigid[bone].rotation * self.centers[bone]).collect();
        // A turn about the bone's moved centre and a shift, as a map, and the transpose of that map.
        let lift = |bone: usize, [omega, tau]: [DVec3; 2]| -> Map {
            let r = &rigid[bone].rotation;
            [omega.cross(r.x_axis), omega.cross(r.y_axis), omega.cross(r.z_axis), tau - omega.cross(pivots[bone])]
        };
        let lower = |bone: usize, z: &Map| -> [DVec3; 2] {
            let r = &rigid[bone].rotation;
            let turned = r.x_axis.cross(z[0]) + r.y_axis.cross(z[1]) + r.z_axis.cross(z[2]);
            [turned - pivots[bone].cross(z[3]), z[3]]
        };
        let conditions: Vec<(DMat3, f64)> = (0..bones)
            .map(|bone| {
                let mass = self.pairs[bone][0].1[9].max(1e-30);
                let r = rigid[bone].rotation;
                let spread = r * self.spread[bone] * r.transpose();
                let trace = spread.x_axis.x + spread.y_axis.y + spread.z_axis.z;
                let inertia = DMat3::from_diagonal(DVec3::splat(trace * 1.000_001 + 1e-30)) - spread;
                (inertia.inverse(), 1.0 / mass)
            })
            .collect();
        let mut residual: Vec<[DVec3; 2]> = (0..bones)
            .map(|bone| {
                let pulled = self.apply(bone, maps);
                let target = &self.targets[bone][shape];
                lower(bone, &[0, 1, 2, 3].map(|a| target[a] - pulled[a]))
            })
            .collect();
        let condition = |residual: &[[DVec3; 2]]| -> Vec<[DVec3; 2]> {
            residual.iter().zip(&conditions).map(|(r, (turn, shift))| [*turn * r[0], r[1] * *shift]).collect()
        };
        let dot = |a: &[[DVec3; 2]], b: &[[DVec3; 2]]| -> f64 {
            a.iter().zip(b).map(|(a, b)| a[0].dot(b[0]) + a[1].dot(b[1])).sum()
        };
        let mut step = vec![[DVec3::ZERO; 2]; bones];
        let mut conditioned = condition(&residual);
        let mut direction = conditioned.clone();
        let mut size = dot(&residual, &conditioned);
        let first = size;
        for _ in 0..40 {
            if !(size > first * 1e-4 && size > 0.0) {
                break;
            }
            let lifted: Vec<Map> = direction.iter().enumerate().map(|(bone, d)| lift(bone, *d)).collect();
            let pulled: Vec<[DVec3; 2]> = (0..bones).map(|bone| lower(bone, &self.apply(bone, &lifted))).collect();
            let bend = dot(&direction, &pulled);
            if bend.is_nan() || bend <= 0.0 {
                break;
            }
            let length = size / bend;
            for bone in 0..bones {
                for k in 0..2 {
                    step[bone][k] += direction[bone][k] * length;
                    residual[bone][k] -= pulled[bone][k] * length;
                }
            }
            conditioned = condition(&residual);
            let next = dot(&residual, &conditioned);
            let share = next / size;
            size = next;
            for bone in 0..bones {
                (0..2).for_each(|k| direction[bone][k] = conditioned[bone][k] + direction[bone][k] * share);
            }
        }
        let before = self.cost(shape, maps);
        for share in [1.0, 0.5, 0.2] {
            let tried: Vec<Rigid> = (0..bones)
                .map(|bone| {
                    let [omega, tau] = step[bone].map(|v| v * share);
                    let Rigid { rotation, translation } = rigid[bone];
                    let turned = orthonormal(turn(omega) * rotation);
                    let place = pivots[bone] + translation + tau;
                    Rigid { rotation: turned, translation: place - turned * self.centers[bone] }
                })
                .collect();
            let lifted: Vec<Map> = tried.iter().map(Rigid::map).collect();
            if self.cost(shape, &lifted) < before {
                rigid.copy_from_slice(&tried);
                maps.copy_from_slice(&lifted);
                return true;
            }
        }
        false
    }
}

fn center(own: &Square) -> DVec3 {
    if own[9] > 0.0 { DVec3::new(own[6], own[7], own[8]) / own[9] } else { DVec3::ZERO }
}

/// The second moments about the centre, not divided by the mass.
fn covariance(own: &Square) -> DMat3 {
    let c = center(own);
    let about = |k: usize, a: usize, b: usize| own[k] - own[9] * c[a] * c[b];
    let (xy, xz, yz) = (about(3, 0, 1), about(4, 0, 2), about(5, 1, 2));
    DMat3::from_cols(
        DVec3::new(about(0, 0, 0), xy, xz),
        DVec3::new(xy, about(1, 1, 1), yz),
        DVec3::new(xz, yz, about(2, 2, 2)),
    )
}

/// The blocks of one bone, its own first, with its stiffness.
fn blocks(
    problem: &Problem,
    influences: &Influences,
    bones: usize,
    bone: usize,
    members: &[(u32, f64)],
    stiffness: f64,
) -> Vec<(u32, Square)> {
    let mut sums = vec![None::<Square>; bones];
    for &(point, weight) in members {
        let products = square(problem.points[point as usize]);
        for &(other, share) in &influences[point as usize] {
            let sum = sums[other as usize].get_or_insert([0.0; 10]);
            let both = weight * share;
            sum.iter_mut().zip(&products).for_each(|(sum, p)| *sum += both * p);
        }
    }
    let mut own = sums[bone].take().unwrap_or([0.0; 10]);
    let (c, spread) = (center(&own), covariance(&own));
    let held = own[9] * stiffness;
    if held > 0.0 {
        // The stiffness is that of the bone's own points, spread equally on all axes, so that no rotation is free.
        let wide = (spread.x_axis.x + spread.y_axis.y + spread.z_axis.z) / own[9] + 1e-12;
        let products = square(c);
        own.iter_mut().zip(products).for_each(|(sum, p)| *sum += held * p);
        (0..3).for_each(|k| own[k] += held * wide);
    }
    let others = sums.into_iter().enumerate().filter_map(|(other, sum)| Some((other as u32, sum?)));
    std::iter::once((bone as u32, own)).chain(others).collect()
}

/// Sums of weight times position times displacement of one bone, for each shape.
fn targets(problem: &Problem, members: &[(u32, f64)]) -> Vec<Map> {
    let width = problem.width;
    let mut sums = vec![0.0f64; 4 * width];
    let (x, rest) = sums.split_at_mut(width);
    let (y, rest) = rest.split_at_mut(width);
    let (z, one) = rest.split_at_mut(width);
    for &(point, weight) in members {
        let p = problem.points[point as usize] * weight;
        let row = problem.row(point as usize).chunks_exact(LANES);
        let sums = x.chunks_exact_mut(LANES).zip(y.chunks_exact_mut(LANES));
        let sums = sums.zip(z.chunks_exact_mut(LANES).zip(one.chunks_exact_mut(LANES)));
        for (d, ((x, y), (z, one))) in row.zip(sums) {
            for k in 0..LANES {
                let d = f64::from(d[k]);
                x[k] += p.x * d;
                y[k] += p.y * d;
                z[k] += p.z * d;
                one[k] += weight * d;
            }
        }
    }
    (0..problem.shapes)
        .map(|shape| [0, 1, 2, 3].map(|a| DVec3::from_slice(&sums[a * width + 3 * shape..a * width + 3 * shape + 3])))
        .collect()
}
