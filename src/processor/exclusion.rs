//! Exclusion from a build: joints, commands and features that a document switches off, and what depends on them.
//!
//! A joint is off with its local group, a command with its tag, its feature or its joint's group. A reference that means
//! something that is off finds a [`Gap`] in its place. Where a module cannot do without it, the build passes the command
//! over, which is a gap for those that refer to its nodes in turn. References that are merely wrong stay errors.

use std::sync::Arc;

use bevy::platform::collections::HashMap;

use super::world::NodeId;
use crate::rig::Uid;

/// Switch that is off, and the thing that it excludes from the build.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum Exclusion {
    /// The local group of a joint.
    #[error("{joint} is in the group {group}, which is off")]
    Joint {
        /// Label of the joint.
        joint: Arc<str>,
        /// Name of the group.
        group: Arc<str>,
    },
    /// A local group whose nodes are looked for.
    #[error("the group {0} is off")]
    Group(Arc<str>),
    /// The feature of a command.
    #[error("{command} is in the feature {feature}, which is off")]
    Feature {
        /// Module of the command and label of its joint.
        command: Arc<str>,
        /// Name of the feature, with its switch after a colon.
        feature: Arc<str>,
    },
    /// The tag of a command.
    #[error("the tag {0} is off")]
    Tag(Arc<str>),
}

/// Reason why a build passes a command over.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum SkipReason {
    /// Tag of the command, its feature or its joint's group is off.
    #[error(transparent)]
    Own(Exclusion),
    /// A reference that it cannot do without means something that is off.
    #[error("{parameter}: {off}")]
    Reference {
        /// The parameter.
        parameter: Arc<str>,
        /// Switch that is off.
        off: Exclusion,
    },
}

impl SkipReason {
    /// The switch that is off.
    pub fn off(&self) -> &Exclusion {
        match self {
            Self::Own(off) | Self::Reference { off, .. } => off,
        }
    }
}

/// Place in a list of nodes that is empty because something is off.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Gap {
    /// The number of nodes before it in the list.
    pub at: usize,
    /// Switch that is off.
    pub off: Exclusion,
    /// The nearest node above what is missing that is built.
    pub above: Option<NodeId>,
}

/// Joint that is left out with its group.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct JointExclusion {
    pub off: Exclusion,
    /// The nearest joint above it that is built.
    pub above: Option<NodeId>,
}

/// Command that is passed over.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct CommandExclusion {
    pub module: Arc<str>,
    pub reason: SkipReason,
    /// The nearest node above that is built of what is missing; `None` where a switch alone decides.
    pub above: Option<NodeId>,
}

/// Exclusions of a document, and gaps of commands that do without excluded nodes.
#[derive(Debug, Clone, Default)]
pub(super) struct Exclusions {
    /// Local groups that are off, with their names.
    pub groups: HashMap<Uid, Arc<str>>,
    /// Joints in them.
    pub joints: HashMap<Uid, JointExclusion>,
    /// Commands that are passed over, by number.
    pub commands: HashMap<u32, CommandExclusion>,
    /// Commands that made less than they would, because a list of theirs has gaps: numbers of their nodes are others.
    pub partial: HashMap<u32, Gap>,
}

impl Exclusions {
    /// The gap that a joint leaves, if it is off.
    pub fn joint(&self, uid: Uid) -> Option<Gap> {
        self.joints.get(&uid).map(|joint| Gap { at: 0, off: joint.off.clone(), above: joint.above })
    }

    /// The gap that the nodes of a command leave, if it is passed over.
    pub fn command(&self, number: u32) -> Option<Gap> {
        self.commands.get(&number).map(CommandExclusion::gap)
    }
}

impl CommandExclusion {
    /// True if a switch of the command itself is off, and not only a node that the command refers to.
    pub fn is_own(&self) -> bool {
        matches!(self.reason, SkipReason::Own(_))
    }

    pub fn gap(&self) -> Gap {
        Gap { at: 0, off: self.reason.off().clone(), above: self.above }
    }
}
