//! Compiled clips: all keys in flat arrays, sampled without allocations and without searching.
//!
//! Linear tracks with the same key times share one search, and their values at a time lie side by side. Rotations that
//! turn far from one key to the next get keys between them when the clip is compiled, so that a normalised linear
//! interpolation is as good as a spherical one.

use super::{
    ClipLayer, Ease, Key, LayerMode, Property, RigClip, Track, TrackTarget,
    sample::{add, between, blend, slerp},
};
use glam::{Quat, Vec4};
use std::collections::BTreeMap;

/// Cosine of half the angle up to which a linear interpolation of rotations is exact to 2e-7.
const NEAR: f32 = 0.9998;
/// Most keys that stand in for one interval of a rotation: one for about 2° up to 180°.
const MOST: f32 = 90.0;

/// Clip in a form that is sampled fast, for any number of characters at once. Values are those of [`RigClip::sample`] up to
/// rounding.
#[derive(Debug, Clone, PartialEq)]
pub struct ClipSampler {
    targets: Vec<TrackTarget>,
    groups: Vec<Group>,
    /// Times of the keys of all groups, one group after the other.
    times: Vec<f32>,
    /// Values of all groups: for each key those of all tracks of the group.
    values: Vec<Vec4>,
    /// Tracks with steps or cubic segments.
    curves: Vec<Curve>,
    /// Values of tracks with one key.
    constants: Vec<(u32, Vec4)>,
    /// Mixing of layers: the sampled number, the number of the result, the mode and the weight. Empty where every target is in
    /// one layer at full weight.
    mixes: Vec<Mix>,
    /// Number of sampled tracks.
    tracks: usize,
    range: [f32; 2],
}

/// Linear tracks with the same key times.
#[derive(Debug, Clone, PartialEq)]
struct Group {
    /// First time and number of keys.
    times: (usize, usize),
    /// First value of the first key.
    values: usize,
    /// Numbers of the tracks; those before `rotations` are no rotations.
    tracks: Vec<u32>,
    rotations: usize,
}

/// Track that is sampled on its own.
#[derive(Debug, Clone, PartialEq)]
struct Curve {
    track: u32,
    property: Property,
    keys: Vec<Key>,
}

#[derive(Debug, Clone, PartialEq)]
struct Mix {
    from: u32,
    to: u32,
    mode: LayerMode,
    weight: f32,
    /// True if no layer below has the target.
    is_lowest: bool,
}

/// Places in the tracks of a [`ClipSampler`] at which it was last sampled, and room for values of layers. One for each
/// character.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct SampleCursor {
    places: Vec<u32>,
    layers: Vec<Vec4>,
}

