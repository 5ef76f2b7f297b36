//! Whole meshes: read, written in every format and read again, and exported with their skeletons.
#![no_main]

use libfuzzer_sys::fuzz_target;
use rigsmith_fuzz::whole::mesh::check;

fuzz_target!(|data: &[u8]| check(data));
