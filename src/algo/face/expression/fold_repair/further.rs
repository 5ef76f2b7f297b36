//! Mending for the open jaw alone and for caricature, once the six expressions are mended.
//!
//! Skin below the chin folds further there than in any of the six at full strength. Weights that mend it are taken only where they
//! change nothing that can be seen: the six fold no more, and all of it moves as before.

use glam::Vec3;
use rayon::prelude::*;

use super::MendedHead;
use crate::{
    algo::face::expression::{ExpressionSet, FittedFace, MAX_STRENGTH, Mix, Sides},
    mesh::model::Weights,
};

/// Largest number of passes.
const PASSES: usize = 2;
/// The most by which the movement of the face may become another in any mix, as a share of its root mean square.
const CHANGED: f32 = 0.03;
/// Largest number of points at which movements are compared.
const SAMPLES: usize = 1500;

/// Mends what folds in units of the jaw at full strength and in the six expressions at their largest; `six` are the six at full
/// strength, which fold `left` triangles. Returns what these fold then.
pub(super) fn mend(
    head: &mut MendedHead,
    face: FittedFace,
    weights: &mut Weights,
    set: &ExpressionSet,
    six: &[Mix],
    left: usize,
) -> usize {
    let units = set.unit_set();
    let mut further: Vec<Mix> = set.six().map(|expression| Mix::of(&[(expression, MAX_STRENGTH)], units)).collect();
    for unit in units.units().iter().filter(|unit| unit.jaw > 0.0) {
        let mut mix = Mix::rest(units);
        mix.add(&unit.name, Sides::Both, 1.0, units);
        further.push(mix);
    }
    let folds = |mix: &Mix| !face.pose_and_repair(mix).1.folded.is_empty();
    let are_folding: Vec<bool> = further.par_iter().map(folds).collect();
    let folding = further.into_iter().zip(are_folding).filter(|(_, folds)| *folds).map(|(mix, _)| mix);
    let mixes: Vec<Mix> = six.iter().cloned().chain(folding).collect();
    if mixes.len() == six.len() {
        return left;
    }
    let sampled = sampled(head);
    let before = movements(head, &face, weights, &mixes, &sampled);
    let mut tried = weights.clone();
    let (mended, [of_six, _]) = head.mend(face, &mut tried, &mixes, six.len(), PASSES);
    let after = movements(head, &mended, &tried, &mixes, &sampled);
    let moves_as_before = before.iter().zip(&after).all(|(before, after)| is_alike(before, after));
    if of_six > left || !moves_as_before {
        return left;
    }
    *weights = tried;
    of_six
}

/// Points of the mask, evenly taken.
fn sampled(head: &MendedHead) -> Vec<usize> {
    let is_in = |point: &usize| head.mask.is_empty() || head.mask.get(*point).copied().unwrap_or(false);
    let all: Vec<usize> = (0..head.points.len()).filter(is_in).collect();
    all.iter().copied().step_by(all.len() / SAMPLES + 1).collect()
}

/// Movements of points in each mix, before poses are repaired.
fn movements(
    head: &MendedHead,
    face: &FittedFace,
    weights: &Weights,
    mixes: &[Mix],
    sampled: &[usize],
) -> Vec<Vec<Vec3>> {
    let moved = |mix: &Mix| -> Vec<Vec3> {
        let matrices = head.matrices(&face.pose_unrepaired(mix));
        let movement = |point: &usize| {
            let rest = head.points[*point];
            let shares = weights.of(*point).filter_map(|(joint, weight)| {
                Some((matrices.get(joint as usize)?.transform_point3(rest) - rest) * weight)
            });
            shares.fold(Vec3::ZERO, |sum, share| sum + share)
        };
        sampled.iter().map(movement).collect()
    };
    mixes.par_iter().map(moved).collect()
}

/// True for movements that differ by so little that nobody sees it.
fn is_alike(before: &[Vec3], after: &[Vec3]) -> bool {
    let all: f32 = before.iter().map(|moved| moved.length_squared()).sum();
    let other: f32 = before.iter().zip(after).map(|(before, after)| before.distance_squared(*after)).sum();
    other <= CHANGED * CHANGED * all
}
