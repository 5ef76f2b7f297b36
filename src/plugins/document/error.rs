//! Reasons why changes are refused.

use bevy::prelude::*;

use crate::{
    plugins::controls::SwitchError,
    rig::{EditError, Uid, operations::OperationError},
};

/// Reason why a change was refused; a sentence for people without its full stop.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ChangeError {
    /// The entity of the request has no [`Rig`](crate::rig::Rig).
    #[error("entity {0} is no rig; it may have been closed")]
    NoRig(Entity),
    /// The history has no step in effect.
    #[error("there is nothing to undo")]
    NothingToUndo,
    /// The history has no undone step.
    #[error("there is nothing to redo")]
    NothingToRedo,
    /// The change is about the active joint, and none is selected.
    #[error("no joint is selected; select one first")]
    NoActive,
    /// No joint has the label.
    #[error("no joint has the label \"{0}\"")]
    NoLabel(String),
    /// The list of labels is longer than the chain.
    #[error("there are {names} names for a chain of {joints} joints")]
    LongChain {
        /// Number of names.
        names: usize,
        /// Number of joints.
        joints: usize,
    },
    /// The rig refuses the operation.
    #[error(transparent)]
    Operation(#[from] OperationError),
    /// The rig refuses an edit, of a step that is undone or redone for example.
    #[error(transparent)]
    Edit(#[from] EditError),
    /// A write to an entity cannot be taken over into the document.
    #[error(transparent)]
    Entity(#[from] EntityWriteError),
    /// A switch cannot be set.
    #[error(transparent)]
    Switch(#[from] SwitchError),
}

/// Reason why a write to an entity is not taken over into the document.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum EntityWriteError {
    /// The rig refuses the edit that the write would be.
    #[error("{write} was not taken over: {source}")]
    Refused {
        /// Kind of the write.
        write: EntityWrite,
        /// Answer of the rig.
        source: OperationError,
    },
    /// The uid of a part was removed or replaced.
    #[error("the uid of entity {entity} stays {uid}: an identity never changes")]
    Uid {
        /// The entity of the part.
        entity: Entity,
        /// The uid that the part keeps.
        uid: Uid,
    },
    /// A created node was despawned.
    #[error("a created node was despawned and comes back; switch off or delete its command instead")]
    CreatedNode,
    /// A constraint was despawned.
    #[error("a constraint of the kind {kind} was despawned and comes back; switch off or delete its command instead")]
    CreatedConstraint {
        /// Kind of the constraint.
        kind: &'static str,
    },
    /// A component that only a build writes was inserted, replaced or removed.
    #[error("`{component}` of \"{name}\" stays as the build gives it; change the command instead")]
    BuiltContent {
        /// Name of the node or rig, or kind of the constraint.
        name: String,
        /// Name of the component.
        component: &'static str,
    },
    /// An attribute that a constraint drives was written.
    #[error(
        "attribute \"{attribute}\" of \"{node}\" is driven by {driver} and stays as that says; write what drives it, or \
         change the command"
    )]
    DrivenAttribute {
        /// Name of the node.
        node: String,
        /// Name of the attribute.
        attribute: String,
        /// Command or constraint that drives it, in words.
        driver: String,
    },
    /// An attribute was written that the node does not have.
    #[error("\"{node}\" has no attribute \"{attribute}\"{nearest}")]
    UnknownAttribute {
        /// Name of the node.
        node: String,
        /// Name of the attribute.
        attribute: String,
        /// Nearest names, as the rest of a sentence.
        nearest: String,
    },
    /// A created node was written.
    #[error("`{component}` of \"{name}\", which a command created, stays as that says; change the command")]
    CreatedContent {
        /// Name of the node.
        name: String,
        /// Name of the component.
        component: &'static str,
    },
    /// A joint was spawned outside of the document.
    #[error("a joint was spawned below an entity that is no joint of the document; spawn it below a joint or the rig")]
    JointParent,
    /// A joint lost its marker component.
    #[error("joint {0} cannot lose its `Joint`; despawn its entity to delete it")]
    JointMarker(Uid),
    /// A joint was put into something that is no group of its rig.
    #[error("joint {0} can only be in a local group of its own rig; add one to this rig")]
    ForeignGroup(Uid),
    /// A joint was moved below something that is no joint of its rig.
    #[error("joint {0} can only hang below joints of its own rig that are in the document")]
    ForeignParent(Uid),
    /// A tag was spawned outside of the document.
    #[error("a tag was spawned on an entity that is no joint of the document; put it on a joint")]
    TagBearer,
    /// A spawned command names something that is no feature of its rig.
    #[error("a spawned command is in something that is no feature of its rig; put it into a feature of its own rig")]
    ForeignFeature,
    /// A tag is a command and a feature at once.
    #[error("a tag is a command or a feature, not both; give each an entity of its own")]
    TagKinds,
    /// A feature was put into a feature.
    #[error("a feature cannot be in a feature; put the commands of both into one, or into a switch of it")]
    NestedFeature,
    /// A tag lost its content, or names something that is no feature of its rig.
    #[error("tag {0} needs a command, in no feature but one of its own rig, or a feature; despawn it to delete it")]
    TagContent(Uid),
    /// A tag was put onto something that is no joint of its rig.
    #[error("tag {0} can only be on a joint of its own rig; despawn it to delete it")]
    TagJoint(Uid),
    /// A local group was spawned on a part of a rig.
    #[error("a local group was spawned on an entity that is no rig; give it to the rig itself")]
    GroupBearer,
    /// A local group was moved to another rig.
    #[error("local group \"{name}\" stays with its rig; add one to the other rig")]
    GroupRig {
        /// Name of the group.
        name: String,
    },
    /// A local group lost its content.
    #[error("local group \"{name}\" cannot lose its `LocalGroup`; despawn it")]
    GroupContent {
        /// Name of the group.
        name: String,
    },
}

