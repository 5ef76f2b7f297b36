//! Posing, and poses that are kept.

use std::collections::{BTreeMap, HashSet};

use bevy::math::{Affine3, Mat3, Quat, Vec3};

use super::{Draft, MirrorPlane, OperationError};
use crate::rig::{EditError, PoseOffset, RigEdit, StoredPose, Uid};

/// Mirrored offsets this close to none are none, so that rounding poses nothing.
const ROUNDING: f32 = 1e-6;

/// Puts offsets on top of the rest pose, and their mirror images on the partners that are not in the list.
pub(super) fn pose(draft: &mut Draft, offsets: &[(Uid, PoseOffset)]) -> Result<(), OperationError> {
    let listed: HashSet<Uid> = offsets.iter().map(|(joint, _)| *joint).collect();
    for &(joint, offset) in offsets {
        set(draft, joint, Some(offset))?;
        let partner = draft.partner(joint).filter(|partner| !listed.contains(partner));
        if let (Some(partner), Some(plane)) = (partner, draft.symmetry()) {
            let mirrored = mirrored(draft, &plane, joint, &offset, partner);
            set(draft, partner, Some(mirrored))?;
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

/// The offset of `partner` that moves the mesh there as the mirror image of what `offset` does at `joint`.
///
/// What an offset does is told in the rig's space at rest: about which axis it turns, along which way it moves. That is
/// mirrored and told again in the partner's own axes, however those are turned. With ancestors posed as mirror images
/// of one another the whole pose is one; where they are not (one arm raised, the other hanging), each side bends
/// relative to its own ancestors.
fn mirrored(draft: &Draft, plane: &MirrorPlane, joint: Uid, offset: &PoseOffset, partner: Uid) -> PoseOffset {
    let (here, there) = (Frame::of(draft, joint), Frame::of(draft, partner));
    let reflect = plane.reflection();

    let moved = reflect * (here.linear * offset.translation);
    let translation = there.linear.inverse() * moved;

    // An axis of rotation is turned the other way round by every reflection it passes.
    let bridge = there.axes.transpose() * reflect * here.axes;
    let turned = bridge * offset.rotation.xyz() * bridge.determinant().signum();
    let rotation = Quat::from_xyzw(turned.x, turned.y, turned.z, offset.rotation.w).normalize();

    // Scale along axes that are not parallel to the partner's is told as well as its axes can.
    let share = |row: Vec3| (row * row * offset.scale).element_sum();
    let scale = Vec3::new(share(bridge.row(0)), share(bridge.row(1)), share(bridge.row(2)));

    let mirrored = PoseOffset {
        translation: if translation.is_finite() { translation } else { Vec3::ZERO },
        rotation,
        scale: if (scale - offset.scale).abs().max_element() <= ROUNDING { offset.scale } else { scale },
    };
    if mirrored.is_rest(ROUNDING) { PoseOffset::IDENTITY } else { mirrored }
}

/// How an offset's numbers are meant in the rig's space, at rest.
struct Frame {
    /// Takes the offset's translation to the rig's space.
    linear: Mat3,
    /// The axes that rotation and scale are about: orthonormal, left-handed where an ancestor's scale is negative.
    axes: Mat3,
}

impl Frame {
    fn of(draft: &Draft, joint: Uid) -> Self {
        let rig = draft.rig();
        let Some(data) = rig.joint(joint) else { return Self { linear: Mat3::IDENTITY, axes: Mat3::IDENTITY } };
        let parent = data.parent.map_or(Affine3::IDENTITY, |parent| rig.rest_global(parent));
        let turned = parent.matrix3 * Mat3::from_quat(data.data.rest.rotation);
        Self { linear: rig.rest_global(joint).matrix3, axes: orthonormal(turned) }
    }
}

/// The nearest axes without scale and shear, the first kept in its direction; handedness stays.
fn orthonormal(matrix: Mat3) -> Mat3 {
    let Some(x) = matrix.x_axis.try_normalize() else { return Mat3::IDENTITY };
    let Some(y) = (matrix.y_axis - x * x.dot(matrix.y_axis)).try_normalize() else { return Mat3::IDENTITY };
    let hand = if matrix.determinant() < 0.0 { -1.0 } else { 1.0 };
    Mat3::from_cols(x, y, x.cross(y) * hand)
}
