//! A motion on controls: offsets of controls that put the joints where they are wanted.
//!
//! A limb with a switch gets the poses of its forward and of its inverse controls, so that the switch can be thrown at any
//! frame; one of which the motion moves a part alone is switched to its forward controls. Any other joint is turned by the
//! control that stands where it stands, or by a null where there is no such control. The hips are moved by the control at their
//! place that carries the body and leaves standing feet where they are.

use std::{collections::BTreeSet, sync::Arc};

use bevy::math::{Quat, Vec3};
use rayon::prelude::*;

use super::{RetargetError, body::Body, limbs::LimbKind, pose::Pose, tracks::KeyedTracks};
use crate::{
    mesh::model::Trs,
    rig::{
        BuiltRig, Matching, NodeType, PoseOffset, SwitchData,
        animation::humanoid::{BodySide, HumanBone, LimbBone},
    },
    solve::{
        matching::{angle_between, hold_limb, offset_towards},
        program::{RigProgram, RigState},
        rotate::scaled_axis,
        weights::{multiply, relative},
    },
};

/// Frames that are posed one after the other; the others are independent of them.
const BLOCK: usize = 32;

/// Part of posing a rig, in the order in which parts depend on one another.
enum Step<'a> {
    /// The travel of the whole figure.
    Travel(Travel),
    /// A joint, as an index of the figure and a slot, and the slot of the control that turns it.
    Joint(Handle),
    /// A joint that an attribute turns.
    Dial(Dial),
    /// A limb with its joints as indices of the figure, and the value of its switch.
    Limb(&'a SwitchData, Vec<usize>, f32),
}

/// Attribute that turns one joint about an axis, such as the toes of a foot that follows its goal.
struct Dial {
    joint: usize,
    joint_slot: usize,
    attribute: usize,
    /// Axis in the joint's space, and radians for one unit of the attribute.
    axis: Vec3,
    rate: f32,
}

/// Control that carries the whole figure over the ground.
struct Travel {
    control: usize,
    /// Transform of the control at rest.
    rest: Trs,
    /// The hips as an index of the figure, and their place at rest.
    hips: usize,
    hips_rest: Vec3,
    up: Vec3,
}

struct Handle {
    joint: usize,
    joint_slot: usize,
    control: usize,
    /// Transform of the control in the joint's space at rest.
    carried: Trs,
    /// True if the control moves the joint, too.
    moves: bool,
    /// True if the joint's rotation is corrected after that of the control.
    corrects: bool,
}

/// Offsets of the controls that the motion moves, and labels of joints that no control moves. `hands` tells which hands, left
/// and right, are held anywhere; with `has_root_motion` the control that carries the whole figure gets its travel.
pub(super) fn keyed(
    built: &BuiltRig,
    program: &Arc<RigProgram>,
    body: &Body,
    poses: &[Pose],
    hands: [bool; 2],
    has_root_motion: bool,
) -> Result<(KeyedTracks, Vec<String>), RetargetError> {
    let mut state = RigState::new(program.clone());
    let limbs = limbs(built, body, hands);
    let parts = limbs_in_part(built, body, &limbs);
    let values = || limbs.iter().map(|(switch, _, value)| (*switch, *value)).chain(parts.iter().map(|of| (*of, 0.0)));
    for (switch, value) in values() {
        // A switch that the program lacks is told when the limb is posed.
        let _ = state.set_attribute(switch.control, &switch.attribute, value);
    }
    state.evaluate(0.0);
    let moves = Moves::find(&state, body, &limbs);
    let (mut steps, unmoved) = steps(&state, body, &limbs, &moves);
    let travel = if has_root_motion { Travel::find(&state, body, &moves) } else { None };
    let root = travel.as_ref().map(|travel| program.nodes()[travel.control].uid);
    if let Some(travel) = travel {
        steps.insert(0, Step::Travel(travel));
    }
    let blocks: Vec<&[Pose]> = poses.chunks(BLOCK).collect();
    let dials: Vec<usize> =
        steps.iter().filter_map(|step| if let Step::Dial(dial) = step { Some(dial.attribute) } else { None }).collect();
    let posed: Vec<Result<Vec<PosedFrame>, RetargetError>> = blocks
        .par_iter()
        .map(|block| {
            let mut state = state.clone();
            // The first pose is far from rest, which takes a second round.
            if let Some(first) = block.first() {
                state = strike(built, state, &steps, first)?;
            }
            let mut list = Vec::with_capacity(block.len());
            for pose in *block {
                state = strike(built, state, &steps, pose)?;
                list.push(PosedFrame {
                    offsets: stored_offsets(&state),
                    dials: dials.iter().map(|slot| state.attribute_at(*slot)).collect(),
                });
            }
            Ok(list)
        })
        .collect();
    let mut frames: Vec<PosedFrame> = Vec::with_capacity(poses.len());
    for block in posed {
        frames.extend(block?);
    }
    let mut keyed = KeyedTracks { root, ..KeyedTracks::default() };
    let moved: BTreeSet<usize> = frames.iter().flat_map(PosedFrame::moved).collect();
    for slot in moved {
        let offsets = frames.iter().map(|frame| frame.offset_at(slot)).collect();
        keyed.nodes.push((program.nodes()[slot].uid, offsets));
    }
    for (place, slot) in dials.iter().enumerate() {
        let attribute = &program.attributes()[*slot];
        let (node, name) = (program.nodes()[attribute.node].uid, attribute.name.to_string());
        keyed.numbers.push((node, name, frames.iter().map(|frame| frame.dials[place]).collect()));
    }
    keyed.values = values().map(|(switch, value)| (switch.control, switch.attribute.to_string(), value)).collect();
    Ok((keyed, unmoved))
}

