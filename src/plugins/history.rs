//! Undo and redo, one step a gesture, the selection included.

use std::{borrow::Cow, sync::Arc};

use bevy::prelude::*;
use undo::{Edit, Record};

use super::selection::Selection;
use crate::rig::{
    Rig, RigEdit, Uid, UidSource,
    operations::{MirrorPlane, Operation, OperationError},
    step::{Step, Timeline},
};

/// The steps that were done to a rig.
#[derive(Component, Default)]
pub struct RigHistory {
    record: Record<Entry>,
}

/// What an operation did.
#[derive(Debug, Clone)]
pub struct Recorded {
    /// What was done, in a few words.
    pub name: Cow<'static, str>,
    /// The step; `None` if nothing changed, which is no step.
    pub step: Option<Arc<Step>>,
}

/// A step in the record.
struct Entry {
    step: Arc<Step>,
    /// True until the step is recorded: its edits have been applied already.
    applied: bool,
}

/// What steps work on.
#[derive(Default)]
struct Editable {
    rig: Rig,
    selection: Vec<Uid>,
    /// True while a history is restored, when the rig is as it shall be already.
    inert: bool,
}

impl Edit for Entry {
    type Target = Editable;
    type Output = Result<Arc<Step>, String>;

    fn edit(&mut self, target: &mut Editable) -> Self::Output {
        if !std::mem::take(&mut self.applied) && !target.inert {
            apply_all(&mut target.rig, &self.step.forward)?;
        }
        target.selection.clone_from(&self.step.after);
        Ok(self.step.clone())
    }

    fn undo(&mut self, target: &mut Editable) -> Self::Output {
        if !target.inert {
            apply_all(&mut target.rig, &self.step.backward)?;
        }
        target.selection.clone_from(&self.step.before);
        Ok(self.step.clone())
    }
}

fn apply_all(rig: &mut Rig, edits: &[RigEdit]) -> Result<(), String> {
    edits.iter().try_for_each(|edit| rig.apply(edit).map(drop)).map_err(|error| error.to_string())
}

impl RigHistory {
    /// A history that was kept, for a rig in which its steps are in effect already.
    pub fn restored(timeline: &Timeline) -> Self {
        let mut record = Record::new();
        let mut target = Editable { inert: true, ..default() };
        for step in timeline.done.iter().chain(timeline.undone.iter().rev()) {
            let _ = record.edit(&mut target, Entry { step: step.clone(), applied: true });
        }
        for _ in &timeline.undone {
            let _ = record.undo(&mut target);
        }
        Self { record }
    }

    /// Runs an operation and records it as one step. Joints that the operation deleted leave the selection.
    pub fn edit(
        &mut self,
        rig: &mut Rig,
        selection: &mut Selection,
        uids: &mut UidSource,
        symmetry: Option<MirrorPlane>,
        operation: &Operation,
    ) -> Result<Recorded, OperationError> {
        let before = selection.0.clone();
        let outcome = operation.run(rig, uids, symmetry)?;
        let after = outcome
            .selected
            .unwrap_or_else(|| before.iter().copied().filter(|joint| rig.joint(*joint).is_some()).collect());
        let name = Cow::Borrowed(operation.name());
        // What changed nothing is no step: undoing it would seem to do nothing.
        if outcome.edits.is_empty() && after == before {
            return Ok(Recorded { name, step: None });
        }
        let step = Step { name: name.clone(), forward: outcome.edits, backward: outcome.inverses, before, after };
        let step = Arc::new(step);
        let entry = Entry { step: step.clone(), applied: true };
        let recorded = self.with(rig, selection, |record, target| record.edit(target, entry));
        debug_assert!(recorded.is_ok(), "a step that was applied already cannot fail");
        Ok(Recorded { name, step: Some(step) })
    }

    /// Takes the last step back and returns it, or `None` if there is none.
    pub fn undo(&mut self, rig: &mut Rig, selection: &mut Selection) -> Option<Result<Arc<Step>, String>> {
        self.with(rig, selection, Record::undo)
    }

    /// Does the last undone step again and returns it, or `None` if there is none.
    pub fn redo(&mut self, rig: &mut Rig, selection: &mut Selection) -> Option<Result<Arc<Step>, String>> {
        self.with(rig, selection, Record::redo)
    }

    /// Names of all steps, oldest first, and how many of them are in effect.
    pub fn steps(&self) -> (Vec<&str>, usize) {
        (self.record.entries().map(|entry| entry.as_ref().step.name.as_ref()).collect(), self.record.head())
    }

    fn with<T>(
        &mut self,
        rig: &mut Rig,
        selection: &mut Selection,
        change: impl FnOnce(&mut Record<Entry>, &mut Editable) -> T,
    ) -> T {
        let mut target =
            Editable { rig: std::mem::take(rig), selection: std::mem::take(&mut selection.0), inert: false };
        let result = change(&mut self.record, &mut target);
        *rig = target.rig;
        selection.0 = target.selection;
        result
    }
}
