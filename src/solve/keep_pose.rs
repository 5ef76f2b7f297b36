//! Poses that mean the same after a change of the rig.
//!
//! A pose is a list of offsets of nodes. What an offset means depends on the axes, the parent and the place of its node, and
//! these change with the rig. A [`PoseKeeper`] re-expresses a pose: the joints stand as before, and the offsets are those that
//! put them there. Controls that both rigs have go where they were (turned as their axes were turned); what is still off
//! after that is put right with controls that only the new rig has, a pole for example, or with those that move the fewest
//! other joints. Whatever is off in the end is measured and listed.
//!
//! Joints that the change moved at rest have another place by intention: nothing holds them where they were.

mod refine;

use std::{
    collections::{BTreeMap, HashSet},
    sync::{Arc, OnceLock},
};

use super::{
    matching::{angle_between, offset_towards},
    program::{RigProgram, RigState},
    weights::{multiply, relative},
};
use crate::{
    mesh::model::Trs,
    rig::{AttributeValues, NodeType, PoseOffset, Uid},
};

/// Distance in lengths of the rig's diagonal, and angle in degrees, below which a joint stands where it stood.
const NEAR: (f32, f32) = (2e-6, 4e-3);
/// Distance in lengths of the rig's diagonal, and angle in degrees, above which a joint is listed: for a character of human
/// size a tenth of a millimetre.
const OFF: (f32, f32) = (4e-5, 0.05);
/// Rounds over all controls; a control may depend on others that come after it.
const ROUNDS: usize = 3;
/// Number of controls that are tried for a joint.
const TRIES: usize = 4;

/// Joint that does not stand as before.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct Deviation {
    /// The joint.
    pub joint: Uid,
    /// Label of the joint.
    pub label: Option<String>,
    /// Distance from its former place, in the rig's units.
    pub distance: f32,
    /// Angle from its former rotation, in degrees.
    pub angle: f32,
}

/// A re-expressed pose.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct KeptPose {
    /// Offsets of nodes; those of nodes that the new rig does not have are as before.
    pub offsets: BTreeMap<Uid, PoseOffset>,
    /// Joints that could not be held, in the order of the rig.
    pub deviations: Vec<Deviation>,
}

/// A node of both rigs: its slots, and its transform at rest in the new rig relative to that in the old one.
#[derive(Debug, Clone, Copy)]
struct Pair {
    before: usize,
    after: usize,
    turned: Trs,
}

/// Re-expresses poses of one rig for another version of it.
#[derive(Debug)]
pub struct PoseKeeper {
    before: RigState,
    after: RigState,
    /// Joints that stand at the same place at rest.
    joints: Vec<Pair>,
    /// Controls of both rigs, and joints that nothing drives.
    handles: Vec<Pair>,
    /// Slots of controls that only the new rig has.
    fresh: Vec<usize>,
    /// Joints, as indices of `joints`, that each posable node of the new rig moves.
    moves: OnceLock<BTreeMap<usize, HashSet<usize>>>,
    /// Diagonal of the box around the joints at rest.
    size: f32,
    /// True if every pose means the same in both rigs.
    is_same: bool,
}

