//! Target of a save: the file that is really replaced, with links followed and special files protected.

use std::{
    io::ErrorKind,
    path::{Path, PathBuf},
};

use super::{SaveError, SaveStep, folder_of, temp::Temp};
use crate::files::disk::{Disk, EntryKind};

/// Largest number of links in a row, the same as on Linux.
const MAX_LINKS: usize = 40;

/// File that the bytes for a path are really written to.
pub(super) struct Target {
    /// Path as the caller gave it, for messages.
    pub path: PathBuf,
    /// Path with links followed.
    pub file: PathBuf,
    /// Folder of `file`.
    pub folder: PathBuf,
    /// True if `file` exists and is replaced.
    pub exists: bool,
}

impl Target {
    pub fn find(disk: &dyn Disk, path: &Path) -> Result<Self, SaveError> {
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
                // A rename would replace a write-protected file without asking.
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

    /// Writes `bytes` to a temporary file beside the target, with its permissions, syncs it and reads it back.
    pub fn stage<'d>(&self, disk: &'d dyn Disk, bytes: &[u8]) -> Result<Temp<'d>, SaveError> {
        let len = bytes.len();
        let mut temp = Temp::anchor(disk, &self.folder).map_err(|error| self.failed(len, SaveStep::Create, error))?;
        temp.fill(bytes, self.exists.then_some(self.file.as_path()))
            .map_err(|(step, error)| self.failed(len, step, error))?;
        Ok(temp)
    }

    /// Checks that files can be created beside the target.
    pub fn check_folder(&self, disk: &dyn Disk) -> Result<(), SaveError> {
        let temp = Temp::anchor(disk, &self.folder).map_err(|error| self.failed(0, SaveStep::Create, error))?;
        drop(temp);
        Ok(())
    }

    /// Puts a finished temporary file of `len` bytes in the target's place.
    pub fn replace(&self, temp: Temp, len: usize) -> Result<(), SaveError> {
        temp.rename_to(&self.file).map_err(|error| self.failed(len, SaveStep::Replace, error))
    }

    /// Waits until the name of the file in place has reached the device.
    pub fn confirm(&self, disk: &dyn Disk) -> Result<(), SaveError> {
        disk.sync_folder(&self.folder).map_err(|source| SaveError::Unconfirmed { path: self.path.clone(), source })
    }

    fn failed(&self, len: usize, step: SaveStep, source: std::io::Error) -> SaveError {
        SaveError::new(&self.path, &self.folder, len, step, source)
    }
}

/// File that a save to `path` writes: links are followed. A path to which nothing can be saved stays as it is.
pub(in crate::files) fn saved_file(disk: &dyn Disk, path: &Path) -> PathBuf {
    Target::find(disk, path).map_or_else(|_| path.to_path_buf(), |target| target.file)
}

/// File that a save to `path` writes, where that is a link, in its own folder with all links resolved: what a text names relative
/// to its file is relative to that. Any other path stays as it is.
pub(in crate::files) fn linked_file(disk: &dyn Disk, path: &Path) -> PathBuf {
    let file = saved_file(disk, path);
    if file == path {
        return file;
    }
    let resolved = disk.canonical(folder_of(&file)).ok().zip(file.file_name());
    resolved.map(|(folder, name)| folder.join(name)).unwrap_or(file)
}

/// True if the path ends in a separator, which `Path` drops: the caller means a folder.
fn ends_in_separator(path: &Path) -> bool {
    path.as_os_str().as_encoded_bytes().last().is_some_and(|&byte| std::path::is_separator(char::from(byte)))
}
