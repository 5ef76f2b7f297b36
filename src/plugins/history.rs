//! Undo and redo, one step for each gesture; a step restores the selection as well.
//!
//! A history holds the last [`MOST_STEPS`] steps at least, unless their weights take more than [`MOST_WEIGHT_BYTES`]: older
//! ones are dropped, so that a long day takes no more memory than a morning.

use std::{borrow::Cow, collections::HashSet, sync::Arc};

use bevy::prelude::*;

use super::selection::Selection;
use crate::rig::{
    EditError, Rig, RigEdit, Uid, UidSource,
    operations::{MirrorPlane, Operation, OperationError, Outcome},
    step::{Commit, Step, UndoStacks},
};

/// Number of steps that a history holds at least; it drops older ones a tenth of that at a time.
pub const MOST_STEPS: usize = 2_000;

/// Bytes of weights that the steps of a history hold at most, besides those of the last step.
pub const MOST_WEIGHT_BYTES: usize = 1 << 30;

/// Steps done to a rig and steps that can be redone, with the preview of a drag.
#[derive(Component, Reflect, Clone, Default)]
#[reflect(opaque)]
#[reflect(Component, Clone, Default)]
pub struct RigHistory {
    stacks: UndoStacks,
    /// Last step that was dropped; it stays in effect.
    bottom: Option<Arc<Step>>,
    /// Number of times that steps left the history: a new one discarded undone ones, or old ones were dropped.
    discarded: u64,
    preview: Option<Preview>,
}

/// Preview of a drag: its edits are applied to the rig but not recorded.
#[derive(Clone)]
struct Preview {
    name: &'static str,
    /// Title of the step that it becomes.
    title: Cow<'static, str>,
    outcome: Outcome,
}

/// Outcome of a recorded operation.
#[derive(Debug, Clone)]
pub struct RecordedOperation {
    /// Short name of the operation.
    pub name: Cow<'static, str>,
    /// Recorded step; `None` if the operation changed nothing.
    pub step: Option<Arc<Step>>,
    /// Notes for people, a sentence each.
    pub notes: Vec<String>,
}

/// True if edits delete a joint. Created nodes never count as deleted, since their commands may build them again.
fn removes(edits: &[RigEdit], joint: Uid) -> bool {
    edits.iter().any(|edit| match edit {
        RigEdit::RemoveJoint(removed) => *removed == joint,
        RigEdit::Batch(edits) => removes(edits, joint),
        _ => false,
    })
}

/// Name of a joint of a rig: its label, or the first digits of its uid.
pub(super) fn joint_name(rig: &Rig, joint: Uid) -> Option<String> {
    let label = rig.joint(joint)?.data.label.clone();
    Some(label.unwrap_or_else(|| format!("joint {:04x}", joint.0 >> 48)))
}

/// Name of a joint in a sentence: its label in quotes, or its uid.
pub(super) fn quoted_name(rig: &Rig, joint: Uid) -> String {
    let label = rig.joint(joint).and_then(|joint| joint.data.label.clone());
    label.map_or_else(|| format!("joint {joint}"), |label| format!("\"{label}\""))
}

fn apply_all(rig: &mut Rig, edits: &[RigEdit]) -> Result<(), EditError> {
    edits.iter().try_for_each(|edit| rig.apply(edit).map(drop))
}

impl RigHistory {
    /// A stored history, for a rig in which its steps are already in effect.
    pub fn restored(stacks: &UndoStacks) -> Self {
        Self { stacks: stacks.clone(), ..Self::default() }
    }

    /// Runs an operation and records it as one step. Joints that the operation deletes leave the selection. A preview
    /// is reverted first.
    ///
    /// # Errors
    /// The operation is refused; then the rig is as it was without a preview.
    pub fn edit(
        &mut self,
        rig: &mut Rig,
        selection: &mut Selection,
        uids: &mut UidSource,
        symmetry: Option<MirrorPlane>,
        operation: &Operation,
    ) -> Result<RecordedOperation, OperationError> {
        self.cancel_preview(rig);
        let title = operation.title(rig, &|node| joint_name(rig, node));
        self.edit_as(title, rig, selection, uids, symmetry, operation)
    }

