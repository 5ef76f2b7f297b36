//! References of a project to other files.

use std::path::{Component, Path, PathBuf};

use crate::files::{Disk, EntryKind, SearchPaths, atomic::folder_of};

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
/// project's folder. If the project's file is a link, its files lie beside the file that it leads to.
pub(super) fn below(disk: &dyn Disk, project: &Path, text: &str) -> Option<PathBuf> {
    let is_link = disk.entry(project, false).is_ok_and(|entry| entry.kind == EntryKind::Link);
    let linked = is_link.then(|| disk.canonical(project).ok()).flatten();
    let is_there = |path: &PathBuf| disk.entry(path, true).is_ok();
    let beside_linked = linked.and_then(|file| below_folder_of(disk, &file, text)).filter(is_there);
    beside_linked.or_else(|| below_folder_of(disk, project, text))
}

/// Path of a file from a reference `text` of the project in that very folder.
fn below_folder_of(disk: &dyn Disk, project: &Path, text: &str) -> Option<PathBuf> {
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

/// Place of a file that a project refers to. A project from elsewhere may name any file of the machine, so only files below
/// its folder are opened.
pub(super) enum Place {
    /// Below the project's folder.
    Inside(PathBuf),
    /// Outside of the folder, with a file of that name in it, which stands in.
    Beside(PathBuf),
    /// Outside of the folder.
    Outside(PathBuf),
}

/// Place of the file to which the reference `text` of a project leads.
pub(super) fn place(disk: &dyn Disk, project: &Path, text: &str) -> Place {
    if let Some(path) = below(disk, project, text) {
        return Place::Inside(path);
    }
    let is_file = |path: &PathBuf| disk.entry(path, true).is_ok_and(|entry| entry.kind == EntryKind::File);
    let name = Path::new(text).file_name().and_then(|name| name.to_str());
    match name.and_then(|name| below(disk, project, name)).filter(is_file) {
        Some(path) => Place::Beside(path),
        None => Place::Outside(located(project, text)),
    }
}

/// True for a file in one of the folders of templates that the person or the site has named.
pub(super) fn is_of_site(disk: &dyn Disk, path: &Path) -> bool {
    let Ok(target) = disk.canonical(path) else { return false };
    let site = SearchPaths::of_site().unwrap_or_default();
    site.folders.iter().any(|folder| disk.canonical(folder).is_ok_and(|folder| target.starts_with(folder)))
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
