//! Smoothing of weights in the few places where an expression would fold the skin.
//!
//! Between lips or lids that meet, the weights of a small triangle may change from one side to the other, and the
//! movement that opens the two flips it. Holding the bones back would weaken the expression; averaging the weights of
//! the triangle's corners with their neighbours' is not visible.

use std::collections::{BTreeMap, BTreeSet};

use glam::{Affine3A, Vec3, Vec3A};
use rayon::prelude::*;

use super::{ExpressionSet, FittedFace, Mix, apply, bone_fit::SLIVER, text::Expression};
use crate::{
    algo::face::{bones::FaceBone, landmarks::Landmarks},
    mesh::{adjacency::weld, influences::keep_strongest, model::Weights, skinning::skin_points},
};

/// Rounds of averaging.
const ROUNDS: usize = 24;
/// Round from which neighbours of the corners are averaged, too.
const WIDEN: usize = 6;
/// Largest number of influences of a point.
const INFLUENCES: usize = 8;

type Influences = Vec<(u32, f32)>;

/// Averages weights where one of the six expressions at full strength turns a triangle by more than a right angle.
///
/// All in head space; `mask` and `weights` as [`FittedFace::new`] takes them. Points at the same place keep the same
/// weights. Returns the number of triangles that still fold. Cost: a pose of each expression.
pub fn repair_folds(
    set: &ExpressionSet,
    points: &[Vec3],
    triangles: &[[u32; 3]],
    mask: &[bool],
    weights: &mut Weights,
    bones: &[FaceBone],
    landmarks: &Landmarks,
) -> usize {
    if weights.len() != points.len() || triangles.iter().flatten().any(|&corner| corner as usize >= points.len()) {
        return 0;
    }
    let six: Vec<&Expression> = set.six().collect();
    let face = FittedFace::new(points, &[], mask, weights, bones, landmarks, set.unit_set());
    let matrices = |expression: &&Expression| -> Vec<Affine3A> {
        let posed = face.pose(&Mix::of(&[(*expression, 1.0)], set.unit_set()));
        let moved = posed.into_iter().zip(bones).map(|(pose, bone)| pose.affine(bone.position));
        [Affine3A::IDENTITY; 2].into_iter().chain(moved).collect()
    };
    let poses: Vec<Vec<Affine3A>> = six.par_iter().map(matrices).collect();
    let with_area = with_area(points, triangles);
    let mut own: BTreeMap<u32, Influences> = BTreeMap::new();
    let mut folded = all_folded(points, triangles, &with_area, weights, &poses);
    if folded.is_empty() {
        return 0;
    }
    let neighbourhood = Neighbourhood::new(points, triangles);
    for round in 0..ROUNDS {
        let mut corners: BTreeSet<u32> = folded
            .iter()
            .filter_map(|&triangle| triangles.get(triangle as usize))
            .flatten()
            .map(|&corner| neighbourhood.place_of[corner as usize])
            .collect();
        if round >= WIDEN {
            let more: Vec<u32> = corners.iter().flat_map(|&place| neighbourhood.next(place)).collect();
            corners.extend(more);
        }
        let averaged: Vec<(u32, Influences)> =
            corners.iter().map(|&place| (place, neighbourhood.average(place, weights, &own))).collect();
        for (place, influences) in averaged {
            for &point in &neighbourhood.points[place as usize] {
                own.insert(point, influences.clone());
            }
        }
        let near: BTreeSet<u32> = own
            .keys()
            .flat_map(|&point| neighbourhood.triangles[neighbourhood.place_of[point as usize] as usize].iter().copied())
            .collect();
        folded = self::folded(points, triangles, near.into_iter(), weights, &own, &poses);
        if folded.is_empty() {
            break;
        }
    }
    let mut repaired = Weights::default();
    for point in 0..points.len() {
        match own.get(&(point as u32)) {
            Some(influences) => repaired.push(influences.iter().copied()),
            None => repaired.push(weights.of(point)),
        }
    }
    *weights = repaired;
    folded.len()
}

/// Number of triangles that turn by more than a right angle in the six expressions at full strength, after
/// [`FittedFace::pose`] has repaired the poses.
///
/// All in head space, as [`repair_folds`] takes it.
pub fn count_folds(
    set: &ExpressionSet,
    points: &[Vec3],
    triangles: &[[u32; 3]],
    mask: &[bool],
    weights: &Weights,
    bones: &[FaceBone],
    landmarks: &Landmarks,
) -> usize {
    if weights.len() != points.len() || triangles.iter().flatten().any(|&corner| corner as usize >= points.len()) {
        return 0;
    }
    let face = FittedFace::new(points, triangles, mask, weights, bones, landmarks, set.unit_set());
    let with_area = with_area(points, triangles);
    let six: Vec<&Expression> = set.six().collect();
    let folds = |expression: &&Expression| {
        let posed = face.pose(&Mix::of(&[(*expression, 1.0)], set.unit_set()));
        turned(points, triangles, &with_area, &apply(points, weights, bones, &posed)).len()
    };
    six.par_iter().map(folds).sum()
}

/// Indices of triangles that are not slivers: slivers have no orientation.
fn with_area(points: &[Vec3], triangles: &[[u32; 3]]) -> Vec<u32> {
    let has_area = |index: &u32| {
        let [a, b, c] = triangles[*index as usize].map(|corner| points[corner as usize]);
        let longest = (b - a).length_squared().max((c - a).length_squared()).max((c - b).length_squared());
        (b - a).cross(c - a).length() > SLIVER * longest
    };
    (0..triangles.len() as u32).filter(has_area).collect()
}

