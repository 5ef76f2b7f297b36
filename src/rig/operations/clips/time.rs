//! Times of keys: moving, scaling, retiming and baking.

use super::{KeyTimes, OperationError, find, keys::Changes, keys::selected};
use crate::rig::{
    Uid,
    animation::{ClipAbout, ClipLayer, Ease, Key, Marker, Property, Track, TrackTarget, cubic_slope},
    operations::Draft,
};

/// Most keys that baking gives a track, and all tracks of a layer.
const MOST: f32 = 1e6;
const MOST_TOGETHER: f32 = 1e7;

/// Puts keys to other times. `factor` is the rate at which time runs there: tangents are divided by it.
pub(super) fn shifted(
    layer: &ClipLayer,
    keys: &KeyTimes,
    changes: &mut Changes,
    map: impl Fn(f32) -> f32,
    factor: f32,
) {
    for (target, keys) in selected(layer, keys) {
        changes.remove(&target, keys.iter().map(|key| key.time));
        let mut next: Vec<Key> = keys.iter().map(|key| stretched(key, map(key.time), factor, factor)).collect();
        if factor < 0.0 {
            turn_round(&mut next);
        }
        changes.insert(&target, next);
    }
}

/// Puts keys to times of their own; tangents stay as they are.
pub(super) fn placed(layer: &ClipLayer, list: &[(TrackTarget, Vec<[f32; 2]>)], changes: &mut Changes) {
    for (target, pairs) in list {
        let Some(track) = layer.tracks.get(target) else { continue };
        let key_at = |time: f32| {
            let place = track.keys.partition_point(|key| key.time < time);
            track.keys.get(place).filter(|key| key.time == time)
        };
        let moved: Vec<Key> =
            pairs.iter().filter_map(|[from, to]| Some(Key { time: *to, ..*key_at(*from)? })).collect();
        changes.remove(target, pairs.iter().map(|[from, _]| *from));
        changes.insert(target, moved);
    }
}

/// A key at another time, where time runs slower by these factors before and behind it.
fn stretched(key: &Key, time: f32, before: f32, behind: f32) -> Key {
    let slower = |tangent: [f32; 4], factor: f32| if factor == 0.0 { [0.0; 4] } else { tangent.map(|t| t / factor) };
    let ease = match key.ease {
        Ease::Cubic { arrive, leave } => Ease::Cubic { arrive: slower(arrive, before), leave: slower(leave, behind) },
        ease => ease,
    };
    Key { time, value: key.value, ease }
}

/// Puts keys whose times fall in order. What was the way to the next key is the way from it then.
fn turn_round(keys: &mut [Key]) {
    let eases: Vec<Ease> = keys.iter().map(|key| key.ease).collect();
    for (place, key) in keys.iter_mut().enumerate() {
        let way = place.checked_sub(1).map(|before| eases[before]);
        key.ease = match (key.ease, way) {
            (Ease::Cubic { arrive, leave }, _) => Ease::Cubic { arrive: leave, leave: arrive },
            // The way from a cubic key needs tangents at both of its ends.
            (ease, Some(Ease::Cubic { .. }) | None) => ease,
            (_, Some(way)) => way,
        };
    }
    keys.reverse();
}

/// Stretches a span of a clip; what comes later moves along.
pub(super) fn retime(draft: &mut Draft, uid: Uid, from: [f32; 2], to: [f32; 2]) -> Result<(), OperationError> {
    let numbers = [from, to].concat();
    if numbers.iter().any(|number| !number.is_finite()) || from[1] <= from[0] || to[1] <= to[0] {
        return Err(OperationError::BadNumber("a span of time ends after it begins; correct its seconds"));
    }
    let rate = (to[1] - to[0]) / (from[1] - from[0]);
    // Times at the ends are exact.
    let map = |time: f32| {
        if time <= from[0] {
            time + (to[0] - from[0])
        } else if time >= from[1] {
            to[1] + (time - from[1])
        } else {
            to[0] + (time - from[0]) * rate
        }
    };
    let clip = find(draft, uid)?.clone();
    let markers = clip.markers.iter().map(|marker| Marker { time: map(marker.time), name: marker.name.clone() });
    let about = ClipAbout { range: clip.range.map(map), markers: markers.collect(), ..clip.about() };
    super::set_about(draft, uid, about)?;
    for layer in &clip.layers {
        let mut changes = Changes::default();
        for (target, track) in &layer.tracks {
            changes.remove(target, track.keys.iter().map(|key| key.time));
            let mut keys = track.keys.clone();
            for time in from {
                // Keys at the ends of the span keep the curves on both sides of it.
                if let Some(key) = split(track, &target.property, time) {
                    keys.push(key);
                }
            }
            let rate_at = |is_in: bool| if is_in { rate } else { 1.0 };
            let next = keys.iter().map(|key| {
                let before = rate_at(key.time > from[0] && key.time <= from[1]);
                let behind = rate_at(key.time >= from[0] && key.time < from[1]);
                stretched(key, map(key.time), before, behind)
            });
            changes.insert(target, next);
        }
        changes.apply(draft, uid, layer.uid)?;
    }
    Ok(())
}

