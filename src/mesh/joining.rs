//! Joined models: the meshes of one character in one model, as files hold them.

use super::{
    gltf::append_materials,
    model::{ChannelTarget, Model, Object, SkinBinding, Weights},
};

impl Model {
    /// Appends the meshes of a model that has the same nodes: objects, points, materials, bind poses, weights and clips.
    /// Equal bind poses are shared; clips of one name stay two. The name and the nodes stay; a node that is a joint in one
    /// of the models is one in the result.
    ///
    /// Both models together have less than 2^32 points. Linear in their size.
    pub fn append(&mut self, other: Self) {
        let (objects, points) = (self.objects.len(), self.points.len());
        let materials = self.material_set.materials.len();
        append_materials(&mut self.material_set, other.material_set);
        append_weights(&mut self.weights, points, other.weights, other.points.len());
        let skins: Vec<usize> = other.skins.into_iter().map(|skin| place_of(&mut self.skins, skin)).collect();
        self.points.extend(other.points);
        self.objects.extend(
            other.objects.into_iter().map(|object| Object { skin: object.skin.map(|skin| skins[skin]), ..object }),
        );
        for mut part in other.parts {
            part.object += objects;
            part.material = part.material.map(|material| material + materials);
            part.vertices.iter_mut().for_each(|point| *point += points as u32);
            self.parts.push(part);
        }
        for (node, same) in self.nodes.iter_mut().zip(other.nodes) {
            node.joint |= same.joint;
            node.extras = node.extras.take().or(same.extras);
        }
        for mut clip in other.clips {
            for channel in &mut clip.channels {
                if let ChannelTarget::MorphWeights(object) = &mut channel.target {
                    *object += objects;
                }
            }
            self.clips.push(clip);
        }
        self.notes.extend(other.notes);
    }
}

/// Index of a bind pose among others, which it is added to if none of them is equal.
fn place_of(skins: &mut Vec<SkinBinding>, skin: SkinBinding) -> usize {
    skins.iter().position(|known| *known == skin).unwrap_or_else(|| {
        skins.push(skin);
        skins.len() - 1
    })
}

/// Appends the influences of `added` points to those of `points` points. Points of a model without weights have none, and
/// influences of points that a model does not have are left out.
fn append_weights(weights: &mut Option<Weights>, points: usize, other: Option<Weights>, added: usize) {
    if weights.is_none() && other.is_none() {
        return;
    }
    let weights = weights.get_or_insert_with(Weights::default);
    fit_to_points(weights, points);
    let mut other = other.unwrap_or_default();
    fit_to_points(&mut other, added);
    let first = weights.joints.len() as u32;
    weights.starts.extend(other.starts.iter().skip(1).map(|start| first + start));
    weights.joints.extend(other.joints);
    weights.values.extend(other.values);
}

/// Gives weights one row for each point. Weights of a mesh whose file has changed may have more, fewer or none.
fn fit_to_points(weights: &mut Weights, points: usize) {
    let end = weights.starts.get(points).or(weights.starts.last()).copied().unwrap_or(0);
    weights.starts.resize(points + 1, end);
    weights.joints.truncate(end as usize);
    weights.values.truncate(end as usize);
}
