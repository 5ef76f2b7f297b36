//! Deleting and reparenting.

use std::collections::HashSet;

use super::{Draft, OperationError, leftovers::clear};
use crate::rig::{EditError, RigEdit, Uid};

/// Deletes joints (and their partners). The joints below move up in place of their parent, or are deleted.
pub(super) fn delete(draft: &mut Draft, joints: &[Uid], keep_children: bool) -> Result<(), OperationError> {
    let joints = draft.with_partners(joints);
    if let Some(missing) = joints.iter().find(|joint| draft.rig().joint(**joint).is_none()) {
        return Err(EditError::NoJoint(*missing).into());
    }
    let first_parent = joints.first().and_then(|joint| draft.rig().joint(*joint)).and_then(|joint| joint.parent);
    let mut doomed: Vec<Uid> = Vec::new();
    let mut seen = HashSet::new();
    for &joint in &joints {
        if keep_children {
            doomed.push(joint);
        } else {
            // Whatever stands below a joint that is listed already is listed, too.
            let mut open = vec![joint];
            while let Some(uid) = open.pop() {
                if seen.insert(uid) {
                    doomed.push(uid);
                    open.extend(draft.rig().children(Some(uid)).iter().rev());
                }
            }
        }
    }
    // Children are deleted before parents. A hierarchy lists parents first, and a joint may be listed before its own
    // ancestor, so the order is by depth.
    let mut by_depth: Vec<(usize, Uid)> = doomed.iter().map(|uid| (draft.rig().root_and_depth(*uid).1, *uid)).collect();
    by_depth.sort_by_key(|(depth, _)| std::cmp::Reverse(*depth));
    for (_, joint) in by_depth {
        if keep_children {
            lift_children(draft, joint)?;
        }
        let partner = draft.rig().joint(joint).and_then(|joint| joint.data.mirror);
        let names_it = |partner: &Uid| draft.rig().joint(*partner).is_some_and(|p| p.data.mirror == Some(joint));
        if let Some(partner) = partner.filter(names_it) {
            draft.apply(RigEdit::SetMirror(partner, None))?;
        }
        clear(draft, joint)?;
        draft.apply(RigEdit::RemoveJoint(joint))?;
    }
    let next = first_parent.filter(|parent| draft.rig().joint(*parent).is_some());
    draft.select(next.into_iter().collect());
    Ok(())
}

fn lift_children(draft: &mut Draft, joint: Uid) -> Result<(), OperationError> {
    let parent = draft.rig().joint(joint).and_then(|joint| joint.parent);
    let place = draft.rig().children(parent).iter().position(|sibling| *sibling == joint).unwrap_or(usize::MAX - 1);
    let children = draft.rig().children(Some(joint)).to_vec();
    for (number, child) in children.into_iter().enumerate() {
        let global = draft.rig().rest_global(child);
        draft.apply(RigEdit::SetParent { joint: child, parent, index: place.saturating_add(1 + number) })?;
        draft.set_global(child, &global)?;
    }
    Ok(())
}

/// Reparents joints below `parent` without moving them; partners go below the partner of `parent`.
pub(super) fn reparent(draft: &mut Draft, joints: &[Uid], parent: Option<Uid>) -> Result<(), OperationError> {
    let listed: HashSet<Uid> = joints.iter().copied().collect();
    for &joint in joints {
        let partner = draft.partner(joint).filter(|partner| !listed.contains(partner));
        reparent_one(draft, joint, parent)?;
        if let Some(partner) = partner {
            let other_parent = parent.map(|parent| draft.partner(parent).unwrap_or(parent));
            reparent_one(draft, partner, other_parent)?;
        }
    }
    Ok(())
}

fn reparent_one(draft: &mut Draft, joint: Uid, parent: Option<Uid>) -> Result<(), OperationError> {
    let global = draft.rig().rest_global(joint);
    draft.apply(RigEdit::SetParent { joint, parent, index: usize::MAX })?;
    Ok(draft.set_global(joint, &global)?)
}