/// Offsets of nodes, and the attributes that turn joints.
struct PosedFrame {
    /// Slots with offsets other than the identity, in their order: few of a rig's nodes move, through a million frames.
    offsets: Box<[(usize, PoseOffset)]>,
    dials: Vec<f32>,
}

impl PosedFrame {
    /// Slots of the nodes that stand elsewhere than at rest.
    fn moved(&self) -> impl Iterator<Item = usize> {
        self.offsets.iter().filter(|(_, offset)| *offset != PoseOffset::IDENTITY).map(|(slot, _)| *slot)
    }

    fn offset_at(&self, slot: usize) -> PoseOffset {
        let place = self.offsets.binary_search_by_key(&slot, |(slot, _)| *slot);
        place.map_or(PoseOffset::IDENTITY, |place| self.offsets[place].1)
    }
}

/// Slots with offsets that are not the identity bit for bit: a zero may have a sign.
fn stored_offsets(state: &RigState) -> Box<[(usize, PoseOffset)]> {
    let bits = |offset: &PoseOffset| {
        let PoseOffset { translation, rotation, scale } = offset;
        (
            translation.to_array().map(f32::to_bits),
            rotation.to_array().map(f32::to_bits),
            scale.to_array().map(f32::to_bits),
        )
    };
    let identity = bits(&PoseOffset::IDENTITY);
    let all = (0..state.program().nodes().len()).map(|slot| (slot, state.offset_at(slot)));
    all.filter(|(_, offset)| bits(offset) != identity).collect()
}

/// Limbs with switches whose joints the motion moves: legs, and arms of hands that are held, follow their goals, other arms
/// their forward controls.
fn limbs<'a>(built: &'a BuiltRig, body: &Body, hands: [bool; 2]) -> Vec<(&'a SwitchData, Vec<usize>, f32)> {
    let limb = |switch: &'a Arc<SwitchData>| {
        let Matching::IkFk { joints, .. } = &switch.matching else { return None };
        let place = |uid: &crate::rig::Uid| body.target.joints.iter().position(|joint| joint.uid == *uid);
        let joints: Vec<usize> = joints.iter().map(place).collect::<Option<_>>()?;
        let has_goal = |limb: &super::limbs::Limb| {
            let is_held = limb.kind == LimbKind::Leg || hands[limb.side as usize];
            is_held && joints.contains(&limb.target[2])
        };
        let is_moved = joints.iter().all(|joint| body.is_moved(*joint));
        is_moved.then(|| (&**switch, joints.clone(), f32::from(u8::from(body.limbs.iter().any(has_goal)))))
    };
    built.switches.iter().filter_map(limb).collect()
}

