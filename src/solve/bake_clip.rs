//! Clips baked into transforms of nodes, for files that have neither controls nor constraints.

use std::sync::Arc;

use super::program::{RigProgram, RigState};
use crate::{
    mesh::model::{Channel, ChannelTarget, Clip, Interpolation, Trs},
    rig::{
        Uid,
        animation::{Key, Property, RigClip, SampledPose, Track, file_clip::channel_of},
        operations::KeyTolerance,
    },
};

/// Most frames of a baked clip.
const FRAMES: f32 = 1e6;

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
/// the nodes. Channels that stay at rest are left out, and keys without which a channel stays within the tolerance. A node that
/// nothing but its keys moves keeps them as they are.
///
/// Time starts at zero with the clip. Takes some tens of microseconds a frame for a character.
pub fn bake_clip(
    program: &Arc<RigProgram>,
    clip: &RigClip,
    nodes: &[BakedNode],
    rate: f32,
    tolerance: &KeyTolerance,
) -> Clip {
    let mut state = RigState::new(program.clone());
    let count = (clip.duration() * rate + 1e-3).floor().clamp(0.0, FRAMES) as usize;
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
    let mut baked = Clip { name: clip.name.clone(), ..Clip::default() };
    for (at, (node, locals)) in nodes.iter().zip(&locals).enumerate() {
        let base = plain_base(program, nodes, at);
        let vector = |v: glam::Vec3| [v.x, v.y, v.z, 0.0];
        let mut last = node.rest.rotation;
        let rotation = |local: &Trs| {
            let turn = if local.rotation.dot(last) < 0.0 { -local.rotation } else { local.rotation };
            last = turn;
            turn.to_array()
        };
        let properties = [
            (
                Property::Translation,
                vector(node.rest.translation),
                locals.iter().map(|at| vector(at.translation)).collect(),
            ),
            (Property::Rotation, node.rest.rotation.to_array(), locals.iter().map(rotation).collect::<Vec<[f32; 4]>>()),
            (Property::Scale, vector(node.rest.scale), locals.iter().map(|at| vector(at.scale)).collect()),
        ];
        for (property, rest, values) in properties {
            let target = match property {
                Property::Translation => ChannelTarget::Translation(at),
                Property::Rotation => ChannelTarget::Rotation(at),
                Property::Scale | Property::Attribute(_) => ChannelTarget::Scale(at),
            };
            if let Some(channel) = base.and_then(|base| channel_of(clip, node.uid, &property, &base, target)) {
                if !is_at_rest(&channel, &rest) {
                    baked.channels.push(channel);
                }
                continue;
            }
            let key = |(time, value): (&f32, &[f32; 4])| Key { time: *time, value: *value, ..Key::number(*time, 0.0) };
            let track = Track { keys: times.iter().zip(&values).map(key).collect() };
            let keys = tolerance.reduced(&track, &property);
            if let [only] = keys[..]
                && only.value.iter().zip(rest).all(|(a, b)| (a - b).abs() < 1e-6)
            {
                continue;
            }
            baked.channels.push(Channel {
                target,
                interpolation: Interpolation::Linear,
                times: keys.iter().map(|key| key.time).collect(),
                values: keys.iter().flat_map(|key| key.value[..property.width()].to_vec()).collect(),
            });
        }
    }
    keep_length(&mut baked, clip.duration());
    baked
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
