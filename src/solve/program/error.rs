//! Errors of compiling a built rig into a program, and of its states.

use std::fmt;

use crate::rig::{BuiltConstraint, Uid};

/// Error of compiling a [`BuiltRig`](crate::rig::BuiltRig). Every text names the constraint and the command that made
/// it by uid, and says what to do.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ProgramError {
    /// Two nodes with the same uid.
    #[error("two nodes have the uid {uid} ({first} and {second}); build the rig again so that each gets its own")]
    DuplicateNode {
        /// Uid of both nodes.
        uid: Uid,
        /// Label of the first node.
        first: String,
        /// Label of the second node.
        second: String,
    },
    /// A node before its parent, or without one at its parent's index.
    #[error("{node} names node {parent} of the list as its parent; parents must stand before their children")]
    ParentOrder {
        /// Label of the node.
        node: String,
        /// Index of the parent.
        parent: usize,
    },
    /// A number of a node or constraint that is not finite, or a rotation without length.
    #[error("{place} holds a number that is not finite or a rotation without length; correct the value")]
    NotFinite {
        /// Node or constraint with the number.
        place: NumberPlace,
    },
    /// A constraint that refers to a node outside the rig.
    #[error(
        "{constraint}: its {role} {node} is not in the rig; point it at a node of this rig, or declare it as an input"
    )]
    MissingNode {
        /// The constraint and its command.
        constraint: ConstraintName,
        /// Role of the node in the constraint.
        role: &'static str,
        /// Uid without a node.
        node: Uid,
    },
    /// A constraint that would move a node that is only an input.
    #[error("{constraint}: its {role} {node} lies outside the rig and cannot be driven; drive a node of this rig")]
    DrivenInput {
        /// The constraint and its command.
        constraint: ConstraintName,
        /// Role of the node in the constraint.
        role: &'static str,
        /// Uid of the input.
        node: Uid,
    },
    /// A constraint that refers to an attribute that its node does not have.
    #[error("{constraint}: {node} has no attribute \"{name}\"; it has {known}")]
    MissingAttribute {
        /// The constraint and its command.
        constraint: ConstraintName,
        /// Label of the node.
        node: String,
        /// Name without an attribute.
        name: String,
        /// Names of the node's attributes.
        known: String,
    },
    /// Joints of a chain that are not parent and child.
    #[error("{constraint}: {child} must be a child of {parent}, on which the chain goes on; list the joints in order")]
    NotAChain {
        /// The constraint and its command.
        constraint: ConstraintName,
        /// Label of the joint that should be the parent.
        parent: String,
        /// Label of the joint that should be its child.
        child: String,
    },
    /// A list of a constraint that is too short.
    #[error("{constraint}: it has {found} {what} and needs at least {needed}")]
    TooFew {
        /// The constraint and its command.
        constraint: ConstraintName,
        /// Name of the list's content.
        what: &'static str,
        /// Number of entries.
        found: usize,
        /// Number of entries needed.
        needed: usize,
    },
    /// An invalid parameter of a constraint.
    #[error("{constraint}: {problem}")]
    BadParameter {
        /// The constraint and its command.
        constraint: ConstraintName,
        /// Description of the problem, with a hint.
        problem: String,
    },
    /// An exposed node that is not in the rig.
    #[error("\"{name}\" shall be exposed but is not in the rig; expose one of its labels or uids")]
    UnknownExposed {
        /// Label or uid of the node.
        name: String,
    },
    /// A cycle of constraints that wait for one another.
    #[error(
        "a cycle of constraints: {loop_text}; remove one of these constraints, or let it read a node outside the loop"
    )]
    Cycle {
        /// The loop in words, with labels and uids.
        loop_text: String,
        /// The constraints of the loop.
        constraints: Vec<Uid>,
        /// The commands that made them.
        commands: Vec<Uid>,
        /// The nodes of the loop.
        nodes: Vec<Uid>,
    },
}

/// Error of setting or reading a state.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum StateError {
    /// A node that the program does not have.
    #[error(
        "the program has no node {0}: it is not in the rig, or was left out because it is neither a joint nor exposed"
    )]
    UnknownNode(Uid),
    /// A node that takes no pose.
    #[error("node {0} takes no pose in this program; expose it when the program is compiled")]
    NotPosable(Uid),
    /// An attribute that the node does not have or that cannot be set.
    #[error("node {node} has no attribute \"{name}\" in this program; expose the node when the program is compiled")]
    UnknownAttribute {
        /// Uid of the node.
        node: Uid,
        /// Name of the attribute.
        name: String,
    },
    /// An input that the program does not have.
    #[error("the program has no input {0}; declare it when the program is compiled")]
    UnknownInput(Uid),
    /// A number that is not finite, or a rotation without length.
    #[error("the value for {0} is not finite or its rotation has no length; nothing was changed")]
    NotFinite(Uid),
}

/// Identity of a constraint in errors.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ConstraintName {
    /// Kind of constraint, in words.
    pub kind: &'static str,
    /// Uid of the constraint.
    pub uid: Uid,
    /// Uid of the command that made it.
    pub command: Uid,
}

impl fmt::Display for ConstraintName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} constraint {} of command {}", self.kind, self.uid, self.command)
    }
}

impl From<&BuiltConstraint> for ConstraintName {
    fn from(constraint: &BuiltConstraint) -> Self {
        Self { kind: constraint.constraint.kind(), uid: constraint.uid, command: constraint.command }
    }
}

/// Place of a number that a program cannot use.
#[derive(Debug, Clone, PartialEq)]
pub enum NumberPlace {
    /// The base transform of a node, with its label.
    Base(String),
    /// A constraint.
    Constraint(ConstraintName),
}

impl fmt::Display for NumberPlace {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Base(node) => write!(f, "the base of {node}"),
            Self::Constraint(constraint) => constraint.fmt(f),
        }
    }
}

impl ProgramError {
    /// Uids of the commands that made the constraints at fault, in the order in which the text names them; empty if no
    /// constraint is at fault.
    pub fn commands(&self) -> &[Uid] {
        match self {
            Self::MissingNode { constraint, .. }
            | Self::DrivenInput { constraint, .. }
            | Self::MissingAttribute { constraint, .. }
            | Self::NotAChain { constraint, .. }
            | Self::TooFew { constraint, .. }
            | Self::BadParameter { constraint, .. }
            | Self::NotFinite { place: NumberPlace::Constraint(constraint) } => {
                std::slice::from_ref(&constraint.command)
            }
            Self::Cycle { commands, .. } => commands,
            Self::DuplicateNode { .. }
            | Self::ParentOrder { .. }
            | Self::NotFinite { place: NumberPlace::Base(_) }
            | Self::UnknownExposed { .. } => &[],
        }
    }
}
