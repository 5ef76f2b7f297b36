//! Pulling a joint of a built rig by the controls that move it.
//!
//! Which controls these are is tried on a copy of the instance, so that it holds for any rig: a goal of inverse kinematics moves
//! the joints above the pulled one, too; forward controls turn. Controls that move more than the pulled chain are left alone
//! as long as there are others.

use std::collections::BTreeSet;

use bevy::math::{Quat, Vec3};

use super::{chain_above, limb_above, pull};
use crate::{
    mesh::model::Trs,
    rig::{BuiltRig, NodeType, PoseOffset, Rig, Uid},
    solve::{
        matching::offset_towards,
        program::RigState,
        rotate::{arc, direction, from_scaled_axis},
    },
};

/// Angle in radians by which controls are tried.
const TRIED_ANGLE: f32 = 0.05;
/// Distance by which controls are tried, as a share of the rig's size.
const TRIED_DISTANCE: f32 = 0.01;
/// Share of the rig's size under which a joint counts as held.
const STILL: f32 = 1e-5;
/// Least movement of a joint, as a share of that of its control, for a control that is moved.
const LEAST_GAIN: f32 = 0.05;
/// Movement from which on a control is as good as the joint itself.
const GOOD_GAIN: f32 = 0.5;
/// Most rounds that bring a joint nearer to its goal.
const ROUNDS: usize = 12;

/// Reason why a joint cannot be pulled.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum PullError {
    /// The node is not in the running rig.
    #[error("it is not in the built rig; build the rig again")]
    NoNode,
    /// No control moves the node.
    #[error("no control moves it at present; turn on a switch or a feature that does, or pose another joint")]
    NoControl,
}

/// Joint or control that is pulled, with the controls that move it.
#[derive(Debug, Clone)]
pub struct ControlPull {
    /// Instance in the pose before the pull.
    state: RigState,
    slot: usize,
    way: Way,
    size: f32,
}

/// Way in which controls bring a joint to its goal.
#[derive(Debug, Clone, PartialEq)]
enum Way {
    /// A control that moves, with the movement of the joint as a share of its own.
    Move { handle: usize, gain: f32 },
    /// Controls that turn, from the top.
    Turn(Vec<usize>),
}

/// Control that was tried.
struct Trial {
    slot: usize,
    /// Joints that it moves, as slots.
    moved: BTreeSet<usize>,
    /// Joints that it turns.
    turned: BTreeSet<usize>,
    /// Largest movement of the pulled node along that of the control, as a share of it; zero for a control that turns.
    gain: f32,
}

