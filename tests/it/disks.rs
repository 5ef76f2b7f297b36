//! Methods of disks that tests put in the place of the real one. Call them where `Disk` is implemented, with what it names
//! in scope.

/// Questions about files and folders, as the real disk answers them.
macro_rules! entries_of_the_disk {
    () => {
        fn entry(&self, path: &Path, follow: bool) -> io::Result<Entry> {
            RealDisk.entry(path, follow)
        }
        fn read_link(&self, path: &Path) -> io::Result<PathBuf> {
            RealDisk.read_link(path)
        }
        fn canonical(&self, path: &Path) -> io::Result<PathBuf> {
            RealDisk.canonical(path)
        }
        fn list(&self, folder: &Path, limit: usize) -> io::Result<Vec<OsString>> {
            RealDisk.list(folder, limit)
        }
    };
}

/// Methods that change something, of a disk on which nothing is changed.
macro_rules! no_changes {
    () => {
        fn create(&self, _: &Path) -> io::Result<Box<dyn DiskFile>> {
            unreachable!()
        }
        fn rename(&self, _: &Path, _: &Path) -> io::Result<()> {
            unreachable!()
        }
        fn hard_link(&self, _: &Path, _: &Path) -> io::Result<()> {
            unreachable!()
        }
        fn sync_folder(&self, _: &Path) -> io::Result<()> {
            unreachable!()
        }
        fn remove(&self, _: &Path) -> io::Result<()> {
            unreachable!()
        }
        fn create_folder(&self, _: &Path) -> io::Result<()> {
            unreachable!()
        }
    };
}

/// Methods that change something, or ask for more than content, of a disk that is only read.
macro_rules! only_read {
    () => {
        fn read_link(&self, _: &Path) -> io::Result<PathBuf> {
            unreachable!()
        }
        fn canonical(&self, _: &Path) -> io::Result<PathBuf> {
            unreachable!()
        }
        $crate::disks::no_changes!();
    };
}

/// All methods but `create` and `hard_link`, as the real disk has them.
macro_rules! as_on_the_disk {
    () => {
        $crate::disks::entries_of_the_disk!();
        fn rename(&self, from: &Path, to: &Path) -> io::Result<()> {
            RealDisk.rename(from, to)
        }
        fn sync_folder(&self, folder: &Path) -> io::Result<()> {
            RealDisk.sync_folder(folder)
        }
        fn remove(&self, path: &Path) -> io::Result<()> {
            RealDisk.remove(path)
        }
        fn create_folder(&self, path: &Path) -> io::Result<()> {
            RealDisk.create_folder(path)
        }
        fn open(&self, path: &Path) -> io::Result<Box<dyn io::Read + Send>> {
            RealDisk.open(path)
        }
    };
}

pub(crate) use {as_on_the_disk, entries_of_the_disk, no_changes, only_read};
