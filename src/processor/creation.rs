//! Parameters that all modules share that make nodes: names, labels, groups.

use serde::{Deserialize, Serialize};

use crate::rig::Uid;

/// Creation parameters. What is left out comes from the joint that carries the tag.
#[derive(bevy::reflect::Reflect, Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Creation {
    /// Name of the nodes in files and lists; several get a number.
    pub name: Option<String>,
    /// The rig; only the tag's own can be written.
    pub global_group: Option<Uid>,
    /// The local group.
    pub local_group: Option<Uid>,
    /// The label that references find the nodes by.
    pub label: Option<String>,
}
