//! Companions: files that a main file refers to, such as the buffer and the images of a `.gltf`.
//!
//! Names of companions hold the hash of their content (`wood.0123456789abcdef.png`), which makes three things safe: a
//! name never stands for two contents, so that nothing is replaced; a file whose hash fits was written by this program;
//! and a file that refers to a companion can be found by looking for the hash.

use std::{
    collections::BTreeSet,
    ffi::OsStr,
    io::{self, ErrorKind, Read},
    path::{Path, PathBuf},
};

use super::temp::is_temp_name;
use crate::{
    files::disk::{Disk, EntryKind},
    rig::skin::content_hash,
};

/// Digits of a hash in a name.
const DIGITS: usize = 16;
/// Bytes that no mark has, with its number of a copy.
const MARK: usize = DIGITS + 12;
/// Largest number of bytes of a plain name that are kept in a companion's name.
const MAX_STEM: usize = 100;
/// Largest number of names in a folder that are searched; in a larger folder, unused companions stay.
const MAX_NAMES: usize = 20_000;
/// Largest number of bytes that are searched for references; beyond it, unused companions stay.
const MAX_TEXT: u64 = 512 << 20;
/// Bytes at the beginning of a mesh in which this program writes its references.
const HEAD: u64 = 1 << 20;
/// Bytes that are searched at a time.
const BLOCK: usize = 1 << 16;

/// Name of a companion with the plain name `plain` and this content; `copy` counts the names that other files already
/// have.
pub(super) fn name(plain: &str, hash: u64, copy: u32) -> String {
    let plain = plain.rsplit(['/', '\\']).next().unwrap_or_default();
    let (mut stem, ending) = plain.rsplit_once('.').unwrap_or((plain, "bin"));
    // Hashes of an earlier save are dropped, so that names do not grow each time a model is read and written.
    while let Some((shorter, _)) = stem.rsplit_once('.').filter(|(_, digits)| parse(digits).is_some()) {
        stem = shorter;
    }
    let mut stem: String =
        stem.chars().map(|c| if c.is_alphanumeric() || "-_.".contains(c) { c } else { '_' }).collect();
    while stem.len() > MAX_STEM {
        stem.pop();
    }
    let stem = match stem.trim_start_matches('.') {
        "" => "file",
        stem => stem,
    };
    let ending: String = ending.chars().filter(char::is_ascii_alphanumeric).take(8).collect();
    let ending = if ending.is_empty() { "bin" } else { &ending };
    match copy {
        0 => format!("{stem}.{hash:016x}.{ending}"),
        copy => format!("{stem}.{hash:016x}-{copy}.{ending}"),
    }
}

/// The hash in a companion's name, and the number of the copy, by which references to it are known.
pub(super) type Mark = (u64, u32);

/// The mark in a companion's name; `None` for other names.
pub(super) fn mark_in(name: &str) -> Option<Mark> {
    let (rest, ending) = name.rsplit_once('.')?;
    let (stem, digits) = rest.rsplit_once('.')?;
    let is_plain = !stem.is_empty() && !ending.is_empty() && !name.contains(['/', '\\']);
    if is_plain { parse(digits) } else { None }
}

/// A hash in 16 hexadecimal digits, with or without the number of a copy after them.
fn parse(text: &str) -> Option<Mark> {
    let (digits, copy) = text.split_at_checked(DIGITS)?;
    let is_hash = digits.bytes().all(|b| b.is_ascii_digit() || (b'a'..=b'f').contains(&b));
    let copy = if copy.is_empty() { 0 } else { copy.strip_prefix('-')?.parse().ok()? };
    is_hash.then(|| u64::from_str_radix(digits, 16).ok()).flatten().map(|hash| (hash, copy))
}

/// The marks of companions that a text refers to.
fn marks_in(text: &[u8]) -> impl Iterator<Item = Mark> {
    let between_dots = text.split(|byte| *byte == b'.').filter(|part| (DIGITS..MARK).contains(&part.len()));
    between_dots.filter_map(|part| parse(std::str::from_utf8(part).ok()?))
}

/// The marks of companions to which the first `limit` bytes of a file refer, read in blocks.
fn marks_of(disk: &dyn Disk, path: &Path, limit: u64) -> io::Result<BTreeSet<Mark>> {
    let mut reader = disk.open(path)?.take(limit);
    let (mut marks, mut text) = (BTreeSet::new(), Vec::with_capacity(BLOCK + MARK));
    loop {
        let count = reader.by_ref().take(BLOCK as u64).read_to_end(&mut text)?;
        if count == 0 {
            marks.extend(marks_in(&text));
            return Ok(marks);
        }
        // What follows the last dot may go on in the next block, unless it is longer than any mark already.
        if let Some(dot) = text.iter().rposition(|byte| *byte == b'.') {
            marks.extend(marks_in(&text[..dot]));
            text.drain(..=dot);
        }
        text.truncate(MARK);
    }
}

