//! References: the nodes that a command works on, selected without names.
//!
//! A [`NodeRef`] has a source of nodes (a joint, the nodes of a command, ...), filters (group, label, type, role) and a
//! choice of places in the filtered list. It holds uids only, so renaming breaks nothing, and it may point at nodes
//! that an earlier command has yet to create. A parameter holds a union of them, [`NodeRefs`], which is one string in
//! files.
//!
//! # Text form
//!
//! One line that starts with `@`. A uid stands beside each name and wins; the name is only for people.
//!
//! ```text
//! references = reference { "+" reference } | "@none"
//! reference  = "@" source { filter }                       (the "@" may be left out after a "+")
//! source     = "any"                                       every node of the rig
//!            | "this"                                      the joint that carries the tag
//!            | "root"                                      the control that carries the rig, see [`Source::Root`]
//!            | "joints"                                    the document's joints
//!            | "joint" named                               one joint
//!            | "hierarchy" [ "this" | named ]              a joint (this if left out) and the joints below it
//!            | "command" named                             nodes that one command creates
//!            | "module" name                               nodes that any command of that module creates
//!            | "input" named                               something outside of the rig that it declares as an input
//! filter     = "rig:" ( "own" | named )                    which rig; own if left out
//!            | "group:" ( "any" | "own" | named )          local group; any if left out
//!            | "label:" named                              nodes with the label of that joint or command
//!            | "type:" type { "," type }                   kinds of node; any if left out
//!            | "role:" name                                purpose of the node, named by the creating command
//!            | "pick:" ( "all" | "none" | place { "," place } )  which of them, in that order; all if left out
//! place      = "START" | "MIDDLE" | "END" | number         numbers count from 0
//! named      = [ name ] "#" uid | name                     the latter only where names can be looked up
//! name       = word of letters, digits, "_", "-", ".", "/" | text in '...' or "...", with the escapes of Rust
//! ```
//!
//! Examples: `@this`, `@joint upper_arm_l#0123456789abcdef`, `@command control/hand_l#00000000000000aa role:offset`,
//! `@joints group:arm_l#00000000000000bb type:joint,control pick:START,2,END`, `@joint hand_l + @joint hand_r`.
//!
//! The name of a command is its module, and the label of its joint after a `/` where that is needed; where several commands
//! of a module stand on one joint, the name that the command gives its nodes stands in place of the label or behind it:
//! `control/hand_l`, `control/hand_ik_l`, `control/hand_l/hand_ik_l`. The name of a label is the label.

mod error;
mod index;
mod names;
mod params;
mod text;
mod write;

use bevy::prelude::*;
use serde::{Deserialize, Deserializer, Serialize, Serializer, de::Error as _};

use crate::rig::{NodeType, Uid};

pub use error::{PickError, ReferenceError, ReferenceProblem};
pub use index::{MOST_COMPARED, RigNameIndex};
pub use names::{NameKind, NameScope, Names, RigNames, label_text};
pub use params::{
    BadReference, FoundReference, bind_known_names, bind_names, given_names, map_references, map_unions,
    nearest_to_gone, references_in, refresh_names, with_uids, without_uids, written_as,
};
pub(in crate::rig) use params::{given_name, map_text_fields, map_uids};

/// A reference. It resolves to an ordered list of nodes: parents first, siblings as authored, then in the order of
/// creation.
#[derive(Reflect, Debug, Clone, PartialEq, Eq, Hash, Default)]
#[reflect(Default)]
pub struct NodeRef {
    /// The rig to look in.
    pub rig: RigScope,
    /// The local group of the nodes.
    pub group: GroupScope,
    /// A joint, or a command tag that gives its nodes a label: only nodes with the same label text count.
    pub label: Option<Uid>,
    /// Kinds of node; empty for any.
    pub types: NodeTypes,
    /// Source of the nodes.
    pub source: Source,
    /// Role of the nodes, as the creating command names it.
    pub role: Option<String>,
    /// Choice of nodes from the filtered list.
    pub pick: Pick,
}

/// The rig that a reference looks in.
#[derive(Reflect, Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
#[reflect(Default)]
pub enum RigScope {
    /// The rig of the tag.
    #[default]
    Own,
    /// The rig with that uid.
    Rig(Uid),
}

/// The local groups that a reference looks in.
#[derive(Reflect, Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
#[reflect(Default)]
pub enum GroupScope {
    /// Nodes of all groups, and nodes without one.
    #[default]
    Any,
    /// The group of the joint that carries the tag (nodes without a group if it has none).
    Own,
    /// The group with that uid.
    Group(Uid),
}

