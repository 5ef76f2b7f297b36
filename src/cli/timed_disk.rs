//! A disk that is read until the time of the command is over: folders may have any number of files.

use std::{
    ffi::OsString,
    io::{self, ErrorKind, Read},
    path::{Path, PathBuf},
};

use super::limits::check_time;
use crate::files::{Disk, DiskFile, Entry, RealDisk};

/// The disk of this machine, from which nothing is read once the time of the command is over. It can only be read.
pub(super) struct TimedDisk;

impl TimedDisk {
    fn check() -> io::Result<()> {
        check_time("reading the folders").map_err(|_| ErrorKind::TimedOut.into())
    }
}

impl Disk for TimedDisk {
    fn entry(&self, path: &Path, follow: bool) -> io::Result<Entry> {
        Self::check()?;
        RealDisk.entry(path, follow)
    }

    fn read_link(&self, path: &Path) -> io::Result<PathBuf> {
        RealDisk.read_link(path)
    }

    fn canonical(&self, path: &Path) -> io::Result<PathBuf> {
        RealDisk.canonical(path)
    }

    fn list(&self, folder: &Path, limit: usize) -> io::Result<Vec<OsString>> {
        Self::check()?;
        RealDisk.list(folder, limit)
    }

    fn create(&self, _: &Path) -> io::Result<Box<dyn DiskFile>> {
        Err(ErrorKind::ReadOnlyFilesystem.into())
    }

    fn rename(&self, _: &Path, _: &Path) -> io::Result<()> {
        Err(ErrorKind::ReadOnlyFilesystem.into())
    }

    fn hard_link(&self, _: &Path, _: &Path) -> io::Result<()> {
        Err(ErrorKind::ReadOnlyFilesystem.into())
    }

    fn sync_folder(&self, _: &Path) -> io::Result<()> {
        Err(ErrorKind::ReadOnlyFilesystem.into())
    }

    fn remove(&self, _: &Path) -> io::Result<()> {
        Err(ErrorKind::ReadOnlyFilesystem.into())
    }

    fn create_folder(&self, _: &Path) -> io::Result<()> {
        Err(ErrorKind::ReadOnlyFilesystem.into())
    }

    fn open(&self, path: &Path) -> io::Result<Box<dyn Read + Send>> {
        Self::check()?;
        RealDisk.open(path)
    }
}
