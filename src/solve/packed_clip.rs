//! Packed clips: the motion of a skeleton in few bytes, for the files and the memory of games.
//!
//! A clip has for each node its translation, rotation and scale relative to the parent: as lines between keys at frames, or,
//! where that takes fewer bytes, as a value for each frame. Parts that stay at rest take a byte, constants their numbers. Numbers
//! have as few bits as the tolerance allows; rotations are told from the middle one of their track, by three numbers. What is
//! lost by that is part of what is measured: with its lines *and* its bits, every node is within the tolerance of where it was, at
//! every frame.

mod bits;
mod long;
mod skeleton;
mod steps;
mod track;

use std::sync::Arc;

use bevy::math::Quat;
use serde_json::Value;

use self::{
    bits::{Reader, write_number},
    steps::Steps,
    track::{PackedTrack, REST},
};
use super::{
    bake_clip::{BakeError, BakeSettings, BakedNode, PlayedClip, frame_times, part_of},
    curve_fit::{fit_lines, sampled},
    program::RigProgram,
    reduction::{FittedCurve, RestingPart, SampledNode, SampledSkeleton, SampledTrack, fit_within},
};
use crate::{
    mesh::model::{Channel, ChannelTarget, Clip, Interpolation, Trs},
    rig::{
        animation::{Ease, Key, Property, RigClip, clip_extras::ClipExtras, motion::Motion},
        operations::KeyTolerance,
    },
};

pub use self::skeleton::{PackedNode, PackedSkeleton};

/// First bytes of a packed clip.
const MAGIC: &[u8; 8] = b"rigclip1";
/// Share of a track's tolerance that its lines get; the other part is for the bits of its numbers.
const LINES: f32 = 0.85;
/// Most frames, nodes, and bytes of texts of a packed clip that is read: frames are as many as baked clips have, so that no
/// track of few bytes takes hundreds of megabytes, and their times are different numbers.
const MOST_FRAMES: u32 = 1 << 20;
const MOST_NODES: u32 = 1_000_000;
const MOST_TEXT: usize = 1 << 20;
/// Parts of a transform, in the order of their tracks.
const PARTS: [Property; 3] = [Property::Translation, Property::Rotation, Property::Scale];
/// Bytes of memory of what is unpacked: of a key as key of a channel and of a rig, of a key of the track that is being
/// changed from one to the other, of a track and a clip without their keys, and of a byte of their texts.
const KEY_BYTES: u64 = 76;
const CHANGED_KEY_BYTES: u64 = 56;
const TRACK_BYTES: u64 = 300;
const CLIP_BYTES: u64 = 500;
const TEXT_BYTES: u64 = 32;

/// Motion of a skeleton's nodes in few bytes.
#[derive(Debug, Clone, PartialEq)]
pub struct PackedClip {
    name: String,
    /// Extras as text, empty without any.
    extras: String,
    rate: f32,
    duration: f32,
    frames: u32,
    /// Count of nodes, most parts of which may stay at rest.
    node_count: u32,
    /// Tracks of the parts that do not stay at rest, by node and part.
    tracks: Vec<NodeTrack>,
}

/// Track of a part of a node.
#[derive(Debug, Clone, PartialEq)]
struct NodeTrack {
    node: u32,
    /// Place of the property in [`PARTS`].
    part: u8,
    track: PackedTrack,
}

/// Reason for not reading a packed clip.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum PackedClipError {
    /// The bytes are something else.
    #[error("it is no packed clip of this version; pack the clip again")]
    Other,
    /// The bytes end too early.
    #[error("the packed clip is cut off at byte {0}; copy or pack it again")]
    CutOff(usize),
    /// A value that no packed clip has.
    #[error("the packed clip has {what} at byte {at} that cannot be; copy or pack it again")]
    Damaged {
        /// The value.
        what: &'static str,
        /// Place of the value.
        at: usize,
    },
}

/// Packs a clip of a rig: plays it at a rate, as [`bake_clip`](super::bake_clip::bake_clip) does, and keeps all nodes within the
/// tolerance at every frame.
///
/// # Errors
/// A clip with more frames or transforms than [`BakeSettings`] allows, or with more markers or longer names than are read back.
pub fn pack_clip(
    program: &Arc<RigProgram>,
    clip: &RigClip,
    nodes: &[BakedNode],
    settings: &BakeSettings,
) -> Result<PackedClip, BakeError> {
    let times = frame_times(clip, nodes.len(), settings)?;
    let BakeSettings { rate, tolerance, .. } = settings;
    let (rate, rests) = (*rate, nodes.iter().map(|node| node.rest).collect::<Vec<Trs>>());
    let extras = ClipExtras::of(clip, rate).written().to_string();
    let longest = extras.len().max(clip.name.len());
    if longest > MOST_TEXT {
        return Err(BakeError::Names { bytes: longest, most: MOST_TEXT });
    }
    let about = PackedClip {
        name: clip.name.clone(),
        extras,
        rate,
        duration: times.last().copied().unwrap_or_default(),
        frames: times.len() as u32,
        node_count: 0,
        tracks: Vec::new(),
    };
    let play = || PlayedClip::new(program, clip, nodes, &times);
    let mut played = play();
    let sampled = played.next_block().map(|(_, sampled)| sampled).unwrap_or_default();
    if played.is_over() {
        return Ok(about.packed(&times, sampled, &rests, tolerance));
    }
    drop(sampled);
    Ok(about.with_tracks(&rests, long::packed_tracks(play, &times, nodes.len(), tolerance)))
}

