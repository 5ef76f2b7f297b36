//! Whole clips: on a rig, in files, sampled, baked, exported and imported.
#![no_main]

use libfuzzer_sys::fuzz_target;
use rigsmith_fuzz::whole::clip::check;

fuzz_target!(|data: &[u8]| check(data));
