//! Entities for the nodes of an instance.

use std::{collections::HashSet, sync::Arc};

use bevy::{prelude::*, transform::components::TransformTreeChanged};

use super::{ControlPose, InstanceMode, NodeOf, NodeSlot, RigNodes, RigRuntime};
use crate::{
    mesh::model::Trs,
    plugins::schema::{Joint, NodeLabel, Null},
    rig::{NodeType, RestTransform},
    solve::program::{ProgramNode, RigProgram},
};

/// Makes an entity an instance of a program: spawns the entities of its nodes that the mode needs, with the components of
/// the [`schema`](crate::plugins::schema) that a program knows, and inserts a [`RigRuntime`] and, if it is missing, a `Transform`.
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
                    let mut entity = world.entity_mut(entity);
                    number_node(&mut entity, slot);
                    describe_node(&mut entity, node, mode);
                    continue;
                }
                let own = (NodeSlot(slot as u32), NodeOf(rig), node.uid, RestTransform::from(node.base));
                let mut entity = world.spawn((own, transform(&node.base), ChildOf(parent)));
                describe_node(&mut entity, node, mode);
                entity.id()
            }
            InstanceMode::Direct => {
                let is_joint = node.kind == NodeType::Joint;
                if let Some(entity) = known {
                    let mut entity = world.entity_mut(entity);
                    number_node(&mut entity, slot);
                    describe_node(&mut entity, node, mode);
                    // A joint that was not exposed before.
                    if node.is_posable() && !entity.contains::<ControlPose>() {
                        entity.insert(ControlPose::default());
                    }
                    continue;
                }
                if !is_joint && !node.is_posable() {
                    continue;
                }
                let own = (NodeSlot(slot as u32), NodeOf(rig), node.uid, RestTransform::from(node.base));
                let mut entity = world.spawn(own);
                describe_node(&mut entity, node, mode);
                if is_joint {
                    entity.insert_if_new(GlobalTransform::IDENTITY);
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

/// Writes the slot of a node where it is another.
fn number_node(entity: &mut EntityWorldMut, slot: usize) {
    let slot = NodeSlot(slot as u32);
    if entity.get::<NodeSlot>() != Some(&slot) {
        entity.insert(slot);
    }
}

/// Writes the components that describe a node where they differ.
fn describe_node(entity: &mut EntityWorldMut, node: &ProgramNode, mode: InstanceMode) {
    let (is_joint, is_null) = (node.kind == NodeType::Joint, node.kind == NodeType::Null);
    if entity.contains::<Joint>() != is_joint {
        if is_joint {
            entity.insert(Joint);
        } else {
            entity.remove::<Joint>();
        }
    }
    if mode == InstanceMode::Direct && entity.contains::<Transform>() {
        // World transforms are written at once, so that joints need no local ones.
        entity.remove::<(Transform, TransformTreeChanged)>();
    }
    if entity.contains::<Null>() != is_null {
        if is_null {
            entity.insert(Null);
        } else {
            entity.remove::<Null>();
        }
    }
    let rest = RestTransform::from(node.base);
    if entity.get::<RestTransform>() != Some(&rest) {
        entity.insert(rest);
    }
    let label = entity.get::<NodeLabel>().map(|label| label.0.as_str());
    match &node.label {
        known if known.as_deref() == label => {}
        Some(label) => {
            entity.insert(NodeLabel(label.to_string()));
        }
        None => {
            entity.remove::<NodeLabel>();
        }
    }
}

/// Converts a transform to Bevy's type.
pub(super) fn transform(trs: &Trs) -> Transform {
    Transform { translation: trs.translation, rotation: trs.rotation, scale: trs.scale }
}
