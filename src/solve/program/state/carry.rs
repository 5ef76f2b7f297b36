//! Motion that goes on through a rebuild: inputs and springs of one instance for another program.

use std::{collections::BTreeSet, sync::Arc};

use super::{Memory, RigState, mark, partial::PartialRun};
use crate::{
    rig::PoseOffset,
    solve::program::{ProgramAttribute, ProgramNode, RigProgram, run::same_bits},
};

/// Correspondences of two programs of the same rig: nodes by uid, attributes by node and name, springs by constraint. Made
/// once for all instances of the program.
#[derive(Debug, Clone)]
pub struct Carry {
    nodes: Vec<Option<usize>>,
    attributes: Vec<Option<usize>>,
    inputs: Vec<Option<usize>>,
    springs: Vec<Option<usize>>,
    /// True if both programs have the same nodes and attributes in the same slots.
    is_aligned: bool,
    /// True if also poses, inputs and springs have the same places, so that an instance can go on with its own lists.
    is_in_place: bool,
    /// Slots of nodes whose poses have other bounds, and of attributes with another range, if the places are the same.
    bounds: Vec<u32>,
    ranges: Vec<u32>,
    /// Differences of two programs of one layout; `None` for programs of different layouts.
    changes: Option<Changes>,
    /// True if operations compute the results of all nodes, in the same registers, so that an instance that runs all of them
    /// compares the results with those of before.
    has_results: bool,
    /// Run of instances that remember results only and are up to date; `None` where all operations have to run.
    partial: Option<Arc<PartialRun>>,
}

/// Differences between two programs of one layout: operations with other parameters, and registers with other values at the
/// start.
#[derive(Debug, Clone, Default)]
struct Changes {
    ops: Vec<u32>,
    x: Vec<u32>,
    n: Vec<u32>,
}

impl Changes {
    /// `None` where a result differs that no operation computes.
    fn between(from: &RigProgram, to: &RigProgram) -> Option<Self> {
        if !Arc::ptr_eq(&from.layout, &to.layout) {
            return None;
        }
        let is_same = |at: &u32| {
            let (before, after) = (&from.ops[*at as usize], &to.ops[*at as usize]);
            after.is_same(&to.tables, before, &from.tables)
        };
        let inputs = to.nodes.len() + 1..to.nodes.len() + 1 + to.inputs.len();
        let is_set = |slot: usize| to.attributes.get(slot).is_some_and(|attribute| attribute.is_settable);
        let changes = Self {
            ops: (0..to.ops.len() as u32).filter(|at| !is_same(at)).collect(),
            x: (0..to.x.len())
                .filter(|at| !inputs.contains(at) && !same_bits(&from.x[*at], &to.x[*at]))
                .map(|at| at as u32)
                .collect(),
            n: (0..to.n.len())
                .filter(|at| !is_set(*at) && from.n[*at].to_bits() != to.n[*at].to_bits())
                .map(|at| at as u32)
                .collect(),
        };
        changes.x.iter().all(|at| *at as usize > to.nodes.len()).then_some(changes)
    }

    /// Registers with other values, transforms first.
    fn registers(&self, to: &RigProgram) -> impl Iterator<Item = usize> {
        let transforms = to.x.len();
        let numbers = self.n.iter().map(move |at| transforms + *at as usize);
        self.x.iter().map(|at| *at as usize).chain(numbers)
    }
}

/// True if operations compute the transforms of all nodes.
fn computes_all_nodes(program: &RigProgram) -> bool {
    // The first register is the rig's space.
    let mut is_computed = vec![false; program.nodes.len() + 1];
    for register in (0..program.ops.len()).flat_map(|op| program.layout.written_by(op)) {
        if let Some(known) = is_computed.get_mut(register) {
            *known = true;
        }
    }
    is_computed.iter().skip(1).all(|known| *known)
}

