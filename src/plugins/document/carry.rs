//! Commands that an operation moves to other joints of a built rig: poses and keys of what they made go along.

use std::{borrow::Cow, collections::HashSet};

use crate::{
    plugins::commands::{BuildResult, RigModules},
    processor::Builder,
    rig::{
        BuiltRig, MovedTags, Rig, RigEdit, Uid, UidSource,
        operations::{MirrorPlane, Operation, TagOperation},
    },
};

/// An operation that moves commands to other joints, as one that gives what is stored of the nodes that they made to those that
/// they make there; every other operation as it is. `rig` is the document without a preview.
///
/// Builds the rig as it is afterwards if commands move, which takes some tens of milliseconds for a character.
pub(super) fn carried<'o>(
    operation: Cow<'o, Operation>,
    rig: &Rig,
    (built, modules): (Option<&BuildResult>, Option<&RigModules>),
    uids: &UidSource,
    symmetry: Option<MirrorPlane>,
) -> Cow<'o, Operation> {
    let (Some(built), Some(modules)) = (built, modules) else { return operation };
    if !may_move_tags(&operation) {
        return operation;
    }
    let nodes = moved_nodes(&operation, rig, (&*built.0, modules), uids, symmetry);
    if nodes.is_empty() {
        return operation;
    }
    Cow::Owned(Operation::Carried { operation: Box::new(operation.into_owned()), nodes })
}

/// Nodes before and after an operation; none if it is refused, or if the rig cannot be built afterwards.
fn moved_nodes(
    operation: &Operation,
    rig: &Rig,
    (built, modules): (&BuiltRig, &RigModules),
    uids: &UidSource,
    symmetry: Option<MirrorPlane>,
) -> Vec<(Uid, Uid)> {
    let mut after = rig.clone();
    if operation.run(&mut after, &mut uids.clone(), symmetry).is_err() {
        return Vec::new();
    }
    let mut tags = MovedTags::between(rig, &after);
    if let Operation::Tags(TagOperation::Paste { clipboard, .. }) = operation {
        // A tag that was cut is on no joint before.
        for (joint, tag) in clipboard.joints.iter().flat_map(|joint| joint.tags.iter().map(move |tag| (joint, tag))) {
            if let (None, Some((bearer, _))) = (rig.find_tag(tag.uid), after.find_tag(tag.uid)) {
                tags.add(tag.uid, joint.uid, bearer.data.uid);
            }
        }
    }
    if tags.is_empty() {
        return Vec::new();
    }
    let Ok(next) = Builder::build(&after, &modules.0) else { return Vec::new() };
    let uids = |built: &BuiltRig| built.nodes.iter().map(|node| node.uid).collect::<HashSet<Uid>>();
    let (known, there) = (uids(built), uids(&next));
    let mut nodes = tags.nodes(rig, &after, &next);
    nodes.retain(|(was, is)| !there.contains(was) && !known.contains(is));
    nodes
}

/// True for operations that can put a tag onto another joint.
fn may_move_tags(operation: &Operation) -> bool {
    match operation {
        Operation::Tags(operation) => {
            matches!(operation, TagOperation::Move { .. } | TagOperation::MoveEach(..) | TagOperation::Paste { .. })
        }
        Operation::Edits(edits) | Operation::Named { edits, .. } => moves_tags(edits),
        Operation::Built { operation, .. } => may_move_tags(operation),
        _ => false,
    }
}

fn moves_tags(edits: &[RigEdit]) -> bool {
    edits.iter().any(|edit| match edit {
        RigEdit::MoveTag { .. } => true,
        RigEdit::Batch(edits) => moves_tags(edits),
        _ => false,
    })
}
