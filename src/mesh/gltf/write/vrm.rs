//! Extensions of an avatar, with the indices of the file.

use serde::Serialize;
use serde_json::{Map, Value};

use super::{document::Node, skeleton::Skeleton};
use crate::mesh::{gltf::GltfError, model::Model, vrm::Avatar};

/// Extension of the figure.
const FIGURE: &str = "VRMC_vrm";
/// Extension of springs.
const SPRINGS: &str = "VRMC_springBone";
/// Extension of constraints, which are at their nodes.
pub(super) const CONSTRAINT: &str = "VRMC_node_constraint";
/// Extensions of avatars.
pub(super) const NAMES: [&str; 3] = [FIGURE, SPRINGS, CONSTRAINT];

/// Extensions of the document; constraints are added to their nodes.
pub(super) fn write(
    avatar: &Avatar,
    model: &Model,
    skeleton: &Skeleton,
    node_of_object: &[Option<usize>],
    nodes: &mut [Node<'_>],
) -> Result<Map<String, Value>, GltfError> {
    check(avatar, model)?;
    let node = |node: usize| skeleton.node_of.get(node).copied().flatten();
    let object = |object: usize| node_of_object.get(object).copied().flatten();
    let outside = || GltfError::model("the avatar refers to a node that is not there or is not written");
    let avatar = avatar.renumbered(&node, &object).ok_or_else(outside)?;
    let mut extensions = Map::new();
    extensions.insert(FIGURE.to_owned(), value(&avatar.vrm)?);
    if !avatar.springs.springs.is_empty() {
        extensions.insert(SPRINGS.to_owned(), value(&avatar.springs)?);
    }
    for (at, constraint) in &avatar.constraints {
        let Some(node) = nodes.get_mut(*at) else { return Err(outside()) };
        let own = Map::from_iter([(CONSTRAINT.to_owned(), value(constraint)?)]);
        node.extensions = Some(Box::new(own.into()));
    }
    Ok(extensions)
}

/// Checks places in lists, which other programs take as they are.
fn check(avatar: &Avatar, model: &Model) -> Result<(), GltfError> {
    let expressions = &avatar.vrm.expressions;
    for (name, expression) in expressions.preset.iter().chain(&expressions.custom) {
        let is_there = |bind: &crate::mesh::vrm::MorphTargetBind| {
            model.objects.get(bind.node).is_some_and(|object| bind.index < object.morph_names.len())
        };
        if !expression.morph_target_binds.iter().all(is_there) {
            return Err(GltfError::model(format!("expression \"{name}\" refers to a morph target that is not there")));
        }
    }
    let springs = &avatar.springs;
    let are_below = |places: &[usize], count: usize| places.iter().all(|place| *place < count);
    let groups = springs.collider_groups.iter().all(|group| are_below(&group.colliders, springs.colliders.len()));
    let chains = springs.springs.iter().all(|chain| are_below(&chain.collider_groups, springs.collider_groups.len()));
    if groups && chains {
        return Ok(());
    }
    Err(GltfError::model("a spring refers to a collider that is not there"))
}

/// JSON of a part of the avatar. By way of its text, numbers are as short as they can be.
fn value(part: &impl Serialize) -> Result<Value, GltfError> {
    let text = serde_json::to_vec(part).map_err(|error| GltfError::model(error.to_string()))?;
    serde_json::from_slice(&text).map_err(|error| GltfError::model(error.to_string()))
}