impl Carry {
    /// Correspondences from one program to another.
    pub fn between(from: &RigProgram, to: &RigProgram) -> Self {
        // Programs of one rig mostly have the same nodes and attributes in the same slots.
        let node = |(slot, node): (usize, &ProgramNode)| match from.nodes.get(slot) {
            Some(before) if before.uid == node.uid => Some(slot),
            _ => from.node(node.uid),
        };
        let attribute = |(slot, attribute): (usize, &ProgramAttribute)| {
            let uid = to.nodes[attribute.node].uid;
            let is_same =
                |before: &&ProgramAttribute| from.nodes[before.node].uid == uid && before.name == attribute.name;
            let slot = match from.attributes.get(slot).filter(is_same) {
                Some(_) => slot,
                None => from.attribute(uid, &attribute.name)?,
            };
            from.attributes[slot].is_settable.then_some(slot)
        };
        let springs = &from.tables.springs;
        let nodes: Vec<Option<usize>> = to.nodes.iter().enumerate().map(node).collect();
        let attributes: Vec<Option<usize>> = to.attributes.iter().enumerate().map(attribute).collect();
        let is_aligned = (from.nodes.len(), from.attributes.len()) == (to.nodes.len(), to.attributes.len())
            && nodes.iter().enumerate().all(|(slot, from)| *from == Some(slot))
            && to.attributes.iter().zip(&from.attributes).all(|(a, b)| (a.node, &a.name) == (b.node, &b.name))
            && to.nodes.iter().zip(&from.nodes).all(|(a, b)| a.is_posable() == b.is_posable());
        let inputs: Vec<Option<usize>> = to.inputs.iter().map(|input| from.input(*input)).collect();
        let spring = |constraint| springs.iter().position(|known| known.constraint == constraint);
        let springs: Vec<Option<usize>> = to.tables.springs.iter().map(|op| spring(op.constraint)).collect();
        let in_order = |list: &[Option<usize>]| list.iter().enumerate().all(|(slot, from)| *from == Some(slot));
        let is_in_place = is_aligned
            && (from.poses, from.inputs.len(), from.layout.spring_ops.len(), from.morphs.len())
                == (to.poses, to.inputs.len(), to.layout.spring_ops.len(), to.morphs.len())
            && in_order(&inputs)
            && in_order(&springs)
            && to.nodes.iter().zip(&from.nodes).all(|(a, b)| a.pose == b.pose);
        let (mut bounds, mut ranges, mut changes) = (Vec::new(), Vec::new(), None);
        if is_in_place {
            let has_other_bounds = |slot: &u32| {
                let slot = *slot as usize;
                to.nodes[slot].freedom != from.nodes[slot].freedom
            };
            let has_other_range = |slot: &u32| {
                let (a, b) = (&to.attributes[*slot as usize], &from.attributes[*slot as usize]);
                (&a.kind, a.default.to_bits(), a.is_settable) != (&b.kind, b.default.to_bits(), b.is_settable)
            };
            bounds = (0..to.nodes.len() as u32).filter(has_other_bounds).collect();
            ranges = (0..to.attributes.len() as u32).filter(has_other_range).collect();
            changes = Changes::between(from, to);
        }
        // Poses and values that are clamped again are others.
        let partial = if bounds.is_empty() && ranges.is_empty() {
            changes.as_ref().and_then(|changes| PartialRun::of(to, &changes.ops, changes.registers(to)))
        } else {
            None
        };
        let partial = partial.map(Arc::new);
        let has_results = is_in_place && changes.is_none() && computes_all_nodes(to);
        Self {
            nodes,
            attributes,
            is_aligned,
            inputs,
            springs,
            is_in_place,
            bounds,
            ranges,
            changes,
            has_results,
            partial,
        }
    }

    /// Slot, for each node slot of the new program, of the same node in the old one.
    pub fn nodes(&self) -> &[Option<usize>] {
        &self.nodes
    }

    /// True if both programs have the same nodes and attributes in the same slots.
    pub fn is_aligned(&self) -> bool {
        self.is_aligned
    }

    /// True if poses have the same bounds in both programs, so that every pose goes on as it is.
    pub fn has_same_bounds(&self) -> bool {
        self.is_in_place && self.bounds.is_empty()
    }

    /// Number of operations that an instance which remembers results only, and is up to date, runs after the exchange.
    pub fn operations_of_results(&self, to: &RigProgram) -> usize {
        self.partial.as_ref().map_or(to.ops.len(), |run| run.ops.len())
    }

    /// Number of operations that an instance which remembers all registers, and is up to date, runs after the exchange whatever
    /// they give; those that read a changed result follow. `None` where all operations run.
    pub fn operations_of_registers(&self, to: &RigProgram) -> Option<usize> {
        let changes = self.changes.as_ref()?;
        let readers = changes.registers(to).flat_map(|register| to.layout.readers.get(register));
        Some(changes.ops.iter().chain(readers).collect::<BTreeSet<_>>().len())
    }

    /// True if an instance that remembers all registers runs only what differs between the programs.
    pub fn is_partial(&self) -> bool {
        self.changes.is_some()
    }
}

impl RigState {
    /// Takes over poses, attribute values, inputs and the motion of springs from an instance of another program of the
    /// same rig. Nodes, attributes and springs are matched by uid and name; what the other instance does not have stays
    /// as it was built.
    pub fn carry_over(&mut self, other: &Self) {
        self.carry_along(other, &Carry::between(&other.program, &self.program));
    }

