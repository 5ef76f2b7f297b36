//! Companions: files that a main file refers to, such as the buffer and the images of a `.gltf`.
//!
//! Names of companions hold the hash of their content (`wood.0123456789abcdef.png`), which makes three things safe: a
//! name never stands for two contents, so that nothing is replaced; a file whose hash fits was written by this program;
//! and a file that refers to a companion can be found by looking for the hash.

use std::{
    collections::BTreeSet,
    io::{self, ErrorKind, Read},
    path::Path,
};

use super::temp::is_temp_name;
use crate::{
    files::disk::{Disk, EntryKind},
    rig::skin::content_hash,
};

/// Digits of a hash in a name.
const DIGITS: usize = 16;
/// Largest number of bytes of a plain name that are kept in a companion's name.
const MAX_STEM: usize = 100;
/// Largest number of names in a folder that are searched; in a larger folder, unused companions stay.
const MAX_NAMES: usize = 20_000;
/// Largest amount of text, in bytes, that is searched for references; beyond it, unused companions stay.
const MAX_TEXT: u64 = 256 << 20;
/// Bytes at the beginning of a file that hold its references where the rest is geometry.
const HEAD: u64 = 1 << 20;

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
fn marks_in(text: &[u8]) -> BTreeSet<Mark> {
    let between_dots = text.split(|byte| *byte == b'.').filter(|part| (DIGITS..DIGITS + 12).contains(&part.len()));
    between_dots.filter_map(|part| parse(std::str::from_utf8(part).ok()?)).collect()
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
    let mut marks = marks_in(&read(disk, main, reach(main).min(MAX_TEXT))?);
    if marks.is_empty() {
        return Ok(Vec::new());
    }
    let names = companions(disk, folder)?;
    for (name, mark) in &names {
        if is_library(name) && marks.contains(mark) {
            marks.extend(marks_in(&read(disk, &folder.join(name), MAX_TEXT)?));
        }
    }
    Ok(names.into_iter().filter(|(_, mark)| marks.contains(mark)).map(|(name, _)| name).collect())
}

/// Removes those of the companions `names` in `folder` that no other file there refers to. A file whose content does
/// not fit the hash in its name was written by another program and stays.
///
/// # Errors
/// When something could not be read or removed: it may be tried again. Nothing is removed before all has been read.
pub(super) fn remove_unmentioned(disk: &dyn Disk, folder: &Path, names: &[String]) -> io::Result<()> {
    let names: Vec<(&str, Mark)> = names.iter().filter_map(|name| Some((name.as_str(), mark_in(name)?))).collect();
    if names.is_empty() {
        return Ok(());
    }
    let listed = disk.list(folder, MAX_NAMES)?;
    if listed.len() == MAX_NAMES {
        return Ok(());
    }
    let mut mentioned = BTreeSet::new();
    let mut left = MAX_TEXT;
    for name in &listed {
        let path = folder.join(name);
        let reach = reach(&path);
        if reach == 0 || is_temp_name(name) || names.iter().any(|(known, _)| name == known) {
            continue;
        }
        let entry = match disk.entry(&path, true) {
            // The entry is a link to nowhere, or was removed in the meantime.
            Err(error) if error.kind() == ErrorKind::NotFound => continue,
            entry => entry?,
        };
        if entry.kind != EntryKind::File {
            continue;
        }
        let Some(rest) = left.checked_sub(entry.len.min(reach)) else { return Ok(()) };
        left = rest;
        mentioned.extend(marks_in(&read(disk, &path, reach)?));
    }
    for (name, mark) in names.iter().filter(|(name, _)| is_library(name)) {
        if mentioned.contains(mark) {
            mentioned.extend(marks_in(&read(disk, &folder.join(name), MAX_TEXT)?));
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

/// The companions in a folder with their marks, by their names alone.
fn companions(disk: &dyn Disk, folder: &Path) -> io::Result<Vec<(String, Mark)>> {
    let names = disk.list(folder, MAX_NAMES)?;
    Ok(names.into_iter().filter_map(|name| Some((name.to_str()?.to_owned(), mark_in(name.to_str()?)?))).collect())
}

fn is_library(name: &str) -> bool {
    name.ends_with(".mtl")
}

/// Bytes at the beginning of a file in which it refers to others, by its ending.
fn reach(path: &Path) -> u64 {
    let ending = path.extension().map(|ending| ending.to_string_lossy().to_ascii_lowercase()).unwrap_or_default();
    match ending.as_str() {
        "bin" | "skin" | "journal" | "png" | "jpg" | "jpeg" | "webp" | "ktx2" | "dds" | "avif" | "f32" => 0,
        "obj" | "glb" => HEAD,
        _ => u64::MAX,
    }
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
        assert_eq!(marks_in(text), BTreeSet::from([(0xAB, 0), (0xAC, 2), (0x0123_4567_89AB_CDEF, 0)]));
    }
}
