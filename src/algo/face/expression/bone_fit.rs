//! Bone movements whose skinned surface follows the field.
//!
//! Skin moves by the weighted mean of its bones' movements. With movements sampled from the field, it would fall short
//! at the field's peaks and move where it should stay. So the movements are solved for: least squares over the points
//! of the skin, in which landmarks count most, with a weak pull towards the mean of the field over each bone's own
//! patch. With fixed weights the matrix is the same for all expressions and factorised once; as the field is a sum over
//! units, the movements for each unit are solved once, too, when it is first used, and an expression is their sum.

mod factor;
mod moving_skin;
mod pose_problem;
mod samples;
mod separation;
mod targets;

use std::{collections::BTreeMap, sync::OnceLock};

use glam::{DMat3, DVec3, Vec3};
use rayon::prelude::*;

use self::{
    factor::{Factor, SparseMatrix},
    moving_skin::MovingSkin,
    pose_problem::Repair,
    samples::{Mark, Sample},
    targets::UnitTargets,
};
use super::{
    BonePose, ExpressionSet, Mix, Sides, UnitSet,
    field::{Field, jaw_pivot},
    limited,
    openings::OpeningLines,
    work::visit,
};
use crate::{
    algo::face::{
        bones::{FaceBone, FaceBoneKind},
        landmarks::Landmarks,
    },
    mesh::model::Weights,
};

/// Weight of the pull towards the mean of the field over a bone's patch, as a share of the patch's weight.
const HOLD: f64 = 0.01;
/// Stiffness between bones with common skin.
const STIFF: f64 = 0.01;
/// Factor of the field. What bones cannot follow is lost, and makes the rest smaller than the field on average.
const GAIN: f64 = 1.09;
/// Largest area of triangles that are ignored, as a share of their longest edge squared.
pub(super) const SLIVER: f32 = 1e-3;
/// Shares by which the movements of bones are brought nearer to each other where skin folds, one a round.
const ROUNDS: [f32; 8] = [0.3, 0.3, 0.3, 0.3, 0.6, 0.6, 0.6, 0.6];
/// Rounds without fewer problems after which a repair ends.
const PATIENCE: usize = 2;
/// The most that a repair of folds takes of each unit of a mix, as a share of the unit's furthest movement. Skin may crease; an
/// expression may not vanish for it.
const TAKEN: f32 = 0.05;

/// A head with its bones and weights, ready to be posed many times.
pub struct FittedFace {
    bones: Vec<FaceBone>,
    landmarks: Landmarks,
    units: UnitSet,
    /// Indices of the bones that are solved for.
    skin: Vec<usize>,
    /// The lines of mouth and eyes; `None` for degenerate landmarks, with which nothing moves.
    opening_lines: Option<OpeningLines>,
    samples: Vec<Sample>,
    /// Factor of the normal equations.
    factor: Factor,
    /// Targets of the units at the samples, kept for other weights.
    targets: Option<UnitTargets>,
    /// Movements of the skin bones for each unit on the left and the right side at full strength, without the jaw.
    unit_movements: Vec<[OnceLock<Vec<DVec3>>; 2]>,
    jaw: JawMovements,
    /// The skin that bones move.
    moving: MovingSkin,
    /// Bones of skin that mirror each other; one in the middle stands twice.
    pairs: Vec<[usize; 2]>,
    /// Number of folds of a pose that people do not notice: a thousandth of the mask's triangles.
    tolerated_folds: usize,
}

/// Movements of the skin bones that belong to the jaw's, which are linear in its rotation matrix and its shift.
#[derive(Default)]
struct JawMovements {
    /// Coefficients of the rotation of the skin below the mouth, less the identity.
    skin: Vec<DVec3>,
    /// Coefficients of the rotation of the jaw bone, less the identity: what it moves need not be moved by others.
    rotation: Vec<DVec3>,
    /// Coefficients of the jaw bone's shift.
    shift: Vec<f64>,
}

