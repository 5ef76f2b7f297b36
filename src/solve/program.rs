//! A built rig as one flat program that instances share.
//!
//! [`RigProgram::compile`] turns the nodes and constraints of a [`BuiltRig`] into a list of small operations, sorted so
//! that each comes after the operations it reads from: no maps, no names, no allocation while it runs. The values that
//! differ between instances are in [`RigState`]. Transforms are multiplied as Bevy multiplies two `Transform`s: no
//! shear.
//!
//! A node's local transform is its base with driven channels and its pose offset on top; constraints then change it in
//! list order, each starting from the result of those before. A constraint reads the final transforms of *other* nodes
//! in the same frame. If it needs only the origin of a node, it does not wait for constraints that only turn or scale
//! that node.

mod cache;
mod chains;
mod constraints;
mod error;
mod freedom;
mod graph;
mod hash;
mod inputs;
mod layout;
mod lists;
mod lower;
mod op;
mod order;
mod places;
mod readers;
mod run;
mod state;

use std::{
    fmt,
    sync::{
        Arc,
        atomic::{AtomicU64, Ordering},
    },
};

use glam::{Affine3A, Vec3A};

pub use cache::ProgramCache;
pub use error::{ConstraintName, NumberPlace, ProgramError, StateError};
pub use hash::ContentHash;
pub use state::{Carry, LANES, Memory, RigState};

use self::{
    cache::ByConstraint,
    freedom::Freedom,
    graph::{DrivenRegister, Graph},
    layout::{Ends, Layout, Layouts},
    op::{Op, Pose, Tables, X},
    run::{Machine, Scratch, SingleRegisters},
    state::SpringState,
};
use crate::{
    mesh::model::Trs,
    rig::{AttributeKind, BuiltRig, NodeType, Uid},
    solve::expression::Expression,
};

/// Options of [`RigProgram::compile`].
#[derive(Debug, Clone, Default, PartialEq)]
pub struct CompileOptions {
    /// Nodes whose transforms the program gives.
    pub keep: Keep,
    /// Nodes outside the rig that constraints refer to, such as a steering wheel, beyond those that the rig declares; their
    /// transforms are set each frame.
    pub inputs: Vec<ExternalNode>,
}

/// Nodes that stay available in a program. The compiler drops operations that none of them depends on.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub enum Keep {
    /// All nodes, all of them posable: for editing.
    #[default]
    All,
    /// Joints and the listed nodes; only the listed nodes can be posed and have attributes. For games.
    DeformAndExposed(Vec<ExposedNode>),
}

/// A node that a game wants to pose or to read.
#[derive(bevy::reflect::Reflect, Debug, Clone, PartialEq, Eq)]
pub enum ExposedNode {
    /// The node with this uid.
    Uid(Uid),
    /// All nodes with this label.
    Label(String),
    /// All controls.
    Controls,
}

impl fmt::Display for ExposedNode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Uid(uid) => uid.fmt(f),
            Self::Label(label) => label.fmt(f),
            Self::Controls => "all controls".fmt(f),
        }
    }
}

/// A node outside the rig.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ExternalNode {
    /// Uid by which constraints refer to the node.
    pub uid: Uid,
    /// Transform in the rig's space until it is set.
    pub rest: Trs,
}

/// A node of a program.
#[derive(Debug, Clone, PartialEq)]
pub struct ProgramNode {
    /// Uid of the node.
    pub uid: Uid,
    /// Name for people.
    pub label: Option<Arc<str>>,
    /// Kind of the node.
    pub kind: NodeType,
    /// Slot of the parent, if the program keeps the parent.
    pub parent: Option<usize>,
    /// Transform relative to the parent without any pose.
    pub base: Trs,
    /// Marks a node that a constraint drives.
    pub is_driven: bool,
    /// Slot of the pose offset.
    pose: Pose,
    /// Bounds of its pose offset, if it has any.
    freedom: Option<Freedom>,
    /// Register of the local transform after all constraints, if there is one.
    local: Option<X>,
}

impl ProgramNode {
    /// Returns `true` if the node can be posed.
    pub fn is_posable(&self) -> bool {
        self.pose != Pose::NONE
    }

    /// True if base and pose offset alone make the node's transform relative to its parent.
    pub fn is_plain(&self) -> bool {
        self.is_posable() && !self.is_driven && self.freedom.is_none()
    }
}

