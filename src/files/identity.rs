//! Identity of files: whether two paths lead to the same file.

use std::path::Path;

use super::{Disk, atomic::folder_of};

/// True if two paths lead to the same file, through links, `.` and `..`, or in another case on file systems that ignore
/// case. Paths of files that do not exist yet count as the same if only the case of their names differs.
pub fn is_same_file(disk: &dyn Disk, a: &Path, b: &Path) -> bool {
    match (disk.canonical(a), disk.canonical(b)) {
        (Ok(a), Ok(b)) if a == b => true,
        // On file systems that ignore case, one file answers to both names, and the folder lists only one of them.
        (Ok(a), Ok(b)) => {
            is_like(disk, &a, &b)
                && disk.list(folder_of(&a), usize::MAX).is_ok_and(|names| {
                    let is_listed = |path: &Path| path.file_name().is_some_and(|name| names.iter().any(|n| n == name));
                    !(is_listed(&a) && is_listed(&b))
                })
        }
        (Err(_), Err(_)) => a == b || is_like(disk, a, b),
        _ => false,
    }
}

/// True if two names in the same folder differ at most in case.
fn is_like(disk: &dyn Disk, a: &Path, b: &Path) -> bool {
    let lower = |path: &Path| path.file_name().map(|name| name.to_string_lossy().to_lowercase());
    let folder = |path: &Path| disk.canonical(folder_of(path)).ok();
    lower(a) == lower(b) && folder(a).is_some() && folder(a) == folder(b)
}
