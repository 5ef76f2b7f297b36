//! Saving so that a file is always whole: the old one until the finished one takes its place in a single rename.
//!
//! The order is the one that survives power loss: temporary file beside the target, write, sync, rename, sync the folder.

mod error;

pub use error::{SaveError, SaveStep};

use std::{
    ffi::OsStr,
    hash::{BuildHasher, Hasher},
    io::{self, ErrorKind},
    path::{Component, Path, PathBuf},
    time::{Duration, SystemTime},
};

use super::disk::{Disk, EntryKind};

const TEMP_PREFIX: &str = ".rigsmith-";
const TEMP_SUFFIX: &str = ".tmp";
const TEMP_DIGITS: usize = 16;
/// As many links in a row as Linux follows.
const MAX_LINKS: usize = 40;

/// Saves `bytes` as the file `path`: afterwards it holds what it held before, or all of `bytes`, whatever fails and whenever.
///
/// An existing file keeps its permissions (and owner, as far as allowed); a symbolic link stays a link, and the file it leads
/// to is replaced; other hard links keep the former content. The folder must exist. On failure the temporary file is removed.
/// Returns after the device has confirmed the content, so a call costs a few milliseconds and up; writes `bytes` once.
///
/// # Errors
/// See [`SaveError`]; the only one after which `path` holds `bytes` is [`SaveError::Unconfirmed`].
pub fn save_atomic(disk: &dyn Disk, path: &Path, bytes: &[u8]) -> Result<(), SaveError> {
    let target = Target::find(disk, path)?;
    let temp = target.stage(disk, bytes)?;
    if let Err(source) = disk.rename(&temp, &target.file) {
        let _ = disk.remove(&temp);
        return Err(SaveError::new(path, &target.folder, bytes.len(), SaveStep::Replace, source));
    }
    disk.sync_folder(&target.folder).map_err(|source| SaveError::Unconfirmed { path: path.to_path_buf(), source })
}

/// Saves files that belong together, such as a `.gltf` with its `.bin` and images; **the last one is the main file**.
///
/// All are written and synced under temporary names first, so that a full disk or a refused folder changes nothing; then they
/// are renamed in the order given, the main file last, and put back if one of the renames fails. Names often come from the
/// model itself, so none may lead out of the main file's folder; missing folders below that are created. A crash between two renames leaves each file whole, but companions may be newer than the
/// main file. Costs what [`save_atomic`] costs for each file.
///
/// # Errors
/// See [`SaveError`]. After [`SaveError::Unconfirmed`] all files are in place; after [`SaveError::Mixed`] some are.
pub fn save_all_atomic(disk: &dyn Disk, files: &[(PathBuf, Vec<u8>)]) -> Result<(), SaveError> {
    let Some((main, _)) = files.last() else { return Ok(()) };
    let mut set = Staged { disk, members: Vec::with_capacity(files.len()) };
    let main_folder = folder_of(main);
    if disk.entry(main_folder, true).is_err_and(|error| error.kind() == ErrorKind::NotFound) {
        return Err(SaveError::NoFolder { path: main.clone(), folder: main_folder.to_path_buf() });
    }
    for (path, _) in files {
        let folder = folder_of(path);
        if !is_beside_or_below(path, main) {
            return Err(SaveError::Outside { path: path.clone(), folder: main_folder.to_path_buf() });
        }
        if disk.entry(folder, true).is_err_and(|error| error.kind() == ErrorKind::NotFound) {
            disk.create_folder(folder).map_err(|source| SaveError::new(path, folder, 0, SaveStep::Create, source))?;
        }
        let target = Target::find(disk, path)?;
        if set.members.iter().any(|member| member.target.file == target.file) {
            return Err(SaveError::SameTarget { path: path.clone() });
        }
        set.members.push(Member { target, temp: None, backup: None, replaced: false });
    }
    for (member, (_, bytes)) in set.members.iter_mut().zip(files) {
        member.temp = Some(member.target.stage(disk, bytes)?);
    }
    // The rename of the main file completes the set, so it alone never has to be put back.
    let companions = set.members.len() - 1;
    for member in &mut set.members[..companions] {
        member.keep_former(disk)?;
    }
    for (i, (path, bytes)) in files.iter().enumerate() {
        if let Err(source) = set.members[i].replace(disk) {
            return Err(if set.put_back() {
                SaveError::new(path, &set.members[i].target.folder, bytes.len(), SaveStep::Replace, source)
            } else {
                SaveError::Mixed { path: main.clone(), source }
            });
        }
    }
    let mut folders: Vec<&Path> = set.members.iter().map(|member| member.target.folder.as_path()).collect();
    folders.sort_unstable();
    folders.dedup();
    for folder in folders {
        disk.sync_folder(folder).map_err(|source| SaveError::Unconfirmed { path: main.clone(), source })?;
    }
    Ok(())
}

