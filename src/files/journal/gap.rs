//! Gaps: records of a journal that cannot be used, and why.

use std::fmt;

use super::RecordKind;

/// Reason why a record cannot be used.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum Damage {
    /// The magic, format or session at the start of the file is damaged; they were found from the records' checksums.
    #[error("the first bytes of the file are damaged")]
    Prelude,
    /// The file ends within the record, as after a power cut.
    #[error("the file is cut off")]
    Cut,
    /// The length of the record is damaged.
    #[error("the length of the record is damaged")]
    Length,
    /// The checksum does not fit the record.
    #[error("the record is damaged: its checksum does not fit")]
    Checksum,
    /// Sound records follow directly on each other, but their numbers do not.
    #[error("records are missing")]
    Missing,
    /// A sound record is out of place, such as a second copy of it.
    #[error("the record stands in the wrong place")]
    Misplaced,
    /// The frame is damaged, but its fields follow from the records around it, so that the record is used all the same.
    #[error("the frame around the record is damaged, its content is whole")]
    Frame,
    /// The record is of a kind that this version does not have.
    #[error("the record is of a kind that this version does not know; update to recover it")]
    UnknownKind,
    /// The checksum fits, but the content is invalid at this place.
    #[error("the content of the record makes no sense")]
    Content,
    /// The record refers to weights whose own record is lost.
    #[error("the weights that it names are lost")]
    Weights,
    /// The record undoes or redoes a step that is lost.
    #[error("the step that it takes back or repeats is lost")]
    UnknownStep,
}

/// Number of records in a journal.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct RecordCount {
    /// Records whose checksum fits.
    pub sound: u64,
    /// Records that are damaged or missing, as far as the numbers of the other records show.
    pub lost: u64,
    /// True if the end of the file is damaged, so that more records may have been lost than are counted.
    pub may_be_more: bool,
}

impl RecordCount {
    /// Adds the records of a gap.
    pub(super) fn lose(&mut self, gap: &Gap) {
        self.lost += gap.records.unwrap_or(1);
        self.may_be_more |= gap.records.is_none();
    }
}

impl fmt::Display for RecordCount {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let at_least = if self.may_be_more { "at least " } else { "" };
        write!(f, "{} of {at_least}{} records", self.sound, self.sound + self.lost)
    }
}

/// A place of a journal where records cannot be used.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Gap {
    /// Start of the gap, in bytes from the start of the file.
    pub at: usize,
    /// Number of bytes from the start of the gap to the next sound record.
    pub bytes: usize,
    /// Number of lost records; `None` at the end of the file, where it is unknown; 0 where bytes are damaged but no
    /// record is lost.
    pub records: Option<u64>,
    /// Kind of the record, if the gap is one record whose head can be read.
    pub kind: Option<RecordKind>,
    /// Damage that makes the gap.
    pub damage: Damage,
    /// Number of [`RecoveredJournal::changes`](super::RecoveredJournal::changes) before the gap.
    pub changes: usize,
}

impl Gap {
    /// Gap at the start of a journal whose first record is not its header.
    pub(super) const NO_HEADER: Self =
        Self { at: 0, bytes: 0, records: Some(0), kind: Some(RecordKind::Header), damage: Damage::Missing, changes: 0 };

    /// True if a replay cannot ignore the gap.
    pub(super) fn loses(&self) -> bool {
        self.records != Some(0) || self.damage == Damage::Weights
    }

    /// True if an unknown number of steps may have been done or undone in the gap.
    pub(super) fn is_unclear(&self) -> bool {
        use RecordKind::{Context, Done, Mark, Skin};
        match (self.records, self.kind) {
            (Some(0), _) => false,
            // The kind can be trusted: a record whose kind alone is damaged is repaired and makes no gap.
            (Some(1), Some(Done | Skin | Mark | Context)) => false,
            _ => true,
        }
    }
}

impl fmt::Display for Gap {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match (self.records, self.kind) {
            (Some(0), _) => write!(f, "nothing is lost")?,
            (Some(1), Some(kind)) => write!(f, "{} is lost", name(kind))?,
            (Some(1), None) => write!(f, "1 record is lost")?,
            (Some(records), _) => write!(f, "{records} records are lost")?,
            (None, _) => write!(f, "the last {} bytes are lost", self.bytes)?,
        }
        let edits = if self.changes == 1 { "edit" } else { "edits" };
        write!(f, " after {} {edits}, at byte {}: {}", self.changes, self.at, self.damage)
    }
}

/// Name of a kind of record, for people.
fn name(kind: RecordKind) -> &'static str {
    match kind {
        RecordKind::Header => "the record of what the work started from",
        RecordKind::Base => "a copy of the rig that the work started with",
        RecordKind::Done => "a step",
        RecordKind::Undone | RecordKind::UndoneOlder => "an undo",
        RecordKind::Redone | RecordKind::RedoneOlder => "a redo",
        RecordKind::Skin => "a set of weights",
        RecordKind::Mark => "the note of a save",
        RecordKind::Context => "the list of open meshes",
        RecordKind::End => "the note that the document was closed",
    }
}