/// An attribute of a program.
#[derive(Debug, Clone, PartialEq)]
pub struct ProgramAttribute {
    /// The node, as a slot.
    pub node: usize,
    /// The name.
    pub name: Arc<str>,
    /// Kind of the attribute: number or choice.
    pub kind: AttributeKind,
    /// The value until another is set.
    pub default: f32,
    /// Marks an attribute that can be set; a constraint gives the value of any other.
    pub is_settable: bool,
}

/// A compiled rig: see the [module](self). Nodes, attributes, inputs and morph targets have *slots*: their indices in
/// the lists of the program.
#[derive(Debug)]
pub struct RigProgram {
    /// Number of the program, unique within the process.
    serial: u64,
    hash: ContentHash,
    nodes: Vec<ProgramNode>,
    /// Slots of the nodes by uid.
    by_uid: Vec<(Uid, u32)>,
    attributes: Vec<ProgramAttribute>,
    morphs: Vec<Arc<str>>,
    inputs: Vec<Uid>,
    /// Names of the inputs that the rig declares, which come first.
    declared: Vec<Arc<str>>,
    poses: usize,
    ops: Vec<Op>,
    layout: Arc<Layout>,
    tables: Tables,
    /// Registers before the first run. Transforms: the rig's space, nodes by slot, inputs, others; numbers: attributes,
    /// morph targets, others.
    x: Vec<Trs>,
    n: Vec<f32>,
    /// See [`rest_height`](Self::rest_height).
    height: f32,
}

/// Label and uid of a node, for messages.
fn name(rig: &BuiltRig, node: usize) -> String {
    let node = &rig.nodes[node];
    let label = node.label.as_deref().unwrap_or(&node.name);
    if label.is_empty() { node.uid.to_string() } else { format!("{label} ({})", node.uid) }
}

impl RigProgram {
    /// Compiles a built rig.
    ///
    /// # Errors
    ///
    /// See [`ProgramError`]: references to missing nodes, joints that form no chain, cycles.
    pub fn compile(rig: &BuiltRig, options: &CompileOptions) -> Result<Self, ProgramError> {
        let hash = ContentHash::of(rig, options);
        Self::compile_hashed(rig, options, hash, &mut ByConstraint::default(), &mut Layouts::default())
    }

    /// Checks that a built rig can run: [`compile`](Self::compile) takes it, with all of its nodes. A rig without constraints is
    /// checked node by node, without the memory of a program.
    ///
    /// # Errors
    ///
    /// See [`ProgramError`].
    pub fn check(rig: &BuiltRig) -> Result<(), ProgramError> {
        if rig.constraints.is_empty() {
            return graph::placed_nodes(rig).map(drop);
        }
        Self::compile(rig, &CompileOptions::default()).map(drop)
    }

    /// Transforms of the nodes of a built rig without a pose, in the rig's space and in the order of the nodes, bit by bit as a
    /// [`RigState`] evaluates them, and the [height](Self::rest_height) of the rig. A rig without constraints takes no memory of
    /// a program for them.
    ///
    /// # Errors
    ///
    /// See [`ProgramError`].
    #[cfg(feature = "cli")]
    pub(crate) fn places_at_rest(rig: &BuiltRig) -> Result<(Vec<Trs>, f32), ProgramError> {
        if !rig.constraints.is_empty() {
            let mut state = RigState::new(Arc::new(Self::compile(rig, &CompileOptions::default())?));
            state.evaluate(0.0);
            return Ok((state.globals().to_vec(), state.program().rest_height()));
        }
        graph::placed_nodes(rig)?;
        let mut places: Vec<Trs> = Vec::with_capacity(rig.nodes.len());
        for node in &rig.nodes {
            let above = node.parent.map_or(Trs::IDENTITY, |parent| places[parent]);
            places.push(if node.base == Trs::IDENTITY { above } else { run::place(&above, &node.base) });
        }
        Ok((places, rest_height(rig.nodes.iter().map(|node| (node.parent, node.base, node.kind)))))
    }

