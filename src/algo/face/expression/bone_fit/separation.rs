//! Separation of lips and lids that cross after all other repair, by the least movement of bones.
//!
//! Each pair of facing points that cross is a linear inequality in the heights of bones: their distance in height is at least
//! zero, or that at rest where they overlap at rest. The movement with the least sum of squares that meets all inequalities is
//! found by Hildreth's method (a quadratic programming procedure, 1957): one inequality after the other, each with a multiplier
//! that never falls below zero. Pairs that do not cross are inequalities, too, but move nothing by themselves. A pose in which the
//! movement would fold more skin than a thousandth of the face, and a tenth more than before, keeps its crossing.

use std::collections::BTreeMap;

use glam::Vec3;

use super::{
    FittedFace,
    moving_skin::{MovingSkin, PosedSkin},
    samples::FacingPoints,
};
use crate::{
    algo::face::expression::{BonePose, limited},
    mesh::skinning::skin_point,
};

/// Distance that points which crossed keep, in eye distances.
const MARGIN: f32 = 5e-5;
/// Largest distance, in eye distances, by which points of lips and of lids pass each other and are separated. Points that pass
/// further are not on the rims: the inside of a lip lies behind the other one.
const DEEPEST_LIPS: f32 = 0.005;
/// Distance of lips in a blend of units, which pass further.
const DEEPEST_LIPS_OF_BLENDS: f32 = 0.01;
const DEEPEST_LIDS: f32 = 0.02;
/// Distance, in eye distances, of points that need no inequality: no separation moves bones so far.
const ROOM: f32 = 0.05;
/// Most rounds over all pairs.
const ROUNDS: usize = 200;
/// Distance in eye distances that ends the rounds.
const PRECISION: f32 = 1e-5;
/// Least sum of squared shares of bones in a pair's distance: points with equal influences cannot be moved apart.
const LEAST_SQUARE: f32 = 0.01;

/// Inequality of one pair of facing points.
struct Inequality {
    /// Share of each unknown height in the distance of the points.
    shares: Vec<(usize, f32)>,
    /// Sum of the squared shares.
    square: f32,
    /// Distance that is missing; negative where there is room.
    missing: f32,
    multiplier: f32,
}

impl FittedFace {
    /// Moves bones up or down until no facing points cross, unless so much more skin would fold then that people notice; alike on
    /// both sides if `is_alike`. A unit alone, unlike a blend (`is_blend`), folds no more for it.
    pub(super) fn separate(&self, poses: &mut [BonePose], is_alike: bool, is_blend: bool) {
        let scale = self.landmarks.eye_distance();
        let MovingSkin { points, weights, facing, .. } = &self.moving;
        let matrices = self.matrices(poses);
        let missing = |pair: &FacingPoints| {
            let [above, below] = [pair.above as usize, pair.below as usize];
            let height = |point: usize| skin_point(point, points[point], weights, &matrices).y;
            (points[above].y - points[below].y).min(0.0) - (height(above) - height(below))
        };
        let is_near = |pair: &FacingPoints, missing: f32| {
            let deepest = match pair.eye {
                Some(_) => DEEPEST_LIDS,
                None if is_blend => DEEPEST_LIPS_OF_BLENDS,
                None => DEEPEST_LIPS,
            };
            missing > -ROOM * scale && missing < deepest * scale
        };
        let pairs =
            facing.rims.iter().map(|pair| (pair, missing(pair))).filter(|(pair, missing)| is_near(pair, *missing));
        let pairs: Vec<(&FacingPoints, f32)> = pairs.collect();
        if pairs.iter().all(|(_, missing)| *missing <= MARGIN * scale) {
            return;
        }
        // Both bones of a pair are one unknown.
        let mut unknown: Vec<usize> = (0..poses.len()).collect();
        if is_alike {
            self.pairs.iter().for_each(|&[one, other]| unknown[other] = unknown[one]);
        }
        let inequality = |(pair, missing): (&FacingPoints, f32)| {
            let mut shares: BTreeMap<usize, f32> = BTreeMap::new();
            for (bone, [share, _]) in self.shares(pair, 1.0) {
                *shares.entry(unknown[bone]).or_default() += share;
            }
            let square = shares.values().map(|share| share * share).sum();
            let missing = missing + MARGIN * scale;
            Inequality { shares: shares.into_iter().collect(), square, missing, multiplier: 0.0 }
        };
        let mut inequalities: Vec<Inequality> = pairs.into_iter().map(inequality).collect();
        inequalities.retain(|inequality| inequality.square >= LEAST_SQUARE);
        let heights = least_heights(&mut inequalities, poses.len(), PRECISION * scale);
        let mut separate = poses.to_vec();
        for (bone, pose) in separate.iter_mut().enumerate() {
            let height = heights[unknown[bone]];
            if height != 0.0 {
                pose.translation = limited(pose.translation + Vec3::Y * height, &self.landmarks);
            }
        }
        let mut posed = PosedSkin::new(&self.moving, matrices);
        let folds = posed.folded().count();
        posed.update(self.matrices(&separate));
        // A pose that folds more than people notice is a caricature, in which a tenth more makes no difference.
        let most = if !is_blend {
            folds
        } else if folds <= self.tolerated_folds {
            self.tolerated_folds
        } else {
            folds + folds / 10
        };
        if posed.folded().count() <= most {
            poses.copy_from_slice(&separate);
        }
    }
}

/// The heights with the least sum of squares that meet all inequalities.
fn least_heights(inequalities: &mut [Inequality], unknowns: usize, precision: f32) -> Vec<f32> {
    let mut heights = vec![0.0_f32; unknowns];
    for _ in 0..ROUNDS {
        let mut most = 0.0_f32;
        for Inequality { shares, square, missing, multiplier } in &mut *inequalities {
            let distance: f32 = shares.iter().map(|(bone, share)| share * heights[*bone]).sum();
            let change = ((*missing - distance) / *square).max(-*multiplier);
            if change == 0.0 {
                continue;
            }
            *multiplier += change;
            most = most.max(change.abs() * *square);
            shares.iter().for_each(|(bone, share)| heights[*bone] += share * change);
        }
        if most <= precision {
            break;
        }
    }
    heights
}
