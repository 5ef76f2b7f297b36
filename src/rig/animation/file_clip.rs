//! Clips of mesh files: as the motion of the file's skeleton, as keys on joints of a rig, and back.
//!
//! A file has transforms relative to the parents, a clip has offsets from rest. From one to the other, each number of a
//! key is a linear function of the numbers of that key, tangents included, so that interpolation between keys stays
//! what it is. Numbers that come from a file are rounded to a grid which is coarser than what two such steps lose: keys
//! that went out and in again are the same bits, and so is the file that is written from them. What channels cannot hold,
//! such as markers, goes through the extras of the animation ([`ClipExtras`]).

use std::{collections::HashMap, sync::Arc};

use bevy::math::{DQuat, DVec3};

use super::{
    ClipLayer, Ease, Key, LayerMode, Marker, Property, RigClip, Track, TrackTarget,
    clip_extras::ClipExtras,
    motion::{Motion, MotionChannel, MotionJoint},
};
use crate::{
    mesh::model::{Channel, ChannelTarget, Clip, Interpolation, Model, Trs},
    rig::{Rig, Uid},
};

/// Frame rates at which a file's keys are looked for, the likeliest first.
const RATES: [f32; 9] = [30.0, 24.0, 25.0, 60.0, 50.0, 48.0, 90.0, 100.0, 120.0];
/// Frame rate of a motion whose keys lie at none of them.
const USUAL_RATE: f32 = 60.0;
/// Most frames, and most values, of a motion that is sampled from a clip.
const MAX_FRAMES: usize = 200_000;
const MAX_VALUES: usize = 32 << 20;
/// Values that any clip may have, and those that it may have for each value of its keys: two keys may lie hours apart.
const FEW_VALUES: usize = 8 << 20;
const VALUES_FOR_A_VALUE: usize = 4;
/// Bound of numbers of a motion; larger ones are damage.
const MAX_NUMBER: f32 = 1e9;

/// Grid of rotations and scale factors.
const GRID: f64 = 1.0 / (1 << 20) as f64;
/// Ratio of the grid of tangents to that of values.
const TANGENT_GRID: f64 = 16.0;

/// Keys of a channel, with the node that they move; `None` for morph targets.
fn track_of(channel: &Channel) -> Option<(usize, Property, Track)> {
    let (node, property) = match channel.target {
        ChannelTarget::Translation(node) => (node, Property::Translation),
        ChannelTarget::Rotation(node) => (node, Property::Rotation),
        ChannelTarget::Scale(node) => (node, Property::Scale),
        ChannelTarget::MorphWeights(_) => return None,
    };
    let width = property.width();
    let is_cubic = channel.interpolation == Interpolation::CubicSpline;
    let values = channel.values.chunks_exact(if is_cubic { 3 * width } else { width });
    let key = |(time, values): (&f32, &[f32])| {
        let part = |at: usize| -> [f32; 4] {
            std::array::from_fn(|axis| if axis < width { values[at * width + axis] } else { 0.0 })
        };
        let (value, ease) = match channel.interpolation {
            Interpolation::Linear => (part(0), Ease::Linear),
            Interpolation::Step => (part(0), Ease::Stepped),
            Interpolation::CubicSpline => (part(1), Ease::Cubic { arrive: part(0), leave: part(2) }),
        };
        let key = Key { time: *time, value, ease };
        if property == Property::Rotation { with_unit_length(key) } else { key }
    };
    let keys: Vec<Key> = channel.times.iter().zip(values).map(key).collect();
    (!keys.is_empty()).then_some((node, property, Track { keys }))
}

