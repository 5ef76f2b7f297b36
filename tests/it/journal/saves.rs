//! Journals around saves: crashes at any moment, projects that others changed, and work that nobody has any more.

use super::*;

/// Copies files, as a crash would leave them.
fn crash_copy(from: &Path, to: &Path) {
    for entry in fs::read_dir(from).unwrap() {
        let entry = entry.unwrap();
        if entry.file_type().unwrap().is_file() {
            fs::copy(entry.path(), to.join(entry.file_name())).unwrap();
        }
    }
}

#[test]
fn a_crash_at_any_moment_of_a_save_recovers_the_same_document() {
    for moment in [Moment::Before, Moment::Noted, Moment::InPlace, Moment::Rotated] {
        for (undone, meanwhile, later) in [(0, 0, 0), (0, 0, 2), (1, 0, 1), (2, 1, 0), (0, 1, 3)] {
            let context = format!("{moment:?}, {undone} undone, {meanwhile} meanwhile, {later} later");
            let folder = fresh();
            let project = folder.path().join("hero.rigsmith.ron");
            let mut desk = Desk::apart(folder.path());
            for number in 0..3 {
                desk.place(number);
            }
            for _ in 0..undone {
                desk.undo();
            }
            // The first save moves the journal beside the project; the second is the one that is cut short.
            desk.save(&project, Moment::Rotated);
            assert_eq!(desk.journal.path(), Some(journal_beside(&project)), "{context}");
            for _ in 0..undone {
                desk.redo();
            }
            for number in 0..meanwhile {
                desk.place(10 + number);
            }
            for _ in 0..undone {
                desk.undo();
            }
            desk.save(&project, moment);
            for number in 0..later {
                desk.place(20 + number);
            }
            if later > 2 {
                // Back past the save, to steps that the journal does not have any more.
                for _ in 0..5 {
                    desk.undo();
                }
                desk.redo();
            }
            desk.flush();
            let path = desk.journal.path().unwrap();
            let recovered = recover(&fs::read(&path).unwrap()).unwrap();
            assert_eq!(recovered.project(), Some(project.as_path()), "{context}");
            assert!(matches!(recovered.basis(hash_at), Basis::Project { .. }), "{context}");
            let back = replayed(&recovered);
            assert_eq!(back.rig, desk.rig, "{context}");
            assert!(!folder.path().join("state").read_dir().unwrap().any(|_| true), "{context}");

            // As left behind: offered if something is not saved, else gone.
            let left = fresh();
            crash_copy(folder.path(), left.path());
            let pending = pending_journals(&RealDisk, left.path());
            let unsaved = recovered.changes().len()
                - match recovered.basis(hash_at) {
                    Basis::Project { contained } => contained,
                    _ => 0,
                };
            assert_eq!(
                pending.iter().map(|p| p.changes).collect::<Vec<_>>(),
                if unsaved > 0 { vec![unsaved] } else { vec![] },
                "{context}"
            );
            assert_eq!(left.path().join("hero.rigsmith.journal").exists(), unsaved > 0, "{context}");
        }
    }
}

#[test]
fn a_project_that_someone_else_changed_is_told() {
    let folder = fresh();
    let project = folder.path().join("hero.rigsmith.ron");
    let mut desk = Desk::apart(folder.path());
    desk.save(&project, Moment::Rotated);
    desk.place(1);
    desk.flush();
    let left = fresh();
    crash_copy(folder.path(), left.path());
    fs::write(&project, write_template(&Rig::new(Uid(42), "renamed"))).unwrap();
    let pending = pending_journals(&RealDisk, left.path());
    assert!(pending.len() == 1 && pending[0].project_changed && pending[0].changes == 1, "{pending:?}");
    let recovered = recover(&fs::read(&pending[0].path).unwrap()).unwrap();
    assert_eq!(recovered.basis(hash_at), Basis::Changed);
    assert_eq!(replayed(&recovered).rig.len(), 1);
    // Edits that make no sense on what is there now end the replay, and say why.
    let mut desk = Desk::apart(folder.path());
    desk.place(1);
    let joint = desk.rig.roots()[0];
    desk.save(&project, Moment::Rotated);
    desk.edit(RigEdit::SetLabel(joint, Some("left".into())));
    desk.place(2);
    let recovered = recover(&desk.bytes()).unwrap();
    let back = recovered.replay(Basis::Changed, Some(Rig::new(Uid(42), "empty")));
    assert_eq!(back.applied, 0);
    assert!(back.refused.is_some_and(|reason| reason.to_string().contains("no joint")));
}

