//! From references to nodes.

use std::collections::HashSet;

use super::world::{Birth, NodeId, World};
use crate::rig::{
    NodeType, Uid,
    nearest::did_you_mean,
    reference::{GroupScope, NodeRef, NodeRefs, NodeTypes, RigScope, Source, Top},
};

/// Who asks: whose joint `this` is, and which rig is its own.
#[derive(Debug, Clone, Copy)]
pub(super) struct Asker {
    pub rig: Uid,
    pub joint: NodeId,
    /// Commands before this place have been carried out.
    pub place: u32,
}

/// Why a reference has no meaning, as the rest of a sentence.
pub(super) type Refusal = String;

pub(super) fn resolve(world: &World, asker: Asker, references: &NodeRefs) -> Result<Vec<NodeId>, Refusal> {
    let mut nodes: Vec<NodeId> = Vec::new();
    for reference in references {
        for node in resolve_one(world, asker, reference)? {
            if !nodes.contains(&node) {
                nodes.push(node);
            }
        }
    }
    Ok(nodes)
}

fn resolve_one(world: &World, asker: Asker, reference: &NodeRef) -> Result<Vec<NodeId>, Refusal> {
    if let RigScope::Rig(rig) = reference.rig
        && rig != asker.rig
    {
        return Err(format!(
            "rig {rig} is another rig than that of the tag; a command works on one rig: merge the two, or declare the \
             node as an input of this one"
        ));
    }
    let place = asker.place;
    let label = reference.label.map(|bearer| label_of(world, bearer, place)).transpose()?;
    let group = match reference.group {
        GroupScope::Any => None,
        GroupScope::Own => Some(world.group(asker.joint, place)),
        GroupScope::Group(uid) => Some(Some(uid)),
    };
    let keeps = |node: NodeId, birth: &Birth| {
        reference.types.allows(type_of(birth.kind))
            && label.as_ref().is_none_or(|label| world.label(node, place).is_some_and(|own| **own == **label))
            && group.is_none_or(|group| world.group(node, place) == group)
            && reference.role.as_ref().is_none_or(|role| birth.origin.as_ref().is_some_and(|o| *o.role == **role))
    };
    let alive = |node: &NodeId| world.birth(*node, place).is_some_and(|birth| keeps(*node, birth));
    let mut found: Vec<NodeId> = match &reference.source {
        Source::Any => (0..world.slots.len() as u32).map(NodeId).filter(alive).collect(),
        Source::This => Some(asker.joint).into_iter().filter(alive).collect(),
        Source::Joints => world.joints.iter().copied().filter(alive).collect(),
        Source::Joint(uid) => vec![joint(world, *uid, place)?].into_iter().filter(alive).collect(),
        Source::Hierarchy(top) => {
            let top = match top {
                Top::This => asker.joint,
                Top::Joint(uid) => joint(world, *uid, place)?,
            };
            let below = |node: &NodeId| is_below(world, *node, top, place);
            let joints = |node: &NodeId| world.birth(*node, place).is_some_and(|b| b.kind == NodeType::Joint);
            (0..world.slots.len() as u32).map(NodeId).filter(alive).filter(joints).filter(below).collect()
        }
        Source::Command(uid) => {
            let before = |command: &u32| world.places[*command as usize] < place;
            let command = world.creator_of(*uid).filter(before).ok_or_else(|| {
                format!("no command has the uid {uid} and has run before this one; move it up, or refer to another")
            })?;
            world.created[command as usize].iter().copied().filter(alive).collect()
        }
        Source::Module(name) => {
            let of_module = |node: &NodeId| {
                let birth = world.birth(*node, place);
                birth.and_then(|birth| birth.origin.as_ref()).is_some_and(|origin| *origin.module == **name)
            };
            (0..world.slots.len() as u32).map(NodeId).filter(of_module).filter(alive).collect()
        }
    };
    sort(world, &mut found, place);
    let picked = reference.pick.indices(found.len()).map_err(|error| error.to_string())?;
    Ok(picked.into_iter().map(|index| found[index]).collect())
}

