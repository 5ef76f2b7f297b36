//! Keys of a retargeted clip, reduced.

use std::sync::Arc;

use super::player::{Player, TrackReach};
use crate::{
    rig::{
        PoseOffset, Rig, Uid,
        animation::{Ease, Key, Property, RigClip, Track, TrackTarget},
        operations::KeyTolerance,
    },
    solve::{
        program::RigProgram,
        reduction::{CurveKind, FrameErrors, JointPlace, SampledTrack, errors_of, reduce_tracks, track_tolerance},
    },
};

/// Most places of joints, of all frames together, that are held while keys are reduced, in 32 bytes each. The motion of more is
/// played again for each comparison.
const MOST_HELD: usize = 1 << 18;

/// Offsets of nodes frame by frame, attributes that are constant, and attributes frame by frame.
#[derive(Debug, Clone, Default)]
pub(super) struct KeyedTracks {
    pub nodes: Vec<(Uid, Vec<PoseOffset>)>,
    pub values: Vec<(Uid, String, f32)>,
    /// Attributes frame by frame.
    pub numbers: Vec<(Uid, String, Vec<f32>)>,
    /// Control that carries the travel over the ground; `None` if no control was to carry it.
    pub root: Option<Uid>,
}

/// Clip without tracks. Its uids follow from its name and the rig.
pub(super) fn empty_clip(rig: &Rig, name: &str, rate: f32, range: [f32; 2], looped: bool) -> RigClip {
    let of = rig.uid().to_string();
    let uids = ["clip", "layer"].map(|what| Uid::derived([of.as_str(), name, what]));
    RigClip { frame_rate: rate, range, looped, ..RigClip::new(uids[0], uids[1], name) }
}

/// Adds the keys to the clip's first layer, reduced within the tolerance of the joints, which the program plays. Returns the
/// numbers of keys before and after.
pub(super) fn fill(
    clip: &mut RigClip,
    mut keyed: KeyedTracks,
    times: &[f32],
    program: &Arc<RigProgram>,
    tolerance: &KeyTolerance,
    curves: CurveKind,
) -> [usize; 2] {
    let mut counts = [0, 0];
    let start = times.first().copied().unwrap_or_default();
    let Some(layer) = clip.layers.first_mut() else { return counts };
    let (targets, mut tracks) = keyed.tracks();
    let held = std::mem::take(&mut keyed.values);
    // The tracks have the values once more.
    drop(keyed);
    let player = Player::new(program, &targets, &held);
    let reaches = player.reaches(&tracks, 20.0 * tolerance.distance);
    for (track, reach) in tracks.iter_mut().zip(&reaches) {
        // Numbers that turn joints are angles in degrees.
        let of = KeyTolerance { value: tolerance.angle, ..*tolerance };
        track.tolerance = track_tolerance(&track.property, reach.most, &of);
    }
    let count = tracks.len();
    let captured = |track: usize, frame: usize| tracks[track].values[frame];
    let is_held = times.len().saturating_mul(player.width()) <= MOST_HELD;
    let truth = if is_held { player.each(times.len(), captured, count, |_, places| places) } else { Vec::new() };
    let keys = reduce_tracks(times, &tracks, curves, |values| {
        let errors = |places: &[JointPlace], wanted: &[JointPlace]| {
            let errors = errors_of(places, wanted, tolerance);
            let of_places = |reach: &TrackReach| {
                let own = reach.places.iter().filter_map(|place| errors.get(*place));
                own.copied().fold(0.0, f32::max)
            };
            FrameErrors {
                worst: errors.iter().copied().fold(0.0, f32::max),
                of_tracks: reaches.iter().map(of_places).collect(),
            }
        };
        let reduced = |track: usize, frame: usize| values[track][frame];
        match is_held {
            true => player.each(times.len(), reduced, count, |frame, places| errors(&places, &truth[frame])),
            false => {
                player.each_pair(times.len(), [&reduced, &captured], count, |[places, wanted]| errors(&places, &wanted))
            }
        }
    });
    for (target, keys) in targets.into_iter().zip(keys) {
        counts[0] += times.len();
        counts[1] += keys.len();
        layer.tracks.insert(target, Arc::new(Track { keys }));
    }
    for (node, name, value) in &held {
        let key = Key { ease: Ease::Stepped, ..Key::number(start, *value) };
        let target = TrackTarget { node: *node, property: Property::Attribute(name.clone()) };
        layer.tracks.insert(target, Arc::new(Track { keys: vec![key] }));
        counts[0] += times.len();
        counts[1] += 1;
    }
    counts
}

impl KeyedTracks {
    /// Tracks that are not at rest all the time.
    fn tracks(&self) -> (Vec<TrackTarget>, Vec<SampledTrack>) {
        let (mut targets, mut tracks) = (Vec::new(), Vec::new());
        let mut add = |node: Uid, property: Property, values: Vec<[f32; 4]>| {
            targets.push(TrackTarget { node, property: property.clone() });
            tracks.push(SampledTrack { property, values, tolerance: 0.0 });
        };
        for (node, offsets) in &self.nodes {
            let mut last = bevy::math::Quat::IDENTITY;
            let rotations = offsets.iter().map(|offset| {
                last = if offset.rotation.dot(last) < 0.0 { -offset.rotation } else { offset.rotation };
                last.to_array()
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
                if !values.iter().all(is_rest) {
                    add(*node, property, values);
                }
            }
        }
        for (node, name, numbers) in &self.numbers {
            let values = numbers.iter().map(|number| [*number, 0.0, 0.0, 0.0]).collect();
            add(*node, Property::Attribute(name.clone()), values);
        }
        (targets, tracks)
    }
}
