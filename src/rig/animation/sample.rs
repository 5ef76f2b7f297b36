//! Values of tracks and clips between keys.

use std::collections::BTreeMap;

use bevy::prelude::*;

use super::{ClipLayer, Ease, Key, LayerMode, PoseOffset, Property, RigClip, Track, TrackTarget};
use crate::rig::{AttributeValues, Uid};

/// Pose of a clip at one moment: offsets and attributes of the animated nodes.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct SampledPose {
    /// Offsets of nodes with a track for at least one of translation, rotation and scale.
    pub offsets: BTreeMap<Uid, PoseOffset>,
    /// Animated attributes.
    pub values: AttributeValues,
}

impl Track {
    /// Value at a second, held before the first and after the last key; `None` without keys.
    pub fn sample(&self, property: &Property, time: f32) -> Option<[f32; 4]> {
        let (first, last) = (self.keys.first()?, self.keys.last()?);
        // A time that is no number counts as the start.
        if time <= first.time || time.is_nan() {
            return Some(first.value);
        }
        if time >= last.time {
            return Some(last.value);
        }
        let next = self.keys.partition_point(|key| key.time <= time);
        Some(between(&self.keys[next - 1], &self.keys[next], property, time))
    }
}

/// Value between two neighbouring keys.
pub(super) fn between(from: &Key, to: &Key, property: &Property, time: f32) -> [f32; 4] {
    let span = to.time - from.time;
    let share = (time - from.time) / span;
    match from.ease {
        Ease::Stepped => from.value,
        Ease::Linear if *property == Property::Rotation => {
            let (a, b) = (Quat::from_array(from.value), Quat::from_array(to.value));
            slerp(a, b, share).to_array()
        }
        Ease::Linear => std::array::from_fn(|axis| from.value[axis] + (to.value[axis] - from.value[axis]) * share),
        Ease::Cubic { leave, .. } => {
            let arrive = arrival(to);
            let (square, cube) = (share * share, share * share * share);
            let value = std::array::from_fn(|axis| {
                (2.0 * cube - 3.0 * square + 1.0) * from.value[axis]
                    + (cube - 2.0 * square + share) * span * leave[axis]
                    + (-2.0 * cube + 3.0 * square) * to.value[axis]
                    + (cube - square) * span * arrive[axis]
            });
            if *property == Property::Rotation { normalized(value) } else { value }
        }
    }
}

/// Tangent with which a cubic curve comes to a key.
pub(super) fn arrival(key: &Key) -> [f32; 4] {
    match key.ease {
        Ease::Cubic { arrive, .. } => arrive,
        Ease::Stepped | Ease::Linear => [0.0; 4],
    }
}

/// Change a second of the cubic curve between two neighbouring keys; zero where it is not cubic.
pub(in crate::rig) fn cubic_slope(from: &Key, to: &Key, time: f32) -> [f32; 4] {
    let Ease::Cubic { leave, .. } = from.ease else { return [0.0; 4] };
    let (arrive, span) = (arrival(to), to.time - from.time);
    let share = (time - from.time) / span;
    std::array::from_fn(|axis| {
        6.0 * share * (1.0 - share) * (to.value[axis] - from.value[axis]) / span
            + (3.0 * share * share - 4.0 * share + 1.0) * leave[axis]
            + (3.0 * share * share - 2.0 * share) * arrive[axis]
    })
}

/// Rotation between two, on the shorter way.
pub(in crate::rig) fn slerp(from: Quat, to: Quat, share: f32) -> Quat {
    let to = if from.dot(to) < 0.0 { -to } else { to };
    let cosine = from.dot(to).min(1.0);
    if cosine > 0.9995 {
        return (from * (1.0 - share) + to * share).normalize();
    }
    let angle = bevy::math::ops::acos(cosine);
    let by = 1.0 / bevy::math::ops::sin(angle);
    let (a, b) = (bevy::math::ops::sin((1.0 - share) * angle) * by, bevy::math::ops::sin(share * angle) * by);
    (from * a + to * b).normalize()
}

fn normalized(value: [f32; 4]) -> [f32; 4] {
    let quat = Quat::from_array(value);
    if quat.length_squared() > 1e-12 { quat.normalize().to_array() } else { Quat::IDENTITY.to_array() }
}

impl RigClip {
    /// Pose at a second, all layers mixed.
    pub fn sample(&self, time: f32) -> SampledPose {
        let mut mixed: BTreeMap<TrackTarget, [f32; 4]> = BTreeMap::new();
        for layer in self.layers.iter().filter(|layer| !layer.muted && layer.weight > 0.0) {
            layer.mix_into(time, &mut mixed);
        }
        let mut pose = SampledPose::default();
        for (target, value) in mixed {
            let vector = Vec3::new(value[0], value[1], value[2]);
            match target.property {
                Property::Translation => pose.offsets.entry(target.node).or_default().translation = vector,
                Property::Rotation => pose.offsets.entry(target.node).or_default().rotation = Quat::from_array(value),
                Property::Scale => pose.offsets.entry(target.node).or_default().scale = vector,
                Property::Attribute(name) => {
                    pose.values.entry(target.node).or_default().insert(name, value[0]);
                }
            }
        }
        pose
    }
}

/// Values that layers need.
impl RigClip {
    /// Value of a property at a second, all layers mixed; `None` if no layer in effect has a key of it.
    pub fn value(&self, target: &TrackTarget, time: f32) -> Option<[f32; 4]> {
        self.value_below(self.layers.len(), target, time)
    }

