//! Updates: a base, what a person made of it, and what its file became, put together in both ways, carried out and undone.

use rigsmith::{
    plugins::{document::Selection, history::RigHistory},
    rig::{
        Rig, UidSource,
        operations::Operation,
        template::{read_template, write_template},
        update::{ChangeKind, Take, diff, edits_between, pose_edits, update},
    },
};

use super::{build, edits::bytes, limited, promises, template::written_again};
use crate::generate::{Choices, edits::operation, template::template};

/// A rig after a few operations; those that are refused change nothing.
fn changed(choices: &mut Choices, rig: &Rig, numbers: u64) -> Rig {
    let mut rig = rig.clone();
    let mut uids = UidSource::seeded(numbers);
    for number in 0..choices.below(8) as u64 {
        let operation = operation(choices, &rig, &limited(), numbers + number * 16);
        if let Err(error) = operation.run(&mut rig, &mut uids, None) {
            promises::error(&error);
        }
    }
    rig
}

/// The rig as a template holds it: a file has neither weights, clips nor a current pose.
fn as_file(rig: &Rig) -> Rig {
    let text = write_template(rig);
    read_template(text.as_bytes()).unwrap_or_else(|error| panic!("{error}\n{text}")).rig
}

/// Carries three versions of a rig through all of it.
pub fn check(bytes_of_choices: &[u8]) {
    let choices = &mut Choices::new(bytes_of_choices);
    let made = template(choices, &limited(), true);
    let Some(base) = made.read().map(|template| as_file(&template.rig)) else { return };
    let mine = changed(choices, &base, 100_000);
    let theirs = match choices.chance(6) {
        // Another template under the same file name.
        true => {
            let other = template(choices, &limited(), false);
            let Some(other) = other.read() else { return };
            other.rig
        }
        false => as_file(&changed(choices, &base, 200_000)),
    };
    assert_eq!(diff(&base, &base), Vec::new());
    for base in [Some(&base), None] {
        for take in [Take::Mine, Take::Theirs] {
            put_together(base, &mine, &theirs, take);
        }
    }
    // Nothing that only one side has is in question.
    let same = update(Some(&base), &mine, &base, Take::Theirs);
    assert_eq!(same.conflicts(), 0, "{:?}", same.changes);
    let taken = update(Some(&base), &base, &theirs, Take::Mine);
    let conflicts: Vec<_> = taken.changes.iter().filter(|change| change.conflict).collect();
    assert!(conflicts.is_empty(), "{conflicts:?}");
}

/// One update: its changes are told, its edits make it, and undoing brings the first bytes back.
fn put_together(base: Option<&Rig>, mine: &Rig, theirs: &Rig, take: Take) {
    let updated = update(base, mine, theirs, take);
    let again = update(base, mine, theirs, take);
    assert_eq!(again, updated, "two updates differ");
    for change in &updated.changes {
        assert!(!change.to_string().is_empty());
        // A conflict has two sides.
        assert!(!change.conflict || change.from != change.to || change.kind != ChangeKind::Changed, "{change:?}");
    }
    written_again(&as_file(&updated.rig), true);
    let mut edits = edits_between(mine, &updated.rig).unwrap_or_else(|error| panic!("{error}"));
    edits.extend(pose_edits(mine, &updated.rig));
    let (mut rig, mut history, mut selection) = (mine.clone(), RigHistory::default(), Selection::default());
    let first = bytes(&rig);
    let operation = Operation::Named { name: "Update", edits };
    let mut uids = UidSource::seeded(1);
    history.edit(&mut rig, &mut selection, &mut uids, None, &operation).unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(write_template(&rig), write_template(&updated.rig), "the edits make something else");
    assert_eq!(rig.clips(), mine.clips(), "clips are a person's");
    build(&rig);
    // The same update again has nothing left to do for the side that was taken.
    let once_more = update(Some(theirs), &rig, theirs, take);
    assert_eq!(once_more.conflicts(), 0, "{:?}", once_more.changes);
    while let Some(undone) = history.undo(&mut rig, &mut selection) {
        undone.expect("what was done can be undone");
    }
    assert!(bytes(&rig) == first, "not the first bytes");
}
