//! Places of journals, and the search for journals with unsaved work of dead processes.

use std::{
    ffi::OsStr,
    fmt,
    io::{self, ErrorKind},
    path::{Path, PathBuf},
    time::SystemTime,
};

use super::{
    Ending, JournalError, MAX_JOURNAL, Origin, RecordCount, file_hash,
    summary::{Summary, summarise},
};
use crate::files::{Disk, EntryKind, ReadError, atomic::folder_of, read::is_missing, read_capped};

/// Largest number of journals of one name that are kept aside.
const MAX_NAMES: usize = 10_000;
/// Largest size in bytes of a project file that is hashed.
const MAX_PROJECT: u64 = 1 << 30;
/// Ending of journals beside a project.
const BESIDE: &str = ".rigsmith.journal";
/// Beginning and ending of journals elsewhere; the session stands between them.
const APART: (&str, &str) = ("rigsmith-", ".journal");

/// Candidate folders of a journal; the first that can be written is used.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct JournalPlaces {
    /// Project file, if there is one: the journal is put beside it.
    pub project: Option<PathBuf>,
    /// Folder of the program for its state; created if it is missing.
    pub state: Option<PathBuf>,
}

impl JournalPlaces {
    /// Folders other than the project's, in which journals of any project may have been left.
    pub fn folders(&self) -> Vec<PathBuf> {
        self.state.iter().cloned().chain([std::env::temp_dir()]).collect()
    }

    /// Files to try, in order.
    pub(super) fn candidates(&self, session: u64) -> Vec<PathBuf> {
        let name = format!("{}{session:016x}{}", APART.0, APART.1);
        let beside = self.project.as_deref().map(journal_beside);
        beside.into_iter().chain(self.folders().into_iter().map(|folder| folder.join(&name))).collect()
    }
}

/// Path of the journal of a project file: `NAME.rigsmith.ron` has `NAME.rigsmith.journal` beside it.
pub fn journal_beside(project: &Path) -> PathBuf {
    let name = project.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let stem = [".rigsmith.ron", ".ron"].iter().find_map(|ending| name.strip_suffix(ending)).unwrap_or(&name);
    project.with_file_name(format!("{stem}{BESIDE}"))
}

/// Project file that a journal with such a name is beside; `None` for journals in other places.
pub fn project_beside(journal: &Path) -> Option<PathBuf> {
    let stem = journal.file_name()?.to_str()?.strip_suffix(BESIDE)?;
    Some(journal.with_file_name(format!("{stem}.rigsmith.ron")))
}

/// Adds an ending to a file's name, so that no search for journals finds the file, and a number if that name is taken.
/// Where the file system allows, `old` stays as a second name, so that the file can be found until another one takes
/// that name. Returns the name, and whether `old` still exists.
pub(super) fn set_aside(disk: &dyn Disk, old: &Path, ending: &str) -> io::Result<(PathBuf, bool)> {
    for number in 1..=MAX_NAMES {
        let mut name = old.as_os_str().to_owned();
        name.push(ending);
        if number > 1 {
            name.push(format!(".{number}"));
        }
        let aside = PathBuf::from(name);
        if is_there(disk, &aside)? {
            continue;
        }
        let linked = match disk.hard_link(old, &aside) {
            Ok(()) => true,
            Err(error) if error.kind() == ErrorKind::AlreadyExists => continue,
            Err(_) => {
                disk.rename(old, &aside)?;
                false
            }
        };
        let _ = disk.sync_folder(folder_of(old));
        return Ok((aside, linked));
    }
    Err(ErrorKind::AlreadyExists.into())
}

/// True if there is something at a path. An error is no answer: a file that cannot be reached must not be replaced.
pub(super) fn is_there(disk: &dyn Disk, path: &Path) -> io::Result<bool> {
    match disk.entry(path, false) {
        Ok(_) => Ok(true),
        Err(error) if is_missing(&error) => Ok(false),
        Err(error) => Err(error),
    }
}

/// State of a journal that was left behind.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Condition {
    /// The file is complete and undamaged.
    Whole,
    /// Parts of the file are damaged; the rest can be recovered.
    Damaged(RecordCount),
    /// The file holds nothing that this version can recover.
    Unreadable(JournalError),
}

impl fmt::Display for Condition {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Whole => write!(f, "whole"),
            Self::Damaged(records) => write!(f, "damaged: {records} can be recovered"),
            Self::Unreadable(error) => error.fmt(f),
        }
    }
}

/// Unsaved work that a dead process left behind.
#[derive(Debug, Clone, PartialEq)]
pub struct PendingJournal {
    /// Path of the journal.
    pub path: PathBuf,
    /// Start of the work.
    pub origin: Origin,
    /// Time at which the work started, in seconds since 1970.
    pub started: u64,
    /// Time at which the last change was written.
    pub modified: Option<SystemTime>,
    /// Number of changes that no saved file holds.
    pub changes: usize,
    /// True if another program has changed the project file since, or the file is gone.
    pub project_changed: bool,
    /// Ending of the file.
    pub ending: Ending,
    /// State of the file: undamaged, damaged or unreadable.
    pub condition: Condition,
}

