//! Trial of writes on a document, one by one; the document is restored afterwards.

use bevy::prelude::*;

use super::super::error::{EntityWrite, EntityWriteError};
use crate::rig::{Rig, RigEdit, Uid, UidSource, operations::Operation};

/// Writes of one frame, tried on a document.
pub(super) struct Trial<'a> {
    pub rig_entity: Entity,
    rig: &'a mut Rig,
    uids: &'a mut UidSource,
    edits: Vec<RigEdit>,
    inverses: Vec<RigEdit>,
    refused: Vec<EntityWriteError>,
    /// True if entities have to be spawned or written again although the document stays the same.
    pub respawn: bool,
}

/// The result of a [`Trial`].
pub(super) struct TrialResult {
    /// Edits that the document accepts, in order.
    pub edits: Vec<RigEdit>,
    /// Reasons for refusing the other edits.
    pub refused: Vec<EntityWriteError>,
    pub respawn: bool,
}

impl<'a> Trial<'a> {
    pub fn new(rig_entity: Entity, rig: &'a mut Rig, uids: &'a mut UidSource) -> Self {
        Self { rig_entity, rig, uids, edits: Vec::new(), inverses: Vec::new(), refused: Vec::new(), respawn: false }
    }

    /// Document with all edits so far.
    pub fn rig(&self) -> &Rig {
        self.rig
    }

    /// Uid that nothing in the rig has: `asked` if it is free, else the next one of the source.
    pub fn free_uid(&mut self, asked: Option<Uid>) -> Uid {
        match asked.filter(|uid| uid.0 != 0 && !self.rig.is_taken(*uid) && *uid != self.rig.uid()) {
            Some(uid) => uid,
            None => self.uids.next_uid(),
        }
    }

    /// Tries edits, all or none; returns false if the document refuses them.
    pub fn edit(&mut self, write: EntityWrite, edits: Vec<RigEdit>) -> bool {
        self.operate(write, &Operation::Edits(edits))
    }

    /// Tries an operation; returns false if the document refuses it.
    pub fn operate(&mut self, write: EntityWrite, operation: &Operation) -> bool {
        match operation.run(self.rig, self.uids, None) {
            Ok(outcome) => {
                self.edits.extend(outcome.edits);
                // Inverses of one operation are listed in the order in which they are applied.
                self.inverses.splice(0..0, outcome.inverses);
                true
            }
            Err(source) => {
                self.refuse(EntityWriteError::Refused { write, source });
                false
            }
        }
    }

    /// Records the reason for refusing a write that cannot be an edit.
    pub fn refuse(&mut self, reason: EntityWriteError) {
        self.refused.push(reason);
    }

    /// Reverts all tried edits and returns them.
    pub fn finish(self) -> TrialResult {
        for inverse in &self.inverses {
            let undone = self.rig.apply(inverse);
            debug_assert!(undone.is_ok(), "an inverse was refused: {undone:?}");
        }
        TrialResult { edits: self.edits, refused: self.refused, respawn: self.respawn }
    }
}
