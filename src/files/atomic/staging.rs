//! Files that are written whole beside their places and wait there, so that nothing is put in place before all is written.

use std::path::Path;

use super::{
    SaveError,
    target::Target,
    temp::{Temp, remove_stale_temps},
};
use crate::files::disk::Disk;

/// A file that is written whole beside its place, and waits for being put there; dropped before, it leaves nothing behind.
pub struct StagedFile<'d> {
    disk: &'d dyn Disk,
    target: Target,
    temp: Temp<'d>,
    len: usize,
}

impl StagedFile<'_> {
    /// Path of the file, as the caller gave it.
    pub fn path(&self) -> &Path {
        &self.target.path
    }

    /// Puts the file in its place, in one rename, and waits until the device has confirmed that.
    ///
    /// # Errors
    /// See [`SaveError`]; the only one after which the file is in place is [`SaveError::Unconfirmed`].
    pub fn put_in_place(self) -> Result<(), SaveError> {
        let Self { disk, target, temp, len } = self;
        target.replace(temp, len)?;
        target.confirm(disk)
    }
}

/// Writes `bytes` for the file `path` as [`save_atomic`](super::save_atomic) does, but for the rename. All outputs of a command
/// are staged before the first is put in place, so that one that cannot be written leaves none behind.
///
/// # Errors
/// See [`SaveError`].
pub fn stage_file<'d>(disk: &'d dyn Disk, path: &Path, bytes: &[u8]) -> Result<StagedFile<'d>, SaveError> {
    let target = Target::find(disk, path)?;
    // Left-over temporary files that cannot be removed are no reason not to save.
    let _ = remove_stale_temps(disk, &target.folder);
    let temp = target.stage(disk, bytes)?;
    Ok(StagedFile { disk, target, temp, len: bytes.len() })
}

/// Checks whether a file can be saved at `path`, as far as its content does not matter. An empty temporary file is created in
/// its folder and removed.
///
/// # Errors
/// The [`SaveError`] of a save.
pub fn check_place(disk: &dyn Disk, path: &Path) -> Result<(), SaveError> {
    Target::find(disk, path)?.check_folder(disk)
}