#[test]
fn only_work_that_nobody_has_any_more_is_offered() {
    let folder = fresh();
    let state = folder.path().join("state");
    let offered = || pending_journals(&RealDisk, &state).len();
    let mut desk = Desk::apart(folder.path());
    desk.flush();
    desk.place(1);
    desk.flush();
    let path = desk.journal.path().unwrap();
    assert_eq!(offered(), 0, "its process lives");
    drop(desk);
    assert_eq!(offered(), 1);
    let pending = pending_journal(&RealDisk, &path).unwrap();
    assert_eq!((pending.changes, pending.ending, &pending.origin), (1, Ending::Open, &Origin::Empty));
    assert!(pending.modified.is_some() && pending.started > 1_600_000_000);
    assert_eq!(pending.condition, Condition::Whole);
    // Neither of these is a journal.
    fs::write(state.join("notes.journal"), fs::read(&path).unwrap()).unwrap();
    fs::create_dir(state.join("x.rigsmith.journal")).unwrap();
    assert_eq!(offered(), 1);
    // One without changes is litter.
    let idle = Desk::apart(folder.path());
    idle.flush();
    let litter = idle.journal.path().unwrap();
    assert!(litter.exists());
    drop(idle);
    assert_eq!(offered(), 1);
    assert!(!litter.exists());
    // A clean end leaves nothing, and drops what comes after it.
    let mut closed = Desk::apart(folder.path());
    closed.place(1);
    closed.flush();
    let gone = closed.journal.path().unwrap();
    closed.journal.close(LONG).unwrap();
    assert!(!gone.exists());
    closed.place(2);
    closed.journal.close(LONG).unwrap();
    assert!(closed.journal.flush(LONG).is_err());
    drop(closed);
    assert_eq!(offered(), 1);
    assert!(pending_journals(&RealDisk, &folder.path().join("nowhere")).is_empty());
}

/// The folder for temporary files, where journals may be, has as many names of others as there are.
#[test]
fn a_crowded_folder_hides_no_work() {
    let folder = fresh();
    let mut desk = Desk::apart(folder.path());
    desk.place(1);
    desk.flush();
    let path = desk.journal.path().unwrap();
    drop(desk);
    let state = path.parent().unwrap();
    (0..10_050).for_each(|number| fs::write(state.join(format!("a{number:05}")), b"").unwrap());
    assert_eq!(
        pending_journals(&RealDisk, state).into_iter().map(|pending| pending.path).collect::<Vec<_>>(),
        std::slice::from_ref(&path)
    );
}

#[test]
fn recovered_work_is_safe_from_the_next_crash() {
    for beside in [false, true] {
        let folder = fresh();
        let project = folder.path().join("hero.rigsmith.ron");
        let mut desk = Desk::apart(folder.path());
        if beside {
            desk.save(&project, Moment::Rotated);
        }
        desk.place(1);
        desk.place(2);
        desk.undo();
        desk.flush();
        let (mut path, mut rig, mut places) =
            (desk.journal.path().unwrap(), desk.rig.clone(), start(folder.path()).places);
        places.project = beside.then(|| project.clone());
        drop(desk);
        for round in 0..3 {
            assert!(pending_journal(&RealDisk, &path).is_some(), "{beside} {round}");
            let recovered = recover(&fs::read(&path).unwrap()).unwrap();
            let back = replayed(&recovered);
            assert_eq!(back.rig, rig, "{beside} {round}");
            let basis = recovered.basis(hash_at);
            let held = |path| read_template(&fs::read(path).unwrap()).unwrap().rig;
            let held = if basis == Basis::Journal { None } else { recovered.project().map(held) };
            let restored = recovered.restore(basis, held);
            let ResumedJournal { journal, kept } =
                Journal::resume(Arc::new(RealDisk), places.clone(), &recovered, &restored, &path);
            assert_eq!(kept, None, "{beside} {round}");
            assert_eq!(journal.position(), recovered.changes().len() as u64, "{beside} {round}");
            let mut desk = Desk {
                rig: back.rig.clone(),
                selection: default(),
                history: RigHistory::restored(&back.stacks),
                journal,
                uids: UidSource::seeded(100 + round),
            };
            desk.redo();
            desk.place(5);
            desk.undo();
            desk.flush();
            assert_eq!(desk.journal.path().as_ref(), Some(&path), "{beside} {round}");
            let others = fs::read_dir(path.parent().unwrap()).unwrap().count();
            assert_eq!(others, if beside { 3 } else { 1 }, "{beside} {round}");
            rig = desk.rig.clone();
            if round == 1 {
                // Where a save was cut short just before the journal would start again.
                desk.save(&project, Moment::InPlace);
                desk.place(9);
                rig = desk.rig.clone();
            }
            path = desk.journal.path().unwrap();
        }
    }
}
