//! Joints that carry things: those of a rig that carry objects of a mesh whose skeleton is not the rig's own, and those whose
//! labels say that they are sockets, targets or controls.

use std::collections::{BTreeMap, BTreeSet, HashMap};

use bevy::math::Vec3;

use crate::{
    mesh::model::Model,
    rig::{
        Rig, Uid,
        deform::{DeformJoint, DeformSkeleton},
    },
};

/// Distance up to which a joint is at the place of a node, as a share of the way to the furthest node.
const SAME_PLACE: f32 = 0.01;
/// Words of labels of joints that carry or steer things and hold no flesh.
const SLOT_WORDS: [&str; 10] =
    ["attach", "attachment", "control", "ctrl", "ik", "pole", "prop", "slot", "socket", "target"];

/// Joints that have the name and the place of a node on which an object of a file hangs, by node.
///
/// Names of several joints are left out, and so are roots, on which a whole figure may hang that bends.
pub(super) fn joints_at_nodes(rig: &Rig, file: &Model) -> BTreeMap<usize, Uid> {
    let nodes: BTreeSet<usize> = file.objects.iter().filter_map(|object| object.node).collect();
    if nodes.is_empty() {
        return BTreeMap::new();
    }
    let places: Vec<Vec3> = file.rest_globals().iter().map(|place| place.translation.into()).collect();
    let first = places.first().copied().unwrap_or_default();
    let far = places.iter().map(|place| place.distance(first)).fold(0.0, f32::max);
    let mut joints: HashMap<&str, Option<Uid>> = HashMap::new();
    for joint in rig.walk() {
        if let Some(label) = joint.data.label.as_deref() {
            let own = joint.parent.map(|_| joint.data.uid);
            joints.entry(label).and_modify(|known| *known = None).or_insert(own);
        }
    }
    let at = |node: usize| {
        let joint = (*joints.get(&*file.nodes.get(node)?.name)?)?;
        let off = places.get(node)?.distance(rig.position(joint));
        (off <= SAME_PLACE * far).then_some((node, joint))
    };
    nodes.into_iter().filter_map(at).collect()
}

/// Joints whose labels say that they carry or steer things, by their numbers in a skeleton. What flesh hangs below is none,
/// whatever its label.
///
/// Only labels tell them apart: a hand that holds a sword and a head with a hat on are last joints in the flesh of the joint
/// above, too.
pub(super) fn named_slots(rig: &Rig, skeleton: &DeformSkeleton) -> Vec<usize> {
    let joints = skeleton.joints();
    let is_named = |joint: &DeformJoint| {
        let is_plain = joint.subject.is_none() && joint.twist.is_none() && joint.halves.is_none();
        let label = || rig.joint(joint.uid)?.data.label.as_deref().map(is_slot_label);
        is_plain && joint.parent.is_some() && label().unwrap_or(false)
    };
    let is_named: Vec<bool> = joints.iter().map(is_named).collect();
    let mut is_bare: Vec<bool> = joints.iter().zip(&is_named).map(|(joint, named)| *named || !joint.deforms).collect();
    // Parents stand before their children.
    for (index, joint) in joints.iter().enumerate().rev() {
        if let Some(parent) = joint.parent {
            is_bare[parent] &= is_bare[index];
        }
    }
    (0..joints.len()).filter(|index| is_named[*index] && is_bare[*index]).collect()
}

/// True if a word of a label is one of a slot's; sockets of eyes are flesh.
fn is_slot_label(label: &str) -> bool {
    let words = words(label);
    let has = |wanted: &str| words.iter().any(|word| word == wanted);
    let is_one = |word: &str| has(word) && !(word == "socket" && (has("eye") || has("eyes")));
    // Slots are often written in one word with what they are on: handslot.
    words.iter().any(|word| word.ends_with("slot")) || SLOT_WORDS.iter().any(|word| is_one(word))
}

/// The words of a label in small letters: they end where a letter does not follow, and capitals begin others.
fn words(label: &str) -> Vec<String> {
    let letters: Vec<char> = label.chars().collect();
    let is_small = |at: usize| letters.get(at).is_some_and(|letter| letter.is_lowercase());
    let (mut words, mut word) = (Vec::new(), String::new());
    for (at, letter) in letters.iter().enumerate() {
        let begins = letter.is_uppercase() && (at > 0 && is_small(at - 1) || is_small(at + 1));
        if begins || !letter.is_alphabetic() {
            words.push(std::mem::take(&mut word));
        }
        if letter.is_alphabetic() {
            word.extend(letter.to_lowercase());
        }
    }
    words.push(word);
    words
}