/// Tells whether a regular file at `path` has this content; `None` if nothing is there.
pub(super) fn holds(disk: &dyn Disk, path: &Path, bytes: &[u8]) -> io::Result<Option<bool>> {
    let entry = match disk.entry(path, false) {
        Err(error) if error.kind() == ErrorKind::NotFound => return Ok(None),
        entry => entry?,
    };
    if entry.kind != EntryKind::File || entry.len != bytes.len() as u64 {
        return Ok(Some(false));
    }
    let mut reader = disk.open(path)?.take(entry.len + 1);
    let (mut rest, mut block) = (bytes, vec![0; (1 << 16).min(bytes.len() + 1)]);
    loop {
        let count = match reader.read(&mut block) {
            Ok(0) => return Ok(Some(rest.is_empty())),
            Ok(count) => count,
            Err(error) if error.kind() == ErrorKind::Interrupted => continue,
            Err(error) => return Err(error),
        };
        match rest.split_at_checked(count) {
            Some((read, more)) if block.starts_with(read) => rest = more,
            _ => return Ok(Some(false)),
        }
    }
}

/// Companions in `folder` that the main file `main` refers to, itself or through a material library.
pub(super) fn referred(disk: &dyn Disk, folder: &Path, main: &Path) -> io::Result<Vec<String>> {
    let reach = if is_mesh(main) { HEAD } else { MAX_TEXT };
    let mut marks = marks_of(disk, main, reach)?;
    if marks.is_empty() {
        return Ok(Vec::new());
    }
    let names = companions(disk, folder)?;
    for (name, mark) in &names {
        if is_library(name) && marks.contains(mark) {
            marks.extend(marks_of(disk, &folder.join(name), MAX_TEXT)?);
        }
    }
    Ok(names.into_iter().filter(|(_, mark)| marks.contains(mark)).map(|(name, _)| name).collect())
}

/// Removes those of the companions `names` in `folder` that no other file refers to: none in the folder, and no model,
/// rig or project in the folders right below it or in the one above. A file whose content does not fit the hash in its
/// name was written by another program and stays. All stay where there is more to search than the limits allow.
///
/// # Errors
/// When something could not be read or removed: it may be tried again. Nothing is removed before all has been read.
pub(super) fn remove_unmentioned(disk: &dyn Disk, folder: &Path, names: &[String]) -> io::Result<()> {
    let names: Vec<(&str, Mark)> = names.iter().filter_map(|name| Some((name.as_str(), mark_in(name)?))).collect();
    if names.is_empty() {
        return Ok(());
    }
    let mut search = Search { disk, mentioned: BTreeSet::new(), names_left: MAX_NAMES, bytes_left: MAX_TEXT };
    let is_removed = |name: &OsStr| names.iter().any(|(known, _)| name == *known);
    let Some(below) = search.folder(folder, |name| may_refer(Path::new(name)) && !is_removed(name))? else {
        return Ok(());
    };
    let above = disk.canonical(folder)?.parent().map(Path::to_path_buf);
    for other in below.into_iter().chain(above) {
        match search.folder(&other, |name| is_naming(Path::new(name))) {
            Ok(Some(_)) => {}
            Ok(None) => return Ok(()),
            // Nobody works in a folder that may not be listed, or that is gone.
            Err(error) if matches!(error.kind(), ErrorKind::NotFound | ErrorKind::PermissionDenied) => {}
            Err(error) => return Err(error),
        }
    }
    let mut mentioned = search.mentioned;
    for (name, mark) in names.iter().filter(|(name, _)| is_library(name)) {
        if mentioned.contains(mark) {
            mentioned.extend(marks_of(disk, &folder.join(name), MAX_TEXT)?);
        }
    }
    for (name, mark) in names.into_iter().filter(|(_, mark)| !mentioned.contains(mark)) {
        let path = folder.join(name);
        let is_ours = match disk.entry(&path, false) {
            Err(error) if error.kind() == ErrorKind::NotFound => continue,
            entry => entry?.kind == EntryKind::File && content_hash(&read(disk, &path, u64::MAX)?) == mark.0,
        };
        if is_ours {
            disk.remove(&path)?;
        }
    }
    Ok(())
}

/// A search for marks through the files of folders.
struct Search<'d> {
    disk: &'d dyn Disk,
    mentioned: BTreeSet<Mark>,
    names_left: usize,
    bytes_left: u64,
}

