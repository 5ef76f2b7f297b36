//! Start of a fit: groups of points with similar movement.
//!
//! The fit begins with one group; then the groups that their own rigid movement explains worst are split, and points go
//! to the group whose movement fits them best, until there are enough (after Le and Deng 2014, "Robust and accurate
//! skeletal rigging from mesh sequences", section 4).

use glam::DVec3;
use rayon::prelude::*;

use super::{
    moves::{Moments, Rigid, square},
    problem::Problem,
    share::Columns,
};

/// Label of points that the head moves.
pub(super) const HEAD: u32 = u32::MAX;

/// Movements of `bones` groups of points; `given` are places whose nearest points form the first groups.
pub(super) fn groups(problem: &Problem, bones: usize, given: &[DVec3], stiffness: f64) -> Vec<Vec<Rigid>> {
    let mut labels = nearest(problem, given);
    let mut count = given.len().max(1);
    let mut moves = vec![vec![Rigid::IDENTITY; problem.shapes]; count];
    let mut left = fit_labels(problem, &labels, &mut moves, stiffness);
    while count < bones {
        let more = split(problem, &mut labels, &left, count, bones.min(2 * count));
        if more == count {
            break;
        }
        let first = count;
        count = more;
        for bone in first..count {
            // A group that has just been split off begins with the mean movement of its points.
            moves.push(average(problem, &labels, bone as u32));
        }
        for _ in 0..3 {
            let _ = fit_labels(problem, &labels, &mut moves, stiffness);
            if given.is_empty() {
                labels = assign(problem, &moves);
            }
        }
        left = fit_labels(problem, &labels, &mut moves, stiffness);
    }
    // Fewer groups than bones: the others begin at rest.
    moves.resize_with(bones, || vec![Rigid::IDENTITY; problem.shapes]);
    moves
}

/// Points by the nearest given place; with none, all in the first group.
fn nearest(problem: &Problem, given: &[DVec3]) -> Vec<u32> {
    let near = |p: &DVec3| {
        let mut best = (f64::INFINITY, 0);
        for (index, place) in given.iter().enumerate() {
            let distance = place.distance_squared(*p);
            if distance < best.0 {
                best = (distance, index as u32);
            }
        }
        best.1
    };
    problem.points.iter().map(near).collect()
}

/// Best group of each point by movement; the head where no group is better than rest.
fn assign(problem: &Problem, moves: &[Vec<Rigid>]) -> Vec<u32> {
    let columns = Columns::new(problem, moves);
    (0..problem.points.len())
        .into_par_iter()
        .map(|point| {
            let (at, moved, energy) = (square(problem.points[point]), problem.row(point), problem.energy[point]);
            let mut best = (energy, HEAD);
            for bone in 0..moves.len() {
                let left = columns.alone(bone, &at, moved, energy);
                if left < best.0 {
                    best = (left, bone as u32);
                }
            }
            best.1
        })
        .collect()
}

/// Fits the groups' movements and returns the squared residual of each point in its own group.
fn fit_labels(problem: &Problem, labels: &[u32], moves: &mut [Vec<Rigid>], stiffness: f64) -> Vec<f64> {
    let influences: Vec<Vec<(u32, f64)>> =
        labels.iter().map(|&l| if l == HEAD { Vec::new() } else { vec![(l, 1.0)] }).collect();
    Moments::new(problem, &influences, moves.len(), stiffness).improve(moves, 1, 0);
    let columns = Columns::new(problem, moves);
    (0..labels.len())
        .into_par_iter()
        .map(|point| {
            let energy = problem.energy[point];
            match labels[point] {
                HEAD => energy,
                bone => {
                    columns.alone(bone as usize, &square(problem.points[point]), problem.row(point), energy).max(0.0)
                }
            }
        })
        .collect()
}

/// Splits the groups with the largest residual, the worst first, until there are `wanted`; returns the number of
/// groups.
fn split(problem: &Problem, labels: &mut [u32], left: &[f64], count: usize, wanted: usize) -> usize {
    let mut sums = vec![(0.0f64, 0usize); count + 1];
    // The point of each group with the largest residual.
    let mut worst = vec![(0.0f64, usize::MAX); count + 1];
    for (point, &label) in labels.iter().enumerate() {
        let group = (label as usize).min(count);
        sums[group] = (sums[group].0 + left[point], sums[group].1 + 1);
        if left[point] > worst[group].0 {
            worst[group] = (left[point], point);
        }
    }
    let mut order: Vec<usize> = (0..=count).filter(|&g| sums[g].1 > 1 && worst[g].1 != usize::MAX).collect();
    order.sort_by(|&a, &b| sums[b].0.total_cmp(&sums[a].0).then(a.cmp(&b)));
    let total: f64 = sums.iter().map(|s| s.0).sum();
    let mut next = count;
    for group in order {
        // Groups far below the mean wait for a later turn, unless there are not enough others.
        if next == wanted || next > count && sums[group].0 * (4 * count) as f64 <= total {
            break;
        }
        let seed = problem.row(worst[group].1);
        let label = if group == count { HEAD } else { group as u32 };
        for (point, mine) in labels.iter_mut().enumerate() {
            if *mine == label {
                let apart = problem.row(point).iter().zip(seed).map(|(a, b)| f64::from((a - b) * (a - b))).sum::<f64>();
                if apart < left[point] || point == worst[group].1 {
                    *mine = next as u32;
                }
            }
        }
        next += 1;
    }
    next
}

/// Movements that shift by the mean displacement of a group.
fn average(problem: &Problem, labels: &[u32], label: u32) -> Vec<Rigid> {
    let mut sums = vec![DVec3::ZERO; problem.shapes];
    let mut count = 0.0;
    for point in (0..labels.len()).filter(|&p| labels[p] == label) {
        count += 1.0;
        for (sum, d) in sums.iter_mut().zip(problem.row(point).chunks_exact(3)) {
            *sum += DVec3::new(f64::from(d[0]), f64::from(d[1]), f64::from(d[2]));
        }
    }
    let shift = |sum: &DVec3| Rigid { translation: *sum / f64::max(count, 1.0), ..Rigid::IDENTITY };
    sums.iter().map(shift).collect()
}