/// Tells whether a file name is that of one of our temporary files (`.rigsmith-` + 16 hexadecimal digits + `.tmp`).
pub fn is_temp_name(name: &OsStr) -> bool {
    name.to_str()
        .and_then(|name| name.strip_prefix(TEMP_PREFIX)?.strip_suffix(TEMP_SUFFIX))
        .is_some_and(|digits| digits.len() == TEMP_DIGITS && digits.bytes().all(|b| b.is_ascii_hexdigit()))
}

/// Removes temporary files in `folder` that killed processes left there at least `age` ago; returns how many.
///
/// # Errors
/// When the folder cannot be listed. A file that cannot be looked at or removed is passed over.
pub fn remove_stale_temps(disk: &dyn Disk, folder: &Path, age: Duration) -> io::Result<usize> {
    let now = SystemTime::now();
    let mut removed = 0;
    for name in disk.list(folder, usize::MAX)?.iter().filter(|name| is_temp_name(name)) {
        let path = folder.join(name);
        let stale = disk.entry(&path, false).is_ok_and(|entry| {
            entry.kind == EntryKind::File
                && entry.modified.and_then(|then| now.duration_since(then).ok()).is_some_and(|old| old >= age)
        });
        if stale && disk.remove(&path).is_ok() {
            removed += 1;
        }
    }
    Ok(removed)
}

/// Where the bytes for `path` really go.
struct Target {
    /// As the caller gave it, for messages.
    path: PathBuf,
    /// With links followed.
    file: PathBuf,
    folder: PathBuf,
    exists: bool,
}

impl Target {
    fn find(disk: &dyn Disk, path: &Path) -> Result<Self, SaveError> {
        let named = |path: PathBuf| SaveError::NoName { path };
        let mut file = path.to_path_buf();
        for _ in 0..=MAX_LINKS {
            if file.file_name().is_none() || ends_in_separator(&file) {
                let is_folder = disk.entry(&file, true).is_ok_and(|entry| entry.kind == EntryKind::Folder);
                let path = path.to_path_buf();
                return Err(if is_folder { SaveError::IsFolder { path } } else { named(path) });
            }
            let folder = folder_of(&file).to_path_buf();
            let path = path.to_path_buf();
            let entry = match disk.entry(&file, false) {
                Ok(entry) => entry,
                Err(error) if error.kind() == ErrorKind::NotFound => {
                    return Ok(Self { path, file, folder, exists: false });
                }
                Err(error) if error.kind() == ErrorKind::NotADirectory => {
                    return Err(SaveError::NoFolder { path, folder });
                }
                Err(error) => return Err(SaveError::new(&path, &folder, 0, SaveStep::Inspect, error)),
            };
            match entry.kind {
                EntryKind::Folder => return Err(SaveError::IsFolder { path }),
                EntryKind::Other => return Err(SaveError::NotAFile { path }),
                // Renaming would replace a protected file without asking.
                EntryKind::File if entry.read_only => return Err(SaveError::WriteProtected { path }),
                EntryKind::File => {
                    return Ok(Self { path, file, folder, exists: true });
                }
                EntryKind::Link => {
                    let link = disk
                        .read_link(&file)
                        .map_err(|source| SaveError::new(&path, &folder, 0, SaveStep::Inspect, source))?;
                    file = folder.join(link);
                }
            }
        }
        Err(SaveError::LinkLoop { path: path.to_path_buf() })
    }

