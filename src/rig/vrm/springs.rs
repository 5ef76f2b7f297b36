//! Springs of a rig as chains of VRM's spring bones.
//!
//! A spring of a rig is an oscillator with a frequency and a damping ratio. VRM moves the end of each bone by its algorithm
//! (section "SpringBone Algorithm"): once a frame of length `t`, to `x + (x - y)(1 - drag) + t * stiffness * r`, where `x`
//! and `y` are the ends in this frame and the one before and `r` is the direction at rest, and then back to the bone's length
//! `L`. For small angles this is a linear recurrence. With `w = 2 pi frequency`, `z = damping`, `p = exp(-2 z w t)` and
//! `s = 2 exp(-z w t) cos(w t sqrt(1 - z z))` (the hyperbolic cosine where `z` is above 1), it has the oscillator's own
//! solution for
//!
//! `stiffness = L / t * (1 / (s - p) - 1)` and `drag = 1 - p / (s - p)`.
//!
//! The frame is a sixtieth of a second. Going back to the bone's length damps, too: no spring has less than a ratio of about
//! `pi * frequency * t`, and one that asks for less gets a drag of zero. No spring turns by more than 0.9 radians a frame.
//! Gravity is zero, because a spring of a rig rests in its rest pose. The tips of a rig's springs are points, so their radius is
//! zero. A spring that feels less than half of the rig's motion is centred on the root of its skeleton.

use std::{
    collections::{BTreeMap, BTreeSet},
    f32::consts::TAU,
};

use bevy::math::ops;
use glam::Vec3;

use super::{AvatarFrames, AvatarSource, BuiltPlaces, HumanNodes};
use crate::{
    mesh::{
        model::{Model, Node, Trs},
        vrm::{ColliderShape, SpringBones, SpringChain, SpringCollider, SpringColliderGroup, SpringJoint},
    },
    rig::{Collider, Constraint, Scalar, Uid},
};

/// Frame of the algorithm, in seconds.
const FRAME: f32 = 1.0 / 60.0;

/// Largest part of a swing in a frame, in radians: faster springs swing as fast as that.
const FASTEST: f32 = 0.9;

/// Springs of an avatar.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct FoundSprings {
    /// The springs.
    pub springs: SpringBones,
    /// Sentences about what the format cannot hold.
    pub notes: Vec<String>,
}

/// Spring of a joint, with the numbers that it has at rest.
#[derive(Debug, Clone)]
struct JointSpring {
    frequency: f32,
    damping: f32,
    motion: f32,
    colliders: Vec<Collider>,
}

/// Stiffness and drag of VRM's algorithm for an oscillator of a frequency in hertz and a damping ratio, at the end of a bone
/// of a length in metres.
pub fn spring_numbers(frequency: f32, damping: f32, length: f32) -> [f32; 2] {
    let phase = (TAU * frequency * FRAME).min(FASTEST);
    let decay = ops::exp(-damping * phase);
    let rest = 1.0 - damping * damping;
    let turn = phase * rest.abs().sqrt();
    let cosine = if rest >= 0.0 { ops::cos(turn) } else { ops::cosh(turn) };
    let product = decay * decay;
    let divisor = 2.0 * decay * cosine - product;
    let stiffness = (length / FRAME * (1.0 / divisor - 1.0)).max(0.0);
    let drag = (1.0 - product / divisor).clamp(0.0, 1.0);
    if stiffness.is_finite() && drag.is_finite() { [stiffness, drag] } else { [0.0, 1.0] }
}

