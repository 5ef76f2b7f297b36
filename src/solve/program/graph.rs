//! Graph of operations from which a program is made: it hands out registers, finds nodes and attributes by uid, and
//! chains the constraints of one node in list order.

mod finish;
mod scalar_key;

use std::sync::Arc;

use bevy::platform::collections::HashMap;
use glam::Vec3;

use self::scalar_key::{ScalarKey, scalar_key};
use super::{
    ConstraintName, ExternalNode, Keep, NumberPlace, ProgramError, name,
    op::{N, Op, Pose, Span, Tables, X},
};
use crate::{
    mesh::model::Trs,
    rig::{BuiltRig, Channel, Dependency, NodeType, Output, Scalar, Uid},
    solve::weights::multiply,
};

/// An operation and its origin, for the order and for errors.
#[derive(Debug, Clone, Copy)]
pub(super) struct Step {
    pub op: Op,
    /// The node that it moves or belongs to.
    pub node: usize,
    /// Index of the constraint in the rig's list.
    pub constraint: Option<usize>,
}

/// Register that constraints drive of a node.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum DrivenRegister {
    /// No register.
    Not,
    /// The local transform.
    Local(X),
    /// The rig transform, written at once.
    Global,
}

/// State of a node while constraints are read.
#[derive(Debug, Clone, Default)]
struct NodeState {
    /// Local transform after the constraints so far; `None` while nothing drives the node.
    local: Option<X>,
    /// Local transform after the last constraint that can move the origin.
    placed: Option<X>,
    /// The step that still takes driven channels, with the channels so far.
    open: Option<(usize, Vec<(Channel, N)>)>,
    /// The last operation, if it is a transform operation that replaces everything before it.
    whole: Option<u32>,
    /// Register of the origin where that is computed on its own.
    position: Option<X>,
    /// Attributes as constraints read them, in order.
    attributes: Vec<N>,
}

/// Operations and registers of an unfinished program.
pub(super) struct Graph<'a> {
    pub rig: &'a BuiltRig,
    pub steps: Vec<Step>,
    pub tables: Tables,
    pub x: Vec<Trs>,
    pub n: Vec<f32>,
    /// Rig transforms of the nodes as they were built.
    pub built: Vec<Trs>,
    /// Settable attributes: node, number of the attribute, register.
    pub attributes: Vec<(usize, usize, N)>,
    /// Registers of the declared inputs, in order.
    pub inputs: Vec<X>,
    /// Morph targets by name, with their register.
    pub morphs: Vec<(Arc<str>, N)>,
    nodes: Vec<NodeState>,
    index: HashMap<Uid, usize>,
    /// The last constraint on each driven node.
    last_on: HashMap<Uid, usize>,
    outside: HashMap<Uid, X>,
    exposed: Vec<bool>,
    all: bool,
    scalars: HashMap<ScalarKey, N>,
    /// Last values that constraints gave a driven attribute.
    driven: HashMap<(usize, usize), N>,
    morph_terms: Vec<(Arc<str>, Vec<N>)>,
    /// Nodes whose origins are computed on their own, with the registers.
    aliases: Vec<(usize, X)>,
}

/// Places of the nodes of a built rig by their uids, and their transforms in the rig's space without any pose.
///
/// # Errors
/// Two nodes have the same uid, a node stands before its parent, or its transform is no transform.
pub(super) fn placed_nodes(rig: &BuiltRig) -> Result<(HashMap<Uid, usize>, Vec<Trs>), ProgramError> {
    let mut index = HashMap::with_capacity_and_hasher(rig.nodes.len(), Default::default());
    let mut built: Vec<Trs> = Vec::with_capacity(rig.nodes.len());
    for (at, node) in rig.nodes.iter().enumerate() {
        if let Some(first) = index.insert(node.uid, at) {
            let (first, second) = (name(rig, first), name(rig, at));
            return Err(ProgramError::DuplicateNode { uid: node.uid, first, second });
        }
        let parent = match node.parent {
            Some(parent) if parent >= at => {
                return Err(ProgramError::ParentOrder { node: name(rig, at), parent });
            }
            parent => parent.map_or(Trs::IDENTITY, |parent| built[parent]),
        };
        if !valid(&node.base) {
            return Err(ProgramError::NotFinite { place: NumberPlace::Base(name(rig, at)) });
        }
        built.push(multiply(&parent, &node.base));
    }
    Ok((index, built))
}

