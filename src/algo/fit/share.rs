//! Weights of all points, given the transforms.
//!
//! The displacement by a bone is linear in the point's position, so the matrix of a point's least squares problem is a
//! quadratic function of its position, whose coefficients (ten a pair of bones) are found once. Only the right-hand
//! side reads the displacements.

use rayon::prelude::*;

use super::{
    convex::Convex,
    moves::{Rigid, Square, square},
    problem::{LANES, Problem},
};

/// Number of points of one task.
const CHUNK: usize = 128;

/// Movements of all bones, prepared for queries at single points.
pub(super) struct Columns {
    bones: usize,
    width: usize,
    /// Four rows of `width` for each bone: its displacement of x, y, z and 1, in all shapes.
    rows: Vec<f32>,
    /// Coefficients of the product of two bones' columns, for each pair (first ≤ second).
    products: Vec<Square>,
}

impl Columns {
    pub fn new(problem: &Problem, moves: &[Vec<Rigid>]) -> Self {
        let (bones, width) = (moves.len(), problem.width);
        let mut rows = vec![0.0f64; bones * 4 * width];
        for (rows, moves) in rows.chunks_exact_mut(4 * width).zip(moves) {
            for (shape, rigid) in moves.iter().enumerate() {
                for (a, image) in rigid.map().into_iter().enumerate() {
                    let at = a * width + shape * 3;
                    rows[at..at + 3].copy_from_slice(&image.to_array());
                }
            }
        }
        let row = |bone: usize, a: usize| &rows[(bone * 4 + a) * width..(bone * 4 + a + 1) * width];
        let products = (0..bones)
            .into_par_iter()
            .flat_map_iter(|first| (0..=first).map(move |second| (first, second)))
            .map(|(first, second)| {
                let dot = |a: usize, b: usize| dot(row(first, a), row(second, b));
                let both = |a: usize, b: usize| dot(a, b) + dot(b, a);
                let (xy, xz, yz) = (both(0, 1), both(0, 2), both(1, 2));
                let (x, y, z) = (both(0, 3), both(1, 3), both(2, 3));
                [dot(0, 0), dot(1, 1), dot(2, 2), xy, xz, yz, x, y, z, dot(3, 3)]
            })
            .collect();
        let rows = rows.iter().map(|&r| r as f32).collect();
        Self { bones, width, rows, products }
    }

    /// The product of two bones' columns at a point.
    pub fn product(&self, first: usize, second: usize, at: &Square) -> f64 {
        let (low, high) = (first.min(second), first.max(second));
        self.products[high * (high + 1) / 2 + low].iter().zip(at).map(|(a, b)| a * b).sum()
    }

    /// The product of a bone's column at a point with the point's displacements `moved`.
    pub fn target(&self, bone: usize, at: &Square, moved: &[f32]) -> f64 {
        let rows = &self.rows[bone * 4 * self.width..(bone + 1) * 4 * self.width];
        let (x, rest) = rows.split_at(self.width);
        let (y, rest) = rest.split_at(self.width);
        let (z, one) = rest.split_at(self.width);
        let mut sums = [[0.0f32; LANES]; 4];
        let rows = x.chunks_exact(LANES).zip(y.chunks_exact(LANES));
        let rows = rows.zip(z.chunks_exact(LANES).zip(one.chunks_exact(LANES)));
        for (d, ((x, y), (z, one))) in moved.chunks_exact(LANES).zip(rows) {
            for k in 0..LANES {
                sums[0][k] += x[k] * d[k];
                sums[1][k] += y[k] * d[k];
                sums[2][k] += z[k] * d[k];
                sums[3][k] += one[k] * d[k];
            }
        }
        let [x, y, z, one] = sums.map(|lanes| lanes.iter().map(|&v| f64::from(v)).sum::<f64>());
        x * at[6] + y * at[7] + z * at[8] + one
    }

