//! Turning joints along their bones.

use std::collections::HashSet;

use bevy::math::{Affine3, Mat3, Quat, Vec3};
use serde::{Deserialize, Serialize};

use super::{Draft, OperationError};
use crate::rig::{EditError, Uid};

/// An axis of a joint.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub enum Axis {
    /// The X axis along the bone, as in Maya and Unreal.
    X,
    /// The Y axis along the bone, as in Blender.
    #[default]
    Y,
    /// The Z axis along the bone.
    Z,
}

/// Turns joints so that `along` points at the child that continues the chain: the only child, or the one with the
/// smallest turn from the bone above. A joint without children takes its parent's rotation. Partners get the mirrored
/// rotation.
pub(super) fn orient(draft: &mut Draft, joints: &[Uid], along: Axis) -> Result<(), OperationError> {
    let mut order: Vec<(usize, Uid)> = Vec::with_capacity(joints.len());
    for &joint in joints {
        draft.rig().joint(joint).ok_or(EditError::NoJoint(joint))?;
        order.push((draft.rig().root_and_depth(joint).1, joint));
    }
    order.sort_by_key(|(depth, _)| *depth);
    let listed: HashSet<Uid> = joints.iter().copied().collect();
    for (_, joint) in order {
        let global = draft.rig().rest_global(joint);
        let Some(rotation) = rotation_for(draft, joint, along) else { continue };
        let (scale, _, translation) = global.to_scale_rotation_translation();
        let turned = Affine3::from_scale_rotation_translation(scale, rotation, translation);
        draft.keeping_children(joint, |draft| draft.set_global(joint, &turned))?;
        let partner = draft.partner(joint).filter(|partner| !listed.contains(partner));
        if let (Some(partner), Some(plane)) = (partner, draft.symmetry()) {
            let mirrored = plane.mirrored_affine(&turned);
            draft.keeping_children(partner, |draft| draft.set_global(partner, &mirrored))?;
        }
    }
    Ok(())
}

fn rotation_for(draft: &Draft, joint: Uid, along: Axis) -> Option<Quat> {
    let rig = draft.rig();
    let here = rig.position(joint);
    let parent = rig.joint(joint)?.parent;
    let incoming = parent.map(|parent| here - rig.position(parent)).and_then(Vec3::try_normalize);
    let bones = rig.children(Some(joint)).iter().filter_map(|child| (rig.position(*child) - here).try_normalize());
    let direction = match incoming {
        Some(incoming) => bones.max_by(|a, b| a.dot(incoming).total_cmp(&b.dot(incoming))),
        None => bones.max_by(|a, b| a.y.abs().total_cmp(&b.y.abs())),
    };
    match direction {
        Some(direction) => Some(frame(direction, along, flexion(draft, joint))),
        None => parent.map(|parent| rig.rest_global(parent).to_scale_rotation_translation().1),
    }
}

/// Least and largest angle of a bend that says about which axis a chain bends: below, its bones are in line; above, the
/// lower one belongs to another chain.
const BENT: [f32; 2] = [15.0_f32.to_radians(), 80.0_f32.to_radians()];

/// The axis about which a chain bends, at right angles to two bones: those that meet in the joint, or, where it starts a
/// chain, those that meet in the next. `None` where the chain is straight.
fn flexion(draft: &Draft, joint: Uid) -> Option<Vec3> {
    let rig = draft.rig();
    let only_child = |joint: Uid| rig.children(Some(joint)).first().filter(|_| rig.children(Some(joint)).len() == 1);
    let bend = |joint: Uid| {
        let parent = rig.joint(joint)?.parent.filter(|parent| only_child(*parent).is_some())?;
        let [above, here, below] = [parent, joint, *only_child(joint)?].map(|joint| rig.position(joint));
        let (incoming, outgoing) = ((here - above).try_normalize()?, (below - here).try_normalize()?);
        let angle = incoming.angle_between(outgoing);
        (BENT[0]..BENT[1]).contains(&angle).then(|| incoming.cross(outgoing).normalize())
    };
    bend(joint).or_else(|| bend(*only_child(joint)?))
}

/// The rotation that takes `along` to `direction` and the axis across it to the `flexion` axis. Where the chain does not
/// bend, the third axis goes as near as possible to the character's front (+Z), or to up if the bone itself points to the
/// front.
fn frame(direction: Vec3, along: Axis, flexion: Option<Vec3>) -> Quat {
    let hint = if direction.z.abs() < 0.9 { Vec3::Z } else { Vec3::Y };
    let usual = direction.cross(hint).normalize();
    let bent = flexion.and_then(|axis| axis.reject_from_normalized(direction).try_normalize());
    // The sign of straight chains; where the two are at right angles, that of the bend.
    let side = bent.map_or(usual, |axis| if axis.dot(usual) < -0.2 { -axis } else { axis });
    let front = side.cross(direction);
    let columns = match along {
        Axis::X => Mat3::from_cols(direction, -side, front),
        Axis::Y => Mat3::from_cols(side, direction, front),
        Axis::Z => Mat3::from_cols(-side, front, direction),
    };
    Quat::from_mat3(&columns).normalize()
}
