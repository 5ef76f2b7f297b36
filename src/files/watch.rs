//! Files whose saves are awaited.
//!
//! Programs save in many ways: in place, emptied first and filled after a pause, in pieces, or beside and renamed over; and
//! some file systems tell nobody. So a watch looks at the file itself, again and again: its length and time at every look, its
//! content where those changed and every so often anyway.

use std::{
    path::{Path, PathBuf},
    time::{Duration, SystemTime},
};

use super::{Disk, ReadError, read_capped};

/// Time between two looks at a file that one should take.
pub const LOOK: Duration = Duration::from_millis(10);

/// Number of looks after which the content is read even if the file seems unchanged.
const READ_EVERY: u32 = 50;

/// A file whose next content is awaited.
#[derive(Debug, Clone)]
pub struct FileWatch {
    path: PathBuf,
    limit: u64,
    /// Content that was given out, or is known.
    known: Option<Vec<u8>>,
    /// Content of the last look, if it is another.
    next: Option<Vec<u8>>,
    seen: Option<(u64, Option<SystemTime>)>,
    looks: u32,
}

impl FileWatch {
    /// A watch of a file of at most `limit` bytes.
    pub fn new(path: &Path, limit: u64) -> Self {
        Self { path: path.to_owned(), limit, known: None, next: None, seen: None, looks: 0 }
    }

    /// The file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Takes note of a content that is no news, such as one that this program saves.
    pub fn know(&mut self, content: Vec<u8>) {
        self.known = Some(content);
    }

    /// Looks at the file. A content that is neither known nor given out, and the same at two looks in a row, is given out.
    /// A file that is not there for the moment, as between two steps of a save, is waited for.
    pub fn look(&mut self, disk: &dyn Disk) -> Option<&[u8]> {
        let state = disk.entry(&self.path, true).ok().map(|entry| (entry.len, entry.modified));
        self.looks = (self.looks + 1) % READ_EVERY;
        if self.next.is_none() && state == self.seen && self.looks != 0 {
            return None;
        }
        let content = read_capped(disk, &self.path, self.limit).ok()?;
        self.seen = state;
        if self.known.as_ref() == Some(&content) {
            self.next = None;
            return None;
        }
        if self.next.as_ref() != Some(&content) {
            self.next = Some(content);
            return None;
        }
        self.next = None;
        Some(self.known.insert(content))
    }

    /// Reads the file at once, as it is.
    ///
    /// # Errors
    /// See [`read_capped`].
    pub fn read(&mut self, disk: &dyn Disk) -> Result<&[u8], ReadError> {
        let content = read_capped(disk, &self.path, self.limit)?;
        Ok(self.known.insert(content))
    }
}
