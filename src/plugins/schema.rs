//! Components and relations that describe a rig: the same in an app, in the editor and in a game.
//!
//! The [`Rig`](crate::rig::Rig) component is the document; the other components are on entities that follow it.
//! Components that describe the document may be written, and a write becomes an edit: see the table in
//! [`plugins`](super). Components that describe results are immutable, or writes to them are reverted.
//!
//! | thing | components |
//! | --- | --- |
//! | rig | `Rig`, [`Uid`], `Transform` |
//! | local group | [`LocalGroup`], `Uid`, [`GroupOf`] the rig |
//! | joint | [`Joint`], `Uid`, `RestTransform`, `Transform`, [`NodeOf`] the rig, `ChildOf`; [`NodeLabel`], [`InGroup`], [`Null`] |
//! | tag | [`Tag`], `Uid`, [`TagOf`] a joint, and [`CommandTag`] or [`FeatureTag`]; [`InFeature`] |
//! | created node | [`CreatedBy`] a command, [`CreatedRole`], `Uid`, `RestTransform`, `Transform`, [`NodeOf`], `ChildOf`, and [`Control`], [`Null`] or [`Joint`]; [`NodeLabel`], [`InGroup`], [`NodeLayer`], [`Attributes`] |
//! | node of a game's instance | [`NodeSlot`], `Uid`, [`NodeOf`] the instance, `RestTransform` below the built parent (that of a joint in the editor is the document's), and [`Joint`], [`Null`] or [`Control`]; [`NodeLabel`], [`NodeLayer`], [`CreatedRole`]. With a hierarchy: `Transform`, `ChildOf`; without one: the `GlobalTransform` of joints, and the [`ControlPose`] of nodes that can be posed |
//! | constraint | [`Constrains`] a node, [`ConstraintKind`], [`ConstraintTargets`], [`CreatedBy`] a command, `Uid` |

use std::collections::BTreeMap;

use bevy::prelude::*;

use crate::rig::{ControlData, LayerData, PoseOffset, RestTransform, Uid};

/// Joint of the document, or one that a command created. Its [`Transform`] is the pose and its [`RestTransform`] the
/// rest pose, both relative to its parent. Where commands turn a joint of the document or hang it elsewhere, the rest pose
/// is the document's in the editor and the built one in a game: see [`RestTransform`].
///
/// Spawning an entity with this component below a rig or one of its joints adds a joint to the document; its rest pose
/// is the `RestTransform`, or the `Transform` where that was left out.
#[derive(Component, Reflect, Debug, Clone, Copy, PartialEq, Eq, Default)]
#[reflect(Component)]
#[require(Transform, RestTransform)]
pub struct Joint;

/// Node that carries others and never moves the mesh. On a joint of the document: a joint without weights.
#[derive(Component, Reflect, Debug, Clone, Copy, Default, PartialEq, Eq)]
#[reflect(Component)]
pub struct Null;

/// Rig that a node belongs to: joints, created nodes, and the nodes of a game's instance.
#[derive(Component, Reflect, Debug, Clone, Copy, PartialEq, Eq)]
#[relationship(relationship_target = RigNodes)]
#[reflect(Component)]
pub struct NodeOf(pub Entity);

/// Nodes of a rig; despawned together with it.
#[derive(Component, Reflect, Debug, Default)]
#[relationship_target(relationship = NodeOf, linked_spawn)]
#[reflect(Component)]
pub struct RigNodes(Vec<Entity>);

/// Label of a joint or created node, by which references find the node.
#[derive(Component, Reflect, Debug, Clone, PartialEq, Eq)]
#[reflect(Component)]
pub struct NodeLabel(pub String);

/// A local group of a rig: a named, coloured set of nodes that can be left out of the build.
#[derive(Component, Reflect, Debug, Clone, PartialEq)]
#[reflect(Component)]
pub struct LocalGroup {
    /// The name people see.
    pub name: String,
    /// sRGB colour of the group's nodes, 0 to 1 each.
    pub color: [f32; 3],
    /// False to leave the group's joints out of the built rig.
    pub enabled: bool,
}

