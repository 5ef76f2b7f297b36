//! Keys of a retargeted clip, reduced.

use std::sync::Arc;

use crate::rig::{
    PoseOffset, Rig, Uid,
    animation::{Ease, Key, Property, RigClip, Track, TrackTarget},
    operations::KeyTolerance,
};

/// Offsets of nodes frame by frame, attributes that are constant, and attributes frame by frame.
#[derive(Debug, Clone, Default)]
pub(super) struct KeyedTracks {
    pub nodes: Vec<(Uid, Vec<PoseOffset>)>,
    pub values: Vec<(Uid, String, f32)>,
    /// Attributes frame by frame.
    pub numbers: Vec<(Uid, String, Vec<f32>)>,
}

/// Clip without tracks. Its uids follow from its name and the rig.
pub(super) fn empty_clip(rig: &Rig, name: &str, rate: f32, range: [f32; 2], looped: bool) -> RigClip {
    let of = rig.uid().to_string();
    let uids = ["clip", "layer"].map(|what| Uid::derived([of.as_str(), name, what]));
    RigClip { frame_rate: rate, range, looped, ..RigClip::new(uids[0], uids[1], name) }
}

/// Adds the keys to the clip's first layer, reduced within what nobody sees on a figure of that height. Returns the numbers of
/// keys before and after.
pub(super) fn fill(clip: &mut RigClip, keyed: &KeyedTracks, times: &[f32], height: f32) -> [usize; 2] {
    let usual = KeyTolerance::default();
    // The tolerance is for humans in metres.
    let tolerance = KeyTolerance { distance: usual.distance * (height / 1.7).max(1e-6), ..usual };
    let mut counts = [0, 0];
    let start = times.first().copied().unwrap_or_default();
    let Some(layer) = clip.layers.first_mut() else { return counts };
    for (node, offsets) in &keyed.nodes {
        let mut last = bevy::math::Quat::IDENTITY;
        let rotations = offsets.iter().map(|offset| {
            let turn = if offset.rotation.dot(last) < 0.0 { -offset.rotation } else { offset.rotation };
            last = turn;
            turn.to_array()
        });
        let rotations: Vec<[f32; 4]> = rotations.collect();
        let vector = |v: bevy::math::Vec3| [v.x, v.y, v.z, 0.0];
        let values = [
            (Property::Translation, offsets.iter().map(|offset| vector(offset.translation)).collect::<Vec<_>>()),
            (Property::Rotation, rotations),
            (Property::Scale, offsets.iter().map(|offset| vector(offset.scale)).collect()),
        ];
        for (property, values) in values {
            let rest = property.rest();
            let is_rest = |value: &[f32; 4]| value.iter().zip(rest).all(|(a, b)| (a - b).abs() < 1e-7);
            if values.iter().all(is_rest) {
                continue;
            }
            let key = |(time, value): (&f32, &[f32; 4])| Key { time: *time, value: *value, ease: Ease::Linear };
            let track = Track { keys: times.iter().zip(&values).map(key).collect() };
            let keys = tolerance.reduced(&track, &property);
            counts[0] += track.keys.len();
            counts[1] += keys.len();
            layer.tracks.insert(TrackTarget { node: *node, property }, Arc::new(Track { keys }));
        }
    }
    for (node, name, numbers) in &keyed.numbers {
        let track =
            Track { keys: times.iter().zip(numbers).map(|(time, number)| Key::number(*time, *number)).collect() };
        let target = TrackTarget { node: *node, property: Property::Attribute(name.clone()) };
        // Numbers that turn joints are angles in degrees.
        let keys = KeyTolerance { value: tolerance.angle, ..tolerance }.reduced(&track, &target.property);
        counts[0] += track.keys.len();
        counts[1] += keys.len();
        layer.tracks.insert(target, Arc::new(Track { keys }));
    }
    for (node, name, value) in &keyed.values {
        let key = Key { ease: Ease::Stepped, ..Key::number(start, *value) };
        let target = TrackTarget { node: *node, property: Property::Attribute(name.clone()) };
        layer.tracks.insert(target, Arc::new(Track { keys: vec![key] }));
        counts[0] += times.len();
        counts[1] += 1;
    }
    counts
}
