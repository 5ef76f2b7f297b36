//! Primitive operations for saving and reading files, and the real file system that carries them out.

use std::{
    ffi::OsString,
    fs, io,
    path::{Path, PathBuf},
    time::SystemTime,
};

/// Bytes that are read back at a time.
const BLOCK: usize = 1 << 16;
/// Number of names of a folder that are held before those beyond the limit are dropped.
const LISTED: usize = 1 << 16;

/// Number of attempts to lock a folder, and the pause between them: 30 seconds in all.
#[cfg(unix)]
const FOLDER_ATTEMPTS: usize = 3000;
#[cfg(unix)]
const FOLDER_PAUSE: std::time::Duration = std::time::Duration::from_millis(10);

/// Kind of the entry at a path.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum EntryKind {
    /// A regular file.
    File,
    /// A folder.
    Folder,
    /// A symbolic link; only when links are not followed.
    Link,
    /// A device, a pipe or a socket.
    Other,
}

/// Properties of the entry at a path.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Entry {
    /// File, folder, link or something else.
    pub kind: EntryKind,
    /// Length in bytes as claimed; it may change, or lie, by the time the file is read.
    pub len: u64,
    /// True if the entry is write-protected.
    pub read_only: bool,
    /// Time of the last change, where the file system keeps one.
    pub modified: Option<SystemTime>,
}

/// A file that is being written.
pub trait DiskFile: Send {
    /// Writes some of `bytes` and returns how many, like [`io::Write::write`].
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize>;

    /// Takes over the permissions, and where possible the owner, of the existing file `of`.
    fn keep_permissions(&mut self, of: &Path) -> io::Result<()>;

    /// Returns once everything written has reached the device.
    fn sync(&mut self) -> io::Result<()>;

    /// Marks the file as in use until it is closed, for [`Disk::is_locked`]; does nothing where files cannot be locked.
    fn lock(&mut self) -> io::Result<()> {
        Ok(())
    }

    /// True if the disk returns exactly `bytes` for the whole file, or if the file cannot be read through this handle.
    fn reads_back(&mut self, bytes: &[u8]) -> io::Result<bool> {
        let _ = bytes;
        Ok(true)
    }

    /// Another handle of the same file, which can sync it while this one goes on writing; an error if the disk offers
    /// none.
    fn another(&self) -> io::Result<Box<dyn DiskFile>> {
        Err(io::ErrorKind::Unsupported.into())
    }
}

/// A lock that lasts until it is dropped.
pub type Hold = Box<dyn Send>;

/// The operations on files that Rigsmith uses. Each call may fail on its own; none is assumed to be atomic but
/// `rename`.
pub trait Disk: Send + Sync {
    /// Describes what is at `path`; symbolic links are followed if `follow` is set.
    fn entry(&self, path: &Path, follow: bool) -> io::Result<Entry>;

    /// Returns the target of the symbolic link at `path`, as stored.
    fn read_link(&self, path: &Path) -> io::Result<PathBuf>;

    /// Returns the absolute path with every link resolved; the path must exist.
    fn canonical(&self, path: &Path) -> io::Result<PathBuf>;

    /// Lists the names in `folder`, sorted; stops after `limit` of them.
    fn list(&self, folder: &Path, limit: usize) -> io::Result<Vec<OsString>>;

    /// Creates a file that must not exist yet and opens it for writing.
    fn create(&self, path: &Path) -> io::Result<Box<dyn DiskFile>>;

    /// Renames a file within its folder in one step, replacing what is at `to`.
    fn rename(&self, from: &Path, to: &Path) -> io::Result<()>;

    /// Gives the file at `existing` the further name `path`, which must not exist yet.
    fn hard_link(&self, existing: &Path, path: &Path) -> io::Result<()>;

    /// Returns once the names in `folder` have reached the device; does nothing where folders cannot be synced.
    fn sync_folder(&self, folder: &Path) -> io::Result<()>;

    /// Removes a file.
    fn remove(&self, path: &Path) -> io::Result<()>;