/// The rig of a local group.
#[derive(Component, Reflect, Debug, Clone, Copy, PartialEq, Eq)]
#[relationship(relationship_target = LocalGroups)]
#[reflect(Component)]
pub struct GroupOf(pub Entity);

/// Local groups of a rig, in order; despawned together with it.
#[derive(Component, Reflect, Debug, Default)]
#[relationship_target(relationship = GroupOf, linked_spawn)]
#[reflect(Component)]
pub struct LocalGroups(Vec<Entity>);

/// The local group of a joint or created node.
#[derive(Component, Reflect, Debug, Clone, Copy, PartialEq, Eq)]
#[relationship(relationship_target = GroupMembers)]
#[reflect(Component)]
pub struct InGroup(pub Entity);

/// The nodes in a local group.
#[derive(Component, Reflect, Debug, Default)]
#[relationship_target(relationship = InGroup)]
#[reflect(Component)]
pub struct GroupMembers(Vec<Entity>);

/// A tag of a joint. Together with [`TagOf`] and a [`CommandTag`] or a [`FeatureTag`] it adds a tag to the document.
#[derive(Component, Reflect, Debug, Clone, PartialEq, Eq)]
#[reflect(Component)]
pub struct Tag {
    /// False to skip the tag in a build.
    pub enabled: bool,
    /// A note for people.
    pub comment: String,
}

impl Default for Tag {
    fn default() -> Self {
        Self { enabled: true, comment: String::new() }
    }
}

/// The joint that carries a tag. A joint's tags are in its [`Tags`], in order.
#[derive(Component, Reflect, Debug, Clone, Copy, PartialEq, Eq)]
#[relationship(relationship_target = Tags)]
#[reflect(Component)]
pub struct TagOf(pub Entity);

/// Tags of a joint, in order; despawned together with it.
#[derive(Component, Reflect, Debug, Default)]
#[relationship_target(relationship = TagOf, linked_spawn)]
#[reflect(Component)]
pub struct Tags(Vec<Entity>);

/// A command: a module that runs when the rig is built.
#[derive(Component, Reflect, Debug, Clone, PartialEq, Eq)]
#[reflect(Component)]
#[require(Tag)]
pub struct CommandTag {
    /// The module's name.
    pub module: String,
    /// The module's parameters as RON.
    pub params: String,
}

/// A feature: turns the commands that are in it on and off.
#[derive(Component, Reflect, Debug, Clone, PartialEq, Eq)]
#[reflect(Component)]
#[require(Tag)]
pub struct FeatureTag {
    /// The kind, from the registry.
    pub kind: String,
    /// The name; empty if the feature only organises.
    pub name: String,
    /// The part of the combined feature.
    pub switch: String,
    /// The choice that the switch is one of; empty if it stands for itself.
    pub choice: String,
}

/// The feature tag that a command is in.
#[derive(Component, Reflect, Debug, Clone, Copy, PartialEq, Eq)]
#[relationship(relationship_target = FeatureCommands)]
#[reflect(Component)]
pub struct InFeature(pub Entity);

/// The commands in a feature.
#[derive(Component, Reflect, Debug, Default)]
#[relationship_target(relationship = InFeature)]
#[reflect(Component)]
pub struct FeatureCommands(Vec<Entity>);

/// The command tag that made a node or a constraint.
#[derive(Component, Reflect, Debug, Clone, Copy, PartialEq, Eq)]
#[relationship(relationship_target = CreatedNodes)]
#[reflect(Component)]
pub struct CreatedBy(pub Entity);

/// The nodes and constraints that a command made.
#[derive(Component, Reflect, Debug, Default)]
#[relationship_target(relationship = CreatedBy)]
#[reflect(Component)]
pub struct CreatedNodes(Vec<Entity>);

/// The purpose of a created node.
#[derive(Component, Reflect, Debug, Clone, PartialEq, Eq)]
#[component(immutable)]
#[reflect(Component)]
pub struct CreatedRole {
    /// Role that the module gives to the node.
    pub role: String,
    /// Node that this node was made for.
    pub subject: Uid,
    /// Number of the node among those with the same role and subject.
    pub number: u32,
}

