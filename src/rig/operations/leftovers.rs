//! Leftovers of deleted joints: the pose and the attribute values of nodes that can never be built again.
//!
//! A node that a command made has its offset and its values in the document. A joint that is deleted takes its commands
//! along, so what they made for it goes, too, in the same step: undo brings all of it back.

use std::collections::BTreeSet;

use super::{Draft, Operation, OperationError};
use crate::rig::{BuiltRig, EditError, Rig, RigEdit, Uid};

/// Runs an operation on a rig that was built, and clears what it leaves of nodes that commands made.
pub(super) fn run_built(draft: &mut Draft, operation: &Operation, built: &BuiltRig) -> Result<(), OperationError> {
    operation.run_in(draft)?;
    let posed: BTreeSet<Uid> =
        draft.rig().pose().keys().chain(draft.rig().attribute_values().keys()).copied().collect();
    let created: Vec<Uid> = posed.into_iter().filter(|node| draft.rig().joint(*node).is_none()).collect();
    if created.is_empty() {
        return Ok(());
    }
    let index = built.index();
    for node in created {
        if is_gone(draft.rig(), built, |node| index.get(&node).copied(), node) {
            clear(draft, node)?;
        }
    }
    Ok(())
}

/// Clears the pose and the attribute values of a node.
pub(super) fn clear(draft: &mut Draft, node: Uid) -> Result<(), EditError> {
    if draft.rig().offset(node).is_some() {
        draft.apply(RigEdit::SetOffset(node, None))?;
    }
    let names: Vec<String> =
        draft.rig().attribute_values().get(&node).map(|values| values.keys().cloned().collect()).unwrap_or_default();
    names.into_iter().try_for_each(|name| draft.apply(RigEdit::SetAttributeValue(node, name, None)))
}

/// True if the command that made a node is not in the rig any more, or the joint is not that it was made for. Nodes that the
/// build does not have are switched off at the moment, and may return.
fn is_gone(rig: &Rig, built: &BuiltRig, find: impl Fn(Uid) -> Option<usize>, node: Uid) -> bool {
    let mut node = node;
    // A node may be made for a node that was made before it.
    for _ in 0..=built.nodes.len() {
        let Some(at) = find(node) else { return false };
        match &built.nodes[at].origin {
            None => return rig.joint(node).is_none(),
            Some(origin) if rig.find_tag(origin.command).is_none() => return true,
            Some(origin) => node = origin.subject,
        }
    }
    false
}
