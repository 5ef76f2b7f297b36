//! Motion that goes on through a rebuild: inputs and springs of one instance for another program.

use std::sync::Arc;

use super::{Memory, RigState};
use crate::{
    rig::PoseOffset,
    solve::program::{ProgramAttribute, RigProgram},
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
}

impl Carry {
    /// Correspondences from one program to another.
    pub fn between(from: &RigProgram, to: &RigProgram) -> Self {
        let attribute = |attribute: &ProgramAttribute| {
            let slot = from.attribute(to.nodes[attribute.node].uid, &attribute.name)?;
            from.attributes[slot].is_settable.then_some(slot)
        };
        let springs = &from.tables.springs;
        let nodes: Vec<Option<usize>> = to.nodes.iter().map(|node| from.node(node.uid)).collect();
        let attributes: Vec<Option<usize>> = to.attributes.iter().map(attribute).collect();
        let is_aligned = (from.nodes.len(), from.attributes.len()) == (to.nodes.len(), to.attributes.len())
            && nodes.iter().enumerate().all(|(slot, from)| *from == Some(slot))
            && to.attributes.iter().zip(&from.attributes).all(|(a, b)| (a.node, &a.name) == (b.node, &b.name))
            && to.nodes.iter().zip(&from.nodes).all(|(a, b)| a.is_posable() == b.is_posable());
        let inputs: Vec<Option<usize>> = to.inputs.iter().map(|input| from.input(*input)).collect();
        let spring = |constraint| springs.iter().position(|known| known.constraint == constraint);
        let springs: Vec<Option<usize>> = to.tables.springs.iter().map(|op| spring(op.constraint)).collect();
        let in_order = |list: &[Option<usize>]| list.iter().enumerate().all(|(slot, from)| *from == Some(slot));
        let is_in_place = is_aligned
            && (from.poses, from.inputs.len(), from.spring_ops.len(), from.morphs.len())
                == (to.poses, to.inputs.len(), to.spring_ops.len(), to.morphs.len())
            && in_order(&inputs)
            && in_order(&springs)
            && to.nodes.iter().zip(&from.nodes).all(|(a, b)| a.pose == b.pose);
        Self { nodes, attributes, is_aligned, inputs, springs, is_in_place }
    }

    /// For each node slot of the new program the slot of the same node in the old one.
    pub fn nodes(&self) -> &[Option<usize>] {
        &self.nodes
    }

    /// True if both programs have the same nodes and attributes in the same slots.
    pub fn is_aligned(&self) -> bool {
        self.is_aligned
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
        let inputs = program.nodes.len() + 1..program.nodes.len() + 1 + program.inputs.len();
        let settable = program.attributes.iter().enumerate().filter(|(_, attribute)| attribute.is_settable);
        if self.memory == Memory::Whole {
            let (x, n) = (self.x[inputs.clone()].to_vec(), self.n[..program.attributes.len()].to_vec());
            self.x.clone_from(&program.x);
            self.n.clone_from(&program.n);
            self.x[inputs].copy_from_slice(&x);
            settable.clone().for_each(|(slot, _)| self.n[slot] = n[slot]);
            self.dirty.clear();
            self.dirty.resize(program.ops.len().div_ceil(64), 0);
        }
        for (slot, attribute) in settable {
            self.n[slot] = attribute.kind.clamp(self.n[slot], attribute.default);
        }
        for node in program.nodes.iter() {
            if let (Some(freedom), Some(pose)) = (node.freedom, self.poses.get_mut(node.pose.0 as usize))
                && *pose != PoseOffset::IDENTITY
            {
                *pose = freedom.clamp(*pose);
            }
        }
        self.program = Arc::clone(program);
        self.mark_all();
    }

    /// As [`carry_over`](Self::carry_over), with correspondences from the other instance's program to this one's.
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
