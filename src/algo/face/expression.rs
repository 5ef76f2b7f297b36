//! Expressions: displacement fields in normalised face coordinates, and the poses of bones that follow them.
//!
//! A [`Unit`] stands for about one facial muscle (an action unit of the Facial Action Coding System): a few landmarks
//! of the skin, and the displacement of each. It is written once, in shares of the eye distance, for the character's
//! left, and fits any head that has [`Landmarks`] and any number of bones. An [`Expression`] names units and strengths.
//!
//! [`pose_sampled`] samples the field at the bones. Few bones cannot follow it everywhere, and each drags its whole
//! patch of skin along, so [`pose`] and [`FittedFace`] solve for the bone movements whose *skinned surface* follows the
//! field best, above all at the landmarks. So a face looks the same with ten bones or eighty.

mod bone_fit;
mod field;
mod fold_repair;
mod openings;
mod set;
mod text;
mod vrm;
mod work;

use bevy::math::ops;
use glam::{Affine3A, Quat, Vec3};

use self::field::Field;
use super::{
    bones::{FaceBone, FaceBoneKind},
    landmarks::Landmarks,
};
use crate::mesh::{model::Weights, skinning::skin_points};

pub use self::{
    bone_fit::FittedFace,
    fold_repair::repair_folds,
    set::{ExpressionSet, UnitSet},
    text::{Expression, ExpressionError, Gaze, MAX_STRENGTH, MAX_TEXT, Part, Sides, Unit, UnitMove, UnitUse},
    vrm::vrm_mixes,
    work::visited_points,
};

/// Largest distance that a bone is moved, in eye distances.
const FURTHEST: f32 = 0.9;

/// A bone's offset from rest in head space.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BonePose {
    /// Movement of the bone, in units of the mesh.
    pub translation: Vec3,
    /// Rotation of the bone about its own (moved) position.
    pub rotation: Quat,
}

impl BonePose {
    /// The pose at rest.
    pub const REST: Self = Self { translation: Vec3::ZERO, rotation: Quat::IDENTITY };

    /// Matrix that takes points of the rest pose to the posed ones, for a bone that rests at `position`.
    pub fn affine(&self, position: Vec3) -> Affine3A {
        let matrix = glam::Mat3A::from_quat(self.rotation);
        Affine3A {
            matrix3: matrix,
            translation: glam::Vec3A::from(position + self.translation) - matrix * glam::Vec3A::from(position),
        }
    }

    /// The rest of the pose of a bone at `position` that another bone's pose leaves to it: the pose of a joint below that
    /// bone's. Rounding is no movement.
    pub fn below(&self, position: Vec3, carrier: &Self, carrier_position: Vec3) -> Self {
        let back = carrier.affine(carrier_position).inverse();
        let moved = back.transform_point3(position + self.translation);
        let turned = (carrier.rotation.inverse() * self.rotation).normalize();
        let slack = 1e-5 * (position - carrier_position).length();
        Self {
            translation: if moved.distance(position) > slack { moved - position } else { Vec3::ZERO },
            rotation: if turned.xyz().length() > 1e-5 { turned } else { Quat::IDENTITY },
        }
    }
}

/// Strength of each unit on each side: any blend of expressions reduces to a mix.
#[derive(Debug, Clone, PartialEq)]
pub struct Mix {
    /// Left and right strength of each unit, in the order of the [`UnitSet`], each from 0 to the unit's limit.
    pub strengths: Vec<[f32; 2]>,
}

impl Mix {
    /// The mix without movement.
    pub fn rest(units: &UnitSet) -> Self {
        Self { strengths: vec![[0.0; 2]; units.units().len()] }
    }

    /// A blend of expressions: strengths of the same unit add up, to the unit's limit at most.
    ///
    /// Strengths of expressions are cut to 0..=[`MAX_STRENGTH`], NaN counts as 0. Units that are not in `units` are left
    /// out (an [`ExpressionSet`] has no such expressions).
    pub fn of(expressions: &[(&Expression, f32)], units: &UnitSet) -> Self {
        let mut mix = Self::rest(units);
        for (expression, strength) in expressions {
            for used in &expression.units {
                mix.add(&used.unit, used.side, used.strength * between(*strength, MAX_STRENGTH), units);
            }
        }
        mix
    }