impl PoseKeeper {
    /// Prepares for poses of instances of `before` that shall mean the same for instances of `after`. Both are compiled with
    /// all nodes, or with controls exposed.
    pub fn between(before: &Arc<RigProgram>, after: &Arc<RigProgram>) -> Self {
        let [mut before, mut after] = [before, after].map(|program| RigState::new(program.clone()));
        before.evaluate(0.0);
        after.evaluate(0.0);
        let (from, to) = (before.program().clone(), after.program().clone());
        let places = || from.nodes().iter().zip(before.globals()).filter(|(node, _)| node.kind == NodeType::Joint);
        let low = places().map(|(_, at)| at.translation).reduce(glam::Vec3::min).unwrap_or_default();
        let high = places().map(|(_, at)| at.translation).reduce(glam::Vec3::max).unwrap_or_default();
        let size = (high - low).length().max(f32::MIN_POSITIVE);
        let pair = |slot: usize| {
            let known = from.node(to.nodes()[slot].uid)?;
            let (was, is) = (before.global_at(known), after.global_at(slot));
            let turned = if was == is { Trs::IDENTITY } else { relative(was, is) };
            Some((Pair { before: known, after: slot, turned }, was.translation.distance(is.translation)))
        };
        let nodes = to.nodes();
        let slots = |kind: NodeType| (0..nodes.len()).filter(move |slot| nodes[*slot].kind == kind);
        let same_place = |(pair, distance): (Pair, f32)| (distance <= 1e-5 * size).then_some(pair);
        let known: Vec<(Pair, f32)> = slots(NodeType::Joint).filter_map(pair).collect();
        let joints: Vec<Pair> = known.iter().copied().filter_map(same_place).collect();
        // Where the skeleton has other proportions, a control that stands elsewhere stands where it belongs.
        let is_reshaped = joints.len() < known.len();
        let kept = |found: (Pair, f32)| if is_reshaped { same_place(found) } else { Some(found.0) };
        let controls = slots(NodeType::Control).filter_map(pair).filter_map(kept);
        let free = joints.iter().copied().filter(|pair| !to.nodes()[pair.after].is_driven);
        let mut handles: Vec<Pair> = controls.chain(free).collect();
        handles.retain(|pair| to.nodes()[pair.after].is_posable());
        // A node comes after those that it stands on, whatever the order in which commands made them.
        let depth = |slot: usize| std::iter::successors(nodes[slot].parent, |slot| nodes[*slot].parent).count();
        handles.sort_by_key(|pair| depth(pair.after));
        let fresh = slots(NodeType::Control)
            .filter(|slot| to.nodes()[*slot].is_posable() && from.node(to.nodes()[*slot].uid).is_none())
            .collect();
        let is_same = means_the_same(&from, &to, &handles, size);
        Self { joints, handles, fresh, moves: OnceLock::new(), size, is_same, before, after }
    }

    /// True if every pose means the same in both rigs, because they have the same nodes with the same axes and parents.
    pub fn is_idle(&self) -> bool {
        self.is_same
    }

    /// Re-expresses a pose. Offsets of a pose that means the same already are not touched.
    ///
    /// Takes some tens of microseconds for such a pose, and some milliseconds for another one of a character.
    pub fn keep(&self, offsets: &BTreeMap<Uid, PoseOffset>, values: &AttributeValues) -> KeptPose {
        let unchanged = KeptPose { offsets: offsets.clone(), deviations: Vec::new() };
        if self.is_same {
            return unchanged;
        }
        let mut before = posed(&self.before, offsets, values);
        before.evaluate(0.0);
        let mut attempt = posed(&self.after, offsets, values);
        attempt.evaluate(0.0);
        let targets: Vec<Trs> = self.joints.iter().map(|pair| target(&before, pair)).collect();
        if self.error(&attempt, &targets) > 0.0 {
            self.place_handles(&before, &mut attempt, &targets, offsets);
            self.correct_joints(&mut attempt, &targets);
            self.refine(&mut attempt, &targets);
        }
        let mut kept = unchanged;
        for slot in self.handles.iter().map(|pair| pair.after).chain(self.fresh.iter().copied()) {
            let (uid, offset) = (attempt.program().nodes()[slot].uid, attempt.offset_at(slot));
            if offsets.get(&uid).copied().unwrap_or_default() != offset {
                kept.offsets.insert(uid, offset);
            }
        }
        kept.offsets.retain(|_, offset| *offset != PoseOffset::IDENTITY);
        kept.deviations = self.listed(&attempt, &targets);
        kept
    }

    /// Joints that do not stand as before where the new rig has one pose and the old one another, both with the same
    /// attributes.
    pub fn deviations(
        &self,
        was: &BTreeMap<Uid, PoseOffset>,
        is: &BTreeMap<Uid, PoseOffset>,
        values: &AttributeValues,
    ) -> Vec<Deviation> {
        let mut before = posed(&self.before, was, values);
        before.evaluate(0.0);
        let mut after = posed(&self.after, is, values);
        after.evaluate(0.0);
        let targets: Vec<Trs> = self.joints.iter().map(|pair| target(&before, pair)).collect();
        self.listed(&after, &targets)
    }