/// Packs the motion of a skeleton of its own, whose joints are within the tolerance at every frame.
pub fn pack_motion(motion: &Motion, tolerance: &KeyTolerance) -> PackedClip {
    let rests: Vec<Trs> = motion.joints.iter().map(|joint| joint.rest).collect();
    let mut sampled: Vec<SampledNode> =
        motion.joints.iter().map(|joint| SampledNode::new(joint.parent, None)).collect();
    for frame in 0..motion.frames() {
        for (node, local) in sampled.iter_mut().zip(motion.locals(frame)) {
            node.push(local);
        }
    }
    let rate = 1.0 / motion.frame_time;
    let facts = ClipExtras { frame_rate: Some(rate), looped: motion.looped, markers: motion.markers.clone() };
    let frames = motion.frames() as u32;
    let mut about = PackedClip {
        name: motion.name.clone(),
        extras: facts.written().to_string(),
        rate,
        duration: frames.saturating_sub(1) as f32 / rate,
        frames,
        node_count: 0,
        tracks: Vec::new(),
    };
    let times: Vec<f32> = (0..frames).map(|frame| about.time(frame)).collect();
    about.duration = times.last().copied().unwrap_or_default();
    about.packed(&times, sampled, &rests, tolerance)
}

impl PackedClip {
    /// Name of the clip.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Number of frames.
    pub fn frames(&self) -> usize {
        self.frames as usize
    }

    /// Number of keys of all tracks.
    pub fn key_count(&self) -> usize {
        self.tracks.iter().map(|own| own.track.len()).sum()
    }

    /// Bytes of memory that the clip takes, about, while it is unpacked and becomes a clip of a rig. Few bytes of a file may
    /// be many keys.
    pub fn unpacked_bytes(&self) -> u64 {
        let keys = |own: &NodeTrack| own.track.len() as u64;
        let tracks: u64 = self.tracks.iter().map(|own| TRACK_BYTES + KEY_BYTES * keys(own)).sum();
        let longest = self.tracks.iter().map(keys).max().unwrap_or_default();
        let texts = (self.name.len() + self.extras.len()) as u64;
        CLIP_BYTES + TEXT_BYTES * texts + tracks + CHANGED_KEY_BYTES * longest
    }

    /// Second of a frame.
    fn time(&self, frame: u32) -> f32 {
        if frame + 1 >= self.frames { self.duration } else { frame as f32 / self.rate }
    }

    fn packed(self, times: &[f32], nodes: Vec<SampledNode>, rests: &[Trs], tolerance: &KeyTolerance) -> Self {
        if times.is_empty() {
            return self.with_tracks(rests, Vec::new());
        }
        let skeleton = SampledSkeleton::new(times.len(), nodes, &vec![[false; 3]; rests.len()], tolerance);
        let fit = |track: &SampledTrack, tolerance: &[f32]| {
            let for_lines: Vec<f32> = tolerance.iter().map(|most| most * LINES).collect();
            let least = tolerance.iter().copied().fold(f32::MAX, f32::min).max(0.1 * track.tolerance);
            let ends = fit_lines(&track.property, times, &track.values, &for_lines);
            let keys: Vec<(u32, [f32; 4])> = ends.iter().map(|end| (*end as u32, track.values[*end])).collect();
            let mut packed = PackedTrack::new(&track.property, &keys, (1.0 - LINES) * least);
            if packed.len() > 1
                && let Some(steps) = Steps::new(&track.property, &track.values, least)
            {
                packed = packed.smaller(PackedTrack::Steps(Box::new(steps)));
            }
            let keys = packed.keys(&track.property);
            let line = |(frame, value): (u32, [f32; 4])| Key { time: times[frame as usize], value, ease: Ease::Linear };
            let values = sampled(&track.property, times, keys.into_iter().map(line).collect());
            let frames = if matches!(packed, PackedTrack::Steps(_)) { Vec::new() } else { ends };
            FittedCurve { curve: packed, values, frames }
        };
        let exact = |track: &SampledTrack| {
            let keys: Vec<(u32, [f32; 4])> = (0..).zip(track.values.iter().copied()).collect();
            PackedTrack::new(&track.property, &keys, 0.0)
        };
        let found = fit_within(&skeleton.tracks, |samples| skeleton.errors(samples), fit)
            .unwrap_or_else(|| skeleton.tracks.iter().map(exact).collect());
        let resting =
            |RestingPart { node, part, value, .. }: &RestingPart| ((*node, *part), PackedTrack::Constant(*value));
        let tracks = skeleton.owners.iter().copied().zip(found).chain(skeleton.resting.iter().map(resting)).collect();
        self.with_tracks(rests, tracks)
    }

