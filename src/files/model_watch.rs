//! Model files whose saves are awaited.
//!
//! A model may be large and may name other files (buffers, materials, pictures), so a watch keeps hashes instead of contents,
//! and follows all files that the last read has asked for. A mesh as text that is cut off is a mesh, too: a file has to stand
//! still for a while before it is read, and what changes while it is read is not taken.

use std::{
    collections::{BTreeMap, BTreeSet},
    ffi::OsString,
    io::{self, Read},
    path::{Path, PathBuf},
    sync::{Mutex, PoisonError},
    time::{Duration, Instant, SystemTime},
};

use super::{Disk, DiskFile, Entry, EntryKind, FileKind, LoadError, load_model};
use crate::{mesh::model::Model, rig::skin::content_hash};

/// Time for which files have to stand still before they are read.
pub const SETTLE: Duration = Duration::from_millis(250);

/// Least time between two looks at the contents of files that seem unchanged: some file systems keep time and length.
const READ_EVERY: Duration = Duration::from_millis(500);

/// Share of the time that reading contents may take: the pause is that many times as long.
const REST: u32 = 20;

/// Bytes that are hashed at a time.
const BLOCK: u64 = 1 << 20;

/// Length and time of a file; `None` while it is not there.
type FileStamp = Option<(u64, Option<SystemTime>)>;

/// Hashes of the contents of files; `None` for one that cannot be read.
type Contents = BTreeMap<PathBuf, Option<u64>>;

/// A model's file, with the files that it names, whose next version is awaited.
#[derive(Debug, Clone)]
pub struct ModelWatch {
    path: PathBuf,
    settle: Duration,
    /// Length and time of every followed file at the last look.
    stamps: BTreeMap<PathBuf, FileStamp>,
    /// Contents that are known or were told.
    known: Contents,
    next: Option<UnsettledVersion>,
    /// Time of the last look at the contents, and the pause before the next one.
    read: Option<Instant>,
    pause: Duration,
}

/// Another version that may still be written.
#[derive(Debug, Clone)]
struct UnsettledVersion {
    since: Instant,
    /// Contents of files that kept time and length; `None` where the stamps tell that there is another version.
    contents: Option<Contents>,
}

impl ModelWatch {
    /// A watch of a model's file, which is news as soon as it can be read: see [`know`](Self::know).
    pub fn new(path: &Path) -> Self {
        Self {
            path: path.to_owned(),
            settle: SETTLE,
            stamps: BTreeMap::from([(path.to_owned(), None)]),
            known: Contents::new(),
            next: None,
            read: None,
            pause: READ_EVERY,
        }
    }

    /// Watch of the same files that have to stand still for another time.
    pub fn settling(self, settle: Duration) -> Self {
        Self { settle, ..self }
    }

    /// The model's file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The model's file and the files that it names, as far as they are known.
    pub fn files(&self) -> BTreeSet<PathBuf> {
        self.stamps.keys().cloned().collect()
    }

    /// Takes note of the files as they are: the next version is the first that is told. A `.gltf`, whose shape lies in other
    /// files, is read once for their names.
    pub fn know(&mut self, disk: &dyn Disk) {
        let mut asked = BTreeSet::new();
        if FileKind::of(&self.path) == Some(FileKind::Gltf) {
            asked = read_with_names(disk, &self.path).1;
        }
        self.follow(asked, disk);
    }

    /// Looks at the files. True once there is another version, which has stood still: [`read`](Self::read) it then.
    pub fn look(&mut self, disk: &dyn Disk) -> bool {
        self.look_at(disk, Instant::now())
    }

    /// Looks at the files at a time that is not before that of the last look: see [`look`](Self::look).
    pub fn look_at(&mut self, disk: &dyn Disk, now: Instant) -> bool {
        let stamps = stamps(disk, self.stamps.keys());
        if stamps != self.stamps {
            self.stamps = stamps;
            self.next = Some(UnsettledVersion { since: now, contents: None });
            return false;
        }
        let since = |then: Instant| now.saturating_duration_since(then);
        let is_due = match &self.next {
            Some(next) => since(next.since) >= self.settle,
            None => self.read.is_none_or(|read| since(read) >= self.pause),
        };
        // A file that is not there for the moment, as between two steps of a save, is waited for.
        if !is_due || self.stamps.get(&self.path).is_none_or(Option::is_none) {
            return false;
        }
        let start = Instant::now();
        let contents = contents(disk, self.stamps.keys());
        self.read = Some(now);
        self.pause = READ_EVERY.max(start.elapsed() * REST);
        let next = self.next.take();
        if contents == self.known {
            return false;
        }
        if next.is_some_and(|next| next.contents.is_none_or(|seen| seen == contents)) {
            self.known = contents;
            return true;
        }
        self.next = Some(UnsettledVersion { since: now, contents: Some(contents) });
        false
    }

