//! BVH: no panic, no hang, and whole frames of finite values.
#![no_main]

use libfuzzer_sys::fuzz_target;
use rigsmith::rig::format::bvh::read_bvh;

fuzz_target!(|data: &[u8]| {
    if let Ok(motion) = read_bvh(data, "fuzz") {
        assert_eq!(motion.values.len(), motion.frames() * motion.width());
        assert!(motion.values.iter().all(|value| value.is_finite()));
    }
});
