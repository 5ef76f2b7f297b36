//! Writes to the entity of a rig itself: its name and its uid.

use bevy::prelude::*;

use super::{Adoption, EntityWrite, sorting::RigWrites};
use crate::rig::{RigAbout, RigEdit};

impl Adoption<'_, '_, '_, '_, '_, '_> {
    /// Adopts a name that was written to the rig's entity, also at its spawn, and restores the uid of the document.
    pub fn rig_written(&mut self, writes: &RigWrites) {
        let entity = self.trial.rig_entity;
        let Some(view) = self.views.get(entity).ok().filter(|_| writes.is_rig_written) else { return };
        self.trial.look_at_entity(entity);
        let (uid, told) = (self.rig().uid(), view.uid.copied());
        // A rig that was spawned since the last frame has no uid yet, unless other code gave it one.
        if told != self.joints.rig_uid {
            self.hold_uid(entity, uid, told);
        }
        let about = self.rig().about().clone();
        let told = view.name.map(|name| name.as_str().to_owned());
        if told == self.joints.rig_name {
            return;
        }
        match told.filter(|name| !name.is_empty()) {
            Some(name) if name == about.name => self.joints.rig_name = Some(name),
            Some(name) => {
                let renamed = RigAbout { name: name.clone(), ..about.clone() };
                if self.trial.edit(EntityWrite::RigName, vec![RigEdit::SetAbout(Box::new(renamed))]) {
                    self.joints.rig_name = Some(name);
                } else {
                    self.commands.entity(entity).try_insert(Name::new(about.name));
                }
            }
            // An empty name counts as none.
            None => {
                self.commands.entity(entity).try_insert(Name::new(about.name));
            }
        }
    }
}
