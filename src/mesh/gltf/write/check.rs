//! Validation of a model before it is written: the code after it may index freely.

use super::{meshes::node_worlds, skeleton::Skeleton};
use crate::mesh::{
    gltf::GltfError,
    model::{ChannelTarget, Interpolation, Model, Part, Weights},
};

/// Inconsistency of a part or of the weights of a model.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
enum ModelFault {
    /// Reference to an object outside the model.
    #[error("refers to an object that is not there")]
    Object,
    /// Reference to a material outside the model.
    #[error("refers to a material that is not there")]
    Material,
    /// Triangle with a vertex outside the part.
    #[error("a triangle refers to a vertex that is not there")]
    Vertex,
    /// Vertex with a point outside the model.
    #[error("a vertex refers to a point that is not there")]
    Point,
    /// Point that is not finite.
    #[error("a point is not finite")]
    PointNumber,
    /// List of attributes of another length than the vertices.
    #[error("a list of attributes is not as long as the vertices")]
    AttributeCount,
    /// Number of morph targets other than that of the object.
    #[error("has another number of morph targets than its object")]
    MorphCount,
    /// Texture coordinate or morph displacement that is not finite.
    #[error("a texture coordinate or morph displacement is not finite")]
    AttributeNumber,
    /// Lists of weights of another length than the points.
    #[error("the weights are not as long as the points")]
    WeightCount,
    /// Weight of a node outside the model.
    #[error("the weights refer to a node that is not there")]
    WeightNode,
    /// Weight that is not finite.
    #[error("a weight is not finite")]
    WeightNumber,
}

/// Checks the model; fails at the first inconsistency.
pub(super) fn check(model: &Model) -> Result<(), GltfError> {
    let fail = |what: String| Err(GltfError::model(what));
    for (i, node) in model.nodes.iter().enumerate() {
        if node.parent.is_some_and(|parent| parent >= i) {
            return fail(format!("node {i} comes before its parent"));
        }
        if !(node.rest.affine().is_finite() && node.rest.rotation.length_squared() > 1e-12) {
            return fail(format!("the rest transform of node {i} is not finite"));
        }
    }
    for (i, skin) in model.skins.iter().enumerate() {
        if skin.joints.len() != skin.inverse_binds.len() {
            return fail(format!("skin {i} has {} joints, {} matrices", skin.joints.len(), skin.inverse_binds.len()));
        }
        if skin.joints.iter().any(|joint| *joint >= model.nodes.len()) {
            return fail(format!("skin {i} refers to a node that is not there"));
        }
        let mut sorted = skin.joints.clone();
        sorted.sort_unstable();
        if sorted.windows(2).any(|pair| pair[0] == pair[1]) {
            return fail(format!("skin {i} lists a node twice"));
        }
        if skin.inverse_binds.iter().any(|matrix| !matrix.is_finite()) {
            return fail(format!("an inverse bind matrix of skin {i} is not finite"));
        }
    }
    for (i, object) in model.objects.iter().enumerate() {
        if object.skin.is_some_and(|skin| skin >= model.skins.len()) {
            return fail(format!("object {i} refers to a skin that is not there"));
        }
        if object.node.is_some_and(|node| node >= model.nodes.len()) {
            return fail(format!("object {i} refers to a node that is not there"));
        }
        if object.skin.is_some() && model.weights.is_none() {
            return fail(format!("object {i} has a skin, but the model has no weights"));
        }
        if !object.morph_weights.is_empty() && object.morph_weights.len() != object.morph_names.len() {
            return fail(format!("object {i} has a wrong number of morph weights"));
        }
        if object.morph_weights.iter().any(|weight| !weight.is_finite()) {
            return fail(format!("a morph weight of object {i} is not finite"));
        }
    }
    for (i, part) in model.parts.iter().enumerate() {
        if let Err(fault) = check_part(model, part) {
            return fail(format!("part {i}: {fault}"));
        }
    }
    if let Some(weights) = &model.weights
        && let Err(fault) = check_weights(weights, model.points.len(), model.nodes.len())
    {
        return fail(fault.to_string());
    }
    check_clips(model)
}