    /// Value of a property, mixed from the first `count` layers.
    fn value_below(&self, count: usize, target: &TrackTarget, time: f32) -> Option<[f32; 4]> {
        let mut value = None;
        let is_on = |layer: &&ClipLayer| !layer.muted && layer.weight > 0.0 && layer.concerns(target.node);
        for layer in self.layers[..count].iter().filter(is_on) {
            let of = layer.tracks.get(target).and_then(|track| track.sample(&target.property, time));
            if let Some(own) = of {
                value = Some(layer.mixed(&target.property, value, own));
            }
        }
        value
    }

    /// Value of a property at a second, all layers mixed, where a layer has the value `own` in place of its keys.
    pub fn value_with(&self, layer: usize, target: &TrackTarget, time: f32, own: [f32; 4]) -> Option<[f32; 4]> {
        let mut value = None;
        let is_on = |layer: &ClipLayer| !layer.muted && layer.weight > 0.0 && layer.concerns(target.node);
        for (place, known) in self.layers.iter().enumerate().filter(|(_, known)| is_on(known)) {
            let of = match place == layer {
                true => Some(own),
                false => known.tracks.get(target).and_then(|track| track.sample(&target.property, time)),
            };
            if let Some(own) = of {
                value = Some(known.mixed(&target.property, value, own));
            }
        }
        value
    }

    /// Value of a layer's key with which the layers up to this one give `wanted`. A layer without weight cannot give it, and
    /// gets the value as if it had full weight.
    pub fn value_for(&self, layer: usize, target: &TrackTarget, time: f32, wanted: [f32; 4]) -> [f32; 4] {
        let Some(own) = self.layers.get(layer) else { return wanted };
        let property = &target.property;
        let below = self.value_below(layer, target, time).unwrap_or_else(|| property.rest());
        let weight = if own.weight > 1e-4 { own.weight } else { 1.0 };
        let (from, to) = match own.mode {
            LayerMode::Override => (below, wanted),
            LayerMode::Additive => (property.rest(), without(property, wanted, below)),
        };
        if weight >= 1.0 {
            return to;
        }
        if *property == Property::Rotation {
            let (from, to) = (Quat::from_array(from), Quat::from_array(to));
            return further(from, to, 1.0 / weight).to_array();
        }
        std::array::from_fn(|axis| from[axis] + (to[axis] - from[axis]) / weight)
    }
}

/// Rotation that lies on the way from one to another, `factor` times as far.
fn further(from: Quat, to: Quat, factor: f32) -> Quat {
    let turn = from.inverse() * to;
    let turn = if turn.w < 0.0 { -turn } else { turn };
    let Some(axis) = turn.xyz().try_normalize() else { return to };
    // The vector part has the digits of small angles, which the cosine has not.
    let half = bevy::math::ops::atan2(turn.xyz().length(), turn.w) * factor;
    let turned = axis * bevy::math::ops::sin(half);
    (from * Quat::from_xyzw(turned.x, turned.y, turned.z, bevy::math::ops::cos(half))).normalize()
}

/// Offset that has to be added to `below` to give `wanted`.
fn without(property: &Property, wanted: [f32; 4], below: [f32; 4]) -> [f32; 4] {
    match property {
        Property::Rotation => (Quat::from_array(below).inverse() * Quat::from_array(wanted)).normalize().to_array(),
        Property::Scale => {
            std::array::from_fn(
                |axis| if below[axis] == 0.0 { property.rest()[axis] } else { wanted[axis] / below[axis] },
            )
        }
        Property::Translation | Property::Attribute(_) => std::array::from_fn(|axis| wanted[axis] - below[axis]),
    }
}

impl ClipLayer {
    /// Value of the layer on top of that of the layers below.
    fn mixed(&self, property: &Property, below: Option<[f32; 4]>, own: [f32; 4]) -> [f32; 4] {
        match (self.mode, below) {
            (LayerMode::Override, None) if self.weight >= 1.0 => own,
            (LayerMode::Override, below) => blend(property, below.unwrap_or_else(|| property.rest()), own, self.weight),
            (LayerMode::Additive, below) => {
                let added = blend(property, property.rest(), own, self.weight);
                add(property, below.unwrap_or_else(|| property.rest()), added)
            }
        }
    }

    fn mix_into(&self, time: f32, mixed: &mut BTreeMap<TrackTarget, [f32; 4]>) {
        for (target, track) in self.tracks.iter().filter(|(target, _)| self.concerns(target.node)) {
            let Some(value) = track.sample(&target.property, time) else { continue };
            let mix = self.mixed(&target.property, mixed.get(target).copied(), value);
            mixed.insert(target.clone(), mix);
        }
    }
}

/// Value between two, by a weight.
pub(super) fn blend(property: &Property, from: [f32; 4], to: [f32; 4], weight: f32) -> [f32; 4] {
    if weight >= 1.0 {
        return to;
    }
    if *property == Property::Rotation {
        return slerp(Quat::from_array(from), Quat::from_array(to), weight).to_array();
    }
    std::array::from_fn(|axis| from[axis] + (to[axis] - from[axis]) * weight)
}

/// Offset on top of another one.
pub(super) fn add(property: &Property, below: [f32; 4], added: [f32; 4]) -> [f32; 4] {
    match property {
        Property::Rotation => (Quat::from_array(below) * Quat::from_array(added)).normalize().to_array(),
        Property::Scale => std::array::from_fn(|axis| below[axis] * added[axis]),
        Property::Translation | Property::Attribute(_) => std::array::from_fn(|axis| below[axis] + added[axis]),
    }
}
