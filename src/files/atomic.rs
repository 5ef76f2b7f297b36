//! Atomic saving: a file is always whole, the old one until the finished one replaces it in a single rename.
//!
//! The order is the one that survives power loss: temporary file beside the target, write, sync, read back, rename,
//! sync the folder. Files that belong together are a [`FileSet`]: every companion has a name with the hash of its
//! content and is in place before the main file is renamed, so that the main file on the disk only ever refers to whole
//! companions.

mod companion;
mod error;
mod record;
mod set;
mod staging;
mod target;
mod temp;

pub use error::{SaveError, SaveStep};
pub use set::{FileSet, save_set};
pub use staging::{StagedFile, check_place, stage_file};
pub use temp::{is_temp_name, remove_stale_temps};

pub(super) use target::{linked_file, saved_file};
pub(super) use temp::temp_name;

use std::path::Path;

use super::disk::Disk;

/// Saves `bytes` as the file `path`. Afterwards the file holds its former content or all of `bytes`, at whatever point
/// the save fails.
///
/// An existing file keeps its permissions (and owner, as far as allowed); a symbolic link stays a link, and the file it
/// leads to is replaced; other hard links keep the former content. The folder must exist. On failure the temporary file
/// is removed; files that dead processes left in the folder are removed, too. Returns after the device has confirmed
/// the content, so a call costs a few milliseconds and up; writes `bytes` once.
///
/// # Errors
/// See [`SaveError`]; the only one after which `path` holds `bytes` is [`SaveError::Unconfirmed`].
pub fn save_atomic(disk: &dyn Disk, path: &Path, bytes: &[u8]) -> Result<(), SaveError> {
    stage_file(disk, path, bytes)?.put_in_place()
}

/// The folder of a path; `.` for a bare name.
pub(super) fn folder_of(path: &Path) -> &Path {
    match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    }
}
