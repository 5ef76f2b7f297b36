//! Limbs that are body parts of their own, as the legs of a figure whose trunk is another piece of the mesh.

use std::collections::{BTreeMap, BTreeSet};

use glam::Vec3;

use super::{
    WeightJoint,
    bone::BoneSegment,
    bone_tree::BoneTree,
    bones::LEAF_REACH,
    roots::{AT_HOME, STATIONS, parents_first, share},
    sight::{Sight, encloses},
};
use crate::mesh::surface::Surface;

/// Takes the bones of limbs that are parts of their own from the parts of the trunk in which they begin, with all bones below. A
/// limb is a part of its own if a part holds its first bone and not the joint above it, and if no part of the trunk runs along
/// that bone, as sleeves and trouser legs do: around half of it at least, and with skin between it and its twin. A robe has no
/// skin between the legs, and hangs from the hips. A last joint has no bone yet: it runs on as far as the part that holds it alone,
/// as that of a head which begins in a collar.
///
/// Returns the parts of trunks and the bones that lead to a pair of such limbs, sorted: these hold nothing there, as no flesh of
/// the trunk leads to the limbs. Otherwise hips would hold all of a robe that lies beside the thighs.
pub(super) fn separate_limbs(
    parts: &mut [Option<Vec<u32>>],
    joints: &[WeightJoint],
    segments: &[BoneSegment],
    (points, members): (&[Vec3], &[Vec<usize>]),
    sight: &Sight,
) -> Vec<(usize, u32)> {
    /// Share of a bone that a sleeve is around.
    const SLEEVE: f32 = 0.5;
    /// Joints that are compared with another one: more are no pairs.
    const MOST_BESIDE: usize = 1024;
    let mut bones: Vec<Vec<&BoneSegment>> = vec![Vec::new(); joints.len()];
    for segment in segments.iter().filter(|segment| segment.head != segment.tail) {
        bones[segment.joint as usize].push(segment);
    }
    let key = |head: Vec3, tail: Vec3| [head, tail].map(|end| end.to_array().map(|c| (c + 0.0).to_bits()));
    let between: BTreeMap<[[u32; 3]; 2], u32> =
        segments.iter().zip(0..).map(|(segment, bone)| (key(segment.head, segment.tail), bone)).collect();
    let mut homes: Vec<Vec<usize>> = vec![Vec::new(); joints.len()];
    for (part, joints) in parts.iter().enumerate() {
        joints.iter().flatten().for_each(|&joint| homes[joint as usize].push(part));
    }
    let has = |parts: &[usize], part: &usize| parts.binary_search(part).is_ok();
    // Parts that each joint leaves, rising.
    let mut left_parts: Vec<Vec<usize>> = vec![Vec::new(); joints.len()];
    let mut links = Vec::new();
    let (order, children) = parents_first(joints);
    for joint in order {
        let Some(parent) = joints[joint].parent else { continue };
        let (left, kept): (Vec<usize>, Vec<usize>) =
            homes[joint].iter().copied().partition(|part| has(&left_parts[parent], part));
        if !left.is_empty() && !kept.is_empty() {
            left_parts[joint] = left;
            continue;
        }
        let (trunk, others): (Vec<usize>, Vec<usize>) =
            homes[joint].iter().copied().partition(|part| has(&homes[parent], part));
        if trunk.is_empty() || others.is_empty() {
            continue;
        }
        let bone = match bones[joint][..] {
            [bone] => *bone,
            [] if children[joint].is_empty() => last_bone(joint, parent, joints, &others, (points, members)),
            _ => continue,
        };
        let around = |part: usize| share(bone.head, bone.tail, |place| sight.is_within(part, place));
        if bone.head == bone.tail || !others.iter().any(|&part| around(part) >= AT_HOME) {
            continue;
        }
        let beside: Vec<usize> = match joints[parent].parent {
            Some(above) => {
                children[above].iter().flat_map(|&side| &children[side]).copied().take(MOST_BESIDE).collect()
            }
            None => children[parent].iter().copied().take(MOST_BESIDE).collect(),
        };
        let beside = beside.into_iter().filter(|&other| are_twins(joints, &bones, joint, other));
        let twins: Vec<&BoneSegment> = beside.map(|other| bones[other][0]).collect();
        let is_sleeve = |part: usize| {
            let skin_between = |twin: &&BoneSegment| {
                (0..STATIONS).map(|i| (i as f32 + 0.5) / STATIONS as f32).any(|along| {
                    let (from, to) = (bone.head.lerp(bone.tail, along), twin.head.lerp(twin.tail, along));
                    sight.is_within(part, from) && sight.is_between(part, from, to)
                })
            };
            around(part) >= SLEEVE && twins.iter().all(skin_between)
        };
        if !trunk.iter().any(|&part| is_sleeve(part)) {
            if !twins.is_empty() {
                let leading = between.get(&key(joints[parent].head, joints[joint].head));
                links.extend(leading.into_iter().flat_map(|&bone| trunk.iter().map(move |&part| (part, bone))));
            }
            left_parts[joint] = trunk;
        }
    }
    for (part, joints) in parts.iter_mut().enumerate() {
        if let Some(joints) = joints {
            joints.retain(|&joint| !has(&left_parts[joint as usize], &part));
        }
    }
    // A joint that leads to limbs alone holds the trunk by these bones.
    links.sort_unstable();
    let joint_of = |bone: u32| segments[bone as usize].joint;
    let (mut all, mut leading) = (vec![0; joints.len()], BTreeMap::<(usize, u32), usize>::new());
    segments.iter().for_each(|segment| all[segment.joint as usize] += 1);
    links.iter().for_each(|&(part, bone)| *leading.entry((part, joint_of(bone))).or_default() += 1);
    links.retain(|&(part, bone)| leading[&(part, joint_of(bone))] < all[joint_of(bone) as usize]);
    links
}