    /// Runs an operation as [`Self::edit`] does, and gives its step a title.
    ///
    /// # Errors
    /// As for [`Self::edit`].
    pub fn edit_as(
        &mut self,
        title: Cow<'static, str>,
        rig: &mut Rig,
        selection: &mut Selection,
        uids: &mut UidSource,
        symmetry: Option<MirrorPlane>,
        operation: &Operation,
    ) -> Result<RecordedOperation, OperationError> {
        self.cancel_preview(rig);
        let outcome = operation.run(rig, uids, symmetry)?;
        Ok(self.record(selection, operation.name(), title, outcome))
    }

    /// Previews an operation, whose step gets a title: the rig changes, its history does not. A former preview is reverted
    /// first, so that each preview starts from the rig without one.
    ///
    /// # Errors
    /// The operation is refused; then no preview remains.
    pub fn preview(
        &mut self,
        title: Cow<'static, str>,
        rig: &mut Rig,
        uids: &mut UidSource,
        symmetry: Option<MirrorPlane>,
        operation: &Operation,
    ) -> Result<&'static str, OperationError> {
        self.cancel_preview(rig);
        let (name, outcome) = (operation.name(), operation.run(rig, uids, symmetry)?);
        self.preview = Some(Preview { name, title, outcome });
        Ok(name)
    }

    /// Records the preview as one step; `None` without a preview.
    pub fn commit_preview(&mut self, selection: &mut Selection) -> Option<RecordedOperation> {
        let Preview { name, title, outcome } = self.preview.take()?;
        Some(self.record(selection, name, title, outcome))
    }

    /// Reverts the preview exactly, bit by bit; false without a preview.
    pub fn cancel_preview(&mut self, rig: &mut Rig) -> bool {
        let Some(preview) = self.preview.take() else { return false };
        let undone = apply_all(rig, &preview.outcome.inverses);
        debug_assert!(undone.is_ok(), "a preview could not be taken back: {undone:?}");
        true
    }

    /// True while the rig shows a preview that its history does not have.
    pub fn is_previewing(&self) -> bool {
        self.preview.is_some()
    }

    /// The rig without the preview, as it is saved.
    pub fn settled<'a>(&self, rig: &'a Rig) -> Cow<'a, Rig> {
        let Some(preview) = &self.preview else { return Cow::Borrowed(rig) };
        let mut rig = rig.clone();
        let undone = apply_all(&mut rig, &preview.outcome.inverses);
        debug_assert!(undone.is_ok(), "a preview could not be taken back: {undone:?}");
        Cow::Owned(rig)
    }

    /// Records an operation whose edits have already been applied.
    fn record(
        &mut self,
        selection: &mut Selection,
        name: &'static str,
        title: Cow<'static, str>,
        outcome: Outcome,
    ) -> RecordedOperation {
        let before = selection.0.clone();
        let after = outcome
            .selected
            .unwrap_or_else(|| before.iter().copied().filter(|node| !removes(&outcome.edits, *node)).collect());
        let name = Cow::Borrowed(name);
        // An operation without effect makes no step: undoing it would seem to do nothing.
        if outcome.edits.is_empty() && after == before {
            return RecordedOperation { name, step: None, notes: outcome.notes };
        }
        let step = Step { name: title, forward: outcome.edits, backward: outcome.inverses, before, after };
        let step = Arc::new(step);
        selection.0.clone_from(&step.after);
        self.discarded += u64::from(self.can_redo());
        self.stacks.follow(&Commit::Done(step.clone()));
        self.drop_old(&step);
        RecordedOperation { name, step: Some(step), notes: outcome.notes }
    }

    /// Drops the oldest steps where there are too many, or too heavy ones, after a step was recorded.
    fn drop_old(&mut self, recorded: &Step) {
        let done = &mut self.stacks.done;
        let mut count = if done.len() >= MOST_STEPS + MOST_STEPS / 10 { done.len() - MOST_STEPS } else { 0 };
        if recorded.weight_bytes() > 0 {
            let mut bytes = 0;
            let fits = |step: &&Arc<Step>| {
                bytes += step.weight_bytes();
                bytes <= MOST_WEIGHT_BYTES
            };
            let kept = done.iter().rev().skip(1).take_while(fits).count() + 1;
            count = count.max(done.len() - kept);
        }
        if let Some(last) = done.drain(..count).next_back() {
            self.bottom = Some(last);
            self.discarded += 1;
        }
    }

    /// Undoes the last step and returns it; `None` without a step. A preview is reverted first.
    pub fn undo(&mut self, rig: &mut Rig, selection: &mut Selection) -> Option<Result<Arc<Step>, EditError>> {
        self.cancel_preview(rig);
        let step = self.stacks.done.last()?.clone();
        if let Err(error) = apply_all(rig, &step.backward) {
            return Some(Err(error));
        }
        selection.0.clone_from(&step.before);
        self.stacks.follow(&Commit::Undone(step.clone()));
        Some(Ok(step))
    }

    /// Redoes the last undone step and returns it; `None` without one. A preview is reverted first.
    pub fn redo(&mut self, rig: &mut Rig, selection: &mut Selection) -> Option<Result<Arc<Step>, EditError>> {
        self.cancel_preview(rig);
        let step = self.stacks.undone.last()?.clone();
        if let Err(error) = apply_all(rig, &step.forward) {
            return Some(Err(error));
        }
        selection.0.clone_from(&step.after);
        self.stacks.follow(&Commit::Redone(step.clone()));
        Some(Ok(step))
    }

    /// True if an undone step can be redone.
    pub fn can_redo(&self) -> bool {
        !self.stacks.undone.is_empty()
    }

    /// Number of times that steps left the history, which can never be redone or undone.
    pub fn discarded(&self) -> u64 {
        self.discarded
    }

    /// Uids of the joints and tags that undoing or redoing some step restores.
    pub fn restorable(&self) -> HashSet<Uid> {
        let steps = self.stacks.done.iter().chain(&self.stacks.undone);
        let mut uids = HashSet::new();
        steps.flat_map(|step| step.forward.iter().chain(&step.backward)).for_each(|edit| edit.added(&mut uids));
        uids
    }

    /// Names of all steps, oldest first, and how many of them are in effect.
    pub fn steps(&self) -> (Vec<&str>, usize) {
        let UndoStacks { done, undone } = &self.stacks;
        (done.iter().chain(undone.iter().rev()).map(|step| step.name.as_ref()).collect(), done.len())
    }

    /// Steps that can be redone, the next one last.
    pub fn undone_steps(&self) -> impl Iterator<Item = &Arc<Step>> {
        self.stacks.undone.iter()
    }

    /// Number of undone steps.
    pub fn undone(&self) -> usize {
        self.stacks.undone.len()
    }

    /// Number of steps in effect after a step, all of them for `None`; 0 if the step itself is not in effect.
    pub fn steps_since(&self, step: Option<&Arc<Step>>) -> usize {
        let Some(step) = step else { return self.stacks.done.len() };
        self.stacks.done.iter().rev().position(|known| Arc::ptr_eq(known, step)).unwrap_or(0)
    }

    /// Last step in effect, even if it is too old to be undone; `None` where there was none. The same step again means that
    /// nothing happened in between but its undo and redo.
    pub fn last(&self) -> Option<&Arc<Step>> {
        self.stacks.done.last().or(self.bottom.as_ref())
    }
}
