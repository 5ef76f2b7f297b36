//! Bones of a human by the shape of the skeleton, where names say nothing.

use std::collections::BTreeMap;

use bevy::math::Vec3;

use super::{
    BodySide, HumanBone, HumanJoints, LimbBone, SkeletonJoint, ancestors, common_ancestor, complete, is_above, path,
};

/// Length of a bone above which it is a head rather than a neck, as a share of the height from a foot to the last joint.
const HEAD: f32 = 0.085;
/// Distance of the joint that carries legs and trunk from the one that carries the legs, at most, as a share of the way from
/// there to a foot.
const BESIDE: f32 = 0.2;
/// Height of an upright trunk's end above its start, as a share of the way between them; that of animals is less.
const UPRIGHT: f32 = 0.85;

/// Joints that stand for bones, by the chains of the skeleton at rest: two that go down are legs, two that branch off above
/// them to the sides are arms, the one that goes up is spine and head. Empty if the skeleton has another shape.
///
/// `up` and `forward` are the directions of the figure; left is on the left of a figure that faces forward.
pub fn by_shape(joints: &[SkeletonJoint], up: Vec3, forward: Vec3) -> HumanJoints {
    let left = up.cross(forward);
    let ends = ends(joints);
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
    let Some(start) = trunk_start(joints, hips, left_foot, top, up) else { return HumanJoints::new() };
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
        let is_arm = |end: &usize| is_above(joints, start, *end) && ![left_foot, right_foot].contains(end);
        let Some(hand) = outermost(sign).filter(is_arm) else { return HumanJoints::new() };
        let trunk: Vec<usize> = path(joints, top, Some(start));
        let arm: Vec<usize> = path(joints, hand, Some(start)).into_iter().filter(|at| !trunk.contains(at)).collect();
        let arm = bends(joints, &arm);
        let Some(first) = limb_start(joints, &arm) else { return HumanJoints::new() };
        for (bone, joint) in [LimbBone::UpperArm, LimbBone::LowerArm, LimbBone::Hand].into_iter().zip(&arm[first..]) {
            named.insert(HumanBone::Limb(side, bone), *joint);
        }
    }
    named.insert(HumanBone::Head, head_of(joints, &named, top, height(top) - height(left_foot)));
    complete(joints, &named)
}

/// Joint from which the trunk goes to `top`: the one that carries the legs; or else the joint that carries it at about the same
/// place, as where legs hang on a pelvis beside the spine, if the trunk stands upright. `None` if neither carries `top`.
fn trunk_start(joints: &[SkeletonJoint], hips: usize, foot: usize, top: usize, up: Vec3) -> Option<usize> {
    if is_above(joints, hips, top) {
        return Some(hips);
    }
    let way = |joint: usize| joints[joint].position - joints[hips].position;
    let is_upright = way(top).dot(up) >= UPRIGHT * way(top).length();
    let is_beside = |above: &usize| way(*above).length() <= BESIDE * way(foot).length();
    joints[hips].parent.filter(is_beside).filter(|above| is_upright && is_above(joints, *above, top))
}

/// Length of an arm in proportion to the leg of its side.
const ARM: f32 = 0.7;
/// Largest difference of an arm's length from what the leg lets expect, and from the other arm's, as a share.
const UNLIKE: [f32; 2] = [0.4, 0.25];

/// Bones of arms that no name tells beside legs and a head that names tell: of the chains on the side that branch off between
/// hips and head, the one whose length is most like the other arm's, or else like what the leg lets expect.
pub(super) fn unnamed_arms(joints: &[SkeletonJoint], named: &BTreeMap<HumanBone, usize>) -> Vec<(HumanBone, usize)> {
    let at = |side, bone| named.get(&HumanBone::Limb(side, bone)).copied();
    let place = |joint: usize| joints[joint].position;
    let legs = BodySide::BOTH.map(|side| at(side, LimbBone::UpperLeg));
    let ([Some(left), Some(right)], Some(head)) = (legs, named.get(&HumanBone::Head).copied()) else {
        return Vec::new();
    };
    let Some(fork) = common_ancestor(joints, left, right).filter(|fork| is_above(joints, *fork, head)) else {
        return Vec::new();
    };
    let mut trunk = path(joints, head, Some(fork));
    trunk.pop();
    let (across, middle) = (place(left) - place(right), (place(left) + place(right)) / 2.0);
    let chain_length =
        |bones: [usize; 3]| place(bones[0]).distance(place(bones[1])) + place(bones[1]).distance(place(bones[2]));
    let length = |side, bones: [LimbBone; 3]| {
        let [upper, lower, end] = bones.map(|bone| at(side, bone));
        Some(chain_length([upper?, lower?, end?]))
    };
    let arm = [LimbBone::UpperArm, LimbBone::LowerArm, LimbBone::Hand];
    let leg = [LimbBone::UpperLeg, LimbBone::LowerLeg, LimbBone::Foot];
    let mut found = Vec::new();
    for (side, other, sign) in [(BodySide::Left, BodySide::Right, 1.0), (BodySide::Right, BodySide::Left, -1.0)] {
        if arm.iter().any(|bone| at(side, *bone).is_some()) {
            continue;
        }
        let of_other = length(other, arm).map(|length| (length, UNLIKE[1]));
        let Some((wanted, most)) = of_other.or_else(|| Some((length(side, leg)? * ARM, UNLIKE[0]))) else { continue };
        let is_of_other_bone = |joint: &usize| {
            let is_of_arm = |bone: &HumanBone| match bone {
                HumanBone::Limb(of, LimbBone::Shoulder) | HumanBone::Finger(of, ..) => *of == side,
                _ => false,
            };
            named.iter().any(|(bone, known)| known == joint && !is_of_arm(bone))
        };
        let chains = ends(joints).into_iter().filter_map(|end| {
            let branch = ancestors(joints, end).find(|at| trunk.contains(at))?;
            let chain = path(joints, end, Some(branch));
            let chain = Some(bends(joints, &chain)).filter(|_| !chain.iter().any(&is_of_other_bone))?;
            let [upper, lower, hand, ..] = chain[limb_start(joints, &chain)?..] else { return None };
            let bones = [upper, lower, hand];
            let unlike = (chain_length(bones) / wanted - 1.0).abs();
            let is_arm = unlike <= most && (place(hand) - middle).dot(across) * sign > 0.0;
            is_arm.then_some((unlike, bones))
        });
        if let Some((_, bones)) = chains.min_by(|(a, _), (b, _)| a.total_cmp(b)) {
            found.extend(arm.into_iter().map(|bone| HumanBone::Limb(side, bone)).zip(bones));
        }
    }
    found
}

/// Joints without children.
fn ends(joints: &[SkeletonJoint]) -> Vec<usize> {
    let mut is_end = vec![true; joints.len()];
    for parent in joints.iter().filter_map(|joint| joint.parent) {
        is_end[parent] = false;
    }
    (0..joints.len()).filter(|joint| is_end[*joint]).collect()
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
