//! Fuzzing of whole paths: seeded choices become templates, models, clips, gestures, edits and calls, which are carried from
//! reading to files that are read again. The targets of `fuzz/` run the same paths with coverage.

use crate::{mutate::run_seeded, whole};

#[test]
fn whole_templates() {
    run_seeded("whole_template", 120, whole::template::check);
}

#[test]
fn whole_models() {
    run_seeded("whole_model", 60, whole::mesh::check);
}

#[test]
fn whole_skins() {
    run_seeded("whole_skin", 40, whole::skin::check);
}

#[test]
fn whole_clips() {
    run_seeded("whole_clip", 120, whole::clip::check);
}

#[test]
fn whole_gestures() {
    run_seeded("whole_gestures", 25, whole::gestures::check);
}

#[test]
fn whole_projects() {
    run_seeded("whole_project", 60, whole::project::check);
}

#[test]
fn edit_sequences() {
    run_seeded("edit_sequence", 50, whole::edits::check);
}

#[test]
fn writes_to_entities() {
    run_seeded("entity_writes", 30, whole::entities::check);
}

#[test]
fn remote_calls() {
    run_seeded("remote_calls", 12, whole::calls::check);
}

#[test]
fn updates() {
    run_seeded("update", 60, whole::update::check);
}

#[test]
fn pose_commands() {
    run_seeded("pose_command", 40, whole::pose::check);
}

/// Inputs that generators make are mostly valid: those that are refused at once would test readers alone.
#[test]
fn most_of_what_is_made_is_valid() {
    use crate::{
        generate::{Choices, models::model, template::template},
        random::Random,
    };

    let mut random = Random(7);
    let (mut templates, mut built, mut with_parts, mut models) = (0, 0, 0, 0);
    let mut modules = std::collections::BTreeSet::new();
    let count = 400;
    for _ in 0..count {
        let bytes: Vec<u8> = (0..600).map(|_| random.next() as u8).collect();
        let made = template(&mut Choices::new(&bytes), &whole::limited(), true);
        if let Some(read) = made.read() {
            templates += 1;
            with_parts += usize::from(!read.instances.is_empty());
            if let Some(rig) = whole::build(&read.rig) {
                built += 1;
                let tags = read.rig.walk().flat_map(|joint| &joint.data.tags);
                modules.extend(tags.filter_map(|tag| match &tag.kind {
                    rigsmith::rig::TagKind::Command { module, .. } => Some(module.clone()),
                    rigsmith::rig::TagKind::Feature { .. } => None,
                }));
                assert!(!rig.nodes.is_empty());
            }
        }
        models += usize::from(!model(&mut Choices::new(&bytes)).is_bent);
    }
    println!("{templates} of {count} templates read, {built} built, {with_parts} with parts; {models} models unbent");
    assert!(templates * 2 > count && built * 8 > count && with_parts * 40 > count && models * 2 > count);
    let all = whole::limited();
    let unused: Vec<&str> = all.iter().map(|module| module.name).filter(|name| !modules.contains(*name)).collect();
    assert!(unused.len() * 3 < all.iter().count(), "no template that builds has {unused:?}");
}
