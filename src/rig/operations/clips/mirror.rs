//! Keys on the other side of the character.

use std::collections::BTreeMap;

use bevy::math::Mat3;

use super::{KeyTimes, OperationError, keys::Changes, keys::selected};
use crate::rig::{
    BuiltRig, Rig, Uid,
    animation::{ClipLayer, Ease, Key, NodeName, NodeNames, Property, TrackTarget},
    label::mirrored_label,
    operations::{Draft, MirrorPlane, frame::Frame},
};

/// Sets the mirror images of keys: on partners, or on the node itself where it has none.
pub(super) fn mirror(
    draft: &Draft,
    layer: &ClipLayer,
    keys: &KeyTimes,
    built: Option<&BuiltRig>,
    changes: &mut Changes,
) -> Result<(), OperationError> {
    let reflection = draft.symmetry().unwrap_or_else(|| MirrorPlane::sagittal(1.0)).reflection();
    let pairs = partners(draft.rig(), built);
    let frame = |node: Uid| frame_of(draft.rig(), built, node);
    for (target, keys) in selected(layer, keys) {
        let other = pairs.get(&target.node).copied().unwrap_or(target.node);
        let (here, there) = (frame(target.node), frame(other));
        let mirrored = keys.iter().map(|key| carried(key, &target.property, (&here, &there), reflection));
        changes.insert(&TrackTarget { node: other, property: target.property.clone() }, mirrored);
    }
    Ok(())
}

/// A key with the same effect in another frame, mapped by `change`.
pub(in crate::rig::operations) fn carried(
    key: &Key,
    property: &Property,
    (here, there): (&Frame, &Frame),
    change: Mat3,
) -> Key {
    let map = |value: [f32; 4], is_tangent: bool| here.carried_value(property, value, there, change, is_tangent);
    let ease = match key.ease {
        Ease::Cubic { arrive, leave } => Ease::Cubic { arrive: map(arrive, true), leave: map(leave, true) },
        ease => ease,
    };
    Key { time: key.time, value: map(key.value, false), ease }
}

/// Frame of a joint, or of a node that commands created.
pub(in crate::rig::operations) fn frame_of(rig: &Rig, built: Option<&BuiltRig>, node: Uid) -> Frame {
    match built.and_then(|built| Frame::built(built, node)) {
        Some(frame) if rig.joint(node).is_none() => frame,
        _ => Frame::of(rig, node),
    }
}

/// Nodes on the other side: the partners of joints, and created nodes of the same purpose under the mirrored label.
pub(in crate::rig::operations) fn partners(rig: &Rig, built: Option<&BuiltRig>) -> BTreeMap<Uid, Uid> {
    let mut pairs = BTreeMap::new();
    let names = NodeNames::of(rig, built);
    for (uid, name) in &names.0 {
        let Some(label) = mirrored_label(&name.label) else { continue };
        if let Some(partner) = names.find(&NodeName { label, role: name.role.clone() }) {
            pairs.insert(*uid, partner);
        }
    }
    for joint in rig.walk() {
        if let Some(partner) = joint.data.mirror.filter(|partner| rig.joint(*partner).is_some()) {
            pairs.insert(joint.data.uid, partner);
        }
    }
    pairs
}
