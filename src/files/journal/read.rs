//! Reader of journals. The bytes may be anything: torn, damaged, or no journal at all.

use std::sync::Arc;

use super::{
    Content, Damage, Gap, Origin, RecordCount, RecordKind, SaveMark,
    encode::Header,
    lossy_history::LossyHistory,
    scan::{Item, Scan},
    tally::Tally,
    text::{SkinsIn, StepIn, read_rig, read_step, read_value},
};
use crate::{
    files::ReadError,
    rig::{
        Rig,
        skin::read_skin_data,
        step::{Commit, Step},
    },
};

/// Largest size in bytes of a journal that is read.
pub const MAX_JOURNAL: u64 = 8 << 30;

/// Reason for reading nothing from a journal.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum JournalError {
    /// The file does not begin like a journal, and has no records of one.
    #[error("this is not a journal: it does not begin with RIGJRNL, and holds no records")]
    NotAJournal,
    /// The journal was written by a later version.
    #[error("the journal has format {found}, this version reads up to {known}; update to recover the work in it")]
    Newer {
        /// Format of the file.
        found: u32,
        /// Highest format that this version reads.
        known: u32,
    },
    /// The file holds no sound record.
    #[error("the journal is damaged, and none of its records can be read; open the last saved file")]
    NothingSound,
    /// The file cannot be read.
    #[error("the journal cannot be read: {0}")]
    Read(#[source] ReadError),
}

/// End of a journal's file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Ending {
    /// A whole record, but not the one that ends a journal: the process died, or is still at work.
    Open,
    /// The record that ends a journal: nothing is to be recovered.
    Closed,
    /// Bytes that are no record: the last of the [gaps](RecoveredJournal::gaps).
    Torn,
}

/// Content of a journal.
#[derive(Debug, Clone, PartialEq)]
pub struct RecoveredJournal {
    /// Session that wrote the journal.
    pub session: u64,
    /// Id of the process that wrote the journal; 0 if it is lost.
    pub process: u32,
    /// Ending of the file.
    pub ending: Ending,
    pub(super) content: Content,
    pub(super) gaps: Vec<Gap>,
    count: RecordCount,
    tally: Tally,
    /// Steps with edits in one direction only, because those in the other direction refer to lost weights.
    pub(super) one_way: Vec<Arc<Step>>,
}

/// Rig on which a journal is replayed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Basis {
    /// The rig that the journal holds.
    Journal,
    /// The rig of the project file at [`RecoveredJournal::project`], which already holds the first `contained` changes.
    Project {
        /// Number of [`RecoveredJournal::changes`] that the project file holds.
        contained: usize,
    },
    /// The project file was changed by another program since, or is gone. Replaying all changes on its present content
    /// is a guess that people should confirm.
    Changed,
}

impl RecoveredJournal {
    /// Places where records cannot be used, in the order of the file.
    pub fn gaps(&self) -> &[Gap] {
        &self.gaps
    }

    /// True if the file differs from the written one, even if nothing is lost.
    pub fn is_damaged(&self) -> bool {
        !self.gaps.is_empty()
    }

    /// Numbers of sound and of lost records.
    pub fn records(&self) -> RecordCount {
        self.count
    }

    /// Start of the work.
    pub fn origin(&self) -> &Origin {
        &self.content.origin
    }

    /// Time at which the work started, in seconds since 1970.
    pub fn started(&self) -> u64 {
        self.content.started
    }

    /// Rig at the start of the work; `None` if the project file holds it, or if it is lost.
    pub fn base(&self) -> Option<&Rig> {
        self.content.base.as_deref()
    }

    /// The latest text given to [`Journal::context`](super::Journal::context).
    pub fn context(&self) -> &str {
        &self.content.context
    }

    /// The changes, in order.
    pub fn changes(&self) -> &[Commit] {
        &self.content.changes
    }

    /// Saves that were at least begun, in order.
    pub fn marks(&self) -> &[SaveMark] {
        &self.content.marks
    }

