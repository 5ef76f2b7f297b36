//! Disk in memory, on which whole commands save and read without touching a file.

use std::{
    collections::BTreeMap,
    ffi::OsString,
    io::{self, ErrorKind},
    path::{Path, PathBuf},
    sync::{Arc, Mutex, MutexGuard, PoisonError},
};

use rigsmith::files::{Disk, DiskFile, Entry, EntryKind};

/// Folder that exists; there is no other.
const FOLDER: &str = "/memory";

/// Path of a file by its name.
pub fn at(name: &str) -> PathBuf {
    Path::new(FOLDER).join(name)
}

type Content = Arc<Mutex<Vec<u8>>>;

/// Files by path, all in one folder.
#[derive(Debug, Clone, Default)]
pub struct MemoryDisk {
    files: Arc<Mutex<BTreeMap<PathBuf, Content>>>,
}

impl MemoryDisk {
    fn files(&self) -> MutexGuard<'_, BTreeMap<PathBuf, Content>> {
        self.files.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Puts a file onto the disk.
    pub fn put(&self, name: &str, bytes: &[u8]) {
        self.files().insert(at(name), Arc::new(Mutex::new(bytes.to_vec())));
    }

    /// Content of a file.
    pub fn get(&self, name: &str) -> Option<Vec<u8>> {
        self.content(&at(name)).ok().map(|content| bytes_of(&content))
    }

    /// Names of all files.
    pub fn names(&self) -> Vec<String> {
        let name = |path: &PathBuf| path.file_name().map(|name| name.to_string_lossy().into_owned());
        self.files().keys().filter_map(name).collect()
    }

    fn content(&self, path: &Path) -> io::Result<Content> {
        self.files().get(path).cloned().ok_or_else(|| ErrorKind::NotFound.into())
    }
}

fn bytes_of(content: &Content) -> Vec<u8> {
    content.lock().unwrap_or_else(PoisonError::into_inner).clone()
}

impl Disk for MemoryDisk {
    fn entry(&self, path: &Path, _: bool) -> io::Result<Entry> {
        let entry = |kind, len| Entry { kind, len, read_only: false, modified: None };
        if path == Path::new(FOLDER) {
            return Ok(entry(EntryKind::Folder, 0));
        }
        Ok(entry(EntryKind::File, bytes_of(&self.content(path)?).len() as u64))
    }

    fn read_link(&self, _: &Path) -> io::Result<PathBuf> {
        Err(ErrorKind::InvalidInput.into())
    }

    fn canonical(&self, path: &Path) -> io::Result<PathBuf> {
        self.entry(path, true).map(|_| path.to_owned())
    }

    fn list(&self, folder: &Path, limit: usize) -> io::Result<Vec<OsString>> {
        if folder != Path::new(FOLDER) {
            return Err(ErrorKind::NotFound.into());
        }
        Ok(self.files().keys().filter_map(|path| path.file_name()).map(OsString::from).take(limit).collect())
    }

    fn create(&self, path: &Path) -> io::Result<Box<dyn DiskFile>> {
        if path.parent() != Some(Path::new(FOLDER)) {
            return Err(ErrorKind::NotFound.into());
        }
        if self.content(path).is_ok() {
            return Err(ErrorKind::AlreadyExists.into());
        }
        let content = Content::default();
        self.files().insert(path.to_owned(), content.clone());
        Ok(Box::new(MemoryFile(content)))
    }

    fn rename(&self, from: &Path, to: &Path) -> io::Result<()> {
        let mut files = self.files();
        let content = files.remove(from).ok_or(ErrorKind::NotFound)?;
        files.insert(to.to_owned(), content);
        Ok(())
    }

    fn hard_link(&self, existing: &Path, path: &Path) -> io::Result<()> {
        let content = self.content(existing)?;
        if self.files().contains_key(path) {
            return Err(ErrorKind::AlreadyExists.into());
        }
        self.files().insert(path.to_owned(), content);
        Ok(())
    }

    fn sync_folder(&self, _: &Path) -> io::Result<()> {
        Ok(())
    }

    fn remove(&self, path: &Path) -> io::Result<()> {
        self.files().remove(path).map(drop).ok_or_else(|| ErrorKind::NotFound.into())
    }

    fn create_folder(&self, _: &Path) -> io::Result<()> {
        Ok(())
    }

    fn open(&self, path: &Path) -> io::Result<Box<dyn io::Read + Send>> {
        Ok(Box::new(io::Cursor::new(bytes_of(&self.content(path)?))))
    }
}

struct MemoryFile(Content);

impl DiskFile for MemoryFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).extend_from_slice(bytes);
        Ok(bytes.len())
    }

    fn keep_permissions(&mut self, _: &Path) -> io::Result<()> {
        Ok(())
    }

    fn sync(&mut self) -> io::Result<()> {
        Ok(())
    }

    fn reads_back(&mut self, bytes: &[u8]) -> io::Result<bool> {
        Ok(bytes_of(&self.0) == bytes)
    }
}
