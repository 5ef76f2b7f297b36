//! Undo and redo, one step a gesture, the selection included.

use std::{borrow::Cow, sync::Arc};

use bevy::prelude::*;

use super::selection::Selection;
use crate::rig::{
    Rig, RigEdit, UidSource,
    operations::{MirrorPlane, Operation, OperationError, Outcome},
    step::{Committed, Step, UndoStacks},
};

/// The steps that were done to a rig.
#[derive(Component, Default)]
pub struct RigHistory {
    stacks: UndoStacks,
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

/// True if edits delete a joint. Created nodes stay selected: their commands may build them again.
fn removes(edits: &[RigEdit], joint: crate::rig::Uid) -> bool {
    edits.iter().any(|edit| match edit {
        RigEdit::RemoveJoint(removed) => *removed == joint,
        RigEdit::Batch(edits) => removes(edits, joint),
        _ => false,
    })
}

fn apply_all(rig: &mut Rig, edits: &[RigEdit]) -> Result<(), String> {
    edits.iter().try_for_each(|edit| rig.apply(edit).map(drop)).map_err(|error| error.to_string())
}

impl RigHistory {
    /// A history that was kept, for a rig in which its steps are in effect already.
    pub fn restored(stacks: &UndoStacks) -> Self {
        Self { stacks: stacks.clone(), preview: None }
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
        Ok(self.record(selection, operation.name(), outcome))
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
    pub fn commit_preview(&mut self, selection: &mut Selection) -> Option<Recorded> {
        let Preview { name, outcome } = self.preview.take()?;
        Some(self.record(selection, name, outcome))
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
    fn record(&mut self, selection: &mut Selection, name: &'static str, outcome: Outcome) -> Recorded {
        let before = selection.0.clone();
        let after = outcome
            .selected
            .unwrap_or_else(|| before.iter().copied().filter(|node| !removes(&outcome.edits, *node)).collect());
        let name = Cow::Borrowed(name);
        // What changed nothing is no step: undoing it would seem to do nothing.
        if outcome.edits.is_empty() && after == before {
            return Recorded { name, step: None, notes: outcome.notes };
        }
        let step = Step { name: name.clone(), forward: outcome.edits, backward: outcome.inverses, before, after };
        let step = Arc::new(step);
        selection.0.clone_from(&step.after);
        self.stacks.follow(&Committed::Done(step.clone()));
        Recorded { name, step: Some(step), notes: outcome.notes }
    }

    /// Takes the last step back and returns it, or `None` if there is none. A preview is taken back before.
    pub fn undo(&mut self, rig: &mut Rig, selection: &mut Selection) -> Option<Result<Arc<Step>, String>> {
        self.cancel_preview(rig);
        let step = self.stacks.done.last()?.clone();
        if let Err(error) = apply_all(rig, &step.backward) {
            return Some(Err(error));
        }
        selection.0.clone_from(&step.before);
        self.stacks.follow(&Committed::Undone(step.clone()));
        Some(Ok(step))
    }

    /// Does the last undone step again and returns it, or `None` if there is none. A preview is taken back before.
    pub fn redo(&mut self, rig: &mut Rig, selection: &mut Selection) -> Option<Result<Arc<Step>, String>> {
        self.cancel_preview(rig);
        let step = self.stacks.undone.last()?.clone();
        if let Err(error) = apply_all(rig, &step.forward) {
            return Some(Err(error));
        }
        selection.0.clone_from(&step.after);
        self.stacks.follow(&Committed::Redone(step.clone()));
        Some(Ok(step))
    }

    /// True if a step that was undone can be done again.
    pub fn can_redo(&self) -> bool {
        !self.stacks.undone.is_empty()
    }

    /// Names of all steps, oldest first, and how many of them are in effect.
    pub fn steps(&self) -> (Vec<&str>, usize) {
        let UndoStacks { done, undone } = &self.stacks;
        (done.iter().chain(undone.iter().rev()).map(|step| step.name.as_ref()).collect(), done.len())
    }

    /// The last step in effect; the same one again after undo and redo, and after nothing else.
    pub fn last(&self) -> Option<&Arc<Step>> {
        self.stacks.done.last()
    }
}
