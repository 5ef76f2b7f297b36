//! Bone movements whose skinned surface follows the field.
//!
//! Skin moves by the weighted mean of its bones' movements. With movements sampled from the field, it would fall short
//! at the field's peaks and move where it should stay. So the movements are solved for: least squares over the points
//! of the skin, in which landmarks count most, with a weak pull towards the mean of the field over each bone's own
//! patch. With fixed weights the matrix is the same for all expressions and factorised once.

mod pose_problem;

use glam::Vec3;

use super::{
    BonePose, Mix, UnitSet,
    field::Field,
    limited,
    openings::{OpeningLines, OpeningSide},
};
use crate::{
    algo::face::{
        bones::{FaceBone, FaceBoneKind},
        landmarks::Landmarks,
    },
    mesh::model::Weights,
};

/// The most samples of the skin, besides landmarks.
const SAMPLES: usize = 1600;
/// Weight of a landmark, as a share of the whole skin's weight.
const LANDMARK: f64 = 0.002;
/// Weight of the pull towards the mean of the field over a bone's patch, as a share of the patch's weight.
const HOLD: f64 = 0.02;
/// Weight of the distance of two landmarks, as a share of the whole skin's weight.
const PAIR: f64 = 0.02;
/// Landmarks whose distance matters more than their positions: lips, lids, corners of the mouth, inner brows.
const PAIRS: [[usize; 2]; 9] =
    [[61, 67], [62, 66], [63, 65], [37, 41], [38, 40], [43, 47], [44, 46], [54, 48], [22, 21]];
/// Number of the first [`PAIRS`] whose first landmark must stay above the second: lips and lids.
const APART: usize = 7;
/// Stiffness between bones with common skin.
const STIFF: f64 = 0.01;
/// Factor of the field. What bones cannot follow is lost, and makes the rest smaller than the field on average.
const GAIN: f64 = 1.09;
/// Largest area of triangles that are ignored, as a share of their longest edge squared.
pub(super) const SLIVER: f32 = 1e-3;
/// Shares by which the movements of bones are brought nearer to each other where skin folds, one a round.
const ROUNDS: [f32; 8] = [0.3, 0.3, 0.3, 0.3, 0.6, 0.6, 0.6, 0.6];
/// The most that a repair of folds takes of an expression, as a share of the furthest movement. Skin may crease; an
/// expression may not vanish for it.
const TAKEN: f32 = 0.05;

/// A head with its bones and weights, ready to be posed many times.
pub struct FittedFace<'a> {
    points: &'a [Vec3],
    triangles: &'a [[u32; 3]],
    weights: &'a Weights,
    bones: &'a [FaceBone],
    landmarks: &'a Landmarks,
    /// Indices of the bones that are solved for, and the index of each bone among them.
    skin: Vec<usize>,
    samples: Vec<Sample>,
    /// The Cholesky factor.
    factor: Vec<f64>,
    /// Weight of each bone's patch.
    patch: Vec<f64>,
    /// Triangles that bones move.
    moving: Vec<u32>,
    /// Points of lips and lids of which the first must stay above the second.
    apart: Vec<[u32; 2]>,
    /// Bones of skin that mirror each other.
    pairs: Vec<[usize; 2]>,
}

/// A point of the skin that should follow the field.
#[derive(Clone)]
struct Sample {
    /// Place at which the field is sampled; for landmarks the landmark itself.
    place: Vec3,
    known: OpeningSide,
    counts: f64,
    /// Unknowns and their weights.
    influences: Vec<(u32, f64)>,
    /// Weight of the jaw bone.
    jaw: f64,
    /// The other sample of a pair whose difference counts, with the jaw's weight there.
    minus: Option<(Vec3, OpeningSide, f64)>,
}