/// Key of a rotation with a value of unit length, which files of small numbers have roughly.
fn with_unit_length(key: Key) -> Key {
    let length = key.value.iter().map(|number| number * number).sum::<f32>().sqrt();
    if (length - 1.0).abs() < 1e-5 {
        return key;
    }
    if length < 1e-6 {
        return Key { value: Property::Rotation.rest(), ease: Ease::Linear, ..key };
    }
    let divided = |list: [f32; 4]| list.map(|number| number / length);
    let ease = match key.ease {
        Ease::Cubic { arrive, leave } => Ease::Cubic { arrive: divided(arrive), leave: divided(leave) },
        ease => ease,
    };
    Key { value: divided(key.value), ease, ..key }
}

/// Channels of a clip that move nodes.
fn node_channels(clip: &Clip) -> impl Iterator<Item = &Channel> {
    clip.channels.iter().filter(|channel| !matches!(channel.target, ChannelTarget::MorphWeights(_)))
}

/// First and last second of the keys of nodes; `None` without any.
fn span(clip: &Clip) -> Option<[f32; 2]> {
    node_channels(clip)
        .filter_map(|channel| Some([*channel.times.first()?, *channel.times.last()?]))
        .reduce(|a, b| [a[0].min(b[0]), a[1].max(b[1])])
}

/// Frame rate at which the keys of a clip lie.
fn frame_rate(clip: &Clip, start: f32) -> f32 {
    let lies = |rate: f32| {
        let near = |time: &f32| {
            let frame = f64::from(time - start) * f64::from(rate);
            (frame - frame.round()).abs() < 0.02
        };
        node_channels(clip).flat_map(|channel| &channel.times).all(near)
    };
    RATES.into_iter().find(|rate| lies(*rate)).unwrap_or(USUAL_RATE)
}

/// Motion of a file's skeleton in one of its clips, frame by frame at the rate of its keys. A clip without keys of
/// nodes gives a motion without frames.
pub fn motion_of(model: &Model, clip: &Clip) -> Motion {
    let joint = |node: &crate::mesh::model::Node| MotionJoint {
        name: node.name.clone(),
        parent: node.parent,
        rest: node.rest,
        ..MotionJoint::default()
    };
    let mut motion = Motion {
        name: clip.name.clone(),
        joints: model.nodes.iter().map(joint).collect(),
        frame_time: 1.0 / USUAL_RATE,
        bind_pose: model.bind_pose().unwrap_or_default(),
        ..Motion::default()
    };
    let facts = ClipExtras::read(clip.extras.as_ref());
    motion.looped = facts.looped;
    let Some([start, end]) = span(clip) else {
        motion.notes.push(format!("the clip \"{}\" moves no joint", clip.name));
        return motion;
    };
    let mut tracks: Vec<(usize, Property, Track)> =
        clip.channels.iter().filter_map(track_of).filter(|(node, ..)| *node < model.nodes.len()).collect();
    tracks.sort_by(|a, b| (a.0, &a.1).cmp(&(b.0, &b.1)));
    for (node, property, _) in &tracks {
        let parts = 0..property.width() as u8;
        motion.joints[*node].channels.extend(parts.map(|part| match property {
            Property::Rotation => MotionChannel::Turn(part),
            Property::Scale => MotionChannel::Scale(part),
            Property::Translation | Property::Attribute(_) => MotionChannel::Position(part),
        }));
    }
    let in_motion = |marker: &Marker| Marker { time: marker.time - start, name: marker.name.clone() };
    motion.markers = facts.markers.iter().map(in_motion).collect();
    let rate = facts.frame_rate.unwrap_or_else(|| frame_rate(clip, start));
    motion.frame_time = 1.0 / rate;
    let given: usize = tracks.iter().map(|(_, property, track)| track.keys.len() * property.width()).sum();
    let most_values = MAX_VALUES.min(FEW_VALUES.max(VALUES_FOR_A_VALUE * given));
    let most = MAX_FRAMES.min(most_values / motion.width().max(1));
    let wanted = (f64::from(end - start) * f64::from(rate) + 0.02).floor();
    let count = (wanted as usize).saturating_add(1).min(most);
    if wanted as usize >= most {
        motion
            .notes
            .push(format!("the clip \"{}\" has more than {most} frames; the first {most} were read", clip.name));
    }
    motion.values.reserve(count * motion.width());
    for frame in 0..count {
        let time = (f64::from(start) + frame as f64 / f64::from(rate)) as f32;
        for (_, property, track) in &tracks {
            let value =
                track.sample(property, time).filter(|value| value.iter().all(|number| number.abs() <= MAX_NUMBER));
            let value = value.unwrap_or_else(|| property.rest());
            motion.values.extend_from_slice(&value[..property.width()]);
        }
    }
    motion
}

