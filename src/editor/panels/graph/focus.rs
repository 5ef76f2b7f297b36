//! Commands in focus: their wires are drawn in full, all others are faded.

use std::collections::BTreeSet;

use super::model::{Graph, GraphWire};
use crate::rig::Uid;

/// Most selected commands whose wires are drawn in full; those of more would crowd the graph.
pub const MOST_LIT: usize = 20;

/// Selected commands, if they are few, and those under the pointer.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub(super) struct Focus {
    commands: BTreeSet<Uid>,
    /// True if wires of other commands are faded.
    pub fades: bool,
}

impl Focus {
    /// Focus on selected commands and on those under the pointer.
    pub fn of(selected: &BTreeSet<Uid>, hovered: BTreeSet<Uid>) -> Self {
        let fades = !selected.is_empty() || !hovered.is_empty();
        let mut commands = hovered;
        if selected.len() <= MOST_LIT {
            commands.extend(selected.iter().copied());
        }
        Self { commands, fades }
    }

    /// True if a wire begins or ends at a command in focus.
    pub fn has(&self, graph: &Graph, wire: GraphWire) -> bool {
        [wire.from, wire.to].into_iter().any(|end| self.commands.contains(&graph.nodes[end].tag))
    }
}
