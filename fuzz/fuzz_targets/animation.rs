//! Files of clips: no panic, no hang, and what is read is written and read again unchanged.
#![no_main]

use libfuzzer_sys::fuzz_target;
use rigsmith::rig::format::animation::{read_animation, write_named};

fuzz_target!(|data: &[u8]| {
    if let Ok(read) = read_animation(data) {
        let text = write_named(read.rig, &read.rig_name, &read.names, &read.clips);
        let again = read_animation(text.as_bytes()).expect("what was written can be read");
        assert_eq!(again.clips, read.clips);
    }
});
