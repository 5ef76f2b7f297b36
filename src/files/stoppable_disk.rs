//! A disk whose saves a person can stop: from then on nothing is created or written, so that a save fails before it replaces
//! anything, and clears up.

use std::{
    ffi::OsString,
    io::{self, Read},
    path::{Path, PathBuf},
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
    },
};

use super::disk::{Disk, DiskFile, Entry, Hold};

/// Wish to stop a save, shared between a person and the disk that is written to.
#[derive(Debug, Clone, Default)]
pub struct StopSign(Arc<StopState>);

#[derive(Debug, Default)]
struct StopState {
    is_stopped: AtomicBool,
    has_refused: AtomicBool,
}

impl StopSign {
    /// Has saves stopped from now on.
    pub fn stop(&self) {
        self.0.is_stopped.store(true, Ordering::Relaxed);
    }

    /// True if a file was not created or written because of the wish.
    pub fn has_refused(&self) -> bool {
        self.0.has_refused.load(Ordering::Relaxed)
    }

    fn check(&self) -> io::Result<()> {
        if !self.0.is_stopped.load(Ordering::Relaxed) {
            return Ok(());
        }
        self.0.has_refused.store(true, Ordering::Relaxed);
        Err(io::Error::other("the save was stopped"))
    }
}

/// A disk whose saves stop with a [`StopSign`]. Files are renamed and removed after it, too, so that a save that was stopped
/// leaves what was there before, and one that had replaced the file already is completed.
pub struct StoppableDisk<'d> {
    disk: &'d dyn Disk,
    sign: StopSign,
}

impl<'d> StoppableDisk<'d> {
    /// The disk, until the sign is given.
    pub fn new(disk: &'d dyn Disk, sign: StopSign) -> Self {
        Self { disk, sign }
    }
}

impl Disk for StoppableDisk<'_> {
    fn entry(&self, path: &Path, follow: bool) -> io::Result<Entry> {
        self.disk.entry(path, follow)
    }

    fn read_link(&self, path: &Path) -> io::Result<PathBuf> {
        self.disk.read_link(path)
    }

    fn canonical(&self, path: &Path) -> io::Result<PathBuf> {
        self.disk.canonical(path)
    }

    fn list(&self, folder: &Path, limit: usize) -> io::Result<Vec<OsString>> {
        self.disk.list(folder, limit)
    }

    fn create(&self, path: &Path) -> io::Result<Box<dyn DiskFile>> {
        self.sign.check()?;
        Ok(Box::new(StoppableFile { file: self.disk.create(path)?, sign: self.sign.clone() }))
    }

    fn rename(&self, from: &Path, to: &Path) -> io::Result<()> {
        self.disk.rename(from, to)
    }

    fn hard_link(&self, existing: &Path, path: &Path) -> io::Result<()> {
        self.disk.hard_link(existing, path)
    }

    fn sync_folder(&self, folder: &Path) -> io::Result<()> {
        self.disk.sync_folder(folder)
    }

    fn remove(&self, path: &Path) -> io::Result<()> {
        self.disk.remove(path)
    }

    fn create_folder(&self, path: &Path) -> io::Result<()> {
        self.disk.create_folder(path)
    }

    fn open(&self, path: &Path) -> io::Result<Box<dyn Read + Send>> {
        self.disk.open(path)
    }

    fn is_locked(&self, path: &Path) -> io::Result<bool> {
        self.disk.is_locked(path)
    }

    fn hold(&self, path: &Path) -> io::Result<Option<Hold>> {
        self.disk.hold(path)
    }

    fn lock_folder(&self, folder: &Path) -> io::Result<Option<Hold>> {
        self.disk.lock_folder(folder)
    }
}

/// A file that is written until the sign is given.
struct StoppableFile {
    file: Box<dyn DiskFile>,
    sign: StopSign,
}

impl DiskFile for StoppableFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.sign.check()?;
        self.file.write(bytes)
    }

    fn keep_permissions(&mut self, of: &Path) -> io::Result<()> {
        self.file.keep_permissions(of)
    }

    fn sync(&mut self) -> io::Result<()> {
        self.file.sync()
    }

    fn lock(&mut self) -> io::Result<()> {
        self.file.lock()
    }

    fn reads_back(&mut self, bytes: &[u8]) -> io::Result<bool> {
        self.file.reads_back(bytes)
    }

    fn another(&self) -> io::Result<Box<dyn DiskFile>> {
        Ok(Box::new(Self { file: self.file.another()?, sign: self.sign.clone() }))
    }
}
