//! Folder of a model: finds files that a model refers to, and refuses files outside.
//!
//! A model from elsewhere may name `file:///etc/passwd`, `../../secret` or a link that leads out. Only what lies below
//! the model's own folder, with every link resolved, is ever opened.

use std::{
    collections::HashMap,
    ffi::OsString,
    io::ErrorKind,
    path::{Path, PathBuf},
    sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError},
};

use thiserror::Error;

use super::{
    atomic::folder_of,
    disk::{Disk, EntryKind},
    read::{OpenFile, ReadError, UNLIKE, is_missing, nearest_names, no_folder, open, read_capped},
};

/// Largest number of names that are searched for one that differs only in case.
const MAX_NAMES: usize = 10_000;
/// Number of names that are kept of the folders that were listed.
const MAX_KEPT: usize = 10 * MAX_NAMES;
/// Number of missing files for which names like theirs are searched.
const MAX_HINTED: usize = 32;
/// Longest reference in bytes; longer ones exceed every file system and are refused unread.
const MAX_LENGTH: usize = 4096;
/// Number of characters of a reference that a message shows.
const SHOWN: usize = 80;

/// Reason for not reading a file that a model refers to.
#[derive(Debug, Error)]
pub enum UriError {
    /// The reference is empty, too long or holds control characters.
    #[error("the model names a file `{uri}`, which is no usable file name ({reason}); correct the reference")]
    Unusable {
        /// The reference, shortened.
        uri: String,
        /// Defect of the reference, in words.
        reason: &'static str,
    },
    /// The reference is a URL.
    #[error(
        "the model names `{uri}`, which is a URL; only files are read: put it beside the model and name it without a scheme"
    )]
    Url {
        /// The reference, shortened.
        uri: String,
    },
    /// The reference is an absolute path.
    #[error("the model names `{uri}` by an absolute path; put the file beside the model and name it relative to that")]
    Absolute {
        /// The reference, shortened.
        uri: String,
    },
    /// The reference leads out of the model's folder.
    #[error("the model names `{uri}`, which is outside its folder `{}`; put the file below that folder", folder.display())]
    Outside {
        /// The reference, shortened.
        uri: String,
        /// The model's folder.
        folder: PathBuf,
    },
    /// The file is missing or unreadable.
    #[error("the model names `{uri}`: {source}")]
    Read {
        /// The reference, shortened.
        uri: String,
        /// Reason for not reading the file.
        source: ReadError,
    },
}

/// Resolves the references of one model to files below the model's folder.
///
/// Folders are listed once, so that the answers are those of one moment; use another value for another reading.
pub struct ModelFolder<'d> {
    disk: &'d dyn Disk,
    /// Canonical path of the folder, so that prefixes can be compared.
    root: PathBuf,
    /// The model's file, if it is known.
    model: Option<PathBuf>,
    /// Canonical path of the folder to which the model's file is a link.
    linked: OnceLock<Option<PathBuf>>,
    search: Mutex<Search>,
}

/// Searches for names so far.
#[derive(Default)]
struct Search {
    folders: HashMap<PathBuf, Arc<Names>>,
    /// Number of names in those folders.
    kept: usize,
    /// Number of missing files for which names like theirs were searched.
    hinted: usize,
}

/// Names in a folder.
struct Names {
    sorted: Vec<OsString>,
    /// The first in byte order of the names that differ only in case, by the name in lower case.
    by_lower: HashMap<String, OsString>,
}

impl Names {
    fn list(disk: &dyn Disk, folder: &Path) -> Self {
        let sorted = disk.list(folder, MAX_NAMES).unwrap_or_default();
        let mut by_lower = HashMap::with_capacity(sorted.len());
        for name in &sorted {
            if let Some(text) = name.to_str() {
                by_lower.entry(text.to_lowercase()).or_insert_with(|| name.clone());
            }
        }
        Self { sorted, by_lower }
    }
}

