//! Clips baked into transforms of nodes, for files that have neither controls nor constraints.

mod blocks;

use std::{
    collections::HashMap,
    sync::{
        Arc,
        atomic::{AtomicU64, Ordering},
    },
};

use super::program::{RigProgram, RigState};
use crate::{
    mesh::model::{Channel, ChannelTarget, Clip, Interpolation, Trs},
    rig::{
        Uid,
        animation::{
            Property, RigClip, SampledPose, TrackTarget,
            clip_extras::{ClipExtras, MAX_MARKERS},
            file_clip::channel_of,
        },
        operations::KeyTolerance,
    },
};

pub(super) use blocks::{JoinedKeys, PlayedClip, reduced_keys};

/// Properties of a node, in the order of its channels.
static PROPERTIES: [Property; 3] = [Property::Translation, Property::Rotation, Property::Scale];

/// Most frames of a baked clip.
const MOST_FRAMES: u64 = 1_000_000;

/// Most transforms of a baked clip where nobody sets another limit: one for each frame and node.
pub const MOST_TRANSFORMS: u64 = 8 << 20;

/// Manner of baking a clip.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BakeSettings {
    /// Frames a second.
    pub rate: f32,
    /// Differences that the removal of keys may leave.
    pub tolerance: KeyTolerance,
    /// Most transforms: one for each frame and node.
    pub most: u64,
}

impl BakeSettings {
    /// Baking at a rate, of up to [`MOST_TRANSFORMS`].
    pub fn new(rate: f32, tolerance: KeyTolerance) -> Self {
        Self { rate, tolerance, most: MOST_TRANSFORMS }
    }
}

/// Number of frames in words: one beyond all numbers of a clip is not exact.
fn frame_count(frames: u64) -> String {
    if frames < 1_000_000_000_000 { frames.to_string() } else { "more than a million million".to_owned() }
}

/// Reason for not baking a clip.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum BakeError {
    /// More frames than any clip has.
    #[error(
        "the clip has {} frames at {rate} frames a second, and no more than {highest} are baked; shorten its range, or bake \
         fewer frames a second",
        frame_count(*frames),
        highest = MOST_FRAMES
    )]
    TooLong {
        /// Number of frames.
        frames: u64,
        /// Frames a second.
        rate: f32,
    },
    /// More transforms than the limit.
    #[error(
        "the clip has {frames} frames at {rate} frames a second, which are {transforms} transforms of {nodes} nodes, and \
         no more than {most} are baked; shorten its range, bake fewer frames a second, or raise the limit: --limit \
         baked={transforms}"
    )]
    TooMuch {
        /// Number of frames.
        frames: u64,
        /// Frames a second.
        rate: f32,
        /// Number of nodes.
        nodes: u64,
        /// Number of transforms: one for each frame and node.
        transforms: u64,
        /// Value of the limit.
        most: u64,
    },
    /// More markers than a file of animations holds.
    #[error(
        "the clip has {count} markers, and no more than {highest} are read from a file of animations; delete some, or \
         split the clip",
        highest = MAX_MARKERS
    )]
    Markers {
        /// Number of markers.
        count: usize,
    },
    /// Names that a packed clip does not hold.
    #[error(
        "the names of the clip and its markers take {bytes} bytes, and a packed clip holds no more than {most}; shorten \
         them, or delete markers"
    )]
    Names {
        /// Bytes of the names.
        bytes: usize,
        /// Largest number of bytes.
        most: usize,
    },
}

/// Node that is baked.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BakedNode {
    /// The node of the rig.
    pub uid: Uid,
    /// Place of the parent among the nodes, before the node's own.
    pub parent: Option<usize>,
    /// Transform relative to the parent at rest.
    pub rest: Trs,
}

/// Poses an instance as a clip does at a moment, and evaluates it. Nodes that the clip does not animate stay.
pub fn strike(state: &mut RigState, pose: &SampledPose) {
    let program = state.program().clone();
    for (uid, offset) in &pose.offsets {
        if let Some(slot) = program.node(*uid) {
            state.set_offset_at(slot, *offset);
        }
    }
    for (uid, values) in &pose.values {
        for (name, value) in values {
            if let Some(slot) = program.attribute(*uid, name) {
                state.set_attribute_at(slot, *value);
            }
        }
    }
    state.evaluate(0.0);
}

/// Plays a clip at a rate and gives the nodes' transforms relative to their parents as channels, whose targets are places among
/// the nodes. Channels that stay at rest are left out, and keys without which joints stay within the tolerance; the others are
/// linear. A node that nothing but its keys moves keeps them as they are, cubic ones, too. Markers, the rate and whether the
/// clip is looped are in the extras.
///
/// Time starts at zero with the clip. Takes some tens of microseconds a frame for a character.
///
/// A clip that does not move for long takes little memory, and a long one no more than some blocks of its frames.
///
/// # Errors
/// A clip with more frames or transforms than [`BakeSettings`] allows, or with more markers than files hold.
pub fn bake_clip(
    program: &Arc<RigProgram>,
    clip: &RigClip,
    nodes: &[BakedNode],
    settings: &BakeSettings,
) -> Result<Clip, BakeError> {
    BakePlan::new(program, nodes).bake(clip, settings)
}

