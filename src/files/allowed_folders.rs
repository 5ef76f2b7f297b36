//! Folders outside of which a request from elsewhere may neither read nor save.

use std::{
    ffi::OsStr,
    path::{Path, PathBuf},
};

use super::{atomic::folder_of, disk_error::DiskError};

/// Folders in which files may be read and saved. Links and `..` are followed before a path is compared with them.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct AllowedFolders(Vec<PathBuf>);

/// Reason for refusing a path.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum AllowedError {
    /// The path leads out of the folders.
    #[error("`{}` is outside of the folders that may be used; name a file in {folders}", path.display())]
    Outside {
        /// The path as given.
        path: PathBuf,
        /// The folders, in words.
        folders: String,
    },
    /// The file or folder does not exist.
    #[error("`{}` cannot be found: {source}; check the path", path.display())]
    Missing {
        /// The path as given.
        path: PathBuf,
        /// Error of the operating system.
        source: DiskError,
    },
    /// The path does not name a file.
    #[error("`{}` names no file", path.display())]
    NoName {
        /// The path as given.
        path: PathBuf,
    },
}

impl AllowedFolders {
    /// The folders, which must exist.
    ///
    /// # Errors
    /// [`AllowedError::Missing`] for the first folder that does not exist.
    pub fn new(folders: impl IntoIterator<Item = PathBuf>) -> Result<Self, AllowedError> {
        let found = folders.into_iter().map(|folder| real(&folder, &folder));
        found.collect::<Result<_, _>>().map(Self)
    }

    /// An existing file in one of the folders; a relative path is that below the first folder.
    ///
    /// # Errors
    /// See [`AllowedError`].
    pub fn existing(&self, path: &Path) -> Result<PathBuf, AllowedError> {
        let file = real(&self.absolute(path)?, path)?;
        self.checked(file, path)
    }

    /// A file to be saved in one of the folders; its own folder must exist.
    ///
    /// # Errors
    /// See [`AllowedError`].
    pub fn target(&self, path: &Path) -> Result<PathBuf, AllowedError> {
        let absolute = self.absolute(path)?;
        // A file that exists may be a link to another place.
        if absolute.symlink_metadata().is_ok() {
            return self.checked(real(&absolute, path)?, path);
        }
        let name = absolute.file_name().map(OsStr::to_owned);
        let name = name.ok_or_else(|| AllowedError::NoName { path: path.to_owned() })?;
        let folder = self.checked(real(folder_of(&absolute), path)?, path)?;
        Ok(folder.join(name))
    }

    fn absolute(&self, path: &Path) -> Result<PathBuf, AllowedError> {
        let first = self.0.first().ok_or_else(|| self.outside(path))?;
        Ok(first.join(path))
    }

    fn checked(&self, real: PathBuf, path: &Path) -> Result<PathBuf, AllowedError> {
        let is_inside = self.0.iter().any(|folder| real.starts_with(folder));
        if is_inside { Ok(real) } else { Err(self.outside(path)) }
    }

    fn outside(&self, path: &Path) -> AllowedError {
        let names: Vec<String> = self.0.iter().map(|folder| format!("`{}`", folder.display())).collect();
        let folders = if names.is_empty() { "none: no folder is allowed".to_owned() } else { names.join(" or ") };
        AllowedError::Outside { path: path.to_owned(), folders }
    }
}

/// The path without links, `.` and `..`.
fn real(path: &Path, given: &Path) -> Result<PathBuf, AllowedError> {
    path.canonicalize().map_err(|source| AllowedError::Missing { path: given.to_owned(), source: source.into() })
}
