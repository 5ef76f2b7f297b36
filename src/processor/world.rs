//! The built world: every value with the commands that wrote it, so that it can be read as of any command.

use std::sync::Arc;

use bevy::platform::collections::{HashMap, HashSet};

use super::{
    AttributeList, ModuleError, anchors::Anchors, deadline::Deadline, exclusion::Exclusions, module::BuildLimits,
};
use crate::{
    mesh::model::Trs,
    rig::{Constraint, ControlData, LayerData, NodeType, Origin, RigInput, SwitchData, Uid},
};

/// A node, as long as its builder lives: nodes that are rolled back keep their place.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct NodeId(pub(super) u32);

/// Aspect of a node: the unit of reading and writing.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[repr(u8)]
pub enum Aspect {
    /// Existence of the node, and its type.
    Birth,
    /// Parent of the node.
    Parent,
    /// Transform of the node relative to its parent.
    Base,
    /// Label of the node.
    Label,
    /// Local group of the node.
    Group,
    /// Appearance, channels and limits of the node as a control.
    Control,
    /// Layer of the node.
    Layer,
    /// Attributes of the node.
    Attributes,
    /// Constraint (constraints have an identity like nodes).
    Constraint,
    /// Switch (switches have an identity like nodes).
    Switch,
}

impl Aspect {
    pub(super) const COUNT: usize = 10;

    /// True if a change of the aspect can change the nodes that references find.
    pub(super) fn is_structure(self) -> bool {
        matches!(self, Self::Birth | Self::Parent | Self::Label | Self::Group)
    }
}

/// Facts about a node that hold from its creation on.
#[derive(Debug, Clone, PartialEq)]
pub struct Birth {
    /// Joint, null or control.
    pub kind: NodeType,
    /// Given name of the node, if any.
    pub name: Option<Arc<str>>,
    /// Origin of the node; `None` for joints of the document.
    pub origin: Option<Arc<Origin>>,
    /// Place among the nodes that the same command made, or among the document's joints.
    pub order: u32,
}

/// A value of an aspect.
#[derive(Debug, Clone, PartialEq)]
pub enum Value {
    /// See [`Aspect::Birth`].
    Birth(Arc<Birth>),
    /// See [`Aspect::Parent`].
    Parent(Option<NodeId>),
    /// See [`Aspect::Base`]. Behind a pointer, so that other values stay small.
    Base(Arc<Trs>),
    /// See [`Aspect::Label`].
    Label(Option<Arc<str>>),
    /// See [`Aspect::Group`].
    Group(Option<Uid>),
    /// See [`Aspect::Control`].
    Control(Arc<ControlData>),
    /// See [`Aspect::Layer`].
    Layer(Arc<LayerData>),
    /// See [`Aspect::Attributes`].
    Attributes(AttributeList),
    /// Constraint, with its place among the constraints that the same command made.
    Constraint(u32, Arc<Constraint>),
    /// Switch, with its place among the switches that the same command made.
    Switch(u32, Arc<SwitchData>),
}

impl Value {
    /// True if two values have the same bits where commands read them (0 and -0 differ, since results may).
    pub(super) fn is_same(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::Base(a), Self::Base(b)) => bits(a) == bits(b),
            (Self::Attributes(a), Self::Attributes(b)) => a.is_same(b),
            _ => self == other,
        }
    }
}

pub(super) fn bits(trs: &Trs) -> [u32; 10] {
    let (t, r, s) = (trs.translation, trs.rotation, trs.scale);
    [t.x, t.y, t.z, r.x, r.y, r.z, r.w, s.x, s.y, s.z].map(f32::to_bits)
}

/// True if two states of one aspect are the same.
pub(super) fn same(a: Option<&Value>, b: Option<&Value>) -> bool {
    match (a, b) {
        (Some(a), Some(b)) => a.is_same(b),
        (None, None) => true,
        _ => false,
    }
}

/// One aspect of one node: the value of the document, and the values that commands wrote.
#[derive(Debug, Clone, Default)]
pub(super) struct Cell {
    pub document: Option<Value>,
    /// Part of the cell that commands use; most cells of most joints have none.
    used: Option<Box<CellUse>>,
}