impl<'d> ModelFolder<'d> {
    /// Returns the folder in which the file `model` lies. If that is a link, what is not in the folder is looked for beside the
    /// file that it leads to, where saves put companions.
    ///
    /// # Errors
    /// When the folder does not exist or cannot be reached.
    pub fn of(disk: &'d dyn Disk, model: &Path) -> Result<Self, ReadError> {
        Ok(Self { model: Some(model.to_path_buf()), ..Self::at(disk, folder_of(model))? })
    }

    /// Returns the folder `folder` itself.
    ///
    /// # Errors
    /// When it does not exist or cannot be reached.
    pub fn at(disk: &'d dyn Disk, folder: &Path) -> Result<Self, ReadError> {
        let root = disk.canonical(folder).map_err(|error| ReadError::new(disk, folder, error))?;
        Ok(Self { disk, root, model: None, linked: OnceLock::new(), search: Mutex::default() })
    }

    /// Returns the folder, absolute and with links resolved.
    pub fn path(&self) -> &Path {
        &self.root
    }

    /// Finds the existing file or folder that the relative reference `uri` names (percent escapes already decoded).
    ///
    /// `\` counts as `/`, and where no name fits exactly one that differs only in case is taken (the first in byte
    /// order), because files written on Windows are like that. The result is absolute, with links resolved.
    ///
    /// # Errors
    /// For anything but a relative reference to something below the folder, and where nothing is there.
    pub fn resolve(&self, uri: &str) -> Result<PathBuf, UriError> {
        let names = self.split(uri)?;
        let found = self.find(uri, &names, &self.root);
        if matches!(&found, Err(UriError::Read { source: ReadError::Missing { .. }, .. }))
            && let Some(linked) = self.linked()
            && let Ok(path) = self.find(uri, &names, linked)
        {
            return Ok(path);
        }
        found
    }

    /// Folder of the file that the model's file leads to as a link; `None` if that is the model's own folder.
    fn linked(&self) -> Option<&Path> {
        let find = || {
            let file = self.disk.canonical(self.model.as_deref()?).ok()?;
            file.parent().map(Path::to_path_buf).filter(|folder| *folder != self.root)
        };
        self.linked.get_or_init(find).as_deref()
    }

    /// Finds what the names lead to below `root`.
    fn find(&self, uri: &str, names: &[String], root: &Path) -> Result<PathBuf, UriError> {
        let mut path = root.to_path_buf();
        for (i, name) in names.iter().enumerate() {
            let exact = path.join(name);
            path = match self.disk.canonical(&exact) {
                Ok(found) => found,
                Err(error) if error.kind() == ErrorKind::NotFound => match self.other_case(&path, name) {
                    Some(found) => found,
                    None => return Err(self.missing(uri, &path, &names[i..])),
                },
                Err(error) if error.kind() == ErrorKind::NotADirectory => {
                    return Err(self.missing(uri, &path, &names[i..]));
                }
                Err(error) => {
                    let source = ReadError::new(self.disk, &exact, error);
                    return Err(UriError::Read { uri: shown(uri), source });
                }
            };
            // Checked at every step, so that no folder outside is even listed.
            if !path.starts_with(root) {
                return Err(self.outside(uri));
            }
        }
        Ok(path)
    }

    /// Reads the whole file that `uri` names, of at most `limit` bytes; see [`resolve`](Self::resolve).
    ///
    /// # Errors
    /// As `resolve`, and as [`read_capped`].
    pub fn read(&self, uri: &str, limit: u64) -> Result<Vec<u8>, UriError> {
        let path = self.resolve(uri)?;
        read_capped(self.disk, &path, limit).map_err(|source| UriError::Read { uri: shown(uri), source })
    }

    /// Opens the file that `uri` names for reading in blocks; see [`resolve`](Self::resolve).
    ///
    /// # Errors
    /// As `resolve`, and as [`open`].
    pub fn open(&self, uri: &str) -> Result<OpenFile, UriError> {
        let path = self.resolve(uri)?;
        open(self.disk, &path).map_err(|source| UriError::Read { uri: shown(uri), source })
    }

