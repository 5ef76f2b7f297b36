//! Temporary files: their names, the process that they belong to, and their removal after that process died.
//!
//! A name is `.rigsmith-` + 8 hexadecimal digits of a save + 8 of a file of that save + `.tmp`. File 0 of a save is its
//! anchor. It is created first, removed last, and locked in between, so that a save is known to be over when its anchor
//! is not locked: the system unlocks the files of a process that dies.

use std::{
    collections::BTreeMap,
    ffi::OsStr,
    hash::{BuildHasher, Hasher},
    io::{self, ErrorKind},
    path::{Path, PathBuf},
    time::{Duration, SystemTime},
};

use super::{SaveStep, companion, record};
use crate::files::disk::{Disk, DiskFile, EntryKind};

const PREFIX: &str = ".rigsmith-";
const SUFFIX: &str = ".tmp";
const DIGITS: usize = 16;
/// Least age of temporary files that are removed as left over, on file systems without locks.
const OLD: Duration = Duration::from_secs(3600);

/// Tells whether a file name is that of one of our temporary files (`.rigsmith-` + 16 hexadecimal digits + `.tmp`).
pub fn is_temp_name(name: &OsStr) -> bool {
    digits(name).is_some()
}

/// The digits of a temporary name.
fn digits(name: &OsStr) -> Option<&str> {
    let digits = name.to_str()?.strip_prefix(PREFIX)?.strip_suffix(SUFFIX)?;
    (digits.len() == DIGITS && digits.bytes().all(|b| b.is_ascii_hexdigit())).then_some(digits)
}

fn name(save: u32, file: u32) -> String {
    format!("{PREFIX}{save:08x}{file:08x}{SUFFIX}")
}

/// A name for a file that is locked as long as it has this name, and that no other process or thread uses at the same
/// time.
pub(in crate::files) fn temp_name() -> String {
    name(random(), 0)
}

fn random() -> u32 {
    let mut hasher = std::hash::RandomState::new().build_hasher();
    hasher.write_u32(std::process::id());
    if let Ok(now) = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH) {
        hasher.write_u128(now.as_nanos());
    }
    hasher.finish() as u32
}

/// A temporary file; dropping the value removes the file.
pub(super) struct Temp<'d> {
    disk: &'d dyn Disk,
    path: PathBuf,
    save: u32,
    file: Option<Box<dyn DiskFile>>,
    /// True if the file was renamed or is to stay.
    stays: bool,
}

impl<'d> Temp<'d> {
    /// Creates the anchor of a save.
    pub fn anchor(disk: &'d dyn Disk, folder: &Path) -> io::Result<Self> {
        let mut attempts = 16;
        loop {
            let save = random();
            let path = folder.join(name(save, 0));
            let error = match disk.create(&path) {
                Err(error) => error,
                Ok(file) => {
                    let mut temp = Self { disk, path, save, file: Some(file), stays: false };
                    match temp.lock() {
                        Ok(()) => return Ok(temp),
                        Err(error) => error,
                    }
                }
            };
            attempts -= 1;
            let again = matches!(error.kind(), ErrorKind::AlreadyExists | ErrorKind::WouldBlock | ErrorKind::NotFound);
            // A missing folder would be missing at the next attempt, too.
            if attempts == 0 || !again || disk.entry(folder, true).is_err() {
                return Err(error);
            }
        }
    }

    /// Locks the file, and checks that no other process removed it as left over before it was locked.
    fn lock(&mut self) -> io::Result<()> {
        if let Some(file) = &mut self.file {
            file.lock()?;
        }
        self.disk.entry(&self.path, false).map(drop)
    }

    /// Creates a further file of the save that `anchor` belongs to.
    pub fn member(anchor: &Self, number: u32) -> io::Result<Self> {
        let path = anchor.path.with_file_name(name(anchor.save, number));
        let file = anchor.disk.create(&path)?;
        Ok(Self { disk: anchor.disk, path, save: anchor.save, file: Some(file), stays: false })
    }

    /// Writes the content, with the permissions of the file `like`, syncs it and compares what the disk returns.
    pub fn fill(&mut self, bytes: &[u8], like: Option<&Path>) -> Result<(), (SaveStep, io::Error)> {
        let Some(file) = &mut self.file else { return Ok(()) };
        if let Some(like) = like {
            file.keep_permissions(like).map_err(|error| (SaveStep::Permissions, error))?;
        }
        let mut rest = bytes;
        while !rest.is_empty() {
            match file.write(rest) {
                Ok(0) => return Err((SaveStep::Write, ErrorKind::WriteZero.into())),
                Ok(n) => rest = rest.get(n..).unwrap_or_default(),
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(error) => return Err((SaveStep::Write, error)),
            }
        }
        file.sync().map_err(|error| (SaveStep::Sync, error))?;
        match file.reads_back(bytes) {
            Ok(true) => Ok(()),
            Ok(false) => {
                let error = io::Error::new(ErrorKind::InvalidData, "the disk returns other bytes than were written");
                Err((SaveStep::Verify, error))
            }
            Err(error) => Err((SaveStep::Verify, error)),
        }
    }

