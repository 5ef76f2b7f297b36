//! OBJ: no panic, no hang, and the same arrays for every block size.
#![no_main]

use libfuzzer_sys::fuzz_target;
use rigsmith::mesh::obj::{ObjArrays, ObjSettings, read_obj};

fuzz_target!(|data: &[u8]| {
    let mut whole = ObjArrays::default();
    let outcome = read_obj(data, &mut whole, &ObjSettings { threads: 1, ..ObjSettings::default() });
    // Small blocks put their borders into every kind of line.
    let mut split = ObjArrays::default();
    let settings = ObjSettings { threads: 2, block_bytes: 64 };
    let outcome_split = read_obj(data, &mut split, &settings);
    assert_eq!(outcome.is_ok(), outcome_split.is_ok());
    assert_eq!(whole.corners, split.corners);
    assert!(whole.positions.iter().flatten().all(|value| value.is_finite()));
    assert!(whole.corners.iter().all(|&corner| (corner as usize) < whole.positions.len()));
});
