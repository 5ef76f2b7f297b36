//! Bones of a human by the shape of the skeleton, where names say nothing.

use std::collections::BTreeMap;

use bevy::math::Vec3;

use super::{
    BodySide, HumanBone, HumanJoints, LimbBone, SkeletonJoint, ancestors, common_ancestor, complete, is_above, path,
};

/// Length of a bone above which it is a head rather than a neck, as a share of the height from a foot to the last joint.
const HEAD: f32 = 0.085;

/// Joints that stand for bones, by the chains of the skeleton at rest: two that go down are legs, two that branch off above
/// them to the sides are arms, the one that goes up is spine and head. Empty if the skeleton has another shape.
///
/// `up` and `forward` are the directions of the figure; left is on the left of a figure that faces forward.
pub fn by_shape(joints: &[SkeletonJoint], up: Vec3, forward: Vec3) -> HumanJoints {
    let left = up.cross(forward);
    let is_end = |joint: &usize| !joints.iter().any(|other| other.parent == Some(*joint));
    let ends: Vec<usize> = (0..joints.len()).filter(is_end).collect();
    let height = |joint: usize| joints[joint].position.dot(up);
    let aside = |joint: usize| joints[joint].position.dot(left);
    let Some(top) = ends.iter().copied().max_by(|a, b| height(*a).total_cmp(&height(*b))) else {
        return HumanJoints::new();
    };
    let lowest = |side: f32| {
        let of_side = ends.iter().copied().filter(|end| aside(*end) * side > 0.0);
        of_side.min_by(|a, b| height(*a).total_cmp(&height(*b)))
    };
    let outermost = |side: f32| ends.iter().copied().max_by(|a, b| (aside(*a) * side).total_cmp(&(aside(*b) * side)));
    let (Some(left_foot), Some(right_foot)) = (lowest(1.0), lowest(-1.0)) else { return HumanJoints::new() };
    let of_right: Vec<usize> = ancestors(joints, right_foot).collect();
    let Some(hips) = ancestors(joints, left_foot).find(|at| of_right.contains(at)) else { return HumanJoints::new() };
    if !is_above(joints, hips, top) {
        return HumanJoints::new();
    }
    let mut named = BTreeMap::from([(HumanBone::Hips, hips)]);
    for (side, sign, foot) in [(BodySide::Left, 1.0, left_foot), (BodySide::Right, -1.0, right_foot)] {
        let leg = bends(joints, &path(joints, foot, Some(hips)));
        let Some([upper, lower, end, rest @ ..]) = limb_start(joints, &leg).map(|first| &leg[first..]) else {
            return HumanJoints::new();
        };
        named.insert(HumanBone::Limb(side, LimbBone::UpperLeg), *upper);
        named.insert(HumanBone::Limb(side, LimbBone::LowerLeg), *lower);
        named.insert(HumanBone::Limb(side, LimbBone::Foot), *end);
        if let Some(toes) = rest.first() {
            named.insert(HumanBone::Limb(side, LimbBone::Toes), *toes);
        }
        // A figure without arms is no human: a hand has fingers at both sides, which are no legs.
        let is_arm = |end: &usize| is_above(joints, hips, *end) && ![left_foot, right_foot].contains(end);
        let Some(hand) = outermost(sign).filter(is_arm) else { return HumanJoints::new() };
        let trunk: Vec<usize> = path(joints, top, Some(hips));
        let arm: Vec<usize> = path(joints, hand, Some(hips)).into_iter().filter(|at| !trunk.contains(at)).collect();
        let arm = bends(joints, &arm);
        let Some(first) = limb_start(joints, &arm) else { return HumanJoints::new() };
        for (bone, joint) in [LimbBone::UpperArm, LimbBone::LowerArm, LimbBone::Hand].into_iter().zip(&arm[first..]) {
            named.insert(HumanBone::Limb(side, bone), *joint);
        }
    }
    named.insert(HumanBone::Head, head_of(joints, &named, top, height(top) - height(left_foot)));
    complete(joints, &named)
}

/// Joint of the head: the last one of the trunk, or the one before if the last one is the end of the head. `tall` is the height
/// of the last joint above a foot.
fn head_of(joints: &[SkeletonJoint], named: &BTreeMap<HumanBone, usize>, top: usize, tall: f32) -> usize {
    let [left, right] = BodySide::BOTH.map(|side| named.get(&HumanBone::Limb(side, LimbBone::UpperArm)).copied());
    let chest = left.zip(right).and_then(|(left, right)| common_ancestor(joints, left, right));
    // The joint before the last one is a neck or the head only above where the arms branch off.
    let before = joints[top].parent.filter(|before| chest.is_some_and(|chest| is_above(joints, chest, *before)));
    match before {
        Some(before) if !joints[top].has_end => {
            let last = joints[top].position.distance(joints[before].position);
            if last > HEAD * tall { before } else { top }
        }
        _ => top,
    }
}

/// Place in a chain at which its two last long bones begin: arm and forearm, thigh and shin. What follows them is a hand or a
/// foot, whose bones are short.
fn limb_start(joints: &[SkeletonJoint], chain: &[usize]) -> Option<usize> {
    let length = |pair: &[usize]| joints[pair[0]].position.distance(joints[pair[1]].position);
    let lengths: Vec<f32> = chain.windows(2).map(length).collect();
    let longest = lengths.iter().copied().fold(0.0, f32::max);
    lengths.iter().rposition(|length| *length >= 0.4 * longest)?.checked_sub(1)
}

/// Joints of a chain without those that stand where the one before stands.
fn bends(joints: &[SkeletonJoint], chain: &[usize]) -> Vec<usize> {
    let mut kept: Vec<usize> = Vec::new();
    for joint in chain {
        let place = joints[*joint].position;
        if kept.last().is_none_or(|last| joints[*last].position.distance(place) > 1e-4 * place.length().max(1e-3)) {
            kept.push(*joint);
        }
    }
    kept
}
