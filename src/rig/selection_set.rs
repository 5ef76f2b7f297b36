//! Selection sets: nodes under a name, to select together again.

use serde::{Deserialize, Serialize};

use crate::rig::{Rig, RigEdit, Uid};

/// Set of nodes under a name. Nodes that the rig does not have at present stay in it.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SelectionSet {
    /// The name people see.
    pub name: String,
    /// Joints and created nodes, in the order of their selection.
    pub nodes: Vec<Uid>,
}

impl Rig {
    /// Selection sets in order.
    pub fn selection_sets(&self) -> &[SelectionSet] {
        &self.sets
    }

    /// Edit after which the rig has a set of these nodes under that name, in place of the set of that name if there is one.
    pub fn with_selection_set(&self, name: &str, nodes: Vec<Uid>) -> RigEdit {
        let mut sets = self.sets.clone();
        match sets.iter_mut().find(|set| set.name == name) {
            Some(known) => known.nodes = nodes,
            None => sets.push(SelectionSet { name: name.to_owned(), nodes }),
        }
        RigEdit::SetSelectionSets(sets)
    }

    /// Edit after which the rig has no set of that name.
    pub fn without_selection_set(&self, name: &str) -> RigEdit {
        RigEdit::SetSelectionSets(self.sets.iter().filter(|set| set.name != name).cloned().collect())
    }

    pub(super) fn set_selection_sets(&mut self, sets: &[SelectionSet]) -> RigEdit {
        RigEdit::SetSelectionSets(std::mem::replace(&mut self.sets, sets.to_vec()))
    }
}
