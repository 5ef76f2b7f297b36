//! Directions in which a human stands and faces.

use bevy::math::{Mat3, Quat, Vec3};

use crate::{
    rig::animation::humanoid::{BodySide, HumanBone, HumanJoints, LimbBone},
    solve::rotate::{direction, perpendicular_or_any},
};

/// Rotation to the axes of a human (left, up, forward) from X, Y and Z, by the places of its limbs; `None` for any other
/// figure.
pub fn human_axes(bones: &HumanJoints, place: &dyn Fn(usize) -> Vec3) -> Option<Quat> {
    let place = |bone: HumanBone| bones.get(&bone)?.first().map(|joint| place(*joint));
    let limb = |side, bone| place(HumanBone::Limb(side, bone));
    let middle = |bone| Some(limb(BodySide::Left, bone)?.midpoint(limb(BodySide::Right, bone)?));
    let top = place(HumanBone::Head).or_else(|| place(HumanBone::Neck)).or_else(|| middle(LimbBone::UpperArm));
    let top = top.or_else(|| place(HumanBone::Hips));
    let feet = middle(LimbBone::Foot).or_else(|| middle(LimbBone::LowerLeg));
    let across = |bone| Some(limb(BodySide::Left, bone)? - limb(BodySide::Right, bone)?);
    let left = across(LimbBone::UpperLeg).or_else(|| across(LimbBone::UpperArm));
    let (top, feet, left) = (top?, feet?, left?);
    // Grounds are level: a figure that leans stands along the nearest axis.
    let up = snapped(direction(top - feet)?, 0.8);
    let left = snapped(perpendicular_or_any(up, &[left]), 0.985);
    let left = perpendicular_or_any(up, &[left]);
    Some(Quat::from_mat3(&Mat3::from_cols(left, up, left.cross(up))).normalize())
}

/// The axis next to a direction, if the cosine between them is large enough.
fn snapped(direction: Vec3, least: f32) -> Vec3 {
    let axes = [Vec3::X, Vec3::Y, Vec3::Z].into_iter().flat_map(|axis| [axis, -axis]);
    axes.into_iter().find(|axis| axis.dot(direction) >= least).unwrap_or(direction)
}
