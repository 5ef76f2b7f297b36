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

/// Colours of groups without a chosen colour, distinguishable with a colour vision deficiency, too (the palette of
/// Okabe and Ito 2008, without black).
pub const GROUP_COLORS: [[f32; 3]; 7] = [
    [0.90, 0.62, 0.00],
    [0.34, 0.71, 0.91],
    [0.00, 0.62, 0.45],
    [0.94, 0.89, 0.26],
    [0.00, 0.45, 0.70],
    [0.84, 0.37, 0.00],
    [0.80, 0.47, 0.65],
];
