//! Undo and redo, one step a gesture, the selection included.

use std::{borrow::Cow, sync::Arc};

use bevy::prelude::*;
use undo::{Edit, Record};

use super::selection::Selection;
use crate::rig::{
    Rig, RigEdit, Uid, UidSource,
    operations::{MirrorPlane, Operation, OperationError, Outcome},
    step::{Step, Timeline},
};

/// The steps that were done to a rig.
#[derive(Component, Default)]
pub struct RigHistory {
    record: Record<Entry>,
    preview: Option<Preview>,
}

/// What a drag under way has done to a rig: in the rig already, not in the record.
struct Preview {
    name: &'static str,
    outcome: Outcome,
}

/// What an operation did.
#[derive(Debug, Clone)]
pub struct Recorded {
    /// What was done, in a few words.
    pub name: Cow<'static, str>,
    /// The step; `None` if nothing changed, which is no step.
    pub step: Option<Arc<Step>>,
    /// What people should know about it, a sentence each.
    pub notes: Vec<String>,
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
        Self { record, preview: None }
    }

    /// Runs an operation and records it as one step. Joints that the operation deleted leave the selection. A preview is
    /// taken back before.
    pub fn edit(
        &mut self,
        rig: &mut Rig,
        selection: &mut Selection,
        uids: &mut UidSource,
        symmetry: Option<MirrorPlane>,
        operation: &Operation,
    ) -> Result<Recorded, OperationError> {
        self.cancel_preview(rig);
        let outcome = operation.run(rig, uids, symmetry)?;
        Ok(self.record(rig, selection, operation.name(), outcome))
    }

    /// Shows what an operation would do: the rig changes, its history does not. What was previewed before is taken back
    /// first, so each preview starts from the rig as it was before the first.
    ///
    /// # Errors
    /// If the operation is refused; then nothing is previewed any more.
    pub fn preview(
        &mut self,
        rig: &mut Rig,
        uids: &mut UidSource,
        symmetry: Option<MirrorPlane>,
        operation: &Operation,
    ) -> Result<&'static str, OperationError> {
        self.cancel_preview(rig);
        let (name, outcome) = (operation.name(), operation.run(rig, uids, symmetry)?);
        self.preview = Some(Preview { name, outcome });
        Ok(name)
    }

    /// Records what is previewed as one step; `None` if nothing is.
    pub fn commit_preview(&mut self, rig: &mut Rig, selection: &mut Selection) -> Option<Recorded> {
        let Preview { name, outcome } = self.preview.take()?;
        Some(self.record(rig, selection, name, outcome))
    }

    /// Takes back what is previewed, to the bit; false if nothing is.
    pub fn cancel_preview(&mut self, rig: &mut Rig) -> bool {
        let Some(preview) = self.preview.take() else { return false };
        let undone = apply_all(rig, &preview.outcome.inverses);
        debug_assert!(undone.is_ok(), "a preview could not be taken back: {undone:?}");
        true
    }

    /// True while the rig shows what is not in its history.
    pub fn is_previewing(&self) -> bool {
        self.preview.is_some()
    }

    /// The rig without what is only previewed: what is saved.
    pub fn settled<'a>(&self, rig: &'a Rig) -> Cow<'a, Rig> {
        let Some(preview) = &self.preview else { return Cow::Borrowed(rig) };
        let mut rig = rig.clone();
        let undone = apply_all(&mut rig, &preview.outcome.inverses);
        debug_assert!(undone.is_ok(), "a preview could not be taken back: {undone:?}");
        Cow::Owned(rig)
    }

    /// Records what has been applied already.
    fn record(&mut self, rig: &mut Rig, selection: &mut Selection, name: &'static str, outcome: Outcome) -> Recorded {
        let before = selection.0.clone();
        let after = outcome
            .selected
            .unwrap_or_else(|| before.iter().copied().filter(|joint| rig.joint(*joint).is_some()).collect());
        let name = Cow::Borrowed(name);
        // What changed nothing is no step: undoing it would seem to do nothing.
        if outcome.edits.is_empty() && after == before {
            return Recorded { name, step: None, notes: outcome.notes };
        }
        let step = Step { name: name.clone(), forward: outcome.edits, backward: outcome.inverses, before, after };
        let step = Arc::new(step);
        let entry = Entry { step: step.clone(), applied: true };
        let recorded = self.with(rig, selection, |record, target| record.edit(target, entry));
        debug_assert!(recorded.is_ok(), "a step that was applied already cannot fail");
        Recorded { name, step: Some(step), notes: outcome.notes }
    }

    /// Takes the last step back and returns it, or `None` if there is none. A preview is taken back before.
    pub fn undo(&mut self, rig: &mut Rig, selection: &mut Selection) -> Option<Result<Arc<Step>, String>> {
        self.cancel_preview(rig);
        self.with(rig, selection, Record::undo)
    }

    /// Does the last undone step again and returns it, or `None` if there is none. A preview is taken back before.
    pub fn redo(&mut self, rig: &mut Rig, selection: &mut Selection) -> Option<Result<Arc<Step>, String>> {
        self.cancel_preview(rig);
        self.with(rig, selection, Record::redo)
    }

    /// Names of all steps, oldest first, and how many of them are in effect.
    pub fn steps(&self) -> (Vec<&str>, usize) {
        (self.record.entries().map(|entry| entry.as_ref().step.name.as_ref()).collect(), self.record.head())
    }

    /// The last step in effect; the same one again after undo and redo, and after nothing else.
    pub fn last(&self) -> Option<&Arc<Step>> {
        let before = self.record.head().checked_sub(1)?;
        self.record.entries().nth(before).map(|entry| &entry.as_ref().step)
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