/// Switches of limbs of which the motion moves some joints, but not all: as with a hind leg, which has a joint more than a
/// human's. Their forward controls take the motion joint by joint. Arms that it does not move at all go with the trunk by their
/// forward controls, too; their goals would stay behind.
fn limbs_in_part<'a>(
    built: &'a BuiltRig,
    body: &Body,
    limbs: &[(&'a SwitchData, Vec<usize>, f32)],
) -> Vec<&'a SwitchData> {
    let feet = BodySide::BOTH.into_iter().filter_map(|side| body.target.limb(side, LimbBone::Foot));
    let feet: Vec<crate::rig::Uid> = feet.map(|foot| body.target.joints[foot].uid).collect();
    let is_in_part = |switch: &SwitchData| {
        let Matching::IkFk { joints, .. } = &switch.matching else { return false };
        let is_arm = !joints.iter().any(|joint| feet.contains(joint));
        let of_whole = |known: &SwitchData| known.control == switch.control && known.attribute == switch.attribute;
        let mut moved = body.target.joints.iter().enumerate().filter(|(at, _)| body.is_moved(*at));
        (is_arm || moved.any(|(_, joint)| joints.contains(&joint.uid)))
            && !limbs.iter().any(|(known, ..)| of_whole(known))
    };
    built.switches.iter().map(|switch| &**switch).filter(|switch| is_in_part(switch)).collect()
}