/// Node that people and animations move. Its `Transform` is its pose; code that writes the pose has to keep to the
/// channels and limits.
#[derive(Component, Reflect, Debug, Clone, PartialEq)]
#[component(immutable)]
#[reflect(Component)]
pub struct Control(pub ControlData);

/// The layer that a node is shown in.
#[derive(Component, Reflect, Debug, Clone, PartialEq)]
#[component(immutable)]
#[reflect(Component)]
pub struct NodeLayer(pub LayerData);

/// Values of a node's attributes by name, as they are in effect. Writing a value drives the rig in the same frame, as
/// writing a control's `Transform` does; the value of an attribute that a constraint drives is restored in the same frame, and
/// told once. Nodes of a game's instance have none until the game inserts some: the values that it inserts count, and those that
/// it leaves out are added.
#[derive(Component, Reflect, Debug, Clone, PartialEq, Default)]
#[reflect(Component)]
pub struct Attributes(pub BTreeMap<String, f32>);

/// Marks a node that is rolled back: it has no place in the rig until it is built again.
#[derive(Component, Reflect, Debug, Clone, Copy, Default, PartialEq, Eq)]
#[component(immutable)]
#[reflect(Component)]
pub struct ParkedNode;

/// Node that a constraint drives (the last one if it drives several). Constraints on one node run in the order of its
/// [`NodeConstraints`].
#[derive(Component, Reflect, Debug, Clone, Copy, PartialEq, Eq)]
#[relationship(relationship_target = NodeConstraints)]
#[reflect(Component)]
pub struct Constrains(pub Entity);

/// The constraints on a node, in the order in which they run.
#[derive(Component, Reflect, Debug, Default)]
#[relationship_target(relationship = Constrains)]
#[reflect(Component)]
pub struct NodeConstraints(Vec<Entity>);

/// The kind of a constraint: `transform`, `aim`, `two_bone`, and so on.
#[derive(Component, Reflect, Debug, Clone, Copy, PartialEq, Eq)]
#[component(immutable)]
#[reflect(Component)]
pub struct ConstraintKind(pub &'static str);

/// The nodes that a constraint reads, in order, with their weights.
#[derive(Component, Reflect, Debug, Clone, PartialEq, Default)]
#[component(immutable)]
#[reflect(Component)]
pub struct ConstraintTargets(pub Vec<ConstraintTarget>);

/// Node that a constraint reads, with its weight.
#[derive(Reflect, Debug, Clone, Copy, PartialEq)]
pub struct ConstraintTarget {
    /// The node.
    pub node: Entity,
    /// Weight of the node; `None` where an attribute gives it.
    pub weight: Option<f32>,
}

/// Number of a node in the program that a game's instance runs.
#[derive(Component, Reflect, Debug, Clone, Copy, PartialEq, Eq)]
#[component(immutable)]
#[reflect(Component)]
pub struct NodeSlot(pub u32);

/// Pose of an exposed node of an instance in [`InstanceMode::Direct`](super::runtime::InstanceMode::Direct), written by people, code or an animation curve.
#[derive(Component, Reflect, Debug, Clone, Copy, PartialEq)]
#[reflect(Component)]
pub struct ControlPose {
    /// Translation in the node's space at rest.
    pub translation: Vec3,
    /// Rotation about the node's own axes, a unit quaternion.
    pub rotation: Quat,
    /// Factors along the node's own axes.
    pub scale: Vec3,
}

impl Default for ControlPose {
    fn default() -> Self {
        PoseOffset::IDENTITY.into()
    }
}

impl From<PoseOffset> for ControlPose {
    fn from(PoseOffset { translation, rotation, scale }: PoseOffset) -> Self {
        Self { translation, rotation, scale }
    }
}

impl From<ControlPose> for PoseOffset {
    fn from(ControlPose { translation, rotation, scale }: ControlPose) -> Self {
        Self { translation, rotation, scale }
    }
}
