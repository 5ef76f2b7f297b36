//! Telling whether two paths lead to the same file.

use std::path::Path;

use super::{Disk, atomic::folder_of};

/// Tells whether two paths lead to the same file, through links, `.` and `..`, or with another case where the file system
/// takes no notice of it. Two paths at which nothing is yet count as the same if no more than the case of their names differs.
pub fn is_same_file(disk: &dyn Disk, a: &Path, b: &Path) -> bool {
    match (disk.canonical(a), disk.canonical(b)) {
        (Ok(a), Ok(b)) if a == b => true,
        // Where the case does not matter, one file answers to both names and the folder lists one of them.
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

/// True for names in the same folder that differ in nothing but their case.
fn is_like(disk: &dyn Disk, a: &Path, b: &Path) -> bool {
    let lower = |path: &Path| path.file_name().map(|name| name.to_string_lossy().to_lowercase());
    let folder = |path: &Path| disk.canonical(folder_of(path)).ok();
    lower(a) == lower(b) && folder(a).is_some() && folder(a) == folder(b)
}
