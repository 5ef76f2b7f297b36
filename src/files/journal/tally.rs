//! Tally of changes, lost ones included: it gives the number of a journal's changes that a saved project holds.

use super::{Gap, SaveMark};

/// Tally of the changes of a journal in the order of its file.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct Tally {
    /// Number of changes that can be read.
    changes: usize,
    /// Position of the next change among all that were recorded.
    next: u64,
    /// False if the number of lost changes, or of changes before the journal, is unknown.
    is_sure: bool,
    /// Positions of changes that are lost.
    lost: Vec<u64>,
    /// Number of changes before each mark, and whether their positions are certain.
    marks: Vec<(usize, bool)>,
}

impl Tally {
    /// Starts at the position `first` of the first change, which the header gives.
    pub(super) fn begin(&mut self, first: u64) {
        self.next = first;
        self.is_sure = true;
    }

    /// Counts a change.
    pub(super) fn change(&mut self) {
        self.changes += 1;
        self.next = self.next.saturating_add(1);
    }

    /// Counts a mark.
    pub(super) fn mark(&mut self) {
        self.marks.push((self.changes, self.is_sure));
    }

    /// Counts the lost records of a gap.
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

    /// Number of changes that can be read.
    pub(super) fn changes(&self) -> usize {
        self.changes
    }

    /// Number of the journal's changes that the project saved at the mark with this index holds; `first` is the
    /// position of the first change.
    ///
    /// With uncertain positions, all changes before the mark count: a mark is written at once when a save begins.
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
