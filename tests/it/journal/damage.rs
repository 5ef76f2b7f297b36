//! Damaged journals: whatever happened to the file, every sound record comes back, what is lost is told, and the file stays.

use rigsmith::files::journal::{
    Condition, Damage, Gap, PendingJournal, RecordCount, RecordKind, ResumedJournal, SkipReason,
};

use super::*;

pub const PRELUDE: usize = 20;
const HEAD: usize = 13;
const TAIL: usize = 8;

/// Where each record of a sound journal begins and ends, and its kind.
pub fn records(bytes: &[u8]) -> Vec<(usize, usize, u8)> {
    let (mut at, mut records) = (PRELUDE, Vec::new());
    while at < bytes.len() {
        let length = u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap()) as usize;
        let end = at + HEAD + length + TAIL;
        records.push((at, end, bytes[at + 4]));
        at = end;
    }
    records
}

pub fn flipped(bytes: &[u8], at: usize) -> Vec<u8> {
    let mut flipped = bytes.to_vec();
    flipped[at] ^= 1 << (at % 8);
    flipped
}

pub fn damaged(bytes: &[u8], record: (usize, usize, u8)) -> Vec<u8> {
    let payload = record.1 - record.0 - HEAD - TAIL;
    assert!(payload > 0);
    flipped(bytes, record.0 + HEAD + payload / 2)
}

/// A journal of more than fifty records of all kinds, and the desk that wrote it.
fn long_work(folder: &Path) -> (Desk, Vec<u8>) {
    let (mut desk, _) = one_of_each(folder);
    for round in 0..8 {
        desk.place(round);
        let joints: Vec<Uid> = desk.rig.walk().map(|joint| joint.data.uid).collect();
        let picked = joints[round * 7 % joints.len()];
        desk.operate(&Operation::Move { to: vec![(picked, Vec3::splat(round as f32))], with_children: true });
        desk.edit(RigEdit::SetLabel(joints[round % joints.len()], Some(format!("joint {round}"))));
        match round % 3 {
            0 => {
                desk.undo();
                desk.redo();
            }
            1 => {
                desk.edit(RigEdit::SetSkin(Uid(8), Some(skin(9, round as u32))));
                desk.undo();
            }
            _ => desk.journal.context(format!("round {round}")),
        }
    }
    let bytes = desk.bytes();
    assert!(records(&bytes).len() > 50, "{} records", records(&bytes).len());
    (desk, bytes)
}

/// The rig that remains when one change is missing: whatever needs it is left out, as a whole.
fn without(base: &Rig, changes: &[Commit], missing: usize) -> Rig {
    let mut rig = base.clone();
    let mut inverses: Vec<(Arc<rigsmith::rig::step::Step>, Vec<RigEdit>)> = Vec::new();
    for (number, committed) in changes.iter().enumerate() {
        let known = inverses.iter().position(|(step, _)| Arc::ptr_eq(step, committed.step()));
        match (committed, known) {
            _ if number == missing => {}
            (Commit::Undone(_), Some(known)) => {
                let (_, backward) = &inverses[known];
                rig.apply(&RigEdit::Batch(backward.clone())).unwrap();
            }
            (Commit::Undone(_) | Commit::Redone(_), None) => {}
            (Commit::Done(step) | Commit::Redone(step), _) => {
                if let Ok(inverse) = rig.apply(&RigEdit::Batch(step.forward.clone())) {
                    inverses.retain(|(known, _)| !Arc::ptr_eq(known, step));
                    inverses.push((step.clone(), vec![inverse]));
                }
            }
        }
    }
    rig
}

/// Every undo leads back, down to the rig that the work started with, and every redo forth again.
pub fn check_history(back: &Replay, base: &Rig, context: &str) {
    let mut history = RigHistory::restored(&back.stacks);
    let (mut rig, mut selection) = (back.rig.clone(), Selection::default());
    let ahead = history.steps().0.len() - history.steps().1;
    while let Some(undone) = history.undo(&mut rig, &mut selection) {
        undone.unwrap_or_else(|error| panic!("{context}: {error}"));
    }
    assert_eq!(&rig, base, "{context}");
    while let Some(redone) = history.redo(&mut rig, &mut selection) {
        redone.unwrap_or_else(|error| panic!("{context}: {error}"));
    }
    for _ in 0..ahead {
        history.undo(&mut rig, &mut selection).unwrap().unwrap();
    }
    assert_eq!(rig, back.rig, "{context}");
}

/// The journal as a process left it in a folder: it is offered and stays as it is.
pub fn offered(folder: &Path, bytes: &[u8]) -> PendingJournal {
    let path = folder.join("rigsmith-0123456789abcdef.journal");
    fs::write(&path, bytes).unwrap();
    let mut pending = pending_journals(&RealDisk, folder);
    assert_eq!(pending.len(), 1);
    assert_eq!(fs::read(&path).unwrap(), bytes, "the file is as it was");
    assert_eq!(pending[0].path, path);
    pending.remove(0)
}

