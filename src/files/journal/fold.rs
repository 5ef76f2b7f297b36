//! Folding: the oldest changes of a long journal become part of the rig that it starts from, so that neither the memory nor
//! the file of a day's work grows with the number of edits since the last save.
//!
//! The document comes back as before. Of the history, as many steps come back as a history holds.

use std::sync::Arc;

use super::Content;
use crate::rig::{
    Rig, RigEdit,
    step::{Commit, Step},
};

/// Number of steps in effect that a journal keeps when it folds: more than a history keeps.
pub(super) const KEPT_STEPS: usize = 11_000;

/// Number of changes that a journal holds where no undo and redo is among them. One of undos and redos alone holds more, since
/// they share their steps, but not much more than ten times as many.
pub const MOST_CHANGES: usize = 2 * KEPT_STEPS;

/// Bytes of weights that a journal keeps when it folds; it holds twice as many at most.
const KEPT_WEIGHT_BYTES: usize = 1 << 30;

/// Rig at the start of a journal's changes.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct StartRig {
    /// The rig.
    pub rig: Arc<Rig>,
    /// Number of the journal's changes that the rig holds.
    pub contained: usize,
}

/// Measure of a journal's content: when it has to fold.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Measure {
    /// Number of changes at which the next look is worth its time.
    look_at: usize,
    /// Bytes of weights of all changes.
    weights: usize,
}

impl Measure {
    /// Measures a content.
    pub fn of(content: &Content) -> Self {
        let held = content.changes.len();
        let look_at = if held < MOST_CHANGES { MOST_CHANGES } else { held + KEPT_STEPS };
        Self { look_at, weights: content.changes.iter().map(weight_bytes).sum() }
    }

    /// Waits for the next time, where nothing could be moved.
    pub fn put_off(&mut self) {
        self.weights = 0;
    }

    /// Follows a change that was added; true if it is time to fold.
    pub fn add(&mut self, committed: &Commit, held: usize) -> bool {
        self.weights += weight_bytes(committed);
        held >= self.look_at || self.weights > 2 * KEPT_WEIGHT_BYTES
    }
}

/// Bytes of weights that a change binds meshes with. An undo or redo shares those of its step.
fn weight_bytes(committed: &Commit) -> usize {
    match committed {
        Commit::Done(step) => Step::weight_bytes(step),
        Commit::Undone(_) | Commit::Redone(_) => 0,
    }
}

impl Content {
    /// Moves the oldest changes into the rig that the journal starts from; returns false if there is nothing to move, or if
    /// the rig is not known.
    pub(super) fn fold(&mut self) -> bool {
        let count = self.surplus();
        if count == 0 || !self.advance(count) {
            return false;
        }
        self.base.clone_from(&self.known);
        self.changes.drain(..count);
        self.first = self.first.saturating_add(count as u64);
        // A project that was saved before holds less than the rig, and nothing of the journal is needed on top of it.
        self.marks.retain(|mark| mark.position >= self.first);
        true
    }

    /// Brings the known rig over the first `count` changes; false, and no rig is known, if it does not take them.
    pub(super) fn advance(&mut self, count: usize) -> bool {
        let Some(known) = self.known.take() else { return false };
        let mut rig = Arc::unwrap_or_clone(known);
        let mut changes = self.changes.iter().take(count);
        let is_whole = changes.all(|change| rig.apply(&RigEdit::Batch(change.effect().0.to_vec())).is_ok());
        self.known = is_whole.then(|| Arc::new(rig));
        is_whole
    }

    /// Number of the oldest changes that can be left out.
    fn surplus(&self) -> usize {
        let held = self.changes.len();
        // At least so many steps done behind a place are in effect at the end.
        let mut in_effect = 0;
        let mut by_steps = 0;
        for (at, change) in self.changes.iter().enumerate().rev() {
            in_effect += if matches!(change, Commit::Undone(_)) { -1 } else { 1 };
            if in_effect >= KEPT_STEPS as i64 {
                by_steps = at;
                break;
            }
        }
        if held >= 10 * MOST_CHANGES {
            by_steps = by_steps.max(held - MOST_CHANGES);
        }
        let mut bytes = 0;
        let fits = |change: &&Commit| {
            bytes += weight_bytes(change);
            bytes <= KEPT_WEIGHT_BYTES
        };
        // The last change stays, however heavy it is.
        let light = self.changes.iter().rev().skip(1).take_while(fits).count() + 1;
        by_steps.max(held.saturating_sub(light))
    }
}
