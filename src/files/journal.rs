//! The journal: a file that stores every committed edit at once, so that a crash, a kill or a power cut costs no work.
//!
//! A [`Journal`] is an append-only file that a thread of its own writes. The file begins with the start of the work (an
//! [`Origin`], and the rig itself unless a saved project holds it); a record for every change follows, undo and redo
//! included. A record is with the kernel within milliseconds, which survives the death of the process, and on the disk
//! a moment later, which survives a power cut; neither holds up the caller. A clean [`close`](Journal::close) removes
//! the file, so that a file whose process is dead holds unsaved work: [`pending_journals`] lists them, [`recover`]
//! reads one, [`RecoveredJournal::restore`] restores the rig, and [`Journal::resume`] continues with it.
//!
//! **Damage.** Each record has a checksum of its own, so that [`recover`] reads every sound record and lists the
//! [`Gap`]s between them; [`RecoveredJournal::restore`] applies all changes that the rig still accepts and lists the
//! others. Only a whole journal whose changes are all saved is ever removed without asking. [`Journal::resume`] keeps a
//! damaged one under the ending `.damaged`, and deleting it is for people to decide.
//!
//! **Saving.** [`Journal::saving`] records the content that the project file is about to get (the hash of its
//! [`project_files`](crate::files::project_files)) and the number of changes in it; after the file is in place,
//! [`Journal::saved`] starts the journal again from it. A crash between any two of these steps recovers the same
//! document: the hash of the project file shows which changes it holds.
//!
//! **Long work.** Where many changes were recorded since the last save ([`MOST_CHANGES`], or gigabytes of weights), the
//! oldest become part of the rig that the journal starts from, and its file is written anew. The document comes back as
//! before, with as many steps as a history holds.
//!
//! **Trouble.** If a folder cannot be written, the next place is tried: beside the project, the caller's folder for
//! such files, the system's folder for temporary files. If all fail, [`Journal::trouble`] gives the reason, editing
//! goes on, and everything is written again as soon as one of them works.
//!
//! The file: magic `RIGJRNL\0`, format, session (a random number that all checksums depend on), then frames of length,
//! kind, number, payload and checksum. Payloads are RON; weights are binary, once each. The rig at the start of the
//! work is stored twice.

mod encode;
mod error;
mod fold;
mod frame;
mod gap;
mod lossy_history;
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

pub use error::JournalWriteError;
pub use fold::MOST_CHANGES;
pub use frame::{JOURNAL_FORMAT, MAX_RECORD, RecordKind};
pub use gap::{Damage, Gap, RecordCount};
pub use place::{
    Condition, JournalPlaces, PendingJournal, file_hash_at, journal_beside, pending_journal, pending_journals,
    project_beside,
};
pub use read::{Basis, Ending, JournalError, MAX_JOURNAL, RecoveredJournal, recover};
pub use restore::{RestoredRig, SkipReason, SkippedChange};
pub use writer::{Journal, JournalStart, ResumedJournal};

pub use crate::rig::skin::content_hash as file_hash;

/// Start of the work that a journal records. Hashes are those of the files' bytes, see [`file_hash`].
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
pub enum Origin {
    /// An empty document.
    #[default]
    Empty,
    /// Content that is bundled with the program, by name.
    Bundled(String),
    /// A mesh file.
    Mesh {
        /// The file.
        path: PathBuf,
        /// Hash of the file when it was opened.
        hash: u64,
    },
    /// A template.
    Template {
        /// The file.
        path: PathBuf,
        /// Hash of the file when it was opened.
        hash: u64,
    },
    /// A project, opened or saved.
    Project {
        /// The file.
        path: PathBuf,
        /// Hash of the file when it was opened or saved.
        hash: u64,
    },
    /// An unknown start, because that part of the journal is damaged. Never written.
    Unknown,
}

impl Origin {
    /// Path of the file; `None` if the work did not start from a file.
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
    /// Hash of the file's bytes.
    pub hash: u64,
    /// Number of changes that the file holds, counted like [`Journal::position`].
    pub position: u64,
}

/// Content of a journal's file: the start of the work, and the changes since.
#[derive(Debug, Clone, PartialEq, Default)]
struct Content {
    /// Number of the file among the files of a session.
    generation: u64,
    /// Start of the session, in seconds since 1970.
    started: u64,
    origin: Origin,
    /// Rig at the start, if no project file holds it.
    base: Option<std::sync::Arc<crate::rig::Rig>>,
    /// Text of the caller.
    context: String,
    /// Position of the first change.
    first: u64,
    changes: Vec<crate::rig::step::Commit>,
    marks: Vec<SaveMark>,
    /// Rig before the first change, wherever it is stored; `None` if it is not known.
    known: Option<std::sync::Arc<crate::rig::Rig>>,
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
        self.base = None;
        self.advance(contained);
        self.changes.drain(..contained);
        self.first = self.first.saturating_add(contained as u64);
        self.origin = Origin::Project { path: mark.path.clone(), hash: mark.hash };
        self.marks.clear();
    }
}
