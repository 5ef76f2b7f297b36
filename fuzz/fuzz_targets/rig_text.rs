//! `.rig` text: no panic, no hang, and what is read is written and read again unchanged.
#![no_main]

use libfuzzer_sys::fuzz_target;
use rigsmith::rig::text::{parse, write};

fuzz_target!(|data: &[u8]| {
    if let Ok(rig) = parse(data) {
        let written = write(&rig).expect("what was read can be written");
        assert_eq!(parse(written.text.as_bytes()).as_ref(), Ok(&rig));
    }
});
