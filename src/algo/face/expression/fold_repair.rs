//! Smoothing of weights in the few places where an expression would fold the skin.
//!
//! Between lips or lids that meet, the weights of a small triangle may change from one side to the other, and the
//! movement that opens the two flips it. Holding the bones back would weaken the expression; averaging the weights of
//! the triangle's corners with their neighbours' is not visible.

use std::collections::BTreeMap;

use glam::{Affine3A, Vec3, Vec3A};
use rayon::prelude::*;

use super::{ExpressionSet, FittedFace, Mix, bone_fit::SLIVER, text::Expression};
use crate::{
    algo::face::{bones::FaceBone, landmarks::Landmarks, weights::Mirror},
    mesh::{adjacency::weld, influences::keep_strongest, model::Weights, skinning::skin_points},
};

/// Number of passes; each solves the bones' movements anew.
const PASSES: usize = 2;
/// Rounds of averaging in a pass.
const ROUNDS: usize = 40;
/// Round from which neighbours of the corners are averaged, too.
const WIDEN: usize = 1;
/// Share of its own weights that a place keeps in a round.
const OWN: f32 = 0.25;
/// Largest number of influences of a point.
const INFLUENCES: usize = 8;

type Influences = Vec<(u32, f32)>;

/// Averages weights where one of the six expressions at full strength turns a triangle by more than a right angle.
///
/// All in head space; `mask` and `weights` as [`FittedFace::new`] takes them. Points at the same place keep the same
/// weights. Bones move otherwise with other weights, so that each pass poses anew, and the weights with the fewest folds
/// are kept. Returns the folds that are left, summed over the six, after [`FittedFace::pose`] has repaired the poses.
/// Cost: a few poses of every expression.
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
    let with_area = with_area(points, triangles);
    let mut neighbourhood: Option<Neighbourhood> = None;
    let mut best: Option<(usize, Weights)> = None;
    let mirror = Mirror::new(points, bones, landmarks);
    for pass in 0..=PASSES {
        let face = FittedFace::new(points, triangles, mask, weights, bones, landmarks, set.unit_set());
        let matrices = |expression: &&Expression| -> Vec<Affine3A> {
            let posed = face.pose(&Mix::of(&[(*expression, 1.0)], set.unit_set()));
            let moved = posed.into_iter().zip(bones).map(|(pose, bone)| pose.affine(bone.position));
            [Affine3A::IDENTITY; 2].into_iter().chain(moved).collect()
        };
        let poses: Vec<Vec<Affine3A>> = six.par_iter().map(matrices).collect();
        let (sum, folded) = all_folded(points, triangles, &with_area, weights, &poses);
        // A pass that helped nothing is the last.
        if best.as_ref().is_some_and(|(least, _)| sum >= *least) {
            break;
        }
        best = Some((sum, weights.clone()));
        if sum == 0 || pass == PASSES {
            break;
        }
        let neighbourhood = neighbourhood.get_or_insert_with(|| Neighbourhood::new(points, triangles));
        let mut averaged =
            AveragedWeights { neighbourhood, weights, own: vec![Vec::new(); neighbourhood.points.len()] };
        averaged.smooth(points, triangles, folded, &poses);
        *weights = averaged.weights();
        if let Some(mirror) = &mirror {
            mirror.apply(weights);
        }
    }
    let Some((left, best)) = best else { return 0 };
    *weights = best;
    left
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

/// Folds of all poses, and the triangles whose orientation any of them flips, in rising order.
fn all_folded(
    points: &[Vec3],
    triangles: &[[u32; 3]],
    which: &[u32],
    weights: &Weights,
    poses: &[Vec<Affine3A>],
) -> (usize, Vec<u32>) {
    let of_pose = |matrices: &Vec<Affine3A>| {
        let mut posed = Vec::new();
        skin_points(points, weights, matrices, &mut posed);
        turned(points, triangles, which, &posed)
    };
    let all: Vec<Vec<u32>> = poses.par_iter().map(of_pose).collect();
    let sum = all.iter().map(Vec::len).sum();
    let mut all = all.concat();
    all.sort_unstable();
    all.dedup();
    (sum, all)
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
}

/// Weights of a surface, some of them averaged.
struct AveragedWeights<'a> {
    neighbourhood: &'a Neighbourhood,
    weights: &'a Weights,
    /// Averaged weights of each place; empty where they are as they were.
    own: Vec<Influences>,
}