    /// Joints that are off by more than anybody would see.
    fn listed(&self, state: &RigState, targets: &[Trs]) -> Vec<Deviation> {
        let mut deviations = Vec::new();
        for (pair, target) in self.joints.iter().zip(targets) {
            let (distance, angle) = between(state.global_at(pair.after), target);
            if distance > OFF.0 * self.size || angle > OFF.1 {
                let node = &state.program().nodes()[pair.after];
                let label = node.label.as_deref().map(str::to_owned);
                deviations.push(Deviation { joint: node.uid, label, distance, angle });
            }
        }
        deviations
    }

    /// Puts the nodes of both rigs where they were, parents before children, as far as that helps.
    fn place_handles(
        &self,
        before: &RigState,
        attempt: &mut RigState,
        targets: &[Trs],
        offsets: &BTreeMap<Uid, PoseOffset>,
    ) {
        let mut best = (self.error(attempt, targets), attempt.clone());
        for _ in 0..ROUNDS {
            for pair in &self.handles {
                let wanted = target(before, pair);
                if !self.is_near(attempt.global_at(pair.after), &wanted) {
                    self.place(attempt, pair.after, &wanted);
                }
            }
            // Controls that stand on others which come later are off until the next round.
            let error = self.error(attempt, targets);
            if error < best.0 {
                best = (error, attempt.clone());
            }
            if error == 0.0 {
                break;
            }
        }
        *attempt = best.1;
        // What was at rest and helps nothing is at rest again.
        for pair in &self.handles {
            let offset = attempt.offset_at(pair.after);
            let was = offsets.get(&attempt.program().nodes()[pair.after].uid).copied().unwrap_or_default();
            if offset == was {
                continue;
            }
            attempt.set_offset_at(pair.after, was);
            attempt.evaluate(0.0);
            if self.error(attempt, targets) > best.0 + 1e-6 {
                attempt.set_offset_at(pair.after, offset);
                attempt.evaluate(0.0);
            }
        }
    }

    /// Puts joints right that are off, parents before children, with the controls that are most their own.
    fn correct_joints(&self, attempt: &mut RigState, targets: &[Trs]) {
        let mut error = self.error(attempt, targets);
        for _ in 0..ROUNDS {
            let start = error;
            for number in 0..self.joints.len() {
                let slot = self.joints[number].after;
                for handle in self.handles_of(number) {
                    let now = *attempt.global_at(slot);
                    if self.is_near(&now, &targets[number]) {
                        break;
                    }
                    // The movement, in the rig's space, that brings the joint to its target brings the control to its own.
                    let carried = relative(&now, attempt.global_at(handle));
                    let wanted = multiply(&targets[number], &carried);
                    let offset = attempt.offset_at(handle);
                    self.place(attempt, handle, &wanted);
                    let next = self.error(attempt, targets);
                    if next < error * 0.999 {
                        error = next;
                    } else {
                        attempt.set_offset_at(handle, offset);
                        attempt.evaluate(0.0);
                    }
                }
            }
            if error == 0.0 || error > start * 0.9 {
                break;
            }
        }
    }

    /// Slots of posable nodes that move a joint: new ones first, then those that move the fewest others.
    fn handles_of(&self, joint: usize) -> Vec<usize> {
        let mut found: Vec<(bool, usize, usize)> = self
            .moves()
            .iter()
            .filter(|(_, moved)| moved.contains(&joint))
            .map(|(slot, moved)| (!self.fresh.contains(slot), moved.len(), *slot))
            .collect();
        found.sort_unstable();
        found.into_iter().take(TRIES).map(|(.., slot)| slot).collect()
    }

    fn moves(&self) -> &BTreeMap<usize, HashSet<usize>> {
        self.moves.get_or_init(|| self.find_moves())
    }

