//! Files whose saves are awaited.
//!
//! Programs save in many ways: in place, emptied first and filled after a pause, in pieces, or beside and renamed over; and
//! some file systems tell nobody. So a watch looks at the file itself, again and again: its length and time at every look, its
//! content where those changed and every so often anyway.

use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
    time::{Duration, Instant, SystemTime},
};

use super::{Disk, ReadError, read_capped};
use crate::rig::template;

/// Time between two looks at a file that one should take.
pub const LOOK: Duration = Duration::from_millis(10);

/// Time after which the content is read even if the file seems unchanged: some file systems keep time and length.
const READ_EVERY: Duration = Duration::from_millis(500);

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
    /// Time of the last look at the content.
    read: Option<Instant>,
}

impl FileWatch {
    /// A watch of a file of at most `limit` bytes.
    pub fn new(path: &Path, limit: u64) -> Self {
        Self { path: path.to_owned(), limit, known: None, next: None, seen: None, read: None }
    }

    /// The file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// True if a content has been seen once, and is given out if the next look sees it again.
    pub fn is_pending(&self) -> bool {
        self.next.is_some()
    }

    /// Takes note of a content that is not to be given out, such as the content that the caller has just saved.
    pub fn know(&mut self, content: Vec<u8>) {
        self.known = Some(content);
    }

    /// Looks at the file. A content that is neither known nor given out, and the same at two looks in a row, is given out.
    /// A file that is not there for the moment, as between two steps of a save, is waited for.
    pub fn look(&mut self, disk: &dyn Disk) -> Option<&[u8]> {
        self.look_at(disk, Instant::now())
    }

    /// Looks at the file at a time that is not before that of the last look: see [`look`](Self::look).
    pub fn look_at(&mut self, disk: &dyn Disk, now: Instant) -> Option<&[u8]> {
        let state = disk.entry(&self.path, true).ok().map(|entry| (entry.len, entry.modified));
        let is_recent = self.read.is_some_and(|read| now.saturating_duration_since(read) < READ_EVERY);
        if self.next.is_none() && state == self.seen && is_recent {
            return None;
        }
        self.read = Some(now);
        let content = match read_capped(disk, &self.path, self.limit) {
            Ok(content) => content,
            // A file may be emptied before it is written; one that stays empty is given out, too.
            Err(ReadError::Empty { .. }) => Vec::new(),
            Err(_) => return None,
        };
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

/// A template's file and the files of its parts, whose saves are awaited.
#[derive(Debug, Clone)]
pub struct TemplateWatch {
    own: FileWatch,
    parts: Vec<FileWatch>,
}

impl TemplateWatch {
    /// A watch of a template's file. Its parts are followed once they are [told](Self::follow).
    pub fn new(path: &Path) -> Self {
        Self { own: FileWatch::new(path, template::MAX_BYTES as u64), parts: Vec::new() }
    }

    /// Number of files that are watched.
    pub fn count(&self) -> usize {
        1 + self.parts.len()
    }

    /// True if the next look may give out a content, see [`FileWatch::is_pending`].
    pub fn is_pending(&self) -> bool {
        self.own.is_pending() || self.parts.iter().any(FileWatch::is_pending)
    }

    /// Reads the template's own file at once, as it is.
    ///
    /// # Errors
    /// See [`read_capped`].
    pub fn read(&mut self, disk: &dyn Disk) -> Result<Vec<u8>, ReadError> {
        self.own.read(disk).map(<[u8]>::to_vec)
    }

    /// Looks at all files, see [`FileWatch::look`]. The content of the template's own file, if one of them has a new one.
    pub fn look(&mut self, disk: &dyn Disk) -> Option<Vec<u8>> {
        self.look_at(disk, Instant::now())
    }

    /// Looks at all files at a time that is not before that of the last look: see [`look`](Self::look).
    pub fn look_at(&mut self, disk: &dyn Disk, now: Instant) -> Option<Vec<u8>> {
        let own = self.own.look_at(disk, now).map(<[u8]>::to_vec);
        let mut is_part = false;
        for part in &mut self.parts {
            is_part |= part.look_at(disk, now).is_some();
        }
        own.or_else(|| match &self.own.known {
            _ if !is_part => None,
            Some(known) => Some(known.clone()),
            None => self.own.read(disk).ok().map(<[u8]>::to_vec),
        })
    }

    /// Takes note of the files of parts that a reader has asked for, with what it got of each: one that it could not read
    /// is news as soon as it can be. While a template cannot be read as a whole, the parts that it had before stay watched
    /// as well.
    pub fn follow(&mut self, asked: BTreeMap<PathBuf, Option<Vec<u8>>>, is_whole: bool) {
        if is_whole {
            self.parts.retain(|part| asked.contains_key(&part.path));
        }
        for (path, content) in asked {
            match self.parts.iter_mut().find(|part| part.path == path) {
                // A file that stays empty was given out once.
                Some(part) if content.is_none() && part.known.as_ref().is_some_and(Vec::is_empty) => {}
                Some(part) => part.known = content,
                None => {
                    let mut watch = FileWatch::new(&path, template::MAX_BYTES as u64);
                    watch.known = content;
                    self.parts.push(watch);
                }
            }
        }
    }
}
