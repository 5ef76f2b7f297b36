//! The built world as plain data, as of a place in the list.

use std::sync::Arc;

use super::world::{Aspect, NodeId, Value, World};
use crate::rig::{BuiltConstraint, BuiltNode, BuiltRig};

pub(super) fn snapshot(world: &World, place: u32) -> BuiltRig {
    let mut alive: Vec<((u32, u32), NodeId)> = Vec::with_capacity(world.slots.len());
    for node in (0..world.slots.len() as u32).map(NodeId) {
        if let Some(birth) = world.birth(node, place) {
            alive.push((world.order_key(node, birth), node));
        }
    }
    alive.sort_unstable_by_key(|(key, _)| *key);
    // Children of every slot, in order; a node whose parent is not there stands below the rig.
    let mut children: Vec<Vec<NodeId>> = vec![Vec::new(); world.slots.len()];
    let mut roots = Vec::new();
    for (_, node) in &alive {
        match world.parent(*node, place).filter(|parent| world.exists(*parent, place)) {
            Some(parent) => children[parent.0 as usize].push(*node),
            None => roots.push(*node),
        }
    }
    let mut nodes = Vec::with_capacity(alive.len());
    let mut stack: Vec<(NodeId, Option<usize>)> = roots.into_iter().rev().map(|node| (node, None)).collect();
    while let Some((node, parent)) = stack.pop() {
        let at = nodes.len();
        nodes.extend(built(world, node, parent, place));
        stack.extend(children[node.0 as usize].iter().rev().map(|child| (*child, Some(at))));
    }
    let (mut constraints, mut switches) = (Vec::new(), Vec::new());
    for (index, slot) in world.slots.iter().enumerate() {
        let Some(creator) = slot.creator else { continue };
        let node = NodeId(index as u32);
        let order = world.places[creator as usize];
        match world.read_at(node, Aspect::Constraint, place) {
            Some(Value::Constraint(number, constraint)) => {
                let command = world.commands[creator as usize];
                let constraint = BuiltConstraint { uid: slot.uid, command, constraint: constraint.clone() };
                constraints.push(((order, *number), constraint));
            }
            _ => {
                if let Some(Value::Switch(number, switch)) = world.read_at(node, Aspect::Switch, place) {
                    switches.push(((order, *number), switch.clone()));
                }
            }
        }
    }
    constraints.sort_by_key(|(key, _)| *key);
    switches.sort_by_key(|(key, _)| *key);
    BuiltRig {
        nodes,
        constraints: constraints.into_iter().map(|(_, constraint)| constraint).collect(),
        switches: switches.into_iter().map(|(_, switch)| switch).collect(),
    }
}

fn built(world: &World, node: NodeId, parent: Option<usize>, place: u32) -> Option<BuiltNode> {
    let birth = world.birth(node, place)?;
    let control = match world.read_at(node, Aspect::Control, place) {
        Some(Value::Control(control)) => Some(control.clone()),
        _ => None,
    };
    let layer = match world.read_at(node, Aspect::Layer, place) {
        Some(Value::Layer(layer)) => Some(layer.clone()),
        _ => None,
    };
    let attributes = match world.read_at(node, Aspect::Attributes, place) {
        Some(Value::Attributes(attributes)) => attributes.clone(),
        _ => Arc::new([]),
    };
    Some(BuiltNode {
        uid: world.uid(node),
        name: world.name(node, place).into(),
        kind: birth.kind,
        parent,
        base: world.base(node, place),
        label: world.label(node, place).cloned(),
        group: world.group(node, place),
        origin: birth.origin.clone(),
        control,
        layer,
        attributes,
    })
}
