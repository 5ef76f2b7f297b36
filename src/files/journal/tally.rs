//! Counting changes, lost ones included: how many of those in a journal a saved project holds.

use super::{Gap, SaveMark};

/// Counts the changes of a journal in the order of its file.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct Tally {
    /// Changes that are there.
    changes: usize,
    /// Position of the next change among all that were recorded.
    next: u64,
    /// False while nobody knows how many changes were lost, or how many came before the journal.
    is_sure: bool,
    /// Positions of changes that are lost.
    lost: Vec<u64>,
    /// For each mark how many changes come before it, and whether their positions are sure.
    marks: Vec<(usize, bool)>,
}

impl Tally {
    /// The header says that the first change has the position `first`.
    pub(super) fn begin(&mut self, first: u64) {
        self.next = first;
        self.is_sure = true;
    }

    /// A change is there.
    pub(super) fn change(&mut self) {
        self.changes += 1;
        self.next = self.next.saturating_add(1);
    }

    /// A mark is there.
    pub(super) fn mark(&mut self) {
        self.marks.push((self.changes, self.is_sure));
    }

    /// Records are lost.
    pub(super) fn lose(&mut self, gap: &Gap) {
        match (gap.records, gap.kind) {
            (Some(0), _) => {}
            (Some(1), Some(kind)) if !kind.is_change() => {}
            (Some(1), Some(_)) => {
                self.lost.push(self.next);
                self.next = self.next.saturating_add(1);
            }
            _ => self.is_sure = false,
        }
    }

    /// Changes that are there.
    pub(super) fn changes(&self) -> usize {
        self.changes
    }

    /// Number of the changes that are there and in the project that was saved at the mark with this index; `first` is the
    /// position of the first change.
    ///
    /// If positions are not sure, all before the mark count: it is written at once when a save begins.
    pub(super) fn contained(&self, index: usize, mark: &SaveMark, first: u64) -> usize {
        let Some(&(before, is_sure)) = self.marks.get(index) else { return 0 };
        if !is_sure {
            return before;
        }
        let lost = self.lost.iter().filter(|position| **position < mark.position).count() as u64;
        let contained = mark.position.saturating_sub(first).saturating_sub(lost);
        usize::try_from(contained).unwrap_or(usize::MAX).min(self.changes)
    }
}
