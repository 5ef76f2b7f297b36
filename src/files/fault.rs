//! Disk that fails on purpose. Tests let each operation of a save fail in turn.
//!
//! Run the code once on a [`FaultyDisk`] without a plan, ask it for the number of
//! [`operations`](FaultyDisk::operations), then run it again for each of them with a [`FaultPlan`] that fails just that
//! one.

use std::{
    ffi::OsString,
    io::{self, ErrorKind, Read},
    path::{Path, PathBuf},
    sync::{Arc, Mutex, MutexGuard, PoisonError},
};

use super::disk::{Disk, DiskFile, Entry, Hold};

/// Kinds of failure of an operation.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Fault {
    /// The disk is full. A write still stores half of its bytes.
    NoSpace,
    /// The device reports an error. A write still stores half of its bytes.
    Io,
    /// The operation is not permitted.
    NoAccess,
    /// A write or a read handles only half of its bytes and says so; other operations succeed.
    Short,
    /// The process dies: this and all later operations fail, and the files stay as they are. A write stores half of its
    /// bytes.
    Crash,
    /// The machine dies: as in a `Crash`, and files lose what was written to them since they were last synced.
    PowerLoss,
}

impl Fault {
    /// Every kind of failure, for loops over all of them.
    pub const ALL: [Self; 6] = [Self::NoSpace, Self::Io, Self::NoAccess, Self::Short, Self::Crash, Self::PowerLoss];

    /// True if nothing runs after the fault, so that temporary files may stay behind.
    pub fn is_crash(self) -> bool {
        matches!(self, Self::Crash | Self::PowerLoss)
    }

    fn error(self) -> io::Error {
        match self {
            Self::NoSpace => ErrorKind::StorageFull.into(),
            Self::NoAccess => ErrorKind::PermissionDenied.into(),
            Self::Io | Self::Short => io::Error::other("input/output error"),
            Self::Crash | Self::PowerLoss => io::Error::other("the process is gone"),
        }
    }
}

/// Number of the operation that fails, and the kind of its failure.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct FaultPlan {
    /// Number of the operation, counted from 0.
    pub at: usize,
    /// Kind of failure.
    pub fault: Fault,
    /// True if all later operations fail as well, false if only that one does. Crashes last in any case.
    pub lasting: bool,
}

/// A [`Disk`] that counts operations and fails as planned. Reads and writes of open files count as operations too.
pub struct FaultyDisk {
    inner: Arc<Inner>,
}

struct Inner {
    disk: Box<dyn Disk>,
    plan: Option<FaultPlan>,
    state: Mutex<State>,
}

#[derive(Default)]
struct State {
    log: Vec<&'static str>,
    written: Vec<WrittenFile>,
    lost_power: bool,
}

/// A file that was created on this disk.
struct WrittenFile {
    /// Present path of the file.
    path: PathBuf,
    bytes: u64,
    synced: u64,
}

impl FaultyDisk {
    /// Wraps `disk`. Without a plan nothing fails, and operations are only counted.
    pub fn new(disk: impl Disk + 'static, plan: Option<FaultPlan>) -> Self {
        Self { inner: Arc::new(Inner { disk: Box::new(disk), plan, state: Mutex::default() }) }
    }

    /// Number of operations so far, the failed ones included.
    pub fn operations(&self) -> usize {
        self.inner.state().log.len()
    }

    /// Names of the operations so far, such as `create`, `write`, `rename`.
    pub fn log(&self) -> Vec<&'static str> {
        self.inner.state().log.clone()
    }

    /// True if the planned fault has happened.
    pub fn has_failed(&self) -> bool {
        self.inner.plan.is_some_and(|plan| self.operations() > plan.at)
    }
}

impl Inner {
    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Counts an operation and returns the fault that is planned for it.
    fn step(&self, name: &'static str) -> Option<Fault> {
        let mut state = self.state();
        let number = state.log.len();
        state.log.push(name);
        let plan = self.plan?;
        let lasting = plan.lasting || plan.fault.is_crash();
        (number == plan.at || (lasting && number > plan.at)).then_some(plan.fault)
    }

    /// Drops the bytes that were not synced when the power fails.
    fn settle(&self, fault: Fault) {
        if fault != Fault::PowerLoss {
            return;
        }
        let mut state = self.state();
        if std::mem::replace(&mut state.lost_power, true) {
            return;
        }
        for file in state.written.drain(..).filter(|file| file.synced < file.bytes) {
            let mut kept = Vec::new();
            let read = self.disk.open(&file.path).and_then(|reader| reader.take(file.synced).read_to_end(&mut kept));
            if read.is_ok()
                && self.disk.remove(&file.path).is_ok()
                && let Ok(mut file) = self.disk.create(&file.path)
            {
                let _ = file.write(&kept);
            }
        }
    }

    /// Carries out an operation that moves no bytes, or fails it.
    fn run<T>(&self, name: &'static str, operation: impl FnOnce(&dyn Disk) -> io::Result<T>) -> io::Result<T> {
        match self.step(name) {
            None | Some(Fault::Short) => operation(self.disk.as_ref()),
            Some(fault) => {
                self.settle(fault);
                Err(fault.error())
            }
        }
    }
}

/// Files have no second handle, so that operations come in the same order every time.
impl Disk for FaultyDisk {
    fn entry(&self, path: &Path, follow: bool) -> io::Result<Entry> {
        self.inner.run("entry", |disk| disk.entry(path, follow))
    }

