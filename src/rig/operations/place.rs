//! Adding joints.

use bevy::math::Vec3;

use super::{
    Axis, Draft, MirrorPlane, OperationError,
    naming::{ChainName, number_inserted, partner_name},
    orient::orient,
};
use crate::rig::{EditError, JointData, NodeKind, RestTransform, Rig, RigEdit, Uid};

/// Adds a chain below `parent`, named by its place and turned along its bones. With symmetry on, the other side gets its
/// chain too; joints near the plane are put on it and shared by both sides.
pub(super) fn chain(draft: &mut Draft, positions: &[Vec3], parent: Option<Uid>) -> Result<(), OperationError> {
    if let Some(parent) = parent.filter(|parent| draft.rig().joint(*parent).is_none()) {
        return Err(EditError::NoJoint(parent).into());
    }
    let plane = draft.symmetry();
    let mut parent = parent;
    let mut other_parent = parent.map(|p| draft.partner(p).unwrap_or(p));
    if !positions.iter().all(|position| position.is_finite()) {
        return Err(OperationError::BadNumber("a joint's position is not finite; place it on the mesh"));
    }
    let settled = settle(positions, plane.as_ref());
    let places: Vec<Vec3> = settled.iter().map(|(position, _)| *position).collect();
    let name = ChainName::new(draft.rig(), &places, parent, plane.as_ref());
    let tip = parent.filter(|parent| name.continues() && is_drawn_tip(draft.rig(), *parent));
    let mut turned: Vec<Uid> = tip.into_iter().collect();
    for (number, (position, other)) in settled.into_iter().enumerate() {
        let name = name.joint(draft.rig(), number, position, plane.as_ref());
        let joint = add(draft, position, parent, Some(name.clone()))?;
        turned.push(joint);
        match other {
            Some(other) => {
                let partner = add(draft, other, other_parent, Some(partner_name(&name)))?;
                draft.apply(RigEdit::SetMirror(joint, Some(partner)))?;
                draft.apply(RigEdit::SetMirror(partner, Some(joint)))?;
                other_parent = Some(partner);
            }
            None => other_parent = Some(joint),
        }
        parent = Some(joint);
    }
    orient(draft, &turned, Axis::Y)?;
    if let Some(last) = parent {
        draft.select(vec![last]);
    }
    Ok(())
}

/// True for the last joint of a chain whose axes were never turned away from the bone above: they turn with the chain.
/// An offset of the pose is one about these axes, so that a joint that is posed keeps them.
fn is_drawn_tip(rig: &Rig, joint: Uid) -> bool {
    rig.offset(joint).is_none()
        && rig.joint(joint).is_some_and(|joint| {
            joint.children.is_empty() && !joint.data.locked && joint.data.rest.rotation.is_near_identity()
        })
}

/// Positions of a chain's joints with live mirroring across `plane`, each with the position of its other side. Central
/// joints are put on the plane and have no other side; without a plane no joint has one.
///
/// A chain that [runs along the plane](MirrorPlane::runs_along), a spine, is central as a whole. In any other chain the
/// joints within the plane's tolerance are central, and at its start the joints within two tolerances, if the chain
/// then leaves the plane by far more (a clavicle).
pub fn settle(positions: &[Vec3], plane: Option<&MirrorPlane>) -> Vec<(Vec3, Option<Vec3>)> {
    let Some(plane) = plane else { return positions.iter().map(|position| (*position, None)).collect() };
    let distance = |position: &Vec3| plane.distance(*position).abs();
    let central = positions.len() > 1 && plane.runs_along(positions);
    let furthest = positions.iter().map(distance).fold(0.0, f32::max);
    let near = (0.25 * furthest).min(2.0 * plane.tolerance);
    let begins = positions.iter().take_while(|position| distance(position) <= near).count();
    let settled = positions.iter().enumerate().map(|(number, position)| {
        if central || number < begins || distance(position) <= plane.tolerance {
            (plane.onto(*position), None)
        } else {
            (*position, Some(plane.mirrored(*position)))
        }
    });
    settled.collect()
}

/// Inserts a joint into the bone above `child`, and on the other side.
pub(super) fn insert(draft: &mut Draft, child: Uid, position: Vec3) -> Result<(), OperationError> {
    let partner = draft.partner(child);
    // A central bone stays in the middle.
    let plane = draft.symmetry().filter(|plane| partner.is_none() && plane.distance(position).abs() <= plane.tolerance);
    let position = plane.map_or(position, |plane| plane.onto(position));
    let joint = insert_one(draft, child, position)?;
    if let (Some(partner), Some(plane)) = (partner, draft.symmetry()) {
        let other = insert_one(draft, partner, plane.mirrored(position))?;
        draft.apply(RigEdit::SetMirror(joint, Some(other)))?;
        draft.apply(RigEdit::SetMirror(other, Some(joint)))?;
    }
    orient(draft, &[joint], Axis::Y)?;
    draft.select(vec![joint]);
    Ok(())
}

fn insert_one(draft: &mut Draft, child: Uid, position: Vec3) -> Result<Uid, OperationError> {
    let parent = draft.rig().joint(child).ok_or(EditError::NoJoint(child))?.parent;
    let Some(parent) = parent else { return Err(OperationError::NoBone(child)) };
    let index = draft.rig().children(Some(parent)).iter().position(|c| *c == child).unwrap_or(usize::MAX);
    let global = draft.rig().rest_global(child);
    let joint = add_at(draft, position, Some(parent), index, None)?;
    draft.apply(RigEdit::SetParent { joint: child, parent: Some(joint), index: 0 })?;
    draft.set_global(child, &global)?;
    number_inserted(draft, joint, child)?;
    Ok(joint)
}

fn add(draft: &mut Draft, position: Vec3, parent: Option<Uid>, label: Option<String>) -> Result<Uid, OperationError> {
    add_at(draft, position, parent, usize::MAX, label)
}

fn add_at(
    draft: &mut Draft,
    position: Vec3,
    parent: Option<Uid>,
    index: usize,
    label: Option<String>,
) -> Result<Uid, OperationError> {
    let uid = draft.next_uid();
    let global = RestTransform::from_translation(position).affine();
    let rest = draft.rig().local_rest(parent, &global);
    // A joint drawn onto an imported joint belongs to the same group.
    let group = parent.and_then(|parent| draft.rig().joint(parent)).and_then(|parent| parent.data.group);
    let joint = JointData { uid, label, rest, group, kind: NodeKind::Joint, ..Default::default() };
    draft.apply(RigEdit::AddJoint { joint: Box::new(joint), parent, index })?;
    Ok(uid)
}
