//! Where journals lie, and which of them hold work that nobody has any more.

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
use crate::files::{Disk, EntryKind, ReadError, atomic::folder_of, read_capped};

/// Names of a folder that are looked through, at most.
const MAX_NAMES: usize = 10_000;
/// Bytes of a project file that are hashed, at most.
const MAX_PROJECT: u64 = 1 << 30;
/// Ending of journals beside a project.
const BESIDE: &str = ".rigsmith.journal";
/// Beginning and ending of journals elsewhere; the session stands between them.
const APART: (&str, &str) = ("rigsmith-", ".journal");

/// The folders that a journal may lie in; the first that can be written is taken.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct JournalPlaces {
    /// The project file, if there is one: the journal lies beside it.
    pub project: Option<PathBuf>,
    /// The program's folder for such things; created when it is missing.
    pub state: Option<PathBuf>,
}

impl JournalPlaces {
    /// The folders, without that of the project, in which journals of whatever project may have been left.
    pub fn folders(&self) -> Vec<PathBuf> {
        self.state.iter().cloned().chain([std::env::temp_dir()]).collect()
    }

    /// The files to try, in order.
    pub(super) fn candidates(&self, session: u64) -> Vec<PathBuf> {
        let name = format!("{}{session:016x}{}", APART.0, APART.1);
        let beside = self.project.as_deref().map(journal_beside);
        beside.into_iter().chain(self.folders().into_iter().map(|folder| folder.join(&name))).collect()
    }
}

/// The journal of a project file: `NAME.rigsmith.ron` has `NAME.rigsmith.journal` beside it.
pub fn journal_beside(project: &Path) -> PathBuf {
    let name = project.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let stem = [".rigsmith.ron", ".ron"].iter().find_map(|ending| name.strip_suffix(ending)).unwrap_or(&name);
    project.with_file_name(format!("{stem}{BESIDE}"))
}

/// The project file that a journal with such a name lies beside; `None` for journals elsewhere.
pub fn project_beside(journal: &Path) -> Option<PathBuf> {
    let stem = journal.file_name()?.to_str()?.strip_suffix(BESIDE)?;
    Some(journal.with_file_name(format!("{stem}.rigsmith.ron")))
}

/// Gives a file a further ending under which nothing looks for journals, and a number if that name is taken. Where the
/// file system allows, `old` stays as a second name, so that the file can be found until another one takes that name.
/// Returns the name, and whether `old` is there still.
pub(super) fn set_aside(disk: &dyn Disk, old: &Path, ending: &str) -> io::Result<(PathBuf, bool)> {
    for number in 1..=MAX_NAMES {
        let mut name = old.as_os_str().to_owned();
        name.push(ending);
        if number > 1 {
            name.push(format!(".{number}"));
        }
        let aside = PathBuf::from(name);
        if disk.entry(&aside, false).is_ok() {
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

/// State of a journal that was left behind.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Condition {
    /// As it was written.
    Whole,
    /// Some of it is damaged; the rest can be recovered.
    Damaged(RecordCount),
    /// Nothing can be recovered by this version.
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

/// Work that a process left behind.
#[derive(Debug, Clone, PartialEq)]
pub struct PendingJournal {
    /// The journal.
    pub path: PathBuf,
    /// What the work started from.
    pub origin: Origin,
    /// When it started, in seconds since 1970.
    pub started: u64,
    /// When the last change was written.
    pub modified: Option<SystemTime>,
    /// How many changes are in no saved file.
    pub changes: usize,
    /// True if the project file was changed by someone else since, or is gone.
    pub project_changed: bool,
    /// Ending of the file.
    pub ending: Ending,
    /// Whether all of it can be read.
    pub condition: Condition,
}

/// The work left behind in a folder, latest first. Journals that a living process writes are not listed. Those that are
/// whole and hold nothing that is not saved are removed; no other is, however little of it can be read.
///
/// Reads the journals and hashes the projects they belong to; a folder that cannot be read holds none.
pub fn pending_journals(disk: &dyn Disk, folder: &Path) -> Vec<PendingJournal> {
    let names = disk.list(folder, MAX_NAMES).unwrap_or_default();
    let journals = names.iter().filter(|name| is_journal_name(name));
    let mut pending: Vec<_> = journals.filter_map(|name| pending_journal(disk, &folder.join(name))).collect();
    pending.sort_by(|a, b| b.modified.cmp(&a.modified).then_with(|| a.path.cmp(&b.path)));
    pending
}

/// The work left behind in one journal, such as [`journal_beside`] a project that is opened; see [`pending_journals`].
pub fn pending_journal(disk: &dyn Disk, path: &Path) -> Option<PendingJournal> {
    let entry = disk.entry(path, false).ok().filter(|entry| entry.kind == EntryKind::File)?;
    // Where nobody can tell, offering work that is not lost is better than hiding work that is.
    if disk.is_locked(path).unwrap_or(false) {
        return None;
    }
    let pending = |condition| PendingJournal {
        path: path.to_owned(),
        origin: Origin::Unknown,
        started: 0,
        modified: entry.modified,
        changes: 0,
        project_changed: false,
        ending: Ending::Torn,
        condition,
    };
    let read = match read_capped(disk, path, MAX_JOURNAL) {
        Ok(bytes) => summarise(&bytes),
        // Somebody else's, or gone meanwhile.
        Err(ReadError::NoAccess { .. } | ReadError::Missing { .. }) => return None,
        Err(ReadError::Empty { .. }) => Err(JournalError::NothingSound),
        Err(error) => Err(JournalError::Read(error.to_string())),
    };
    let summary = match read {
        Ok(summary) => summary,
        Err(error) => return Some(pending(Condition::Unreadable(error))),
    };
    let (changes, project_changed) = unsaved(disk, &summary);
    if !summary.is_damaged && (changes == 0 || summary.ending == Ending::Closed || is_superseded(disk, path, &summary))
    {
        let _ = disk.remove(path);
        return None;
    }
    let condition = if summary.is_damaged { Condition::Damaged(summary.records) } else { Condition::Whole };
    let (origin, started, ending) = (summary.origin, summary.started, summary.ending);
    Some(PendingJournal { origin, started, changes, project_changed, ending, ..pending(condition) })
}

/// How many changes are in no saved file, and whether the project is another one by now.
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

/// The [`file_hash`] of a file as it is now; `None` if it cannot be read. For [`Recovered::basis`](super::Recovered::basis).
pub fn file_hash_at(disk: &dyn Disk, path: &Path) -> Option<u64> {
    read_capped(disk, path, MAX_PROJECT).ok().map(|bytes| file_hash(&bytes))
}

/// True if the same session went on in the journal beside the project that it saved, which is whole.
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