impl FittedFace {
    /// Prepares a head for posing.
    ///
    /// All in head space. `triangles` are checked for flips (an empty list: no check). `mask` marks points of the
    /// face's skin (an empty list: all points that bones move); `weights` as [`apply`](super::apply) takes them.
    /// Inconsistent input (too few weights, joints without a bone, triangles without points) is skipped. Cost: points
    /// times influences squared, and bones times the square of how many lie side by side.
    pub fn new(
        points: &[Vec3],
        triangles: &[[u32; 3]],
        mask: &[bool],
        weights: &Weights,
        bones: &[FaceBone],
        landmarks: &Landmarks,
        units: &UnitSet,
    ) -> Self {
        let mut face = Self {
            bones: bones.to_vec(),
            landmarks: landmarks.clone(),
            units: units.clone(),
            skin: (0..bones.len()).filter(|&bone| bones[bone].kind == FaceBoneKind::Skin).collect(),
            opening_lines: OpeningLines::new(landmarks),
            samples: Vec::new(),
            factor: Factor::default(),
            targets: None,
            unit_movements: unsolved(units),
            jaw: JawMovements::default(),
            moving: MovingSkin::default(),
            pairs: mirrored_pairs(bones, landmarks),
            tolerated_folds: 0,
        };
        let Some(opening_lines) = face.opening_lines.clone() else { return face };
        visit(points.len());
        let (samples, facing) = samples::gather(points, mask, weights, bones, landmarks, &opening_lines);
        face.samples = samples;
        face.factorise();
        face.jaw = face.jaw_movements(&opening_lines);
        face.moving = MovingSkin::new(points, triangles, weights, bones, &facing);
        let is_facial = |corners: &&[u32; 3]| {
            mask.is_empty() || corners.iter().all(|corner| mask.get(*corner as usize).copied().unwrap_or(false))
        };
        face.tolerated_folds = triangles.iter().filter(is_facial).count() / 1000;
        face
    }

    /// The pose of each bone, as [`pose`](super::pose) gives it, for a mix of the units that the face was made with.
    ///
    /// Bones of skin whose triangles would flip are brought nearer to equal movements, by 5 % of the furthest movement of
    /// each unit at most, and alike on both sides in a mix that is alike on both sides; lips or lids that would cross are
    /// moved apart.
    /// Cost: points that bones move times rounds of repair, and for each unit once samples times moves of the field.
    pub fn pose(&self, mix: &Mix) -> Vec<BonePose> {
        let mut poses = self.pose_and_repair(mix).0;
        let used = mix.strengths.iter().filter(|strengths| **strengths != [0.0; 2]).count();
        self.separate(&mut poses, is_alike(mix), used > 1);
        poses
    }

    /// The pose of each bone before lips and lids that still cross are separated, and what its repair took and left.
    pub(super) fn pose_and_repair(&self, mix: &Mix) -> (Vec<BonePose>, Repair) {
        let rest = || (vec![BonePose::REST; self.bones.len()], Repair::none(mix));
        let Some(opening_lines) = self.opening_lines.as_ref().filter(|_| !mix.is_rest()) else { return rest() };
        let Some(field) = Field::new(mix, &self.units, &self.bones, &self.landmarks) else { return rest() };
        visit(self.moving.points.len());
        let mut poses = self.solve(mix, &field, opening_lines);
        if self.landmarks.symmetric && is_alike(mix) {
            self.mirror(&mut poses);
        }
        let repair = self.repair(&mut poses, mix, opening_lines);
        (poses, repair)
    }

    /// Share of the furthest movement of each unit of a mix that mending of folds takes, on the left and on the right: 0.05 at
    /// most. A change of a bone is charged to the units that move it, in their shares.
    pub fn taken(&self, mix: &Mix) -> Vec<[f32; 2]> {
        self.pose_and_repair(mix).1.taken
    }

    /// Largest share that mending of folds takes of each unit, by its name: of the unit alone and in each of the six expressions,
    /// all at full strength. Cost: a pose of each.
    pub fn taken_of_units(&self, set: &ExpressionSet) -> BTreeMap<String, f32> {
        let alone = |name: &str| {
            let mut mix = Mix::rest(&self.units);
            mix.add(name, Sides::Both, 1.0, &self.units);
            mix
        };
        let mut mixes: Vec<Mix> = self.units.units().iter().map(|unit| alone(&unit.name)).collect();
        mixes.extend(set.six().map(|expression| Mix::of(&[(expression, 1.0)], &self.units)));
        let taken: Vec<Vec<[f32; 2]>> = mixes.par_iter().map(|mix| self.taken(mix)).collect();
        let most = |unit: usize| taken.iter().flat_map(|taken| taken[unit]).fold(0.0, f32::max);
        self.units.units().iter().enumerate().map(|(number, unit)| (unit.name.clone(), most(number))).collect()
    }