#[derive(Debug, Clone, Default)]
struct CellUse {
    writes: Vec<(u32, Value)>,
    readers: Vec<u32>,
}

impl Cell {
    /// Values by command, in no order: places of commands change.
    pub fn writes(&self) -> &[(u32, Value)] {
        self.used.as_ref().map_or(&[], |used| &used.writes)
    }

    pub fn writes_mut(&mut self) -> &mut Vec<(u32, Value)> {
        &mut self.used.get_or_insert_default().writes
    }

    /// Commands that read the cell, sorted.
    pub fn readers(&self) -> &[u32] {
        self.used.as_ref().map_or(&[], |used| &used.readers)
    }

    pub fn readers_mut(&mut self) -> &mut Vec<u32> {
        &mut self.used.get_or_insert_default().readers
    }
}

#[derive(Debug, Clone)]
pub(super) struct Slot {
    pub uid: Uid,
    /// Command that can create the node; `None` for joints of the document.
    pub creator: Option<u32>,
    /// Constraints that drive the node, at any place of the list.
    pub driven_by: Vec<NodeId>,
    /// Children of the node at any place of the list, in rising order.
    pub below: Vec<NodeId>,
    /// Commands that read the node's transform in the rig's space, sorted.
    pub global_readers: Vec<u32>,
    /// Cells of the first aspects, which all joints have.
    cells: [Cell; COMMON],
    /// Cells of the other aspects; most joints have none of them.
    rare: Option<Box<[Cell; Aspect::COUNT - COMMON]>>,
}

/// Number of the first aspects, those that all joints have.
const COMMON: usize = Aspect::Control as usize;

/// Cell of an aspect that neither the document nor a command has a value of.
static NO_CELL: Cell = Cell { document: None, used: None };

impl Slot {
    fn new(uid: Uid, creator: Option<u32>) -> Self {
        let (driven_by, below, global_readers) = (Vec::new(), Vec::new(), Vec::new());
        Self { uid, creator, driven_by, below, global_readers, cells: Default::default(), rare: None }
    }

    fn cell(&self, aspect: Aspect) -> &Cell {
        match (aspect as usize).checked_sub(COMMON) {
            None => &self.cells[aspect as usize],
            Some(rare) => self.rare.as_ref().map_or(&NO_CELL, |cells| &cells[rare]),
        }
    }

    fn cell_mut(&mut self, aspect: Aspect) -> &mut Cell {
        match (aspect as usize).checked_sub(COMMON) {
            None => &mut self.cells[aspect as usize],
            Some(rare) => &mut self.rare.get_or_insert_default()[rare],
        }
    }
}

/// Place of a command that is not in the list.
pub(super) const NOWHERE: u32 = u32::MAX;

#[derive(Debug, Clone, Default)]
pub(super) struct World {
    pub slots: Vec<Slot>,
    ids: HashMap<Uid, NodeId>,
    /// The tag of each command.
    pub commands: Vec<Uid>,
    by_command: HashMap<Uid, u32>,
    /// The place of each command in the list, [`NOWHERE`] if it is not there.
    pub places: Vec<u32>,
    /// Nodes that each command has created in any build, in the order of their first creation.
    pub created: Vec<Vec<NodeId>>,
    /// The joint that carries each command.
    pub bearers: Vec<Uid>,
    /// The document's joints, in its order.
    pub joints: Vec<NodeId>,
    /// Declared inputs, and their nodes: outside of the rig, so that nothing stands on them and nothing drives them.
    pub declared: Vec<RigInput>,
    pub inputs: Vec<NodeId>,
    /// Exclusions of the document and of commands.
    pub off: Exclusions,
    /// Transforms in the rig's space that are kept; told of all that is written.
    pub anchors: Anchors,
    /// Limits on the nodes and constraints that commands make.
    pub limits: BuildLimits,
    /// End of the time in which commands may begin; `None` for no end.
    pub deadline: Option<Deadline>,
    /// Number of slots of nodes and constraints that commands make.
    made: usize,
    /// Nodes and constraints that are there, counted by the running command once there may be too many.
    counted: Option<usize>,
    /// Number of commands and nodes in [`Slot::global_readers`] of all nodes.
    pub global_reads: usize,
    /// Number of nodes that were visited to find readers of transforms, and circles.
    pub visited: u64,
    /// Number of joints that were compared with those of the document.
    pub followed: u64,
    /// Number of values that commands have read and written.
    pub work: u64,
    /// Work before the current run.
    pub work_before: u64,
}