    /// Compiles a built rig whose hash is known. Expressions are read once for each constraint, and layouts worked out once
    /// for rigs that differ in numbers only.
    fn compile_hashed(
        rig: &BuiltRig,
        options: &CompileOptions,
        hash: ContentHash,
        expressions: &mut ByConstraint<Arc<Expression>>,
        layouts: &mut Layouts,
    ) -> Result<Self, ProgramError> {
        let outside = inputs::outside(rig, options);
        let mut graph = Graph::new(rig, &options.keep, &outside)?;
        lower::lower(&mut graph, expressions)?;
        let driven = graph.finish();
        let kept: Vec<usize> = (0..rig.nodes.len()).filter(|node| graph.is_kept(*node)).collect();
        let mut slots = vec![None; rig.nodes.len()];
        kept.iter().enumerate().for_each(|(slot, node)| slots[*node] = Some(slot));

        let mut attributes = Vec::new();
        let mut attribute_registers = Vec::new();
        for (slot, node) in kept.iter().enumerate().filter(|(_, node)| graph.is_posable(**node)) {
            for (number, attribute) in rig.nodes[*node].attributes.iter().enumerate() {
                attribute_registers.push(graph.attribute(*node, number));
                attributes.push(ProgramAttribute {
                    node: slot,
                    name: attribute.name.clone(),
                    kind: attribute.kind.clone(),
                    default: attribute.clamp(attribute.default),
                    is_settable: graph.is_settable(*node, number),
                });
            }
        }
        let local = |node: usize| if let DrivenRegister::Local(local) = driven[node] { Some(local) } else { None };
        let count = attribute_registers.len();
        attribute_registers.extend(graph.morphs.iter().map(|morph| morph.1));
        let ends = Ends {
            results: kept.iter().map(|node| graph.global(*node)).collect(),
            numbers: attribute_registers,
            attributes: count,
            settable: graph.attributes.iter().map(|known| known.2).collect(),
            nodes: kept.iter().map(|node| (graph.pose(*node), local(*node))).collect(),
        };
        let layout = layouts.of(&mut graph, ends)?;
        let fixed = layout.fixed(&mut graph);
        run_fixed(&mut graph, &fixed);
        let ops = layout.ops(&mut graph);
        let (x, n) = layout.registers(&graph.x, &graph.n);

        let nodes: Vec<ProgramNode> = kept
            .iter()
            .map(|node| ProgramNode {
                uid: rig.nodes[*node].uid,
                label: rig.nodes[*node].label.clone(),
                kind: rig.nodes[*node].kind,
                parent: rig.nodes[*node].parent.and_then(|parent| slots[parent]),
                base: rig.nodes[*node].base,
                is_driven: driven[*node] != DrivenRegister::Not,
                pose: layout.posed(graph.pose(*node)),
                freedom: rig.nodes[*node].control.as_ref().and_then(|control| Freedom::of(control)),
                local: local(*node).map(|local| layout.placed(local)),
            })
            .collect();
        let mut by_uid: Vec<(Uid, u32)> = nodes.iter().enumerate().map(|(at, node)| (node.uid, at as u32)).collect();
        by_uid.sort_unstable();
        Ok(Self {
            serial: next_serial(),
            hash,
            height: rest_height(nodes.iter().map(|node| (node.parent, node.base, node.kind))),
            nodes,
            by_uid,
            attributes,
            morphs: graph.morphs.iter().map(|morph| morph.0.clone()).collect(),
            inputs: outside.iter().map(|input| input.uid).collect(),
            declared: rig.inputs.iter().map(|input| input.name.clone()).collect(),
            poses: layout.poses(),
            ops,
            layout,
            tables: graph.tables,
            x,
            n,
        })
    }

    /// The hash of the rig and options that the program was compiled from: equal for equal content, on every machine.
    pub fn hash(&self) -> ContentHash {
        self.hash
    }

    /// Nodes by slot; parents before children.
    pub fn nodes(&self) -> &[ProgramNode] {
        &self.nodes
    }

    /// Attributes by slot.
    pub fn attributes(&self) -> &[ProgramAttribute] {
        &self.attributes
    }

    /// Names of the morph targets by slot.
    pub fn morphs(&self) -> &[Arc<str>] {
        &self.morphs
    }

    /// Number of operations of a full evaluation.
    pub fn operations(&self) -> usize {
        self.ops.len()
    }

    /// Height of the joints as they are built, without constraints, in the rig's space: their extent along Y, or along the
    /// longest axis where they lie flat (less than a tenth of that axis). Differences of places are measured against it.
    pub fn rest_height(&self) -> f32 {
        self.height
    }