    /// Goes on with another program of the same rig: see [`carry_over`](Self::carry_over).
    pub fn exchange(&mut self, program: &Arc<RigProgram>, carry: &Carry) {
        if !carry.is_in_place {
            let mut fresh = Self::with_memory(Arc::clone(program), self.memory);
            fresh.carry_along(self, carry);
            *self = fresh;
            return;
        }
        if let Some(changes) = carry.changes.as_ref().filter(|_| self.memory == Memory::Whole) {
            self.exchange_changes(program, changes, carry);
            return;
        }
        let is_settled = self.memory == Memory::Results && !self.is_dirty(0.0);
        if let Some(run) = carry.partial.as_ref().filter(|_| is_settled) {
            self.program = Arc::clone(program);
            self.partial = Some(Arc::clone(run));
            return;
        }
        let inputs = program.nodes.len() + 1..program.nodes.len() + 1 + program.inputs.len();
        let settable = program.attributes.iter().enumerate().filter(|(_, attribute)| attribute.is_settable);
        if self.memory == Memory::Whole {
            let (x, n) = (self.x[inputs.clone()].to_vec(), self.n[..program.attributes.len()].to_vec());
            self.has_results = carry.has_results && (self.has_results || !self.all_dirty);
            let nodes = 1..=program.nodes.len();
            let results = if self.has_results { self.x[nodes.clone()].to_vec() } else { Vec::new() };
            self.x.clone_from(&program.x);
            if self.has_results {
                self.x[nodes].copy_from_slice(&results);
            }
            self.n.clone_from(&program.n);
            self.x[inputs].copy_from_slice(&x);
            settable.for_each(|(slot, _)| self.n[slot] = n[slot]);
            self.dirty.clear();
            self.dirty.resize(program.ops.len().div_ceil(64), 0);
        }
        // Values are within the ranges and bounds of before.
        for slot in carry.ranges.iter().map(|slot| *slot as usize) {
            let attribute = &program.attributes[slot];
            if attribute.is_settable {
                self.n[slot] = attribute.kind.clamp(self.n[slot], attribute.default);
            }
        }
        for node in carry.bounds.iter().map(|slot| &program.nodes[*slot as usize]) {
            if let (Some(freedom), Some(pose)) = (node.freedom, self.poses.get_mut(node.pose.0 as usize))
                && *pose != PoseOffset::IDENTITY
            {
                *pose = freedom.clamp(*pose);
            }
        }
        self.program = Arc::clone(program);
        self.mark_all();
    }

    /// Goes on with a program of the same layout: what depends on a difference has to run.
    fn exchange_changes(&mut self, program: &Arc<RigProgram>, changes: &Changes, carry: &Carry) {
        let layout = &program.layout;
        mark(&mut self.dirty, &changes.ops);
        for at in changes.x.iter().map(|at| *at as usize) {
            self.x[at] = program.x[at];
            mark(&mut self.dirty, layout.readers.get(at));
        }
        for at in changes.n.iter().map(|at| *at as usize) {
            self.n[at] = program.n[at];
            mark(&mut self.dirty, layout.readers.get(program.x.len() + at));
        }
        for slot in carry.ranges.iter().map(|slot| *slot as usize) {
            let attribute = &program.attributes[slot];
            if !attribute.is_settable {
                continue;
            }
            let value = attribute.kind.clamp(self.n[slot], attribute.default);
            if self.n[slot].to_bits() != value.to_bits() {
                self.n[slot] = value;
                mark(&mut self.dirty, layout.attribute_readers.get(slot));
            }
        }
        for node in carry.bounds.iter().map(|slot| &program.nodes[*slot as usize]) {
            let Some((freedom, pose)) = node.freedom.zip(self.poses.get_mut(node.pose.0 as usize)) else { continue };
            let clamped = if *pose == PoseOffset::IDENTITY { *pose } else { freedom.clamp(*pose) };
            if *pose != clamped {
                *pose = clamped;
                mark(&mut self.dirty, layout.pose_readers.get(node.pose.0 as usize));
            }
        }
        self.any_dirty |= self.dirty.iter().any(|word| *word != 0);
        self.program = Arc::clone(program);
    }

    /// Takeover as in [`carry_over`](Self::carry_over), with the correspondences from the other instance's program to
    /// this one's.
    pub fn carry_along(&mut self, other: &Self, carry: &Carry) {
        fn pairs(list: &[Option<usize>]) -> impl Iterator<Item = (usize, usize)> {
            list.iter().enumerate().filter_map(|(slot, from)| Some((slot, (*from)?)))
        }
        for (slot, from) in pairs(&carry.nodes) {
            self.set_offset_at(slot, other.offset_at(from));
        }
        for (slot, from) in pairs(&carry.attributes) {
            self.set_attribute_at(slot, other.n[from]);
        }
        for (slot, from) in pairs(&carry.inputs) {
            self.set_input_at(slot, other.x[other.program.nodes.len() + 1 + from]);
        }
        for (slot, from) in pairs(&carry.springs) {
            if let (Some(own), Some(state)) = (self.springs.get_mut(slot), other.springs.get(from)) {
                *own = *state;
            }
        }
    }
}
