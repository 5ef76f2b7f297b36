//! Projects: no panic, no hang, and what is read is written and read again unchanged.
#![no_main]

use libfuzzer_sys::fuzz_target;
use rigsmith::rig::project::{read_project, write_project};

fuzz_target!(|data: &[u8]| {
    if let Ok(read) = read_project(data) {
        let text = write_project(&read.project);
        let again = read_project(text.as_bytes()).expect("what was written can be read");
        assert_eq!(again.project, read.project);
    }
});
