//! Traces of commands: the cells that a command reads and writes, and the nodes that it makes.

use bevy::platform::collections::HashMap;

use crate::{
    mesh::model::Trs,
    processor::{
        exclusion::{Exclusion, Gap},
        resolve::{self, Asker, Resolution},
        world::{Aspect, NodeId, Value, World, bits, same},
    },
    rig::reference::NodeRefs,
};

/// Read of a command, with what it found.
#[derive(Debug, Clone)]
pub(in crate::processor) enum Read {
    Cell(NodeId, Aspect, Option<Value>),
    /// References of a parameter, with what they found.
    References(Box<str>, NodeRefs, Option<Resolution>),
    Children(NodeId, Vec<NodeId>),
}

/// Cells that a command read and wrote.
#[derive(Debug, Clone, Default)]
pub(in crate::processor) struct Trace {
    pub reads: Vec<Read>,
    pub writes: Vec<(NodeId, Aspect)>,
    /// Transforms in the rig's space that the command read: one value each, however deep the node stands.
    pub globals: HashMap<NodeId, Trs>,
    /// Number of nodes and constraints that the command made.
    pub made: u32,
    /// First gap of a list that the command goes through.
    pub partial: Option<Gap>,
    /// Parameter that the command read as left out because the node that it refers to is off; the last one of several.
    pub optional_off: Option<(String, Exclusion)>,
    /// Nearest built node above the node that the command needs and that is off.
    pub above: Option<NodeId>,
}

impl Trace {
    pub fn asks(&self) -> bool {
        self.reads.iter().any(|read| !matches!(read, Read::Cell(..)))
    }

    /// True if everything that was read is still so.
    pub fn holds(&self, world: &World, asker: Asker) -> bool {
        let is_global = |(node, global): (&NodeId, &Trs)| bits(&world.global(*node, asker.place).0) == bits(global);
        let is_read = |read: &Read| match read {
            Read::Cell(node, aspect, value) => same(world.read_at(*node, *aspect, asker.place), value.as_ref()),
            Read::References(_, references, found) => {
                resolve::resolve(world, asker, references).ok().as_ref() == found.as_ref()
            }
            Read::Children(node, children) => world_children(world, *node, asker.place) == *children,
        };
        self.reads.iter().all(is_read) && self.globals.iter().all(is_global)
    }
}

pub(super) fn world_children(world: &World, node: NodeId, place: u32) -> Vec<NodeId> {
    let is_child = |child: &NodeId| world.parent(*child, place) == Some(node) && world.exists(*child, place);
    let mut children: Vec<NodeId> = world.slots[node.0 as usize].below.iter().copied().filter(is_child).collect();
    resolve::sort(world, &mut children, place);
    children
}
