//! Reading files with a size limit, and with errors that say what to do.

use std::{
    ffi::OsString,
    io::{self, ErrorKind, Read},
    path::{Path, PathBuf},
};

use thiserror::Error;

use super::{
    atomic::{folder_of, is_temp_name},
    disk::{Disk, Entry, EntryKind},
    disk_error::DiskError,
};

/// Largest number of bytes that are reserved before a single byte has been read, whatever length the file claims.
const FIRST_RESERVE: u64 = 16 << 20;
/// Bytes that tell what kind of file it is.
const BEGINNING: u64 = 4096;
/// Largest number of names in a folder that are searched for a hint.
const MAX_NAMES: usize = 4096;
const MAX_HINTS: usize = 3;
/// Remedy for a symbolic link whose file is missing.
const LINK_REMEDY: &str = "it is a symbolic link to a file that is not there; correct the link or remove it";

/// Remedy for a missing file with a name unlike all others.
pub(super) const UNLIKE: &str = "check the path";

/// Reason for not reading a file.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum ReadError {
    /// The file does not exist.
    #[error("there is no file `{}`; {hint}", path.display())]
    Missing {
        /// The path as given.
        path: PathBuf,
        /// Remedy; names the nearest existing files.
        hint: String,
    },
    /// The path is a folder.
    #[error("`{}` is a folder; give the name of a file in it", path.display())]
    IsFolder {
        /// The path as given.
        path: PathBuf,
    },
    /// The path is a device, a pipe or a socket.
    #[error("`{}` is not a regular file; save what it delivers to a file first", path.display())]
    NotAFile {
        /// The path as given.
        path: PathBuf,
    },
    /// The file has no content.
    #[error("`{}` is empty; export or copy it again", path.display())]
    Empty {
        /// The path as given.
        path: PathBuf,
    },
    /// The file may not be read.
    #[error("no permission to read `{}`; allow reading it or copy it elsewhere", path.display())]
    NoAccess {
        /// The path as given.
        path: PathBuf,
        /// Error of the operating system.
        source: DiskError,
    },
    /// The file is longer than the limit.
    #[error("`{}` is too large: more than {limit} bytes are not read here; make it smaller or split it", path.display())]
    TooLarge {
        /// The path as given.
        path: PathBuf,
        /// The limit in bytes.
        limit: u64,
    },
    /// Any other failure.
    #[error("cannot read `{}`: {source}; check the disk or copy the file elsewhere", path.display())]
    Io {
        /// The path as given.
        path: PathBuf,
        /// Error of the operating system.
        source: DiskError,
    },
}

impl ReadError {
    /// The path as given.
    pub fn path(&self) -> &Path {
        match self {
            Self::Missing { path, .. }
            | Self::IsFolder { path }
            | Self::NotAFile { path }
            | Self::Empty { path }
            | Self::NoAccess { path, .. }
            | Self::TooLarge { path, .. }
            | Self::Io { path, .. } => path,
        }
    }

    pub(super) fn new(disk: &dyn Disk, path: &Path, source: io::Error) -> Self {
        let hint = is_missing(&source).then(|| hint(disk, path));
        let path = path.to_path_buf();
        match (source.kind(), hint) {
            (_, Some(hint)) => Self::Missing { path, hint },
            (ErrorKind::PermissionDenied, _) => Self::NoAccess { path, source: source.into() },
            (ErrorKind::IsADirectory, _) => Self::IsFolder { path },
            _ => Self::Io { path, source: source.into() },
        }
    }
}

/// True if an error says that there is nothing at a path. Others are no answer: something may be there.
pub(super) fn is_missing(error: &io::Error) -> bool {
    matches!(error.kind(), ErrorKind::NotFound | ErrorKind::NotADirectory)
}

/// A file to be read in blocks.
pub struct OpenFile {
    /// The content.
    pub reader: Box<dyn Read + Send>,
    /// Length in bytes that the file system claims; the reader may deliver more or fewer.
    pub len: u64,
}

impl Read for OpenFile {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        self.reader.read(buffer)
    }
}

/// Opens a regular, non-empty file for reading in blocks.
///
/// # Errors
/// See [`ReadError`]; `TooLarge` does not occur.
pub fn open(disk: &dyn Disk, path: &Path) -> Result<OpenFile, ReadError> {
    let entry = regular(disk, path)?;
    if entry.len == 0 {
        return Err(ReadError::Empty { path: path.to_path_buf() });
    }
    let reader = disk.open(path).map_err(|error| ReadError::new(disk, path, error))?;
    Ok(OpenFile { reader, len: entry.len })
}

/// Reads a whole regular, non-empty file of at most `limit` bytes.
///
/// Memory follows what really arrives: a length that the file system only claims reserves at most 16 MiB.
///
/// # Errors
/// See [`ReadError`].
pub fn read_capped(disk: &dyn Disk, path: &Path, limit: u64) -> Result<Vec<u8>, ReadError> {
    read_plausible(disk, path, limit, |_| true)
}