    /// Closes the file, so that a set of many files does not keep them all open.
    pub fn close(&mut self) {
        self.file = None;
    }

    /// Renames the file to its final name, replacing a file of that name. The file stays locked until then.
    pub fn rename_to(mut self, path: &Path) -> io::Result<()> {
        self.disk.rename(&self.path, path)?;
        self.stays = true;
        Ok(())
    }

    /// Gives the file its final name, which must not exist yet: [`ErrorKind::AlreadyExists`] otherwise.
    pub fn link_to(mut self, path: &Path) -> io::Result<()> {
        match self.disk.hard_link(&self.path, path) {
            Ok(()) => return Ok(()),
            Err(error) if error.kind() == ErrorKind::AlreadyExists => return Err(error),
            // File systems such as exFAT have no hard links.
            Err(_) => {}
        }
        match self.disk.entry(path, false) {
            Ok(_) => Err(ErrorKind::AlreadyExists.into()),
            Err(error) if error.kind() == ErrorKind::NotFound => {
                self.disk.rename(&self.path, path)?;
                self.stays = true;
                Ok(())
            }
            Err(error) => Err(error),
        }
    }

    /// Leaves the file where it is, for a later save to remove.
    pub fn leave(mut self) {
        self.stays = true;
    }
}

impl Drop for Temp<'_> {
    fn drop(&mut self) {
        if !self.stays {
            // Windows removes a file at once only if it is closed.
            self.file = None;
            // A second attempt, so that a passing failure leaves no file behind.
            let _ = self.disk.remove(&self.path).or_else(|_| self.disk.remove(&self.path));
        }
    }
}

/// Removes files that processes left in `folder` when they died in the middle of a save: their temporary files, and
/// companions that no file refers to. Returns how many temporary files there were.
///
/// Files of living processes stay. Where files cannot be locked, temporary files count as left behind after an hour.
///
/// # Errors
/// When the folder cannot be listed. A file that cannot be looked at or removed is passed over.
pub fn remove_stale_temps(disk: &dyn Disk, folder: &Path) -> io::Result<usize> {
    Ok(remove_saves(disk, folder, &saves(disk, folder)?, false))
}

/// Removes stale files like [`remove_stale_temps`], for callers that have locked the folder.
pub(super) fn remove_stale_in_turn(disk: &dyn Disk, folder: &Path) -> io::Result<usize> {
    Ok(remove_saves(disk, folder, &saves(disk, folder)?, true))
}

/// Temporary files of a folder, grouped by save.
fn saves(disk: &dyn Disk, folder: &Path) -> io::Result<BTreeMap<String, Vec<PathBuf>>> {
    let mut saves: BTreeMap<String, Vec<PathBuf>> = BTreeMap::new();
    for name in disk.list(folder, usize::MAX)? {
        if let Some(save) = digits(&name).and_then(|digits| digits.get(..8)) {
            saves.entry(save.to_owned()).or_default().push(folder.join(&name));
        }
    }
    Ok(saves)
}

fn remove_saves(disk: &dyn Disk, folder: &Path, saves: &BTreeMap<String, Vec<PathBuf>>, in_turn: bool) -> usize {
    let mut removed = 0;
    for (save, files) in saves {
        let anchor = folder.join(format!("{PREFIX}{save}00000000{SUFFIX}"));
        // The lock is held until the files are gone, so that no process can reuse the name meanwhile.
        let _held = match disk.hold(&anchor) {
            Ok(None) => continue,
            Ok(held) => held,
            // A missing anchor belongs to a save whose other files were removed before: anchors are removed last.
            Err(error) if error.kind() == ErrorKind::NotFound => None,
            Err(_) if files.iter().all(|file| is_old(disk, file)) => None,
            Err(_) => continue,
        };
        // The record lists what has to be removed, so it is removed last.
        if remove_recorded(disk, folder, &anchor, in_turn).is_err() {
            continue;
        }
        for file in files.iter().filter(|file| **file != anchor).chain(files.iter().filter(|file| **file == anchor)) {
            match disk.entry(file, false) {
                Ok(entry) if entry.kind == EntryKind::File && disk.remove(file).is_ok() => removed += 1,
                Err(error) if error.kind() == ErrorKind::NotFound => {}
                _ => break,
            }
        }
    }
    removed
}

/// Removes the companions that a dead save may have left over.
fn remove_recorded(disk: &dyn Disk, folder: &Path, anchor: &Path, in_turn: bool) -> io::Result<()> {
    let names = record::read(disk, anchor)?;
    if names.is_empty() {
        return Ok(());
    }
    // The folder is locked, because another process may be about to refer to a companion that no file refers to yet.
    let _turn = if in_turn { None } else { disk.lock_folder(folder)? };
    companion::remove_unmentioned(disk, folder, &names)
}

fn is_old(disk: &dyn Disk, file: &Path) -> bool {
    let modified = disk.entry(file, false).ok().and_then(|entry| entry.modified);
    modified.and_then(|then| SystemTime::now().duration_since(then).ok()).is_some_and(|age| age >= OLD)
}
