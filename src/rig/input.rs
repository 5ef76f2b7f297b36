//! Inputs: things outside of a rig that its commands refer to, such as a steering wheel.

use serde::{Deserialize, Serialize};

use crate::rig::{RestTransform, Uid};

/// An input that a rig declares. An app puts an entity into it; without one it stands where it is declared.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RigInput {
    /// Identity.
    pub uid: Uid,
    /// The name by which apps and references find it.
    pub name: String,
    /// Declared place, in the rig's space.
    pub rest: RestTransform,
}