#[test]
fn a_bit_flipped_in_any_record_loses_that_record_at_most() {
    let folder = fresh();
    let left = fresh();
    let (desk, bytes) = long_work(folder.path());
    let whole = recover(&bytes).unwrap();
    assert!(!whole.is_damaged());
    let (base, all) = (whole.base().unwrap().clone(), records(&bytes));
    assert_eq!(whole.records(), RecordCount { sound: all.len() as u64, lost: 0, may_be_more: false });
    let mut change = 0;
    let (mut mended, mut compared) = (0, 0);
    for (number, &(start, end, kind)) in all.iter().enumerate() {
        let is_change = (3..=7).contains(&kind);
        let payload = end - start - HEAD - TAIL;
        let inside = [0, payload / 3, payload / 2, payload.saturating_sub(1)].map(|at| start + HEAD + at);
        let frame = [0, 2, 4, 5, 9].map(|at| start + at).into_iter().chain([end - TAIL, end - 1]);
        for at in frame.chain(inside.into_iter().filter(|_| payload > 0)) {
            let context = format!("record {number} of kind {kind} from {start} to {end}, byte {at}");
            let bytes = flipped(&bytes, at);
            let found = recover(&bytes).unwrap_or_else(|error| panic!("{context}: {error}"));
            let count = found.records();
            let Condition::Damaged(listed) = offered(left.path(), &bytes).condition else {
                panic!("{context}: nobody is told");
            };
            assert_eq!(listed, count, "{context}");
            assert!(found.is_damaged() && found.gaps()[0].at == start, "{context}: {:?}", found.gaps());
            let restored = found.restore(Basis::Journal, None);
            if (start + HEAD..end - TAIL).contains(&at) {
                assert_eq!((count.sound, count.lost), (all.len() as u64 - 1, 1), "{context}");
                assert_eq!(found.gaps()[0].records, Some(1), "{context}");
                assert_eq!(found.gaps()[0].kind.map(|kind| kind as u8), Some(kind), "{context}");
                // Undos and redos have no content, so what is lost here is a step or no change.
                if is_change {
                    let expected = without(&base, whole.changes(), change);
                    assert_eq!(restored.replayed.rig, expected, "{context}: {:?}", restored.skipped);
                    compared += 1;
                }
            } else {
                // Length, number and kind follow from the records around it, and the checksum tells its own flipped bit.
                assert_eq!((count.sound, count.lost), (all.len() as u64, 0), "{context}");
                assert_eq!(found.gaps()[0].damage, Damage::Frame, "{context}");
                assert_eq!(found.changes(), whole.changes(), "{context}");
                assert_eq!(restored.replayed.rig, desk.rig, "{context}");
                mended += 1;
            }
            if kind != 8 {
                assert_eq!(found.base(), whole.base(), "{context}");
            }
            let base = found.base().unwrap_or_else(|| panic!("{context}: there are two copies"));
            check_history(&restored.replayed, base, &context);
        }
        change += usize::from(is_change);
    }
    assert!(mended > 300 && compared > 80, "{mended} {compared}");
}

#[test]
fn a_bit_flipped_in_any_byte_of_the_prelude_loses_nothing() {
    let folder = fresh();
    let left = fresh();
    let (desk, bytes) = long_work(folder.path());
    let whole = recover(&bytes).unwrap();
    for at in 0..PRELUDE {
        for bit in 0..8 {
            let mut bytes = bytes.clone();
            bytes[at] ^= 1 << bit;
            let found = recover(&bytes).unwrap_or_else(|error| panic!("bit {bit} of byte {at}: {error}"));
            assert_eq!((found.session, found.changes()), (whole.session, whole.changes()), "bit {bit} of byte {at}");
            assert_eq!(found.gaps().len(), 1);
            assert_eq!((found.gaps()[0].damage, found.gaps()[0].records), (Damage::Prelude, Some(0)));
            assert_eq!(replayed(&found).rig, desk.rig);
            assert!(matches!(offered(left.path(), &bytes).condition, Condition::Damaged(_)));
        }
    }
    // All of it, with the header: nobody knows what the work was on, but it is there.
    let mut zeros = bytes.clone();
    zeros[..PRELUDE + HEAD + 40].fill(0);
    let found = recover(&zeros).unwrap();
    assert_eq!((found.session, found.origin()), (whole.session, &Origin::Unknown));
    assert_eq!(found.changes(), whole.changes());
    assert_eq!(found.restore(Basis::Journal, None).replayed.rig, desk.rig);
    let pending = offered(left.path(), &zeros);
    assert_eq!((pending.changes, pending.origin), (whole.changes().len(), Origin::Unknown));
}

