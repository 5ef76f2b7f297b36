//! Saves of sets that a person stops: at whatever point, the old set or the finished one is there.

use std::{
    ffi::OsString,
    fs, io,
    path::{Path, PathBuf},
    sync::atomic::{AtomicUsize, Ordering},
};

use rigsmith::files::{Disk, DiskFile, Entry, RealDisk, StopSign, StoppableDisk};

use super::{Kind, expected, furnished, names};
use crate::disks::as_on_the_disk;

/// A disk at which somebody stops the save while a file is created.
struct StoppingDisk {
    sign: StopSign,
    /// Files that are created before that.
    before: AtomicUsize,
}

impl Disk for StoppingDisk {
    as_on_the_disk!();
    fn create(&self, path: &Path) -> io::Result<Box<dyn DiskFile>> {
        let left = self.before.load(Ordering::Relaxed);
        match left.checked_sub(1) {
            Some(left) => self.before.store(left, Ordering::Relaxed),
            None => self.sign.stop(),
        }
        RealDisk.create(path)
    }
    fn hard_link(&self, existing: &Path, path: &Path) -> io::Result<()> {
        RealDisk.hard_link(existing, path)
    }
}

#[test]
fn a_save_that_is_stopped_leaves_the_old_set() {
    for kind in Kind::ALL {
        let folder = furnished();
        kind.save(&RealDisk, folder.path(), 1).unwrap();
        let before = names(folder.path());
        let mut stopped = 0;
        for created in 0.. {
            let sign = StopSign::default();
            let disk = StoppingDisk { sign: sign.clone(), before: AtomicUsize::new(created) };
            match kind.save(&StoppableDisk::new(&disk, sign.clone()), folder.path(), 2) {
                Ok(()) => break,
                Err(error) => assert!(error.to_string().contains("the save was stopped"), "{kind:?}: {error}"),
            }
            assert!(sign.has_refused(), "{kind:?} after {created} files");
            assert_eq!((kind.load(folder.path()), names(folder.path())), (Ok(1), before.clone()), "{kind:?}");
            stopped += 1;
        }
        assert!(stopped > 0, "{kind:?} is never stopped");
        assert_eq!((kind.load(folder.path()), names(folder.path())), (Ok(2), expected(kind, 2)), "{kind:?}");
    }
}

#[test]
fn a_save_that_was_stopped_before_it_began_writes_nothing() {
    for kind in Kind::ALL {
        let folder = furnished();
        let (before, sign) = (names(folder.path()), StopSign::default());
        sign.stop();
        assert!(!sign.has_refused());
        assert!(kind.save(&StoppableDisk::new(&RealDisk, sign.clone()), folder.path(), 1).is_err(), "{kind:?}");
        assert!(sign.has_refused() && names(folder.path()) == before, "{kind:?}");
        assert!(fs::metadata(kind.main(folder.path())).is_err(), "{kind:?}");
    }
}
