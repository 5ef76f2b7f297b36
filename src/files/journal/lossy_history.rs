//! History from the records of a damaged journal; lost steps keep their place in it as far as possible.

use std::sync::Arc;

use super::{Gap, RecordKind};
use crate::rig::step::Step;

/// Steps in effect and undone steps; `None` stands for a lost step.
///
/// An undo does not say which step it takes back: it is the last one in effect. After a gap that may hide steps, undos
/// and redos, that is known only of steps that were done since.
#[derive(Default)]
pub(super) struct LossyHistory {
    done: Vec<Option<Arc<Step>>>,
    undone: Vec<Option<Arc<Step>>>,
    /// Index in `done` from which on the steps are certain.
    done_sure: usize,
    /// Index in `undone` from which on the steps are certain.
    undone_sure: usize,
}

impl LossyHistory {
    /// Follows a gap in which records are lost.
    pub(super) fn lose(&mut self, gap: &Gap) {
        if gap.is_unclear() {
            self.done_sure = self.done.len();
            self.undone_sure = self.undone.len();
        } else if gap.records == Some(1) && gap.kind == Some(RecordKind::Done) {
            self.done(None);
        }
    }

    /// Follows a step that was done.
    pub(super) fn done(&mut self, step: Option<Arc<Step>>) {
        self.undone.clear();
        self.undone_sure = 0;
        self.done.push(step);
    }

    /// Follows an undo of the last step, and returns that step; `None` if it is lost.
    pub(super) fn undo(&mut self) -> Option<Arc<Step>> {
        let step = if self.done.len() > self.done_sure { self.done.pop().flatten() } else { None };
        self.undone.push(step.clone());
        step
    }

    /// Follows a redo of the last undone step, and returns that step; `None` if it is lost.
    pub(super) fn redo(&mut self) -> Option<Arc<Step>> {
        let step = if self.undone.len() > self.undone_sure { self.undone.pop().flatten() } else { None };
        self.done.push(step.clone());
        step
    }

    /// Follows an undo of a step from before the journal.
    pub(super) fn undo_older(&mut self, step: Option<Arc<Step>>) {
        self.undone.push(step);
    }

    /// Follows a redo of a step from before the journal.
    pub(super) fn redo_older(&mut self, step: Option<Arc<Step>>) {
        self.done.push(step);
    }
}