#[test]
fn every_cut_and_every_flipped_byte_leaves_all_other_records() {
    let folder = fresh();
    let (_desk, bytes) = one_of_each(folder.path());
    let whole = recover(&bytes).unwrap();
    let all = records(&bytes);
    for at in 0..bytes.len() {
        let sound = all.iter().filter(|(_, end, _)| *end <= at).count();
        match recover(&bytes[..at]) {
            Err(JournalError::NotAJournal) => assert!(at < 8, "cut at {at}"),
            Err(error) => assert!(sound == 0 && error == JournalError::NothingSound, "cut at {at}: {error}"),
            Ok(found) => {
                assert_eq!(found.records().sound, sound as u64, "cut at {at}");
                assert_eq!(found.changes(), &whole.changes()[..found.changes().len()], "cut at {at}");
                let is_between = all[sound].0 == at;
                assert_eq!(found.ending, if is_between { Ending::Open } else { Ending::Torn }, "cut at {at}");
                assert_eq!(found.is_damaged(), !is_between, "cut at {at}");
                if let Some(gap) = found.gaps().last() {
                    assert_eq!((gap.at, gap.at + gap.bytes, gap.damage), (all[sound].0, at, Damage::Cut));
                    assert_eq!(gap.records, None, "cut at {at}");
                }
                replayed(&found);
            }
        }
        for bit in [0, 3, 7] {
            let mut flipped = bytes.clone();
            flipped[at] ^= 1 << bit;
            let found = recover(&flipped).unwrap_or_else(|error| panic!("bit {bit} of byte {at}: {error}"));
            assert_ne!(found, whole, "bit {bit} of byte {at} counts for nothing");
            let count = found.records();
            assert_eq!(count.sound + count.lost, all.len() as u64, "bit {bit} of byte {at}");
            assert!(count.lost <= 1 && !count.may_be_more, "bit {bit} of byte {at}");
            found.restore(Basis::Journal, None);
        }
    }
    // A run of zeros, as a lost sector leaves it.
    for start in (PRELUDE..bytes.len() - 64).step_by(16) {
        let mut zeros = bytes.clone();
        zeros[start..start + 64].fill(0);
        let hit = |&&(from, to, _): &&(usize, usize, u8)| from < start + 64 && start < to;
        let found = recover(&zeros).unwrap();
        let spared = all.len() - all.iter().filter(hit).count();
        assert!(found.records().sound >= spared as u64, "zeros from {start}: {:?}", found.records());
        found.restore(Basis::Journal, None);
    }
    let mut longer = bytes.clone();
    longer.extend(&bytes);
    let twice = recover(&longer).unwrap();
    assert_eq!(twice.changes(), whole.changes());
    assert_eq!((twice.ending, twice.gaps()[0].damage), (Ending::Torn, Damage::Length));
}

#[test]
fn an_undo_of_a_lost_step_takes_nothing_else_back() {
    let folder = fresh();
    let mut desk = Desk::apart(folder.path());
    for number in 0..3 {
        desk.place(number);
    }
    desk.undo();
    desk.undo();
    let bytes = desk.bytes();
    let done: Vec<_> = records(&bytes).into_iter().filter(|record| record.2 == 3).collect();
    // The third step is lost and undone: nothing is missing in the end.
    let found = recover(&damaged(&bytes, done[2])).unwrap();
    assert_eq!(found.restore(Basis::Journal, None).replayed.rig, desk.rig);
    let undo_of_lost: Vec<&Gap> = found.gaps().iter().filter(|gap| gap.damage == Damage::UnknownStep).collect();
    assert_eq!(undo_of_lost.len(), 1, "{:?}", found.gaps());
    assert_eq!(undo_of_lost[0].kind, Some(RecordKind::Undone));
    assert!(undo_of_lost[0].to_string().contains("an undo is lost after 2 edits"), "{}", undo_of_lost[0]);
    // Where two records are lost nobody knows what the undos took back; both steps before stay.
    let mut bytes = bytes.clone();
    let undos = records(&bytes).iter().filter(|record| record.2 == 4).count();
    assert_eq!(undos, 2);
    bytes[done[2].0..done[2].1 + 10].fill(0x55);
    let found = recover(&bytes).unwrap();
    let back = found.restore(Basis::Journal, None).replayed;
    assert_eq!((back.rig.len(), found.records().lost), (2, 2));
}

