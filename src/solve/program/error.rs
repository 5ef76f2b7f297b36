//! What can be wrong with a built rig that is to become a program.

use crate::rig::{BuiltConstraint, Constraint, Uid};

/// Why a [`BuiltRig`](crate::rig::BuiltRig) has no program. Every text names the constraint and the command that made it
/// by uid, and says what to do.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ProgramError {
    /// Two nodes have the same uid.
    #[error("two nodes have the uid {uid} ({first} and {second}); build the rig again so that each gets its own")]
    DuplicateNode {
        /// The uid.
        uid: Uid,
        /// Label of the first node.
        first: String,
        /// Label of the second.
        second: String,
    },
    /// A node stands before its parent, or its parent is not there.
    #[error("{node} names node {parent} of the list as its parent; parents must stand before their children")]
    ParentOrder {
        /// The node.
        node: String,
        /// What it names.
        parent: usize,
    },
    /// A number of a node or constraint is not finite, or a rotation has no length.
    #[error("{place} holds a number that is not finite or a rotation without length; correct the value")]
    NotFinite {
        /// The node or constraint.
        place: String,
    },
    /// A constraint names a node that is not there.
    #[error(
        "{constraint}: its {role} {node} is not in the rig; point it at a node of this rig, or declare it as an input"
    )]
    MissingNode {
        /// The constraint and its command.
        constraint: String,
        /// What the node is to the constraint.
        role: &'static str,
        /// The uid that was not found.
        node: Uid,
    },
    /// A constraint would move a node that is only an input.
    #[error("{constraint}: its {role} {node} lies outside the rig and cannot be driven; drive a node of this rig")]
    DrivenInput {
        /// The constraint and its command.
        constraint: String,
        /// What the node is to the constraint.
        role: &'static str,
        /// The input.
        node: Uid,
    },
    /// A constraint names an attribute that its node does not have.
    #[error("{constraint}: {node} has no attribute \"{name}\"; it has {known}")]
    MissingAttribute {
        /// The constraint and its command.
        constraint: String,
        /// The node.
        node: String,
        /// The name that was not found.
        name: String,
        /// What the node has.
        known: String,
    },
    /// Joints of a chain do not hang on one another.
    #[error("{constraint}: {child} must be a child of {parent}, on which the chain goes on; list the joints in order")]
    NotAChain {
        /// The constraint and its command.
        constraint: String,
        /// The joint that should be the parent.
        parent: String,
        /// The joint that should be its child.
        child: String,
    },
    /// A list of a constraint is too short.
    #[error("{constraint}: it has {found} {what} and needs at least {needed}")]
    TooFew {
        /// The constraint and its command.
        constraint: String,
        /// What there is too little of.
        what: &'static str,
        /// How many there are.
        found: usize,
        /// How many it needs.
        needed: usize,
    },
    /// A parameter of a constraint makes no sense.
    #[error("{constraint}: {problem}")]
    BadParameter {
        /// The constraint and its command.
        constraint: String,
        /// What is wrong and what to do.
        problem: String,
    },
    /// An exposed node is not in the rig.
    #[error("\"{name}\" shall be exposed but is not in the rig; expose one of its labels or uids")]
    UnknownExposed {
        /// The label or uid.
        name: String,
    },
    /// Constraints wait for one another.
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

/// Why a state was not changed or read.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum StateError {
    /// The program does not have the node.
    #[error(
        "the program has no node {0}: it is not in the rig, or was left out because it is neither a joint nor exposed"
    )]
    UnknownNode(Uid),
    /// The node takes no pose.
    #[error("node {0} takes no pose in this program; expose it when the program is compiled")]
    NotPosable(Uid),
    /// The node has no attribute of that name that can be set.
    #[error("node {node} has no attribute \"{name}\" in this program; expose the node when the program is compiled")]
    UnknownAttribute {
        /// The node.
        node: Uid,
        /// The name.
        name: String,
    },
    /// The program has no such input.
    #[error("the program has no input {0}; declare it when the program is compiled")]
    UnknownInput(Uid),
    /// A number is not finite, or a rotation has no length.
    #[error("the value for {0} is not finite or its rotation has no length; nothing was changed")]
    NotFinite(Uid),
}

/// Text for a constraint in errors.
pub(super) fn describe(constraint: &BuiltConstraint) -> String {
    format!("{} constraint {} of command {}", kind(&constraint.constraint), constraint.uid, constraint.command)
}

/// The kind of a constraint in words.
fn kind(constraint: &Constraint) -> &'static str {
    use Constraint as C;
    match constraint {
        C::Transform { .. } => "transform",
        C::Relative { .. } => "relative",
        C::Aim { .. } => "aim",
        C::TwoBone { .. } => "two-bone",
        C::Chain { .. } => "chain",
        C::Spline { .. } => "spline",
        C::Twist { .. } => "twist",
        C::Stretch { .. } => "stretch",
        C::Limit { .. } => "limit",
        C::Spring { .. } => "spring",
        C::DrivenKey { .. } => "driven key",
        C::Expression { .. } => "expression",
        C::Foot { .. } => "foot",
    }
}
