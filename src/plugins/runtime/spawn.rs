//! Entities for the nodes of an instance.

use std::sync::Arc;

use bevy::prelude::*;

use super::{ControlPose, InstanceMode, NodeOf, NodeSlot, RigRuntime};
use crate::{mesh::model::Trs, rig::NodeType, solve::program::RigProgram};

/// Makes an entity an instance of a program: spawns the entities of its nodes that the mode needs, and inserts a
/// [`RigRuntime`] and, if it is missing, a `Transform`.
pub fn spawn_instance(world: &mut World, rig: Entity, program: &Arc<RigProgram>, mode: InstanceMode) {
    let mut runtime = RigRuntime::new(Arc::clone(program), mode);
    for (slot, node) in program.nodes().iter().enumerate() {
        let own = (NodeSlot(slot as u32), NodeOf(rig), node.uid);
        let entity = match mode {
            InstanceMode::Hierarchy => {
                let parent = node.parent.and_then(|parent| runtime.entity(parent)).unwrap_or(rig);
                world.spawn((own, transform(&node.base), ChildOf(parent))).id()
            }
            InstanceMode::Direct => {
                let is_joint = node.kind == NodeType::Joint;
                if !is_joint && !node.is_posable() {
                    continue;
                }
                let mut entity = world.spawn(own);
                if is_joint {
                    entity.insert(GlobalTransform::IDENTITY);
                }
                if node.is_posable() {
                    entity.insert(ControlPose::default());
                }
                entity.id()
            }
        };
        runtime.attach(slot, entity);
        if let Some(shown) = runtime.shown.get_mut(slot) {
            *shown = transform(&node.base);
        }
    }
    world.entity_mut(rig).insert_if_new(Transform::IDENTITY).insert(runtime);
}

/// Converts a transform to Bevy's type.
pub(super) fn transform(trs: &Trs) -> Transform {
    Transform { translation: trs.translation, rotation: trs.rotation, scale: trs.scale }
}
