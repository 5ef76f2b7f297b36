//! Animations of clips, for the nodes and objects that are written.

use super::{
    buffer::{Bin, Target},
    document::{AnimatedProperty, Animation, Channel, Sampler},
    skeleton::Skeleton,
};
use crate::mesh::model::{ChannelTarget, Interpolation, Model};

pub(super) fn write<'a>(
    model: &'a Model,
    skeleton: &Skeleton,
    node_of_object: &[Option<usize>],
    bin: &mut Bin,
) -> Vec<Animation<'a>> {
    let mut animations = Vec::new();
    for clip in &model.clips {
        let (mut channels, mut samplers) = (Vec::new(), Vec::new());
        for channel in clip.channels.iter().filter(|channel| !channel.times.is_empty() && !channel.values.is_empty()) {
            let (node, path) = match channel.target {
                ChannelTarget::Translation(node) => (skeleton.node_of[node], "translation"),
                ChannelTarget::Rotation(node) => (skeleton.node_of[node], "rotation"),
                ChannelTarget::Scale(node) => (skeleton.node_of[node], "scale"),
                ChannelTarget::MorphWeights(object) => (node_of_object[object], "weights"),
            };
            let Some(node) = node else {
                continue;
            };
            let output = match path {
                "rotation" => bin.floats(channel.values.as_chunks::<4>().0, Target::Other),
                "weights" => bin.floats(channel.values.as_chunks::<1>().0, Target::Other),
                _ => bin.floats(channel.values.as_chunks::<3>().0, Target::Other),
            };
            let input = bin.times(&channel.times);
            let interpolation = match channel.interpolation {
                Interpolation::Linear => "LINEAR",
                Interpolation::Step => "STEP",
                Interpolation::CubicSpline => "CUBICSPLINE",
            };
            channels.push(Channel { sampler: samplers.len(), target: AnimatedProperty { node, path } });
            samplers.push(Sampler { input, interpolation, output });
        }
        if channels.is_empty() {
            continue;
        }
        animations.push(Animation { name: &clip.name, channels, samplers, extras: clip.extras.as_ref() });
    }
    animations
}
