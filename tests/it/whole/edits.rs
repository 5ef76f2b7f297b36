//! Edits: operations, undo, redo and steps of the build in any order; every build is that from nothing, and all of it is undone
//! to the first bytes.

use rigsmith::{
    plugins::{document::Selection, history::RigHistory},
    processor::Builder,
    rig::{
        Rig, RigEdit, Uid, UidSource,
        project::{Project, ProjectRig, write_project},
        step::{Commit, edits_from_empty, replay},
    },
};

use super::{check_limits, limited, promises, template::saved};
use crate::generate::{Choices, edits::operation, template::template};

/// Deeds of one sequence, at most.
const MOST: usize = 40;

/// All of a rig but its weights.
pub fn bytes(rig: &Rig) -> String {
    write_project(&Project { rigs: vec![ProjectRig { rig: rig.clone(), skins: Vec::new() }], ..Default::default() })
}

/// Carries a sequence of edits through all of it.
pub fn check(bytes_of_choices: &[u8]) {
    let choices = &mut Choices::new(bytes_of_choices);
    let modules = limited();
    let made = template(choices, &modules, false);
    let mut rig = made.read().map_or_else(|| Rig::new(Uid(1), "empty"), |template| template.rig);
    let first = rig.clone();
    let (mut history, mut selection, mut uids) = (RigHistory::default(), Selection::default(), UidSource::seeded(9));
    let mut builder = Builder::new(modules.clone());
    builder.sync(&rig);
    builder.run_all();
    let mut commits: Vec<Commit> = Vec::new();
    for number in 0..MOST as u64 {
        if choices.is_over() {
            break;
        }
        match choices.below(10) {
            0 => {
                if let Some(undone) = history.undo(&mut rig, &mut selection) {
                    commits.push(Commit::Undone(undone.expect("what was done can be undone")));
                }
                builder.sync(&rig);
            }
            1 => {
                if let Some(redone) = history.redo(&mut rig, &mut selection) {
                    commits.push(Commit::Redone(redone.expect("what was undone can be redone")));
                }
                builder.sync(&rig);
            }
            2 => {
                let place = choices.below(builder.len() + 1);
                match choices.below(5) {
                    0 => builder.step_forward(),
                    1 => builder.step_back(),
                    2 => builder.joint_forward(),
                    3 => builder.joint_back(),
                    _ => builder.run_to(place),
                };
            }
            _ => {
                let operation = operation(choices, &rig, &modules, number * 16);
                let before = bytes(&rig);
                match history.edit(&mut rig, &mut selection, &mut uids, None, &operation) {
                    Ok(recorded) => {
                        let Some(step) = recorded.step else { continue };
                        match &step.forward[..] {
                            [edit] => builder.touch(&rig, edit),
                            _ => builder.sync(&rig),
                        }
                        commits.push(Commit::Done(step));
                    }
                    Err(error) => {
                        promises::error(&error);
                        assert!(bytes(&rig) == before, "a refused operation changed something: {operation:?}");
                    }
                }
            }
        }
        if choices.chance(3) {
            built_as_from_nothing(&mut builder, &rig);
        }
    }
    built_as_from_nothing(&mut builder, &rig);
    whole(&rig, &first, &commits);
    while let Some(undone) = history.undo(&mut rig, &mut selection) {
        undone.expect("what was done can be undone");
    }
    assert!(bytes(&rig) == bytes(&first), "not the first bytes");
    assert_eq!(rig, first);
    builder.sync(&rig);
    built_as_from_nothing(&mut builder, &rig);
}

/// A build that goes on is the build from nothing.
fn built_as_from_nothing(builder: &mut Builder, rig: &Rig) {
    let report = builder.run_all();
    check_limits(builder, rig);
    let mut fresh = Builder::new(limited());
    fresh.sync(rig);
    let full = fresh.run_all();
    assert_eq!(report.error, full.error);
    assert_eq!(builder.cursor(), fresh.cursor());
    let (ours, theirs) = (builder.built(), fresh.built());
    let differs = ours.nodes.iter().zip(&theirs.nodes).find(|(a, b)| a != b);
    assert!(ours == theirs, "{differs:#?}");
    let shared = builder.shared_built();
    assert!(*shared == ours, "the shared result is another");
}

/// A rig after edits is saved and read, is made of an empty one, and is the outcome of its journal.
fn whole(rig: &Rig, first: &Rig, commits: &[Commit]) {
    saved(rig, None);
    let mut empty = Rig::new(rig.uid(), "");
    for edit in &edits_from_empty(rig) {
        empty.apply(edit).unwrap_or_else(|error| panic!("{edit:?}: {error}"));
    }
    assert_eq!(&empty, rig);
    let replayed = replay(first.clone(), commits, 0);
    assert_eq!(replayed.refused, None);
    assert_eq!(&replayed.rig, rig);
    // Every edit comes back from the text of a remote call.
    for commit in commits {
        for edit in commit.effect().0 {
            let json = serde_json::to_value(edit).unwrap_or_else(|error| panic!("{edit:?}: {error}"));
            let read: RigEdit = serde_json::from_value(json).unwrap_or_else(|error| panic!("{edit:?}: {error}"));
            assert_eq!(&read, edit);
        }
    }
}
