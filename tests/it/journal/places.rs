//! A disk that fails while a journal looks for its place, goes on with recovered work, or is searched for: nobody's work is
//! taken away.

use std::{collections::BTreeSet, path::PathBuf};

use rigsmith::files::FaultyDisk;

use super::{
    damage::{damaged, records},
    *,
};
use crate::files_faults::plans;

/// Removes a journal that lies in the system's folder for temporary files, which other tests use, too.
fn tidy(path: Option<PathBuf>, folder: &Path) {
    if let Some(path) = path.filter(|path| !path.starts_with(folder)) {
        let _ = fs::remove_file(path);
    }
}

#[test]
fn the_journal_of_another_is_never_replaced_whatever_fails() {
    // Begins a journal beside a project that has one, and works; returns the number of operations.
    let begin = |disk: Arc<FaultyDisk>, is_living: bool| {
        let folder = fresh();
        let project = folder.path().join("hero.rigsmith.ron");
        let places = JournalPlaces { project: Some(project.clone()), ..start(folder.path()).places };
        let opened =
            || JournalStart { places: places.clone(), rig: Some(Rig::new(Uid(1), "")), ..JournalStart::default() };
        let mut other = Desk::new(Arc::new(RealDisk), opened());
        other.place(1);
        let bytes = other.bytes();
        let other = is_living.then_some(other);
        let beside = journal_beside(&project);
        let mut desk = Desk::new(disk.clone(), opened());
        desk.place(2);
        let is_safe = desk.journal.flush(LONG).is_ok();
        let path = desk.journal.path();
        let context = format!("living {is_living}, {path:?}, {:?}", disk.log());
        assert_ne!(path.as_ref(), Some(&beside), "{context}");
        if is_safe {
            assert_eq!(recover_at(path.as_ref().unwrap()).rig, desk.rig, "{context}");
        }
        drop(desk);
        assert!(fs::read(&beside).unwrap() == bytes, "{context}");
        drop(other);
        tidy(path, folder.path());
        disk.operations()
    };
    for is_living in [false, true] {
        let operations = begin(Arc::new(FaultyDisk::new(RealDisk, None)), is_living);
        assert!(operations > 8, "{operations}");
        for plan in plans(operations) {
            begin(Arc::new(FaultyDisk::new(RealDisk, Some(plan))), is_living);
        }
    }
}

/// The rigs that the journals of a folder give back.
fn restored_in(folder: &Path) -> Vec<Rig> {
    let paths = fs::read_dir(folder).into_iter().flatten().map(|entry| entry.unwrap().path());
    let journals = paths.filter(|path| path.extension().is_some_and(|ending| ending == "journal"));
    let read = journals.filter_map(|path| recover(&fs::read(path).unwrap()).ok());
    read.map(|found| found.restore(Basis::Journal, None).replayed.rig).collect()
}

#[test]
fn recovered_work_stays_recoverable_whatever_fails() {
    // Goes on with the work of a dead process; returns the number of operations.
    let resume = |disk: Arc<FaultyDisk>, is_damaged: bool| {
        let folder = fresh();
        let mut desk = Desk::apart(folder.path());
        desk.place(1);
        desk.place(2);
        let mut bytes = desk.bytes();
        let path = desk.journal.path().unwrap();
        drop(desk);
        let mut aside = path.clone().into_os_string();
        aside.push(".damaged");
        fs::write(&aside, b"from before").unwrap();
        if is_damaged {
            let first = records(&bytes).into_iter().find(|record| record.2 == 3).unwrap();
            bytes = damaged(&bytes, first);
            fs::write(&path, &bytes).unwrap();
        }
        let found = recover(&bytes).unwrap();
        let restored = found.restore(Basis::Journal, None);
        let ResumedJournal { journal, .. } =
            Journal::resume(disk.clone(), start(folder.path()).places, &found, &restored, &path);
        let is_safe = journal.flush(LONG).is_ok();
        let at = journal.path();
        drop(journal);
        let context = format!("damaged {is_damaged}, {at:?}, {:?}", disk.log());
        let state = path.parent().unwrap();
        let mut rigs = restored_in(state);
        if let Some(at) = at.as_ref().filter(|at| !at.starts_with(folder.path())) {
            let found = recover(&fs::read(at).unwrap());
            rigs.extend(found.map(|found| found.restore(Basis::Journal, None).replayed.rig));
        }
        assert!(rigs.contains(&restored.replayed.rig), "{context}");
        if is_safe {
            assert_eq!(recover_at(at.as_ref().unwrap()).rig, restored.replayed.rig, "{context}");
        }
        // What is damaged may hold more than could be read today.
        let mut files = fs::read_dir(state).unwrap().map(|entry| fs::read(entry.unwrap().path()).unwrap());
        assert!(!is_damaged || files.any(|file| file == bytes), "{context}");
        assert_eq!(fs::read(&aside).unwrap(), b"from before", "{context}");
        tidy(at, folder.path());
        disk.operations()
    };
    for is_damaged in [false, true] {
        let operations = resume(Arc::new(FaultyDisk::new(RealDisk, None)), is_damaged);
        assert!(operations > 8, "{operations}");
        for plan in plans(operations) {
            resume(Arc::new(FaultyDisk::new(RealDisk, Some(plan))), is_damaged);
        }
    }
}

