//! The T-pose of VRM 1.0 (`tpose.md`) as the rest of a model.
//!
//! Arms lie along X with the palms down, fingers along the arms and thumbs half way to the front (definitions 1.4 and 1.6 to
//! 1.8); legs are vertical from hip to ankle, and feet point to the front (1.1 and 1.2). Knees keep the slight bend by which
//! solvers know where they bend; trunk, shoulders and head stay as they are.

use std::collections::BTreeMap;

use bevy::math::{Quat, Vec3};

use super::helper_joints::HelperJoints;
use crate::{
    mesh::{
        model::{Channel, ChannelTarget, Interpolation, Model, Trs},
        similarity::Similarity,
    },
    rig::{
        Uid,
        animation::humanoid::{BodySide, Finger, HumanBone, HumanJoints, LimbBone},
        vrm::{AvatarSource, node_globals},
    },
    solve::rotate::{arc, direction, perpendicular, scaled_axis},
};

/// Fingers beside the thumb.
const FINGERS: [Finger; 4] = [Finger::Index, Finger::Middle, Finger::Ring, Finger::Little];

/// Smallest turn in radians; a joint that is nearer to the pose stays.
const STILL: f32 = 1e-3;

/// Largest angle, as a cosine, by which the last joint of a finger may point away from the one before.
const CURLED: f32 = 0.2;

/// Change of a model's rest.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct TPose {
    /// Number of joints of the human that were turned.
    pub turned: usize,
    /// Largest turn in degrees.
    pub largest: f32,
}

/// Goal of a joint.
#[derive(Debug, Clone, Copy)]
enum Goal {
    /// The way to a place, which the joint carries, lies along a direction.
    Along { to: Vec3, direction: Vec3 },
    /// Palm of a hand: the same, and a way across lies to the front.
    Palm { to: Vec3, direction: Vec3, across: Option<Vec3> },
    /// The foot stands as it did, but for its heading, which is that of a way.
    Heading { way: Vec3 },
}

/// Turns the nodes of a model that stands upright and faces +Z into a T-pose. Helper joints follow as in the rig. Points that
/// nodes carry move with them; skins, weights and clips stay. `placement` is the way from the rig's space to the model's.
pub fn t_pose(model: &mut Model, human: &HumanJoints, source: &AvatarSource, placement: &Similarity) -> TPose {
    let before = node_globals(model);
    let goals = goals(model, &before, human);
    let mut pose = TPose::default();
    // The rotation of each node against before, in the model's space, and the turns of joints in their own spaces.
    let mut turns: Vec<Quat> = Vec::with_capacity(before.len());
    let mut own_turns: BTreeMap<usize, Quat> = BTreeMap::new();
    for (node, place) in before.iter().enumerate() {
        let above = model.nodes[node].parent.map_or(Quat::IDENTITY, |parent| turns[parent]);
        let turn = goals.get(&node).map_or(above, |goal| goal.turn(place.translation, above));
        let own = (above.inverse() * turn).normalize();
        let angle = scaled_axis(own).length();
        if angle < STILL {
            turns.push(above);
            continue;
        }
        pose.turned += 1;
        pose.largest = pose.largest.max(angle.to_degrees());
        own_turns.insert(node, (place.rotation.inverse() * own * place.rotation).normalize());
        turns.push(turn);
    }
    if own_turns.is_empty() {
        return pose;
    }
    let rests: Vec<Trs> = model.nodes.iter().map(|node| node.rest).collect();
    for (node, turn) in &own_turns {
        let rest = &mut model.nodes[*node].rest;
        rest.rotation = (rest.rotation * *turn).normalize();
    }
    follow(model, &before, &own_turns, source, placement);
    carry(model, &before);
    hold(model, &rests);
    pose
}

