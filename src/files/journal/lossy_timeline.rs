//! The history that the records of a damaged journal tell: steps that are lost keep their place in it as far as possible.

use std::sync::Arc;

use super::{Gap, RecordKind};
use crate::rig::step::Step;

/// Steps in effect and steps undone; `None` stands for a step that is lost.
///
/// An undo does not say which step it takes back: it is the last one in effect. After a gap that may hide steps, undos
/// and redos, that is known only of steps that were done since.
#[derive(Default)]
pub(super) struct LossyTimeline {
    done: Vec<Option<Arc<Step>>>,
    undone: Vec<Option<Arc<Step>>>,
    /// From this index on, `done` is sure.
    done_sure: usize,
    /// From this index on, `undone` is sure.
    undone_sure: usize,
}

impl LossyTimeline {
    /// Records are lost.
    pub(super) fn lose(&mut self, gap: &Gap) {
        if gap.is_unclear() {
            self.done_sure = self.done.len();
            self.undone_sure = self.undone.len();
        } else if gap.records == Some(1) && gap.kind == Some(RecordKind::Done) {
            self.done(None);
        }
    }

    /// A step was done.
    pub(super) fn done(&mut self, step: Option<Arc<Step>>) {
        self.undone.clear();
        self.undone_sure = 0;
        self.done.push(step);
    }

    /// The last step was undone; `None` if nobody knows it.
    pub(super) fn undo(&mut self) -> Option<Arc<Step>> {
        let step = if self.done.len() > self.done_sure { self.done.pop().flatten() } else { None };
        self.undone.push(step.clone());
        step
    }

    /// The last step undone was done again; `None` if nobody knows it.
    pub(super) fn redo(&mut self) -> Option<Arc<Step>> {
        let step = if self.undone.len() > self.undone_sure { self.undone.pop().flatten() } else { None };
        self.done.push(step.clone());
        step
    }

    /// A step from before the journal was undone.
    pub(super) fn undo_older(&mut self, step: Option<Arc<Step>>) {
        self.undone.push(step);
    }

    /// A step from before the journal was done again.
    pub(super) fn redo_older(&mut self, step: Option<Arc<Step>>) {
        self.done.push(step);
    }
}