impl ControlPull {
    /// Controls by which a joint or a control of a running rig is pulled.
    ///
    /// # Errors
    /// See [`PullError`].
    pub fn find(rig: &Rig, built: &BuiltRig, state: &RigState, node: Uid) -> Result<Self, PullError> {
        let mut state = state.clone();
        state.evaluate(0.0);
        let slot = state.program().node(node).ok_or(PullError::NoNode)?;
        let far = state.globals().iter().map(|at| at.translation.length());
        let size = far.filter(|far| far.is_finite()).fold(1e-3, f32::max);
        let handles: Vec<(usize, [bool; 2])> = built
            .nodes
            .iter()
            .filter_map(|node| {
                let channels = node.control.as_ref()?.channels;
                let slot = state.program().node(node.uid)?;
                let free = [channels.translate.contains(&true), channels.rotate.contains(&true)];
                state.program().nodes()[slot].is_posable().then_some((slot, free))
            })
            .collect();
        let subject = subject(rig, &mut state, node, size);
        let chain = subject.map(|joint| chain_above(rig, joint)).unwrap_or_default();
        // A shoulder may follow the goal of its hand, but it does not turn by itself.
        let limb = subject.map(|joint| limb_above(rig, joint)).unwrap_or_default();
        let below = |top: Option<&Uid>| nodes_below(built, &state, top.copied().or(subject));
        let (in_limb, in_chain) = (below(limb.first()), below(chain.first()));
        let above: Vec<usize> = chain.iter().filter_map(|joint| state.program().node(*joint)).collect();
        let mut turning = Vec::new();
        let mut moving = Vec::new();
        for (handle, [can_move, can_turn]) in handles {
            if can_turn && handle != slot {
                turning.extend(tried_turn(&mut state, handle, slot, size));
            }
            if can_move {
                moving.extend(tried_move(&mut state, handle, slot, size));
            }
        }
        let is_local = |tried: &&Trial| tried.moved.is_subset(&in_limb);
        // Forward controls that are moved carry the limb away; goals turn it.
        let turns_chain = |tried: &&Trial| above.is_empty() || above.iter().any(|joint| tried.turned.contains(joint));
        let local = |least: f32| {
            let good = moving.iter().filter(is_local).filter(turns_chain).filter(|tried| tried.gain >= least);
            good.min_by_key(|tried| tried.moved.len())
        };
        let as_move = |tried: &Trial| Way::Move { handle: tried.slot, gain: tried.gain };
        let mut chain_controls: Vec<&Trial> = turning.iter().filter(|tried| tried.moved.is_subset(&in_chain)).collect();
        // A control that moves more stands above; of two that move the same joints the later one hangs below.
        chain_controls.sort_by_key(|tried| std::cmp::Reverse(tried.moved.len()));
        if chain.len() == 1 && chain_controls.len() > 1 {
            chain_controls = chain_controls.split_off(chain_controls.len() - 1);
        }
        let widest = || {
            let wide_move = moving.iter().filter(|tried| tried.gain >= GOOD_GAIN).min_by_key(|tried| tried.moved.len());
            let wide_turn = turning.iter().min_by_key(|tried| tried.moved.len());
            match (wide_move, wide_turn) {
                (Some(moving), Some(turning)) if turning.moved.len() < moving.moved.len() => {
                    Some(Way::Turn(vec![turning.slot]))
                }
                (Some(moving), _) => Some(as_move(moving)),
                (None, turning) => turning.map(|turning| Way::Turn(vec![turning.slot])),
            }
        };
        // A control that is pulled itself moves where it is a goal, or where no controls above it turn.
        let own = moving.iter().find(|tried| tried.slot == slot);
        let is_moved = own.is_some_and(|own| chain.is_empty() || turns_chain(&own) || chain_controls.is_empty());
        let way = match (local(GOOD_GAIN), chain_controls.is_empty()) {
            _ if is_moved => Way::Move { handle: slot, gain: 1.0 },
            (Some(best), _) if own.is_none() => as_move(best),
            (Some(_), true) => Way::Move { handle: slot, gain: 1.0 },
            (_, false) => Way::Turn(chain_controls.iter().map(|tried| tried.slot).collect()),
            (None, true) => match local(LEAST_GAIN) {
                Some(best) => as_move(best),
                None => widest().ok_or(PullError::NoControl)?,
            },
        };
        Ok(Self { state, slot, way, size })
    }

    /// Position of the pulled node before the pull, in the rig's space.
    pub fn position(&self) -> Vec3 {
        self.state.global_at(self.slot).translation
    }

    /// Controls that the pull poses, from the top.
    pub fn handles(&self) -> Vec<Uid> {
        let slots = match &self.way {
            Way::Move { handle, .. } => std::slice::from_ref(handle),
            Way::Turn(slots) => slots,
        };
        slots.iter().map(|slot| self.state.program().nodes()[*slot].uid).collect()
    }