    /// Adds one unit on one side or both; returns `false` if there is no such unit.
    pub fn add(&mut self, unit: &str, side: Sides, strength: f32, units: &UnitSet) -> bool {
        let Some(index) = units.index(unit) else { return false };
        let (Some(strengths), Some(unit)) = (self.strengths.get_mut(index), units.units().get(index)) else {
            return false;
        };
        for (side_index, strengths) in strengths.iter_mut().enumerate() {
            if side.has(side_index) {
                *strengths = between(*strengths + between(strength, unit.limit), unit.limit);
            }
        }
        true
    }

    /// Returns `true` if nothing moves.
    pub fn is_rest(&self) -> bool {
        self.strengths.iter().all(|strengths| strengths == &[0.0; 2])
    }
}

/// `value` clamped to 0..=`most`; 0 for NaN.
fn between(value: f32, most: f32) -> f32 {
    if value.is_nan() { 0.0 } else { value.clamp(0.0, most) }
}

/// Poses of bones for a blend of expressions (strengths 0..=[`MAX_STRENGTH`]) whose skin follows the blend best.
///
/// All in head space: rest positions of `bones`, `points` and `landmarks`, and the poses. `weights` as [`apply`] takes
/// them. This is [`FittedFace`] without triangles, hence without a check for flipped triangles: a few milliseconds for
/// 11,000 points and 40 bones. Keep a [`FittedFace`] to pose the same head often.
pub fn pose(
    set: &ExpressionSet,
    wanted: &[(&Expression, f32)],
    bones: &[FaceBone],
    weights: &Weights,
    points: &[Vec3],
    landmarks: &Landmarks,
) -> Vec<BonePose> {
    let units = set.unit_set();
    FittedFace::new(points, &[], &[], weights, bones, landmarks, units).pose(&Mix::of(wanted, units))
}

/// Poses of bones for a mix of units, without regard to weights: the field, sampled at the bones.
///
/// Skin bones move, the jaw bone turns about its position and carries that of the tongue, eye bones turn. Skin bones follow the whole field, as if the
/// jaw bone held no skin. All bones rest if the landmarks are degenerate. Cost: bones times moves.
pub fn pose_sampled(mix: &Mix, units: &UnitSet, bones: &[FaceBone], landmarks: &Landmarks) -> Vec<BonePose> {
    let Some(field) = Field::new(mix, units, bones, landmarks) else { return vec![BonePose::REST; bones.len()] };
    bones
        .iter()
        .map(|bone| match bone.kind {
            FaceBoneKind::Skin => BonePose {
                translation: limited(field.at(bone.position, openings::OpeningSide::default()), landmarks),
                rotation: Quat::IDENTITY,
            },
            _ => field.turn(bone),
        })
        .collect()
}

/// A movement clamped to the longest that a bone may make; zero if it is not finite.
fn limited(movement: Vec3, landmarks: &Landmarks) -> Vec3 {
    if movement.is_finite() { movement.clamp_length_max(FURTHEST * landmarks.eye_distance()) } else { Vec3::ZERO }
}

/// The points of a head in an expression, by linear blend skinning.
///
/// `points` in head space; `weights` as [`face_weights`](super::weights) makes them: joint 0 is the neck and 1 the
/// head, which stay at rest, 2 + i is `bones[i]`. Bones without a pose stay at rest. A point without weights stays.
pub fn apply(points: &[Vec3], weights: &Weights, bones: &[FaceBone], poses: &[BonePose]) -> Vec<Vec3> {
    work::visit(points.len());
    let mut matrices = vec![Affine3A::IDENTITY; 2];
    matrices.extend(
        bones
            .iter()
            .enumerate()
            .map(|(index, bone)| poses.get(index).copied().unwrap_or(BonePose::REST).affine(bone.position)),
    );
    let mut posed = Vec::new();
    skin_points(points, weights, &matrices, &mut posed);
    posed
}

/// A turn by degrees about the x axis, which opens a jaw when positive.
fn pitch(degrees: f32) -> Quat {
    let half = degrees.to_radians() * 0.5;
    Quat::from_xyzw(ops::sin(half), 0.0, 0.0, ops::cos(half))
}

/// A turn by degrees about the y axis, to the character's left when positive.
fn yaw(degrees: f32) -> Quat {
    let half = degrees.to_radians() * 0.5;
    Quat::from_xyzw(0.0, ops::sin(half), 0.0, ops::cos(half))
}
