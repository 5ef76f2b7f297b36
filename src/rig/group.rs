//! Local groups: named, coloured sets of joints.

use serde::{Deserialize, Serialize};

use crate::rig::Uid;

/// A local group of a rig. A joint is in at most one.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct GroupData {
    /// Identity.
    pub uid: Uid,
    /// The name people see.
    pub name: String,
    /// sRGB colour of the group's joints, 0 to 1 each.
    pub color: [f32; 3],
    /// Joints of a disabled group are left out of the built rig.
    pub enabled: bool,
}