impl<'a> Graph<'a> {
    /// A graph with a register for every node's rig transform: node `i` has register `i + 1`.
    pub fn new(rig: &'a BuiltRig, keep: &Keep, outside: &[ExternalNode]) -> Result<Self, ProgramError> {
        let (index, built) = placed_nodes(rig)?;
        let exposed = exposed(rig, &index, keep)?;
        let mut graph = Self {
            rig,
            steps: Vec::new(),
            tables: Tables { bases: vec![Trs::IDENTITY], ..Tables::default() },
            x: vec![Trs::IDENTITY; rig.nodes.len() + 1],
            n: Vec::new(),
            built,
            attributes: Vec::new(),
            inputs: Vec::new(),
            morphs: Vec::new(),
            nodes: vec![NodeState::default(); rig.nodes.len()],
            index,
            last_on: HashMap::default(),
            outside: HashMap::default(),
            exposed,
            all: matches!(keep, Keep::All),
            scalars: HashMap::default(),
            driven: HashMap::default(),
            morph_terms: Vec::new(),
            aliases: Vec::new(),
        };
        for input in outside {
            let register = graph.new_x();
            graph.x[register.0 as usize] = input.rest;
            graph.inputs.push(register);
            graph.outside.insert(input.uid, register);
        }
        for (at, constraint) in rig.constraints.iter().enumerate() {
            for driven in constraint.constraint.drives() {
                if let Dependency::Node(node) = driven {
                    graph.last_on.insert(node, at);
                }
            }
        }
        graph.declare_attributes();
        Ok(graph)
    }

    /// Declares a register for every attribute, and a second one for attributes that constraints drive.
    fn declare_attributes(&mut self) {
        let mut driven: Vec<(Uid, &str)> = Vec::new();
        for constraint in &self.rig.constraints {
            driven.extend(constraint.constraint.outputs().filter_map(|output| match output {
                Output::Attribute(node, name) => Some((*node, &**name)),
                _ => None,
            }));
        }
        for (at, node) in self.rig.nodes.iter().enumerate() {
            for (number, attribute) in node.attributes.iter().enumerate() {
                let register = self.new_n(attribute.clamp(attribute.default));
                if driven.contains(&(node.uid, &*attribute.name)) {
                    self.nodes[at].attributes.push(register);
                    continue;
                }
                self.nodes[at].attributes.push(register);
                if self.is_posable(at) {
                    self.attributes.push((at, number, register));
                }
            }
        }
    }

    /// Adds a register for a transform.
    pub fn new_x(&mut self) -> X {
        self.x.push(Trs::IDENTITY);
        X(self.x.len() as u32 - 1)
    }

    /// Adds a register for a number with an initial value.
    pub fn new_n(&mut self, value: f32) -> N {
        self.n.push(value);
        N(self.n.len() as u32 - 1)
    }

    /// Returns `true` if people and animation may pose the node.
    pub fn is_posable(&self, node: usize) -> bool {
        self.all || self.exposed[node]
    }

    /// Returns `true` if the node's rig transform is a result of the program.
    pub fn is_kept(&self, node: usize) -> bool {
        self.is_posable(node) || self.rig.nodes[node].kind == NodeType::Joint
    }

    /// The pose slot of a node.
    pub fn pose(&self, node: usize) -> Pose {
        if self.is_posable(node) { Pose(node as u32) } else { Pose::NONE }
    }

    /// The rig transform of a node.
    pub fn global(&self, node: usize) -> X {
        X(node as u32 + 1)
    }

    /// The rig transform of a node's parent.
    pub fn parent(&self, node: usize) -> X {
        self.rig.nodes[node].parent.map_or(X::RIG, |parent| self.global(parent))
    }

    /// Index of a node's base in the table; 0 for the identity.
    pub fn base(&mut self, node: usize) -> u32 {
        let base = self.rig.nodes[node].base;
        if base == Trs::IDENTITY {
            return 0;
        }
        self.tables.bases.push(base);
        self.tables.bases.len() as u32 - 1
    }

    /// Index of an axis in the table.
    pub fn axis(&mut self, axis: Vec3) -> u32 {
        self.tables.axes.push(axis);
        self.tables.axes.len() as u32 - 1
    }

    /// Adds an operation for a node.
    pub fn push(&mut self, op: Op, node: usize, constraint: Option<usize>) {
        self.steps.push(Step { op, node, constraint });
    }

    fn text(&self, constraint: usize) -> ConstraintName {
        ConstraintName::from(&self.rig.constraints[constraint])
    }

    /// Index of a node that a constraint drives.
    pub fn driven(&self, constraint: usize, role: &'static str, node: Uid) -> Result<usize, ProgramError> {
        if let Some(at) = self.index.get(&node) {
            return Ok(*at);
        }
        let constraint = self.text(constraint);
        Err(if self.outside.contains_key(&node) {
            ProgramError::DrivenInput { constraint, role, node }
        } else {
            ProgramError::MissingNode { constraint, role, node }
        })
    }