impl Goal {
    /// Turn of a joint at a place, in the model's space, whose parent is turned by `above`.
    fn turn(self, place: Vec3, above: Quat) -> Quat {
        let towards = |to: Vec3, goal: Vec3| {
            let way = direction(above * (to - place));
            way.map_or(above, |way| (arc(way, goal, Vec3::Y) * above).normalize())
        };
        match self {
            Self::Along { to, direction } => towards(to, direction),
            Self::Palm { to, direction, across } => {
                let turn = towards(to, direction);
                let across = across.and_then(|across| perpendicular(turn * across, direction));
                across.map_or(turn, |across| (arc(across, Vec3::Z, direction) * turn).normalize())
            }
            Self::Heading { way } => {
                let heading = perpendicular(way, Vec3::Y);
                heading.filter(|heading| heading.z > 0.3).map_or(Quat::IDENTITY, |way| arc(way, Vec3::Z, Vec3::Y))
            }
        }
    }
}

/// Goals of the joints of limbs.
fn goals(model: &Model, globals: &[Trs], human: &HumanJoints) -> BTreeMap<usize, Goal> {
    let first = |bone: HumanBone| human.get(&bone)?.first().copied();
    let place = |node: usize| globals[node].translation;
    let mut goals = BTreeMap::new();
    for (side, out) in [(BodySide::Left, Vec3::X), (BodySide::Right, Vec3::NEG_X)] {
        let limb = |bone: LimbBone| first(HumanBone::Limb(side, bone));
        let finger = |finger: Finger, number: u8| first(HumanBone::Finger(side, finger, number));
        let along = |from: Option<usize>, to: Option<usize>, direction: Vec3| {
            Some((from?, Goal::Along { to: place(to?), direction }))
        };
        let [upper, lower, hand] = [LimbBone::UpperArm, LimbBone::LowerArm, LimbBone::Hand].map(limb);
        goals.extend(along(upper, lower, out));
        goals.extend(along(lower, hand, out));
        goals.extend(along(limb(LimbBone::UpperLeg), limb(LimbBone::Foot), Vec3::NEG_Y));
        let thumb = (out + Vec3::Z).normalize();
        for (kind, direction) in FINGERS.map(|kind| (kind, out)).into_iter().chain([(Finger::Thumb, thumb)]) {
            let joints = [1, 2, 3].map(|number| finger(kind, number));
            goals.extend(along(joints[0], joints[1], direction));
            goals.extend(along(joints[1], joints[2], direction));
            if let Some(last) = joints[2].or(joints[1]).or(joints[0])
                && let Some(to) = tip(model, globals, last)
            {
                goals.insert(last, Goal::Along { to, direction });
            }
        }
        let knuckles: Vec<Vec3> = FINGERS.iter().filter_map(|kind| finger(*kind, 1).map(place)).collect();
        if let (Some(hand), false) = (hand, knuckles.is_empty()) {
            let to = knuckles.iter().sum::<Vec3>() / knuckles.len() as f32;
            let across = (knuckles.len() > 1).then(|| knuckles[0] - knuckles[knuckles.len() - 1]);
            goals.insert(hand, Goal::Palm { to, direction: out, across });
        }
        if let Some(foot) = limb(LimbBone::Foot) {
            let way = limb(LimbBone::Toes).map_or(Vec3::ZERO, |toes| place(toes) - place(foot));
            goals.insert(foot, Goal::Heading { way });
        }
    }
    goals
}

/// Place to which the last joint of a finger points: its child, else as far on along the axis that is the bone's in the joint
/// before.
fn tip(model: &Model, globals: &[Trs], joint: usize) -> Option<Vec3> {
    let own = globals[joint];
    let child = model.nodes.iter().position(|node| node.parent == Some(joint));
    let child = child.map(|child| globals[child].translation).filter(|tip| tip.distance(own.translation) > 1e-5);
    let on = || {
        let bone = model.nodes[joint].rest.translation;
        let before = own.translation - globals[model.nodes[joint].parent?].translation;
        let on = own.rotation * bone;
        let is_straight = direction(on)?.dot(direction(before)?) > CURLED;
        is_straight.then_some(own.translation + on)
    };
    child.or_else(on)
}