    /// Returns `true` if the rig moves by itself as time passes.
    pub fn has_springs(&self) -> bool {
        !self.layout.spring_ops.is_empty()
    }

    /// Slot of a node.
    pub fn node(&self, uid: Uid) -> Option<usize> {
        let at = self.by_uid.binary_search_by_key(&uid, |(uid, _)| *uid).ok()?;
        Some(self.by_uid[at].1 as usize)
    }

    /// Slot of the first node with the label.
    pub fn find_label(&self, label: &str) -> Option<usize> {
        self.nodes.iter().position(|node| node.label.as_deref() == Some(label))
    }

    /// Slot of an attribute.
    pub fn attribute(&self, node: Uid, name: &str) -> Option<usize> {
        let node = self.node(node)?;
        self.attributes.iter().position(|attribute| attribute.node == node && *attribute.name == *name)
    }

    /// Slot of a morph target.
    pub fn morph(&self, name: &str) -> Option<usize> {
        self.morphs.iter().position(|known| **known == *name)
    }
}

/// Runs the operations that depend on no input, once for all instances.
fn run_fixed(graph: &mut Graph<'_>, fixed: &[Op]) {
    let (x, n) = (&mut graph.x, &mut graph.n);
    let mut machine = Machine {
        tables: &graph.tables,
        registers: SingleRegisters::<false> { x, n, poses: &[], changed: false, moved: &mut [] },
        springs: &mut [] as &mut [SpringState],
        scratch: &mut Scratch::default(),
        dt: 0.0,
        frame: None,
    };
    fixed.iter().for_each(|op| machine.run(op));
}

/// See [`RigProgram::rest_height`]. Takes the parent of each node by its place in the list, its base and its kind.
fn rest_height(nodes: impl ExactSizeIterator<Item = (Option<usize>, Trs, NodeType)>) -> f32 {
    let mut places: Vec<Affine3A> = Vec::with_capacity(nodes.len());
    let (mut low, mut high) = (Vec3A::INFINITY, Vec3A::NEG_INFINITY);
    for (parent, base, kind) in nodes {
        let above = parent.map_or(Affine3A::IDENTITY, |parent| places[parent]);
        let place = above * base.affine();
        if kind == NodeType::Joint {
            (low, high) = (low.min(place.translation), high.max(place.translation));
        }
        places.push(place);
    }
    let extent = (high - low).max(Vec3A::ZERO);
    let longest = extent.max_element();
    if extent.y >= 0.1 * longest { extent.y } else { longest }
}

fn next_serial() -> u64 {
    static NEXT: AtomicU64 = AtomicU64::new(1);
    NEXT.fetch_add(1, Ordering::Relaxed)
}

#[cfg(test)]
#[cfg(feature = "cli")]
mod tests {
    use glam::{Quat, Vec3};

    use super::*;
    use crate::rig::BuiltNode;

    #[test]
    fn places_at_rest_are_those_of_a_state() {
        let node = |number: usize| BuiltNode {
            uid: Uid(number as u64 + 1),
            name: Arc::from("n"),
            kind: if number % 3 == 2 { NodeType::Null } else { NodeType::Joint },
            parent: number.checked_sub(1 + number % 2),
            base: match number % 4 {
                3 => Trs::IDENTITY,
                _ => Trs {
                    translation: Vec3::new(0.1, 0.3 * number as f32, -0.2),
                    rotation: Quat::from_xyzw(0.6, 0.0, 0.8, 0.0),
                    scale: Vec3::new(1.0, 2.0, 0.5),
                },
            },
            label: None,
            group: None,
            origin: None,
            control: None,
            layer: None,
            attributes: Arc::from([]),
        };
        let rig = BuiltRig { nodes: (0..9).map(node).collect(), ..BuiltRig::default() };
        let (places, height) = RigProgram::places_at_rest(&rig).unwrap();
        let mut state = RigState::new(Arc::new(RigProgram::compile(&rig, &CompileOptions::default()).unwrap()));
        state.evaluate(0.0);
        assert_eq!(places, state.globals());
        assert_eq!(height, state.program().rest_height());
        let doubled = BuiltRig { nodes: [0, 0].map(node).into(), ..BuiltRig::default() };
        assert!(RigProgram::places_at_rest(&doubled).is_err());
    }
}
