//! Tags: instructions on joints.
//!
//! A command tag names a module and its parameters; a feature tag names a switch that turns commands on and off. The
//! parameters stay text here: only their module knows their types, so tags of modules that are not installed are
//! preserved.

use serde::{Deserialize, Serialize};

use crate::rig::Uid;

/// A tag on a joint.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct TagData {
    /// Identity.
    pub uid: Uid,
    /// A disabled tag is skipped by a build.
    pub enabled: bool,
    /// A note for people.
    pub comment: String,
    /// Kind of the tag with its data.
    pub kind: TagKind,
}

/// The kinds of tag that are entities of their own (identifier tags become fields of the joint).
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub enum TagKind {
    /// Runs a module when the rig is built.
    Command {
        /// The module's name.
        module: String,
        /// The module's parameters as RON text, exactly as written in the file.
        params: String,
        /// The feature tag that turns this command on and off.
        feature: Option<Uid>,
    },
    /// Turns commands on and off.
    Feature {
        /// The kind of feature, from the registry.
        kind: String,
        /// The name animators see; empty if the feature only organises.
        name: String,
        /// A secondary name that turns a part of the feature on and off.
        switch: String,
        /// The choice that the switch is one of: of the switches of one choice of a feature, exactly one is on. Empty
        /// for a switch that stands for itself.
        #[serde(default, skip_serializing_if = "String::is_empty")]
        choice: String,
    },
}
