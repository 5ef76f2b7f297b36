//! Moving, rotating and scaling the rest pose.

use std::collections::{HashMap, HashSet};

use bevy::math::{Affine3, Vec3};

use super::{Draft, OperationError};
use crate::rig::{RestTransform, Rig, RigEdit, Uid};

/// Moves joints to positions in the rig's space.
pub(super) fn place_at(draft: &mut Draft, to: &[(Uid, Vec3)], with_children: bool) -> Result<(), OperationError> {
    if to.iter().any(|(_, position)| !position.is_finite()) {
        return Err(OperationError::BadNumber("a joint's position is not finite; drag it back onto the mesh"));
    }
    let mut targets = Vec::with_capacity(to.len());
    for &(joint, position) in to {
        draft.position(joint)?;
        let mut global = draft.rig().rest_global(joint);
        global.translation = position;
        targets.push((joint, global));
    }
    set_globals(draft, targets, with_children)
}

/// Sets rest transforms relative to parents, parents first, and the mirrored ones on partners.
pub(super) fn rest(draft: &mut Draft, to: &[(Uid, RestTransform)], with_children: bool) -> Result<(), OperationError> {
    let listed: HashSet<Uid> = to.iter().map(|(joint, _)| *joint).collect();
    let mut to = to.to_vec();
    to.sort_by_cached_key(|(joint, _)| draft.rig().root_and_depth(*joint).1);
    for (joint, rest) in to {
        let set = |draft: &mut Draft| draft.apply(RigEdit::SetRest(joint, rest));
        if with_children {
            set(draft)?
        } else {
            draft.keeping_children(joint, set)?
        }
        let (Some(plane), global) = (draft.symmetry(), draft.rig().rest_global(joint)) else { continue };
        // The other side follows; a joint on the plane stays on it.
        let (other, global) = match draft.partner(joint) {
            Some(partner) if listed.contains(&partner) => continue,
            Some(partner) => (partner, plane.mirrored_affine(&global)),
            None if plane.distance(global.translation).abs() <= plane.tolerance => {
                (joint, Affine3 { translation: plane.onto(global.translation), ..global })
            }
            None => continue,
        };
        if global != draft.rig().rest_global(other) {
            set_globals_of(draft, &[(other, global)], with_children)?;
        }
    }
    Ok(())
}

/// Applies `change` about a pivot (or each joint's own position).
pub(super) fn about(
    draft: &mut Draft,
    joints: &[Uid],
    change: Affine3,
    pivot: Option<Vec3>,
    with_children: bool,
) -> Result<(), OperationError> {
    let listed: HashSet<Uid> = joints.iter().copied().collect();
    let mut targets = Vec::with_capacity(joints.len());
    let mut carried = HashMap::new();
    for &joint in joints {
        draft.position(joint)?;
        if with_children && is_below(draft.rig(), joint, &listed, &mut carried) {
            continue;
        }
        let global = draft.rig().rest_global(joint);
        let center = pivot.unwrap_or(global.translation);
        let turned = Affine3::from_translation(center) * change * Affine3::from_translation(-center) * global;
        targets.push((joint, turned));
    }
    set_globals(draft, targets, with_children)
}

/// True if one of the `listed` joints stands above a joint. `known` keeps the answers for the joints on the way up, so that
/// a way that joints share is walked once.
fn is_below(rig: &Rig, joint: Uid, listed: &HashSet<Uid>, known: &mut HashMap<Uid, bool>) -> bool {
    let (mut way, mut at) = (Vec::new(), joint);
    let is_below = loop {
        if let Some(found) = known.get(&at) {
            break *found;
        }
        way.push(at);
        match rig.joint(at).and_then(|joint| joint.parent) {
            None => break false,
            Some(parent) if listed.contains(&parent) => break true,
            Some(parent) => at = parent,
        }
    };
    known.extend(way.into_iter().map(|joint| (joint, is_below)));
    is_below
}

/// Sets transforms in the rig's space, parents first, and mirrors them to partners that are not in the list.
fn set_globals(draft: &mut Draft, mut targets: Vec<(Uid, Affine3)>, with_children: bool) -> Result<(), OperationError> {
    if let Some(plane) = draft.symmetry() {
        let listed: HashSet<Uid> = targets.iter().map(|(joint, _)| *joint).collect();
        for number in 0..targets.len() {
            let (joint, global) = targets[number];
            match draft.partner(joint) {
                Some(partner) if !listed.contains(&partner) => targets.push((partner, plane.mirrored_affine(&global))),
                Some(_) => {}
                // A joint on the plane belongs to both sides and stays on it.
                None if plane.distance(draft.rig().position(joint)).abs() <= plane.tolerance => {
                    targets[number].1.translation = plane.onto(global.translation);
                }
                None => {}
            }
        }
    }
    targets.sort_by_cached_key(|(joint, _)| draft.rig().root_and_depth(*joint).1);
    set_globals_of(draft, &targets, with_children)
}

fn set_globals_of(draft: &mut Draft, targets: &[(Uid, Affine3)], with_children: bool) -> Result<(), OperationError> {
    for (joint, global) in targets {
        if with_children {
            draft.set_global(*joint, global)?;
        } else {
            draft.keeping_children(*joint, |draft| draft.set_global(*joint, global))?;
        }
    }
    Ok(())
}