/// Joints of a rig that are the nodes of a file: those with the same names and rest transforms, in the order of the
/// nodes. `None` if an animated node has none, so that the clip has to be retargeted.
pub fn own_joints(model: &Model, rig: &Rig) -> Option<Vec<Option<Uid>>> {
    let height = model.rest_globals().iter().map(|at| at.translation.abs().max_element()).fold(0.0, f32::max);
    let is_rest = |a: &Trs, b: &Trs| {
        a.translation.distance(b.translation) <= 1e-4 * height
            && a.rotation.dot(b.rotation).abs() >= 1.0 - 1e-6
            && a.scale.distance(b.scale) <= 1e-4 * a.scale.abs().max_element()
    };
    let joints: Vec<_> = rig.walk().collect();
    let is_node = |joint: &crate::rig::RigJoint, node: &crate::mesh::model::Node| {
        joint.data.label.as_deref().unwrap_or_default() == node.name && is_rest(&joint.data.rest.into(), &node.rest)
    };
    let mut by_label: HashMap<&str, Vec<&crate::rig::RigJoint>> = HashMap::with_capacity(joints.len());
    for joint in &joints {
        by_label.entry(joint.data.label.as_deref().unwrap_or_default()).or_default().push(*joint);
    }
    let places = |number: usize| -> Option<Uid> {
        let node = &model.nodes[number];
        // The skeleton of the file itself has its nodes in order, even those without names.
        if let Some(joint) =
            joints.get(number).filter(|joint| joints.len() == model.nodes.len() && is_node(joint, node))
        {
            return Some(joint.data.uid);
        }
        let alike = by_label.get(node.name.as_str()).filter(|_| !node.name.is_empty()).into_iter().flatten();
        let mut found = alike.filter(|joint| is_node(joint, node));
        found.next().filter(|_| found.next().is_none()).map(|joint| joint.data.uid)
    };
    let found: Vec<Option<Uid>> = (0..model.nodes.len()).map(places).collect();
    let animated = model.clips.iter().flat_map(|clip| &clip.channels).filter_map(|channel| match channel.target {
        ChannelTarget::Translation(node) | ChannelTarget::Rotation(node) | ChannelTarget::Scale(node) => Some(node),
        ChannelTarget::MorphWeights(_) => None,
    });
    let mut is_any = false;
    for node in animated {
        found.get(node).copied().flatten()?;
        is_any = true;
    }
    is_any.then_some(found)
}

/// Clip of a file as keys on the joints that its nodes became, key by key; `joints` are those of [`own_joints`] or of
/// an import. Nodes without a joint, and morph targets, are left out. `None` if nothing is left.
pub fn rig_clip(rig: &Rig, name: &str, clip: &Clip, joints: &[Option<Uid>]) -> Option<RigClip> {
    let range = span(clip)?;
    let of = rig.uid().to_string();
    let uids = ["clip", "layer"].map(|what| Uid::derived([of.as_str(), name, what]));
    let facts = ClipExtras::read(clip.extras.as_ref());
    let mut made = RigClip {
        frame_rate: facts.frame_rate.unwrap_or_else(|| frame_rate(clip, range[0])),
        range,
        looped: facts.looped,
        markers: facts.markers,
        ..RigClip::new(uids[0], uids[1], name)
    };
    let layer = made.layers.first_mut()?;
    for (node, property, track) in clip.channels.iter().filter_map(track_of) {
        let Some(uid) = joints.get(node).copied().flatten() else { continue };
        let Some(rest) = rig.joint(uid).map(|joint| Trs::from(joint.data.rest)) else { continue };
        let change = RestChange { rest, property: property.clone(), grid: grid(&property, &track, &rest) };
        let keys = track.keys.iter().map(|key| change.offset(key)).collect();
        layer.tracks.insert(TrackTarget { node: uid, property }, Arc::new(Track { keys }));
    }
    (!layer.tracks.is_empty()).then_some(made)
}

