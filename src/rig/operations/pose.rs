//! Posing, and poses that are kept.

use std::collections::{BTreeMap, HashSet};

use super::{Draft, OperationError, frame::Frame};
use crate::rig::{EditError, PoseOffset, RigEdit, StoredPose, Uid};

/// Puts offsets on top of the rest pose, and their mirror images on the partners that are not in the list.
pub(super) fn pose(draft: &mut Draft, offsets: &[(Uid, PoseOffset)]) -> Result<(), OperationError> {
    let listed: HashSet<Uid> = offsets.iter().map(|(joint, _)| *joint).collect();
    for &(joint, offset) in offsets {
        set(draft, joint, Some(offset))?;
        let partner = draft.partner(joint).filter(|partner| !listed.contains(partner));
        if let (Some(partner), Some(plane)) = (partner, draft.symmetry()) {
            // What each side does is relative to its own ancestors: with those posed as mirror images of one another the
            // whole pose is one; where one arm is raised and the other hangs, both elbows bend alike.
            let (here, there) = (Frame::of(draft.rig(), joint), Frame::of(draft.rig(), partner));
            set(draft, partner, Some(here.carried(&offset, &there, plane.reflection())))?;
        }
    }
    Ok(())
}

/// Puts joints and their partners to rest; all joints if none is listed.
pub(super) fn reset(draft: &mut Draft, joints: &[Uid]) -> Result<(), OperationError> {
    let posed: Vec<Uid> = match joints {
        [] => draft.rig().pose().keys().copied().collect(),
        joints => draft.with_partners(joints),
    };
    posed.into_iter().try_for_each(|joint| Ok(set(draft, joint, None)?))
}

/// Keeps the current pose under a name; a pose of that name is replaced.
pub(super) fn store(draft: &mut Draft, name: &str) -> Result<(), OperationError> {
    let name = checked_name(name)?;
    let offsets = draft.rig().pose().clone();
    let known = draft.rig().stored_poses().iter().find(|pose| pose.name == name).cloned();
    let edit = match known {
        Some(known) => {
            // Joints that were deleted keep their part, as everywhere.
            let gone = known.offsets.iter().filter(|(joint, _)| draft.rig().joint(**joint).is_none());
            let offsets = gone.map(|(joint, offset)| (*joint, *offset)).chain(offsets).collect();
            RigEdit::SetStoredPose(Box::new(StoredPose { offsets, ..known }))
        }
        None => {
            let pose = StoredPose { uid: draft.next_uid(), name: name.to_owned(), offsets };
            RigEdit::AddStoredPose(Box::new(pose), usize::MAX)
        }
    };
    Ok(draft.apply(edit)?)
}

/// Makes a stored pose the current one.
pub(super) fn apply(draft: &mut Draft, uid: Uid) -> Result<(), OperationError> {
    let stored: BTreeMap<Uid, PoseOffset> = find(draft, uid)?.offsets;
    let other = |(joint, _): &(&Uid, &PoseOffset)| !stored.contains_key(joint);
    let to_rest: Vec<Uid> = draft.rig().pose().iter().filter(other).map(|(joint, _)| *joint).collect();
    for joint in to_rest {
        set(draft, joint, None)?;
    }
    for (joint, offset) in stored {
        if draft.rig().joint(joint).is_some() {
            set(draft, joint, Some(offset))?;
        }
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

/// Sets an offset unless it is there already, so that what changes nothing is no step of the history.
fn set(draft: &mut Draft, joint: Uid, offset: Option<PoseOffset>) -> Result<(), EditError> {
    let offset = offset.filter(|offset| *offset != PoseOffset::IDENTITY);
    if draft.rig().joint(joint).is_some() && draft.rig().offset(joint).copied() == offset {
        return Ok(());
    }
    draft.apply(RigEdit::SetOffset(joint, offset))
}
