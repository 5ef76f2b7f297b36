//! Resolution of references to nodes.

use bevy::platform::collections::{HashMap, HashSet};

use super::{
    exclusion::{Exclusion, Gap},
    world::{Birth, NodeId, World},
};
use crate::rig::{
    NodeType, Uid,
    nearest::did_you_mean,
    reference::{GroupScope, NodeRef, NodeRefs, NodeTypes, Pick, PickAt, PickError, RigScope, Source, Top},
};

/// Command that refers to nodes: the joint that `this` means, and its rig.
#[derive(Debug, Clone, Copy)]
pub(super) struct Asker {
    pub rig: Uid,
    pub joint: NodeId,
    /// Commands before this place have been carried out.
    pub place: u32,
}

/// Reason why a reference has no meaning.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ResolveError {
    /// A node of another rig.
    #[error(
        "rig {0} is another rig than that of the tag; a command works on one rig: merge the two, or declare the node as \
         an input of this one"
    )]
    OtherRig(Uid),
    /// A command that does not exist or runs later.
    #[error("no command has the uid {0} and has run before this one; move it up, or refer to another")]
    NoCommand(Uid),
    /// A joint that does not exist.
    #[error("there is no joint {0} in the rig; it was deleted: refer to another")]
    NoJoint(Uid),
    /// An input that the rig does not declare.
    #[error("the rig declares no input {0}; declare it under `inputs`, or refer to something else")]
    NoInput(Uid),
    /// The label of a joint or command that has none.
    #[error("the joint or command {0}, whose label is meant, has no label; give it one")]
    NoLabel(Uid),
    /// The label of a joint or command that does not exist.
    #[error("the joint or command {0}, whose label is meant, is not there; refer to another")]
    NoBearer(Uid),
    /// A pick of places that the list does not have.
    #[error(transparent)]
    Pick(#[from] PickError),
}

/// Nodes that references find, and their gaps.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct Resolution {
    pub nodes: Vec<NodeId>,
    /// Excluded nodes that the references mean besides.
    pub gaps: Vec<Gap>,
}

/// Reason why a reference finds nothing.
enum MissingTarget {
    Off(Box<Gap>),
    Wrong(ResolveError),
}

impl From<Gap> for MissingTarget {
    fn from(gap: Gap) -> Self {
        Self::Off(Box::new(gap))
    }
}

pub(super) fn resolve(world: &World, asker: Asker, references: &NodeRefs) -> Result<Resolution, ResolveError> {
    let mut all = Resolution::default();
    let mut seen: HashSet<NodeId> = HashSet::default();
    for reference in references {
        let mut gaps = Vec::new();
        let found = match resolve_one(world, asker, reference, &mut gaps) {
            Ok(found) => found,
            Err(MissingTarget::Wrong(error)) => return Err(error),
            Err(MissingTarget::Off(gap)) => {
                gaps = vec![*gap];
                Vec::new()
            }
        };
        for node in found {
            if seen.insert(node) {
                all.nodes.push(node);
            }
        }
        let at = all.nodes.len();
        all.gaps.extend(gaps.into_iter().map(|gap| Gap { at, ..gap }));
    }
    Ok(all)
}

