//! Which joints of a rig are selected.

use bevy::prelude::*;

use crate::rig::Uid;

/// Selected joints of a rig; the last one is active: the parent of what is placed next.
#[derive(Component, Debug, Clone, PartialEq, Eq, Default)]
pub struct Selection(pub Vec<Uid>);

impl Selection {
    /// The joint that was selected last.
    pub fn active(&self) -> Option<Uid> {
        self.0.last().copied()
    }
}

/// The joint under the pointer: what a click would pick now.
#[derive(Component, Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Hovered(pub Option<Uid>);