/// Springs of a rig over the nodes of its model, whose rest is the avatar's. The last joint of a chain gets a node at its end
/// where it has no child.
pub fn spring_bones(
    model: &mut Model,
    source: &AvatarSource,
    frames: &AvatarFrames,
    human: &HumanNodes,
) -> FoundSprings {
    let mut found = FoundSprings::default();
    let Some(built) = source.built else { return found };
    let places = BuiltPlaces::new(built, source);
    let bones: BTreeSet<usize> = human.bones.values().copied().collect();
    let mut sprung: BTreeMap<usize, JointSpring> = BTreeMap::new();
    let (mut shifted, mut weak, mut human_springs) = (0, 0, 0);
    for constraint in &built.constraints {
        let Constraint::Spring { driven, frequency, damping, weight, translate, rotate, motion, colliders } =
            &*constraint.constraint
        else {
            continue;
        };
        let [frequency, damping, weight, motion] =
            [frequency, damping, weight, motion].map(|number| value(number, source));
        let Some(joint) = places.joint_of(*driven).filter(|_| weight > 0.0) else { continue };
        shifted += usize::from(*translate);
        weak += usize::from(weight < 1.0);
        if !*rotate {
            continue;
        }
        if bones.contains(&joint) {
            human_springs += 1;
            continue;
        }
        sprung.insert(joint, JointSpring { frequency, damping, motion, colliders: colliders.clone() });
    }
    let mut note = |count: usize, text: &str| {
        if count > 0 {
            found.notes.push(format!("springs: {count} {text}"));
        }
    };
    note(shifted, "lag in their position, which VRM 1.0 cannot: only directions swing");
    note(weak, "swing in part, which VRM 1.0 cannot: they swing wholly");
    note(human_springs, "move bones of the human, which programs pose: left out");
    let mut groups = Groups::default();
    for chain in chains(model, &sprung) {
        found.springs.springs.push(chain_of(model, &chain, &sprung, frames, &mut groups));
    }
    groups.fill(&mut found, &places, frames);
    found
}

/// Number of a spring as the rig stands: a constant, or an attribute's value.
fn value(number: &Scalar, source: &AvatarSource) -> f32 {
    let of_attribute = |node: &Uid, name: &str| {
        let own = || source.built?.node(*node)?.attributes.iter().find(|known| *known.name == *name);
        source.rig.attribute_value(*node, name).or_else(|| Some(own()?.default)).unwrap_or_default()
    };
    match number {
        Scalar::Value(value) => *value,
        Scalar::Attribute { node, name, factor, add } => of_attribute(node, name) * factor + add,
        Scalar::Choice { node, name, value } => (1.0 - (of_attribute(node, name) - value).abs()).clamp(0.0, 1.0),
        Scalar::Channel { .. } => 0.0,
    }
}

/// Chains of joints that swing, each node in one chain: from a joint to the first of those right below it, and so on. The
/// others below it begin chains of their own.
fn chains(model: &Model, sprung: &BTreeMap<usize, JointSpring>) -> Vec<Vec<usize>> {
    let mut chains: Vec<Vec<usize>> = Vec::new();
    let mut used: BTreeSet<usize> = BTreeSet::new();
    for joint in sprung.keys() {
        if !used.insert(*joint) {
            continue;
        }
        let mut chain = vec![*joint];
        let mut last = *joint;
        while let Some(next) = sprung.keys().copied().find(|at| model.nodes[*at].parent == Some(last)) {
            if !used.insert(next) {
                break;
            }
            chain.push(next);
            last = next;
        }
        chains.push(chain);
    }
    chains
}

