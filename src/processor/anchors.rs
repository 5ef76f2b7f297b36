//! Transforms in the rig's space of nodes on long ways below the rig.
//!
//! Such a transform is the product of all transforms on the way up. A long way is multiplied in stretches, counted from
//! the rig: the nodes at their ends are anchors, whose transforms are kept until something on the way to them is written.
//! Which anchors are known decides how much work it takes, and never how the product is rounded.

use bevy::platform::collections::{HashMap, HashSet};

use super::world::{Aspect, NOWHERE, NodeId, World};
use crate::mesh::model::Trs;

/// Number of nodes of a stretch. A way of no more is one product.
pub(super) const STRETCH: usize = 128;

/// Known anchors.
#[derive(Debug, Clone, Default)]
pub(super) struct Anchors {
    known: HashMap<NodeId, Anchor>,
    /// Nodes on the ways to known anchors.
    on_way: HashSet<NodeId>,
}

#[derive(Debug, Clone, Copy)]
struct Anchor {
    global: Trs,
    /// The first place at which all that the transform is made of has been written.
    from: u32,
}

impl Anchors {
    /// Forgets all anchors if a node is on the way to one.
    pub fn note_written(&mut self, node: NodeId, aspect: Aspect) {
        if matches!(aspect, Aspect::Base | Aspect::Parent) && self.on_way.contains(&node) {
            self.forget();
        }
    }

    pub fn forget(&mut self) {
        self.known.clear();
        self.on_way.clear();
    }

    fn at(&self, node: NodeId, place: u32) -> Option<Anchor> {
        self.known.get(&node).copied().filter(|anchor| anchor.from <= place)
    }
}

/// Product of the transforms on the way from a node up to the rig.
struct Way {
    global: Trs,
    /// The nodes that were visited, upwards.
    nodes: Vec<NodeId>,
    /// Lowest node of each stretch, as its place among those nodes, with its transform, downwards.
    ends: Vec<(usize, Trs)>,
    /// First place at which the transform above those nodes holds.
    from: u32,
}

impl World {
    /// Transform of a node in the rig's space, and the number of nodes that were visited on the way up to the rig.
    pub fn global(&self, node: NodeId, place: u32) -> (Trs, u64) {
        match self.short_global(node, place) {
            Ok(found) => found,
            Err(visited) => {
                let way = self.way(node, place);
                (way.global, visited + way.nodes.len() as u64)
            }
        }
    }

    /// Transform as [`World::global`] gives it; anchors on the way to it are kept.
    pub fn global_kept(&mut self, node: NodeId, place: u32) -> (Trs, u64) {
        let visited = match self.short_global(node, place) {
            Ok(found) => return found,
            Err(visited) => visited,
        };
        let way = self.way(node, place);
        let mut from = way.from;
        for (lowest, global) in &way.ends {
            let stretch = &way.nodes[*lowest..*lowest + STRETCH];
            let written = stretch.iter().try_fold(from, |from, link| Some(from.max(self.written_from(*link)?)));
            // What is written twice, or later, is another at other places.
            let Some(written) = written.filter(|written| *written <= place) else { break };
            from = written;
            self.anchors.known.insert(stretch[0], Anchor { global: *global, from });
            self.anchors.on_way.extend(stretch.iter().copied());
        }
        (way.global, visited + way.nodes.len() as u64)
    }

    /// Returns `true` if a command, at the place before `place`, wrote a transform or parent on the way from a node up to
    /// the rig.
    pub fn is_moved_by(&self, command: u32, node: NodeId, place: u32) -> bool {
        let is_own = |node: NodeId, aspect: Aspect| {
            self.cell(node, aspect).writes().iter().any(|(writer, _)| *writer == command)
        };
        let mut at = Some(node);
        while let Some(link) = at {
            if let Some(anchor) = self.anchors.at(link, place) {
                return anchor.from == place;
            }
            if is_own(link, Aspect::Base) || is_own(link, Aspect::Parent) {
                return true;
            }
            at = self.parent(link, place);
        }
        false
    }

    /// Product of a way of at most one stretch; for a longer one the number of nodes that were visited.
    fn short_global(&self, node: NodeId, place: u32) -> Result<(Trs, u64), u64> {
        let (mut global, mut at, mut count) = (self.base(node, place), node, 1);
        while let Some(parent) = self.parent(at, place) {
            if count == STRETCH as u64 {
                return Err(count);
            }
            global = self.base(parent, place) * global;
            at = parent;
            count += 1;
        }
        Ok((global, count))
    }

    fn way(&self, node: NodeId, place: u32) -> Way {
        let (mut nodes, mut anchor, mut at) = (Vec::new(), None, Some(node));
        while let Some(link) = at {
            anchor = self.anchors.at(link, place);
            if anchor.is_some() {
                break;
            }
            nodes.push(link);
            at = self.parent(link, place);
        }
        let mut above = anchor.map(|anchor| anchor.global);
        let mut ends = Vec::new();
        let mut lowest = nodes.len();
        for stretch in nodes.rchunks(STRETCH) {
            let own = stretch[1..].iter().fold(self.base(stretch[0], place), |own, link| self.base(*link, place) * own);
            let global = above.map_or(own, |above| above * own);
            above = Some(global);
            lowest -= stretch.len();
            if stretch.len() == STRETCH {
                ends.push((lowest, global));
            }
        }
        Way { global: above.unwrap_or(Trs::IDENTITY), nodes, ends, from: anchor.map_or(0, |anchor| anchor.from) }
    }

    /// The first place at which transform and parent of a node are what they are at all later ones; `None` if there is more
    /// than one value of either.
    fn written_from(&self, node: NodeId) -> Option<u32> {
        [Aspect::Base, Aspect::Parent].into_iter().try_fold(0, |from: u32, aspect| {
            let cell = self.cell(node, aspect);
            match (cell.document.is_some(), cell.writes()) {
                (_, []) => Some(from),
                (false, [(command, _)]) => {
                    let place = self.places[*command as usize];
                    (place != NOWHERE).then(|| from.max(place + 1))
                }
                _ => None,
            }
        })
    }
}