impl EntityWriteError {
    /// Name of the component whose write was refused; `Entity` where an entity was spawned or despawned.
    pub fn component(&self) -> &'static str {
        match self {
            Self::Refused { write, .. } => write.component(),
            Self::Uid { .. } => "Uid",
            Self::CreatedNode | Self::CreatedConstraint { .. } => "Entity",
            Self::BuiltContent { component, .. } | Self::CreatedContent { component, .. } => component,
            Self::DrivenAttribute { .. } | Self::UnknownAttribute { .. } => "Attributes",
            Self::JointParent | Self::ForeignParent(_) => "ChildOf",
            Self::JointMarker(_) => "Joint",
            Self::ForeignGroup(_) => "InGroup",
            Self::TagBearer | Self::TagJoint(_) => "TagOf",
            Self::ForeignFeature | Self::NestedFeature => "InFeature",
            Self::TagContent(_) | Self::TagKinds => "CommandTag",
            Self::GroupBearer | Self::GroupRig { .. } => "GroupOf",
            Self::GroupContent { .. } => "LocalGroup",
        }
    }
}

/// Kind of a write to an entity.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum EntityWrite {
    /// A joint was spawned.
    #[error("a spawned joint")]
    SpawnedJoint,
    /// Joints were despawned.
    #[error("a despawned joint")]
    DespawnedJoint,
    /// The name of a rig was written.
    #[error("a write to the name of a rig")]
    RigName,
    /// The label of a joint was written.
    #[error("a write to a label")]
    Label,
    /// The kind of a joint was written: with weights or without.
    #[error("a write to the kind of a joint")]
    Kind,
    /// The group of a joint was written.
    #[error("a write to a group")]
    Group,
    /// The rest transform of a joint was written.
    #[error("a write to a rest pose")]
    Rest,
    /// The parent of a joint was written.
    #[error("a write to a parent")]
    Parent,
    /// A tag was spawned.
    #[error("a spawned tag")]
    SpawnedTag,
    /// A tag was despawned.
    #[error("a despawned tag")]
    DespawnedTag,
    /// The content of a tag was written.
    #[error("a write to a tag")]
    Tag,
    /// A tag was put onto another joint.
    #[error("a tag on another joint")]
    TagJoint,
    /// The order of the tags of a joint was written.
    #[error("an order of tags")]
    TagOrder,
    /// A local group was spawned.
    #[error("a spawned local group")]
    SpawnedLocalGroup,
    /// A local group was despawned.
    #[error("a despawned local group")]
    DespawnedLocalGroup,
    /// The content of a local group was written.
    #[error("a write to a local group")]
    LocalGroup,
}

impl EntityWrite {
    /// Name of the component that was written; `Entity` where an entity was spawned or despawned.
    pub fn component(self) -> &'static str {
        match self {
            Self::SpawnedJoint
            | Self::DespawnedJoint
            | Self::SpawnedTag
            | Self::DespawnedTag
            | Self::SpawnedLocalGroup
            | Self::DespawnedLocalGroup => "Entity",
            Self::RigName => "Name",
            Self::Label => "NodeLabel",
            Self::Kind => "Null",
            Self::Group => "InGroup",
            Self::Rest => "RestTransform",
            Self::Parent => "ChildOf",
            Self::Tag => "CommandTag",
            Self::TagJoint => "TagOf",
            Self::TagOrder => "Tags",
            Self::LocalGroup => "LocalGroup",
        }
    }
}
