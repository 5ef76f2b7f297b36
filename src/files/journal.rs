//! The journal: every committed edit in a file at once, so that a crash, a kill or a power cut costs no work.
//!
//! A [`Journal`] is an append-only file that a thread of its own writes. It begins with what the work started from (an
//! [`Origin`], and the rig itself unless a saved project holds it); then comes a record for every change, undo and redo
//! included. A record is with the kernel within milliseconds, which survives the death of the process, and on the disk
//! a moment later, which survives a power cut; neither holds up the caller. A clean [`close`](Journal::close) removes
//! the file, so that a file whose process is gone is work to be offered back: [`pending_journals`] lists them,
//! [`recover`] reads one, [`Recovered::restore`] makes the rig again, and [`Journal::resume`] goes on with it.
//!
//! **Damage.** Each record has a checksum of its own, so that [`recover`] takes every one that is sound and tells the
//! [`Gap`]s between them; [`Recovered::restore`] makes all changes again that the rig still takes and tells those that it
//! left out. Only a whole journal whose changes are all saved is ever removed unasked. [`Journal::resume`] keeps a damaged
//! one under the ending `.damaged`, and deleting it is for people to decide.
//!
//! **Saving.** [`Journal::saving`] notes which content the project file is about to get (the hash of its
//! [`project_files`](crate::files::project_files)) and which changes are in it; after the file is in place, [`Journal::saved`] starts the journal anew on it, beside it. A crash between any two of
//! these steps recovers the same document: whether the project file has the noted content tells which changes it holds.
//!
//! **Trouble.** Where a folder cannot be written the next place is tried: beside the project, the caller's folder for
//! such things, the system's folder for temporary files. If all fail, [`Journal::trouble`] says why, editing goes on,
//! and everything is written again as soon as one of them works.
//!
//! The file: magic `RIGJRNL\0`, format, session (a random number that all checksums depend on), then frames of length,
//! kind, number, payload and checksum. Payloads are RON; weights are binary, once each. The rig that the work started with
//! is there twice.

mod encode;
mod frame;
mod gap;
mod lossy_timeline;
mod place;
mod read;
mod restore;
mod scan;
mod summary;
mod sync;
mod tally;
mod text;
mod thread;
mod writer;

use std::path::PathBuf;

use serde::{Deserialize, Serialize};

pub use frame::{JOURNAL_FORMAT, MAX_RECORD, RecordKind};
pub use gap::{Damage, Gap, RecordCount};
pub use place::{
    Condition, JournalPlaces, PendingJournal, file_hash_at, journal_beside, pending_journal, pending_journals,
    project_beside,
};
pub use read::{Basis, Ending, JournalError, MAX_JOURNAL, Recovered, recover};
pub use restore::{Restored, SkipReason, Skipped};
pub use writer::{Journal, JournalStart, Resumed};

pub use crate::rig::skin::content_hash as file_hash;

/// What the work in a journal started from. Hashes are those of the files' bytes, see [`file_hash`].
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
pub enum Origin {
    /// Nothing.
    #[default]
    Empty,
    /// Something that comes with the program.
    Bundled(String),
    /// A mesh file.
    Mesh {
        /// The file.
        path: PathBuf,
        /// Its hash when it was opened.
        hash: u64,
    },
    /// A template.
    Template {
        /// The file.
        path: PathBuf,
        /// Its hash when it was opened.
        hash: u64,
    },
    /// A project, opened or saved.
    Project {
        /// The file.
        path: PathBuf,
        /// Its hash when it was opened or saved.
        hash: u64,
    },
    /// Not known any more, because that part of the journal is damaged. Never written.
    Unknown,
}

impl Origin {
    /// The file; `None` if there is none.
    pub fn path(&self) -> Option<&std::path::Path> {
        match self {
            Self::Empty | Self::Bundled(_) | Self::Unknown => None,
            Self::Mesh { path, .. } | Self::Template { path, .. } | Self::Project { path, .. } => Some(path),
        }
    }
}

/// A save: the project file with this hash holds all changes before this position.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct SaveMark {
    /// The project file.
    pub path: PathBuf,
    /// The hash of its bytes.
    pub hash: u64,
    /// How many changes it holds, counted like [`Journal::position`].
    pub position: u64,
}

/// What a journal's file holds: where the work started and what happened since.
#[derive(Debug, Clone, PartialEq, Default)]
struct Content {
    /// Counts the files of a session.
    generation: u64,
    /// When the session began, in seconds since 1970.
    started: u64,
    origin: Origin,
    /// The rig it started with, if no project file holds it.
    base: Option<std::sync::Arc<crate::rig::Rig>>,
    /// The caller's text.
    context: String,
    /// The position of the first change.
    first: u64,
    changes: Vec<crate::rig::step::Committed>,
    marks: Vec<SaveMark>,
}

impl Content {
    /// Starts again from a saved project.
    fn rebase(&mut self, mark: &SaveMark) {
        let contained = usize::try_from(mark.position.saturating_sub(self.first)).unwrap_or(usize::MAX);
        self.rebase_after(mark, contained);
    }

    /// Starts again from a saved project that holds the first `contained` changes.
    fn rebase_after(&mut self, mark: &SaveMark, contained: usize) {
        let contained = contained.min(self.changes.len());
        self.changes.drain(..contained);
        self.first = self.first.saturating_add(contained as u64);
        self.origin = Origin::Project { path: mark.path.clone(), hash: mark.hash };
        self.base = None;
        self.marks.clear();
    }
}