/// Source of a reference's nodes.
#[derive(Reflect, Debug, Clone, PartialEq, Eq, Hash, Default)]
#[reflect(Default)]
pub enum Source {
    /// Every node: joints of the document and nodes that commands have created so far.
    #[default]
    Any,
    /// The joint that carries the tag.
    This,
    /// The control that carries the rig: of the controls that commands of the root joint make, the first that stands
    /// below no other. The root joint is the uppermost joint above the tag's; where its commands make no control, it is
    /// another root joint, if only one has such controls. Parts refer to it where they mean the world: as a parent, a
    /// rig without such a control stands for it.
    Root,
    /// The joints of the document.
    Joints,
    /// A single joint.
    Joint(Uid),
    /// A joint and the joints below it.
    Hierarchy(Top),
    /// The nodes that a command (its tag) creates.
    Command(Uid),
    /// The nodes that commands of that module create.
    Module(String),
    /// A declared input of the rig.
    Input(Uid),
}

/// The joint at the top of a hierarchy.
#[derive(Reflect, Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
#[reflect(Default)]
pub enum Top {
    /// The joint that carries the tag.
    #[default]
    This,
    /// The joint with that uid.
    Joint(Uid),
}

/// Choice of nodes from a list.
#[derive(Reflect, Debug, Clone, PartialEq, Eq, Hash, Default)]
#[reflect(Default)]
pub enum Pick {
    /// All nodes, in their order.
    #[default]
    All,
    /// The nodes at these places, in this order.
    List(Vec<PickAt>),
}

/// A place in a list of nodes.
#[derive(Reflect, Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum PickAt {
    /// The first.
    Start,
    /// The middle one; the later of two.
    Middle,
    /// The last.
    End,
    /// The node of this number, counted from 0.
    Number(u32),
}

impl Pick {
    /// The indices into a list of `count` nodes, each once.
    ///
    /// # Errors
    /// [`PickError`] for a number past the end. An empty list has no places, and is no error for `START`, `MIDDLE` and
    /// `END`.
    pub fn indices(&self, count: usize) -> Result<Vec<usize>, PickError> {
        let Self::List(places) = self else { return Ok((0..count).collect()) };
        let mut indices = Vec::with_capacity(places.len());
        for place in places {
            let index = match *place {
                PickAt::Number(number) if number as usize >= count => return Err(PickError { number, count }),
                _ if count == 0 => continue,
                PickAt::Start => 0,
                PickAt::Middle => count / 2,
                PickAt::End => count - 1,
                PickAt::Number(number) => number as usize,
            };
            if !indices.contains(&index) {
                indices.push(index);
            }
        }
        Ok(indices)
    }
}

/// A set of kinds of node; the empty set stands for any.
#[derive(Reflect, Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
#[reflect(Default)]
pub struct NodeTypes(u16);

impl NodeTypes {
    /// Any kind.
    pub const ANY: Self = Self(0);
    /// Joints, of the document or created.
    pub const JOINT: Self = Self(1);
    /// Controls.
    pub const CONTROL: Self = Self(1 << 1);
    /// Nodes that only carry others (nulls).
    pub const NULL: Self = Self(1 << 2);

    /// Names of the kinds in the text form.
    pub const NAMES: [(&'static str, Self); 3] =
        [("joint", Self::JOINT), ("control", Self::CONTROL), ("null", Self::NULL)];

    /// The kinds of both sets. (The empty set adds nothing.)
    pub const fn with(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }

    /// Returns `true` if the set is empty, which stands for any kind.
    pub const fn is_any(self) -> bool {
        self.0 == 0
    }

    /// Returns `true` if the set admits a node of these kinds.
    pub const fn allows(self, node: Self) -> bool {
        self.0 == 0 || self.0 & node.0 != 0
    }

    /// The names of the kinds in the set.
    pub fn names(self) -> impl Iterator<Item = &'static str> {
        Self::NAMES.into_iter().filter(move |(_, kind)| self.0 & kind.0 != 0).map(|(name, _)| name)
    }
}

impl From<NodeType> for NodeTypes {
    fn from(node: NodeType) -> Self {
        match node {
            NodeType::Joint => Self::JOINT,
            NodeType::Null => Self::NULL,
            NodeType::Control => Self::CONTROL,
        }
    }
}

impl std::ops::BitOr for NodeTypes {
    type Output = Self;

    fn bitor(self, other: Self) -> Self {
        self.with(other)
    }
}

impl From<Source> for NodeRef {
    fn from(source: Source) -> Self {
        Self { source, ..Self::default() }
    }
}

impl NodeRef {
    /// The joint that carries the tag.
    pub fn this() -> Self {
        Source::This.into()
    }

    /// A single joint.
    pub fn joint(joint: Uid) -> Self {
        Source::Joint(joint).into()
    }

    /// The nodes that a command creates.
    pub fn command(tag: Uid) -> Self {
        Source::Command(tag).into()
    }

    /// The nodes that commands of a module create.
    pub fn module(name: impl Into<String>) -> Self {
        Source::Module(name.into()).into()
    }

    /// The reference restricted to nodes with a role.
    pub fn with_role(self, role: impl Into<String>) -> Self {
        Self { role: Some(role.into()), ..self }
    }

    /// The reference restricted to nodes of these kinds.
    pub fn of_types(self, types: NodeTypes) -> Self {
        Self { types, ..self }
    }