/// Clips of a file on the joints that its nodes became. Names are those of the file; a clip without one is called
/// `clip`.
pub fn rig_clips(rig: &Rig, model: &Model, joints: &[Option<Uid>]) -> Vec<RigClip> {
    (0..model.clips.len()).filter_map(|number| numbered_clip(rig, model, number, joints)).collect()
}

/// Clip of a file with that number, from zero, as [`rig_clips`] has it; `None` if it has no keys of the joints.
pub fn numbered_clip(rig: &Rig, model: &Model, number: usize, joints: &[Option<Uid>]) -> Option<RigClip> {
    let clip = model.clips.get(number)?;
    let name = if clip.name.trim().is_empty() { "clip" } else { clip.name.trim() };
    let mut made = rig_clip(rig, name, clip, joints)?;
    // Two clips of one name are two clips.
    let (of, number) = (rig.uid().to_string(), number.to_string());
    made.uid = Uid::derived([of.as_str(), &made.name, &number, "clip"]);
    made.layers[0].uid = Uid::derived([of.as_str(), &made.name, &number, "layer"]);
    Some(made)
}

/// Keys of a clip for one property of a joint whose transform is its rest transform and its offset alone, as a channel
/// for a file. Time starts at zero with the clip. `None` if a channel cannot hold them: several layers, keys of several
/// kinds or beyond the clip.
pub fn channel_of(
    clip: &RigClip,
    joint: Uid,
    property: &Property,
    rest: &Trs,
    target: ChannelTarget,
) -> Option<Channel> {
    let is_on = |layer: &&ClipLayer| !layer.muted && layer.weight > 0.0 && layer.concerns(joint);
    let key = TrackTarget { node: joint, property: property.clone() };
    let mut layers = clip.layers.iter().filter(is_on).filter(|layer| layer.tracks.contains_key(&key));
    let layer = layers.next()?;
    if layers.next().is_some() || layer.weight < 1.0 || layer.mode != LayerMode::Override {
        return None;
    }
    let keys = &layer.tracks.get(&key)?.keys;
    let [start, end] = clip.range;
    let interpolation = match keys.first()?.ease {
        Ease::Linear => Interpolation::Linear,
        Ease::Stepped => Interpolation::Step,
        Ease::Cubic { .. } => Interpolation::CubicSpline,
    };
    let is_alike = |key: &Key| {
        let kind = match key.ease {
            Ease::Linear => Interpolation::Linear,
            Ease::Stepped => Interpolation::Step,
            Ease::Cubic { .. } => Interpolation::CubicSpline,
        };
        kind == interpolation && key.time >= start && key.time <= end
    };
    if !keys.iter().all(is_alike) {
        return None;
    }
    let times: Vec<f32> = keys.iter().map(|key| key.time - start).collect();
    if times.windows(2).any(|pair| pair[0] >= pair[1]) {
        return None;
    }
    let change = RestChange { rest: *rest, property: property.clone(), grid: 0.0 };
    let width = property.width();
    let mut values = Vec::with_capacity(keys.len() * width);
    for key in keys {
        let key = change.local(key);
        match key.ease {
            Ease::Cubic { arrive, leave } => {
                [arrive, key.value, leave].iter().for_each(|part| values.extend_from_slice(&part[..width]));
            }
            Ease::Linear | Ease::Stepped => values.extend_from_slice(&key.value[..width]),
        }
    }
    Some(Channel { target, interpolation, times, values })
}

