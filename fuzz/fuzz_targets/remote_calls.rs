//! Remote calls: every body gets an answer, and an error changes nothing.
#![no_main]

use libfuzzer_sys::fuzz_target;
use rigsmith_fuzz::whole::calls::check;

fuzz_target!(|data: &[u8]| check(data));