impl World {
    pub fn new(limits: BuildLimits) -> Self {
        Self { limits, ..Self::default() }
    }

    pub fn id(&self, uid: Uid) -> Option<NodeId> {
        self.ids.get(&uid).copied()
    }

    pub fn uid(&self, node: NodeId) -> Uid {
        self.slots[node.0 as usize].uid
    }

    /// The slot for a uid, made where there is none.
    pub fn slot(&mut self, uid: Uid, creator: Option<u32>) -> NodeId {
        if let Some(id) = self.ids.get(&uid) {
            return *id;
        }
        let id = NodeId(self.slots.len() as u32);
        self.slots.push(Slot::new(uid, creator));
        self.ids.insert(uid, id);
        if let Some(creator) = creator {
            self.created[creator as usize].push(id);
            self.made += 1;
        }
        id
    }

    /// Returns `true` if the commands before `place` have made as many nodes and constraints as they may.
    pub fn is_full(&mut self, place: u32) -> bool {
        // Slots stay when what was made is gone.
        if self.made < self.limits.made {
            return false;
        }
        let is_there =
            |node: &&NodeId| self.exists(**node, place) || self.read_at(**node, Aspect::Constraint, place).is_some();
        let made = self.counted.unwrap_or_else(|| self.created.iter().flatten().filter(is_there).count());
        self.counted = Some(made);
        made >= self.limits.made
    }

    /// Notes that another command makes nodes and constraints from now on.
    pub fn begin_command(&mut self) {
        self.counted = None;
    }

    /// Notes a node or constraint that the running command makes.
    pub fn note_made(&mut self) {
        self.counted = self.counted.map(|made| made + 1);
    }

    /// Refuses more work in the current run than was agreed.
    pub fn check_work(&self) -> Result<(), ModuleError> {
        let limit = self.limits.work;
        if self.work - self.work_before <= limit {
            return Ok(());
        }
        let limit = usize::try_from(limit).unwrap_or(usize::MAX);
        Err(ModuleError::TooMany { what: "values read and written in one run", name: "work", limit })
    }

    /// The number of a command, made where there is none.
    pub fn command(&mut self, uid: Uid) -> u32 {
        let next = self.commands.len() as u32;
        let command = *self.by_command.entry(uid).or_insert(next);
        if command == next {
            self.commands.push(uid);
            self.places.push(NOWHERE);
            self.created.push(Vec::new());
            self.bearers.push(Uid::default());
        }
        command
    }

    /// The number of the command with that tag.
    pub fn creator_of(&self, tag: Uid) -> Option<u32> {
        self.by_command.get(&tag).copied()
    }

    pub fn cell(&self, node: NodeId, aspect: Aspect) -> &Cell {
        self.slots[node.0 as usize].cell(aspect)
    }

    /// Notes a value that is about to be written: nodes that may stand on another are found without a search.
    pub fn note_parent(&mut self, node: NodeId, value: &Value) {
        let Value::Parent(Some(parent)) = value else { return };
        let below = &mut self.slots[parent.0 as usize].below;
        if let Err(at) = below.binary_search(&node) {
            below.insert(at, node);
        }
    }

    pub fn cell_mut(&mut self, node: NodeId, aspect: Aspect) -> &mut Cell {
        self.slots[node.0 as usize].cell_mut(aspect)
    }

