//! A document on which writes are tried one by one, and which is as it was afterwards.

use bevy::prelude::*;

use crate::rig::{Rig, RigEdit, Uid, UidSource, operations::Operation};

/// Writes of one frame, tried on a document.
pub(super) struct Trial<'a> {
    pub rig_entity: Entity,
    rig: &'a mut Rig,
    uids: &'a mut UidSource,
    edits: Vec<RigEdit>,
    inverses: Vec<RigEdit>,
    refused: Vec<String>,
    /// True if entities have to be made again though the document stays.
    pub respawn: bool,
}

/// The result of a [`Trial`].
pub(super) struct Tried {
    /// Edits that the document takes, in order.
    pub edits: Vec<RigEdit>,
    /// Reasons why it does not take the others.
    pub refused: Vec<String>,
    pub respawn: bool,
}

impl<'a> Trial<'a> {
    pub fn new(rig_entity: Entity, rig: &'a mut Rig, uids: &'a mut UidSource) -> Self {
        Self { rig_entity, rig, uids, edits: Vec::new(), inverses: Vec::new(), refused: Vec::new(), respawn: false }
    }

    /// The document with all edits so far.
    pub fn rig(&self) -> &Rig {
        self.rig
    }

    /// A uid that nothing in the rig has: the one that somebody asks for, if it is free.
    pub fn free_uid(&mut self, asked: Option<Uid>) -> Uid {
        match asked.filter(|uid| uid.0 != 0 && !self.rig.is_taken(*uid) && *uid != self.rig.uid()) {
            Some(uid) => uid,
            None => self.uids.next_uid(),
        }
    }

    /// Tries edits, all or none; false if the document refuses them.
    pub fn edit(&mut self, what: &str, edits: Vec<RigEdit>) -> bool {
        self.operate(what, &Operation::Edits(edits))
    }

    /// Tries an operation.
    pub fn operate(&mut self, what: &str, operation: &Operation) -> bool {
        match operation.run(self.rig, self.uids, None) {
            Ok(outcome) => {
                self.edits.extend(outcome.edits);
                // The inverses of one operation stand in the order in which they are applied.
                self.inverses.splice(0..0, outcome.inverses);
                true
            }
            Err(error) => {
                self.refuse(format!("{what} was not taken over: {error}"));
                false
            }
        }
    }

    /// Notes a write that cannot be an edit.
    pub fn refuse(&mut self, reason: String) {
        self.refused.push(reason);
    }

    /// Takes everything back.
    pub fn finish(self) -> Tried {
        for inverse in &self.inverses {
            let undone = self.rig.apply(inverse);
            debug_assert!(undone.is_ok(), "an inverse was refused: {undone:?}");
        }
        Tried { edits: self.edits, refused: self.refused, respawn: self.respawn }
    }
}
