//! Clips on the nodes of a rig: layers, masks, markers, keys of every kind, and keys that no track can have.

use std::{collections::BTreeMap, sync::Arc};

use rigsmith::rig::{
    Uid,
    animation::{ClipLayer, Ease, Key, LayerMode, Marker, Property, RigClip, Track, TrackTarget},
};

use super::{Choices, params::NAMES};

/// A clip; `nodes` are those of a rig, of which a few are replaced by others that no rig has.
pub fn clip(choices: &mut Choices, uid: u64, nodes: &[Uid]) -> RigClip {
    let name = choices.pick(&NAMES);
    let mut clip = RigClip::new(Uid(uid), Uid(uid + 1), name);
    clip.frame_rate = choices.pick(&[30.0, 24.0, 60.0, 1.0, 1e-3, 1e6]);
    clip.range = choices.pick(&[[0.0, 2.0], [0.0, 0.0], [-1.0, 1.0], [0.5, 0.75], [0.0, 1e9], [0.0, 3e38]]);
    clip.looped = choices.chance(3);
    for number in 0..choices.below(3) {
        clip.markers.push(Marker { time: number as f32 * 0.5, name: choices.pick(&NAMES).to_owned() });
    }
    for number in 1..choices.below(4) as u64 {
        clip.layers.push(ClipLayer::empty(Uid(uid + 1 + number)));
    }
    for layer in &mut clip.layers {
        if choices.chance(3) {
            layer.mode = LayerMode::Additive;
        }
        layer.weight = choices.pick(&[1.0, 0.5, 0.0, 1.0]);
        layer.muted = choices.chance(6);
        if choices.chance(6) {
            layer.mask.extend(choices.of(nodes));
        }
        for _ in 0..choices.below(5) {
            let node = choices.of(nodes).filter(|_| !choices.chance(16)).unwrap_or(Uid(0xDEAD));
            let property = property(choices);
            let keys = keys(choices, &property);
            layer.tracks.insert(TrackTarget { node, property }, Arc::new(Track { keys }));
        }
    }
    if choices.chance(8) {
        bend(choices, &mut clip);
    }
    clip
}

/// Property of a node.
pub fn property(choices: &mut Choices) -> Property {
    match choices.below(6) {
        0..=2 => Property::Rotation,
        3 => Property::Translation,
        4 => Property::Scale,
        _ => Property::Attribute(choices.pick(&NAMES).to_owned()),
    }
}

/// Keys at rising times.
pub fn keys(choices: &mut Choices, property: &Property) -> Vec<Key> {
    let width = property.width();
    let mut time = choices.pick(&[0.0, -0.5, 0.25]);
    let count = 1 + choices.below(6);
    let mut keys = Vec::with_capacity(count);
    for _ in 0..count {
        let value = match property {
            Property::Rotation => choices.rotation().to_array(),
            Property::Scale => [1.0 + choices.unit(), 1.0, 0.5 + choices.unit(), 0.0],
            Property::Translation => {
                let place = choices.vector();
                [place.x, place.y, place.z, 0.0]
            }
            Property::Attribute(_) => [choices.number(), 0.0, 0.0, 0.0],
        };
        let mut tangent = || std::array::from_fn(|axis| if axis < width { choices.number() } else { 0.0 });
        let (arrive, leave) = (tangent(), tangent());
        let ease = match choices.below(3) {
            0 => Ease::Linear,
            1 => Ease::Stepped,
            _ => Ease::Cubic { arrive, leave },
        };
        keys.push(Key { time, value, ease });
        time += 0.125 + 0.5 * choices.unit();
    }
    keys
}

/// Gives a clip one thing that no clip can have.
fn bend(choices: &mut Choices, clip: &mut RigClip) {
    let odd = choices.pick(&[f32::NAN, f32::INFINITY, -1.0]);
    match choices.below(6) {
        0 => clip.frame_rate = odd,
        1 => clip.range = [1.0, 0.0],
        2 => clip.range[1] = f32::NAN,
        3 => clip.layers[0].weight = odd,
        4 => clip.markers = [2.0, 1.0].map(|time| Marker { time, name: String::new() }).to_vec(),
        _ => {
            let target = TrackTarget { node: Uid(0xDEAD), property: Property::Translation };
            let wrong = choices.pick(&[
                Key { time: odd, value: [0.0; 4], ease: Ease::Linear },
                Key { time: 0.0, value: [f32::NAN, 0.0, 0.0, 0.0], ease: Ease::Linear },
                Key { time: 0.0, value: [0.0, 0.0, 0.0, 1.0], ease: Ease::Linear },
            ]);
            let mut tracks = BTreeMap::new();
            tracks.insert(target, Arc::new(Track { keys: vec![wrong, Key { time: 0.0, ..wrong }] }));
            clip.layers[0].tracks = tracks;
        }
    }
}