#[test]
fn lost_weights_take_only_what_names_them_along() {
    let folder = fresh();
    let mut desk = Desk::apart(folder.path());
    let mesh = Uid(8);
    for seed in 0..3 {
        desk.edit(RigEdit::SetSkin(mesh, Some(skin(9, seed))));
        desk.place(seed as usize);
    }
    let bytes = desk.bytes();
    let skins: Vec<_> = records(&bytes).into_iter().filter(|record| record.2 == 8).collect();
    assert_eq!(skins.len(), 3);
    for (number, record) in skins.iter().enumerate() {
        let found = recover(&damaged(&bytes, *record)).unwrap();
        assert_eq!(found.changes().len(), 5, "only the step that sets them is lost");
        let restored = found.restore(Basis::Journal, None);
        assert!(restored.skipped.is_empty());
        assert_eq!(restored.replayed.rig.len(), 3);
        let last = if number == 2 { skin(9, 1) } else { skin(9, 2) };
        assert_eq!(restored.replayed.rig.skin(mesh), Some(&last));
        check_history(&restored.replayed, found.base().unwrap(), &format!("weights {number}"));
    }
}

#[test]
fn a_step_that_needs_a_lost_one_is_left_out_whole_and_told() {
    let folder = fresh();
    let mut desk = Desk::apart(folder.path());
    desk.place(0);
    desk.place(1);
    let joints: Vec<Uid> = desk.rig.walk().map(|joint| joint.data.uid).collect();
    desk.edit(RigEdit::SetLabel(joints[0], Some("stays".into())));
    desk.operate(&Operation::Labels(vec![(joints[0], "a".into()), (joints[1], "b".into())]));
    desk.undo();
    desk.edit(RigEdit::SetLabel(joints[1], Some("c".into())));
    let bytes = desk.bytes();
    let second = records(&bytes).into_iter().filter(|record| record.2 == 3).nth(1).unwrap();
    let found = recover(&damaged(&bytes, second)).unwrap();
    let restored = found.restore(Basis::Journal, None);
    let skipped: Vec<_> = restored.skipped.iter().map(|skipped| skipped.change).collect();
    assert_eq!(skipped, [2, 4], "{:?}", restored.skipped);
    assert!(restored.skipped.iter().all(|skipped| matches!(skipped.why, SkipReason::Refused(_))));
    assert_eq!(
        restored.replayed.rig.joint(joints[0]).and_then(|joint| joint.data.label.clone()).as_deref(),
        Some("stays")
    );
    assert_eq!(restored.replayed.refused, None);
    assert!(restored.replayed.selection.as_ref().is_none_or(|selected| !selected.contains(&joints[1])));
    check_history(&restored.replayed, found.base().unwrap(), "a lost joint");
}

#[test]
fn what_a_saved_project_holds_is_not_made_twice() {
    let folder = fresh();
    let project = folder.path().join("hero.rigsmith.ron");
    let mut desk = Desk::apart(folder.path());
    for number in 0..4 {
        desk.place(number);
    }
    desk.undo();
    desk.save(&project, Moment::InPlace);
    desk.place(7);
    let joint = desk.rig.roots()[0];
    desk.edit(RigEdit::SetLabel(joint, Some("later".into())));
    let bytes = desk.bytes();
    let path = desk.journal.path().unwrap();
    let places = start(folder.path()).places;
    let rig = desk.rig.clone();
    drop(desk);
    let all = records(&bytes);
    let mark = all.iter().position(|record| record.2 == 9).unwrap();
    for (number, record) in all.iter().enumerate().skip(2).filter(|(_, record)| record.1 - record.0 > HEAD + TAIL) {
        let bytes = damaged(&bytes, *record);
        fs::write(&path, &bytes).unwrap();
        let pending = pending_journal(&RealDisk, &path).unwrap();
        let found = recover(&bytes).unwrap();
        let basis = found.basis(hash_at);
        let project = read_template(&fs::read(&project).unwrap()).unwrap().rig;
        let unsaved = if number > mark { 1 } else { 2 };
        if number == mark {
            assert_eq!(basis, Basis::Journal, "the note of the save is lost");
            assert_eq!(found.restore(basis, None).replayed.rig, rig);
            continue;
        }
        assert_eq!(pending.changes, unsaved, "record {number}");
        let Basis::Project { contained } = basis else { panic!("record {number}: {basis:?}") };
        assert_eq!(contained, found.changes().len() - unsaved, "record {number}");
        let restored = found.restore(basis, Some(project));
        assert!(restored.skipped.is_empty(), "record {number}");
        if number < mark {
            assert_eq!(restored.replayed.rig, rig, "record {number}");
        }
        // The journal that goes on says the same.
        let ResumedJournal { journal, kept } =
            Journal::resume(Arc::new(RealDisk), places.clone(), &found, &restored, &path);
        journal.flush(LONG).unwrap();
        let again = recover(&fs::read(journal.path().unwrap()).unwrap()).unwrap();
        assert!(!again.is_damaged() && again.changes().len() == unsaved);
        assert_eq!(replayed(&again).rig, restored.replayed.rig, "record {number}");
        assert_eq!(fs::read(kept.unwrap()).unwrap(), bytes);
    }
}