/// Triangles whose normals the pose turns by more than a right angle.
fn turned(rest: &[Vec3], triangles: &[[u32; 3]], which: &[u32], posed: &[Vec3]) -> Vec<u32> {
    let normal = |points: &[Vec3], corners: [u32; 3]| {
        let [a, b, c] = corners.map(|corner| points[corner as usize]);
        (b - a).cross(c - a)
    };
    let is_turned = |index: &u32| {
        let corners = triangles[*index as usize];
        normal(rest, corners).dot(normal(posed, corners)) < 0.0
    };
    which.iter().copied().filter(is_turned).collect()
}

/// Triangles whose orientation any of the poses flips, in rising order.
fn all_folded(
    points: &[Vec3],
    triangles: &[[u32; 3]],
    which: &[u32],
    weights: &Weights,
    poses: &[Vec<Affine3A>],
) -> Vec<u32> {
    let of_pose = |matrices: &Vec<Affine3A>| {
        let mut posed = Vec::new();
        skin_points(points, weights, matrices, &mut posed);
        turned(points, triangles, which, &posed)
    };
    let all: Vec<Vec<u32>> = poses.par_iter().map(of_pose).collect();
    let all: BTreeSet<u32> = all.into_iter().flatten().collect();
    all.into_iter().collect()
}

/// Neighbourhood of each place of the welded surface.
struct Neighbourhood {
    place_of: Vec<u32>,
    points: Vec<Vec<u32>>,
    triangles: Vec<Vec<u32>>,
    corners: Vec<Vec<u32>>,
}

impl Neighbourhood {
    fn new(points: &[Vec3], triangles: &[[u32; 3]]) -> Self {
        let (place_of, count) = weld(points);
        let mut neighbourhood = Self {
            place_of,
            points: vec![Vec::new(); count],
            triangles: vec![Vec::new(); count],
            corners: vec![Vec::new(); count],
        };
        for (point, &place) in neighbourhood.place_of.iter().enumerate() {
            neighbourhood.points[place as usize].push(point as u32);
        }
        for (index, triangle) in triangles.iter().enumerate() {
            let places = triangle.map(|corner| neighbourhood.place_of[corner as usize]);
            for place in places {
                neighbourhood.triangles[place as usize].push(index as u32);
                neighbourhood.corners[place as usize].extend(places.iter().filter(|&&other| other != place));
            }
        }
        for corners in &mut neighbourhood.corners {
            corners.sort_unstable();
            corners.dedup();
        }
        neighbourhood
    }

    fn next(&self, place: u32) -> Vec<u32> {
        self.corners[place as usize].clone()
    }

    /// Half a place's own weights plus half the mean of its neighbours'.
    fn average(&self, place: u32, weights: &Weights, own: &BTreeMap<u32, Influences>) -> Influences {
        let mut sum: BTreeMap<u32, f32> = BTreeMap::new();
        let mut add = |place: u32, share: f32| {
            let Some(&point) = self.points[place as usize].first() else { return };
            for (joint, weight) in influences(point, weights, own) {
                *sum.entry(joint).or_default() += weight * share;
            }
        };
        add(place, 0.5);
        let next = &self.corners[place as usize];
        for &other in next {
            add(other, 0.5 / next.len() as f32);
        }
        let mut all: Influences = sum.into_iter().filter(|(_, weight)| *weight > 1e-4).collect();
        keep_strongest(&mut all, INFLUENCES, 0.0);
        all
    }
}

fn influences(point: u32, weights: &Weights, own: &BTreeMap<u32, Influences>) -> Influences {
    own.get(&point).cloned().unwrap_or_else(|| weights.of(point as usize).collect())
}

/// Triangles whose orientation any of the poses flips, with changed weights in `own`.
fn folded(
    points: &[Vec3],
    triangles: &[[u32; 3]],
    which: impl Iterator<Item = u32>,
    weights: &Weights,
    own: &BTreeMap<u32, Influences>,
    poses: &[Vec<Affine3A>],
) -> Vec<u32> {
    let normal = |[a, b, c]: [Vec3; 3]| (b - a).cross(c - a);
    let turned = |index: &u32| {
        let corners = triangles[*index as usize];
        let rest = corners.map(|corner| points[corner as usize]);
        let moving = |corner: &u32| match own.get(corner) {
            Some(_) => true,
            None => weights.of(*corner as usize).any(|(joint, _)| joint >= 2),
        };
        let [a, b, c] = rest;
        let longest = (b - a).length_squared().max((c - a).length_squared()).max((c - b).length_squared());
        if !corners.iter().any(moving) || normal(rest).length() <= SLIVER * longest {
            return false;
        }
        let influences = corners.map(|corner| influences(corner, weights, own));
        poses.iter().any(|matrices| {
            let posed = [0, 1, 2].map(|k| {
                let mut sum = Vec3A::ZERO;
                for &(joint, weight) in &influences[k] {
                    if let Some(matrix) = matrices.get(joint as usize) {
                        sum += matrix.transform_point3a(rest[k].into()) * weight;
                    }
                }
                Vec3::from(sum)
            });
            normal(rest).dot(normal(posed)) < 0.0
        })
    };
    which.filter(turned).collect()
}