    /// The project file that was last saved or opened, if there is one.
    pub fn project(&self) -> Option<&std::path::Path> {
        let opened = match &self.content.origin {
            Origin::Project { path, .. } => Some(path.as_path()),
            _ => None,
        };
        self.content.marks.last().map(|mark| mark.path.as_path()).or(opened)
    }

    /// Assumes that the work started from `project`, which the journal is beside, if the journal's own record of its
    /// start is lost. A replay on it is a guess: [`Basis::Changed`].
    pub fn assume_project(&mut self, project: &std::path::Path) {
        if self.content.origin == Origin::Unknown && self.content.base.is_none() {
            self.content.origin = Origin::Project { path: project.to_owned(), hash: 0 };
        }
    }

    /// Rig to replay the changes on. `hash` gives the present hash of the file at a path, or `None` if it cannot be
    /// read.
    pub fn basis(&self, mut hash: impl FnMut(&std::path::Path) -> Option<u64>) -> Basis {
        if let Some((index, mark)) = self.saved(&mut hash) {
            let contained = self.tally.contained(index, mark, self.content.first);
            return Basis::Project { contained };
        }
        match &self.content.origin {
            _ if self.content.base.is_some() => Basis::Journal,
            Origin::Project { path, hash: known } if hash(path) == Some(*known) => Basis::Project { contained: 0 },
            Origin::Project { .. } => Basis::Changed,
            _ => Basis::Journal,
        }
    }

    /// Latest save whose content the project file has now, with its index.
    pub(super) fn saved(&self, hash: &mut impl FnMut(&std::path::Path) -> Option<u64>) -> Option<(usize, &SaveMark)> {
        self.content.marks.iter().enumerate().rev().find(|(_, mark)| hash(&mark.path) == Some(mark.hash))
    }
}

/// Reads every sound record of a journal, whatever is between them. Memory stays within a small multiple of the file's
/// length.
///
/// # Errors
/// [`JournalError`] if there is no sound record. Damage is no error: see [`RecoveredJournal::gaps`].
pub fn recover(bytes: &[u8]) -> Result<RecoveredJournal, JournalError> {
    let scan = Scan::new(bytes)?;
    let content = Content { origin: Origin::Unknown, ..Content::default() };
    let mut reader = Reader {
        recovered: RecoveredJournal {
            session: scan.session(),
            process: 0,
            ending: Ending::Open,
            content,
            gaps: Vec::new(),
            count: RecordCount::default(),
            tally: Tally::default(),
            one_way: Vec::new(),
        },
        stacks: LossyHistory::default(),
        skins: SkinsIn::new(),
    };
    for item in scan {
        reader.take(item);
    }
    if reader.recovered.gaps.is_empty() && reader.recovered.content.origin == Origin::Unknown {
        reader.lose(Gap::NO_HEADER);
    }
    match reader.recovered.count.sound {
        0 => Err(JournalError::NothingSound),
        _ => Ok(reader.recovered),
    }
}

/// State of the reader: the result so far, and the steps and weights that the next records refer to.
struct Reader {
    recovered: RecoveredJournal,
    stacks: LossyHistory,
    skins: SkinsIn,
}

impl Reader {
    fn take(&mut self, item: Item<'_>) {
        let recovered = &mut self.recovered;
        let (at, kind, payload) = match item {
            Item::Gap(gap) => {
                if gap.records != Some(0) {
                    recovered.ending = Ending::Torn;
                }
                recovered.count.lose(&gap);
                self.stacks.lose(&gap);
                self.lose(gap);
                return;
            }
            Item::Record(at, kind, payload) => (at, kind, payload),
        };
        recovered.count.sound += 1;
        recovered.ending = if kind == RecordKind::End { Ending::Closed } else { Ending::Open };
        let place =
            Gap { at, bytes: payload.len(), records: Some(1), kind: Some(kind), damage: Damage::Content, changes: 0 };
        let taken =
            if kind.is_change() { self.take_change(kind, payload, place) } else { self.take_other(kind, payload) };
        if let Err((damage, records)) = taken {
            self.lose(Gap { records: Some(records), damage, ..place });
        }
    }

