//! Bone movements whose skinned surface follows the field.
//!
//! Skin moves by the weighted mean of its bones' movements. With movements sampled from the field, it would fall short
//! at the field's peaks and move where it should stay. So the movements are solved for: least squares over the points
//! of the skin, in which landmarks count most, with a weak pull towards the mean of the field over each bone's own
//! patch. With fixed weights the matrix is the same for all expressions and factorised once; as the field is a sum over
//! units, the movements for each unit are solved once, too, when it is first used, and an expression is their sum.
//! Bones turn as well as move: a patch of skin that stretches along a jaw or around a lip needs both.

mod moving_skin;
mod normal_equations;
mod pose_problem;
mod region_gains;
mod samples;

use std::sync::OnceLock;

use glam::{DMat3, DVec3, Quat, Vec3};
use rayon::prelude::*;

use self::{
    moving_skin::MovingSkin,
    normal_equations::{Motion, NormalEquations, target},
    region_gains::RegionGains,
    samples::{Mark, Sample, influences},
};
use super::{
    BonePose, Mix, UnitSet,
    field::{Field, jaw_pivot},
    limited, limited_turn,
    openings::OpeningLines,
    turn_of,
};
use crate::{
    algo::face::{
        bones::{FaceBone, FaceBoneKind},
        landmarks::Landmarks,
    },
    mesh::model::Weights,
};

/// Length that a turn of one radian counts as when bones are fitted, in eye distances.
const TURN: f32 = 0.12;
/// Distance from an eyeball's centre up to which skin belongs to its lids, in radii.
const LID: f32 = 1.35;
/// Largest area of triangles that are ignored, as a share of their longest edge squared.
pub(super) const SLIVER: f32 = 1e-3;
/// Shares by which the movements of bones are brought nearer to each other where skin folds, one a round.
const ROUNDS: [f32; 8] = [0.3, 0.3, 0.3, 0.3, 0.6, 0.6, 0.6, 0.6];
/// Rounds without fewer problems after which a repair ends.
const PATIENCE: usize = 2;
/// The most that a repair of folds takes of an expression, as a share of the furthest movement. Skin may crease; an
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
    equations: NormalEquations,
    gains: RegionGains,
    /// Motions of the skin bones for each unit on the left and the right side at full strength, without the jaw.
    unit_motions: Vec<[OnceLock<Vec<Motion>>; 2]>,
    jaw: JawMotions,
    /// The skin that bones move.
    moving: MovingSkin,
    /// Bones of skin that mirror each other.
    pairs: Vec<[usize; 2]>,
    eyeballs: Vec<Eyeball>,
    lids: Vec<LidPoint>,
}

/// An eyeball that is a mesh of its own, which lids slide over.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Eyeball {
    /// Centre, in head space.
    pub center: Vec3,
    /// Radius, in units of the mesh.
    pub radius: f32,
}

/// A point of a lid.
struct LidPoint {
    /// Index of the point in the moving skin.
    point: u32,
    /// Index of the eyeball.
    eyeball: usize,
    /// Distance from the eyeball's centre at rest.
    rest: f32,
}

/// Motions of the skin bones that belong to the jaw's, which are linear in the entries of its rotation matrix, a turn
/// about the x axis, and in its shift.
#[derive(Default)]
struct JawMotions {
    /// For the rotation of the skin below the mouth: for its cosine less one, and for its sine.
    skin: [Vec<Motion>; 2],
    /// For the rotation of the jaw bone, likewise: what it moves need not be moved by others.
    rotation: [Vec<Motion>; 2],
    /// For each axis of its shift.
    shift: [Vec<Motion>; 3],
}

/// A pose before and while its problems are repaired.
pub(super) struct SolvedPose {
    pub poses: Vec<BonePose>,
    /// Turn of each skin bone, as the axis times the angle; zero for others.
    pub turns: Vec<Vec3>,
}

impl SolvedPose {
    /// Sets the motion of a skin bone, within the limits of bones.
    fn set(&mut self, bone: usize, shift: Vec3, turn: Vec3, landmarks: &Landmarks) {
        let turn = limited_turn(turn);
        self.turns[bone] = turn;
        self.poses[bone] = BonePose { translation: limited(shift, landmarks), rotation: turn_of(turn) };
    }
}

