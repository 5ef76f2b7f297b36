//! Reasons for not saving a file, and what to do about them.

use std::{
    io::{self, ErrorKind},
    path::{Path, PathBuf},
};

use thiserror::Error;

/// Step of a save, for error messages.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SaveStep {
    /// Inspecting the entry at the path.
    Inspect,
    /// Creating the temporary file.
    Create,
    /// Copying the permissions of the replaced file.
    Permissions,
    /// Writing the content.
    Write,
    /// Waiting until the content has reached the device.
    Sync,
    /// Comparing the bytes that the disk returns with the bytes that were written.
    Verify,
    /// Putting the finished file in place.
    Replace,
}

impl std::fmt::Display for SaveStep {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Inspect => "looking at what is there",
            Self::Create => "creating a temporary file beside it",
            Self::Permissions => "keeping its permissions",
            Self::Write => "writing",
            Self::Sync => "waiting for the disk",
            Self::Verify => "reading back what was written",
            Self::Replace => "putting the finished file in place",
        })
    }
}

/// Reason for not saving a file. The former content of the file is unchanged, except after [`SaveError::Unconfirmed`].
#[derive(Debug, Error)]
pub enum SaveError {
    /// The path ends in no file name.
    #[error("cannot save to `{}`: it names no file; add a file name", path.display())]
    NoName {
        /// The path as given.
        path: PathBuf,
    },
    /// The path is a folder.
    #[error("cannot save to `{}`: it is a folder; give the name of a file in it", path.display())]
    IsFolder {
        /// The path as given.
        path: PathBuf,
    },
    /// The path is a device, a pipe or a socket.
    #[error("cannot save to `{}`: it is not a regular file; choose another name", path.display())]
    NotAFile {
        /// The path as given.
        path: PathBuf,
    },
    /// The folder of the path is missing or is a file.
    #[error("cannot save `{}`: there is no folder `{}`; create it or choose another", path.display(), folder.display())]
    NoFolder {
        /// The path as given.
        path: PathBuf,
        /// The folder that is missing.
        folder: PathBuf,
    },
    /// The file there is marked read-only.
    #[error("cannot save `{}`: the file is write-protected; allow writing to it or save under another name", path.display())]
    WriteProtected {
        /// The path as given.
        path: PathBuf,
    },
    /// Symbolic links lead in a circle.
    #[error("cannot save `{}`: its symbolic links lead in a circle; remove the link or choose another name", path.display())]
    LinkLoop {
        /// The path as given.
        path: PathBuf,
    },
    /// Another program created a file under the name of a companion while the set was being saved.
    #[error("cannot save `{}`: another program has just put a file there; save again", path.display())]
    Occupied {
        /// The companion.
        path: PathBuf,
    },
    /// The disk, the quota or the largest file size is exhausted.
    #[error("cannot save `{}` ({bytes} bytes): the disk is full, and what was there is unchanged; free some space or choose another disk", path.display())]
    NoSpace {
        /// The path as given.
        path: PathBuf,
        /// Size of the content in bytes; of a set that of all files that are not there yet.
        bytes: u64,
        /// Error of the operating system.
        source: io::Error,
    },
    /// The folder may not be written to.
    #[error("cannot save `{}`: no permission to write in `{}`, and what was there is unchanged; choose another folder or allow writing there", path.display(), folder.display())]
    NoAccess {
        /// The path as given.
        path: PathBuf,
        /// The folder that refused.
        folder: PathBuf,
        /// Error of the operating system.
        source: io::Error,
    },
    /// Any other failure.
    #[error("cannot save `{}`: {step} failed ({source}), and what was there is unchanged; try again or choose another disk", path.display())]
    Io {
        /// The path as given.
        path: PathBuf,
        /// Failed step.
        step: SaveStep,
        /// Error of the operating system.
        source: io::Error,
    },
    /// The file is complete and in place, but the device did not confirm it.
    #[error("`{}` was written, but the disk did not confirm it ({source}); save again before relying on it", path.display())]
    Unconfirmed {
        /// The path as given.
        path: PathBuf,
        /// Error of the operating system.
        source: io::Error,
    },
}

impl SaveError {
    /// The file that was to be saved.
    pub fn path(&self) -> &Path {
        match self {
            Self::NoName { path }
            | Self::IsFolder { path }
            | Self::NotAFile { path }
            | Self::NoFolder { path, .. }
            | Self::WriteProtected { path }
            | Self::LinkLoop { path }
            | Self::Occupied { path }
            | Self::NoSpace { path, .. }
            | Self::NoAccess { path, .. }
            | Self::Io { path, .. }
            | Self::Unconfirmed { path, .. } => path,
        }
    }

    pub(super) fn new(path: &Path, folder: &Path, bytes: usize, step: SaveStep, source: io::Error) -> Self {
        let path = path.to_path_buf();
        match source.kind() {
            ErrorKind::StorageFull | ErrorKind::QuotaExceeded | ErrorKind::FileTooLarge => {
                Self::NoSpace { path, bytes: bytes as u64, source }
            }
            ErrorKind::PermissionDenied | ErrorKind::ReadOnlyFilesystem => {
                Self::NoAccess { path, folder: folder.to_path_buf(), source }
            }
            ErrorKind::NotFound | ErrorKind::NotADirectory if step == SaveStep::Create => {
                Self::NoFolder { path, folder: folder.to_path_buf() }
            }
            _ => Self::Io { path, step, source },
        }
    }
}