    /// Offsets of the controls with which the node is at the goal, or as near to it as they bring it. They follow from the
    /// goal alone, not from the way on which it went there.
    pub fn to(&self, goal: Vec3) -> Vec<(Uid, PoseOffset)> {
        let mut state = self.state.clone();
        let slots = match &self.way {
            Way::Move { handle, gain } => {
                self.move_to(&mut state, *handle, *gain, goal);
                std::slice::from_ref(handle)
            }
            Way::Turn(slots) => {
                self.turn_to(&mut state, slots, goal);
                slots
            }
        };
        slots.iter().map(|slot| (state.program().nodes()[*slot].uid, state.offset_at(*slot))).collect()
    }

    fn move_to(&self, state: &mut RigState, handle: usize, gain: f32, goal: Vec3) {
        let place = |state: &mut RigState, by: Vec3| {
            let now = *state.global_at(handle);
            let wanted = Trs { translation: now.translation + by, ..now };
            let offset = offset_towards(&now, &state.offset_at(handle), &wanted);
            state.set_offset_at(handle, offset);
            state.evaluate(0.0);
        };
        place(state, (goal - self.position()) / gain.max(LEAST_GAIN));
        let mut off = state.global_at(self.slot).translation.distance(goal);
        for _ in 0..ROUNDS {
            if handle == self.slot || off <= STILL * self.size {
                return;
            }
            let before = state.offset_at(handle);
            let by = goal - state.global_at(self.slot).translation;
            place(state, by);
            let now = state.global_at(self.slot).translation.distance(goal);
            // A goal out of reach would draw the control ever further away.
            if now > 0.9 * off {
                state.set_offset_at(handle, before);
                state.evaluate(0.0);
                return;
            }
            off = now;
        }
    }

    fn turn_to(&self, state: &mut RigState, slots: &[usize], goal: Vec3) {
        let mut points: Vec<Vec3> = slots.iter().map(|slot| state.global_at(*slot).translation).collect();
        points.push(state.global_at(self.slot).translation);
        let mut carried = Quat::IDENTITY;
        for (slot, whole) in slots.iter().zip(pull(&points, goal)) {
            turn(state, *slot, (whole * carried.conjugate()).normalize());
            carried = whole;
        }
        // Hinges and limits keep controls from that: the others make up for it.
        for _ in 0..ROUNDS {
            for slot in slots.iter().rev() {
                let (end, origin) = (state.global_at(self.slot).translation, state.global_at(*slot).translation);
                if end.distance(goal) <= STILL * self.size {
                    return;
                }
                if let Some((from, to)) = direction(end - origin).zip(direction(goal - origin)) {
                    let before = state.offset_at(*slot);
                    turn(state, *slot, arc(from, to, Vec3::ZERO));
                    if state.global_at(self.slot).translation.distance(goal) > end.distance(goal) {
                        state.set_offset_at(*slot, before);
                        state.evaluate(0.0);
                    }
                }
            }
        }
    }
}

/// Turns a node by a rotation in the rig's space, within its channels and limits.
fn turn(state: &mut RigState, slot: usize, by: Quat) {
    let (offset, global) = (state.offset_at(slot), state.global_at(slot).rotation);
    let own = global.conjugate() * by * global;
    state.set_offset_at(slot, PoseOffset { rotation: (offset.rotation * own).normalize(), ..offset });
    state.evaluate(0.0);
}

/// Joint whose chain is pulled: the joint itself, or the topmost one that a control turns.
fn subject(rig: &Rig, state: &mut RigState, node: Uid, size: f32) -> Option<Uid> {
    if rig.joint(node).is_some() {
        return Some(node);
    }
    let slot = state.program().node(node)?;
    let (moved, _) = with_turn(state, slot, None, size)?;
    let joints = moved.joints.into_iter().map(|slot| state.program().nodes()[slot].uid);
    joints.filter(|joint| rig.joint(*joint).is_some()).min_by_key(|joint| rig.ancestors(*joint).count())
}

