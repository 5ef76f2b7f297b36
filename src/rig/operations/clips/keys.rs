//! Keys: setting, deleting, copying and pasting, and what all changes of keys share.

use std::collections::BTreeMap;

use super::{KeyOperation, KeyTimes, OperationError, ease, layer_of, mirror, pose, reduce, time};
use crate::rig::{
    RigEdit, Uid,
    animation::{ClipLayer, Key, LayerAbout, TrackTarget},
    operations::Draft,
};

/// Copied keys.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct KeyClipboard {
    /// Keys by what they animate; the first of all is at second 0.
    pub keys: BTreeMap<TrackTarget, Vec<Key>>,
}

impl KeyClipboard {
    /// Copies keys of a layer.
    pub fn copy(layer: &ClipLayer, keys: &KeyTimes) -> Self {
        let mut copied = selected(layer, keys);
        let first = copied.values().flatten().map(|key| key.time).reduce(f32::min).unwrap_or_default();
        copied.values_mut().flatten().for_each(|key| key.time -= first);
        Self { keys: copied }
    }

    /// The keys for other nodes; those of nodes that are mapped nowhere stay.
    pub fn with_nodes(&self, map: impl Fn(Uid) -> Uid) -> Self {
        let other = |(target, keys): (&TrackTarget, &Vec<Key>)| {
            (TrackTarget { node: map(target.node), ..target.clone() }, keys.clone())
        };
        Self { keys: self.keys.iter().map(other).collect() }
    }
}

/// Runs a change of keys of a layer.
pub(super) fn run(draft: &mut Draft, clip: Uid, layer: Uid, change: &KeyOperation) -> Result<(), OperationError> {
    let own = layer_of(draft, clip, layer)?.clone();
    let mut changes = Changes::default();
    match change {
        KeyOperation::Pose { time, nodes } => {
            let targets = pose::targets(draft.rig(), &own, nodes);
            return pose::set_pose(draft, clip, layer, *time, &targets);
        }
        KeyOperation::Values { time, values } => return pose::set_values(draft, clip, layer, *time, values),
        KeyOperation::Set(list) => list.iter().for_each(|(target, keys)| changes.insert(target, keys.iter().copied())),
        KeyOperation::Move { keys, by } => time::shifted(&own, keys, &mut changes, |time| time + by, 1.0),
        KeyOperation::Place(list) => time::placed(&own, list, &mut changes),
        KeyOperation::Scale { keys, pivot, factor } => {
            if !factor.is_finite() || *factor == 0.0 {
                return Err(OperationError::BadNumber("keys cannot be scaled by zero; use another factor"));
            }
            time::shifted(&own, keys, &mut changes, |time| pivot + (time - pivot) * factor, *factor);
        }
        KeyOperation::Delete(keys) => {
            for (target, keys) in selected(&own, keys) {
                changes.remove(&target, keys.iter().map(|key| key.time));
            }
        }
        KeyOperation::Paste { clipboard, at } => {
            for (target, keys) in &clipboard.keys {
                changes.insert(target, keys.iter().map(|key| Key { time: key.time + at, ..*key }));
            }
        }
        KeyOperation::Mirror { keys, built } => mirror::mirror(draft, &own, keys, built.as_deref(), &mut changes)?,
        KeyOperation::Ease { keys, ease } => ease::ease(&own, keys, *ease, &mut changes),
        KeyOperation::Bake { targets, rate } => {
            if !rate.is_finite() || *rate <= 0.0 {
                return Err(OperationError::BadNumber("keys cannot be baked at that rate; use a positive one"));
            }
            time::bake(&own, targets, *rate, &mut changes)?;
        }
        KeyOperation::Reduce { targets, tolerance } => reduce::reduce(&own, targets, tolerance, &mut changes),
        KeyOperation::Adopt { from, to } => {
            for (target, track) in own.tracks.iter().filter(|(target, _)| target.node == *from) {
                let next = TrackTarget { node: *to, ..target.clone() };
                if !own.tracks.contains_key(&next) {
                    changes.remove(target, track.keys.iter().map(|key| key.time));
                    changes.insert(&next, track.keys.iter().copied());
                }
            }
            if own.mask.contains(from) && !own.mask.contains(to) {
                let mask = own.mask.iter().copied().chain([*to]).collect();
                let about = Box::new(LayerAbout { mask, ..own.about() });
                draft.apply(RigEdit::SetLayer { clip, layer, about })?;
            }
        }
    }
    changes.apply(draft, clip, layer)
}

/// Keys of a layer at the given times.
pub(super) fn selected(layer: &ClipLayer, keys: &KeyTimes) -> BTreeMap<TrackTarget, Vec<Key>> {
    let mut found = BTreeMap::new();
    for (target, times) in keys {
        let Some(track) = layer.tracks.get(target) else { continue };
        let mut times = times.clone();
        times.sort_by(f32::total_cmp);
        let is_one = |key: &&Key| {
            let place = times.partition_point(|time| *time < key.time);
            times.get(place).is_some_and(|time| *time == key.time)
        };
        let own: Vec<Key> = track.keys.iter().filter(is_one).copied().collect();
        if !own.is_empty() {
            found.insert(target.clone(), own);
        }
    }
    found
}

/// Keys to remove and to set, by track.
#[derive(Default)]
pub(super) struct Changes {
    removed: BTreeMap<TrackTarget, Vec<f32>>,
    inserted: BTreeMap<TrackTarget, Vec<Key>>,
}

impl Changes {
    /// Removes keys at these times.
    pub fn remove(&mut self, target: &TrackTarget, times: impl IntoIterator<Item = f32>) {
        self.removed.entry(target.clone()).or_default().extend(times);
    }

    /// Sets keys, in place of those at the same times. Of two at the same time the later one counts.
    pub fn insert(&mut self, target: &TrackTarget, keys: impl IntoIterator<Item = Key>) {
        self.inserted.entry(target.clone()).or_default().extend(keys);
    }

    /// Makes edits of the changes, one a track. Keys that are as they were are left alone.
    pub fn apply(mut self, draft: &mut Draft, clip: Uid, layer: Uid) -> Result<(), OperationError> {
        let targets: std::collections::BTreeSet<TrackTarget> =
            self.removed.keys().chain(self.inserted.keys()).cloned().collect();
        for target in targets {
            let mut removed = self.removed.remove(&target).unwrap_or_default();
            let mut inserted = self.inserted.remove(&target).unwrap_or_default();
            // A stable sort, of which the last of equal times stays.
            inserted.reverse();
            inserted.sort_by(|a, b| a.time.total_cmp(&b.time));
            inserted.dedup_by(|later, first| later.time == first.time);
            let track = layer_of(draft, clip, layer)?.tracks.get(&target);
            let known = track.map_or(&[] as &[Key], |track| &track.keys);
            let at = |time: f32| {
                let place = known.partition_point(|key| key.time < time);
                known.get(place).filter(|key| key.time == time)
            };
            removed.retain(|time| at(*time).is_some());
            removed.extend(inserted.iter().filter(|key| at(key.time).is_some()).map(|key| key.time));
            removed.sort_by(f32::total_cmp);
            removed.dedup();
            inserted.retain(|key| {
                let is_same = at(key.time) == Some(key);
                if is_same && let Ok(place) = removed.binary_search_by(|time| time.total_cmp(&key.time)) {
                    removed.remove(place);
                }
                !is_same
            });
            if !removed.is_empty() || !inserted.is_empty() {
                draft.apply(RigEdit::SetKeys { clip, layer, target, removed, inserted })?;
            }
        }
        Ok(())
    }
}