/// Grid of the offsets of a track: for translations a power of two below a two-hundred-thousandth of the largest number
/// in the file.
fn grid(property: &Property, track: &Track, rest: &Trs) -> f64 {
    if *property != Property::Translation {
        return GRID;
    }
    let values = track.keys.iter().flat_map(|key| key.value).map(f32::abs);
    let largest = values.fold(rest.translation.abs().max_element(), f32::max);
    let scale = rest.scale.abs().min_element();
    let exponent = |number: f32| i64::from(number.clamp(1e-20, 1e20).to_bits() >> 23) - 127;
    let exponent = exponent(largest) - 19 - if scale > 0.0 { exponent(scale) } else { 0 };
    f64::from_bits(((1023 + exponent) as u64) << 52)
}

/// Change of keys between transforms relative to the parent and offsets from rest.
struct RestChange {
    rest: Trs,
    property: Property,
    /// Grid of values; zero for none.
    grid: f64,
}

impl RestChange {
    /// Key of an offset for a key of a local transform.
    fn offset(&self, key: &Key) -> Key {
        let back = inverse(self.rest.rotation.as_dquat());
        let scale = self.rest.scale.as_dvec3();
        let divided = |v: DVec3, otherwise: f64| {
            let by = |a: f64, by: f64| if by == 0.0 { otherwise } else { a / by };
            DVec3::new(by(v.x, scale.x), by(v.y, scale.y), by(v.z, scale.z))
        };
        self.changed(key, |value, is_value| match self.property {
            Property::Rotation => (back * DQuat::from_array(value)).to_array(),
            Property::Scale => four(divided(three(value), f64::from(u8::from(is_value)))),
            Property::Translation | Property::Attribute(_) => {
                let from = if is_value { self.rest.translation.as_dvec3() } else { DVec3::ZERO };
                four(divided(back * (three(value) - from), 0.0))
            }
        })
    }

    /// Key of a local transform for a key of an offset.
    fn local(&self, key: &Key) -> Key {
        let rotation = self.rest.rotation.as_dquat();
        let scale = self.rest.scale.as_dvec3();
        self.changed(key, |value, is_value| match self.property {
            Property::Rotation => (rotation * DQuat::from_array(value)).to_array(),
            Property::Scale => four(three(value) * scale),
            Property::Translation | Property::Attribute(_) => {
                let from = if is_value { self.rest.translation.as_dvec3() } else { DVec3::ZERO };
                four(from + rotation * (scale * three(value)))
            }
        })
    }

    /// Key with changed numbers; the function also learns whether they are a value, else they are a tangent.
    fn changed(&self, key: &Key, change: impl Fn([f64; 4], bool) -> [f64; 4]) -> Key {
        let numbers = |list: [f32; 4], is_value: bool| {
            let grid = if is_value { self.grid } else { self.grid * TANGENT_GRID };
            let changed = change(list.map(f64::from), is_value);
            changed.map(|number| if grid > 0.0 { ((number / grid).round() * grid) as f32 } else { number as f32 })
        };
        let ease = match key.ease {
            Ease::Cubic { arrive, leave } => {
                Ease::Cubic { arrive: numbers(arrive, false), leave: numbers(leave, false) }
            }
            ease => ease,
        };
        Key { time: key.time, value: numbers(key.value, true), ease }
    }
}

/// Inverse of a rotation that is a unit quaternion to within rounding, so that the product of the two is exact.
fn inverse(rotation: DQuat) -> DQuat {
    rotation.conjugate() * (1.0 / rotation.length_squared())
}

fn three([x, y, z, _]: [f64; 4]) -> DVec3 {
    DVec3::new(x, y, z)
}

fn four(v: DVec3) -> [f64; 4] {
    [v.x, v.y, v.z, 0.0]
}
