//! Whole bindings: shapes and joints become weights, skin files and characters, which are read again.
#![no_main]

use libfuzzer_sys::fuzz_target;
use rigsmith_fuzz::whole::skin::check;

fuzz_target!(|data: &[u8]| check(data));
