//! Three-way updates: conflicts are told, edits make the update, undo takes it back.
#![no_main]

use libfuzzer_sys::fuzz_target;
use rigsmith_fuzz::whole::update::check;

fuzz_target!(|data: &[u8]| check(data));
