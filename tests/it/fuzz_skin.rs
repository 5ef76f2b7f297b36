//! Fuzzing of the `.skin` reader, behind its checksum and before it: no panic, no hang, and whatever it accepts writes itself
//! again.

use std::cell::Cell;

use rigsmith::rig::skin::SkinFile;

use crate::{
    mutate::run_fuzz,
    skin_file::{sample, sealed},
};

/// Reads hostile bytes: an error, or a skin that writes itself to the same bytes. Returns whether it was read.
fn survives(bytes: &[u8]) -> bool {
    let read = SkinFile::read(bytes);
    if let Ok(skin) = &read {
        assert_eq!(skin.write(), bytes, "what reads must write itself again");
    }
    read.is_ok()
}

#[test]
fn no_bytes_break_the_reader() {
    let seeds = [sample(true).write(), sample(false).write()];
    let (read, refused) = (Cell::new(0), Cell::new(0));
    run_fuzz("skin", &seeds, &[b"RIGSKIN\0"], |bytes| {
        survives(bytes);
        if bytes.len() >= 64 {
            // With magic, length and checksum put right, what lies behind them is read.
            let mut bytes = bytes.to_vec();
            bytes[..8].copy_from_slice(b"RIGSKIN\0");
            let count = if survives(&sealed(bytes)) { &read } else { &refused };
            count.set(count.get() + 1);
        }
    });
    assert!(read.get() > 100 && refused.get() > 100, "{} are read, {} refused", read.get(), refused.get());
}