fn type_of(kind: NodeType) -> NodeTypes {
    match kind {
        NodeType::Joint => NodeTypes::JOINT,
        NodeType::Null => NodeTypes::NULL,
        NodeType::Control => NodeTypes::CONTROL,
    }
}

fn joint(world: &World, uid: Uid, place: u32) -> Result<NodeId, Refusal> {
    let node = world.id(uid).filter(|node| world.exists(*node, place));
    node.ok_or_else(|| format!("there is no joint {uid} in the built rig; it was deleted, or its group is disabled"))
}

/// The text of a label that is known by who bears it.
fn label_of(world: &World, bearer: Uid, place: u32) -> Result<String, Refusal> {
    let bare = || format!("the joint or command {bearer}, whose label is meant, has no label; give it one");
    let before = |command: &u32| world.places[*command as usize] < place;
    if let Some(command) = world.creator_of(bearer).filter(before) {
        let nodes = world.created[command as usize].iter();
        let label = nodes.filter(|node| world.exists(**node, place)).find_map(|node| world.label(*node, place));
        return label.map(|label| label.to_string()).ok_or_else(bare);
    }
    match world.id(bearer).filter(|node| world.exists(*node, place)) {
        Some(node) => world.label(node, place).map(|label| label.to_string()).ok_or_else(bare),
        None => Err(format!("the joint or command {bearer}, whose label is meant, is not there; refer to another")),
    }
}

fn is_below(world: &World, node: NodeId, top: NodeId, place: u32) -> bool {
    let mut at = Some(node);
    while let Some(node) = at {
        if node == top {
            return true;
        }
        at = world.parent(node, place);
    }
    false
}

/// Parents first, siblings as authored, then in the order of creation.
pub(super) fn sort(world: &World, nodes: &mut [NodeId], place: u32) {
    if nodes.len() < 2 {
        return;
    }
    nodes.sort_by_cached_key(|node| path(world, *node, place));
}

/// The order keys from the root down to a node: comparing them gives the order of a walk through the hierarchy.
fn path(world: &World, node: NodeId, place: u32) -> Vec<(u32, u32)> {
    let mut keys = Vec::with_capacity(8);
    let mut at = Some(node);
    while let Some(node) = at {
        if let Some(birth) = world.birth(node, place) {
            keys.push(world.order_key(node, birth));
        }
        at = world.parent(node, place);
    }
    keys.reverse();
    keys
}

/// What might have been meant where a reference finds nothing, as the rest of a sentence.
pub(super) fn nearest(world: &World, asker: Asker, references: &NodeRefs) -> String {
    let place = asker.place;
    let all = (0..world.slots.len() as u32).map(NodeId);
    let labels: HashSet<&str> = all
        .filter(|node| world.exists(*node, place))
        .filter_map(|node| world.label(node, place))
        .map(|l| &**l)
        .collect();
    let mut labels: Vec<&str> = labels.into_iter().collect();
    labels.sort_unstable();
    for reference in references {
        if let Some(text) = reference.label.and_then(|bearer| label_of(world, bearer, place).ok()) {
            return did_you_mean(&text, labels.iter().filter(|label| **label != text));
        }
        if let Source::Module(name) = &reference.source {
            let all = (0..world.slots.len() as u32).map(NodeId);
            let origins = all.filter_map(|node| world.birth(node, place)?.origin.as_ref());
            let modules: HashSet<&str> = origins.map(|origin| &*origin.module).collect();
            let mut modules: Vec<&str> = modules.into_iter().collect();
            modules.sort_unstable();
            return did_you_mean(name, modules);
        }
        if let (Source::Command(uid), Some(role)) = (&reference.source, &reference.role)
            && let Some(command) = world.creator_of(*uid)
        {
            let nodes = world.created[command as usize].iter();
            let mut roles: Vec<&str> = nodes
                .filter_map(|node| world.birth(*node, place))
                .filter_map(|birth| birth.origin.as_ref().map(|origin| &*origin.role))
                .collect();
            roles.sort_unstable();
            roles.dedup();
            return did_you_mean(role, roles);
        }
    }
    String::new()
}