    /// Creates a folder and the missing ones above it.
    fn create_folder(&self, path: &Path) -> io::Result<()>;

    /// Opens a file for reading.
    fn open(&self, path: &Path) -> io::Result<Box<dyn io::Read + Send>>;

    /// True if a living process has [locked](DiskFile::lock) the file at `path`.
    fn is_locked(&self, path: &Path) -> io::Result<bool> {
        self.entry(path, true).map(|_| false)
    }

    /// Keeps the file at `path` from being [locked](DiskFile::lock) while left-over files of dead processes are
    /// removed; `None` while a living process has it locked, [`Unsupported`](io::ErrorKind::Unsupported) where files
    /// cannot be locked.
    fn hold(&self, path: &Path) -> io::Result<Option<Hold>> {
        let _ = path;
        Err(io::ErrorKind::Unsupported.into())
    }

    /// Waits until no other save that changes companions runs in `folder`, then keeps other saves waiting; `None` where
    /// folders cannot be locked.
    ///
    /// # Errors
    /// [`WouldBlock`](io::ErrorKind::WouldBlock) if the wait takes longer than any save does.
    fn lock_folder(&self, folder: &Path) -> io::Result<Option<Hold>> {
        let _ = folder;
        Ok(None)
    }
}

/// The file system of this machine.
#[derive(Debug, Clone, Copy, Default)]
pub struct RealDisk;

impl Disk for RealDisk {
    fn entry(&self, path: &Path, follow: bool) -> io::Result<Entry> {
        let facts = if follow { fs::metadata(path)? } else { fs::symlink_metadata(path)? };
        let kind = match facts.file_type() {
            t if t.is_symlink() => EntryKind::Link,
            t if t.is_dir() => EntryKind::Folder,
            t if t.is_file() => EntryKind::File,
            _ => EntryKind::Other,
        };
        Ok(Entry { kind, len: facts.len(), read_only: facts.permissions().readonly(), modified: facts.modified().ok() })
    }

    fn read_link(&self, path: &Path) -> io::Result<PathBuf> {
        fs::read_link(path)
    }

    fn canonical(&self, path: &Path) -> io::Result<PathBuf> {
        fs::canonicalize(path)
    }

    fn list(&self, folder: &Path, limit: usize) -> io::Result<Vec<OsString>> {
        // File systems list names in any order, so which ones are the first is known only when all have been listed.
        let mut names = Vec::new();
        for entry in fs::read_dir(folder)? {
            names.push(entry?.file_name());
            if names.len() >= limit.saturating_add(LISTED) {
                names.sort();
                names.truncate(limit);
            }
        }
        names.sort();
        names.truncate(limit);
        Ok(names)
    }

    fn create(&self, path: &Path) -> io::Result<Box<dyn DiskFile>> {
        let file = fs::OpenOptions::new().read(true).write(true).create_new(true).open(path)?;
        Ok(Box::new(RealFile(file)))
    }

    fn rename(&self, from: &Path, to: &Path) -> io::Result<()> {
        // On Windows a virus scanner or an indexer holds a fresh file open for a moment, and renaming is refused
        // meanwhile.
        let mut attempts = if cfg!(windows) { 20 } else { 1 };
        loop {
            attempts -= 1;
            match fs::rename(from, to) {
                Err(error) if attempts > 0 && error.kind() == io::ErrorKind::PermissionDenied => {
                    std::thread::sleep(std::time::Duration::from_millis(25));
                }
                result => return result,
            }
        }
    }

    fn hard_link(&self, existing: &Path, path: &Path) -> io::Result<()> {
        fs::hard_link(existing, path)
    }

    #[cfg(unix)]
    fn sync_folder(&self, folder: &Path) -> io::Result<()> {
        use io::ErrorKind::{InvalidInput, PermissionDenied, Unsupported};
        // A folder that may be written but not listed cannot be opened, and some network file systems cannot sync one.
        let handle = match fs::File::open(folder) {
            Err(error) if error.kind() == PermissionDenied => return Ok(()),
            opened => opened?,
        };
        match handle.sync_all() {
            Err(error) if matches!(error.kind(), InvalidInput | Unsupported) => Ok(()),
            result => result,
        }
    }