    /// Reads the model as it is. `None` if a file changed meanwhile: the next looks tell when it stands still again.
    ///
    /// # Errors
    /// See [`load_model`].
    pub fn read(&mut self, disk: &dyn Disk) -> Option<Result<Model, LoadError>> {
        let before = stamps(disk, self.stamps.keys());
        let (model, asked) = read_with_names(disk, &self.path);
        self.follow(asked, disk);
        // What is saved while files are read or hashed is another version than the model, whatever was hashed.
        if stamps(disk, before.keys()) != before {
            self.known.clear();
            self.next = Some(UnsettledVersion { since: Instant::now(), contents: None });
            return None;
        }
        Some(model)
    }

    /// Follows the model's own file and those that a reader asked for, as they are now.
    fn follow(&mut self, mut asked: BTreeSet<PathBuf>, disk: &dyn Disk) {
        asked.insert(self.path.clone());
        self.stamps = stamps(disk, asked.iter());
        self.known = contents(disk, asked.iter());
        self.next = None;
        self.read = Some(Instant::now());
    }
}

fn stamps<'p>(disk: &dyn Disk, paths: impl Iterator<Item = &'p PathBuf>) -> BTreeMap<PathBuf, FileStamp> {
    let stamp = |path: &PathBuf| disk.entry(path, true).ok().map(|entry| (entry.len, entry.modified));
    paths.map(|path| (path.clone(), stamp(path))).collect()
}

fn contents<'p>(disk: &dyn Disk, paths: impl Iterator<Item = &'p PathBuf>) -> Contents {
    paths.map(|path| (path.clone(), hash_of(disk, path).ok())).collect()
}

/// Hash of a file's content.
fn hash_of(disk: &dyn Disk, path: &Path) -> io::Result<u64> {
    // Opening a pipe without a writer would wait for ever.
    if disk.entry(path, true)?.kind != EntryKind::File {
        return Err(io::ErrorKind::InvalidInput.into());
    }
    let mut reader = disk.open(path)?;
    let (mut hash, mut block) = (0u64, Vec::new());
    loop {
        block.clear();
        if reader.by_ref().take(BLOCK).read_to_end(&mut block)? == 0 {
            return Ok(hash);
        }
        hash = (hash.rotate_left(5) ^ content_hash(&block)).wrapping_mul(0x9E37_79B9_7F4A_7C15);
    }
}

/// A model, and the files that its reader opened or looked for in vain.
fn read_with_names(disk: &dyn Disk, path: &Path) -> (Result<Model, LoadError>, BTreeSet<PathBuf>) {
    read_noting_files(disk, |disk| load_model(disk, path))
}

/// Result of a reader, and the files that it opened or looked for in vain: its own, and all that those name. The reader cannot
/// write.
pub fn read_noting_files<T>(disk: &dyn Disk, read: impl FnOnce(&dyn Disk) -> T) -> (T, BTreeSet<PathBuf>) {
    let noting = NotingDisk { disk, asked: Mutex::default() };
    let found = read(&noting);
    (found, noting.asked.into_inner().unwrap_or_else(PoisonError::into_inner))
}

/// Disk that takes note of the files that are asked for. It can only be read.
struct NotingDisk<'d> {
    disk: &'d dyn Disk,
    asked: Mutex<BTreeSet<PathBuf>>,
}

impl NotingDisk<'_> {
    fn note(&self, path: &Path) {
        self.asked.lock().unwrap_or_else(PoisonError::into_inner).insert(path.to_owned());
    }
}

impl Disk for NotingDisk<'_> {
    fn entry(&self, path: &Path, follow: bool) -> io::Result<Entry> {
        self.disk.entry(path, follow)
    }

    fn read_link(&self, path: &Path) -> io::Result<PathBuf> {
        self.disk.read_link(path)
    }

    fn canonical(&self, path: &Path) -> io::Result<PathBuf> {
        self.disk.canonical(path).inspect_err(|_| self.note(path))
    }

    fn list(&self, folder: &Path, limit: usize) -> io::Result<Vec<OsString>> {
        self.disk.list(folder, limit)
    }

    fn create(&self, _: &Path) -> io::Result<Box<dyn DiskFile>> {
        Err(io::ErrorKind::ReadOnlyFilesystem.into())
    }

    fn rename(&self, _: &Path, _: &Path) -> io::Result<()> {
        Err(io::ErrorKind::ReadOnlyFilesystem.into())
    }

    fn hard_link(&self, _: &Path, _: &Path) -> io::Result<()> {
        Err(io::ErrorKind::ReadOnlyFilesystem.into())
    }

    fn sync_folder(&self, _: &Path) -> io::Result<()> {
        Err(io::ErrorKind::ReadOnlyFilesystem.into())
    }

    fn remove(&self, _: &Path) -> io::Result<()> {
        Err(io::ErrorKind::ReadOnlyFilesystem.into())
    }

    fn create_folder(&self, _: &Path) -> io::Result<()> {
        Err(io::ErrorKind::ReadOnlyFilesystem.into())
    }

    fn open(&self, path: &Path) -> io::Result<Box<dyn Read + Send>> {
        self.note(path);
        self.disk.open(path)
    }
}
