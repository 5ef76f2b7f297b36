//! References of a project to other files.

use std::path::{Component, Path, PathBuf};

use crate::files::{Disk, atomic::folder_of};

/// Text by which a project refers to a file: relative to the project's folder, with `/` between names, so that both can
/// be moved together; absolute if they have no folder in common.
pub(super) fn reference(disk: &dyn Disk, project: &Path, file: &Path, notes: &mut Vec<String>) -> String {
    let (folder, target) = (whole(folder_of(project)), whole(file));
    let found = if target.starts_with(&folder) {
        relative(&folder, &target)
    } else {
        // A relative path that goes up is only right where links are resolved.
        match (disk.canonical(&folder), disk.canonical(&target)) {
            (Ok(folder), Ok(target)) => relative(&folder, &target),
            _ => relative(&folder, &target),
        }
    };
    let path = found.unwrap_or(target);
    let names = path.components().map(|part| part.as_os_str().to_string_lossy());
    let text = match path.is_relative() {
        true => names.collect::<Vec<_>>().join("/"),
        false => path.to_string_lossy().into_owned(),
    };
    if path.to_str().is_none() {
        notes.push(format!(
            "the name of `{}` is not UTF-8 and cannot be kept exactly; rename that file",
            path.display()
        ));
    }
    text
}

/// Path of a file from a project's reference `text`.
pub(super) fn located(project: &Path, text: &str) -> PathBuf {
    folder_of(project).join(text)
}

/// Path of a file from a project's reference `text`; `None` if the reference, or a link that it names, leads out of the
/// project's folder.
pub(super) fn below(disk: &dyn Disk, project: &Path, text: &str) -> Option<PathBuf> {
    let plain = |part: Component| matches!(part, Component::Normal(_) | Component::CurDir);
    let path = Path::new(text);
    let is_plain = path.file_name().is_some() && path.components().all(plain);
    let path = is_plain.then(|| located(project, text))?;
    match (disk.canonical(folder_of(project)), disk.canonical(&path)) {
        (Ok(folder), Ok(target)) if !target.starts_with(&folder) => None,
        // A file that is not there is told where it is read.
        _ => Some(path),
    }
}

/// True for references that lead further than to folders beside the project's: absolute ones, and those that go up more
/// than once. A project from elsewhere may name any file of the machine by them.
pub(super) fn leads_away(text: &str) -> bool {
    let path = Path::new(text);
    path.is_absolute() || path.components().filter(|part| *part == Component::ParentDir).count() > 1
}

/// An absolute path without `.` and `..`.
fn whole(path: &Path) -> PathBuf {
    let absolute = std::path::absolute(path).unwrap_or_else(|_| path.to_path_buf());
    let mut out = PathBuf::new();
    for part in absolute.components() {
        match part {
            Component::CurDir => {}
            Component::ParentDir => {
                out.pop();
            }
            part => out.push(part),
        }
    }
    out
}

/// Relative path from a folder to a file; `None` if they have no folder in common.
fn relative(folder: &Path, file: &Path) -> Option<PathBuf> {
    let common = folder.components().zip(file.components()).take_while(|(a, b)| a == b);
    let (mut shared, mut named) = (0, false);
    for (part, _) in common {
        shared += 1;
        named |= matches!(part, Component::Normal(_));
    }
    let up = folder.components().skip(shared).map(|_| Component::ParentDir);
    named.then(|| up.chain(file.components().skip(shared)).collect())
}