impl AveragedWeights<'_> {
    /// Averages until no triangle is folded or all rounds are over.
    fn smooth(&mut self, points: &[Vec3], triangles: &[[u32; 3]], mut folded: Vec<u32>, poses: &[Vec<Affine3A>]) {
        for round in 0..ROUNDS {
            let corners = folded.iter().flat_map(|&triangle| triangles[triangle as usize]);
            let mut places: Vec<u32> = corners.map(|corner| self.neighbourhood.place_of[corner as usize]).collect();
            places.sort_unstable();
            places.dedup();
            if round >= WIDEN {
                let next = places.iter().flat_map(|&place| &self.neighbourhood.corners[place as usize]);
                places = next.chain(&places).copied().collect();
                places.sort_unstable();
                places.dedup();
            }
            let averages: Vec<Influences> = places.par_iter().map(|&place| self.average(points, place)).collect();
            for (&place, influences) in places.iter().zip(averages) {
                self.own[place as usize] = influences;
            }
            // The corners of all folded triangles have changed, so that no other triangle can be folded.
            let mut near: Vec<u32> =
                places.iter().flat_map(|&place| &self.neighbourhood.triangles[place as usize]).copied().collect();
            near.sort_unstable();
            near.dedup();
            folded = near
                .into_par_iter()
                .filter(|&triangle| self.is_folded(points, triangles[triangle as usize], poses))
                .collect();
            if folded.is_empty() {
                return;
            }
        }
    }

    /// The weights of all points.
    fn weights(&self) -> Weights {
        let mut weights = Weights::default();
        for (point, &place) in self.neighbourhood.place_of.iter().enumerate() {
            match self.own[place as usize].as_slice() {
                [] => weights.push(self.weights.of(point)),
                own => weights.push(own.iter().copied()),
            }
        }
        weights
    }

    /// A share of a place's own weights plus the mean of its neighbours', in which near ones count more.
    ///
    /// A triangle folds where weights change much over a short way, mostly where tiny triangles meet large ones. With
    /// shares by the square of the distance the change is even along the surface, not from one point to the next.
    fn average(&self, points: &[Vec3], place: u32) -> Influences {
        let mut sum: BTreeMap<u32, f32> = BTreeMap::new();
        let mut add = |place: u32, share: f32| {
            for (joint, weight) in self.of_place(place) {
                *sum.entry(joint).or_default() += weight * share;
            }
        };
        let position = |place: u32| {
            let point = self.neighbourhood.points[place as usize].first();
            point.map_or(Vec3::ZERO, |point| points[*point as usize])
        };
        let near = |other: u32| 1.0 / position(other).distance_squared(position(place)).max(f32::MIN_POSITIVE);
        let next = &self.neighbourhood.corners[place as usize];
        let all: f32 = next.iter().map(|other| near(*other)).sum();
        if all.is_finite() && all > 0.0 {
            add(place, OWN);
            next.iter().for_each(|other| add(*other, (1.0 - OWN) * near(*other) / all));
        } else {
            add(place, 1.0);
        }
        let mut all: Influences = sum.into_iter().filter(|(_, weight)| *weight > 1e-4).collect();
        keep_strongest(&mut all, INFLUENCES, 0.0);
        all
    }

    fn of_place(&self, place: u32) -> Influences {
        match self.own[place as usize].as_slice() {
            [] => {
                let point = self.neighbourhood.points[place as usize].first();
                point.map(|&point| self.weights.of(point as usize).collect()).unwrap_or_default()
            }
            own => own.to_vec(),
        }
    }

    /// True if any of the poses flips the orientation of a triangle.
    fn is_folded(&self, points: &[Vec3], corners: [u32; 3], poses: &[Vec<Affine3A>]) -> bool {
        let normal = |[a, b, c]: [Vec3; 3]| (b - a).cross(c - a);
        let rest = corners.map(|corner| points[corner as usize]);
        let [a, b, c] = rest;
        let longest = (b - a).length_squared().max((c - a).length_squared()).max((c - b).length_squared());
        if normal(rest).length() <= SLIVER * longest {
            return false;
        }
        let influences = corners.map(|corner| self.of_place(self.neighbourhood.place_of[corner as usize]));
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
    }
}
