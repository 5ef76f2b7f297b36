//! Entities for the nodes of an instance.

use std::{collections::HashSet, sync::Arc};

use bevy::prelude::*;

use super::{ControlPose, InstanceMode, NodeOf, NodeSlot, RigNodes, RigRuntime};
use crate::{mesh::model::Trs, rig::NodeType, solve::program::RigProgram};

/// Makes an entity an instance of a program: spawns the entities of its nodes that the mode needs, and inserts a
/// [`RigRuntime`] and, if it is missing, a `Transform`.
pub fn spawn_instance(world: &mut World, rig: Entity, program: &Arc<RigProgram>, mode: InstanceMode) {
    let runtime = RigRuntime::new(Arc::clone(program), mode);
    world.entity_mut(rig).insert_if_new(Transform::IDENTITY).insert(runtime);
    furnish_instance(world, rig);
}

/// Spawns the entities that an instance's nodes lack, puts all below their parents, and despawns those of nodes that its
/// program does not have.
pub fn furnish_instance(world: &mut World, rig: Entity) {
    let Some(mut runtime) = world.get_mut::<RigRuntime>(rig).map(|mut found| found.bypass_change_detection().clone())
    else {
        return;
    };
    let (program, mode) = (Arc::clone(runtime.state.program()), runtime.mode);
    for (slot, node) in program.nodes().iter().enumerate() {
        let known = runtime.entity(slot).filter(|entity| world.get_entity(*entity).is_ok());
        let entity = match mode {
            InstanceMode::Hierarchy => {
                let parent = node.parent.and_then(|parent| runtime.entity(parent)).unwrap_or(rig);
                if let Some(entity) = known {
                    if world.get::<ChildOf>(entity).map(ChildOf::parent) != Some(parent) {
                        world.entity_mut(entity).insert(ChildOf(parent));
                    }
                    world.entity_mut(entity).insert(NodeSlot(slot as u32));
                    continue;
                }
                let own = (NodeSlot(slot as u32), NodeOf(rig), node.uid);
                world.spawn((own, transform(&node.base), ChildOf(parent))).id()
            }
            InstanceMode::Direct => {
                let is_joint = node.kind == NodeType::Joint;
                if let Some(entity) = known {
                    world.entity_mut(entity).insert(NodeSlot(slot as u32));
                    continue;
                }
                if !is_joint && !node.is_posable() {
                    continue;
                }
                let mut entity = world.spawn((NodeSlot(slot as u32), NodeOf(rig), node.uid));
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
    let alive: HashSet<Entity> = runtime.nodes.iter().flatten().copied().collect();
    let nodes = world.get::<RigNodes>(rig).map(|nodes| nodes.iter().collect::<Vec<_>>()).unwrap_or_default();
    let is_own = |entity: &Entity| world.get::<NodeSlot>(*entity).is_some();
    let gone: Vec<Entity> = nodes.into_iter().filter(|entity| !alive.contains(entity) && is_own(entity)).collect();
    for entity in gone {
        // What others hung on it stays, on the rig.
        let hung: Vec<Entity> = world.get::<Children>(entity).map(|hung| hung.to_vec()).unwrap_or_default();
        for child in hung {
            world.entity_mut(child).insert(ChildOf(rig));
        }
        world.despawn(entity);
    }
    if let Some(mut found) = world.get_mut::<RigRuntime>(rig) {
        *found = runtime;
    }
}

/// Converts a transform to Bevy's type.
pub(super) fn transform(trs: &Trs) -> Transform {
    Transform { translation: trs.translation, rotation: trs.rotation, scale: trs.scale }
}
