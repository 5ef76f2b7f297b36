//! Journals: no panic, no hang, and what is recovered can be replayed.
#![no_main]

use libfuzzer_sys::fuzz_target;
use rigsmith::files::journal::{Basis, recover};

fuzz_target!(|data: &[u8]| {
    if let Ok(recovered) = recover(data) {
        drop(recovered.restore(Basis::Journal, None));
    }
});