    /// The reference restricted to nodes in these local groups.
    pub fn in_group(self, group: GroupScope) -> Self {
        Self { group, ..self }
    }

    /// The reference restricted to nodes with the label of that joint or command.
    pub fn labelled(self, bearer: Uid) -> Self {
        Self { label: Some(bearer), ..self }
    }

    /// The reference restricted to these places of its list.
    pub fn picking(self, places: impl Into<Vec<PickAt>>) -> Self {
        Self { pick: Pick::List(places.into()), ..self }
    }

    /// Uids in the reference, with the kind of object of each.
    pub fn uids_mut(&mut self) -> impl Iterator<Item = (NameKind, &mut Uid)> {
        let rig = match &mut self.rig {
            RigScope::Own => None,
            RigScope::Rig(uid) => Some((NameKind::Rig, uid)),
        };
        let group = match &mut self.group {
            GroupScope::Any | GroupScope::Own => None,
            GroupScope::Group(uid) => Some((NameKind::Group, uid)),
        };
        let source = match &mut self.source {
            Source::Joint(uid) | Source::Hierarchy(Top::Joint(uid)) => Some((NameKind::Joint, uid)),
            Source::Command(uid) => Some((NameKind::Command, uid)),
            Source::Input(uid) => Some((NameKind::Input, uid)),
            _ => None,
        };
        let label = self.label.as_mut().map(|uid| (NameKind::Label, uid));
        source.into_iter().chain(rig).chain(group).chain(label)
    }

    /// Uids in the reference, with the kind of object of each.
    pub fn uids(&self) -> impl Iterator<Item = (NameKind, Uid)> {
        let mut copy = self.clone();
        let list: Vec<_> = copy.uids_mut().map(|(kind, uid)| (kind, *uid)).collect();
        list.into_iter()
    }

    /// The text form with current names.
    pub fn to_text(&self, names: &dyn Names) -> String {
        write::written(std::slice::from_ref(self), Some(names))
    }
}

/// A union of references: the nodes of the first, then those of the second that are not among them, and so on.
#[derive(Reflect, Debug, Clone, PartialEq, Eq, Hash, Default)]
#[reflect(Default)]
pub struct NodeRefs(pub Vec<NodeRef>);

impl NodeRefs {
    /// A reference to nothing.
    pub const NONE: Self = Self(Vec::new());

    /// Returns `true` without references.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// The references.
    pub fn iter(&self) -> std::slice::Iter<'_, NodeRef> {
        self.0.iter()
    }

    /// Reads the text form; a name without a uid is looked up.
    ///
    /// # Errors
    /// [`ReferenceError`] with the place of malformed text or of an unknown or ambiguous name, and the nearest matches.
    pub fn parse(text: &str, names: &dyn Names) -> Result<Self, ReferenceError> {
        text::read(text, Some(names)).map(Self)
    }

    /// The text form with current names.
    pub fn to_text(&self, names: &dyn Names) -> String {
        write::written(&self.0, Some(names))
    }
}

impl From<NodeRef> for NodeRefs {
    fn from(reference: NodeRef) -> Self {
        Self(vec![reference])
    }
}

impl From<Source> for NodeRefs {
    fn from(source: Source) -> Self {
        NodeRef::from(source).into()
    }
}

impl<'a> IntoIterator for &'a NodeRefs {
    type Item = &'a NodeRef;
    type IntoIter = std::slice::Iter<'a, NodeRef>;

    fn into_iter(self) -> Self::IntoIter {
        self.0.iter()
    }
}

/// The text form without names.
impl std::fmt::Display for NodeRef {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&write::written(std::slice::from_ref(self), None))
    }
}

/// The text form without names.
impl std::fmt::Display for NodeRefs {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&write::written(&self.0, None))
    }
}

/// Reads the text form; every name needs its uid.
impl std::str::FromStr for NodeRef {
    type Err = ReferenceError;

    fn from_str(text: &str) -> Result<Self, ReferenceError> {
        let mut list = text::read(text, None)?;
        let count = list.len();
        match list.pop() {
            Some(one) if count == 1 => Ok(one),
            _ => Err(ReferenceError::new(text, 0, ReferenceProblem::NotOne(count))),
        }
    }
}

/// Reads the text form; every name needs its uid.
impl std::str::FromStr for NodeRefs {
    type Err = ReferenceError;

    fn from_str(text: &str) -> Result<Self, ReferenceError> {
        text::read(text, None).map(Self)
    }
}

impl Serialize for NodeRef {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

impl Serialize for NodeRefs {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

impl<'de> Deserialize<'de> for NodeRef {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let text = std::borrow::Cow::<'de, str>::deserialize(deserializer)?;
        text.parse().map_err(D::Error::custom)
    }
}

impl<'de> Deserialize<'de> for NodeRefs {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let text = std::borrow::Cow::<'de, str>::deserialize(deserializer)?;
        text.parse().map_err(D::Error::custom)
    }
}
