//! Templates: no panic, no hang, and the header reads whenever the whole does.
#![no_main]

use libfuzzer_sys::fuzz_target;
use rigsmith::rig::template::{read_header, read_template};

fuzz_target!(|data: &[u8]| {
    let header = read_header(data);
    if read_template(data).is_ok() {
        assert!(header.is_ok());
    }
});
