//! Header of the shown rig with the changes of one frame.
//!
//! A click leaves the field that is being typed, so that the typed text and what was clicked come in one frame: each is a step,
//! and the second keeps the first.

use bevy::prelude::Entity;

use crate::{
    editor::{library::header_step, panel::Requests, panels::displayed_rig::DisplayedRig},
    rig::RigAbout,
};

/// Header that is being changed.
pub(super) struct HeaderDraft {
    rig: Entity,
    about: RigAbout,
}

impl HeaderDraft {
    pub fn of(shown: &DisplayedRig) -> Self {
        Self { rig: shown.entity, about: shown.rig.about().clone() }
    }

    /// Sends a change as one step. Lists only grow by the changes of a frame until the last of them, so that numbers of their
    /// elements hold.
    pub fn change(&mut self, name: &'static str, requests: &mut Requests, change: impl FnOnce(&mut RigAbout)) {
        let mut about = self.about.clone();
        change(&mut about);
        // A change that is refused, with its reason, takes no other along.
        if about.check().is_ok() {
            self.about = about.clone();
        }
        requests.send(header_step(self.rig, name, about));
    }
}