/// Sets the frame rate of a clip, whose keys and markers stay on their frames.
pub(super) fn set_rate(draft: &mut Draft, uid: Uid, rate: f32) -> Result<(), OperationError> {
    if !rate.is_finite() || rate <= 0.0 {
        return Err(OperationError::BadNumber("a frame rate is a positive number; use 30, for example"));
    }
    let clip = find(draft, uid)?;
    let (factor, about) = (clip.frame_rate / rate, clip.about());
    // Keys beside the range stay on their frames, too.
    let keys = clip.key_times();
    let markers = about.markers.iter().map(|marker| marker.time);
    let times = || keys.iter().copied().chain(markers.clone()).chain(about.range);
    let from = [times().fold(f32::MAX, f32::min), times().fold(f32::MIN, f32::max)];
    let to = from.map(|time| time * factor);
    if from[1] > from[0] {
        retime(draft, uid, from, to)?;
    }
    let about = ClipAbout { frame_rate: rate, ..find(draft, uid)?.about() };
    super::set_about(draft, uid, about)
}

/// The key that can be put between two keys of a track without a change of the curve; `None` where there is a key, or none
/// on one of the sides. Cubic rotations are left whole.
fn split(track: &Track, property: &Property, time: f32) -> Option<Key> {
    let place = track.keys.partition_point(|key| key.time <= time);
    let (from, to) = (track.keys.get(place.checked_sub(1)?)?, track.keys.get(place)?);
    if from.time == time {
        return None;
    }
    let value = track.sample(property, time)?;
    let ease = match from.ease {
        Ease::Cubic { .. } if *property == Property::Rotation => return None,
        Ease::Cubic { .. } => {
            let tangent = cubic_slope(from, to, time);
            Ease::Cubic { arrive: tangent, leave: tangent }
        }
        ease => ease,
    };
    Some(Key { time, value, ease })
}

/// Track that is baked.
struct BakedSpan<'a> {
    target: &'a TrackTarget,
    track: &'a Track,
    /// Seconds of the first and the last key.
    first: f32,
    last: f32,
    /// Frames between them.
    frames: f32,
}

/// Linear keys at a rate in place of the keys of tracks.
pub(super) fn bake<'a>(
    layer: &'a ClipLayer,
    targets: &'a [TrackTarget],
    rate: f32,
    changes: &mut Changes,
) -> Result<(), OperationError> {
    let span = |target: &'a TrackTarget| {
        let track = layer.tracks.get(target)?;
        let (first, last) = (track.keys.first()?.time, track.keys.last()?.time);
        Some(BakedSpan { target, track, first, last, frames: ((last - first) * rate).floor() })
    };
    let spans: Vec<BakedSpan> = targets.iter().filter_map(span).collect();
    // A key far away makes all tracks long that have one.
    let together: f32 = spans.iter().map(|span| span.frames).sum();
    if together > MOST_TOGETHER || spans.iter().any(|span| span.frames > MOST) {
        return Err(OperationError::BadNumber(
            "that many keys are too many; bake at a lower rate, or delete keys that are far away",
        ));
    }
    for BakedSpan { target, track, first, last, frames } in spans {
        let at = |frame: u32| first + frame as f32 / rate;
        let mut times: Vec<f32> = (0..=frames as u32).map(at).filter(|time| *time < last).collect();
        times.push(last);
        times.dedup();
        changes.remove(target, track.keys.iter().map(|key| key.time));
        let baked = times.into_iter().filter_map(|time| {
            let place = track.keys.partition_point(|key| key.time <= time).max(1) - 1;
            let ease = if track.keys[place].ease == Ease::Stepped { Ease::Stepped } else { Ease::Linear };
            Some(Key { time, value: track.sample(&target.property, time)?, ease })
        });
        changes.insert(target, baked);
    }
    Ok(())
}
