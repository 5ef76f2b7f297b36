//! Saves that failed: what is saved is made again only where the save may end in another way.

use std::{
    io::ErrorKind,
    time::{Duration, Instant},
};

use rigsmith::files::{FailedSave, Fault, FaultPlan, FaultyDisk, FileSet, RealDisk, SaveError, save_set};

/// A disk on which nothing succeeds any more.
fn failing(fault: Fault) -> FaultyDisk {
    FaultyDisk::new(RealDisk, Some(FaultPlan { at: 0, fault, lasting: true }))
}

#[test]
fn a_failed_save_is_due_when_its_reason_is_gone_or_another() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.glb");
    let error = SaveError::NoSpace { path: path.clone(), bytes: 100_000, source: ErrorKind::StorageFull.into() };
    let start = Instant::now();
    let at = |milliseconds| start + Duration::from_millis(milliseconds);
    let full = failing(Fault::NoSpace);
    let mut failed = FailedSave::new(&full, &path, &error, at(0));
    let trial = full.operations();
    assert!(trial > 0);
    // A minute of looks: one trial a second.
    for milliseconds in (0..60_000).step_by(10) {
        assert!(!failed.is_due(&full, at(milliseconds)), "{milliseconds}");
    }
    assert!((58..=60).contains(&(full.operations() / trial - 1)), "{} operations", full.operations());
    // Another reason is told once.
    let forbidden = failing(Fault::NoAccess);
    assert!(failed.is_due(&forbidden, at(61_000)));
    assert!(!failed.is_due(&forbidden, at(62_000)));
    // There is room again, and the trial leaves nothing behind.
    assert!(!failed.is_due(&RealDisk, at(62_500)));
    assert!(failed.is_due(&RealDisk, at(63_500)));
    assert_eq!(folder.path().read_dir().unwrap().count(), 0);
}

/// The disk has to have room for all files of a set.
#[test]
fn a_full_disk_is_told_with_the_size_of_the_set() {
    let (main, companion) = (5_000, 100_000);
    let save = |plan| {
        let folder = tempfile::tempdir().unwrap();
        let disk = FaultyDisk::new(RealDisk, plan);
        let mut set = FileSet::new(&folder.path().join("a.gltf"));
        set.add(&disk, "a.bin", vec![7; companion]);
        set.finish(vec![b' '; main]);
        let saved = save_set(&disk, &set);
        (disk.operations(), saved)
    };
    let (operations, saved) = save(None);
    saved.unwrap();
    let fails = |at| save(Some(FaultPlan { at, fault: Fault::NoSpace, lasting: true })).1.err();
    let sizes: Vec<u64> = (0..operations)
        .filter_map(|at| match fails(at) {
            Some(SaveError::NoSpace { bytes, .. }) => Some(bytes),
            _ => None,
        })
        .collect();
    assert!(sizes.contains(&((main + companion) as u64)), "{sizes:?}");
    assert!(!sizes.contains(&(main as u64)) && !sizes.contains(&(companion as u64)), "{sizes:?}");
}