    /// The joints that each posable node moves, found by moving each of them a little.
    fn find_moves(&self) -> BTreeMap<usize, HashSet<usize>> {
        let mut state = self.after.clone();
        let rest = self.after.globals();
        let turn = glam::Quat::from_euler(glam::EulerRot::XYZ, 0.2, 0.3, 0.25);
        let slots = self.handles.iter().map(|pair| pair.after).chain(self.fresh.iter().copied());
        slots
            .map(|slot| {
                let moved = PoseOffset {
                    translation: glam::Vec3::new(0.03, 0.05, 0.04) * self.size,
                    ..PoseOffset::from_rotation(turn)
                };
                state.set_offset_at(slot, moved);
                state.evaluate(0.0);
                let is_moved = |pair: &Pair| !self.is_near(state.global_at(pair.after), &rest[pair.after]);
                let joints = self.joints.iter().enumerate().filter(|(_, pair)| is_moved(pair));
                let joints = joints.map(|(number, _)| number).collect();
                state.set_offset_at(slot, PoseOffset::IDENTITY);
                state.evaluate(0.0);
                (slot, joints)
            })
            .collect()
    }

    /// Poses a node so that it stands at `wanted`, as far as its channels and limits let it.
    fn place(&self, attempt: &mut RigState, slot: usize, wanted: &Trs) {
        for _ in 0..3 {
            let now = *attempt.global_at(slot);
            if self.is_near(&now, wanted) {
                return;
            }
            let offset = attempt.offset_at(slot);
            let mut next = offset_towards(&now, &offset, wanted);
            if (now.scale - wanted.scale).abs().max_element() > 1e-6 {
                next.scale = offset.scale * wanted.scale / now.scale;
            }
            attempt.set_offset_at(slot, next);
            attempt.evaluate(0.0);
        }
    }

    /// Distance of the joints from their targets, as one number; zero if all are near.
    fn error(&self, state: &RigState, targets: &[Trs]) -> f32 {
        let off = |(pair, target): (&Pair, &Trs)| {
            let now = state.global_at(pair.after);
            if self.is_near(now, target) {
                return 0.0;
            }
            let (distance, angle) = between(now, target);
            distance / self.size + angle.to_radians()
        };
        self.joints.iter().zip(targets).map(off).sum()
    }

    fn is_near(&self, a: &Trs, b: &Trs) -> bool {
        let (distance, angle) = between(a, b);
        distance <= NEAR.0 * self.size && angle <= NEAR.1 && (a.scale - b.scale).abs().max_element() <= 1e-5
    }
}

/// True if both rigs have the same controls and joints below the same parents, and what people pose has the same axes. A
/// parameter of a constraint may differ: its author wants another result.
fn means_the_same(from: &RigProgram, to: &RigProgram, handles: &[Pair], size: f32) -> bool {
    let matters = |kind: NodeType| kind != NodeType::Null;
    let count = |program: &RigProgram| program.nodes().iter().filter(|node| matters(node.kind)).count();
    let parent = |program: &RigProgram, slot: usize| {
        let nodes = program.nodes();
        let mut above = std::iter::successors(nodes[slot].parent, |slot| nodes[*slot].parent);
        above.find(|slot| matters(nodes[*slot].kind)).map(|slot| nodes[slot].uid)
    };
    let is_turned = |pair: &Pair| {
        let (distance, angle) = between(&pair.turned, &Trs::IDENTITY);
        distance > 1e-6 * size || angle > 1e-3
    };
    count(from) == count(to)
        && !handles.iter().any(is_turned)
        && (0..to.nodes().len())
            .filter(|slot| matters(to.nodes()[*slot].kind))
            .all(|slot| from.node(to.nodes()[slot].uid).is_some_and(|known| parent(from, known) == parent(to, slot)))
}

/// Target in the new rig of a node in the old rig's pose.
fn target(before: &RigState, pair: &Pair) -> Trs {
    let posed = before.global_at(pair.before);
    if pair.turned == Trs::IDENTITY { *posed } else { multiply(posed, &pair.turned) }
}

fn between(a: &Trs, b: &Trs) -> (f32, f32) {
    (a.translation.distance(b.translation), angle_between(a, b))
}

/// An instance in a pose; what it does not have is left out.
fn posed(rest: &RigState, offsets: &BTreeMap<Uid, PoseOffset>, values: &AttributeValues) -> RigState {
    let mut state = rest.clone();
    let program = state.program().clone();
    for (uid, offset) in offsets {
        if let Some(slot) = program.node(*uid) {
            state.set_offset_at(slot, *offset);
        }
    }
    for (uid, values) in values {
        for (name, value) in values {
            if let Some(slot) = program.attribute(*uid, name) {
                state.set_attribute_at(slot, *value);
            }
        }
    }
    state
}
