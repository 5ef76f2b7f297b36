//! Poses: assignments and switches as text, on built rigs, stored and exported.
#![no_main]

use libfuzzer_sys::fuzz_target;
use rigsmith_fuzz::whole::pose::check;

fuzz_target!(|data: &[u8]| check(data));
