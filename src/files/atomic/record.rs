//! Record of a set that is being saved: its companions, which may be left over if the process dies.
//!
//! The anchor of a set's save lists the companions that are about to be put in place and those that the former main
//! file refers to. A later save that finds the record of a dead process removes the companions that no file refers to,
//! without knowing how far the save got.

use std::{
    io::{self, ErrorKind, Read},
    path::Path,
};

use crate::files::disk::Disk;

const HEADER: &str = "rigsmith set 1\n";
/// Largest size in bytes of a record that is read.
const MAX_BYTES: u64 = 16 << 20;

/// The content of a record.
pub(super) fn text<'a>(names: impl Iterator<Item = &'a str>) -> Vec<u8> {
    let mut text = HEADER.to_owned();
    for name in names {
        text.push_str(name);
        text.push('\n');
    }
    text.into_bytes()
}

/// Companions that the record in an anchor file lists; empty if the anchor does not belong to a set.
pub(super) fn read(disk: &dyn Disk, anchor: &Path) -> io::Result<Vec<String>> {
    let mut reader = match disk.open(anchor) {
        Err(error) if error.kind() == ErrorKind::NotFound => return Ok(Vec::new()),
        opened => opened?,
    };
    let mut bytes = Vec::new();
    reader.by_ref().take(HEADER.len() as u64).read_to_end(&mut bytes)?;
    if bytes != HEADER.as_bytes() {
        return Ok(Vec::new());
    }
    bytes.clear();
    reader.take(MAX_BYTES).read_to_end(&mut bytes)?;
    // A record that was cut off while it was written belongs to a save that has put no file in place.
    Ok(String::from_utf8_lossy(&bytes).lines().map(str::to_owned).collect())
}
