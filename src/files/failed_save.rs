//! Saves that failed and are tried again. What is saved may take long to make, so it is made again only where the save may end in
//! another way.

use std::{
    path::{Path, PathBuf},
    time::{Duration, Instant},
};

use super::{Disk, SaveError, stage_file};

/// Pause before a trial, and between two of them.
const AGAIN: Duration = Duration::from_secs(1);

/// Save that failed.
#[derive(Debug)]
pub struct FailedSave {
    path: PathBuf,
    /// Number of bytes for which there was no space; 0 for other errors.
    bytes: usize,
    /// Error of the last trial; `None` if it succeeded.
    reason: Option<String>,
    /// Time of the next trial.
    next: Instant,
}

impl FailedSave {
    /// The save to `path` that failed with this error at that time.
    pub fn new(disk: &dyn Disk, path: &Path, error: &SaveError, now: Instant) -> Self {
        let bytes = match error {
            SaveError::NoSpace { bytes, .. } => usize::try_from(*bytes).unwrap_or_default(),
            _ => 0,
        };
        let reason = trial(disk, path, bytes);
        Self { path: path.to_owned(), bytes, reason, next: now + AGAIN }
    }

    /// True if the file is worth making again at a time that is not before that of the last look: once a second, unless as many
    /// bytes still cannot be written for the same reason.
    pub fn is_due(&mut self, disk: &dyn Disk, now: Instant) -> bool {
        if now < self.next {
            return false;
        }
        self.next = now + AGAIN;
        let reason = trial(disk, &self.path, self.bytes);
        let is_due = reason.is_none() || reason != self.reason;
        self.reason = reason;
        is_due
    }
}

/// Error of saving so many bytes, none of which are left behind.
fn trial(disk: &dyn Disk, path: &Path, bytes: usize) -> Option<String> {
    stage_file(disk, path, &vec![0; bytes]).err().map(|error| error.to_string())
}
