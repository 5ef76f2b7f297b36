//! Sets of files on disks that lack hard links, return other bytes than were written, or have other saves at the same time.

use std::{
    ffi::OsString,
    fs, io,
    path::{Path, PathBuf},
    sync::atomic::{AtomicBool, Ordering},
};

use rigsmith::files::{Disk, DiskFile, Entry, Hold, RealDisk, remove_stale_temps};

use super::{Kind, expected, furnished, names};
use crate::disks::as_on_the_disk;

/// A disk that carries out nothing as the real one does unless it is passed on here.
struct PassThroughDisk {
    hard_links: bool,
    /// True if what is read back has changed on the way.
    decays: bool,
}

struct DecayingFile(Box<dyn DiskFile>);

impl DiskFile for DecayingFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let mut bytes = bytes.to_vec();
        bytes.iter_mut().skip(17).take(1).for_each(|byte| *byte ^= 1);
        self.0.write(&bytes)
    }
    fn keep_permissions(&mut self, of: &Path) -> io::Result<()> {
        self.0.keep_permissions(of)
    }
    fn sync(&mut self) -> io::Result<()> {
        self.0.sync()
    }
    fn reads_back(&mut self, bytes: &[u8]) -> io::Result<bool> {
        self.0.reads_back(bytes)
    }
}

impl Disk for PassThroughDisk {
    as_on_the_disk!();
    fn create(&self, path: &Path) -> io::Result<Box<dyn DiskFile>> {
        let file = RealDisk.create(path)?;
        Ok(if self.decays { Box::new(DecayingFile(file)) } else { file })
    }
    fn hard_link(&self, existing: &Path, path: &Path) -> io::Result<()> {
        if self.hard_links { RealDisk.hard_link(existing, path) } else { Err(io::ErrorKind::Unsupported.into()) }
    }
}

#[test]
fn a_set_is_saved_where_there_are_neither_hard_links_nor_locks() {
    for kind in Kind::ALL {
        let folder = furnished();
        for version in [1, 2, 5] {
            kind.save(&PassThroughDisk { hard_links: false, decays: false }, folder.path(), version).unwrap();
            assert_eq!(kind.load(folder.path()), Ok(version));
            assert_eq!(names(folder.path()), expected(kind, version));
        }
        // A temporary file of today may be that of a living process.
        let temp = folder.path().join(".rigsmith-0123456700000000.tmp");
        fs::write(&temp, "half").unwrap();
        let disk = PassThroughDisk { hard_links: false, decays: false };
        assert_eq!(remove_stale_temps(&disk, folder.path()).unwrap(), 0);
        let long_ago = std::time::SystemTime::now() - std::time::Duration::from_secs(4000);
        fs::File::options().write(true).open(&temp).unwrap().set_modified(long_ago).unwrap();
        assert_eq!(remove_stale_temps(&disk, folder.path()).unwrap(), 1);
    }
}

#[test]
fn a_disk_that_returns_other_bytes_replaces_nothing() {
    for kind in Kind::ALL {
        let folder = furnished();
        kind.save(&RealDisk, folder.path(), 1).unwrap();
        let before = names(folder.path());
        let error =
            kind.save(&PassThroughDisk { hard_links: true, decays: true }, folder.path(), 2).unwrap_err().to_string();
        assert!(error.contains("other bytes") && error.contains("unchanged"), "{error}");
        assert_eq!((kind.load(folder.path()), names(folder.path())), (Ok(1), before));
    }
}

/// A disk on which another save of the same set, the first one, has its turn while a save waits for its own.
struct CrowdedDisk<'f> {
    kind: Kind,
    folder: &'f Path,
    is_first: AtomicBool,
}

impl Disk for CrowdedDisk<'_> {
    as_on_the_disk!();
    fn create(&self, path: &Path) -> io::Result<Box<dyn DiskFile>> {
        RealDisk.create(path)
    }
    fn hard_link(&self, existing: &Path, path: &Path) -> io::Result<()> {
        RealDisk.hard_link(existing, path)
    }
    fn lock_folder(&self, folder: &Path) -> io::Result<Option<Hold>> {
        if self.is_first.swap(false, Ordering::Relaxed) {
            self.kind.save(&RealDisk, self.folder, 1).unwrap();
        }
        RealDisk.lock_folder(folder)
    }
}

/// A main file that came while the save waited is replaced as any other: what it alone names goes with it.
#[test]
fn a_set_that_another_save_made_meanwhile_leaves_nothing() {
    for kind in Kind::ALL {
        let folder = furnished();
        let disk = CrowdedDisk { kind, folder: folder.path(), is_first: AtomicBool::new(true) };
        kind.save(&disk, folder.path(), 2).unwrap();
        assert!(!disk.is_first.load(Ordering::Relaxed), "{kind:?} takes turns");
        assert_eq!((kind.load(folder.path()), names(folder.path())), (Ok(2), expected(kind, 2)), "{kind:?}");
    }
}