    /// The remaining squared distance if one bone alone moves the point.
    pub fn alone(&self, bone: usize, at: &Square, moved: &[f32], energy: f64) -> f64 {
        energy - 2.0 * self.target(bone, at, moved) + self.product(bone, bone, at)
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// Settings of the computation of weights.
pub(super) struct ShareSettings<'a> {
    /// The largest number of bones a point, the head included.
    pub most: usize,
    /// Pull towards the mean of the neighbours, as a share of the mean energy of a point.
    pub smoothing: f64,
    /// Candidate bones of each point, sorted.
    pub candidates: &'a (dyn Fn(usize, &mut Vec<u32>) + Sync),
}

/// Finds the weights of all points anew, beginning with those in `influences`.
///
/// Returns each point's influences, sorted by bone (the remainder to one is the head's), and its squared distance.
pub(super) fn share(
    problem: &Problem,
    columns: &Columns,
    influences: &[Vec<(u32, f64)>],
    sharing: &ShareSettings,
) -> (Vec<Vec<(u32, f64)>>, Vec<f64>) {
    let count = problem.points.len();
    let mean = problem.energy.iter().sum::<f64>() / count.max(1) as f64;
    let pull = sharing.smoothing * mean;
    let chunks: Vec<Vec<(Vec<(u32, f64)>, f64)>> = (0..count.div_ceil(CHUNK))
        .into_par_iter()
        .map(|chunk| {
            let (mut convex, mut targets, mut bones) = (Convex::default(), Vec::new(), Vec::new());
            let range = chunk * CHUNK..((chunk + 1) * CHUNK).min(count);
            range
                .map(|point| {
                    bones.clear();
                    (sharing.candidates)(point, &mut bones);
                    let around = problem.around(point);
                    let smooth = if around.is_empty() { 0.0 } else { pull };
                    one(
                        problem,
                        columns,
                        influences,
                        &bones,
                        point,
                        smooth,
                        mean * 1e-9,
                        sharing.most,
                        &mut convex,
                        &mut targets,
                    )
                })
                .collect()
        })
        .collect();
    chunks.into_iter().flatten().unzip()
}

fn one(
    problem: &Problem,
    columns: &Columns,
    influences: &[Vec<(u32, f64)>],
    bones: &[u32],
    point: usize,
    smooth: f64,
    least: f64,
    most: usize,
    convex: &mut Convex,
    targets: &mut Vec<f64>,
) -> (Vec<(u32, f64)>, f64) {
    debug_assert!(bones.iter().all(|&b| (b as usize) < columns.bones));
    // The head comes first; it moves nothing.
    let n = bones.len() + 1;
    convex.reset(n);
    let at = square(problem.points[point]);
    let moved = problem.row(point);
    for (i, &bone) in bones.iter().enumerate() {
        convex.target[i + 1] = columns.target(bone as usize, &at, moved);
        for (j, &other) in bones[..=i].iter().enumerate() {
            let product = columns.product(bone as usize, other as usize, &at);
            convex.gram[(i + 1) * n + j + 1] = product;
            convex.gram[(j + 1) * n + i + 1] = product;
        }
    }
    targets.clear();
    targets.extend_from_slice(&convex.target);
    let mut left = 1.0;
    for &(bone, weight) in &influences[point] {
        if let Ok(index) = bones.binary_search(&bone) {
            convex.weights[index + 1] = weight;
            left -= weight;
        }
    }
    convex.weights[0] = if influences[point].is_empty() { 0.0 } else { f64::max(left, 0.0) };
    if smooth > 0.0 {
        let around = problem.around(point);
        let share = smooth / around.len() as f64;
        for &other in around {
            let mut left = 1.0;
            for &(bone, weight) in &influences[other as usize] {
                left -= weight;
                if let Ok(index) = bones.binary_search(&bone) {
                    convex.target[index + 1] += share * weight;
                }
            }
            convex.target[0] += share * left;
        }
    }
    (0..n).for_each(|i| convex.gram[i * n + i] += smooth + least);
    convex.solve(most);
    let row: Vec<(u32, f64)> = bones
        .iter()
        .zip(&convex.weights[1..])
        .filter(|(_, weight)| **weight > 0.0)
        .map(|(&bone, &weight)| (bone, weight))
        .collect();
    let mut square = problem.energy[point];
    for i in (1..n).filter(|&i| convex.weights[i] > 0.0) {
        let pulled: f64 = (1..n).map(|j| convex.gram[i * n + j] * convex.weights[j]).sum();
        let held = (smooth + least) * convex.weights[i];
        square += convex.weights[i] * (pulled - held - 2.0 * targets[i]);
    }
    (row, square.max(0.0))
}