    /// Splits a reference into names below the folder, `.` and `..` worked out.
    fn split(&self, uri: &str) -> Result<Vec<String>, UriError> {
        let unusable = |reason| Err(UriError::Unusable { uri: shown(uri), reason });
        if uri.len() > MAX_LENGTH {
            return unusable("it is too long");
        }
        if uri.chars().any(char::is_control) {
            return unusable("it holds control characters");
        }
        let uri_slashed = uri.replace('\\', "/");
        if let Some((scheme, _)) = uri_slashed.split_once(':')
            && scheme.starts_with(|c: char| c.is_ascii_alphabetic())
            && scheme.chars().all(|c| c.is_ascii_alphanumeric() || "+-.".contains(c))
        {
            let uri = shown(uri);
            // A scheme of a single letter is a Windows drive.
            return Err(if scheme.len() == 1 { UriError::Absolute { uri } } else { UriError::Url { uri } });
        }
        if uri_slashed.starts_with('/') {
            return Err(UriError::Absolute { uri: shown(uri) });
        }
        if cfg!(windows) && uri_slashed.contains(':') {
            return unusable("it holds a colon");
        }
        let mut names = Vec::new();
        for name in uri_slashed.split('/') {
            match name {
                "" | "." => {}
                ".." => {
                    if names.pop().is_none() {
                        return Err(self.outside(uri));
                    }
                }
                name => names.push(name.to_owned()),
            }
        }
        if names.is_empty() {
            return unusable("it names no file");
        }
        Ok(names)
    }

    /// Name in `folder` that differs from `name` only in case.
    fn other_case(&self, folder: &Path, name: &str) -> Option<PathBuf> {
        let names = self.names(folder);
        let found = names.by_lower.get(&name.to_lowercase())?;
        self.disk.canonical(&folder.join(found)).ok()
    }

    /// Names in a folder, listed where they were not listed yet.
    fn names(&self, folder: &Path) -> Arc<Names> {
        if let Some(names) = self.search().folders.get(folder) {
            return names.clone();
        }
        let names = Arc::new(Names::list(self.disk, folder));
        let mut search = self.search();
        if search.kept + names.sorted.len() > MAX_KEPT {
            search.folders.clear();
            search.kept = 0;
        }
        search.kept += names.sorted.len() + 1;
        search.folders.insert(folder.to_path_buf(), names.clone());
        names
    }

    fn search(&self) -> MutexGuard<'_, Search> {
        self.search.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn outside(&self, uri: &str) -> UriError {
        UriError::Outside { uri: shown(uri), folder: self.root.clone() }
    }

    fn missing(&self, uri: &str, folder: &Path, rest: &[String]) -> UriError {
        let mut path = folder.to_path_buf();
        path.extend(rest);
        // A second attempt to reach the file tells why it fails.
        let source = match self.disk.entry(&path, true) {
            Err(error) if is_missing(&error) => ReadError::Missing { hint: self.hint(&path), path },
            _ => match open(self.disk, &path) {
                Err(error) => error,
                Ok(_) => ReadError::Missing { path, hint: "try again".to_owned() },
            },
        };
        UriError::Read { uri: shown(uri), source }
    }

    /// Remedy for a missing file.
    fn hint(&self, path: &Path) -> String {
        if let Some(hint) = no_folder(self.disk, path) {
            return hint;
        }
        let hinted = {
            let mut search = self.search();
            search.hinted += 1;
            search.hinted
        };
        // Each search compares the name with all others; a model may name files without end.
        if hinted > MAX_HINTED { UNLIKE.to_owned() } else { nearest_names(path, &self.names(folder_of(path)).sorted) }
    }

    /// True if `uri` refers to an existing regular file below the folder.
    pub fn has(&self, uri: &str) -> bool {
        self.resolve(uri)
            .is_ok_and(|path| self.disk.entry(&path, true).is_ok_and(|entry| entry.kind == EntryKind::File))
    }
}

/// A reference for messages: one line, shortened, without the megabytes of an embedded picture.
fn shown(uri: &str) -> String {
    let mut text: String = uri.chars().take(SHOWN).map(|c| if c.is_control() { '\u{FFFD}' } else { c }).collect();
    if uri.chars().nth(SHOWN).is_some() {
        text.push_str("...");
    }
    text
}