/// Steps for all joints that the motion moves, and labels of joints that nothing moves.
fn steps<'a>(
    state: &RigState,
    body: &Body,
    limbs: &[(&'a SwitchData, Vec<usize>, f32)],
    moves: &Moves,
) -> (Vec<Step<'a>>, Vec<String>) {
    let program = state.program();
    let (mut steps, mut unmoved) = (Vec::new(), Vec::new());
    let hips = body.target.first(HumanBone::Hips);
    let spine = body.target.bones.get(&HumanBone::Spine).map_or(&[][..], |spine| &spine[..]);
    for (at, joint) in body.target.joints.iter().enumerate().filter(|(at, _)| body.is_moved(*at)) {
        if let Some((switch, joints, value)) = limbs.iter().find(|(_, joints, _)| joints.contains(&at)) {
            if joints.first() == Some(&at) {
                steps.push(Step::Limb(switch, joints.clone(), *value));
            }
            continue;
        }
        let above = std::iter::successors(joint.parent, |at| body.target.joints[*at].parent);
        let above: Vec<usize> = above.filter_map(|at| program.node(body.target.joints[at].uid)).collect();
        let is_hips = hips == Some(at);
        let Some((joint_slot, control)) =
            program.node(joint.uid).and_then(|slot| Some((slot, moves.best(state, slot, &above, is_hips)?)))
        else {
            match program.node(joint.uid).and_then(|slot| Dial::find(state, body, at, slot)) {
                Some(dial) => steps.push(Step::Dial(dial)),
                None => unmoved.push(joint.label.clone()),
            }
            continue;
        };
        let carried = relative(state.global_at(joint_slot), state.global_at(control));
        // A curve lays the joints within a spine; only its end is where its control is.
        let corrects = !spine.contains(&at) || spine.last() == Some(&at);
        steps.push(Step::Joint(Handle { joint: at, joint_slot, control, carried, moves: is_hips, corrects }));
    }
    (steps, unmoved)
}

/// Joints that each posable node turns.
struct Moves {
    list: Vec<Mover>,
    /// Slots of feet that are held by their goals.
    standing: Vec<usize>,
    /// Distance within which a control stands where a joint stands.
    near: f32,
}

/// Node that turns joints.
struct Mover {
    slot: usize,
    /// Slots of the joints.
    joints: Vec<usize>,
    is_control: bool,
    /// True if the node can be moved in all directions.
    is_movable: bool,
}

impl Moves {
    /// Turns every node a little and looks which joints turn.
    fn find(state: &RigState, body: &Body, limbs: &[(&SwitchData, Vec<usize>, f32)]) -> Self {
        let program = state.program();
        let mut tried = state.clone();
        let near = 2e-3 * body.target.height;
        let turn = Quat::from_xyzw(0.12, 0.14, 0.1, 1.0).normalize();
        let way = Vec3::splat(near);
        let joints: Vec<usize> = body.target.joints.iter().filter_map(|joint| program.node(joint.uid)).collect();
        let nodes = program.nodes().iter().enumerate();
        let posable =
            nodes.filter(|(_, node)| node.is_posable() && (node.kind == NodeType::Control || !node.is_driven));
        let list = posable.map(|(slot, node)| {
            tried.set_offset_at(slot, PoseOffset { translation: way, ..PoseOffset::IDENTITY });
            let is_movable = tried.offset_at(slot).translation.distance(way) < 0.1 * near;
            let mut turned: Vec<usize> = Vec::new();
            // A hinge at its end turns one way alone.
            for rotation in [turn, turn.inverse()] {
                if turned.is_empty() {
                    tried.set_offset_at(slot, PoseOffset::from_rotation(rotation));
                    tried.evaluate(0.0);
                    let is_turned =
                        |joint: &usize| angle_between(tried.global_at(*joint), state.global_at(*joint)) > 0.1;
                    turned.extend(joints.iter().copied().filter(is_turned));
                }
            }
            tried.set_offset_at(slot, PoseOffset::IDENTITY);
            tried.evaluate(0.0);
            Mover { slot, joints: turned, is_control: node.kind == NodeType::Control, is_movable }
        });
        let feet = BodySide::BOTH.into_iter().filter_map(|side| body.target.limb(side, LimbBone::Foot));
        let is_held = |foot: &usize| limbs.iter().any(|(_, joints, value)| *value > 0.0 && joints.contains(foot));
        let standing = feet.filter(is_held).filter_map(|foot| program.node(body.target.joints[foot].uid)).collect();
        Self { list: list.collect(), standing, near }
    }

    /// Node that turns a joint: of those at its place the one that carries most, else the one that carries least and turns no
    /// joint above it; a control rather than a null that stands there just for it. The hips are also moved; by a control that
    /// carries standing feet, such as that of the whole character, only if there is no other one.
    fn best(&self, state: &RigState, joint: usize, above: &[usize], is_hips: bool) -> Option<usize> {
        let place = state.global_at(joint).translation;
        let turning = || self.list.iter().filter(|mover| mover.joints.contains(&joint));
        let is_there = |mover: &&Mover| state.global_at(mover.slot).translation.distance(place) <= self.near;
        let is_fit = |mover: &Mover| mover.is_control && (!is_hips || mover.is_movable);
        let carries_feet = |mover: &Mover| is_hips && self.standing.iter().any(|foot| mover.joints.contains(foot));
        let most = turning().filter(is_there).min_by_key(|mover| {
            (!is_fit(mover), carries_feet(mover), std::cmp::Reverse(mover.joints.len()), mover.slot)
        });
        let below = || turning().filter(|mover| !mover.joints.iter().any(|other| above.contains(other)));
        let least = || below().min_by_key(|mover| (!is_fit(mover), mover.joints.len(), mover.slot));
        most.or_else(least).map(|mover| mover.slot)
    }
}

/// Poses the controls.
fn strike(built: &BuiltRig, mut state: RigState, steps: &[Step], pose: &Pose) -> Result<RigState, RetargetError> {
    for step in steps {
        match step {
            Step::Travel(travel) => travel.place(&mut state, &pose[travel.hips]),
            Step::Joint(handle) => handle.place(&mut state, &pose[handle.joint]),
            Step::Dial(dial) => dial.turn(&mut state, &pose[dial.joint]),
            Step::Limb(switch, joints, value) => {
                let wanted: Vec<Trs> = joints.iter().map(|joint| pose[*joint]).collect();
                state = hold_limb(built, state, switch, &wanted, *value)?;
            }
        }
    }
    Ok(state)
}

impl Travel {
    /// Topmost control that carries all joints which the motion moves, and can be moved; `None` without one, or without hips.
    fn find(state: &RigState, body: &Body, moves: &Moves) -> Option<Self> {
        let program = state.program();
        let hips = body.target.first(HumanBone::Hips)?;
        let joints = body.target.joints.iter().enumerate().filter(|(at, _)| body.is_moved(*at));
        let moved: Vec<usize> = joints.filter_map(|(_, joint)| program.node(joint.uid)).collect();
        let carries_all = |mover: &&Mover| {
            mover.is_control && mover.is_movable && moved.iter().all(|joint| mover.joints.contains(joint))
        };
        let depth = |slot: usize| std::iter::successors(Some(slot), |slot| program.nodes()[*slot].parent).count();
        let carriers = moves.list.iter().filter(carries_all);
        let control = carriers.map(|mover| mover.slot).min_by_key(|slot| (depth(*slot), *slot))?;
        let hips_rest = body.target.joints[hips].rest.translation;
        Some(Self { control, rest: *state.global_at(control), hips, hips_rest, up: body.up })
    }

    /// Moves the control over the ground as far as the hips are from their place at rest.
    fn place(&self, state: &mut RigState, hips: &Trs) {
        let way = hips.translation - self.hips_rest;
        let level = way - self.up * way.dot(self.up);
        let wanted = Trs { translation: self.rest.translation + level, ..self.rest };
        state.evaluate(0.0);
        let offset = state.offset_at(self.control);
        let next = offset_towards(state.global_at(self.control), &offset, &wanted);
        state.set_offset_at(self.control, PoseOffset { translation: next.translation, ..offset });
        state.evaluate(0.0);
    }
}

impl Dial {
    /// First attribute that turns the joint and no other one.
    fn find(state: &RigState, body: &Body, joint: usize, joint_slot: usize) -> Option<Self> {
        let program = state.program();
        let joints: Vec<usize> = body.target.joints.iter().filter_map(|joint| program.node(joint.uid)).collect();
        let attributes = program.attributes().iter().enumerate().filter(|(_, attribute)| attribute.is_settable);
        for (attribute, _) in attributes {
            let mut tried = state.clone();
            let before = tried.attribute_at(attribute);
            tried.set_attribute_at(attribute, before + 5.0);
            tried.evaluate(0.0);
            let by = tried.attribute_at(attribute) - before;
            let is_turned = |slot: &usize| angle_between(tried.global_at(*slot), state.global_at(*slot)) > 0.05;
            let mut turned = joints.iter().filter(|slot| is_turned(slot));
            if by == 0.0 || turned.next() != Some(&joint_slot) || turned.next().is_some() {
                continue;
            }
            let turn = state.global_at(joint_slot).rotation.inverse() * tried.global_at(joint_slot).rotation;
            let axis = scaled_axis(turn);
            let angle = axis.length();
            return Some(Self { joint, joint_slot, attribute, axis: axis / angle, rate: angle / by });
        }
        None
    }

    /// Turns the joint as far as its axis allows.
    fn turn(&self, state: &mut RigState, wanted: &Trs) {
        state.evaluate(0.0);
        let way = (state.global_at(self.joint_slot).rotation.inverse() * wanted.rotation).normalize();
        let way = if way.w < 0.0 { -way } else { way };
        let angle = 2.0 * bevy::math::ops::atan2(way.xyz().dot(self.axis), way.w);
        let value = state.attribute_at(self.attribute) + angle / self.rate;
        if value.is_finite() {
            state.set_attribute_at(self.attribute, value);
            state.evaluate(0.0);
        }
    }
}

impl Handle {
    /// Turns the joint, and moves it if the control does that.
    fn place(&self, state: &mut RigState, wanted: &Trs) {
        self.set(state, &multiply(wanted, &self.carried));
        let off = angle_between(state.global_at(self.joint_slot), wanted);
        if !self.corrects || off < 0.01 {
            return;
        }
        let before = state.offset_at(self.control);
        let carried = relative(state.global_at(self.joint_slot), state.global_at(self.control));
        self.set(state, &multiply(wanted, &carried));
        if angle_between(state.global_at(self.joint_slot), wanted) > 0.9 * off {
            state.set_offset_at(self.control, before);
            state.evaluate(0.0);
        }
    }

    fn set(&self, state: &mut RigState, wanted: &Trs) {
        state.evaluate(0.0);
        let offset = state.offset_at(self.control);
        let mut next = offset_towards(state.global_at(self.control), &offset, wanted);
        if !self.moves {
            next.translation = offset.translation;
        }
        state.set_offset_at(self.control, next);
        state.evaluate(0.0);
    }
}
