//! Packed clips: no panic, no hang, and what is read is written and read again unchanged.
#![no_main]

use libfuzzer_sys::fuzz_target;
use rigsmith::solve::packed_clip::PackedSkeleton;

fuzz_target!(|data: &[u8]| {
    if let Ok(read) = PackedSkeleton::from_bytes(data) {
        let again = PackedSkeleton::from_bytes(&read.to_bytes()).expect("what was written can be read");
        assert_eq!(again, read);
        drop(read.animation("fuzz"));
    }
});