/// Reads a file as [`read_capped`] does if its first bytes may be those of the wanted kind; otherwise these bytes alone,
/// which the reader of that kind refuses like the whole file. Gigabytes of anything else are not read.
///
/// # Errors
/// See [`ReadError`].
pub(super) fn read_plausible(
    disk: &dyn Disk,
    path: &Path,
    limit: u64,
    may_begin_with: impl Fn(&[u8]) -> bool,
) -> Result<Vec<u8>, ReadError> {
    let too_large = || ReadError::TooLarge { path: path.to_path_buf(), limit };
    let entry = regular(disk, path)?;
    if entry.len > limit {
        return Err(too_large());
    }
    let reader = disk.open(path).map_err(|error| ReadError::new(disk, path, error))?;
    let mut reader = reader.take(limit.saturating_add(1));
    let mut bytes = Vec::with_capacity(usize::try_from(entry.len.min(FIRST_RESERVE)).unwrap_or(0));
    let failed = |error| ReadError::new(disk, path, error);
    reader.by_ref().take(BEGINNING).read_to_end(&mut bytes).map_err(failed)?;
    if !may_begin_with(&bytes) && !bytes.is_empty() {
        return Ok(bytes);
    }
    reader.read_to_end(&mut bytes).map_err(failed)?;
    match bytes.len() as u64 {
        0 => Err(ReadError::Empty { path: path.to_path_buf() }),
        read if read > limit => Err(too_large()),
        _ => Ok(bytes),
    }
}

fn regular(disk: &dyn Disk, path: &Path) -> Result<Entry, ReadError> {
    let entry = disk.entry(path, true).map_err(|error| ReadError::new(disk, path, error))?;
    match entry.kind {
        EntryKind::File => Ok(entry),
        EntryKind::Folder => Err(ReadError::IsFolder { path: path.to_path_buf() }),
        // Opening a pipe without a writer would wait for ever.
        EntryKind::Link | EntryKind::Other => Err(ReadError::NotAFile { path: path.to_path_buf() }),
    }
}

/// Remedy for a missing file: names the first missing folder, or the names most like the given one. A symbolic link that leads
/// nowhere is told as one, because its own name is the most alike.
fn hint(disk: &dyn Disk, path: &Path) -> String {
    let is_link = || disk.entry(path, false).is_ok_and(|entry| entry.kind == EntryKind::Link);
    let of_link = || is_link().then(|| LINK_REMEDY.to_owned());
    let list = || disk.list(folder_of(path), MAX_NAMES).unwrap_or_default();
    no_folder(disk, path).or_else(of_link).unwrap_or_else(|| nearest_names(path, &list()))
}

/// Remedy for a missing file whose folder is missing as well, or is none.
pub(super) fn no_folder(disk: &dyn Disk, path: &Path) -> Option<String> {
    let folder = folder_of(path);
    match disk.entry(folder, true) {
        Ok(entry) if entry.kind == EntryKind::Folder => None,
        Ok(_) => Some(format!("`{}` is a file, not a folder", folder.display())),
        Err(_) => Some(format!("there is no folder `{}` either; check the path", folder.display())),
    }
}

/// Remedy for a missing file: the most alike of the first names in its folder.
pub(super) fn nearest_names(path: &Path, names: &[OsString]) -> String {
    let wanted = path.file_name().unwrap_or_default().to_string_lossy().to_lowercase();
    let mut near: Vec<(usize, String)> = names
        .iter()
        .take(MAX_NAMES)
        .filter(|name| !is_temp_name(name))
        .filter_map(|name| {
            let name = name.to_string_lossy().into_owned();
            let distance = edit_distance(&wanted, &name.to_lowercase());
            (distance <= 2.max(wanted.chars().count() / 3)).then_some((distance, name))
        })
        .collect();
    near.sort();
    near.truncate(MAX_HINTS);
    match near.as_slice() {
        [] => UNLIKE.to_owned(),
        names => {
            let names: Vec<String> = names.iter().map(|(_, name)| format!("`{name}`")).collect();
            format!("did you mean {}?", names.join(" or "))
        }
    }
}

/// Levenshtein distance in characters. Names have at most 255 characters on common file systems.
fn edit_distance(a: &str, b: &str) -> usize {
    let b: Vec<char> = b.chars().take(255).collect();
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, x) in a.chars().take(255).enumerate() {
        let mut diagonal = i;
        row[0] = i + 1;
        for (j, &y) in b.iter().enumerate() {
            let substituted = diagonal + usize::from(x != y);
            diagonal = row[j + 1];
            row[j + 1] = substituted.min(diagonal + 1).min(row[j] + 1);
        }
    }
    row[b.len()]
}
