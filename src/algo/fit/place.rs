//! Positions of bones, and the conversion of results to the caller's space.

use glam::{DMat3, DQuat, DVec3, Vec3};

use super::{
    BoneMove, FitSettings, PRUNE,
    moves::{Influences, Rigid},
    problem::Problem,
};
use crate::mesh::{influences::keep_strongest, model::Weights};

/// Pull of a bone's position towards the middle of its points, against the fixed point of its rotations.
const PULL: f64 = 0.05;

impl Problem {
    /// Converts a position from the caller's space to the fit's.
    pub fn inward(&self, point: Vec3) -> DVec3 {
        (point.as_dvec3() - self.center) / self.scale
    }
}

/// The bones' positions, and the weights of all points, in the caller's space.
pub(super) fn finish(
    problem: &Problem,
    settings: &FitSettings,
    influences: &Influences,
    moves: &[Vec<Rigid>],
) -> (Vec<Vec3>, Weights) {
    let mut weights = Weights::default();
    let mut moving = problem.origin.iter().zip(influences).peekable();
    for point in 0..problem.all {
        match moving.next_if(|(p, _)| **p as usize == point) {
            Some((_, row)) => weights.push(finished(row, settings.influences)),
            None => weights.push([(0, 1.0)]),
        }
    }
    let positions: Vec<Vec3> = positions(problem, influences, moves)
        .into_iter()
        .enumerate()
        .map(|(bone, free)| match settings.start.get(bone) {
            Some(start) if settings.locked.get(bone) == Some(&true) => *start,
            _ => (free * problem.scale + problem.center).as_vec3(),
        })
        .collect();
    (positions, weights)
}

/// Influences of one point over joints, with the head's share, strongest first.
fn finished(row: &[(u32, f64)], most: usize) -> Vec<(u32, f32)> {
    let head = 1.0 - row.iter().map(|e| e.1).sum::<f64>();
    let all = std::iter::once((0, head)).chain(row.iter().map(|e| (e.0 + 1, e.1)));
    let mut all: Vec<(u32, f32)> = all.filter(|e| e.1 > PRUNE).map(|e| (e.0, e.1 as f32)).collect();
    keep_strongest(&mut all, most, 0.0);
    if all.is_empty() {
        all.push((0, 1.0));
    }
    all
}

/// Position of each bone: the place that the bone shifts least in all shapes, as far as its rotations determine it,
/// else the middle of its points.
fn positions(problem: &Problem, influences: &Influences, moves: &[Vec<Rigid>]) -> Vec<DVec3> {
    let mut sums = vec![(0.0f64, DVec3::ZERO, 0.0f64); moves.len()];
    for (row, p) in influences.iter().zip(&problem.points) {
        for &(bone, weight) in row {
            let sum = &mut sums[bone as usize];
            *sum =
                (sum.0 + weight * weight, sum.1 + *p * weight * weight, sum.2 + weight * weight * p.length_squared());
        }
    }
    sums.iter()
        .zip(moves)
        .map(|(&(mass, sum, square), moves)| {
            if mass <= 0.0 {
                return DVec3::ZERO;
            }
            let middle = sum / mass;
            let spread = (square / mass - middle.length_squared()).max(0.0);
            // Least squares of (R - 1) x + t over the shapes, and of the distance to the middle.
            let mut matrix = DMat3::ZERO;
            let mut target = DVec3::ZERO;
            for rigid in moves {
                let turn = rigid.rotation - DMat3::IDENTITY;
                matrix += turn.transpose() * turn;
                target -= turn.transpose() * (turn * middle + rigid.translation);
            }
            let trace = matrix.x_axis.x + matrix.y_axis.y + matrix.z_axis.z;
            if trace <= 1e-12 {
                return middle;
            }
            let offset = (matrix + DMat3::from_diagonal(DVec3::splat(trace * PULL))).inverse() * target;
            // The position stays within the spread of the bone's own points.
            middle + offset.clamp_length_max((2.0 * spread).sqrt())
        })
        .collect()
}

/// Movements about the bones' positions: for each shape, those of all bones.
pub(super) fn outward(problem: &Problem, positions: &[Vec3], moves: &[Vec<Rigid>]) -> Vec<Vec<BoneMove>> {
    let one = |position: &Vec3, rigid: &Rigid| {
        let at = problem.inward(*position);
        let shift = (rigid.rotation * at + rigid.translation - at) * problem.scale;
        BoneMove { rotation: DQuat::from_mat3(&rigid.rotation).as_quat().normalize(), translation: shift.as_vec3() }
    };
    (0..problem.shapes)
        .map(|shape| positions.iter().zip(moves).map(|(position, moves)| one(position, &moves[shape])).collect())
        .collect()
}