/// The bone of a last joint below `parent`, straight on and nearly as far as the farthest of some parts reaches.
fn last_bone(
    joint: usize,
    parent: usize,
    joints: &[WeightJoint],
    parts: &[usize],
    (points, members): (&[Vec3], &[Vec<usize>]),
) -> BoneSegment {
    let head = joints[joint].head;
    let onwards = (head - joints[parent].head).normalize_or_zero();
    let reach = parts.iter().flat_map(|&part| &members[part]).map(|&point| (points[point] - head).dot(onwards));
    let reach = reach.fold(0f32, f32::max);
    BoneSegment { joint: joint as u32, head, tail: head + onwards * reach * LEAF_REACH }
}

/// True if two joints have one bone each, of about the same length and direction, and hang on one joint or on joints that do.
fn are_twins(joints: &[WeightJoint], bones: &[Vec<&BoneSegment>], joint: usize, other: usize) -> bool {
    /// Lengths that differ by more than this share are not a pair's.
    const ALIKE: f32 = 0.2;
    let above = |joint: usize| joints[joint].parent;
    let of_one = |a: Option<usize>, b: Option<usize>| a.is_some() && a == b;
    let are_beside =
        of_one(above(joint), above(other)) || of_one(above(joint).and_then(above), above(other).and_then(above));
    let ([bone], [twin]) = (&bones[joint][..], &bones[other][..]) else { return false };
    let (way, twin_way) = (bone.tail - bone.head, twin.tail - twin.head);
    let (length, twin_length) = (way.length(), twin_way.length());
    let is_alike = (length - twin_length).abs() <= ALIKE * length.max(twin_length);
    joint != other && are_beside && is_alike && way.dot(twin_way) > 0.5 * length * twin_length
}

/// The small ones of some islands that are around whole bones, as hands that are pieces of their own. `boxes` are the islands'
/// corners, and `of` has the island of each place.
pub(super) fn small_limbs(
    small: &[bool],
    boxes: &[[Vec3; 2]],
    of: &[u32],
    (places, triangles): (&[Vec3], &[[u32; 3]]),
    joints: &[WeightJoint],
) -> BTreeSet<usize> {
    /// Boxes around the middles of bones, and bones in boxes, that are looked at: in a crowd of shells around one bone nothing is a
    /// limb.
    const MOST_BOXES: usize = 1 << 18;
    const MOST_BONES: usize = 1 << 12;
    let islands: Vec<usize> = (0..small.len()).filter(|&island| small[island]).collect();
    let corners = |&island: &usize| BoneSegment { joint: 0, head: boxes[island][0], tail: boxes[island][1] };
    let diagonals: Vec<BoneSegment> = islands.iter().map(corners).collect();
    let tree = BoneTree::of_boxes(&diagonals);
    let mut within: BTreeMap<usize, Vec<[Vec3; 2]>> = BTreeMap::new();
    let (mut looks, mut count) = (0, 0);
    for joint in joints {
        let Some(from) = joint.parent.map(|parent| joints[parent].head).filter(|&from| from != joint.head) else {
            continue;
        };
        // What encloses most of a bone is around the middle of it.
        tree.any_within(from.midpoint(joint.head), 0.0, |index| {
            let BoneSegment { head: low, tail: high, .. } = diagonals[index as usize];
            let is_in_box = |place: Vec3| place.cmpge(low).all() && place.cmple(high).all();
            if share(from, joint.head, is_in_box) >= AT_HOME {
                within.entry(islands[index as usize]).or_default().push([from, joint.head]);
                count += 1;
            }
            looks += 1;
            looks > MOST_BOXES || count > MOST_BONES
        });
        if looks > MOST_BOXES || count > MOST_BONES {
            return BTreeSet::new();
        }
    }
    let mut parts: BTreeMap<usize, Vec<[u32; 3]>> = within.keys().map(|&island| (island, Vec::new())).collect();
    for triangle in triangles {
        if let Some(part) = parts.get_mut(&(of[triangle[0] as usize] as usize)) {
            part.push(*triangle);
        }
    }
    let is_limb = |island: &usize| {
        let surface = Surface::build(places, &parts[island]);
        within[island].iter().any(|&[from, to]| share(from, to, |place| encloses(&surface, place)) >= AT_HOME)
    };
    within.keys().copied().filter(is_limb).collect()
}
