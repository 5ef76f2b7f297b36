//! Morph targets and clips of faces, added to a model.

use bevy::math::Vec3;

use crate::{
    mesh::model::{Channel, ChannelTarget, Clip, Interpolation, Model, Morph},
    plugins::face::FaceShape,
    rig::{Rig, StoredPose},
};

/// Adds shapes as morph targets to the objects that they move. Targets that an object has already stay as they are.
pub(super) fn add_morphs(model: &mut Model, shapes: &[FaceShape]) {
    for number in 0..model.objects.len() {
        let mut parts: Vec<_> = model.parts.iter_mut().filter(|part| part.object == number).collect();
        let moves = |shape: &FaceShape| {
            parts.iter().flat_map(|part| &part.vertices).any(|point| shape.offset(*point) != Vec3::ZERO)
        };
        if !shapes.iter().any(moves) {
            continue;
        }
        let object = &mut model.objects[number];
        let before = object.morph_names.len();
        for shape in shapes.iter().filter(|shape| !object.morph_names.contains(&shape.name)).collect::<Vec<_>>() {
            for part in &mut parts {
                let mut positions: Vec<Vec3> = part.vertices.iter().map(|point| shape.offset(*point)).collect();
                // A part that stays where it is has no list of zeros.
                if positions.iter().all(|offset| *offset == Vec3::ZERO) {
                    positions = Vec::new();
                }
                part.morphs.push(Morph { positions, ..Morph::default() });
            }
            object.morph_names.push(shape.name.clone());
            if !object.morph_weights.is_empty() {
                object.morph_weights.push(0.0);
            }
        }
        let added = object.morph_names.len() - before;
        widen_keys(&mut model.clips, number, before, added);
    }
}

/// Adds zeros for the added morph targets of an object to the keys of clips that move those it had before.
fn widen_keys(clips: &mut [Clip], object: usize, before: usize, added: usize) {
    if before == 0 || added == 0 {
        return;
    }
    let channels = clips.iter_mut().flat_map(|clip| &mut clip.channels);
    for channel in channels.filter(|channel| channel.target == ChannelTarget::MorphWeights(object)) {
        // Tangents of cubic splines are rows of their own.
        let mut values = Vec::with_capacity(channel.values.len() / before * (before + added));
        for row in channel.values.chunks(before) {
            values.extend_from_slice(row);
            values.extend(std::iter::repeat_n(0.0, added));
        }
        channel.values = values;
    }
}

/// A clip of one frame for each stored pose.
pub(super) fn clips(rig: &Rig) -> Vec<Clip> {
    let joints: Vec<_> = rig.walk().map(|joint| &joint.data).collect();
    let clip = |stored: &StoredPose| {
        let mut channels = Vec::new();
        for (node, joint) in joints.iter().enumerate() {
            let Some(offset) = stored.offsets.get(&joint.uid) else { continue };
            let posed = offset.on(&joint.rest);
            let mut add = |target: ChannelTarget, values: Vec<f32>| {
                channels.push(Channel { target, interpolation: Interpolation::Linear, times: vec![0.0], values });
            };
            add(ChannelTarget::Translation(node), posed.translation.to_array().to_vec());
            add(ChannelTarget::Rotation(node), posed.rotation.to_array().to_vec());
            if posed.scale != joint.rest.scale {
                add(ChannelTarget::Scale(node), posed.scale.to_array().to_vec());
            }
        }
        Clip { name: stored.name.clone(), channels, extras: None }
    };
    rig.stored_poses().iter().map(clip).collect()
}