    /// Face as it is, which keeps what units ask of its skin for [`FittedFace::with_weights`].
    pub(super) fn keeping_targets(mut self) -> Self {
        self.targets = Some(UnitTargets::new(&self.units));
        self
    }

    /// Head with other weights, as [`FittedFace::new`] makes it; what is known of units is kept.
    pub(super) fn with_weights(
        self,
        points: &[Vec3],
        triangles: &[[u32; 3]],
        mask: &[bool],
        weights: &Weights,
    ) -> Self {
        let Self { bones, landmarks, units, samples, targets, .. } = self;
        let mut face = Self::new(points, triangles, mask, weights, &bones, &landmarks, &units);
        if let (Some(targets), Some(lines)) = (targets, &face.opening_lines) {
            face.targets = Some(targets.for_samples(&samples, &face.samples, &units, lines, &landmarks));
        }
        face
    }

    /// Sums the normal equations and factorises them.
    fn factorise(&mut self) {
        let size = self.skin.len();
        let mut matrix = SparseMatrix::zero(size);
        let mut patch = vec![0.0; size];
        for sample in &self.samples {
            for &(a, weight) in &sample.influences {
                if sample.minus.is_none() {
                    patch[a as usize] += sample.counts * weight;
                }
                for &(b, other) in &sample.influences {
                    matrix.add(a, b, sample.counts * weight * other);
                }
            }
        }
        let floor = 1e-6 / size.max(1) as f64;
        self.factor = matrix.stiffened(STIFF, |bone| HOLD * patch[bone] + floor).factorise();
    }

    /// Movements of the skin bones whose skin follows a displacement best.
    fn movements(&self, displacement: impl Fn(&Mark) -> DVec3) -> Vec<DVec3> {
        self.movements_to(self.samples.iter().map(|sample| sample.target(&displacement)))
    }

    /// Movements of the skin bones that bring each sample nearest to its target.
    fn movements_to(&self, targets: impl Iterator<Item = DVec3>) -> Vec<DVec3> {
        visit(self.samples.len());
        let mut right = vec![DVec3::ZERO; self.skin.len()];
        for (sample, target) in self.samples.iter().zip(targets) {
            // The mean of the field over a bone's patch is a target, too.
            let counts = if sample.minus.is_none() { sample.counts * (1.0 + HOLD) } else { sample.counts };
            for &(unknown, weight) in &sample.influences {
                right[unknown as usize] += counts * weight * target;
            }
        }
        self.factor.solve(&mut right);
        right
    }

    fn jaw_movements(&self, opening_lines: &OpeningLines) -> JawMovements {
        let pivot = jaw_pivot(&self.bones, &self.landmarks);
        let share = |mark: &Mark| f64::from(opening_lines.jaw(mark.place, mark.known)) * GAIN;
        JawMovements {
            skin: self.movements(|mark| (mark.place - pivot).as_dvec3() * share(mark)),
            rotation: self.movements(|mark| (pivot - mark.place).as_dvec3() * mark.jaw),
            shift: self.movements(|mark| DVec3::splat(-mark.jaw)).into_iter().map(|movement| movement.x).collect(),
        }
    }

    /// The movements for one unit on one side, without the jaw; solved when they are first asked for.
    fn unit_movements(&self, unit: usize, side: usize, opening_lines: &OpeningLines) -> &[DVec3] {
        self.unit_movements[unit][side].get_or_init(|| {
            let field = Field::of_unit(&self.units.units()[unit], side, opening_lines, &self.landmarks);
            match &self.targets {
                Some(targets) => self.movements_to(targets.of(unit, side, &self.samples, &field).iter().copied()),
                None => self.movements(|mark| asked(&field, mark)),
            }
        })
    }

