//! Errors of putting a part into a rig.

use super::{OptionError, SocketError};
use crate::rig::{EditError, Uid, operations::OperationError};

/// Reason why a part does not fit the rig that uses it, or an instance does not fit its part.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum PartError {
    /// A chain with a number of joints outside its range.
    #[error("chain \"{chain}\" takes {min} to {max} joints, not {count}")]
    ChainLength {
        /// Name of the chain.
        chain: String,
        /// Smallest number of joints.
        min: usize,
        /// Largest number of joints.
        max: usize,
        /// Number of joints of the instance.
        count: usize,
    },
    /// A chain of joints outside the part.
    #[error("chain \"{chain}\" names joints that the part does not have")]
    ForeignChain {
        /// Name of the chain.
        chain: String,
    },
    /// A chain whose number of joints cannot be changed.
    #[error("chain \"{chain}\": {source}")]
    ChainEdit {
        /// Name of the chain.
        chain: String,
        /// The edit's error.
        source: EditError,
    },
    /// A number of joints for a part without chains.
    #[error("the part has no chain that takes other numbers of joints")]
    NoChains,
    /// A number of joints without a chain's name, for a part with several.
    #[error("the part has several chains; name one of {}", known.join(", "))]
    UnnamedChain {
        /// Names of the chains.
        known: Vec<String>,
    },
    /// A chain that the part does not have.
    #[error("the part has no chain \"{name}\"{nearest}")]
    UnknownChain {
        /// Name without a chain.
        name: String,
        /// End of the sentence with similar names.
        nearest: String,
    },
    /// Parts, and parts of parts, that bring more than a template takes.
    #[error(
        "the parts of the template would bring more than {most} joints and tags; use this part, and those that it has \
         itself, less often"
    )]
    TooLarge {
        /// Largest number of joints and tags.
        most: usize,
    },
    /// More joints of the host than the part has.
    #[error("{given} joints are given, and the part has only {count}; take some away")]
    TooManyJoints {
        /// Number of joints of the host.
        given: usize,
        /// Number of joints of the part.
        count: usize,
    },
    /// A joint that the host does not have.
    #[error("there is no joint \"{label}\"{nearest}")]
    UnknownHostJoint {
        /// Label without a joint.
        label: String,
        /// End of the sentence with similar labels.
        nearest: String,
    },
    /// A joint that the part does not have.
    #[error("the part has no joint \"{label}\"{nearest}")]
    UnknownJoint {
        /// Label without a joint.
        label: String,
        /// End of the sentence with similar labels.
        nearest: String,
    },
    /// A joint of the part without a counterpart in the host.
    #[error("joint \"{label}\" of the part is not used here")]
    UnusedJoint {
        /// Label of the joint.
        label: String,
    },
    /// A feature that the part does not have.
    #[error("the part has no feature \"{name}\"{nearest}")]
    UnknownFeature {
        /// Name without a feature.
        name: String,
        /// End of the sentence with similar names.
        nearest: String,
    },
    /// A tag that the part does not have.
    #[error("the part has no tag \"{name}\"{nearest}")]
    UnknownTag {
        /// Name without a tag.
        name: String,
        /// End of the sentence with similar names.
        nearest: String,
    },
    /// A name of several tags.
    #[error("the part has {count} tags \"{name}\"; say which: \"{name}#1\" to \"{name}#{count}\"")]
    AmbiguousTag {
        /// Name of the tags.
        name: String,
        /// Number of tags with that name.
        count: usize,
    },
    /// A tag on a joint of the part without a counterpart in the host.
    #[error("tag {tag} is on a joint that is not used here")]
    UnusedTag {
        /// Uid of the tag.
        tag: Uid,
    },
    /// A socket that is not there.
    #[error(transparent)]
    Socket(#[from] SocketError),
    /// An option that the part does not have, or a value that it does not take.
    #[error(transparent)]
    Option(#[from] OptionError),
    /// An edit that the host refused.
    #[error(transparent)]
    Edit(#[from] EditError),
    /// A drop that the host refused.
    #[error(transparent)]
    Drop(#[from] OperationError),
}
