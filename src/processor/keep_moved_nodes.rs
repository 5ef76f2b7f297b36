//! Poses and clips of nodes whose commands moved to another joint in an update: they go along.

use std::{collections::BTreeMap, sync::Arc};

use crate::rig::{
    EditError, MovedNodes, Rig, RigEdit, Uid,
    animation::{RigClip, Track, TrackTarget},
};

/// A clip without the tracks of nodes that have moved.
pub(super) fn clip_without(clip: &RigClip, moved: &MovedNodes) -> RigClip {
    let mut clip = clip.clone();
    for layer in &mut clip.layers {
        layer.tracks.retain(|target, _| moved.get(target.node).is_none());
    }
    clip
}

/// Gives a clip the tracks that `clip_without` took from another one, under the next uids of their nodes. Tracks of a node
/// whose next one has keys of its own stay under the former uid.
pub(super) fn carry_tracks(clip: &mut RigClip, from: &RigClip, moved: &MovedNodes) {
    for (layer, known) in clip.layers.iter_mut().zip(&from.layers) {
        let mut carried: BTreeMap<TrackTarget, Arc<Track>> = BTreeMap::new();
        for (target, track) in &known.tracks {
            let Some(next) = moved.get(target.node) else { continue };
            let target = TrackTarget { node: next, ..target.clone() };
            let target = if layer.tracks.contains_key(&target) {
                TrackTarget { node: former(moved, next), ..target }
            } else {
                target
            };
            carried.insert(target, track.clone());
        }
        layer.tracks.extend(carried);
        for node in &mut layer.mask {
            *node = moved.get(*node).unwrap_or(*node);
        }
    }
}

fn former(moved: &MovedNodes, next: Uid) -> Uid {
    moved.pairs().into_iter().find(|(_, is)| *is == next).map_or(next, |(was, _)| was)
}

/// Gives the offsets and attribute values of nodes that have moved to their next uids, in the document's current pose.
pub(super) fn carry_pose(rig: &mut Rig, moved: &MovedNodes) -> Result<(), EditError> {
    for (was, is) in moved.pairs() {
        let offset = rig.offset(was).copied().filter(|_| rig.offset(is).is_none());
        if offset.is_some() {
            rig.apply(&RigEdit::SetOffset(is, offset))?;
            rig.apply(&RigEdit::SetOffset(was, None))?;
        }
        let values = rig.attribute_values();
        let values = values.get(&was).filter(|_| !values.contains_key(&is)).cloned().unwrap_or_default();
        for (name, value) in values {
            rig.apply(&RigEdit::SetAttributeValue(was, name.clone(), None))?;
            rig.apply(&RigEdit::SetAttributeValue(is, name, Some(value)))?;
        }
    }
    Ok(())
}
