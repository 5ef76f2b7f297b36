//! Clips baked into transforms of nodes, for files that have neither controls nor constraints.

use std::sync::Arc;

use super::{
    program::{RigProgram, RigState},
    reduction::{SampledNode, reduce_skeleton},
};
use crate::{
    mesh::model::{Channel, ChannelTarget, Clip, Interpolation, Trs},
    rig::{
        Uid,
        animation::{Key, Property, RigClip, SampledPose, TrackTarget, clip_extras::ClipExtras, file_clip::channel_of},
        operations::KeyTolerance,
    },
};

/// Most frames of a baked clip.
const MOST_FRAMES: usize = 1_000_000;

/// Most transforms of a baked clip: one for each frame and node.
pub const MOST_TRANSFORMS: usize = 8 << 20;

/// Reason for not baking a clip.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum BakeError {
    /// More frames than there is memory for.
    #[error(
        "the clip has {frames} frames at {rate} frames a second, and no more than {most} are baked for {nodes} nodes; \
         shorten its range, or bake fewer frames a second"
    )]
    TooLong {
        /// Number of frames.
        frames: u64,
        /// Frames a second.
        rate: f32,
        /// Largest number of frames.
        most: usize,
        /// Number of nodes.
        nodes: usize,
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
/// # Errors
/// A clip with more frames than there is memory for: see [`MOST_TRANSFORMS`].
pub fn bake_clip(
    program: &Arc<RigProgram>,
    clip: &RigClip,
    nodes: &[BakedNode],
    rate: f32,
    tolerance: &KeyTolerance,
) -> Result<Clip, BakeError> {
    let (times, sampled) = sample_nodes(program, clip, nodes, rate)?;
    let properties = [Property::Translation, Property::Rotation, Property::Scale];
    let channel = |at: usize, property: &Property| {
        let base = plain_base(program, nodes, at)?;
        let (node, target) = (nodes[at].uid, channel_target(at, property));
        let track = TrackTarget { node, property: property.clone() };
        if clip.layers.iter().any(|layer| layer.tracks.contains_key(&track)) {
            return channel_of(clip, node, property, &base, target);
        }
        let key = Key { value: part_of(&base, property), ..Key::number(0.0, 0.0) };
        Some(keyed_channel(target, property.width(), &[key]))
    };
    let mut direct: Vec<[Option<Channel>; 3]> =
        (0..nodes.len()).map(|at| std::array::from_fn(|part| channel(at, &properties[part]))).collect();
    let fixed: Vec<[bool; 3]> = direct.iter().map(|parts| std::array::from_fn(|part| parts[part].is_some())).collect();
    let keys = reduce_skeleton(&times, &sampled, &fixed, tolerance);
    let extras = Some(ClipExtras::of(clip, rate).written());
    let mut baked = Clip { name: clip.name.clone(), extras, ..Clip::default() };
    for (at, (node, mut keys)) in nodes.iter().zip(keys).enumerate() {
        for (part, property) in properties.iter().enumerate() {
            let kept = direct[at][part].take();
            let channel = kept.unwrap_or_else(|| {
                keyed_channel(channel_target(at, property), property.width(), &std::mem::take(&mut keys[part]))
            });
            if !is_at_rest(&channel, &part_of(&node.rest, property)) {
                baked.channels.push(channel);
            }
        }
    }
    keep_length(&mut baked, clip.duration());
    Ok(baked)
}

/// Transforms of nodes relative to their parents, frame by frame, with the times of the frames.
pub(super) fn sample_nodes(
    program: &Arc<RigProgram>,
    clip: &RigClip,
    nodes: &[BakedNode],
    rate: f32,
) -> Result<(Vec<f32>, Vec<SampledNode>), BakeError> {
    let mut state = RigState::new(program.clone());
    let last = (clip.duration() * rate + 1e-3).floor().max(0.0);
    let most = MOST_FRAMES.min(MOST_TRANSFORMS / nodes.len().max(1));
    if last >= most as f32 {
        return Err(BakeError::TooLong { frames: (last as u64).saturating_add(1), rate, most, nodes: nodes.len() });
    }
    let count = last as usize;
    let mut times: Vec<f32> = (0..=count).map(|frame| frame as f32 / rate).collect();
    // The end lies between frames where the rate is not the clip's own.
    if clip.duration() - times.last().copied().unwrap_or_default() > 1e-4 {
        times.push(clip.duration());
    }
    let mut locals: Vec<Vec<Trs>> = vec![Vec::with_capacity(times.len()); nodes.len()];
    for time in &times {
        strike(&mut state, &clip.sample(clip.range[0] + time));
        let globals: Vec<Option<Trs>> = nodes.iter().map(|node| state.global(node.uid)).collect();
        for (at, node) in nodes.iter().enumerate() {
            let local = match (globals[at], node.parent) {
                (Some(global), None) => global,
                (Some(global), Some(parent)) => globals[parent].map_or(node.rest, |parent| global.relative_to(&parent)),
                (None, _) => node.rest,
            };
            locals[at].push(local);
        }
    }
    let sampled = nodes
        .iter()
        .zip(locals)
        .map(|(node, locals)| SampledNode { parent: node.parent, locals: same_side(locals, node.rest.rotation) })
        .collect();
    Ok((times, sampled))
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

/// Transforms whose first rotation lies on the side of that at rest.
fn same_side(mut locals: Vec<Trs>, rest: glam::Quat) -> Vec<Trs> {
    if let Some(first) = locals.first_mut().filter(|first| first.rotation.dot(rest) < 0.0) {
        first.rotation = -first.rotation;
    }
    locals
}

/// Channel of linear keys.
fn keyed_channel(target: ChannelTarget, width: usize, keys: &[Key]) -> Channel {
    Channel {
        target,
        interpolation: Interpolation::Linear,
        times: keys.iter().map(|key| key.time).collect(),
        values: keys.iter().flat_map(|key| key.value[..width].iter().copied()).collect(),
    }
}

/// Rest transform of a node that nothing but its own keys moves, relative to the same parent in the rig and in the file.
fn plain_base(program: &RigProgram, nodes: &[BakedNode], at: usize) -> Option<Trs> {
    let node = &program.nodes()[program.node(nodes[at].uid)?];
    let parent = node.parent.map(|parent| program.nodes()[parent].uid);
    (node.is_plain() && parent == nodes[at].parent.map(|parent| nodes[parent].uid)).then_some(node.base)
}

/// True if a channel has one key, which is the node's rest.
fn is_at_rest(channel: &Channel, rest: &[f32; 4]) -> bool {
    channel.times.len() == 1
        && channel.interpolation != Interpolation::CubicSpline
        && channel.values.iter().zip(rest).all(|(a, b)| (a - b).abs() < 1e-6)
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