    /// Register of the rig transform of a node that a constraint reads.
    pub fn read(&self, constraint: usize, role: &'static str, node: Uid) -> Result<X, ProgramError> {
        if let Some(register) = self.outside.get(&node) {
            return Ok(*register);
        }
        self.index.get(&node).map(|at| self.global(*at)).ok_or_else(|| ProgramError::MissingNode {
            constraint: self.text(constraint),
            role,
            node,
        })
    }

    /// Register of a transform whose translation alone is read: the final origin of the node, which does not wait for
    /// constraints that only turn or scale the node.
    pub fn read_position(&mut self, constraint: usize, role: &'static str, node: Uid) -> Result<X, ProgramError> {
        let Some(at) = self.index.get(&node).copied() else { return self.read(constraint, role, node) };
        if let Some(register) = self.nodes[at].position {
            return Ok(register);
        }
        let register = self.new_x();
        self.nodes[at].position = Some(register);
        self.aliases.push((at, register));
        Ok(register)
    }

    /// Rig transform of a node or input as it was built.
    pub fn built_of(&self, node: Uid) -> Trs {
        match (self.index.get(&node), self.outside.get(&node)) {
            (Some(at), _) => self.built[*at],
            (None, Some(register)) => self.x[register.0 as usize],
            (None, None) => Trs::IDENTITY,
        }
    }

    /// The register of a node's local transform after the constraints so far, and the register for its next state.
    ///
    /// `places` says that the constraint can move the node's origin.
    pub fn take_local(&mut self, node: usize, constraint: usize, places: bool) -> (X, X) {
        let input = self.local(node, constraint);
        self.nodes[node].whole = None;
        let out = self.new_x();
        let state = &mut self.nodes[node];
        state.local = Some(out);
        if places {
            state.placed = Some(out);
        }
        (input, out)
    }

    /// The local transform of a node after the constraints so far.
    fn local(&mut self, node: usize, constraint: usize) -> X {
        if let Some(local) = self.nodes[node].local {
            self.close(node);
            return local;
        }
        let (base, out) = (self.base(node), self.new_x());
        self.push(Op::Local { pose: self.pose(node), base, drives: Span::default(), out }, node, Some(constraint));
        self.nodes[node].local = Some(out);
        self.nodes[node].placed = Some(out);
        out
    }

    /// Returns `true` if no later constraint drives a node.
    pub fn is_last(&self, constraint: usize, node: Uid) -> bool {
        self.last_on.get(&node) == Some(&constraint)
    }

    /// Notes that a transform operation replaces the whole transform of a node; if no other constraint follows, the
    /// operation writes the rig transform at once.
    pub fn is_whole(&mut self, node: usize, transform: u32) {
        self.nodes[node].whole = Some(transform);
    }

    /// Adds a number to a channel of a node: to its base if only channels were driven so far, else on top of the
    /// constraints so far.
    pub fn drive_channel(&mut self, node: usize, constraint: usize, channel: Channel, value: N) {
        if self.nodes[node].open.is_none() {
            let step = self.steps.len();
            if self.nodes[node].local.is_none() {
                self.local(node, constraint);
            } else {
                let (input, out) = self.take_local(node, constraint, true);
                self.push(Op::Drive { input, drives: Span::default(), out }, node, Some(constraint));
            }
            self.nodes[node].open = Some((step, Vec::new()));
        }
        if let Some((_, drives)) = &mut self.nodes[node].open {
            drives.push((channel, value));
        }
    }

    /// Writes the driven channels of a node into their step.
    fn close(&mut self, node: usize) {
        let Some((step, list)) = self.nodes[node].open.take() else { return };
        let span = Span { start: self.tables.drives.len() as u32, len: list.len() as u32 };
        self.tables.drives.extend(list);
        if let Op::Local { drives, .. } | Op::Drive { drives, .. } = &mut self.steps[step].op {
            *drives = span;
        }
    }

    /// Sets the value of an attribute; the last value counts.
    pub fn drive_attribute(
        &mut self,
        constraint: usize,
        node: usize,
        name: &str,
        value: N,
    ) -> Result<(), ProgramError> {
        let number = self.attribute_number(constraint, node, name)?;
        self.driven.insert((node, number), value);
        Ok(())
    }

    /// Adds a term to a morph target.
    pub fn drive_morph(&mut self, name: &Arc<str>, value: N) {
        match self.morph_terms.iter_mut().find(|(known, _)| known == name) {
            Some((_, terms)) => terms.push(value),
            None => self.morph_terms.push((Arc::clone(name), vec![value])),
        }
    }