/// Nodes of a file and the program that moves them, for the baking of any number of clips: a clip takes work for the nodes that it
/// moves.
#[derive(Debug)]
pub struct BakePlan<'a> {
    program: &'a Arc<RigProgram>,
    nodes: &'a [BakedNode],
    /// Place of each node.
    places: HashMap<Uid, usize>,
    /// Rest transforms of the nodes that nothing but their own keys moves.
    bases: Vec<Option<Trs>>,
    /// Nodes that have a channel without any keys, as their transform in the program is not their rest in the file.
    elsewhere: Vec<usize>,
    /// True if nothing but their own keys moves the nodes.
    is_plain: bool,
    /// Number of nodes that clips looked at.
    visits: AtomicU64,
}

impl<'a> BakePlan<'a> {
    /// Takes the nodes and the program.
    pub fn new(program: &'a Arc<RigProgram>, nodes: &'a [BakedNode]) -> Self {
        let bases: Vec<Option<Trs>> = (0..nodes.len()).map(|at| plain_base(program, nodes, at)).collect();
        let is_elsewhere = |at: &usize| {
            let (base, rest) = (bases[*at], &nodes[*at].rest);
            base.is_some_and(|base| {
                PROPERTIES.iter().any(|property| {
                    let (base, rest) = (part_of(&base, property), part_of(rest, property));
                    !is_near(&base[..property.width()], &rest)
                })
            })
        };
        Self {
            program,
            nodes,
            places: nodes.iter().enumerate().map(|(at, node)| (node.uid, at)).collect(),
            elsewhere: (0..nodes.len()).filter(is_elsewhere).collect(),
            is_plain: bases.iter().all(Option::is_some),
            bases,
            visits: AtomicU64::new(0),
        }
    }

    /// Number of nodes that clips looked at so far: a count of work for tests.
    pub fn visits(&self) -> u64 {
        self.visits.load(Ordering::Relaxed)
    }

    /// Bakes a clip, as [`bake_clip`] does.
    ///
    /// # Errors
    /// As for [`bake_clip`].
    pub fn bake(&self, clip: &RigClip, settings: &BakeSettings) -> Result<Clip, BakeError> {
        let (program, nodes) = (self.program, self.nodes);
        let times = frame_times(clip, nodes.len(), settings)?;
        let mut chosen = self.own_nodes(clip);
        let mut direct = self.direct(clip, &chosen);
        let is_whole = |direct: &[[Option<Channel>; 3]]| direct.as_flattened().iter().all(Option::is_some);
        // Where all parts of the nodes with keys have their channels already, nothing is played, and the others stay at rest.
        let keys: Vec<[JoinedKeys; 3]> = if self.is_plain && is_whole(&direct) {
            vec![Default::default(); chosen.len()]
        } else {
            chosen = (0..nodes.len()).collect();
            direct = self.direct(clip, &chosen);
            let fixed: Vec<[bool; 3]> =
                direct.iter().map(|parts| std::array::from_fn(|part| parts[part].is_some())).collect();
            reduced_keys(PlayedClip::new(program, clip, nodes, &times), &fixed, &settings.tolerance)
        };
        let extras = Some(ClipExtras::of(clip, settings.rate).written());
        let mut baked = Clip { name: clip.name.clone(), extras, ..Clip::default() };
        for ((at, mut kept), mut keys) in chosen.into_iter().zip(direct).zip(keys) {
            for (part, property) in PROPERTIES.iter().enumerate() {
                let channel = kept[part].take().unwrap_or_else(|| {
                    std::mem::take(&mut keys[part]).channel(channel_target(at, property), property.width())
                });
                if !is_at_rest(&channel, &part_of(&nodes[at].rest, property)) {
                    baked.channels.push(channel);
                }
            }
        }
        keep_length(&mut baked, clip.duration());
        Ok(baked)
    }

    /// Places of the nodes that have a channel of their own: those with keys, and those that stand elsewhere in the file.
    fn own_nodes(&self, clip: &RigClip) -> Vec<usize> {
        let keyed = clip.layers.iter().flat_map(|layer| layer.tracks.keys());
        let mut own: Vec<usize> = keyed.filter_map(|track| self.places.get(&track.node).copied()).collect();
        own.extend(&self.elsewhere);
        own.sort_unstable();
        own.dedup();
        own
    }

    /// Channels of some nodes that need no playing: keys as they are, and one key for what has none; `None` where other things
    /// than its keys move a node, or where its keys cannot stay as they are.
    fn direct(&self, clip: &RigClip, chosen: &[usize]) -> Vec<[Option<Channel>; 3]> {
        self.visits.fetch_add(chosen.len() as u64, Ordering::Relaxed);
        let channel = |at: usize, property: &Property| {
            let base = self.bases[at]?;
            let (node, target) = (self.nodes[at].uid, channel_target(at, property));
            let track = TrackTarget { node, property: property.clone() };
            if clip.layers.iter().any(|layer| layer.tracks.contains_key(&track)) {
                return channel_of(clip, node, property, &base, target);
            }
            Some(constant_channel(target, &part_of(&base, property)[..property.width()]))
        };
        chosen.iter().map(|&at| std::array::from_fn(|part| channel(at, &PROPERTIES[part]))).collect()
    }
}