    #[cfg(not(unix))]
    fn sync_folder(&self, _folder: &Path) -> io::Result<()> {
        Ok(())
    }

    fn remove(&self, path: &Path) -> io::Result<()> {
        fs::remove_file(path)
    }

    fn create_folder(&self, path: &Path) -> io::Result<()> {
        fs::create_dir_all(path)
    }

    fn open(&self, path: &Path) -> io::Result<Box<dyn io::Read + Send>> {
        Ok(Box::new(fs::File::open(path)?))
    }

    fn is_locked(&self, path: &Path) -> io::Result<bool> {
        // On file systems without locks, a file counts as unlocked.
        Ok(matches!(fs::File::open(path)?.try_lock_shared(), Err(fs::TryLockError::WouldBlock)))
    }

    fn hold(&self, path: &Path) -> io::Result<Option<Hold>> {
        let file = fs::File::open(path)?;
        match file.try_lock_shared() {
            Ok(()) => Ok(Some(Box::new(file))),
            Err(fs::TryLockError::WouldBlock) => Ok(None),
            Err(fs::TryLockError::Error(_)) => Err(io::ErrorKind::Unsupported.into()),
        }
    }

    #[cfg(unix)]
    fn lock_folder(&self, folder: &Path) -> io::Result<Option<Hold>> {
        let folder = fs::File::open(folder)?;
        for _ in 0..FOLDER_ATTEMPTS {
            match folder.try_lock() {
                Ok(()) => return Ok(Some(Box::new(folder))),
                Err(fs::TryLockError::WouldBlock) => std::thread::sleep(FOLDER_PAUSE),
                Err(fs::TryLockError::Error(_)) => return Ok(None),
            }
        }
        Err(io::ErrorKind::WouldBlock.into())
    }
}

struct RealFile(fs::File);

impl DiskFile for RealFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        io::Write::write(&mut self.0, bytes)
    }

    fn keep_permissions(&mut self, of: &Path) -> io::Result<()> {
        let wanted = fs::metadata(of)?;
        let found = self.0.metadata()?;
        #[cfg(unix)]
        {
            use std::os::unix::fs::{MetadataExt, fchown};
            // Only the administrator may change a file's owner; other users keep at least the group, if that is
            // allowed.
            let (uid, gid) = (wanted.uid(), wanted.gid());
            if (uid, gid) != (found.uid(), found.gid()) && fchown(&self.0, Some(uid), Some(gid)).is_err() {
                let _ = fchown(&self.0, None, Some(gid));
            }
        }
        // Mounts may refuse every change of permissions, even to the present ones.
        if wanted.permissions() == found.permissions() {
            return Ok(());
        }
        self.0.set_permissions(wanted.permissions())
    }

    fn sync(&mut self) -> io::Result<()> {
        self.0.sync_all()
    }

    fn lock(&mut self) -> io::Result<()> {
        match self.0.try_lock() {
            Err(fs::TryLockError::WouldBlock) => Err(io::ErrorKind::WouldBlock.into()),
            // On file systems without locks, the file stays unlocked.
            Ok(()) | Err(fs::TryLockError::Error(_)) => Ok(()),
        }
    }

    fn reads_back(&mut self, mut bytes: &[u8]) -> io::Result<bool> {
        io::Seek::rewind(&mut self.0)?;
        let mut block = vec![0; BLOCK.min(bytes.len() + 1)];
        loop {
            let count = match io::Read::read(&mut self.0, &mut block) {
                Ok(0) => return Ok(bytes.is_empty()),
                Ok(count) => count,
                Err(error) if error.kind() == io::ErrorKind::Interrupted => continue,
                Err(error) => return Err(error),
            };
            match bytes.split_at_checked(count) {
                Some((read, rest)) if block.starts_with(read) => bytes = rest,
                _ => return Ok(false),
            }
        }
    }

    fn another(&self) -> io::Result<Box<dyn DiskFile>> {
        Ok(Box::new(Self(self.0.try_clone()?)))
    }
}