impl Search<'_> {
    /// Searches the files of a folder whose names are `wanted`, and returns the folders among them; `None` if there is more
    /// to search than the limits allow.
    fn folder(&mut self, folder: &Path, wanted: impl Fn(&OsStr) -> bool) -> io::Result<Option<Vec<PathBuf>>> {
        let listed = self.disk.list(folder, self.names_left)?;
        self.names_left -= listed.len();
        if self.names_left == 0 {
            return Ok(None);
        }
        let mut below = Vec::new();
        for name in listed.iter().filter(|name| wanted(name) && !is_temp_name(name)) {
            let path = folder.join(name);
            let entry = match self.disk.entry(&path, true) {
                // The entry is a link to nowhere, or was removed in the meantime.
                Err(error) if error.kind() == ErrorKind::NotFound => continue,
                entry => entry?,
            };
            match entry.kind {
                EntryKind::Folder => below.push(path),
                EntryKind::File => {
                    let Some(left) = self.bytes_left.checked_sub(entry.len) else { return Ok(None) };
                    self.bytes_left = left;
                    // A file that grows meanwhile is read as far as it was counted.
                    match marks_of(self.disk, &path, entry.len) {
                        Err(error) if error.kind() == ErrorKind::NotFound => {}
                        marks => self.mentioned.extend(marks?),
                    }
                }
                _ => {}
            }
        }
        Ok(Some(below))
    }
}

/// The companions in a folder with their marks, by their names alone.
fn companions(disk: &dyn Disk, folder: &Path) -> io::Result<Vec<(String, Mark)>> {
    let names = disk.list(folder, MAX_NAMES)?;
    Ok(names.into_iter().filter_map(|name| Some((name.to_str()?.to_owned(), mark_in(name.to_str()?)?))).collect())
}

fn is_library(name: &str) -> bool {
    name.ends_with(".mtl")
}

fn ending(path: &Path) -> String {
    path.extension().map(|ending| ending.to_string_lossy().to_ascii_lowercase()).unwrap_or_default()
}

/// True for meshes, which are geometry for the most part.
fn is_mesh(path: &Path) -> bool {
    matches!(ending(path).as_str(), "obj" | "glb" | "vrm")
}

/// True for files that may refer to others: all but those that hold nothing but pixels or numbers.
fn may_refer(path: &Path) -> bool {
    let ending = ending(path);
    !matches!(ending.as_str(), "bin" | "skin" | "png" | "jpg" | "jpeg" | "webp" | "ktx2" | "dds" | "avif" | "f32")
}

/// True for files that refer to others as a rule: models, rigs, projects and scenes.
fn is_naming(path: &Path) -> bool {
    let ending = ending(path);
    let others = matches!(ending.as_str(), "blend" | "dae" | "fbx" | "usd" | "usda" | "json");
    others || is_mesh(path) || matches!(ending.as_str(), "gltf" | "mtl" | "ron" | "rig")
}

fn read(disk: &dyn Disk, path: &Path, limit: u64) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    disk.open(path)?.take(limit).read_to_end(&mut bytes)?;
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_readable_and_safe() {
        let check = |plain: &str, expected: &str| {
            let name = name(plain, 0xAB, 0);
            assert_eq!(name, expected);
            assert_eq!(mark_in(&name), Some((0xAB, 0)), "{name}");
        };
        check("wood.png", "wood.00000000000000ab.png");
        check("my textures/old wood.v2.PNG", "old_wood.v2.00000000000000ab.PNG");
        check("wood.0123456789abcdef.png", "wood.00000000000000ab.png");
        check("wood.0123456789abcdef-2.png", "wood.00000000000000ab.png");
        check("..\\..\\etc", "etc.00000000000000ab.bin");
        check("", "file.00000000000000ab.bin");
        check("...", "file.00000000000000ab.bin");
        check("Bär:#\n.mtl", "Bär___.00000000000000ab.mtl");
        assert!(name(&format!("{}.png", "ä".repeat(200)), 1, 0).len() < 130);
        assert_eq!(mark_in(&name("a.bin", 7, 3)), Some((7, 3)));
        for other in [
            "wood.png",
            "0123456789abcdef.png",
            "a.0123456789abcdeg.png",
            "a.0123456789ABCDEF.png",
            "a/b.0123456789abcdef.c",
        ] {
            assert_eq!(mark_in(other), None, "{other}");
        }
        let text =
            br#"{"uri":"my%20wood.00000000000000ab.png"},{"uri":"x.00000000000000ac-2.bin"} 1.5.0123456789abcdef"#;
        assert_eq!(
            marks_in(text).collect::<BTreeSet<_>>(),
            BTreeSet::from([(0xAB, 0), (0xAC, 2), (0x0123_4567_89AB_CDEF, 0)])
        );
    }
}
