//! Reasons why a journal does not store changes.

use std::{path::PathBuf, time::Duration};

use crate::files::DiskError;

/// Reason why a journal does not store changes.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum JournalWriteError {
    /// The disk refused.
    #[error(transparent)]
    Disk(#[from] DiskError),
    /// The disk accepts no more bytes.
    #[error("the disk takes nothing more")]
    Full,
    /// An earlier sync failed.
    #[error("the disk did not take earlier changes")]
    Earlier,
    /// A record would be longer than the limit of its reader.
    #[error("{mebibytes} MiB are more than a record holds")]
    LargeRecord {
        /// Length of the record in mebibytes.
        mebibytes: usize,
    },
    /// The text of a record would be longer than the limit of its reader.
    #[error("{mebibytes} MiB of text are more than a record holds")]
    LargeText {
        /// Length of the text in mebibytes.
        mebibytes: usize,
    },
    /// The lists of weights contradict each other.
    #[error("the lists of the weights do not fit together")]
    Weights,
    /// A value cannot be written as text.
    #[error(transparent)]
    Text(#[from] ron::Error),
    /// The journal of another window or of a crash has the same path.
    #[error("another journal lies there")]
    PathInUse,
    /// The journal has no place to try.
    #[error("there is no place for it")]
    NoPlace,
    /// The journal has no open file.
    #[error("no journal is open")]
    NotOpen,
    /// The disk did not answer in time.
    #[error("the disk has not answered within {0:?}")]
    Late(Duration),
    /// The journal was closed.
    #[error("the journal has been closed")]
    Closed,
    /// The file of a closed journal cannot be removed.
    #[error("`{}`: {source}", path.display())]
    Remove {
        /// The file.
        path: PathBuf,
        /// Error of the operating system.
        source: DiskError,
    },
    /// No place accepts the journal.
    #[error(
        "changes cannot be kept for recovery in `{}`: {source}; save soon, and free space or allow writing there",
        path.display()
    )]
    Place {
        /// The first place.
        path: PathBuf,
        /// Reason for the refusal of that place.
        source: Box<JournalWriteError>,
    },
    /// The thread of the journal cannot be started.
    #[error("changes cannot be kept for recovery: {0}; save often, and restart the program")]
    Thread(#[source] DiskError),
}

impl From<std::io::Error> for JournalWriteError {
    fn from(error: std::io::Error) -> Self {
        Self::Disk(error.into())
    }
}
