//! Sequences of edits: each build is that from nothing, and all of it is undone to the first bytes.
#![no_main]

use libfuzzer_sys::fuzz_target;
use rigsmith_fuzz::whole::edits::check;

fuzz_target!(|data: &[u8]| check(data));
