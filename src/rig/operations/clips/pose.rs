//! Keys for the current pose, set by hand or with every pose that is committed.

use std::collections::BTreeSet;

use super::{OperationError, find, keys::Changes, layer_of};
use crate::rig::{
    EditError, PoseOffset, Rig, Uid,
    animation::{ClipLayer, Ease, Key, Property, TrackTarget},
    operations::{Draft, Operation},
};

/// Properties of nodes that get keys when the whole pose of the nodes is keyed.
pub(super) fn targets(rig: &Rig, layer: &ClipLayer, nodes: &[Uid]) -> BTreeSet<TrackTarget> {
    let mut found = BTreeSet::new();
    for &node in nodes {
        found.extend([Property::Translation, Property::Rotation].map(|property| TrackTarget { node, property }));
        if rig.offset(node).is_some_and(|offset| offset.scale != PoseOffset::IDENTITY.scale) {
            found.insert(TrackTarget { node, property: Property::Scale });
        }
        let names = rig.attribute_values().get(&node).into_iter().flat_map(|values| values.keys());
        found.extend(names.map(|name| TrackTarget { node, property: Property::Attribute(name.clone()) }));
        found.extend(layer.tracks.keys().filter(|target| target.node == node).cloned());
    }
    found
}

/// Value of a property in the document's current pose; `None` for an attribute that is not set.
fn current(rig: &Rig, target: &TrackTarget) -> Option<[f32; 4]> {
    let offset = rig.offset(target.node).copied().unwrap_or_default();
    let vector = |value: bevy::math::Vec3| [value.x, value.y, value.z, 0.0];
    Some(match &target.property {
        Property::Translation => vector(offset.translation),
        Property::Rotation => offset.rotation.to_array(),
        Property::Scale => vector(offset.scale),
        Property::Attribute(name) => [rig.attribute_value(target.node, name)?, 0.0, 0.0, 0.0],
    })
}

/// Sets keys of a layer with which the layers up to it give the current pose.
pub(super) fn set_pose(
    draft: &mut Draft,
    clip: Uid,
    layer: Uid,
    time: f32,
    targets: &BTreeSet<TrackTarget>,
) -> Result<(), OperationError> {
    let rig = draft.rig();
    let values = targets.iter().filter_map(|target| Some((target.clone(), current(rig, target)?)));
    let values: Vec<(TrackTarget, [f32; 4])> = values.collect();
    set_values(draft, clip, layer, time, &values)
}

/// Sets keys of a layer with which the layers up to it give values.
pub(super) fn set_values(
    draft: &mut Draft,
    clip: Uid,
    layer: Uid,
    time: f32,
    values: &[(TrackTarget, [f32; 4])],
) -> Result<(), OperationError> {
    if !time.is_finite() {
        return Err(OperationError::BadNumber("a key needs a time that is finite; use another"));
    }
    let found = find(draft, clip)?;
    let place = found.layers.iter().position(|own| own.uid == layer).ok_or(EditError::NoLayer(clip, layer))?;
    let mut changes = Changes::default();
    for (target, wanted) in values {
        let value = found.value_for(place, target, time, *wanted);
        let keys = found.layers[place].tracks.get(target).map_or(&[] as &[Key], |track| &track.keys);
        changes.insert(target, [Key { time, value, ease: ease_at(keys, time) }]);
    }
    changes.apply(draft, clip, layer)
}

/// Interpolation of a key at that time: that of the key that it replaces, or steps behind a step.
fn ease_at(keys: &[Key], time: f32) -> Ease {
    let before = keys.partition_point(|key| key.time <= time).checked_sub(1);
    match before.map(|place| keys[place]) {
        Some(Key { time: known, ease, .. }) if known == time => ease,
        Some(Key { ease: Ease::Stepped, .. }) => Ease::Stepped,
        Some(_) | None => Ease::Linear,
    }
}

/// Largest difference of a value from that of a clip that is rounding.
const ROUNDING: f32 = 2e-6;

/// Runs an operation, then sets keys for what it posed to values other than those of the clip.
pub(in crate::rig::operations) fn keyed(
    draft: &mut Draft,
    operation: &Operation,
    (clip, layer, time): (Uid, Option<Uid>, f32),
) -> Result<(), OperationError> {
    let before = (draft.rig().pose().clone(), draft.rig().attribute_values().clone());
    operation.run_in(draft)?;
    let Some(found) = draft.rig().clip(clip) else { return Err(EditError::NoClip(clip).into()) };
    let Some(layer) = layer.or_else(|| found.layers.last().map(|layer| layer.uid)) else { return Ok(()) };
    layer_of(draft, clip, layer)?;
    let (rig, (pose, values)) = (draft.rig(), &before);
    let is_other_offset = |node: &&Uid| rig.offset(**node) != pose.get(node);
    let mut nodes: BTreeSet<Uid> = pose.keys().chain(rig.pose().keys()).filter(is_other_offset).copied().collect();
    if let Operation::Pose(offsets) | Operation::SetPose { offsets, .. } = operation {
        nodes.extend(offsets.iter().map(|(node, _)| *node));
    }
    let mut targets = BTreeSet::new();
    for node in nodes {
        for property in [Property::Translation, Property::Rotation, Property::Scale] {
            let target = TrackTarget { node, property };
            let shown = found.value(&target, time).unwrap_or_else(|| target.property.rest());
            // A key with the value of the clip would change the curves on both sides of it. Poses that were taken from what is
            // shown are rounded.
            let is_other =
                |value: [f32; 4]| value.iter().zip(&shown).any(|(a, b)| (a - b).abs() > ROUNDING * a.abs().max(1.0));
            if current(rig, &target).is_some_and(is_other) {
                targets.insert(target);
            }
        }
    }
    for (node, of) in rig.attribute_values() {
        for (name, value) in of {
            if values.get(node).and_then(|of| of.get(name)) != Some(value) {
                targets.insert(TrackTarget { node: *node, property: Property::Attribute(name.clone()) });
            }
        }
    }
    set_pose(draft, clip, layer, time, &targets)
}