    fn attribute_number(&self, constraint: usize, node: usize, name: &str) -> Result<usize, ProgramError> {
        let attributes = &self.rig.nodes[node].attributes;
        attributes.iter().position(|attribute| *attribute.name == *name).ok_or_else(|| {
            let known: Vec<String> = attributes.iter().map(|attribute| format!("\"{}\"", attribute.name)).collect();
            ProgramError::MissingAttribute {
                constraint: self.text(constraint),
                node: super::name(self.rig, node),
                name: name.to_owned(),
                known: if known.is_empty() { "none".to_owned() } else { known.join(", ") },
            }
        })
    }

    /// Register of a number that a constraint reads.
    pub fn scalar(&mut self, constraint: usize, scalar: &Scalar) -> Result<N, ProgramError> {
        let node = match scalar {
            // Every number has a register of its own, so that the layout of a program does not depend on which of them are
            // equal: an instance that goes on with another number runs what reads it.
            Scalar::Value(value) if value.is_finite() => return Ok(self.new_n(*value)),
            Scalar::Value(_) => {
                return Err(ProgramError::NotFinite { place: NumberPlace::Constraint(self.text(constraint)) });
            }
            Scalar::Attribute { node, .. } | Scalar::Choice { node, .. } | Scalar::Channel { node, .. } => *node,
        };
        let at = self.driven(constraint, "attribute's node", node)?;
        let key = scalar_key(at, scalar);
        if let Some(register) = self.scalars.get(&key) {
            return Ok(*register);
        }
        let register = match scalar {
            Scalar::Value(value) => self.new_n(*value),
            Scalar::Attribute { name, factor, add, .. } => {
                let number = self.attribute_number(constraint, at, name)?;
                let input = self.nodes[at].attributes[number];
                if !(factor.is_finite() && add.is_finite()) {
                    return Err(ProgramError::NotFinite { place: NumberPlace::Constraint(self.text(constraint)) });
                }
                if *factor == 1.0 && *add == 0.0 {
                    input
                } else {
                    let out = self.new_n(0.0);
                    self.push(Op::Linear { input, factor: *factor, add: *add, out }, at, Some(constraint));
                    out
                }
            }
            Scalar::Choice { name, value, .. } => {
                let number = self.attribute_number(constraint, at, name)?;
                let (input, out) = (self.nodes[at].attributes[number], self.new_n(0.0));
                self.push(Op::Choice { input, value: *value, out }, at, Some(constraint));
                out
            }
            Scalar::Channel { channel, .. } => {
                let out = self.new_n(0.0);
                self.push(Op::Channel { pose: self.pose(at), channel: *channel, out }, at, Some(constraint));
                out
            }
        };
        self.scalars.insert(key, register);
        Ok(register)
    }

    /// True if people may set an attribute: no constraint drives it.
    pub fn is_settable(&self, node: usize, number: usize) -> bool {
        self.attributes.binary_search_by_key(&(node, number), |known| (known.0, known.1)).is_ok()
    }

    /// Register from which constraints read an attribute.
    pub fn attribute(&self, node: usize, number: usize) -> N {
        self.nodes[node].attributes[number]
    }
}

pub(super) fn valid(trs: &Trs) -> bool {
    let length = trs.rotation.length_squared();
    trs.translation.is_finite() && trs.scale.is_finite() && length.is_finite() && length > 0.0
}

fn exposed(rig: &BuiltRig, index: &HashMap<Uid, usize>, keep: &Keep) -> Result<Vec<bool>, ProgramError> {
    let mut exposed = vec![false; rig.nodes.len()];
    let Keep::DeformAndExposed(list) = keep else { return Ok(exposed) };
    for wanted in list {
        let mut found = false;
        match wanted {
            super::ExposedNode::Uid(uid) => {
                if let Some(at) = index.get(uid) {
                    exposed[*at] = true;
                    found = true;
                }
            }
            super::ExposedNode::Label(label) => {
                for (at, node) in rig.nodes.iter().enumerate() {
                    if node.label.as_deref() == Some(label) {
                        exposed[at] = true;
                        found = true;
                    }
                }
            }
            super::ExposedNode::Controls => {
                for (at, node) in rig.nodes.iter().enumerate() {
                    exposed[at] |= node.kind == NodeType::Control;
                }
                found = true;
            }
        }
        if !found {
            return Err(ProgramError::UnknownExposed { name: wanted.to_string() });
        }
    }
    Ok(exposed)
}