    /// Value after all commands before `place`, and the command that wrote it last.
    pub fn read_at(&self, node: NodeId, aspect: Aspect, place: u32) -> Option<&Value> {
        let cell = self.cell(node, aspect);
        let mut best: Option<(u32, &Value)> = None;
        for (command, value) in cell.writes() {
            let at = self.places[*command as usize];
            if at < place && best.is_none_or(|(place, _)| place < at) {
                best = Some((at, value));
            }
        }
        // What is not born does not have what others wrote on it either; the birth itself is asked for by name.
        best.map(|(_, value)| value).or(cell.document.as_ref())
    }

    /// Command that wrote an aspect last before `place`; `None` for a value of the document.
    pub fn writer_before(&self, node: NodeId, aspect: Aspect, place: u32) -> Option<u32> {
        let writers = self.cell(node, aspect).writes().iter().map(|(command, _)| *command);
        let before = writers.filter(|command| self.places[*command as usize] < place);
        before.max_by_key(|command| self.places[*command as usize])
    }

    pub fn birth(&self, node: NodeId, place: u32) -> Option<&Arc<Birth>> {
        match self.read_at(node, Aspect::Birth, place) {
            Some(Value::Birth(birth)) => Some(birth),
            _ => None,
        }
    }

    /// Name in files and messages: as given, or made of the name of the node's subject and its role.
    pub fn name(&self, node: NodeId, place: u32) -> String {
        let Some(birth) = self.birth(node, place) else { return self.uid(node).to_string() };
        let Some(origin) = &birth.origin else {
            return self.label(node, place).map_or_else(|| self.uid(node).to_string(), |label| label.to_string());
        };
        let numbered = |name: String| if origin.number == 0 { name } else { format!("{name}_{}", origin.number + 1) };
        if let Some(name) = &birth.name {
            return numbered(name.to_string());
        }
        let subject = self.id(origin.subject).filter(|subject| *subject != node);
        let subject = subject.map_or_else(|| origin.subject.to_string(), |subject| self.name(subject, place));
        numbered(format!("{subject}_{}", origin.role))
    }

    /// True for a declared input.
    pub fn is_input(&self, node: NodeId) -> bool {
        self.inputs.contains(&node)
    }

    pub fn exists(&self, node: NodeId, place: u32) -> bool {
        self.birth(node, place).is_some()
    }

    pub fn parent(&self, node: NodeId, place: u32) -> Option<NodeId> {
        match self.read_at(node, Aspect::Parent, place) {
            Some(Value::Parent(parent)) => *parent,
            _ => None,
        }
    }

    pub fn base(&self, node: NodeId, place: u32) -> Trs {
        match self.read_at(node, Aspect::Base, place) {
            Some(Value::Base(base)) => **base,
            _ => Trs::IDENTITY,
        }
    }

    /// Commands that read the rig-space transform of one of the nodes, or of a node that may stand below one of them.
    pub fn global_readers(&mut self, nodes: Vec<NodeId>) -> Vec<u32> {
        let mut readers = Vec::new();
        // Parents differ from place to place, so that two nodes may each stand below the other somewhere.
        let mut seen: HashSet<NodeId> = HashSet::default();
        let mut stack = nodes;
        while let Some(node) = stack.pop() {
            self.visited += 1;
            if seen.insert(node) {
                let slot = &self.slots[node.0 as usize];
                readers.extend(&slot.global_readers);
                stack.extend(&slot.below);
            }
        }
        readers
    }

    pub fn label(&self, node: NodeId, place: u32) -> Option<&Arc<str>> {
        match self.read_at(node, Aspect::Label, place) {
            Some(Value::Label(label)) => label.as_ref(),
            _ => None,
        }
    }

    pub fn group(&self, node: NodeId, place: u32) -> Option<Uid> {
        match self.read_at(node, Aspect::Group, place) {
            Some(Value::Group(group)) => *group,
            _ => None,
        }
    }

    /// Key of a node's place among all others without regard to parents: the document's joints in their order, then
    /// created nodes in the order of commands.
    pub fn order_key(&self, node: NodeId, birth: &Birth) -> (u32, u32) {
        match self.slots[node.0 as usize].creator {
            None => (0, birth.order),
            Some(command) => (self.places[command as usize].saturating_add(1), birth.order),
        }
    }
}