/// Moves the helper joints of the rig to where they follow the turned joints.
fn follow(
    model: &mut Model,
    before: &[Trs],
    own_turns: &BTreeMap<usize, Quat>,
    source: &AvatarSource,
    placement: &Similarity,
) {
    let places = source.places();
    let posed = |uid: Uid| places.get(&uid).is_some_and(|node| own_turns.contains_key(node));
    let Some(mut helpers) = source.built.and_then(|built| HelperJoints::new(built, &posed)) else { return };
    let rest = helpers.globals(&BTreeMap::new(), source.joints);
    // Axes of the model's nodes in those of the rig's.
    let axes: Vec<Quat> = rest
        .iter()
        .zip(before)
        .map(|(rest, node)| {
            let own = rest.map_or(Quat::IDENTITY, |rest| (placement.rotation * rest.rotation).normalize());
            (own.inverse() * node.rotation).normalize()
        })
        .collect();
    let turned = own_turns.iter().filter_map(|(node, turn)| {
        let axes = *axes.get(*node)?;
        Some((source.joints[*node], (axes * *turn * axes.inverse()).normalize()))
    });
    let posed = helpers.globals(&turned.collect(), source.joints);
    let mut now: Vec<Trs> = Vec::with_capacity(model.nodes.len());
    for (node, moved) in model.nodes.iter_mut().enumerate() {
        let parent = moved.parent.map_or(Trs::IDENTITY, |parent| now[parent]);
        let uid = source.joints.get(node).copied().unwrap_or_default();
        if helpers.drives(uid)
            && let (Some(Some(was)), Some(Some(is))) = (rest.get(node), posed.get(node))
            && was != is
        {
            let rotation = (placement.rotation * is.rotation * axes[node]).normalize();
            let global = Trs { translation: placement.point(is.translation), rotation, scale: Vec3::ONE };
            moved.rest = global.relative_to(&parent);
        }
        now.push(parent * moved.rest);
    }
}

/// Moves the points of objects that nodes carry.
fn carry(model: &mut Model, before: &[Trs]) {
    let now = node_globals(model);
    let mut moved = vec![false; model.points.len()];
    for part in &mut model.parts {
        let object = model.objects.get(part.object);
        let Some(node) = object.filter(|object| object.skin.is_none()).and_then(|object| object.node) else { continue };
        let (was, is) = (before[node], now[node]);
        let turn = (is.rotation * was.rotation.inverse()).normalize();
        for point in &part.vertices {
            let at = *point as usize;
            if !std::mem::replace(&mut moved[at], true) {
                model.points[at] = is.translation + turn * (model.points[at] - was.translation);
            }
        }
        part.normals.iter_mut().for_each(|normal| *normal = turn * *normal);
        for morph in &mut part.morphs {
            let offsets = morph.positions.iter_mut().chain(&mut morph.normals);
            offsets.for_each(|offset| *offset = turn * *offset);
        }
    }
}

/// Gives clips a key for each node that they left at its former rest.
fn hold(model: &mut Model, rests: &[Trs]) {
    let changed: Vec<(usize, Trs, Trs)> = model
        .nodes
        .iter()
        .zip(rests)
        .enumerate()
        .filter(|(_, (node, rest))| node.rest != **rest)
        .map(|(at, (node, rest))| (at, node.rest, *rest))
        .collect();
    for clip in &mut model.clips {
        for (node, now, was) in &changed {
            let values = [
                (
                    ChannelTarget::Translation(*node),
                    was.translation.to_array().to_vec(),
                    now.translation != was.translation,
                ),
                (ChannelTarget::Rotation(*node), was.rotation.to_array().to_vec(), now.rotation != was.rotation),
            ];
            for (target, values, is_other) in values {
                if is_other && !clip.channels.iter().any(|channel| channel.target == target) {
                    clip.channels.push(Channel {
                        target,
                        interpolation: Interpolation::Linear,
                        times: vec![0.0],
                        values,
                    });
                }
            }
        }
    }
}