impl<'a> FittedFace<'a> {
    /// Prepares a head for posing.
    ///
    /// All in head space. `triangles` are checked for flips (an empty list: no check). `mask` marks points of the
    /// face's skin (an empty list: all points that bones move); `weights` as [`apply`](super::apply) takes them.
    /// Inconsistent input (too few weights, joints without a bone, triangles without points) is skipped. Cost: points
    /// times influences squared, and bones cubed.
    pub fn new(
        points: &'a [Vec3],
        triangles: &'a [[u32; 3]],
        mask: &[bool],
        weights: &'a Weights,
        bones: &'a [FaceBone],
        landmarks: &'a Landmarks,
    ) -> Self {
        let skin: Vec<usize> = (0..bones.len()).filter(|&bone| bones[bone].kind == FaceBoneKind::Skin).collect();
        let mut unknown_of = vec![u32::MAX; bones.len()];
        for (unknown, &bone) in skin.iter().enumerate() {
            unknown_of[bone] = unknown as u32;
        }
        let mut face = Self {
            points,
            triangles,
            weights,
            bones,
            landmarks,
            skin,
            samples: Vec::new(),
            factor: Vec::new(),
            patch: Vec::new(),
            moving: Vec::new(),
            apart: Vec::new(),
            pairs: mirrored_pairs(bones, landmarks),
        };
        let Some(opening_lines) = OpeningLines::new(landmarks) else { return face };
        face.gather(&opening_lines, &unknown_of, mask);
        face.factorise();
        // Slivers without an area have no orientation.
        let has_area = |[a, b, c]: [usize; 3]| {
            let [a, b, c] = [a, b, c].map(|corner| points[corner]);
            let longest = (b - a).length_squared().max((c - a).length_squared()).max((c - b).length_squared());
            (b - a).cross(c - a).length() > SLIVER * longest
        };
        face.moving = (0..triangles.len() as u32)
            .filter(|&index| {
                let corners = triangles[index as usize].map(|corner| corner as usize);
                corners.iter().all(|&corner| corner < points.len())
                    && has_area(corners)
                    && corners.iter().any(|&corner| face.influences(corner).any(|(joint, _)| joint >= 2))
            })
            .collect();
        face
    }

    /// The pose of each bone, as [`pose`](super::pose) gives it, for a mix of units.
    ///
    /// Bones of skin whose triangles would flip are brought nearer to equal movements, by 5 % of the furthest movement
    /// at most, and alike on both sides in a mix that is alike on both sides; lips or lids that would cross are moved
    /// apart.
    /// Cost: points times moves of the field.
    pub fn pose(&self, mix: &Mix, units: &UnitSet) -> Vec<BonePose> {
        let rest = vec![BonePose::REST; self.bones.len()];
        if mix.is_rest() {
            return rest;
        }
        let Some(field) = Field::new(mix, units, self.bones, self.landmarks) else { return rest };
        let mut poses = self.solve(&field);
        self.repair(&mut poses, mix.strengths.iter().all(|[left, right]| left == right));
        poses
    }