/// Chain with its numbers, and with an end.
fn chain_of(
    model: &mut Model,
    chain: &[usize],
    sprung: &BTreeMap<usize, JointSpring>,
    frames: &AvatarFrames,
    groups: &mut Groups,
) -> SpringChain {
    let (first, last) = (chain[0], chain[chain.len() - 1]);
    let is_free = |node: &usize| model.nodes[*node].parent == Some(last) && !sprung.contains_key(node);
    let end = (0..frames.rest.len()).find(|node| is_free(node) && is_away(&frames.rest, last, *node));
    let (end, end_offset) = match end {
        Some(end) => (end, frames.rest[end].translation - frames.rest[last].translation),
        None => {
            let offset = end_offset(model, frames, last);
            let name = format!("{}_end", model.nodes[last].name);
            let rest = Trs { translation: offset, ..Trs::IDENTITY };
            model.nodes.push(Node { name, parent: Some(last), rest, ..Node::default() });
            (model.nodes.len() - 1, offset)
        }
    };
    let mut joints = Vec::with_capacity(chain.len() + 1);
    let mut own_groups: Vec<usize> = Vec::new();
    for (at, joint) in chain.iter().enumerate() {
        let spring = &sprung[joint];
        let length = match chain.get(at + 1) {
            Some(next) => frames.rest[*next].translation.distance(frames.rest[*joint].translation),
            None => end_offset.length(),
        };
        let [stiffness, drag_force] = spring_numbers(spring.frequency, spring.damping, length);
        joints.push(SpringJoint { stiffness, drag_force, ..SpringJoint::end(*joint) });
        if !spring.colliders.is_empty() {
            let group = groups.number(&spring.colliders);
            if !own_groups.contains(&group) {
                own_groups.push(group);
            }
        }
    }
    joints.push(SpringJoint::end(end));
    let root = std::iter::successors(Some(first), |node| model.nodes[*node].parent).last();
    let is_calm = sprung[&first].motion < 0.5;
    let name = model.nodes[first].name.clone();
    SpringChain { name, joints, collider_groups: own_groups, center: root.filter(|_| is_calm) }
}

/// True if two nodes stand at two places.
fn is_away(rest: &[Trs], a: usize, b: usize) -> bool {
    rest[a].translation.distance(rest[b].translation) > 1e-4
}

/// Place of the end of a joint without children in its own space: as far on as the joint before is back.
fn end_offset(model: &Model, frames: &AvatarFrames, joint: usize) -> Vec3 {
    let own = frames.rest[joint];
    let before = model.nodes[joint].parent.map(|parent| own.translation - frames.rest[parent].translation);
    let before = before.filter(|bone| bone.length() > 1e-4).map(|bone| own.rotation.inverse() * bone);
    before.unwrap_or(Vec3::Y * 0.1)
}

/// Groups of colliders, each list once.
#[derive(Default)]
struct Groups {
    lists: Vec<Vec<Collider>>,
}

impl Groups {
    fn number(&mut self, colliders: &[Collider]) -> usize {
        self.lists.iter().position(|known| known == colliders).unwrap_or_else(|| {
            self.lists.push(colliders.to_vec());
            self.lists.len() - 1
        })
    }

    /// Adds the groups with their colliders, each body once.
    fn fill(self, found: &mut FoundSprings, places: &BuiltPlaces, frames: &AvatarFrames) {
        let mut known: Vec<Collider> = Vec::new();
        let mut lost = 0;
        for (number, list) in self.lists.into_iter().enumerate() {
            let mut colliders = Vec::new();
            for collider in list {
                let at = known.iter().position(|other| *other == collider);
                let at = at.or_else(|| {
                    found.springs.colliders.push(body(&collider, places, frames)?);
                    known.push(collider);
                    Some(known.len() - 1)
                });
                lost += usize::from(at.is_none());
                colliders.extend(at);
            }
            let name = format!("colliders {}", number + 1);
            found.springs.collider_groups.push(SpringColliderGroup { name, colliders });
        }
        if lost > 0 {
            found.notes.push(format!("springs: {lost} colliders hang on nothing that is in the file: left out"));
        }
    }
}

/// Body about a node of the rig; `None` if it hangs on no joint.
fn body(collider: &Collider, places: &BuiltPlaces, frames: &AvatarFrames) -> Option<SpringCollider> {
    let node = places.joint_of(collider.node)?;
    let offset = places.on_joint(collider.node, node, frames)?;
    let radius = collider.radius * frames.placement.scale;
    let end = collider.end.and_then(|end| {
        let joint = places.joint_of(end)?;
        let place = frames.rest[joint] * Trs { translation: places.on_joint(end, joint, frames)?, ..Trs::IDENTITY };
        let carrier = frames.rest.get(node)?;
        Some(carrier.rotation.inverse() * (place.translation - carrier.translation))
    });
    let shape = match end {
        Some(tail) => ColliderShape::Capsule { offset, radius, tail },
        None => ColliderShape::Sphere { offset, radius },
    };
    Some(SpringCollider { node, shape })
}