impl ClipSampler {
    /// Compiles a clip: all tracks that have an effect.
    pub fn new(clip: &RigClip) -> Self {
        let layers = || clip.layers.iter().filter(|layer| !layer.muted && layer.weight > 0.0);
        let tracks_of = |layer: &'_ ClipLayer| {
            let mask = layer.mask.clone();
            layer.tracks.clone().into_iter().filter(move |(target, track)| {
                (mask.is_empty() || mask.contains(&target.node)) && !track.keys.is_empty()
            })
        };
        let mut numbers: BTreeMap<TrackTarget, u32> = BTreeMap::new();
        for (target, _) in layers().flat_map(tracks_of) {
            numbers.insert(target, 0);
        }
        numbers.values_mut().zip(0..).for_each(|(number, place)| *number = place);
        let mut seen = vec![false; numbers.len()];
        let (mut mixes, mut tracks) = (Vec::new(), Vec::new());
        for layer in layers() {
            for (target, track) in tracks_of(layer) {
                let to = numbers.get(&target).copied().unwrap_or_default();
                let is_lowest = !std::mem::replace(&mut seen[to as usize], true);
                let from = tracks.len() as u32;
                mixes.push(Mix { from, to, mode: layer.mode, weight: layer.weight, is_lowest });
                tracks.push((target.property.clone(), track));
            }
        }
        // Where every target has one track at full weight, tracks are sampled into the result.
        if mixes.iter().all(|mix| mix.is_lowest && mix.weight >= 1.0) {
            let mut sorted: Vec<_> = mixes.iter().map(|mix| mix.to).zip(tracks).collect();
            sorted.sort_by_key(|(to, _)| *to);
            tracks = sorted.into_iter().map(|(_, track)| track).collect();
            mixes.clear();
        }
        let mut sampler = Self {
            targets: numbers.into_keys().collect(),
            groups: Vec::new(),
            times: Vec::new(),
            values: Vec::new(),
            curves: Vec::new(),
            constants: Vec::new(),
            mixes,
            tracks: tracks.len(),
            range: clip.range,
        };
        let mut linear: BTreeMap<Vec<u32>, Vec<(u32, bool, Vec<Key>)>> = BTreeMap::new();
        for (number, (property, track)) in (0..).zip(&tracks) {
            let keys = &track.keys;
            let is_linear = keys[..keys.len() - 1].iter().all(|key| key.ease == Ease::Linear);
            if keys.iter().all(|key| key.value == keys[0].value) && is_linear {
                sampler.constants.push((number, Vec4::from_array(keys[0].value)));
            } else if is_linear {
                let is_rotation = *property == Property::Rotation;
                let keys = if is_rotation { smoothed(track) } else { keys.clone() };
                let times = keys.iter().map(|key| key.time.to_bits()).collect();
                linear.entry(times).or_default().push((number, is_rotation, keys));
            } else {
                sampler.curves.push(Curve { track: number, property: property.clone(), keys: keys.clone() });
            }
        }
        for (times, mut tracks) in linear {
            tracks.sort_by_key(|(number, is_rotation, _)| (*is_rotation, *number));
            sampler.groups.push(Group {
                times: (sampler.times.len(), times.len()),
                values: sampler.values.len(),
                rotations: tracks.iter().filter(|(_, is_rotation, _)| !is_rotation).count(),
                tracks: tracks.iter().map(|(number, ..)| *number).collect(),
            });
            sampler.times.extend(times.iter().map(|bits| f32::from_bits(*bits)));
            let value = |key: usize, keys: &[Key]| Vec4::from_array(keys[key].value);
            let rows = (0..times.len()).flat_map(|key| tracks.iter().map(move |(.., keys)| value(key, keys)));
            sampler.values.extend(rows);
        }
        sampler
    }

    /// Animated properties, in the order of the values.
    pub fn targets(&self) -> &[TrackTarget] {
        &self.targets
    }

    /// Cursor at the start.
    pub fn cursor(&self) -> SampleCursor {
        let layers = if self.mixes.is_empty() { 0 } else { self.tracks };
        SampleCursor { places: vec![0; self.groups.len() + self.curves.len()], layers: vec![Vec4::ZERO; layers] }
    }

    /// First and last second of the clip.
    pub fn range(&self) -> [f32; 2] {
        self.range
    }

    /// Writes the value of each of the [targets](Self::targets) at a second to `out`, which has room for them. A cursor of
    /// another clip is exchanged for one of this clip.
    pub fn sample(&self, time: f32, cursor: &mut SampleCursor, out: &mut [Vec4]) {
        let rooms = if self.mixes.is_empty() { 0 } else { self.tracks };
        if cursor.places.len() != self.groups.len() + self.curves.len() || cursor.layers.len() != rooms {
            *cursor = self.cursor();
        }
        if out.len() < self.targets.len() {
            return;
        }
        let SampleCursor { places, layers } = cursor;
        if self.mixes.is_empty() {
            self.sample_tracks(time, places, out);
            return;
        }
        self.sample_tracks(time, places, layers);
        for mix in &self.mixes {
            let property = &self.targets[mix.to as usize].property;
            let value = layers[mix.from as usize].to_array();
            let below = if mix.is_lowest { property.rest() } else { out[mix.to as usize].to_array() };
            let mixed = match mix.mode {
                LayerMode::Override => blend(property, below, value, mix.weight),
                LayerMode::Additive => add(property, below, blend(property, property.rest(), value, mix.weight)),
            };
            out[mix.to as usize] = Vec4::from_array(mixed);
        }
    }

    fn sample_tracks(&self, time: f32, places: &mut [u32], out: &mut [Vec4]) {
        for (number, value) in &self.constants {
            out[*number as usize] = *value;
        }
        for (group, place) in self.groups.iter().zip(places.iter_mut()) {
            let (first, count) = group.times;
            let times = &self.times[first..first + count];
            let width = group.tracks.len();
            let (at, share) = segment(times, time, place);
            let row = group.values + at * width;
            let (from, to) = (&self.values[row..row + width], &self.values[row + width..row + 2 * width]);
            let (plain, rotations) = group.tracks.split_at(group.rotations);
            for ((number, from), to) in plain.iter().zip(from).zip(to) {
                out[*number as usize] = *from + (*to - *from) * share;
            }
            let values = from[group.rotations..].iter().zip(&to[group.rotations..]);
            for (number, (from, to)) in rotations.iter().zip(values) {
                let mixed = *from + (*to - *from) * share;
                out[*number as usize] = mixed * mixed.length_recip();
            }
        }
        for (curve, place) in self.curves.iter().zip(&mut places[self.groups.len()..]) {
            let keys = &curve.keys;
            let last = keys.len() - 1;
            let value = if last == 0 || time <= keys[0].time || time.is_nan() {
                keys[0].value
            } else if time >= keys[last].time {
                keys[last].value
            } else {
                let at = found(|at| keys[at].time, last, time, place);
                between(&keys[at], &keys[at + 1], &curve.property, time)
            };
            out[curve.track as usize] = Vec4::from_array(value);
        }
    }
}