    /// The influences of a point; none past the end of `weights`.
    fn influences(&self, point: usize) -> impl Iterator<Item = (u32, f32)> + '_ {
        let range = match (self.weights.starts.get(point), self.weights.starts.get(point + 1)) {
            (Some(&start), Some(&end)) => start as usize..end as usize,
            _ => 0..0,
        };
        let joints = self.weights.joints.get(range.clone()).unwrap_or_default();
        joints.iter().copied().zip(self.weights.values.get(range).unwrap_or_default().iter().copied())
    }

    /// Takes samples on the whole skin, and at the landmarks.
    fn gather(&mut self, opening_lines: &OpeningLines, unknown_of: &[u32], mask: &[bool]) {
        let mut lower_share = vec![0.5_f32; self.points.len()];
        let mut samples = Vec::new();
        let thinned = self.thinned(mask);
        for (index, &point) in self.points.iter().enumerate() {
            let Some(mut sample) = self.sample(index, point, unknown_of) else { continue };
            let (mut lower, mut all) = (0.0, 0.0);
            for (joint, weight) in self.influences(index) {
                let Some(bone) = (joint as usize).checked_sub(2).and_then(|bone| self.bones.get(bone)) else {
                    continue;
                };
                all += weight;
                if bone.kind == FaceBoneKind::Jaw || !opening_lines.above_mouth(bone.position) {
                    lower += weight;
                }
            }
            lower_share[index] = lower / all.max(1e-6);
            if !thinned.get(index).copied().unwrap_or(false) {
                continue;
            }
            // Where lips touch, only the skin's own weights tell the upper from the lower one.
            if opening_lines.near_mouth_line(point) {
                match lower_share[index] {
                    share if share > 0.8 => sample.known.upper_lip = Some(false),
                    share if share < 0.2 => sample.known.upper_lip = Some(true),
                    _ => continue,
                }
            }
            samples.push(sample);
        }
        let each = 1.0 / samples.len().max(1) as f64;
        for sample in &mut samples {
            sample.counts = each;
        }
        let candidates: Vec<usize> = (0..self.points.len())
            .filter(|&index| mask.is_empty() || mask.get(index).copied().unwrap_or(false))
            .collect();
        let mut at_marks = Vec::new();
        for (mark, &place) in self.landmarks.points.iter().enumerate() {
            let known = OpeningSide::of_landmark(mark);
            let fits = |index: usize| match known.upper_lip {
                None => true,
                Some(upper) => (lower_share[index] < 0.5) == upper,
            };
            let nearest = candidates.iter().copied().filter(|&index| fits(index)).min_by(|&a, &b| {
                let [a, b] = [a, b].map(|index| self.points[index].distance_squared(place));
                a.total_cmp(&b)
            });
            let sample = nearest.and_then(|index| self.sample(index, place, unknown_of));
            if let Some(mut sample) = sample.clone() {
                sample.known = known;
                sample.counts = LANDMARK;
                samples.push(sample);
            }
            at_marks.push(nearest.zip(sample));
        }
        for (number, [a, b]) in PAIRS.into_iter().enumerate() {
            let (Some(Some((point, one))), Some(Some((other_point, other)))) = (at_marks.get(a), at_marks.get(b))
            else {
                continue;
            };
            let minus = Some((other.place, OpeningSide::of_landmark(b), other.jaw));
            let known = OpeningSide::of_landmark(a);
            let mut pair = Sample { known, counts: PAIR, minus, ..one.clone() };
            for &(unknown, weight) in &other.influences {
                match pair.influences.iter_mut().find(|(known, _)| *known == unknown) {
                    Some((_, known)) => *known -= weight,
                    None => pair.influences.push((unknown, -weight)),
                }
            }
            samples.push(pair);
            if number < APART && point != other_point {
                self.apart.push([*point as u32, *other_point as u32]);
            }
        }
        self.samples = samples;
    }

    /// Marks the points of the mask that become samples: all, or on a dense mesh about [`SAMPLES`] of them. A point and
    /// its mirror image are both taken or both left out.
    fn thinned(&self, mask: &[bool]) -> Vec<bool> {
        let inside = |index: usize| mask.is_empty() || mask.get(index).copied().unwrap_or(false);
        let count = (0..self.points.len()).filter(|&index| inside(index)).count();
        if count <= SAMPLES {
            return (0..self.points.len()).map(inside).collect();
        }
        let fine = 1000.0 / self.landmarks.eye_distance().max(f32::MIN_POSITIVE);
        let limit = (SAMPLES as f64 / count as f64 * f64::from(u32::MAX)) as u64;
        let taken = |point: &Vec3| {
            let place = [(point.x - self.landmarks.middle).abs(), point.y, point.z];
            let mut mixed = 0x9e37_79b9_7f4a_7c15_u64;
            for value in place {
                mixed = (mixed ^ ((value * fine).round() as i64 as u64)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
                mixed ^= mixed >> 29;
            }
            (mixed >> 32) < limit
        };
        self.points.iter().enumerate().map(|(index, point)| inside(index) && taken(point)).collect()
    }

    /// A sample of a point, if bones move it at all.
    fn sample(&self, index: usize, place: Vec3, unknown_of: &[u32]) -> Option<Sample> {
        let mut sample =
            Sample { place, known: OpeningSide::default(), counts: 0.0, influences: Vec::new(), jaw: 0.0, minus: None };
        let mut all = 0.0;
        for (joint, weight) in self.influences(index) {
            let Some(bone) = (joint as usize).checked_sub(2).filter(|&bone| bone < self.bones.len()) else { continue };
            if !weight.is_finite() {
                continue;
            }
            all += weight;
            match self.bones[bone].kind {
                FaceBoneKind::Skin => sample.influences.push((unknown_of[bone], f64::from(weight))),
                FaceBoneKind::Jaw => sample.jaw += f64::from(weight),
                FaceBoneKind::Eye => {}
            }
        }
        (all > 0.02 && place.is_finite() && !sample.influences.is_empty()).then_some(sample)
    }

    /// Sums the normal equations and factorises them.
    fn factorise(&mut self) {
        let size = self.skin.len();
        let mut matrix = vec![0.0; size * size];
        self.patch = vec![0.0; size];
        for sample in &self.samples {
            for &(a, weight) in &sample.influences {
                if sample.minus.is_none() {
                    self.patch[a as usize] += sample.counts * weight;
                }
                for &(b, other) in &sample.influences {
                    matrix[a as usize * size + b as usize] += sample.counts * weight * other;
                }
            }
        }
        let floor = 1e-6 / size.max(1) as f64;
        let common = matrix.clone();
        for a in 0..size {
            matrix[a * size + a] += HOLD * self.patch[a] + floor;
            for b in (0..size).filter(|&b| b != a) {
                matrix[a * size + a] += STIFF * common[a * size + b];
                matrix[a * size + b] -= STIFF * common[a * size + b];
            }
        }
        cholesky(&mut matrix, size);
        self.factor = matrix;
    }

    /// The poses that follow a field best, before folds are repaired.
    fn solve(&self, field: &Field) -> Vec<BonePose> {
        let size = self.skin.len();
        let mut poses: Vec<BonePose> = self.bones.iter().map(|bone| field.turn(bone)).collect();
        let jaw = self.bones.iter().position(|bone| bone.kind == FaceBoneKind::Jaw);
        let jaw = jaw.map(|bone| poses[bone].affine(self.bones[bone].position));
        let mut right = vec![[0.0; 3]; size];
        let mut asked = vec![[0.0; 3]; size];
        for sample in &self.samples {
            let rest = |place: Vec3, known: OpeningSide, weight: f64| {
                let target = field.at(place, known).as_dvec3() * GAIN;
                match jaw {
                    Some(jaw) if weight > 0.0 => target - (jaw.transform_point3(place) - place).as_dvec3() * weight,
                    _ => target,
                }
            };
            let mut target = rest(sample.place, sample.known, sample.jaw);
            if let Some((place, known, weight)) = sample.minus {
                target -= rest(place, known, weight);
            }
            for &(unknown, weight) in &sample.influences {
                for axis in 0..3 {
                    let value = sample.counts * weight * target[axis];
                    right[unknown as usize][axis] += value;
                    if sample.minus.is_none() {
                        asked[unknown as usize][axis] += value;
                    }
                }
            }
        }
        // The target of a patch is the mean of the field over it.
        for unknown in 0..size {
            if self.patch[unknown] > 0.0 {
                for axis in 0..3 {
                    right[unknown][axis] += HOLD * asked[unknown][axis];
                }
            }
        }
        substitute(&self.factor, size, &mut right);
        for (&bone, solved) in self.skin.iter().zip(&right) {
            let movement = Vec3::new(solved[0] as f32, solved[1] as f32, solved[2] as f32);
            poses[bone].translation = limited(movement, self.landmarks);
        }
        poses
    }
}

