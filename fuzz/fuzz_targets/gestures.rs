//! Lists of gestures: no panic, no hang.
#![no_main]

use libfuzzer_sys::fuzz_target;
use rigsmith::plugins::gesture::read_gestures;

fuzz_target!(|data: &[u8]| {
    let _ = read_gestures(data);
});