/// Checks that the nodes that are written have finite places, as the reader does: factors and ways add up from node to node.
pub(super) fn check_places(model: &Model, skeleton: &Skeleton) -> Result<(), GltfError> {
    let is_written = |node: &usize| skeleton.node_of[*node].is_some();
    let worlds = node_worlds(model);
    let is_far = |node: &usize| !worlds[*node].as_affine3a().is_finite();
    let Some(node) = (0..model.nodes.len()).filter(is_written).find(is_far) else { return Ok(()) };
    let name = match model.nodes[node].name.as_str() {
        "" => format!("joint {node}"),
        name => format!("joint \"{name}\""),
    };
    Err(GltfError::model(format!(
        "{name} is at no finite place: its numbers and those of the joints above it add up to more than a number \
         can hold; write smaller ones"
    )))
}

fn check_part(model: &Model, part: &Part) -> Result<(), ModelFault> {
    let Some(object) = model.objects.get(part.object) else {
        return Err(ModelFault::Object);
    };
    if part.material.is_some_and(|material| material >= model.material_set.materials.len()) {
        return Err(ModelFault::Material);
    }
    let count = part.vertices.len();
    if part.triangles.iter().flatten().any(|vertex| *vertex as usize >= count) {
        return Err(ModelFault::Vertex);
    }
    for point in &part.vertices {
        match model.points.get(*point as usize) {
            None => return Err(ModelFault::Point),
            Some(point) if !point.is_finite() => return Err(ModelFault::PointNumber),
            Some(_) => {}
        }
    }
    let fits = |length: usize| length == 0 || length == count;
    let lists = [part.normals.len(), part.tangents.len(), part.colors.len()];
    let morphs =
        part.morphs.iter().flat_map(|morph| [morph.positions.len(), morph.normals.len(), morph.tangents.len()]);
    if !lists.into_iter().chain(part.uvs.iter().map(Vec::len)).chain(morphs).all(fits) {
        return Err(ModelFault::AttributeCount);
    }
    if part.morphs.len() != object.morph_names.len() {
        return Err(ModelFault::MorphCount);
    }
    let offsets = |morph: &crate::mesh::model::Morph| {
        morph.positions.iter().chain(&morph.normals).chain(&morph.tangents).all(|offset| offset.is_finite())
    };
    let finite = part.morphs.iter().all(offsets) && part.uvs.iter().flatten().all(|uv| uv.is_finite());
    if finite { Ok(()) } else { Err(ModelFault::AttributeNumber) }
}

fn check_weights(weights: &Weights, points: usize, nodes: usize) -> Result<(), ModelFault> {
    let rising = weights.starts.windows(2).all(|pair| pair[0] <= pair[1]);
    let ends = weights.starts.first() == Some(&0) && weights.starts.last() == Some(&(weights.joints.len() as u32));
    if weights.len() != points || !rising || !ends || weights.joints.len() != weights.values.len() {
        return Err(ModelFault::WeightCount);
    }
    if weights.joints.iter().any(|joint| *joint as usize >= nodes) {
        return Err(ModelFault::WeightNode);
    }
    match weights.values.iter().all(|value| value.is_finite()) {
        true => Ok(()),
        false => Err(ModelFault::WeightNumber),
    }
}

fn check_clips(model: &Model) -> Result<(), GltfError> {
    for (i, clip) in model.clips.iter().enumerate() {
        for channel in &clip.channels {
            let components = match channel.target {
                ChannelTarget::Translation(node) | ChannelTarget::Scale(node) if node < model.nodes.len() => 3,
                ChannelTarget::Rotation(node) if node < model.nodes.len() => 4,
                ChannelTarget::MorphWeights(object) if object < model.objects.len() => {
                    model.objects[object].morph_names.len()
                }
                _ => return Err(GltfError::model(format!("clip {i} refers to something that is not there"))),
            };
            let per_key = components * if channel.interpolation == Interpolation::CubicSpline { 3 } else { 1 };
            if channel.values.len() != channel.times.len() * per_key {
                return Err(GltfError::model(format!("a channel of clip {i} has a wrong number of values")));
            }
            let finite = channel.times.iter().chain(&channel.values).all(|value| value.is_finite());
            let rising = channel.times.windows(2).all(|pair| pair[0] < pair[1]);
            if !finite || !rising || channel.times.first().is_some_and(|time| *time < 0.0) {
                let what = format!("a channel of clip {i} is not finite, or its times do not rise from zero");
                return Err(GltfError::model(what));
            }
        }
    }
    Ok(())
}
