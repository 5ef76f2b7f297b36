//! Selection: the selected joints of a rig.

use bevy::prelude::*;

use crate::rig::Uid;

/// Selected joints of a rig; the last one is active: the parent of the next placed joint.
#[derive(Component, Reflect, Debug, Clone, PartialEq, Eq, Default)]
#[reflect(Component, Default)]
pub struct Selection(pub Vec<Uid>);

impl Selection {
    /// The joint that was selected last.
    pub fn active(&self) -> Option<Uid> {
        self.0.last().copied()
    }
}

/// The joint under the pointer, which a click would pick.
#[derive(Component, Reflect, Debug, Clone, Copy, PartialEq, Eq, Default)]
#[reflect(Component, Default)]
pub struct HoveredNode(pub Option<Uid>);
