//! Dependencies between commands, as their last runs found them.

use std::collections::{BTreeMap, BTreeSet};

use super::{
    super::{
        scope::Read,
        world::{Aspect, NodeId},
    },
    Builder,
};
use crate::rig::Uid;

/// Dependency of a command on an earlier one.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub struct CommandDependency {
    /// Command that reads.
    pub reader: Uid,
    /// Parameter whose references find the nodes that are read; `None` for what the command reads besides.
    pub parameter: Option<Box<str>>,
    /// Earlier command that made or changed those nodes.
    pub source: Uid,
}

impl Builder {
    /// Dependencies of the commands in the list, as their last runs found them: the commands that made the nodes which
    /// references of parameters found, and those that wrote the values which a command read. Commands that have not run,
    /// or are passed over, have none. They follow the order of the list, those of a command are sorted by parameter.
    pub fn dependencies(&self) -> Vec<CommandDependency> {
        let mut list = Vec::new();
        for number in &self.list {
            let reader = self.world.commands[*number as usize];
            for (parameter, source) in self.sources(*number) {
                let source = self.world.commands[source as usize];
                list.push(CommandDependency { reader, parameter: parameter.map(Into::into), source });
            }
        }
        list
    }

    /// Commands that a command depends on, with the parameters whose references lead to them.
    fn sources(&self, number: u32) -> BTreeSet<(Option<&str>, u32)> {
        let place = self.world.places[number as usize];
        let trace = &self.commands[number as usize].trace;
        let mut found: BTreeSet<(Option<&str>, u32)> = BTreeSet::new();
        let mut referred: BTreeMap<NodeId, BTreeSet<&str>> = BTreeMap::new();
        for read in &trace.reads {
            let Read::References(parameter, _, Some(resolution)) = read else { continue };
            for node in &resolution.nodes {
                referred.entry(*node).or_default().insert(parameter);
                found.extend(self.creator_before(*node, place).map(|source| (Some(&**parameter), source)));
            }
        }
        let mut add = |node: NodeId, source: Option<u32>| {
            let Some(source) = source.filter(|source| *source != number) else { return };
            match referred.get(&node) {
                Some(parameters) => found.extend(parameters.iter().map(|parameter| (Some(*parameter), source))),
                None => {
                    found.insert((None, source));
                }
            }
        };
        for read in &trace.reads {
            match read {
                Read::Cell(node, aspect, _) => add(*node, self.world.writer_before(*node, *aspect, place)),
                Read::Children(_, children) => {
                    children.iter().for_each(|child| add(*child, self.creator_before(*child, place)));
                }
                Read::References(..) => {}
            }
        }
        for node in trace.globals.keys() {
            let above = std::iter::successors(Some(*node), |node| self.world.parent(*node, place));
            for link in above {
                for aspect in [Aspect::Base, Aspect::Parent] {
                    add(link, self.world.writer_before(link, aspect, place));
                }
            }
        }
        // What a reference leads to is told once.
        let named: BTreeSet<u32> = found.iter().filter(|(name, _)| name.is_some()).map(|(_, source)| *source).collect();
        found.retain(|(name, source)| name.is_some() || !named.contains(source));
        found
    }

    /// Command that made a node, if it runs before that place.
    fn creator_before(&self, node: NodeId, place: u32) -> Option<u32> {
        let creator = self.world.slots[node.0 as usize].creator?;
        (self.world.places[creator as usize] < place).then_some(creator)
    }
}