    /// Gives the bones of each pair the mean of their movements: the skin of a symmetric head may be sampled and cut into
    /// triangles otherwise on its two sides.
    fn mirror(&self, poses: &mut [BonePose]) {
        let mut movements: Vec<Vec3> = poses.iter().map(|pose| pose.translation).collect();
        self.even_out(&mut movements);
        for &bone in self.pairs.iter().flatten() {
            poses[bone].translation = movements[bone];
        }
    }

    /// The poses that follow a mix best, before folds are repaired.
    fn solve(&self, mix: &Mix, field: &Field, opening_lines: &OpeningLines) -> Vec<BonePose> {
        let mut poses: Vec<BonePose> = self.bones.iter().map(|bone| field.turn(bone)).collect();
        let sides =
            self.unit_movements.iter().zip(&mix.strengths).enumerate().flat_map(|(unit, (known, strengths))| {
                [0, 1].map(|side| (unit, side, f64::from(strengths[side]), known[side].get().is_some()))
            });
        let used: Vec<(usize, usize, f64, bool)> = sides.filter(|(_, _, strength, _)| *strength > 0.0).collect();
        let new: Vec<_> = used.iter().filter(|(.., is_known)| !is_known).collect();
        new.par_iter().for_each(|(unit, side, ..)| {
            self.unit_movements(*unit, *side, opening_lines);
        });
        let mut movements = vec![DVec3::ZERO; self.skin.len()];
        for (unit, side, strength, _) in used {
            for (sum, movement) in movements.iter_mut().zip(self.unit_movements(unit, side, opening_lines)) {
                *sum += *movement * strength;
            }
        }
        let turned = |rotation: glam::Quat, sum: &mut [DVec3], arms: &[DVec3]| {
            let less = DMat3::from_quat(rotation.as_dquat()) - DMat3::IDENTITY;
            for (sum, arm) in sum.iter_mut().zip(arms) {
                *sum += less * *arm;
            }
        };
        if let Some(rotation) = field.skin_jaw() {
            turned(rotation, &mut movements, &self.jaw.skin);
        }
        if let Some(jaw) = self.bones.iter().position(|bone| bone.kind == FaceBoneKind::Jaw) {
            turned(poses[jaw].rotation, &mut movements, &self.jaw.rotation);
            let shift = poses[jaw].translation.as_dvec3();
            for (sum, share) in movements.iter_mut().zip(&self.jaw.shift) {
                *sum += shift * *share;
            }
        }
        for (&bone, movement) in self.skin.iter().zip(movements) {
            poses[bone].translation = limited(movement.as_vec3(), &self.landmarks);
        }
        poses
    }
}

/// True for a mix that is the same on the left and on the right.
fn is_alike(mix: &Mix) -> bool {
    mix.strengths.iter().all(|[left, right]| left == right)
}

/// Displacement that a field asks of a place.
fn asked(field: &Field, mark: &Mark) -> DVec3 {
    field.at(mark.place, mark.known).as_dvec3() * GAIN
}

/// A place for what is solved for each unit on both sides.
fn unsolved<T>(units: &UnitSet) -> Vec<[OnceLock<T>; 2]> {
    units.units().iter().map(|_| [OnceLock::new(), OnceLock::new()]).collect()
}

/// Bones of skin that are each nearest to the other's mirror image, and near it; a bone of the middle with itself.
fn mirrored_pairs(bones: &[FaceBone], landmarks: &Landmarks) -> Vec<[usize; 2]> {
    let near = 0.1 * landmarks.eye_distance();
    let image = |bone: &FaceBone| bone.position.with_x(2.0 * landmarks.middle - bone.position.x);
    let partner = |of: usize| {
        let skin = (0..bones.len()).filter(|bone| bones[*bone].kind == FaceBoneKind::Skin);
        let away = |bone: &usize| bones[*bone].position.distance(image(&bones[of]));
        skin.min_by(|a, b| away(a).total_cmp(&away(b))).filter(|bone| away(bone) < near)
    };
    let partners: Vec<Option<usize>> = (0..bones.len()).map(partner).collect();
    let mutual = |bone: usize| partners[bone].filter(|other| *other >= bone && partners[*other] == Some(bone));
    (0..bones.len()).filter_map(|bone| Some([bone, mutual(bone)?])).collect()
}
