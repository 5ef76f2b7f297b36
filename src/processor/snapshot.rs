//! The built world as plain data, as of a place in the list.

use std::sync::{Arc, LazyLock};

use bevy::platform::collections::{HashMap, HashSet};

use super::world::{Aspect, NodeId, Value, World};
use crate::{
    mesh::model::Trs,
    rig::{Attribute, BuiltConstraint, BuiltInput, BuiltNode, BuiltRig, Uid},
};

/// The last snapshot, and what has changed in the world since.
#[derive(Default)]
pub(super) struct BuiltCache {
    last: Option<Last>,
    /// Nodes and constraints with changed values, if nothing else has changed.
    changed: HashSet<NodeId>,
}

struct Last {
    built: Arc<BuiltRig>,
    place: u32,
    nodes: HashMap<Uid, usize>,
    /// Index of each constraint, with its number among those of its command.
    constraints: HashMap<Uid, (usize, u32)>,
}

impl BuiltCache {
    /// Most changed values for which reading them one by one is worth while.
    const FEW: usize = 64;

    /// Drops the snapshot: places of commands have changed.
    pub fn forget(&mut self) {
        self.last = None;
        self.changed.clear();
    }

    /// Notes a changed value. Names depend on labels and on births, the order of nodes on parents.
    pub fn note(&mut self, node: NodeId, aspect: Aspect) {
        if aspect.is_structure() || aspect == Aspect::Switch {
            self.forget();
        } else if self.last.is_some() {
            self.changed.insert(node);
        }
    }

    /// The snapshot as of a place.
    pub fn refresh(&mut self, world: &World, place: u32) -> Arc<BuiltRig> {
        let changed = std::mem::take(&mut self.changed);
        let is_known = |last: &&mut Last| last.place == place && changed.len() <= Self::FEW;
        if let Some(last) = self.last.as_mut().filter(is_known)
            && (changed.is_empty() || last.patch(world, &changed).is_some())
        {
            debug_assert!(*last.built == snapshot(world, place), "a patched snapshot differs from a fresh one");
            return Arc::clone(&last.built);
        }
        let built = Arc::new(snapshot(world, place));
        let number = |uid: Uid| match world.read_at(world.id(uid)?, Aspect::Constraint, place) {
            Some(Value::Constraint(number, _)) => Some(*number),
            _ => None,
        };
        let constraints = built.constraints.iter().enumerate();
        let last = Last {
            place,
            nodes: built.nodes.iter().enumerate().map(|(at, node)| (node.uid, at)).collect(),
            constraints: constraints
                .filter_map(|(at, constraint)| Some((constraint.uid, (at, number(constraint.uid)?))))
                .collect(),
            built: Arc::clone(&built),
        };
        self.last = Some(last);
        built
    }
}

impl Last {
    /// Reads changed values again; `None` if something was there before that is not now, or the other way round.
    fn patch(&mut self, world: &World, changed: &HashSet<NodeId>) -> Option<()> {
        let mut built = BuiltRig::clone(&self.built);
        for id in changed {
            let uid = world.uid(*id);
            let node = self.nodes.get(&uid);
            if let Some(at) = node {
                let node = built.nodes.get_mut(*at)?;
                read_values(world, *id, self.place, node);
            }
            match (world.read_at(*id, Aspect::Constraint, self.place), self.constraints.get(&uid)) {
                (Some(Value::Constraint(number, constraint)), Some((at, before))) if number == before => {
                    built.constraints.get_mut(*at)?.constraint = Arc::clone(constraint);
                }
                (None, None) => {}
                _ => return None,
            }
        }
        self.built = Arc::new(built);
        Some(())
    }
}

pub(super) fn snapshot(world: &World, place: u32) -> BuiltRig {
    let mut alive: Vec<((u32, u32), NodeId)> = Vec::with_capacity(world.slots.len());
    for node in (0..world.slots.len() as u32).map(NodeId) {
        if let Some(birth) = world.birth(node, place).filter(|_| !world.is_input(node)) {
            alive.push((world.order_key(node, birth), node));
        }
    }
    alive.sort_unstable_by_key(|(key, _)| *key);
    // Children of every slot, in order; a node whose parent is not there stands below the rig.
    let mut children: Vec<Vec<NodeId>> = vec![Vec::new(); world.slots.len()];
    let mut roots = Vec::new();
    for (_, node) in &alive {
        match world.parent(*node, place).filter(|parent| world.exists(*parent, place) && !world.is_input(*parent)) {
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
        inputs: world
            .declared
            .iter()
            .map(|input| BuiltInput { uid: input.uid, name: input.name.as_str().into(), rest: input.rest.into() })
            .collect(),
    }
}

fn built(world: &World, node: NodeId, parent: Option<usize>, place: u32) -> Option<BuiltNode> {
    let birth = world.birth(node, place)?;
    let mut built = BuiltNode {
        uid: world.uid(node),
        name: world.name(node, place).into(),
        kind: birth.kind,
        parent,
        base: Trs::IDENTITY,
        label: world.label(node, place).cloned(),
        group: world.group(node, place),
        origin: birth.origin.clone(),
        control: None,
        layer: None,
        attributes: NO_ATTRIBUTES.clone(),
    };
    read_values(world, node, place, &mut built);
    Some(built)
}

static NO_ATTRIBUTES: LazyLock<Arc<[Attribute]>> = LazyLock::new(|| Arc::new([]));

/// Reads what neither the structure nor the names depend on.
fn read_values(world: &World, node: NodeId, place: u32, built: &mut BuiltNode) {
    built.base = world.base(node, place);
    built.control = match world.read_at(node, Aspect::Control, place) {
        Some(Value::Control(control)) => Some(control.clone()),
        _ => None,
    };
    built.layer = match world.read_at(node, Aspect::Layer, place) {
        Some(Value::Layer(layer)) => Some(layer.clone()),
        _ => None,
    };
    built.attributes = match world.read_at(node, Aspect::Attributes, place) {
        Some(Value::Attributes(attributes)) => attributes.iter().cloned().collect(),
        _ => NO_ATTRIBUTES.clone(),
    };
}