impl FittedFace {
    /// Prepares a head for posing.
    ///
    /// All in head space. `triangles` are checked for flips (an empty list: no check). `mask` marks points of the
    /// face's skin (an empty list: all points that bones move); `weights` as [`apply`](super::apply) takes them.
    /// Inconsistent input (too few weights, joints without a bone, triangles without points) is skipped. Cost: points
    /// times influences squared, and bones cubed.
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
            equations: NormalEquations::default(),
            gains: RegionGains::default(),
            unit_motions: units.units().iter().map(|_| [OnceLock::new(), OnceLock::new()]).collect(),
            jaw: JawMotions::default(),
            moving: MovingSkin::default(),
            pairs: mirrored_pairs(bones, landmarks),
            eyeballs: Vec::new(),
            lids: Vec::new(),
        };
        let Some(opening_lines) = face.opening_lines.clone() else { return face };
        let (samples, apart) = samples::gather(points, mask, weights, bones, landmarks, &opening_lines);
        face.samples = samples;
        let length = f64::from(TURN * landmarks.eye_distance());
        face.equations = NormalEquations::new(&face.samples, face.skin.len(), length);
        face.gains = RegionGains::new(&face.samples, bones, &face.skin);
        face.jaw = face.jaw_motions(&opening_lines);
        face.moving = MovingSkin::new(points, triangles, weights, bones, &apart);
        face
    }

    /// The face with eyeballs: lids stay outside of them, or as deep inside as they are at rest.
    pub fn with_eyeballs(mut self, eyeballs: &[Eyeball]) -> Self {
        self.eyeballs = eyeballs.to_vec();
        self.lids.clear();
        let of_skin = |point: usize| {
            let bones = influences(&self.moving.weights, point).filter_map(|(joint, weight)| {
                let bone = self.bones.get((joint as usize).checked_sub(2)?)?;
                (bone.kind == FaceBoneKind::Skin).then_some(weight)
            });
            bones.sum::<f32>() > 0.3
        };
        for (number, ball) in eyeballs.iter().enumerate() {
            for (point, at) in self.moving.points.iter().enumerate() {
                let rest = at.distance(ball.center);
                // Skin behind the middle of the ball is the wall of its socket.
                if rest < LID * ball.radius && at.z > ball.center.z && of_skin(point) {
                    self.lids.push(LidPoint { point: point as u32, eyeball: number, rest });
                }
            }
        }
        self
    }

    /// The pose of each bone, as [`pose`](super::pose) gives it, for a mix of the units that the face was made with.
    ///
    /// Bones of skin whose triangles would flip are brought nearer to equal movements, by 5 % of the furthest movement
    /// at most, and alike on both sides in a mix that is alike on both sides; lips or lids that would cross are moved
    /// apart.
    /// Cost: points that bones move times rounds of repair, and for each unit once samples times moves of the field.
    pub fn pose(&self, mix: &Mix) -> Vec<BonePose> {
        self.mended_pose(mix).0
    }

    /// The pose of each bone, as [`FittedFace::pose`] gives it, and the share of the furthest movement that mending folds
    /// took from it.
    pub fn mended_pose(&self, mix: &Mix) -> (Vec<BonePose>, f32) {
        let rest = vec![BonePose::REST; self.bones.len()];
        let Some(opening_lines) = self.opening_lines.as_ref().filter(|_| !mix.is_rest()) else { return (rest, 0.0) };
        let Some(field) = Field::new(mix, &self.units, &self.bones, &self.landmarks) else { return (rest, 0.0) };
        let mut solved = self.solve(mix, &field, opening_lines);
        let taken = self.repair(&mut solved, mix.strengths.iter().all(|[left, right]| left == right));
        (solved.poses, taken)
    }

    /// Motions of the skin bones whose skin follows a displacement best; in full size, or as they come out.
    fn motions(&self, displacement: impl Fn(&Mark) -> DVec3, in_full: bool) -> Vec<Motion> {
        let targets: Vec<DVec3> = self.samples.iter().map(|sample| target(sample, &displacement)).collect();
        match in_full {
            true => self.gains.motions(&self.equations, &self.samples, &targets),
            false => self.equations.motions(&self.samples, targets.into_iter()),
        }
    }

    fn jaw_motions(&self, opening_lines: &OpeningLines) -> JawMotions {
        let pivot = jaw_pivot(&self.bones, &self.landmarks);
        let share = |mark: &Mark| f64::from(opening_lines.jaw(mark.place, mark.known));
        // Cosine less one, and sine, of a turn about the x axis.
        let arms: [fn(DVec3) -> DVec3; 2] = [|arm: DVec3| arm.with_x(0.0), |arm: DVec3| DVec3::new(0.0, -arm.z, arm.y)];
        let arm = |mark: &Mark| (mark.place - pivot).as_dvec3();
        JawMotions {
            skin: arms.map(|of| self.motions(|mark| of(arm(mark)) * share(mark), true)),
            rotation: arms.map(|of| self.motions(|mark| of(arm(mark)) * -mark.jaw, false)),
            shift: DVec3::AXES.map(|axis| self.motions(|mark| axis * -mark.jaw, false)),
        }
    }

    /// The motions for one unit on one side, without the jaw; solved when they are first asked for.
    fn unit_motions(&self, unit: usize, side: usize, opening_lines: &OpeningLines) -> &[Motion] {
        self.unit_motions[unit][side].get_or_init(|| {
            let field = Field::of_unit(&self.units.units()[unit], side, opening_lines, &self.landmarks);
            self.motions(|mark| field.at(mark.place, mark.known).as_dvec3(), true)
        })
    }

    /// The pose that follows a mix best, before folds are repaired.
    fn solve(&self, mix: &Mix, field: &Field, opening_lines: &OpeningLines) -> SolvedPose {
        let poses: Vec<BonePose> = self.bones.iter().map(|bone| field.turn(bone)).collect();
        let sides = self.unit_motions.iter().zip(&mix.strengths).enumerate().flat_map(|(unit, (known, strengths))| {
            [0, 1].map(|side| (unit, side, f64::from(strengths[side]), known[side].get().is_some()))
        });
        let used: Vec<(usize, usize, f64, bool)> = sides.filter(|(_, _, strength, _)| *strength > 0.0).collect();
        let new: Vec<_> = used.iter().filter(|(.., is_known)| !is_known).collect();
        new.par_iter().for_each(|(unit, side, ..)| {
            self.unit_motions(*unit, *side, opening_lines);
        });
        let mut motions = vec![Motion::default(); self.skin.len()];
        let mut add = |share: f64, more: &[Motion]| {
            for (sum, motion) in motions.iter_mut().zip(more) {
                sum.add(motion, share);
            }
        };
        for (unit, side, strength, _) in used {
            add(strength, self.unit_motions(unit, side, opening_lines));
        }
        let entries = |rotation: Quat| {
            let matrix = DMat3::from_quat(rotation.as_dquat());
            [matrix.y_axis.y - 1.0, matrix.y_axis.z]
        };
        if let Some(rotation) = field.skin_jaw() {
            entries(rotation).into_iter().zip(&self.jaw.skin).for_each(|(share, motions)| add(share, motions));
        }
        if let Some(jaw) = self.bones.iter().position(|bone| bone.kind == FaceBoneKind::Jaw) {
            let turned = entries(poses[jaw].rotation).into_iter().zip(&self.jaw.rotation);
            let shift = poses[jaw].translation.as_dvec3().to_array();
            turned.chain(shift.into_iter().zip(&self.jaw.shift)).for_each(|(share, motions)| add(share, motions));
        }
        let mut solved = SolvedPose { turns: vec![Vec3::ZERO; poses.len()], poses };
        for (&bone, motion) in self.skin.iter().zip(&motions) {
            solved.set(bone, motion.shift.as_vec3(), motion.turn.as_vec3(), &self.landmarks);
        }
        solved
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