/// Slots of a node and of all nodes below it.
fn nodes_below(built: &BuiltRig, state: &RigState, top: Option<Uid>) -> BTreeSet<usize> {
    let mut inside = vec![false; built.nodes.len()];
    for (number, node) in built.nodes.iter().enumerate() {
        inside[number] = Some(node.uid) == top || node.parent.is_some_and(|parent| inside[parent]);
    }
    let nodes = built.nodes.iter().zip(inside).filter(|(_, inside)| *inside);
    nodes.filter_map(|(node, _)| state.program().node(node.uid)).collect()
}

/// Joints that moved or turned, as slots.
#[derive(Default)]
struct JointMotion {
    joints: BTreeSet<usize>,
    turned: BTreeSet<usize>,
}

impl JointMotion {
    /// Adds the joints that differ between the state and what it was before.
    fn add(&mut self, state: &RigState, before: &[Trs], size: f32) {
        let nodes = state.program().nodes().iter().zip(before).enumerate();
        for (slot, (_, before)) in nodes.filter(|(_, (node, _))| node.kind == NodeType::Joint) {
            let now = state.global_at(slot);
            let is_turned = now.rotation.dot(before.rotation).abs() < 1.0 - 1e-6;
            if is_turned {
                self.turned.insert(slot);
            }
            if is_turned || now.translation.distance(before.translation) > STILL * size {
                self.joints.insert(slot);
            }
        }
    }
}

/// Joints that a turn of a control moves, and the movement of a pulled node; `None` for a control that cannot turn.
fn with_turn(state: &mut RigState, slot: usize, pulled: Option<usize>, size: f32) -> Option<(JointMotion, f32)> {
    let (offset, before) = (state.offset_at(slot), state.globals().to_vec());
    for sign in [1.0, -1.0] {
        // An axis along none of the control's own turns it about each that is free.
        let by = from_scaled_axis(Vec3::new(0.55, 0.62, 0.56) * (sign * TRIED_ANGLE));
        state.set_offset_at(slot, PoseOffset { rotation: (offset.rotation * by).normalize(), ..offset });
        let is_turned = state.offset_at(slot) != offset;
        state.evaluate(0.0);
        let mut moved = JointMotion::default();
        moved.add(state, &before, size);
        let by = pulled.map_or(0.0, |at| state.global_at(at).translation.distance(before[at].translation));
        state.set_offset_at(slot, offset);
        state.evaluate(0.0);
        if is_turned {
            return Some((moved, by));
        }
    }
    None
}

fn tried_turn(state: &mut RigState, handle: usize, slot: usize, size: f32) -> Option<Trial> {
    let (moved, by) = with_turn(state, handle, Some(slot), size)?;
    (by > STILL * size).then_some(Trial { slot: handle, moved: moved.joints, turned: moved.turned, gain: 0.0 })
}

fn tried_move(state: &mut RigState, handle: usize, slot: usize, size: f32) -> Option<Trial> {
    let (offset, before) = (state.offset_at(handle), state.globals().to_vec());
    let (mut gain, mut moved) = (0.0_f32, JointMotion::default());
    let far = TRIED_DISTANCE * size;
    let axes = Vec3::AXES.into_iter().flat_map(|axis| [axis, -axis]);
    for axis in std::iter::once(Vec3::new(0.55, 0.62, 0.56)).chain(axes) {
        let now = before[handle];
        let wanted = Trs { translation: now.translation + axis * far, ..now };
        state.set_offset_at(handle, offset_towards(&now, &offset, &wanted));
        state.evaluate(0.0);
        let by = state.global_at(slot).translation - before[slot].translation;
        gain = gain.max(by.dot(axis) / far);
        moved.add(state, &before, size);
        state.set_offset_at(handle, offset);
        state.evaluate(0.0);
        // Most controls have no effect, which the first direction shows: it is along none of their axes.
        if by.length() <= STILL * size {
            break;
        }
    }
    (gain >= LEAST_GAIN).then_some(Trial {
        slot: handle,
        moved: moved.joints,
        turned: moved.turned,
        gain: gain.min(1.0),
    })
}