/// Seconds of the frames of a clip from its start.
pub(super) fn frame_times(clip: &RigClip, nodes: usize, settings: &BakeSettings) -> Result<Vec<f32>, BakeError> {
    let BakeSettings { rate, most, .. } = *settings;
    if clip.markers.len() > MAX_MARKERS {
        return Err(BakeError::Markers { count: clip.markers.len() });
    }
    let last = (clip.duration() * rate + 1e-3).floor().max(0.0) as u64;
    let (frames, nodes) = (last.saturating_add(1), nodes as u64);
    if last >= MOST_FRAMES {
        return Err(BakeError::TooLong { frames, rate });
    }
    let transforms = frames.saturating_mul(nodes);
    if transforms > most {
        return Err(BakeError::TooMuch { frames, rate, nodes, transforms, most });
    }
    let mut times: Vec<f32> = (0..frames).map(|frame| frame as f32 / rate).collect();
    // The end lies between frames where the rate is not the clip's own.
    if clip.duration() - times.last().copied().unwrap_or_default() > 1e-4 {
        times.push(clip.duration());
    }
    Ok(times)
}

fn channel_target(at: usize, property: &Property) -> ChannelTarget {
    match property {
        Property::Translation => ChannelTarget::Translation(at),
        Property::Rotation => ChannelTarget::Rotation(at),
        Property::Scale | Property::Attribute(_) => ChannelTarget::Scale(at),
    }
}

/// Numbers of a transform for a property.
pub(super) fn part_of(trs: &Trs, property: &Property) -> [f32; 4] {
    match property {
        Property::Rotation => trs.rotation.to_array(),
        Property::Scale => trs.scale.extend(0.0).to_array(),
        Property::Translation | Property::Attribute(_) => trs.translation.extend(0.0).to_array(),
    }
}

/// Channel of one key.
fn constant_channel(target: ChannelTarget, value: &[f32]) -> Channel {
    Channel { target, interpolation: Interpolation::Linear, times: vec![0.0], values: value.to_vec() }
}

/// Rest transform of a node that nothing but its own keys moves, relative to the same parent in the rig and in the file.
fn plain_base(program: &RigProgram, nodes: &[BakedNode], at: usize) -> Option<Trs> {
    let node = &program.nodes()[program.node(nodes[at].uid)?];
    let parent = node.parent.map(|parent| program.nodes()[parent].uid);
    (node.is_plain() && parent == nodes[at].parent.map(|parent| nodes[parent].uid)).then_some(node.base)
}

/// True if a channel has one key, which is the node's rest.
fn is_at_rest(channel: &Channel, rest: &[f32; 4]) -> bool {
    channel.times.len() == 1 && channel.interpolation != Interpolation::CubicSpline && is_near(&channel.values, rest)
}

/// True if the numbers of a transform's part are those of another one.
fn is_near(values: &[f32], others: &[f32]) -> bool {
    values.iter().zip(others).all(|(a, b)| (a - b).abs() < 1e-6)
}

/// Adds keys to the first channel where no channel has one at the start or the end, so that the clip is as long in a file.
fn keep_length(clip: &mut Clip, duration: f32) {
    let times = || clip.channels.iter().filter_map(|channel| Some([*channel.times.first()?, *channel.times.last()?]));
    let start = times().map(|[first, _]| first).fold(f32::MAX, f32::min);
    let end = times().map(|[_, last]| last).fold(0.0, f32::max);
    let Some(channel) = clip.channels.first_mut() else { return };
    let is_cubic = channel.interpolation == Interpolation::CubicSpline;
    let width = channel.values.len() / channel.times.len().max(1) / if is_cubic { 3 } else { 1 };
    // A held value of a cubic channel leaves and arrives without a tangent.
    let held =
        |key: &[f32]| if is_cubic { [&[0.0; 4][..width], key, &[0.0; 4][..width]].concat() } else { key.to_vec() };
    if start > 1e-4 {
        let key = if is_cubic { &mut channel.values[..2 * width] } else { &mut channel.values[..width] };
        let value = key[key.len() - width..].to_vec();
        if is_cubic {
            key[..width].fill(0.0);
        }
        channel.times.insert(0, 0.0);
        channel.values.splice(0..0, held(&value));
    }
    if end < duration - 1e-4 {
        let from = channel.values.len() - if is_cubic { 2 * width } else { width };
        let value = channel.values[from..from + width].to_vec();
        if is_cubic {
            channel.values[from + width..].fill(0.0);
        }
        channel.times.push(duration);
        channel.values.extend(held(&value));
    }
}
