//! Writes to entities of an app: the world says what the document says.
#![no_main]

use libfuzzer_sys::fuzz_target;
use rigsmith_fuzz::whole::entities::check;

fuzz_target!(|data: &[u8]| check(data));