/// Bones of skin that are each nearest to the other's mirror image, and near it.
fn mirrored_pairs(bones: &[FaceBone], landmarks: &Landmarks) -> Vec<[usize; 2]> {
    let near = 0.1 * landmarks.eye_distance();
    let image = |bone: &FaceBone| bone.position.with_x(2.0 * landmarks.middle - bone.position.x);
    let partner = |of: usize| {
        let skin = (0..bones.len()).filter(|bone| bones[*bone].kind == FaceBoneKind::Skin);
        let away = |bone: &usize| bones[*bone].position.distance(image(&bones[of]));
        skin.min_by(|a, b| away(a).total_cmp(&away(b))).filter(|bone| away(bone) < near)
    };
    let partners: Vec<Option<usize>> = (0..bones.len()).map(partner).collect();
    let mutual = |bone: usize| partners[bone].filter(|other| *other > bone && partners[*other] == Some(bone));
    (0..bones.len()).filter_map(|bone| Some([bone, mutual(bone)?])).collect()
}

/// Factorises a symmetric positive matrix in place, L in the lower triangle. A pivot lost to rounding becomes 1.
fn cholesky(matrix: &mut [f64], size: usize) {
    for row in 0..size {
        for column in 0..=row {
            let mut sum = matrix[row * size + column];
            for k in 0..column {
                sum -= matrix[row * size + k] * matrix[column * size + k];
            }
            matrix[row * size + column] = if row == column {
                if sum > 0.0 { sum.sqrt() } else { 1.0 }
            } else {
                sum / matrix[column * size + column]
            };
        }
    }
}

/// Solves for three right-hand sides at once.
#[expect(clippy::needless_range_loop, reason = "indices are those of the matrix")]
fn substitute(factor: &[f64], size: usize, right: &mut [[f64; 3]]) {
    for axis in 0..3 {
        for row in 0..size {
            let mut sum = right[row][axis];
            for k in 0..row {
                sum -= factor[row * size + k] * right[k][axis];
            }
            right[row][axis] = sum / factor[row * size + row];
        }
        for row in (0..size).rev() {
            let mut sum = right[row][axis];
            for k in row + 1..size {
                sum -= factor[k * size + row] * right[k][axis];
            }
            right[row][axis] = sum / factor[row * size + row];
        }
    }
}