    /// The clip with tracks of nodes, by node and part; those that stay at rest are left out.
    fn with_tracks(mut self, rests: &[Trs], tracks: Vec<((usize, usize), PackedTrack)>) -> Self {
        self.node_count = rests.len() as u32;
        for ((node, part), track) in tracks {
            let rest = part_of(&rests[node], &PARTS[part]);
            let is_rest =
                track.constant().is_some_and(|value| value.iter().zip(&rest).all(|(a, b)| (a - b).abs() < 1e-6));
            if !is_rest {
                self.tracks.push(NodeTrack { node: node as u32, part: part as u8, track });
            }
        }
        self.tracks.sort_by_key(|own| (own.node, own.part));
        self
    }

    /// The clip as channels of linear keys, whose targets are places among the nodes. Parts that stay at rest have none.
    pub fn unpacked(&self) -> Clip {
        let channels = self.tracks.iter().filter(|own| own.track.len() > 0).map(|own| self.channel(own)).collect();
        let extras = serde_json::from_str::<Value>(&self.extras).ok();
        Clip { name: self.name.clone(), channels, extras }
    }

    fn channel(&self, own: &NodeTrack) -> Channel {
        let (property, node) = (&PARTS[usize::from(own.part)], own.node as usize);
        let target = match property {
            Property::Translation => ChannelTarget::Translation(node),
            Property::Rotation => ChannelTarget::Rotation(node),
            Property::Scale | Property::Attribute(_) => ChannelTarget::Scale(node),
        };
        let (count, width) = (own.track.len(), property.width());
        let (mut times, mut values) = (Vec::with_capacity(count), Vec::with_capacity(count * width));
        own.track.each_key(property, |frame, value| {
            times.push(self.time(frame));
            values.extend_from_slice(&value[..width]);
        });
        Channel { target, interpolation: Interpolation::Linear, times, values }
    }

    /// Bytes of the clip.
    pub fn to_bytes(&self) -> Vec<u8> {
        let mut out = MAGIC.to_vec();
        for text in [&self.name, &self.extras] {
            write_number(&mut out, text.len() as u32);
            out.extend_from_slice(text.as_bytes());
        }
        out.extend(self.rate.to_le_bytes());
        out.extend(self.duration.to_le_bytes());
        write_number(&mut out, self.frames);
        write_number(&mut out, self.node_count);
        let mut tracks = self.tracks.iter().peekable();
        for place in (0..self.node_count).flat_map(|node| (0..PARTS.len() as u8).map(move |part| (node, part))) {
            match tracks.next_if(|own| (own.node, own.part) == place) {
                Some(own) => own.track.write(&mut out),
                None => out.push(REST),
            }
        }
        out
    }

    /// Clip of bytes.
    ///
    /// # Errors
    /// See [`PackedClipError`].
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, PackedClipError> {
        let rest = bytes.strip_prefix(MAGIC).ok_or(PackedClipError::Other)?;
        let mut reader = Reader::new(rest, MAGIC.len());
        let mut text = || -> Result<String, PackedClipError> {
            let length = reader.number("a length of a text", MOST_TEXT as u32)?;
            let at = reader.at();
            let text = std::str::from_utf8(reader.bytes(length as usize)?);
            Ok(text.map_err(|_| PackedClipError::Damaged { what: "a text", at })?.to_owned())
        };
        let (name, extras) = (text()?, text()?);
        let rate = reader.float("a frame rate")?;
        let duration = reader.float("a duration")?;
        if rate <= 0.0 || duration < 0.0 {
            return Err(PackedClipError::Damaged { what: "a frame rate or duration", at: reader.at() });
        }
        let frames = reader.number("a count of frames", MOST_FRAMES)?;
        // The last frame is the end of the clip, and times rise.
        if frames >= 2 && duration <= (frames - 2) as f32 / rate {
            return Err(PackedClipError::Damaged { what: "a duration of fewer frames", at: reader.at() });
        }
        let node_count = reader.number("a count of nodes", MOST_NODES)?;
        let mut tracks: Vec<NodeTrack> = Vec::new();
        for node in 0..node_count {
            for (part, property) in (0..).zip(&PARTS) {
                if let Some(track) = PackedTrack::read(&mut reader, property, frames)? {
                    tracks.push(NodeTrack { node, part, track });
                }
            }
        }
        if !reader.is_empty() {
            return Err(PackedClipError::Damaged { what: "more bytes", at: reader.at() });
        }
        Ok(Self { name, extras, rate, duration, frames, node_count, tracks })
    }
}

/// Rotation of an array, of unit length.
fn unit(value: [f32; 4]) -> Quat {
    Quat::from_array(value).normalize()
}
