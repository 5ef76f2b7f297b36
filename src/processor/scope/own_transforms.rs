//! Transforms in the rig's space of nodes that the command itself moved, or that stand below such nodes.
//!
//! A command that makes a long chain asks for the transform of each node before it makes the next one. The product of a
//! long way is made in stretches, as that of other nodes, and the transforms at their ends are kept while the command runs.

use bevy::platform::collections::{HashMap, HashSet};

use crate::{
    mesh::model::Trs,
    processor::{
        BuildScope,
        anchors::STRETCH,
        world::{Aspect, NodeId},
    },
};

/// Lowest nodes of the stretches of ways on which the command moved something, with their transforms in the rig's space.
#[derive(Debug, Clone, Default)]
pub(super) struct OwnAnchors {
    known: HashMap<NodeId, Trs>,
    /// Nodes on the ways to them.
    on_way: HashSet<NodeId>,
}

impl OwnAnchors {
    /// Forgets all of them if a node is on the way to one.
    pub(super) fn note_written(&mut self, node: NodeId, aspect: Aspect) {
        if matches!(aspect, Aspect::Base | Aspect::Parent) && self.on_way.contains(&node) {
            self.known.clear();
            self.on_way.clear();
        }
    }
}

impl BuildScope<'_> {
    /// Transform in the rig's space of such a node: the values on the way up are read one by one, as far as a node whose
    /// transform is known. How the product is rounded follows from the length of the way, never from what is known.
    pub(super) fn global_of_own(&mut self, node: NodeId) -> Trs {
        let (mut way, mut above, mut at) = (Vec::new(), None, Some(node));
        while let Some(link) = at {
            above = self.own.known.get(&link).copied();
            if above.is_some() {
                break;
            }
            way.push((link, self.base(link)));
            at = self.parent(link);
        }
        for stretch in way.rchunks(STRETCH) {
            let own = stretch[1..].iter().fold(stretch[0].1, |own, (_, base)| *base * own);
            let global = above.map_or(own, |above| above * own);
            above = Some(global);
            if stretch.len() == STRETCH {
                self.own.known.insert(stretch[0].0, global);
                self.own.on_way.extend(stretch.iter().map(|(link, _)| *link));
            }
        }
        above.unwrap_or(Trs::IDENTITY)
    }
}
