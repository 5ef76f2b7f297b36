//! Whole templates: read, checked, formatted, built forward and back, written in every format and read again.
#![no_main]

use libfuzzer_sys::fuzz_target;
use rigsmith_fuzz::whole::template::check;

fuzz_target!(|data: &[u8]| check(data));
