//! Journals of long work: what is held in memory and in the file stays bounded, and everything comes back.

use rigsmith::files::journal::MOST_CHANGES;

use super::*;

/// A rig with a joint for each of a few numbers.
fn joints() -> Rig {
    let mut rig = Rig::new(Uid(42), "long");
    let mut uids = UidSource::seeded(3);
    for number in 0..12 {
        Operation::Place { position: Vec3::splat(number as f32), parent: None }.run(&mut rig, &mut uids, None).unwrap();
    }
    rig
}

/// Names the joints, one after the other.
fn work(desk: &mut Desk, edits: std::ops::Range<usize>) {
    let joints = desk.rig.roots().to_vec();
    for number in edits {
        desk.edit(RigEdit::SetLabel(joints[number % joints.len()], Some(format!("n{number}"))));
        if number % 1000 == 0 {
            // The thread may lag behind.
            desk.flush();
            assert!(desk.journal.held() <= MOST_CHANGES, "{} changes are held after {number}", desk.journal.held());
        }
    }
    desk.flush();
    assert!(desk.journal.held() <= MOST_CHANGES, "{} changes are held", desk.journal.held());
}

/// Fails unless a journal brings back the rig, and the steps of the history.
fn check(desk: &mut Desk) {
    let back = recover_at(&desk.journal.path().unwrap());
    assert_eq!((&back.rig, &back.selection), (&desk.rig, &Some(desk.selection.0.clone())));
    let mut history = RigHistory::restored(&back.stacks);
    let (mut rig, mut selection) = (back.rig.clone(), Selection(back.selection.unwrap()));
    for step in 0..rigsmith::plugins::history::MOST_STEPS {
        let undone =
            history.undo(&mut rig, &mut selection).unwrap_or_else(|| panic!("step {step} from the end is lost"));
        let here = desk.history.undo(&mut desk.rig, &mut desk.selection).unwrap();
        assert_eq!(undone.unwrap(), here.unwrap());
    }
    assert_eq!(rig, desk.rig);
}

#[test]
fn a_hundred_thousand_edits_take_no_more_memory_than_some() {
    let folder = fresh();
    let mut desk = Desk::new(Arc::new(RealDisk), JournalStart { rig: Some(joints()), ..start(folder.path()) });
    work(&mut desk, 0..20_000);
    let some = fs::metadata(desk.journal.path().unwrap()).unwrap().len();
    work(&mut desk, 20_000..100_000);
    assert_eq!(desk.journal.position(), 100_000);
    let all = fs::metadata(desk.journal.path().unwrap()).unwrap().len();
    assert!(all < some * 3 / 2, "{all} bytes after all edits, {some} after a fifth of them");
    check(&mut desk);
}

#[test]
fn undo_and_redo_of_older_steps_survive_a_fold() {
    let folder = fresh();
    let mut desk = Desk::new(Arc::new(RealDisk), JournalStart { rig: Some(joints()), ..start(folder.path()) });
    work(&mut desk, 0..MOST_CHANGES - 5);
    for _ in 0..9 {
        desk.undo();
    }
    for _ in 0..4 {
        desk.redo();
    }
    work(&mut desk, MOST_CHANGES..MOST_CHANGES + 40);
    assert!(desk.journal.held() < MOST_CHANGES / 2 + 100, "{} changes are held", desk.journal.held());
    check(&mut desk);
}

/// The document comes back whether a save was finished, begun, or did not happen since the journal began anew.
#[test]
fn saves_of_long_work_lose_nothing() {
    for moment in [Moment::Before, Moment::Noted, Moment::InPlace, Moment::Rotated] {
        let folder = fresh();
        let project = folder.path().join("hero.rigsmith.ron");
        let mut desk = Desk::new(Arc::new(RealDisk), JournalStart { rig: Some(joints()), ..start(folder.path()) });
        work(&mut desk, 0..30);
        desk.save(&project, Moment::Rotated);
        // The rig before the first change is that of the project now, which the journal does not hold.
        work(&mut desk, 30..MOST_CHANGES + 200);
        assert!(desk.journal.held() < MOST_CHANGES, "{moment:?}: {} changes are held", desk.journal.held());
        let recovered = recover(&desk.bytes()).unwrap();
        assert_eq!(recovered.basis(hash_at), Basis::Journal, "{moment:?}");
        desk.save(&project, moment);
        work(&mut desk, 0..10);
        let recovered = recover(&desk.bytes()).unwrap();
        let is_saved = matches!(recovered.basis(hash_at), Basis::Project { .. });
        assert_eq!(is_saved, moment >= Moment::InPlace, "{moment:?}");
        assert_eq!(replayed(&recovered).rig, desk.rig, "{moment:?}");
    }
}

/// A journal that goes on with recovered work folds as well.
#[test]
fn recovered_work_goes_on_within_the_same_bounds() {
    let folder = fresh();
    let project = folder.path().join("hero.rigsmith.ron");
    let text = write_template(&joints());
    fs::write(&project, &text).unwrap();
    let origin = Origin::Project { path: project.clone(), hash: file_hash(text.as_bytes()) };
    let begin = JournalStart { origin, saved_rig: Some(joints()), ..start(folder.path()) };
    let places = begin.places.clone();
    let mut desk = Desk::new(Arc::new(RealDisk), begin);
    desk.rig = joints();
    work(&mut desk, 0..500);
    let old = desk.journal.path().unwrap();
    let recovered = recover(&desk.bytes()).unwrap();
    let restored = recovered.restore(recovered.basis(hash_at), Some(joints()));
    assert_eq!(restored.replayed.rig, desk.rig);
    let Desk { rig, selection, history, uids, journal } = desk;
    drop(journal);
    let ResumedJournal { journal, kept } = Journal::resume(Arc::new(RealDisk), places, &recovered, &restored, &old);
    assert_eq!(kept, None);
    let mut desk = Desk { rig, selection, history, uids, journal };
    work(&mut desk, 500..MOST_CHANGES + 500);
    assert_eq!(recover_at(&desk.journal.path().unwrap()).rig, desk.rig);
    assert!(desk.journal.held() < MOST_CHANGES, "{} changes are held", desk.journal.held());
}
