//! Whole projects: saved, opened, saved on a disk that fails, and opened with another mesh.
#![no_main]

use libfuzzer_sys::fuzz_target;
use rigsmith_fuzz::whole::project::check;

fuzz_target!(|data: &[u8]| check(data));
