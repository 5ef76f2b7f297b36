//! Animations of clips, for the nodes and objects that are written.

use serde_json::{Map, Value};

use super::{
    buffer::{Bin, Target},
    insert_list, insert_name,
    skeleton::Skeleton,
};
use crate::mesh::model::{ChannelTarget, Interpolation, Model};

pub(super) fn write(model: &Model, skeleton: &Skeleton, node_of_object: &[Option<usize>], bin: &mut Bin) -> Vec<Value> {
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
            let mut sampler = Map::new();
            sampler.insert("input".to_owned(), bin.times(&channel.times).into());
            let interpolation = match channel.interpolation {
                Interpolation::Linear => "LINEAR",
                Interpolation::Step => "STEP",
                Interpolation::CubicSpline => "CUBICSPLINE",
            };
            sampler.insert("interpolation".to_owned(), interpolation.into());
            sampler.insert("output".to_owned(), output.into());
            let mut target = Map::new();
            target.insert("node".to_owned(), node.into());
            target.insert("path".to_owned(), path.into());
            let mut map = Map::new();
            map.insert("sampler".to_owned(), samplers.len().into());
            map.insert("target".to_owned(), target.into());
            channels.push(map);
            samplers.push(sampler);
        }
        if channels.is_empty() {
            continue;
        }
        let mut animation = Map::new();
        insert_name(&mut animation, &clip.name);
        insert_list(&mut animation, "channels", channels);
        insert_list(&mut animation, "samplers", samplers);
        if let Some(extras) = &clip.extras {
            animation.insert("extras".to_owned(), extras.clone());
        }
        animations.push(animation.into());
    }
    animations
}
