//! Posing, and stored poses.

use std::collections::{BTreeMap, HashSet};

use super::{Draft, OperationError, WholePose, frame::Frame};
use crate::rig::{AttributeValues, EditError, PoseOffset, RigEdit, StoredPose, Uid};

/// Sets offsets on top of the rest pose, and their mirror images on the partners that are not in the list.
pub(super) fn pose(draft: &mut Draft, offsets: &[(Uid, PoseOffset)]) -> Result<(), OperationError> {
    let listed: HashSet<Uid> = offsets.iter().map(|(joint, _)| *joint).collect();
    for &(joint, offset) in offsets {
        set(draft, joint, Some(offset))?;
        let partner = draft.partner(joint).filter(|partner| !listed.contains(partner));
        if let (Some(partner), Some(plane)) = (partner, draft.symmetry()) {
            // Each side's offset is relative to its own ancestors: if those are mirror images of one another, so is the
            // whole pose; if one arm is raised and the other hangs, both elbows bend alike.
            let (here, there) = (Frame::of(draft.rig(), joint), Frame::of(draft.rig(), partner));
            set(draft, partner, Some(here.carried(&offset, &there, plane.reflection())))?;
        }
    }
    Ok(())
}

/// Sets offsets and attribute values of nodes; those that are set already stay as they are.
pub(super) fn set_all(
    draft: &mut Draft,
    offsets: &[(Uid, PoseOffset)],
    values: &[(Uid, String, Option<f32>)],
) -> Result<(), OperationError> {
    for (node, offset) in offsets {
        set(draft, *node, Some(*offset))?;
    }
    for (node, name, value) in values {
        if draft.rig().attribute_value(*node, name) != *value {
            draft.apply(RigEdit::SetAttributeValue(*node, name.clone(), *value))?;
        }
    }
    Ok(())
}

/// Resets joints and their partners to rest, and their attributes to the defaults of their commands; all joints and
/// created nodes if none is listed.
pub(super) fn reset(draft: &mut Draft, joints: &[Uid]) -> Result<(), OperationError> {
    let posed: Vec<Uid> = match joints {
        [] => draft.rig().pose().keys().chain(draft.rig().attribute_values().keys()).copied().collect(),
        joints => draft.with_partners(joints),
    };
    for node in posed {
        set(draft, node, None)?;
        let names = draft.rig().attribute_values().get(&node).into_iter().flat_map(|values| values.keys().cloned());
        for name in names.collect::<Vec<_>>() {
            draft.apply(RigEdit::SetAttributeValue(node, name, None))?;
        }
    }
    Ok(())
}

/// Stores a pose under a name; a stored pose of that name is replaced.
pub(super) fn store(draft: &mut Draft, name: &str, shown: &WholePose) -> Result<(), OperationError> {
    let name = checked_name(name)?;
    let WholePose { offsets, values } = shown.clone();
    let known = draft.rig().stored_poses().iter().find(|pose| pose.name == name).cloned();
    let edit = match known {
        Some(known) => RigEdit::SetStoredPose(Box::new(StoredPose { offsets, values, ..known })),
        None => {
            let pose = StoredPose { uid: draft.next_uid(), name: name.to_owned(), offsets, values };
            RigEdit::AddStoredPose(Box::new(pose), usize::MAX)
        }
    };
    Ok(draft.apply(edit)?)
}

/// Makes a stored pose the current one.
pub(super) fn apply(draft: &mut Draft, uid: Uid) -> Result<(), OperationError> {
    let StoredPose { offsets: stored, values, .. } = find(draft, uid)?;
    let other = |(joint, _): &(&Uid, &PoseOffset)| !stored.contains_key(joint);
    let to_rest: Vec<Uid> = draft.rig().pose().iter().filter(other).map(|(joint, _)| *joint).collect();
    for joint in to_rest {
        set(draft, joint, None)?;
    }
    for (joint, offset) in stored {
        // The part of a node that does not exist at present waits for it.
        set(draft, joint, Some(offset))?;
    }
    let all = |values: &AttributeValues| -> BTreeMap<(Uid, String), f32> {
        let of = |(node, values): (&Uid, &BTreeMap<String, f32>)| {
            let node = *node;
            values.iter().map(move |(name, value)| ((node, name.clone()), *value)).collect::<Vec<_>>()
        };
        values.iter().flat_map(of).collect()
    };
    let (now, then) = (all(draft.rig().attribute_values()), all(&values));
    for (node, name) in now.keys().filter(|key| !then.contains_key(key)) {
        draft.apply(RigEdit::SetAttributeValue(*node, name.clone(), None))?;
    }
    for ((node, name), value) in then.iter().filter(|(key, value)| now.get(key) != Some(value)) {
        draft.apply(RigEdit::SetAttributeValue(*node, name.clone(), Some(*value)))?;
    }
    Ok(())
}

/// Gives a stored pose another name.
pub(super) fn rename(draft: &mut Draft, uid: Uid, name: &str) -> Result<(), OperationError> {
    let name = checked_name(name)?;
    let pose = find(draft, uid)?;
    if draft.rig().stored_poses().iter().any(|other| other.uid != uid && other.name == name) {
        return Err(OperationError::PoseName(name.to_owned()));
    }
    if pose.name != name {
        draft.apply(RigEdit::SetStoredPose(Box::new(StoredPose { name: name.to_owned(), ..pose })))?;
    }
    Ok(())
}

fn find(draft: &Draft, uid: Uid) -> Result<StoredPose, OperationError> {
    Ok(draft.rig().stored_pose(uid).cloned().ok_or(EditError::NoPose(uid))?)
}

fn checked_name(name: &str) -> Result<&str, OperationError> {
    let name = name.trim();
    if name.is_empty() { Err(OperationError::NoName) } else { Ok(name) }
}

/// Sets an offset unless it is set already, so that an operation without effect makes no step of the history.
fn set(draft: &mut Draft, joint: Uid, offset: Option<PoseOffset>) -> Result<(), EditError> {
    let offset = offset.filter(|offset| *offset != PoseOffset::IDENTITY);
    if draft.rig().offset(joint).copied() == offset {
        return Ok(());
    }
    draft.apply(RigEdit::SetOffset(joint, offset))
}