    fn read_link(&self, path: &Path) -> io::Result<PathBuf> {
        self.inner.run("read_link", |disk| disk.read_link(path))
    }

    fn canonical(&self, path: &Path) -> io::Result<PathBuf> {
        self.inner.run("canonical", |disk| disk.canonical(path))
    }

    fn list(&self, folder: &Path, limit: usize) -> io::Result<Vec<OsString>> {
        self.inner.run("list", |disk| disk.list(folder, limit))
    }

    fn create(&self, path: &Path) -> io::Result<Box<dyn DiskFile>> {
        let file = self.inner.run("create", |disk| disk.create(path))?;
        let mut state = self.inner.state();
        let number = state.written.len();
        state.written.push(WrittenFile { path: path.to_path_buf(), bytes: 0, synced: 0 });
        Ok(Box::new(FaultyFile { file, number, inner: Arc::clone(&self.inner) }))
    }

    fn rename(&self, from: &Path, to: &Path) -> io::Result<()> {
        self.inner.run("rename", |disk| disk.rename(from, to))?;
        // Unsynced content stays unsafe under its next name; the file that had that name before is gone.
        for file in &mut self.inner.state().written {
            if file.path == to {
                file.synced = file.bytes;
                file.path = PathBuf::new();
            } else if file.path == from {
                file.path = to.to_path_buf();
            }
        }
        Ok(())
    }

    fn hard_link(&self, existing: &Path, path: &Path) -> io::Result<()> {
        self.inner.run("hard_link", |disk| disk.hard_link(existing, path))
    }

    fn sync_folder(&self, folder: &Path) -> io::Result<()> {
        self.inner.run("sync_folder", |disk| disk.sync_folder(folder))
    }

    fn remove(&self, path: &Path) -> io::Result<()> {
        self.inner.run("remove", |disk| disk.remove(path))
    }

    fn create_folder(&self, path: &Path) -> io::Result<()> {
        self.inner.run("create_folder", |disk| disk.create_folder(path))
    }

    fn open(&self, path: &Path) -> io::Result<Box<dyn Read + Send>> {
        let reader = self.inner.run("open", |disk| disk.open(path))?;
        Ok(Box::new(FaultyReader { reader, inner: Arc::clone(&self.inner) }))
    }

    fn is_locked(&self, path: &Path) -> io::Result<bool> {
        self.inner.run("is_locked", |disk| disk.is_locked(path))
    }

    fn hold(&self, path: &Path) -> io::Result<Option<Hold>> {
        self.inner.run("hold", |disk| disk.hold(path))
    }

    fn lock_folder(&self, folder: &Path) -> io::Result<Option<Hold>> {
        self.inner.run("lock_folder", |disk| disk.lock_folder(folder))
    }
}

struct FaultyFile {
    file: Box<dyn DiskFile>,
    /// Index of the file among the files created on this disk.
    number: usize,
    inner: Arc<Inner>,
}

impl FaultyFile {
    fn write_counted(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let count = self.file.write(bytes)?;
        if let Some(written) = self.inner.state().written.get_mut(self.number) {
            written.bytes += count as u64;
        }
        Ok(count)
    }
}

impl DiskFile for FaultyFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let half = bytes.get(..bytes.len().div_ceil(2)).unwrap_or_default();
        // After a crash no byte reaches the disk; at the crash itself half of the bytes do.
        let crashed =
            self.inner.plan.is_some_and(|plan| plan.fault.is_crash() && self.inner.state().log.len() > plan.at);
        match self.inner.step("write") {
            None => self.write_counted(bytes),
            Some(Fault::Short) => self.write_counted(half),
            Some(fault) => {
                if !crashed && fault != Fault::NoAccess {
                    let _ = self.write_counted(half);
                }
                self.inner.settle(fault);
                Err(fault.error())
            }
        }
    }

    fn keep_permissions(&mut self, of: &Path) -> io::Result<()> {
        match self.inner.step("keep_permissions") {
            None | Some(Fault::Short) => self.file.keep_permissions(of),
            Some(fault) => {
                self.inner.settle(fault);
                Err(fault.error())
            }
        }
    }

    fn sync(&mut self) -> io::Result<()> {
        match self.inner.step("sync") {
            None | Some(Fault::Short) => {
                self.file.sync()?;
                if let Some(written) = self.inner.state().written.get_mut(self.number) {
                    written.synced = written.bytes;
                }
                Ok(())
            }
            Some(fault) => {
                self.inner.settle(fault);
                Err(fault.error())
            }
        }
    }

    fn lock(&mut self) -> io::Result<()> {
        self.file.lock()
    }

    fn reads_back(&mut self, bytes: &[u8]) -> io::Result<bool> {
        match self.inner.step("reads_back") {
            None | Some(Fault::Short) => self.file.reads_back(bytes),
            Some(fault) => {
                self.inner.settle(fault);
                Err(fault.error())
            }
        }
    }
}

struct FaultyReader {
    reader: Box<dyn Read + Send>,
    inner: Arc<Inner>,
}

impl Read for FaultyReader {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        match self.inner.step("read") {
            None => self.reader.read(buffer),
            Some(Fault::Short) => {
                let half = buffer.len().div_ceil(2);
                self.reader.read(buffer.get_mut(..half).unwrap_or_default())
            }
            Some(fault) => {
                self.inner.settle(fault);
                Err(fault.error())
            }
        }
    }
}
