//! Damaged journals on the disk: nothing removes them unasked, and no file holds up a reader.

use std::path::PathBuf;

use rigsmith::files::journal::{Condition, ResumedJournal, project_beside};

use super::{
    damage::{PRELUDE, check_history, damaged, flipped, offered, records},
    *,
};

#[test]
fn a_damaged_journal_is_kept_whatever_becomes_of_its_work() {
    let folder = fresh();
    let (bytes, path) = of_two_joints(folder.path());
    let first = records(&bytes).into_iter().find(|record| record.2 == 3).unwrap();
    let bytes = damaged(&bytes, first);
    let mut taken = path.clone().into_os_string();
    taken.push(".damaged");
    fs::write(&taken, b"from before").unwrap();
    fs::write(&path, &bytes).unwrap();
    let found = recover(&bytes).unwrap();
    let restored = found.restore(Basis::Journal, None);
    let ResumedJournal { journal, kept } =
        Journal::resume(Arc::new(RealDisk), start(folder.path()).places, &found, &restored, &path);
    journal.flush(LONG).unwrap();
    let kept = kept.unwrap();
    assert_eq!(fs::read(&kept).unwrap(), bytes);
    assert!(kept.to_string_lossy().ends_with(".journal.damaged.2"), "{}", kept.display());
    assert_eq!(fs::read(&taken).unwrap(), b"from before");
    assert_eq!(journal.path(), Some(path.clone()));
    // A second crash: the work is offered, the damaged file is not.
    drop(journal);
    let pending = pending_journals(&RealDisk, path.parent().unwrap());
    assert_eq!(pending.len(), 1);
    assert_eq!((pending[0].condition.clone(), pending[0].changes), (Condition::Whole, 1));
    assert_eq!(recover_at(&path).rig, restored.replayed.rig);
    // Saved and closed: still there.
    let found = recover(&fs::read(&path).unwrap()).unwrap();
    let restored = found.restore(Basis::Journal, None);
    let ResumedJournal { journal, kept: none } =
        Journal::resume(Arc::new(RealDisk), start(folder.path()).places, &found, &restored, &path);
    assert_eq!(none, None, "this one was whole");
    journal.flush(LONG).unwrap();
    journal.close(LONG).unwrap();
    assert!(!path.exists() && kept.exists());
}

#[test]
fn no_damaged_journal_is_ever_removed_unasked() {
    let folder = fresh();
    let project = folder.path().join("hero.rigsmith.ron");
    let mut desk = Desk::apart(folder.path());
    desk.place(1);
    desk.save(&project, Moment::Rotated);
    let bytes = desk.bytes();
    let path = desk.journal.path().unwrap();
    drop(desk);
    assert_eq!((project_beside(&path), journal_beside(&project)), (Some(project.clone()), path.clone()));
    // Everything is saved, but where a byte is wrong nobody can be sure of that.
    let mut kinds = Vec::new();
    for at in 0..bytes.len() {
        fs::write(&path, flipped(&bytes, at)).unwrap();
        let pending = pending_journal(&RealDisk, &path).unwrap_or_else(|| panic!("byte {at}"));
        assert_ne!(pending.condition, Condition::Whole, "byte {at}");
        assert!(path.exists());
    }
    let newer = [&bytes[..8], &2u32.to_le_bytes(), &[9; 80]].concat();
    let contents: [(&[u8], &str); 4] = [
        (b"", "none of its records"),
        (b"RIGJRNL\0", "none of its records"),
        (b"something else", "not a journal"),
        (&newer, "format 2"),
    ];
    for (content, sign) in contents {
        fs::write(&path, content).unwrap();
        let pending = pending_journal(&RealDisk, &path).unwrap();
        let Condition::Unreadable(error) = &pending.condition else { panic!("{:?}", pending.condition) };
        assert!(error.to_string().contains(sign), "{error}");
        assert_eq!(fs::read(&path).unwrap(), content);
        kinds.push(error.clone());
    }
    assert!(matches!(kinds[3], JournalError::Newer { found: 2, .. }));
    // Whole, and all of it saved.
    fs::write(&path, &bytes).unwrap();
    assert_eq!(pending_journal(&RealDisk, &path), None);
    assert!(!path.exists());
}

