//! Lists of nodes in which a node is found by itself.

use bevy::platform::collections::HashMap;

use super::NodeId;

/// Nodes of a list that grows at its end, each with its place in it. A node is found in the same time however long the list
/// is.
#[derive(Debug, Clone, Default)]
pub struct ListedNodes {
    places: HashMap<NodeId, usize>,
    count: usize,
}

impl ListedNodes {
    /// Adds a node at the end.
    pub fn push(&mut self, node: NodeId) {
        self.places.entry(node).or_insert(self.count);
        self.count += 1;
    }

    /// First place of a node in the list, from zero.
    pub fn place(&self, node: NodeId) -> Option<usize> {
        self.places.get(&node).copied()
    }

    /// True if the node is in the list.
    pub fn contains(&self, node: NodeId) -> bool {
        self.places.contains_key(&node)
    }

    /// True if nothing is in the list.
    pub fn is_empty(&self) -> bool {
        self.count == 0
    }
}

impl FromIterator<NodeId> for ListedNodes {
    fn from_iter<I: IntoIterator<Item = NodeId>>(nodes: I) -> Self {
        let mut list = Self::default();
        nodes.into_iter().for_each(|node| list.push(node));
        list
    }
}
