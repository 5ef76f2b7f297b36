//! Long clips, which are reduced in blocks of frames.
//!
//! Lines are found block by block. Each track as a whole is told in bits then, and the clip is played again to see whether all nodes
//! are still where they were; if not, the numbers get more bits.

use super::{LINES, PARTS, track::PackedTrack};
use crate::{
    rig::{
        animation::{Ease, Key, Property},
        operations::KeyTolerance,
    },
    solve::{
        bake_clip::{JoinedKeys, PlayedClip, reduced_keys},
        curve_fit::sampled,
        reduction::{SampledPart, are_near},
    },
};

/// Shares of what lines leave of the tolerance that are tried for the bits of numbers.
const SHARES: [f32; 3] = [0.5, 0.125, 0.03];

/// Tracks of a clip that `play` begins to play, by node and part, with which all nodes are within the tolerance at every frame.
pub(super) fn packed_tracks<'a>(
    play: impl Fn() -> PlayedClip<'a>,
    times: &[f32],
    nodes: usize,
    tolerance: &KeyTolerance,
) -> Vec<((usize, usize), PackedTrack)> {
    let lines = reduced_keys(play(), &vec![[false; 3]; nodes], &tolerance.scaled(LINES));
    for share in SHARES {
        let tracks = packed(&lines, times, share);
        if is_within(play(), times, &tracks, tolerance) {
            return by_part(tracks);
        }
    }
    by_part(packed(&lines, times, 0.0))
}

fn by_part(tracks: Vec<[PackedTrack; 3]>) -> Vec<((usize, usize), PackedTrack)> {
    let parts = |(node, parts): (usize, [PackedTrack; 3])| {
        parts.into_iter().enumerate().map(move |(part, track)| ((node, part), track))
    };
    tracks.into_iter().enumerate().flat_map(parts).collect()
}

/// Tracks of keys, whose bits take a share of what the lines leave of the tolerance.
fn packed(lines: &[[JoinedKeys; 3]], times: &[f32], share: f32) -> Vec<[PackedTrack; 3]> {
    let frame = |time: f32| times.binary_search_by(|other| other.total_cmp(&time)).unwrap_or_else(|near| near) as u32;
    let track = |joined: &JoinedKeys, property: &Property| {
        let keys: Vec<(u32, [f32; 4])> = joined.keys().map(|(time, value)| (frame(time), value)).collect();
        PackedTrack::new(property, &keys, share * (1.0 - LINES) * joined.tolerance())
    };
    lines.iter().map(|parts| std::array::from_fn(|part| track(&parts[part], &PARTS[part]))).collect()
}

/// True if the nodes are within the tolerance at every frame as the tracks have them.
fn is_within(mut played: PlayedClip, times: &[f32], tracks: &[[PackedTrack; 3]], tolerance: &KeyTolerance) -> bool {
    let line = |(frame, value): (u32, [f32; 4])| Key { time: times[frame as usize], value, ease: Ease::Linear };
    let keys =
        |track: &PackedTrack, property: &Property| track.keys(property).into_iter().map(line).collect::<Vec<Key>>();
    let curves: Vec<[Vec<Key>; 3]> =
        tracks.iter().map(|parts| std::array::from_fn(|part| keys(&parts[part], &PARTS[part]))).collect();
    while let Some((frames, nodes)) = played.next_block() {
        let times = &times[frames];
        let values: Vec<[SampledPart; 3]> = curves
            .iter()
            .map(|parts| std::array::from_fn(|part| part_between(&PARTS[part], &parts[part], times)))
            .collect();
        if !are_near(&nodes, times.len(), &values, tolerance) {
            return false;
        }
    }
    true
}

/// Values of keys at times, of which those between the first and the last one are read.
fn part_between(property: &Property, keys: &[Key], times: &[f32]) -> SampledPart {
    let (Some(first), Some(last)) = (times.first(), times.last()) else { return SampledPart::default() };
    let from = keys.partition_point(|key| key.time <= *first).saturating_sub(1);
    let to = (keys.partition_point(|key| key.time < *last) + 1).min(keys.len());
    match &keys[from..to] {
        [only] => SampledPart::new(vec![only.value]),
        between => SampledPart::new(sampled(property, times, between.to_vec())),
    }
}