#[test]
fn a_project_journal_without_a_header_is_taken_for_that_of_the_project_beside_it() {
    let folder = fresh();
    let project = folder.path().join("hero.rigsmith.ron");
    let mut desk = Desk::apart(folder.path());
    desk.place(1);
    desk.save(&project, Moment::Rotated);
    desk.place(2);
    let bytes = desk.bytes();
    let header = records(&bytes)[0];
    let mut found = recover(&damaged(&bytes, header)).unwrap();
    assert_eq!((found.origin(), found.project()), (&Origin::Unknown, None));
    found.assume_project(&project);
    assert_eq!((found.basis(hash_at), found.project()), (Basis::Changed, Some(project.as_path())));
    let held = read_template(&fs::read(&project).unwrap()).unwrap().rig;
    assert_eq!(found.restore(Basis::Changed, Some(held)).replayed.rig, desk.rig);
}

/// A frame with a checksum that fits.
fn frame(session: u64, number: u64, kind: u8, payload: &[u8]) -> Vec<u8> {
    let mut out = (payload.len() as u32).to_le_bytes().to_vec();
    out.push(kind);
    out.extend(number.to_le_bytes());
    out.extend(payload);
    let checksum = file_hash(&out) ^ session;
    out.extend(checksum.to_le_bytes());
    out
}

#[test]
fn files_made_to_hold_up_a_reader_do_not() {
    const LENGTH: usize = 8 << 20;
    let folder = fresh();
    let (_desk, bytes) = one_of_each(folder.path());
    let whole = recover(&bytes).unwrap();
    let next = records(&bytes).len() as u64;
    let head = |length: usize, number: u64| {
        let mut head = (length as u32).to_le_bytes().to_vec();
        head.push(3);
        head.extend(number.to_le_bytes());
        head
    };
    // Heads that claim half of the file, one after the other.
    let mut heads = bytes.clone();
    while heads.len() < LENGTH {
        heads.extend(head(LENGTH / 2, next));
    }
    heads.extend(vec![0; LENGTH / 2]);
    assert_eq!(recover(&heads).unwrap().changes(), whole.changes());
    // The same with a sound record after each.
    let mut mixed = bytes.clone();
    let mut number = next;
    while mixed.len() < LENGTH {
        mixed.extend(head(LENGTH / 2, number));
        mixed.extend(frame(whole.session, number + 1, 10, b"c"));
        number += 2;
    }
    mixed.extend(vec![0; LENGTH / 2]);
    assert_eq!(recover(&mixed).unwrap().changes(), whole.changes());
    // The same without any session to go by.
    let mut lost = heads[PRELUDE + 200..].to_vec();
    lost.splice(..0, *b"RIGJRNL\0\x01\0\0\0sessions");
    let _ = recover(&lost);
}

#[test]
fn the_journal_that_one_bit_emptied_gives_back_all_but_one_record() {
    let Some(data) = std::env::var_os("RIGSMITH_DATA").map(PathBuf::from) else {
        return println!("skipped: RIGSMITH_DATA names no folder");
    };
    let file = data.join("hostile/journal_one_bit.journal");
    let Ok(bytes) = fs::read(&file) else { return println!("skipped: there is no {}", file.display()) };
    let found = recover(&bytes).unwrap();
    let total = records(&bytes).len() as u64;
    assert_eq!((found.records().sound, found.records().lost), (total - 1, 1), "{:?}", found.gaps());
    let restored = found.restore(Basis::Journal, None);
    println!("{}: {:?}, {:?}", found.records(), found.gaps(), restored.skipped);
    check_history(&restored.replayed, &found.base().cloned().unwrap_or_default(), "one bit");
    let left = fresh();
    assert!(matches!(offered(left.path(), &bytes).condition, Condition::Damaged(_)));
}