    /// Writes `bytes` to a temporary file beside the target, with its permissions, and syncs it.
    fn stage(&self, disk: &dyn Disk, bytes: &[u8]) -> Result<PathBuf, SaveError> {
        let failed = |step, source| SaveError::new(&self.path, &self.folder, bytes.len(), step, source);
        let mut attempts = 16;
        let (temp, mut file) = loop {
            let temp = self.folder.join(temp_name());
            match disk.create(&temp) {
                Ok(file) => break (temp, file),
                Err(error) if error.kind() == ErrorKind::AlreadyExists && attempts > 0 => attempts -= 1,
                Err(error) => return Err(failed(SaveStep::Create, error)),
            }
        };
        let mut fill = || {
            if self.exists {
                file.keep_permissions(&self.file).map_err(|e| (SaveStep::Permissions, e))?;
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
            file.sync().map_err(|e| (SaveStep::Sync, e))
        };
        let filled = fill();
        // Windows renames and removes only closed files.
        drop(file);
        match filled {
            Ok(()) => Ok(temp),
            Err((step, source)) => {
                let _ = disk.remove(&temp);
                Err(failed(step, source))
            }
        }
    }
}

/// One file of a set between being written and being in place.
struct Member {
    target: Target,
    temp: Option<PathBuf>,
    backup: Option<PathBuf>,
    replaced: bool,
}

impl Member {
    /// Gives the former file a second name, so that it can be put back.
    fn keep_former(&mut self, disk: &dyn Disk) -> Result<(), SaveError> {
        if !self.target.exists {
            return Ok(());
        }
        let backup = self.target.folder.join(temp_name());
        if disk.hard_link(&self.target.file, &backup).is_ok() {
            self.backup = Some(backup);
            return Ok(());
        }
        // Not every file system has hard links (exFAT has none).
        let mut former = Vec::new();
        disk.open(&self.target.file)
            .and_then(|mut file| io::Read::read_to_end(&mut file, &mut former))
            .map_err(|source| SaveError::new(&self.target.path, &self.target.folder, 0, SaveStep::Inspect, source))?;
        self.backup = Some(self.target.stage(disk, &former)?);
        Ok(())
    }

    fn replace(&mut self, disk: &dyn Disk) -> io::Result<()> {
        if let Some(temp) = &self.temp {
            disk.rename(temp, &self.target.file)?;
            self.temp = None;
            self.replaced = true;
        }
        Ok(())
    }
}

/// The files of a set; whatever is left under a temporary name is removed at the end.
struct Staged<'d> {
    disk: &'d dyn Disk,
    members: Vec<Member>,
}

impl Staged<'_> {
    /// Undoes the renames done so far; true if all of them were undone.
    fn put_back(&mut self) -> bool {
        let mut whole = true;
        for member in self.members.iter_mut().rev().filter(|member| member.replaced) {
            let undone = match member.backup.take() {
                Some(backup) => self.disk.rename(&backup, &member.target.file),
                None => self.disk.remove(&member.target.file),
            };
            whole &= undone.is_ok();
        }
        whole
    }
}

impl Drop for Staged<'_> {
    fn drop(&mut self) {
        for member in &self.members {
            for path in member.temp.iter().chain(&member.backup) {
                // A failure that passes should leave no litter.
                let _ = self.disk.remove(path).or_else(|_| self.disk.remove(path));
            }
        }
    }
}

/// The folder of a path; `.` for a bare name.
pub(super) fn folder_of(path: &Path) -> &Path {
    match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    }
}

/// Tells whether `path` lies in the folder of `main` or below it, by name alone.
fn is_beside_or_below(path: &Path, main: &Path) -> bool {
    path.strip_prefix(main.parent().unwrap_or(Path::new("")))
        .is_ok_and(|rest| rest.components().all(|part| matches!(part, Component::Normal(_) | Component::CurDir)))
}

/// `Path` drops a trailing separator, but whoever writes one means a folder.
fn ends_in_separator(path: &Path) -> bool {
    path.as_os_str().as_encoded_bytes().last().is_some_and(|&byte| std::path::is_separator(char::from(byte)))
}

/// A name that no other process or thread uses at the same time.
pub(super) fn temp_name() -> String {
    let mut hasher = std::hash::RandomState::new().build_hasher();
    hasher.write_u32(std::process::id());
    if let Ok(now) = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH) {
        hasher.write_u128(now.as_nanos());
    }
    format!("{TEMP_PREFIX}{:016x}{TEMP_SUFFIX}", hasher.finish())
}
