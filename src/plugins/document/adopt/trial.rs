//! Trial of writes on a document, one by one; the document is restored afterwards.

use std::collections::BTreeMap;

use bevy::prelude::*;

use super::super::{
    error::{EntityWrite, EntityWriteError},
    refusals::{Bearer, RefusalLog},
};
use crate::rig::{Rig, RigEdit, Uid, UidSource, operations::Operation};

/// Writes of one frame, tried on a document.
pub(super) struct Trial<'a> {
    pub rig_entity: Entity,
    rig: &'a mut Rig,
    uids: &'a mut UidSource,
    edits: Vec<RigEdit>,
    inverses: Vec<RigEdit>,
    /// Bearer that is looked at.
    bearer: Bearer,
    looks: Vec<Bearer>,
    refused: Vec<(Bearer, EntityWriteError)>,
    accepted: Vec<(Bearer, EntityWrite)>,
    /// True if entities have to be spawned or written again although the document stays the same.
    pub respawn: bool,
}

/// The result of a [`Trial`].
pub(super) struct TrialResult {
    /// Edits that the document accepts, in order.
    pub edits: Vec<RigEdit>,
    /// Bearers that were looked at, reasons for refusing writes to them, and accepted writes.
    looks: Vec<Bearer>,
    refused: Vec<(Bearer, EntityWriteError)>,
    accepted: Vec<(Bearer, EntityWrite)>,
    pub respawn: bool,
}

impl TrialResult {
    /// Takes the reasons to tell: those of writes that were not told already.
    pub fn take_refused(&mut self, told: &mut RefusalLog) -> Vec<EntityWriteError> {
        if told.is_empty() && self.refused.is_empty() {
            return Vec::new();
        }
        for (bearer, write) in self.accepted.drain(..) {
            told.accept(bearer, write.component());
        }
        let mut looks: BTreeMap<Bearer, Vec<EntityWriteError>> = BTreeMap::new();
        looks.extend(self.looks.drain(..).map(|bearer| (bearer, Vec::new())));
        for (bearer, reason) in self.refused.drain(..) {
            looks.entry(bearer).or_default().push(reason);
        }
        looks.into_iter().flat_map(|(bearer, refused)| told.look(bearer, refused)).collect()
    }
}

impl<'a> Trial<'a> {
    pub fn new(rig_entity: Entity, rig: &'a mut Rig, uids: &'a mut UidSource) -> Self {
        let bearer = Bearer::Entity(rig_entity);
        let (edits, inverses, looks) = (Vec::new(), Vec::new(), Vec::new());
        let (refused, accepted, respawn) = (Vec::new(), Vec::new(), false);
        Self { rig_entity, rig, uids, edits, inverses, bearer, looks, refused, accepted, respawn }
    }

    /// Begins a look at a part of the rig: writes to it are tried from now on.
    pub fn look_at(&mut self, part: Uid) {
        self.bearer = Bearer::Part(self.rig_entity, part);
        self.looks.push(self.bearer);
    }

    /// Begins a look at an entity that is no part of the rig yet, or at that of the rig itself.
    pub fn look_at_entity(&mut self, entity: Entity) {
        self.bearer = Bearer::Entity(entity);
        self.looks.push(self.bearer);
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
                self.accepted.push((self.bearer, write));
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
        self.refused.push((self.bearer, reason));
    }

    /// Reverts all tried edits and returns them.
    pub fn finish(self) -> TrialResult {
        for inverse in &self.inverses {
            let undone = self.rig.apply(inverse);
            debug_assert!(undone.is_ok(), "an inverse was refused: {undone:?}");
        }
        let Self { edits, looks, refused, accepted, respawn, .. } = self;
        TrialResult { edits, looks, refused, accepted, respawn }
    }
}