/// The interval around a time, and the share of the way through it.
fn segment(times: &[f32], time: f32, place: &mut u32) -> (usize, f32) {
    let last = times.len() - 1;
    if time <= times[0] || time.is_nan() {
        return (0, 0.0);
    }
    if time >= times[last] {
        return (last - 1, 1.0);
    }
    let at = found(|at| times[at], last, time, place);
    (at, (time - times[at]) / (times[at + 1] - times[at]))
}

/// Number of the last time that is not after `time`: near the last place, or by search. `time` is within the times.
fn found(times: impl Fn(usize) -> f32, last: usize, time: f32, place: &mut u32) -> usize {
    let at = *place as usize;
    let is_in = |at: usize| at < last && times(at) <= time && time < times(at + 1);
    let at = if is_in(at) {
        at
    } else if is_in(at + 1) {
        at + 1
    } else {
        let (mut low, mut high) = (0, last);
        while high - low > 1 {
            let middle = low.midpoint(high);
            if times(middle) <= time { low = middle } else { high = middle }
        }
        low
    };
    *place = at as u32;
    at
}

/// Keys of a rotation of which neighbours are near each other and in the same half of the sphere.
fn smoothed(track: &Track) -> Vec<Key> {
    let mut keys: Vec<Key> = Vec::with_capacity(track.keys.len());
    for key in &track.keys {
        let mut key = *key;
        if let Some(before) = keys.last().copied() {
            let (a, mut b) = (Quat::from_array(before.value), Quat::from_array(key.value));
            if a.dot(b) < 0.0 {
                b = -b;
                key.value = b.to_array();
            }
            let cosine = a.dot(b).min(1.0);
            if cosine < NEAR {
                let degrees = bevy::math::ops::acos(cosine).to_degrees() * 2.0;
                let pieces = (degrees / 2.0).ceil().clamp(1.0, MOST) as u32;
                let added: Vec<Key> = (1..pieces)
                    .map(|piece| piece as f32 / pieces as f32)
                    .map(|share| Key::rotation(before.time + (key.time - before.time) * share, slerp(a, b, share)))
                    .collect();
                // Times that rounding makes equal have no room between them.
                let rises = |list: &[Key]| list.windows(2).all(|pair| pair[0].time < pair[1].time);
                let ends = added.first().is_none_or(|first| first.time > before.time)
                    && added.last().is_none_or(|last| last.time < key.time);
                if ends && rises(&added) {
                    keys.extend(added);
                }
            }
        }
        keys.push(key);
    }
    keys
}