#[test]
fn a_search_takes_no_work_away_whatever_fails() {
    // Searches a folder with journals of every kind; returns the number of operations.
    let search = |disk: &FaultyDisk, are_all_found: bool| {
        let folder = fresh();
        let state = folder.path().join("state");
        let left = |changes: usize| {
            let mut desk = Desk::apart(folder.path());
            (0..changes).for_each(|number| desk.place(number));
            let bytes = desk.bytes();
            (desk.journal.path().unwrap(), bytes)
        };
        let (unsaved, bytes) = left(2);
        let (broken, whole) = left(3);
        let first = records(&whole).into_iter().find(|record| record.2 == 3).unwrap();
        let broken_bytes = damaged(&whole, first);
        fs::write(&broken, &broken_bytes).unwrap();
        let (unused, _) = left(0);
        let mut living = Desk::apart(folder.path());
        living.flush();
        let offered: BTreeSet<_> = pending_journals(disk, &state).into_iter().map(|pending| pending.path).collect();
        let context = format!("{offered:?}, {:?}", disk.log());
        let work = BTreeSet::from([unsaved.clone(), broken.clone()]);
        assert!(offered == work || !are_all_found, "{context}");
        assert!(fs::read(&unsaved).unwrap() == bytes && fs::read(&broken).unwrap() == broken_bytes, "{context}");
        // Nobody has taken the file away from the one who is about to write to it.
        living.place(1);
        living.flush();
        assert_eq!(recover_at(&living.journal.path().unwrap()).rig, living.rig, "{context}");
        // The next search finds all of it.
        let again: BTreeSet<_> = pending_journals(&RealDisk, &state).into_iter().map(|pending| pending.path).collect();
        assert_eq!(again, work, "{context}");
        assert!(!unused.exists(), "{context}");
        disk.operations()
    };
    let operations = search(&FaultyDisk::new(RealDisk, None), true);
    for plan in plans(operations) {
        search(&FaultyDisk::new(RealDisk, Some(plan)), false);
    }
}

#[test]
fn work_that_another_window_goes_on_with_is_left_to_it() {
    let folder = fresh();
    let mut desk = Desk::apart(folder.path());
    desk.place(1);
    let bytes = desk.bytes();
    let path = desk.journal.path().unwrap();
    let rig = desk.rig.clone();
    drop(desk);
    let found = recover(&bytes).unwrap();
    let restored = found.restore(Basis::Journal, None);
    let resume = || {
        let resumed = Journal::resume(Arc::new(RealDisk), start(folder.path()).places, &found, &restored, &path);
        resumed.journal.flush(LONG).unwrap();
        resumed.journal
    };
    // Both windows were asked about the same file.
    let (first, second) = (resume(), resume());
    assert_eq!(first.path(), Some(path.clone()));
    let elsewhere = second.path().unwrap();
    assert_ne!(elsewhere, path);
    for journal in [&path, &elsewhere] {
        assert_eq!(recover_at(journal).rig, rig, "{}", journal.display());
    }
    second.close(LONG).unwrap();
    drop(first);
    assert_eq!(recover_at(&path).rig, rig);
}
