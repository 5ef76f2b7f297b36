//! Whole sketches: gestures on a mesh, bound, exported and undone.
#![no_main]

use libfuzzer_sys::fuzz_target;
use rigsmith_fuzz::whole::gestures::check;

fuzz_target!(|data: &[u8]| check(data));
