//! Reseeding: bones that contribute little are moved to the regions with the largest remaining error.
//!
//! Alternating between weights and transforms never moves a bone from a part of the mesh with enough bones to one with
//! too few; reseeding does.

use glam::DVec3;
use rayon::prelude::*;

use super::{
    moves::{Influences, Rigid, square},
    problem::Problem,
    share::Columns,
};

/// Number of points around a seed that determine a bone's first movement.
const PATCH: usize = 40;
/// Expected gain relative to the error of the patch: a reseeded bone will serve more points than the patch's.
const GAIN: f64 = 6.0;

/// Reseeds up to `most` of the bones from `first` on, and returns their indices, sorted.
///
/// `left` is each point's squared distance. A bone is only moved if its loss costs less than its expected gain at the
/// new place.
pub(super) fn renew(
    problem: &Problem,
    columns: &Columns,
    influences: &mut Influences,
    moves: &mut [Vec<Rigid>],
    left: &[f64],
    first: usize,
    most: usize,
) -> Vec<u32> {
    let worth = worth(problem, columns, influences, moves.len());
    let mut weak: Vec<u32> = (first as u32..moves.len() as u32).collect();
    weak.sort_by(|&a, &b| worth[a as usize].total_cmp(&worth[b as usize]).then(a.cmp(&b)));
    weak.truncate(most);
    let patches = worst_patches(problem, left, weak.len());
    let mut renewed = Vec::new();
    for (bone, (patch, sum)) in weak.into_iter().zip(patches) {
        if worth[bone as usize] >= sum * GAIN {
            break;
        }
        moves[bone as usize] = begin(problem, &patch);
        renewed.push(bone);
    }
    renewed.sort_unstable();
    influences.par_iter_mut().for_each(|row| {
        let lost = row.iter().any(|e| renewed.binary_search(&e.0).is_ok());
        if lost {
            row.retain(|e| renewed.binary_search(&e.0).is_err());
        }
    });
    renewed
}

/// Increase of the squared error if each bone's weight went to the other bones of each point.
fn worth(problem: &Problem, columns: &Columns, influences: &Influences, bones: usize) -> Vec<f64> {
    let losses: Vec<Vec<(u32, f64)>> = influences
        .par_iter()
        .zip(&problem.points)
        .map(|(row, p)| {
            let at = square(*p);
            let pull = |bone: u32| -> f64 {
                row.iter().map(|&(other, w)| w * columns.product(bone as usize, other as usize, &at)).sum()
            };
            let pulls: Vec<f64> = row.iter().map(|e| pull(e.0)).collect();
            let whole: f64 = row.iter().zip(&pulls).map(|(e, pull)| e.1 * pull).sum();
            let loss = |(&(bone, weight), &pull): (&(u32, f64), &f64)| {
                // Without the bone the point goes to the mean of its other bones, the head among them.
                let own = columns.product(bone as usize, bone as usize, &at);
                let apart = (whole - 2.0 * pull + own).max(0.0);
                let rest = 1.0 - weight;
                let loss = if rest > 0.05 { (weight / rest) * (weight / rest) * apart } else { f64::INFINITY };
                (bone, loss.min(whole.max(0.0)))
            };
            row.iter().zip(&pulls).map(loss).collect()
        })
        .collect();
    let mut worth = vec![0.0; bones];
    losses.iter().flatten().for_each(|&(bone, loss)| worth[bone as usize] += loss);
    worth
}

/// Patches that do not overlap, those with the largest remaining error first, and this error.
fn worst_patches(problem: &Problem, left: &[f64], count: usize) -> Vec<(Vec<u32>, f64)> {
    // A single bad point is not worth a bone: the mean around a point counts.
    let around: Vec<f64> = (0..left.len())
        .into_par_iter()
        .map(|point| {
            let others = problem.around(point);
            let sum: f64 = others.iter().map(|&p| left[p as usize]).sum();
            (left[point] + sum) / (1 + others.len()) as f64
        })
        .collect();
    let mut order: Vec<u32> = (0..left.len() as u32).collect();
    order.sort_unstable_by(|&a, &b| around[b as usize].total_cmp(&around[a as usize]).then(a.cmp(&b)));
    let mut taken = vec![false; left.len()];
    let mut patches = Vec::new();
    for seed in order {
        if patches.len() == count {
            break;
        }
        if taken[seed as usize] {
            continue;
        }
        let mut patch = vec![seed];
        taken[seed as usize] = true;
        let mut next = 0;
        while next < patch.len() && patch.len() < PATCH {
            for &other in problem.around(patch[next] as usize) {
                if !std::mem::replace(&mut taken[other as usize], true) {
                    patch.push(other);
                }
            }
            next += 1;
        }
        let sum = patch.iter().map(|&p| left[p as usize]).sum();
        // The next patch must not touch this one.
        patch.iter().for_each(|&p| problem.around(p as usize).iter().for_each(|&o| taken[o as usize] = true));
        patches.push((patch, sum));
    }
    patches
}

/// Movements that shift by the mean displacement of a patch.
fn begin(problem: &Problem, patch: &[u32]) -> Vec<Rigid> {
    let mut sums = vec![DVec3::ZERO; problem.shapes];
    for &point in patch {
        for (sum, d) in sums.iter_mut().zip(problem.row(point as usize).chunks_exact(3)) {
            *sum += DVec3::new(f64::from(d[0]), f64::from(d[1]), f64::from(d[2]));
        }
    }
    let share = 1.0 / patch.len().max(1) as f64;
    sums.into_iter().map(|sum| Rigid { translation: sum * share, ..Rigid::IDENTITY }).collect()
}