/// Nodes of one reference; `gaps` gets the excluded nodes of a list that is not excluded as a whole.
fn resolve_one(
    world: &World,
    asker: Asker,
    reference: &NodeRef,
    gaps: &mut Vec<Gap>,
) -> Result<Vec<NodeId>, MissingTarget> {
    if let RigScope::Rig(rig) = reference.rig
        && rig != asker.rig
    {
        return Err(MissingTarget::Wrong(ResolveError::OtherRig(rig)));
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
    let before = |command: u32| world.places[command as usize] < place;
    let mut incomplete: Option<Gap> = None;
    let mut found: Vec<NodeId> = match &reference.source {
        Source::Any => {
            let all = (0..world.slots.len() as u32).map(NodeId);
            all.filter(|node| !world.is_input(*node)).filter(alive).collect()
        }
        Source::This => Some(asker.joint).into_iter().filter(alive).collect(),
        Source::Root => root_control(world, asker).into_iter().filter(alive).collect(),
        Source::Joints => world.joints.iter().copied().filter(alive).collect(),
        Source::Input(uid) => {
            let node = world.id(*uid).filter(|node| world.is_input(*node));
            Some(node.ok_or(MissingTarget::Wrong(ResolveError::NoInput(*uid)))?).into_iter().filter(alive).collect()
        }
        Source::Joint(uid) => vec![joint(world, *uid, place)?].into_iter().filter(alive).collect(),
        Source::Hierarchy(top) => {
            let top = match top {
                Top::This => asker.joint,
                Top::Joint(uid) => joint(world, *uid, place)?,
            };
            let mut off: Vec<_> = world.off.joints.iter().collect();
            off.retain(|(_, joint)| joint.above.is_some_and(|above| is_below(world, above, top, place)));
            off.sort_unstable_by_key(|(uid, _)| **uid);
            gaps.extend(off.into_iter().filter_map(|(uid, _)| world.off.joint(*uid)));
            incomplete = gaps.first().cloned();
            let joints = |node: &NodeId| world.birth(*node, place).is_some_and(|b| b.kind == NodeType::Joint);
            hierarchy(world, top, place).into_iter().filter(alive).filter(joints).collect()
        }
        Source::Command(uid) => {
            let command = world.creator_of(*uid).filter(|command| before(*command));
            let command = command.ok_or(MissingTarget::Wrong(ResolveError::NoCommand(*uid)))?;
            if let Some(gap) = world.off.command(command) {
                return Err(gap.into());
            }
            incomplete = world.off.partial.get(&command).cloned();
            world.created[command as usize].iter().copied().filter(alive).collect()
        }
        Source::Module(name) => {
            let of_module = |node: &NodeId| {
                let birth = world.birth(*node, place);
                birth.and_then(|birth| birth.origin.as_ref()).is_some_and(|origin| *origin.module == **name)
            };
            let off = world.off.commands.iter().filter(|(number, off)| *off.module == **name && before(**number));
            incomplete = off.min_by_key(|(number, _)| world.places[**number as usize]).map(|(_, off)| off.gap());
            (0..world.slots.len() as u32).map(NodeId).filter(of_module).filter(alive).collect()
        }
    };
    if let (true, GroupScope::Group(group)) = (found.is_empty(), reference.group)
        && let Some(name) = world.off.groups.get(&group)
    {
        incomplete.get_or_insert(Gap { at: 0, off: Exclusion::Group(name.clone()), above: None });
    }
    if let Some(gap) = incomplete
        && (found.is_empty() || picks_numbers(&reference.pick))
    {
        return Err(gap.into());
    }
    sort(world, &mut found, place);
    let picked = reference.pick.indices(found.len()).map_err(|error| MissingTarget::Wrong(error.into()))?;
    if reference.pick != Pick::All {
        // Of the first or the last of a list nothing is missing.
        gaps.clear();
    }
    Ok(picked.into_iter().map(|index| found[index]).collect())
}

/// True if a pick counts places of a list: a gap in the list shifts them.
fn picks_numbers(pick: &Pick) -> bool {
    matches!(pick, Pick::List(places) if places.iter().any(|place| matches!(place, PickAt::Number(_))))
}

/// The control that carries the rig of the asker: of the controls that commands of its root joint have made so far, the
/// first that stands below no other. Without one, that of another root joint, if only one has such controls.
pub(super) fn root_control(world: &World, asker: Asker) -> Option<NodeId> {
    let place = asker.place;
    let is_joint = |node: NodeId| world.slots[node.0 as usize].creator.is_none();
    let above = |node: NodeId| std::iter::successors(Some(node), |node| world.parent(*node, place));
    let root_of = |node: NodeId| above(node).filter(|node| is_joint(*node)).last();
    let is_control = |node: NodeId| world.birth(node, place).is_some_and(|birth| birth.kind == NodeType::Control);
    let mut controls: Vec<(NodeId, NodeId)> = Vec::new();
    for node in (0..world.slots.len() as u32).map(NodeId).filter(|node| is_control(*node)) {
        let Some(creator) = world.slots[node.0 as usize].creator else { continue };
        let Some(bearer) = world.id(world.bearers[creator as usize]) else { continue };
        if root_of(bearer) == Some(bearer) && !above(node).skip(1).any(is_control) {
            controls.push((bearer, node));
        }
    }
    let own = root_of(asker.joint);
    let mut of_root: Vec<NodeId> =
        controls.iter().filter(|(root, _)| Some(*root) == own).map(|(_, node)| *node).collect();
    if of_root.is_empty() && controls.iter().all(|(root, _)| *root == controls[0].0) {
        of_root = controls.into_iter().map(|(_, node)| node).collect();
    }
    sort(world, &mut of_root, place);
    of_root.first().copied()
}

fn type_of(kind: NodeType) -> NodeTypes {
    match kind {
        NodeType::Joint => NodeTypes::JOINT,
        NodeType::Null => NodeTypes::NULL,
        NodeType::Control => NodeTypes::CONTROL,
    }
}

fn joint(world: &World, uid: Uid, place: u32) -> Result<NodeId, MissingTarget> {
    match (world.id(uid).filter(|node| world.exists(*node, place)), world.off.joint(uid)) {
        (Some(node), _) => Ok(node),
        (None, Some(gap)) => Err(gap.into()),
        (None, None) => Err(MissingTarget::Wrong(ResolveError::NoJoint(uid))),
    }
}

/// Text of the label of a joint, or of the node that a command labels.
fn label_of(world: &World, bearer: Uid, place: u32) -> Result<String, MissingTarget> {
    let bare = || MissingTarget::Wrong(ResolveError::NoLabel(bearer));
    let before = |command: &u32| world.places[*command as usize] < place;
    if let Some(command) = world.creator_of(bearer).filter(before) {
        if let Some(gap) = world.off.command(command) {
            return Err(gap.into());
        }
        let nodes = world.created[command as usize].iter();
        let label = nodes.filter(|node| world.exists(**node, place)).find_map(|node| world.label(*node, place));
        return label.map(|label| label.to_string()).ok_or_else(bare);
    }
    match world.id(bearer).filter(|node| world.exists(*node, place)) {
        Some(node) => world.label(node, place).map(|label| label.to_string()).ok_or_else(bare),
        None => Err(world
            .off
            .joint(bearer)
            .map_or(MissingTarget::Wrong(ResolveError::NoBearer(bearer)), MissingTarget::from)),
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

/// A node and all nodes below it.
fn hierarchy(world: &World, top: NodeId, place: u32) -> HashSet<NodeId> {
    let mut found: HashSet<NodeId> = HashSet::default();
    let mut stack = vec![top];
    while let Some(node) = stack.pop() {
        if found.insert(node) {
            let below = world.slots[node.0 as usize].below.iter().copied();
            stack.extend(below.filter(|child| world.parent(*child, place) == Some(node)));
        }
    }
    found
}

/// Number of nodes up to which comparing the ways down to them takes less than a walk through the hierarchy.
const FEW: usize = 16;

/// Sorts nodes: parents first, siblings as authored, then in the order of creation.
pub(super) fn sort(world: &World, nodes: &mut [NodeId], place: u32) {
    match nodes.len() {
        0 | 1 => {}
        2..=FEW => nodes.sort_by_cached_key(|node| path(world, *node, place)),
        _ => {
            let ranks = ranks(world, nodes, place);
            nodes.sort_by_key(|node| ranks.get(node).copied());
        }
    }
}

/// Places of nodes, and of all nodes above them, in a walk through the hierarchy. The ways down to the nodes of a long
/// chain would be as long as the square of its length.
fn ranks(world: &World, nodes: &[NodeId], place: u32) -> HashMap<NodeId, usize> {
    let mut seen: HashSet<NodeId> = HashSet::default();
    let mut children: HashMap<Option<NodeId>, Vec<((u32, u32), NodeId)>> = HashMap::default();
    for node in nodes {
        let mut at = Some(*node);
        while let Some(node) = at.filter(|node| seen.insert(*node)) {
            let mut parent = world.parent(node, place);
            // A node that is not there has no place of its own in the walk.
            while let Some(gone) = parent.filter(|parent| !world.exists(*parent, place)) {
                parent = world.parent(gone, place);
            }
            if let Some(birth) = world.birth(node, place) {
                children.entry(parent).or_default().push((world.order_key(node, birth), node));
            }
            at = parent;
        }
    }
    children.values_mut().for_each(|siblings| siblings.sort_unstable_by(|a, b| b.cmp(a)));
    let mut ranks: HashMap<NodeId, usize> = HashMap::default();
    let mut stack = children.remove(&None).unwrap_or_default();
    while let Some((_, node)) = stack.pop() {
        ranks.insert(node, ranks.len());
        stack.extend(children.remove(&Some(node)).unwrap_or_default());
    }
    ranks
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

/// Similar names for a reference that finds nothing, as the rest of a sentence.
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