    fn lose(&mut self, gap: Gap) {
        let recovered = &mut self.recovered;
        recovered.tally.lose(&gap);
        recovered.gaps.push(Gap { changes: recovered.content.changes.len(), ..gap });
    }

    /// Adds a change; on failure returns the damage and the number of records that it loses.
    fn take_change(&mut self, kind: RecordKind, payload: &[u8], place: Gap) -> Result<(), (Damage, u64)> {
        let has_step = !matches!(kind, RecordKind::Undone | RecordKind::Redone);
        let read = if has_step { read_step(payload, &self.skins) } else { None };
        let damage = match (&read, has_step) {
            (_, false) => Damage::UnknownStep,
            (None, true) => Damage::Content,
            (Some(_), true) => Damage::Weights,
        };
        let is_usable =
            |read: &StepIn| if kind == RecordKind::UndoneOlder { read.has_backward } else { read.has_forward };
        let read = read.filter(is_usable);
        let is_one_way = read.as_ref().is_some_and(|read| !(read.has_forward && read.has_backward));
        let step = read.map(|read| Arc::new(read.step));
        if let Some(step) = step.clone().filter(|_| is_one_way) {
            self.recovered.one_way.push(step);
            self.lose(Gap { records: Some(0), damage, ..place });
        }
        let stacks = &mut self.stacks;
        let committed = match kind {
            RecordKind::Undone => stacks.undo().map(Commit::Undone),
            RecordKind::Redone => stacks.redo().map(Commit::Redone),
            RecordKind::UndoneOlder => {
                stacks.undo_older(step.clone());
                step.map(Commit::Undone)
            }
            RecordKind::RedoneOlder => {
                stacks.redo_older(step.clone());
                step.map(Commit::Redone)
            }
            _ => {
                stacks.done(step.clone());
                step.map(Commit::Done)
            }
        };
        let committed = committed.ok_or((damage, 1))?;
        self.recovered.tally.change();
        self.recovered.content.changes.push(committed);
        Ok(())
    }

    /// Adds a record that is no change; returns failures like [`Self::take_change`].
    fn take_other(&mut self, kind: RecordKind, payload: &[u8]) -> Result<(), (Damage, u64)> {
        let content = &mut self.recovered.content;
        let senseless = (Damage::Content, 1);
        match kind {
            RecordKind::Header if content.origin == Origin::Unknown && content.changes.is_empty() => {
                let header: Header = read_value(payload).ok_or(senseless)?;
                (content.generation, content.started) = (header.generation, header.started);
                (content.origin, content.first) = (header.origin, header.first);
                self.recovered.process = header.process;
                self.recovered.tally.begin(header.first);
            }
            // The second copy of the rig.
            RecordKind::Base if content.base.is_some() => {}
            RecordKind::Base if content.changes.is_empty() => {
                let (rig, is_whole) = read_rig(payload, &self.skins).ok_or(senseless)?;
                content.base = Some(Arc::new(rig));
                if !is_whole {
                    return Err((Damage::Weights, 0));
                }
            }
            RecordKind::Skin => {
                let (hash, bytes) = payload.split_first_chunk::<8>().ok_or(senseless)?;
                let skin = read_skin_data(bytes).ok_or(senseless)?;
                self.skins.insert(u64::from_le_bytes(*hash), Arc::new(skin));
            }
            RecordKind::Mark => {
                content.marks.push(read_value(payload).ok_or(senseless)?);
                self.recovered.tally.mark();
            }
            RecordKind::Context => content.context = std::str::from_utf8(payload).map_err(|_| senseless)?.to_owned(),
            RecordKind::End => {}
            _ => return Err(senseless),
        }
        Ok(())
    }
}