/// Unsaved work in the journals of a folder, latest first. Journals of living processes are not listed. Undamaged
/// journals without unsaved changes are removed; all others stay, however little of them can be read.
///
/// Reads the journals and hashes the projects they belong to; a folder that cannot be read counts as empty.
pub fn pending_journals(disk: &dyn Disk, folder: &Path) -> Vec<PendingJournal> {
    // A folder for temporary files has any number of names of others.
    let names = disk.list(folder, usize::MAX).unwrap_or_default();
    let journals = names.iter().filter(|name| is_journal_name(name));
    let mut pending: Vec<_> = journals.filter_map(|name| pending_journal(disk, &folder.join(name))).collect();
    pending.sort_by(|a, b| b.modified.cmp(&a.modified).then_with(|| a.path.cmp(&b.path)));
    pending
}

/// Unsaved work in one journal, such as [`journal_beside`] a project that is opened; see [`pending_journals`].
pub fn pending_journal(disk: &dyn Disk, path: &Path) -> Option<PendingJournal> {
    let entry = match disk.entry(path, false) {
        Ok(entry) if entry.kind == EntryKind::File => Ok(entry),
        Ok(_) => return None,
        Err(error) if is_missing(&error) => return None,
        Err(error) => Err(ReadError::new(disk, path, error)),
    };
    // If the lock cannot be tested, the journal is offered: offering saved work is better than hiding unsaved work.
    let lock = disk.is_locked(path);
    if matches!(lock, Ok(true)) {
        return None;
    }
    let pending = |condition| PendingJournal {
        path: path.to_owned(),
        origin: Origin::Unknown,
        started: 0,
        modified: entry.as_ref().ok().and_then(|entry| entry.modified),
        changes: 0,
        project_changed: false,
        ending: Ending::Torn,
        condition,
    };
    let read = match entry.as_ref().map_err(Clone::clone).and_then(|_| read_capped(disk, path, MAX_JOURNAL)) {
        Ok(bytes) => summarise(&bytes),
        // The journal belongs to another user, or has just been removed.
        Err(ReadError::NoAccess { .. } | ReadError::Missing { .. }) => return None,
        Err(ReadError::Empty { .. }) => Err(JournalError::NothingSound),
        Err(error) => Err(JournalError::Read(error)),
    };
    let summary = match read {
        Ok(summary) => summary,
        Err(error) => return Some(pending(Condition::Unreadable(error))),
    };
    let (changes, project_changed) = unsaved(disk, &summary);
    if !summary.is_damaged && (changes == 0 || summary.ending == Ending::Closed || is_superseded(disk, path, &summary))
    {
        // A living process may be about to write its first changes.
        if lock.is_ok() {
            let _ = disk.remove(path);
        }
        return None;
    }
    let condition = if summary.is_damaged { Condition::Damaged(summary.records) } else { Condition::Whole };
    let (origin, started, ending) = (summary.origin, summary.started, summary.ending);
    Some(PendingJournal { origin, started, changes, project_changed, ending, ..pending(condition) })
}

/// Number of changes that no saved file holds, and whether the project file has changed since.
fn unsaved(disk: &dyn Disk, summary: &Summary) -> (usize, bool) {
    let is = |path: &Path, hash: u64| file_hash_at(disk, path) == Some(hash);
    let all = summary.tally.changes();
    let mut marks = summary.marks.iter().enumerate().rev();
    if let Some((index, mark)) = marks.find(|(_, mark)| is(&mark.path, mark.hash)) {
        return (all.saturating_sub(summary.contained(index, mark)), false);
    }
    let changed = match &summary.origin {
        Origin::Project { path, hash } if !summary.has_base => !is(path, *hash),
        _ => false,
    };
    (all, changed)
}

/// Present [`file_hash`] of a file; `None` if it cannot be read. For
/// [`RecoveredJournal::basis`](super::RecoveredJournal::basis).
pub fn file_hash_at(disk: &dyn Disk, path: &Path) -> Option<u64> {
    read_capped(disk, path, MAX_PROJECT).ok().map(|bytes| file_hash(&bytes))
}

/// True if an undamaged journal beside a project that the session saved continues the same session.
fn is_superseded(disk: &dyn Disk, path: &Path, summary: &Summary) -> bool {
    summary.marks.iter().any(|mark| {
        let later = journal_beside(&mark.path);
        later != path
            && read_capped(disk, &later, MAX_JOURNAL).ok().and_then(|bytes| summarise(&bytes).ok()).is_some_and(
                |other| {
                    let is_later = other.session == summary.session && other.generation > summary.generation;
                    is_later && !other.is_damaged
                },
            )
    })
}

fn is_journal_name(name: &OsStr) -> bool {
    name.to_str().is_some_and(|name| {
        let session = name.strip_prefix(APART.0).and_then(|rest| rest.strip_suffix(APART.1));
        let apart = session.is_some_and(|s| s.len() == 16 && s.bytes().all(|b| b.is_ascii_hexdigit()));
        apart || name.ends_with(BESIDE)
    })
}
