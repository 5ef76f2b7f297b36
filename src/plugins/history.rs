//! Undo and redo, one step a gesture, the selection included.

use bevy::prelude::*;
use undo::{Edit, Record};

use super::selection::Selection;
use crate::rig::{
    Rig, RigEdit, Uid, UidSource,
    operations::{MirrorPlane, Operation, OperationError},
};

/// The steps that were done to a rig.
#[derive(Component, Default)]
pub struct RigHistory {
    record: Record<Step>,
}

/// One step: edits that were applied together, and the selection around them.
struct Step {
    name: &'static str,
    forward: Vec<RigEdit>,
    backward: Vec<RigEdit>,
    before: Vec<Uid>,
    after: Vec<Uid>,
    /// True until the step is recorded: its edits have been applied already.
    applied: bool,
}

/// What steps work on.
#[derive(Default)]
struct Editable {
    rig: Rig,
    selection: Vec<Uid>,
}

impl Edit for Step {
    type Target = Editable;
    type Output = Result<&'static str, String>;

    fn edit(&mut self, target: &mut Editable) -> Self::Output {
        if !std::mem::take(&mut self.applied) {
            apply_all(&mut target.rig, &self.forward)?;
        }
        target.selection.clone_from(&self.after);
        Ok(self.name)
    }

    fn undo(&mut self, target: &mut Editable) -> Self::Output {
        apply_all(&mut target.rig, &self.backward)?;
        target.selection.clone_from(&self.before);
        Ok(self.name)
    }
}

fn apply_all(rig: &mut Rig, edits: &[RigEdit]) -> Result<(), String> {
    edits.iter().try_for_each(|edit| rig.apply(edit).map(drop)).map_err(|error| error.to_string())
}

impl RigHistory {
    /// Runs an operation and records it as one step; returns its name. Joints that the operation deleted leave the
    /// selection.
    pub fn edit(
        &mut self,
        rig: &mut Rig,
        selection: &mut Selection,
        uids: &mut UidSource,
        symmetry: Option<MirrorPlane>,
        operation: &Operation,
    ) -> Result<&'static str, OperationError> {
        let before = selection.0.clone();
        let outcome = operation.run(rig, uids, symmetry)?;
        let after = outcome
            .selected
            .unwrap_or_else(|| before.iter().copied().filter(|joint| rig.joint(*joint).is_some()).collect());
        // What changed nothing is no step: undoing it would seem to do nothing.
        if outcome.edits.is_empty() && after == before {
            return Ok(operation.name());
        }
        let step = Step {
            name: operation.name(),
            forward: outcome.edits,
            backward: outcome.inverses,
            before,
            after,
            applied: true,
        };
        let recorded = self.with(rig, selection, |record, target| record.edit(target, step));
        debug_assert!(recorded.is_ok(), "a step that was applied already cannot fail");
        Ok(operation.name())
    }

    /// Takes the last step back; its name, or `None` if there is none.
    pub fn undo(&mut self, rig: &mut Rig, selection: &mut Selection) -> Option<Result<&'static str, String>> {
        self.with(rig, selection, Record::undo)
    }

    /// Does the last undone step again; its name, or `None` if there is none.
    pub fn redo(&mut self, rig: &mut Rig, selection: &mut Selection) -> Option<Result<&'static str, String>> {
        self.with(rig, selection, Record::redo)
    }

    /// Names of all steps, oldest first, and how many of them are in effect.
    pub fn steps(&self) -> (Vec<&'static str>, usize) {
        (self.record.entries().map(|entry| entry.as_ref().name).collect(), self.record.head())
    }

    fn with<T>(
        &mut self,
        rig: &mut Rig,
        selection: &mut Selection,
        change: impl FnOnce(&mut Record<Step>, &mut Editable) -> T,
    ) -> T {
        let mut target = Editable { rig: std::mem::take(rig), selection: std::mem::take(&mut selection.0) };
        let result = change(&mut self.record, &mut target);
        *rig = target.rig;
        selection.0 = target.selection;
        result
    }
}
