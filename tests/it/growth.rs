//! Growth of work and memory with the size of a rig, counted: for the worst shapes, twice the size takes about twice as much.

use std::{fmt::Write as _, sync::Arc};

use rigsmith::{
    processor::Builder,
    rig::{Rig, template::read_template},
};

/// Largest growth for twice the size.
const GROWTH: f64 = 2.3;

fn template(joints: &[String]) -> Rig {
    let text = format!("(format: 2, name: \"n\", joints: [{}])", joints.join(",\n"));
    read_template(text.as_bytes()).unwrap().rig
}

fn joint(label: &str, parent: Option<&str>, tags: &[String]) -> String {
    let mut text = format!("(label: \"{label}\", translation: (0, 0.1, 0)");
    if let Some(parent) = parent {
        let _ = write!(text, ", parent: \"{parent}\"");
    }
    if !tags.is_empty() {
        let _ = write!(text, ", tags: [{}]", tags.join(", "));
    }
    text + ")"
}

fn null(at: &str) -> String {
    format!("Command(module: \"null\", params: (at: \"{at}\"))")
}

fn control() -> String {
    "Command(module: \"control\", params: (at: \"@this\"))".to_owned()
}

/// Joints in a chain; `tags` are those of the joint with a number.
fn chain(count: usize, tags: impl Fn(usize) -> Vec<String>) -> Rig {
    let parent = |number: usize| number.checked_sub(1).map(|above| format!("j{above}"));
    let joints: Vec<String> =
        (0..count).map(|number| joint(&format!("j{number}"), parent(number).as_deref(), &tags(number))).collect();
    template(&joints)
}

fn star(count: usize) -> Rig {
    let arms = (0..count).map(|number| joint(&format!("j{number}"), Some("top"), &[null("@this")]));
    template(&std::iter::once(joint("top", None, &[])).chain(arms).collect::<Vec<_>>())
}

fn all_tags_on_one_joint(count: usize) -> Rig {
    let attribute = |number: usize| format!("Command(module: \"attribute\", params: (name: \"a{number}\"))");
    let tags: Vec<String> = (0..count).flat_map(|number| [null("@this"), attribute(number)]).collect();
    template(&[joint("j", None, &tags)])
}

fn equal_names(count: usize) -> Rig {
    let joint = |number: usize| {
        let (own, tag) = (0x1000 + number, 0x10_0000 + number);
        let tag = format!("Command(uid: \"{tag:016x}\", module: \"null\", params: (at: \"@this\"))");
        format!("(uid: \"{own:016x}\", label: \"j\", translation: (0, 0.1, 0), tags: [{tag}])")
    };
    template(&(0..count).map(joint).collect::<Vec<_>>())
}

/// Values that commands read and wrote in a build, and values that are kept of it.
fn measured(rig: &Rig) -> (u64, usize) {
    let mut builder = Builder::new(Arc::new(rigsmith::modules::all()));
    builder.sync(rig);
    let report = builder.run_all();
    assert_eq!(report.error, None);
    assert!(!report.executed.is_empty());
    (builder.work(), builder.traced())
}

fn check(shape: &str, counts: [usize; 3], rig: impl Fn(usize) -> Rig) {
    let measures: Vec<(u64, usize)> = counts.into_iter().map(|count| measured(&rig(count))).collect();
    for pair in measures.windows(2) {
        let [(work, traced), (more_work, more_traced)] = [pair[0], pair[1]];
        assert!(work > 0 && traced > 0, "{shape}: nothing is counted");
        assert!(more_traced as f64 <= GROWTH * traced as f64, "{shape}: memory grows by {measures:?}");
        assert!(more_work as f64 <= GROWTH * work as f64, "{shape}: work grows by {measures:?}");
    }
}

#[test]
fn builds_of_the_worst_shapes_grow_with_their_size() {
    let few = [150, 300, 600];
    check("star", few, star);
    check("all tags on one joint", few, all_tags_on_one_joint);
    check("equal names", few, equal_names);
    // The way up to the rig is walked as far as a joint whose transform is known, at most some hundred.
    let many = [600, 1200, 2400];
    check("chain", many, |count| chain(count, |_| vec![null("@this")]));
    check("chain of controls", many, |count| chain(count, |_| vec![control()]));
    check("chain under one reference", many, |count| {
        chain(count, |at| if at == 0 { vec![null("@any")] } else { vec![] })
    });
    // What one command makes or turns stands below what it made or turned before.
    for (module, params) in [
        ("control", "at: \"@hierarchy this\""),
        ("duplicate_chain", "suffix: \"b\""),
        ("mirror_joints", "joints: \"@hierarchy this\""),
        ("orient_joints", "joints: \"@hierarchy this\", along: x"),
    ] {
        let tag = format!("Command(module: \"{module}\", params: ({params}))");
        check(module, many, |count| chain(count, |at| if at == 0 { vec![tag.clone()] } else { vec![] }));
    }
}

/// Copies that one command makes of a long chain stand where the joints do, whatever it keeps of the transforms above.
#[test]
fn copies_of_long_chains_stand_where_the_joints_do() {
    use rigsmith::{
        mesh::model::Trs,
        rig::{BuiltNode, NodeType, RestTransform, RigEdit},
    };

    let count = 400;
    let turn = "Command(module: \"orient_joints\", params: (joints: \"@hierarchy this\", along: x))".to_owned();
    let copy = "Command(module: \"duplicate_chain\", params: (suffix: \"b\"))".to_owned();
    let mut rig = chain(count, |at| if at == 0 { vec![turn.clone(), copy.clone()] } else { vec![] });
    for (number, joint) in rig.walk().map(|joint| joint.data.uid).collect::<Vec<_>>().into_iter().enumerate() {
        let (sin, cos) = bevy::math::ops::sin_cos(0.05 * number as f32);
        let rest = RestTransform::from_translation(glam::Vec3::new(0.1 * cos, 0.1 * sin, 0.01));
        rig.apply(&RigEdit::SetRest(joint, rest)).unwrap();
    }
    let built = Builder::build(&rig, &Arc::new(rigsmith::modules::all())).unwrap();
    let mut globals: Vec<Trs> = Vec::new();
    for node in &built.nodes {
        let above = node.parent.map_or(Trs::IDENTITY, |parent| globals[parent]);
        globals.push(above * node.base);
    }
    let expected = rig.rest_globals();
    for kind in [NodeType::Joint, NodeType::Null] {
        let nodes = built.nodes.iter().zip(&globals);
        let found: Vec<(&BuiltNode, &Trs)> = nodes.filter(|(node, _)| node.kind == kind).collect();
        assert_eq!(found.len(), count, "{kind:?}");
        for ((node, found), (_, expected)) in found.into_iter().zip(&expected) {
            let (found, expected) = (found.translation, expected.translation);
            assert!(found.distance(expected) < 2e-3, "{}: {found} instead of {expected}", node.name);
        }
    }
}

/// Long chains are built the same from nothing and after edits at any height, whatever is known of them.
#[test]
fn long_chains_follow_edits_as_they_are_built() {
    use rigsmith::rig::{RestTransform, RigEdit};

    let modules = Arc::new(rigsmith::modules::all());
    for module in ["null", "control"] {
        let tag = || format!("Command(module: \"{module}\", params: (at: \"@this\"))");
        let mut rig = chain(420, |_| vec![tag()]);
        let mut builder = Builder::new(modules.clone());
        builder.sync(&rig);
        assert_eq!(builder.run_all().error, None);
        assert_eq!(builder.built(), Builder::build(&rig, &modules).unwrap(), "{module}");
        let joint = |rig: &Rig, number: usize| rig.find_label(&format!("j{number}")).unwrap();
        for number in [2, 127, 128, 300, 419] {
            let rest = RestTransform::from_translation(glam::Vec3::new(0.01 * number as f32, 0.3, 0.0));
            rig.apply(&RigEdit::SetRest(joint(&rig, number), rest)).unwrap();
            builder.sync(&rig);
            // Half of the commands first: the others see the chain later.
            builder.run_to(200);
            builder.step_back();
            assert_eq!(builder.run_all().error, None);
            assert_eq!(builder.built(), Builder::build(&rig, &modules).unwrap(), "{module}: joint {number}");
        }
        let (from, to) = (joint(&rig, 200), joint(&rig, 50));
        rig.apply(&RigEdit::SetParent { joint: from, parent: Some(to), index: 0 }).unwrap();
        builder.sync(&rig);
        assert_eq!(builder.run_all().error, None);
        assert_eq!(builder.built(), Builder::build(&rig, &modules).unwrap(), "{module}: another parent");
    }
}

/// A command that reads where the end of a chain is runs again when any joint above moves, and no other one does.
#[test]
fn a_transform_is_read_again_when_a_joint_above_changes() {
    use rigsmith::rig::{RestTransform, RigEdit};

    let tags = |at: usize| if at == 3 { vec![null("@this")] } else { vec![] };
    let mut rig = chain(8, tags);
    let modules = Arc::new(rigsmith::modules::all());
    let mut builder = Builder::new(modules.clone());
    builder.sync(&rig);
    builder.run_all();
    let joint = |rig: &Rig, number: usize| rig.find_label(&format!("j{number}")).unwrap();
    for (number, runs) in [(0, 1), (2, 1), (3, 1), (4, 0), (7, 0)] {
        let rest = RestTransform::from_translation(glam::Vec3::new(number as f32, 0.5, 0.25));
        let edit = RigEdit::SetRest(joint(&rig, number), rest);
        rig.apply(&edit).unwrap();
        builder.sync(&rig);
        let report = builder.run_all();
        assert_eq!((report.executed.len(), report.error), (runs, None), "joint {number}");
        assert_eq!(builder.built(), Builder::build(&rig, &modules).unwrap(), "joint {number}");
    }
}

/// Nodes that are visited when all joints of a chain move at once, and a command reads where its end is.
fn visited(count: usize) -> u64 {
    use rigsmith::rig::{RestTransform, RigEdit};

    let mut rig = chain(count, |at| if at + 1 == count { vec![null("@this")] } else { vec![] });
    let mut builder = Builder::new(Arc::new(rigsmith::modules::all()));
    builder.sync(&rig);
    assert_eq!(builder.visited(), 0, "nothing is read before the first run");
    assert_eq!(builder.run_all().error, None);
    let before = builder.visited();
    let joints: Vec<_> = rig.walk().map(|joint| joint.data.uid).collect();
    for joint in joints {
        let rest = RestTransform::from_translation(glam::Vec3::new(0.0, 0.2, 0.0));
        rig.apply(&RigEdit::SetRest(joint, rest)).unwrap();
    }
    builder.sync(&rig);
    let visited = builder.visited() - before;
    assert_eq!(builder.run_all().executed.len(), 1);
    visited
}

/// Nodes that are visited to find circles of constraints, where each joint of a chain follows a control that stands on the
/// joint above.
fn searched(count: usize) -> u64 {
    let rig = chain(count, |_| vec![control()]);
    let mut builder = Builder::new(Arc::new(rigsmith::modules::all()));
    builder.sync(&rig);
    assert_eq!(builder.run_all().error, None);
    builder.visited()
}

#[test]
fn circles_on_chains_of_controls_are_searched_once() {
    let visits: Vec<u64> = [150, 300, 600].into_iter().map(searched).collect();
    for pair in visits.windows(2) {
        assert!(pair[0] > 0 && pair[1] as f64 <= GROWTH * pair[0] as f64, "{visits:?}");
    }
}

#[test]
fn moves_of_whole_chains_are_followed_once() {
    let visits: Vec<u64> = [150, 300, 600].into_iter().map(visited).collect();
    for pair in visits.windows(2) {
        assert!(pair[0] > 0 && pair[1] as f64 <= GROWTH * pair[0] as f64, "{visits:?}");
    }
}

/// Transforms of joints at the end of a chain are the same whatever was looked at before: a copy of a rig has looked at nothing.
#[test]
fn transforms_of_long_chains_follow_edits() {
    use rigsmith::rig::{JointData, RestTransform, RigEdit, Uid};

    let mut rig = chain(330, |_| vec![]);
    let joint = |rig: &Rig, number: usize| rig.find_label(&format!("j{number}")).unwrap();
    let compare = |rig: &Rig, what: &str| {
        let fresh = rig.clone();
        for (uid, global) in rig.rest_globals() {
            assert_eq!(rig.rest_global(uid), fresh.rest_global(uid), "{what}: {uid}");
            let there = rig.rest_global(uid).translation;
            assert!(there.distance(global.translation) < 0.01, "{what}: {uid}: {there} {global:?}");
        }
    };
    compare(&rig, "as it is");
    let rest = |number: usize| RestTransform {
        rotation: glam::Quat::from_rotation_z(0.01 * number as f32),
        ..RestTransform::from_translation(glam::Vec3::new(0.02, 0.1, 0.01))
    };
    for number in [329, 320, 257, 256, 192, 130, 64, 63, 1, 0] {
        let edit = RigEdit::SetRest(joint(&rig, number), rest(number));
        let back = rig.apply(&edit).unwrap();
        compare(&rig, "a joint is turned");
        rig.apply(&back).unwrap();
        compare(&rig, "a joint is turned back");
        rig.apply(&edit).unwrap();
    }
    let (from, to) = (joint(&rig, 200), joint(&rig, 50));
    let back = rig.apply(&RigEdit::SetParent { joint: from, parent: Some(to), index: 0 }).unwrap();
    compare(&rig, "another parent");
    rig.apply(&back).unwrap();
    compare(&rig, "the former parent");
    let back = rig.apply(&RigEdit::RemoveJoint(joint(&rig, 329))).unwrap();
    let tip = joint(&rig, 328);
    let added = JointData { uid: Uid(0xabcd), rest: rest(7), ..JointData::default() };
    rig.apply(&RigEdit::AddJoint { joint: Box::new(added), parent: Some(tip), index: 0 }).unwrap();
    compare(&rig, "another joint at the end");
    rig.apply(&back).unwrap();
    compare(&rig, "both joints at the end");
}

/// Joints get the names and places that they get in a copy of the rig, for which nothing is known yet.
#[test]
fn names_of_placed_joints_follow_edits() {
    use rigsmith::rig::{
        Uid, UidSource,
        operations::{MirrorPlane, Operation},
    };

    for plane in [None, Some(MirrorPlane::sagittal(1.0))] {
        let mut rig = Rig::new(Uid(1), "drawn");
        let mut uids = UidSource::seeded(5);
        let (mut seed, mut active, mut labels) = (7_u32, None, Vec::new());
        for step in 0..400 {
            let mut random = |below: u32| {
                seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                (seed >> 16) % below
            };
            let all: Vec<Uid> = rig.walk().map(|joint| joint.data.uid).collect();
            let any = all.get(random(100) as usize * all.len() / 100).copied();
            let kind = if step < 130 { 9 } else { random(20) };
            let operation = match (kind, any) {
                (0, Some(joint)) => Operation::Delete { joints: vec![joint], keep_children: true },
                (1, Some(joint)) => Operation::Labels(vec![(joint, format!("arm{}_l_{}", random(4), random(3)))]),
                (2, Some(joint)) => Operation::Labels(vec![(joint, "joint+2_1".to_owned())]),
                _ => {
                    // Above the last joint, on the middle or on one side; sometimes a chain of its own.
                    let across = [0.0, 0.0, 0.0, 0.5, -0.5][random(5) as usize];
                    let position = glam::Vec3::new(across, 0.01 * step as f32, 0.1 * random(3) as f32);
                    let parent = match kind {
                        3 => None,
                        4 => any,
                        _ => active,
                    };
                    Operation::Place { position, parent }
                }
            };
            let (mut fresh, mut fresh_uids) = (rig.clone(), uids.clone());
            let expected = operation.run(&mut fresh, &mut fresh_uids, plane);
            let outcome = operation.run(&mut rig, &mut uids, plane);
            assert_eq!(outcome, expected, "step {step}");
            assert_eq!(rig, fresh, "step {step}");
            let Ok(outcome) = outcome else { continue };
            if let (Operation::Place { .. }, Some(selected)) = (&operation, &outcome.selected) {
                active = selected.last().copied();
                labels.extend(active.and_then(|joint| rig.joint(joint)?.data.label.clone()));
            }
            if kind == 5 {
                outcome.inverses.iter().for_each(|edit| drop(rig.apply(edit).unwrap()));
            }
            active = active.filter(|joint| rig.joint(*joint).is_some());
        }
        assert!(rig.len() > 100, "{}", rig.len());
        assert!(labels.iter().any(|label| label.contains("_l_")) && labels.iter().any(|label| !label.contains("_l_")));
    }
}

/// Joints that are visited to delete a chain, from its end to its root.
fn visited_to_delete(count: usize) -> u64 {
    use rigsmith::rig::{UidSource, operations::Operation};

    let mut rig = chain(count, |_| vec![]);
    let (root, before) = (rig.roots()[0], rig.visits());
    let deletion = Operation::Delete { joints: vec![root], keep_children: false };
    deletion.run(&mut rig, &mut UidSource::seeded(1), None).unwrap();
    assert!(rig.is_empty());
    rig.visits() - before
}

#[test]
fn chains_are_deleted_in_proportion_to_their_length() {
    let visits: Vec<u64> = [300, 600, 1200].into_iter().map(visited_to_delete).collect();
    for pair in visits.windows(2) {
        assert!(pair[0] > 0 && pair[1] as f64 <= GROWTH * pair[0] as f64, "{visits:?}");
    }
}

/// Joints that are visited to move all joints of a chain, and to undo that.
fn visited_to_move(count: usize, with_children: bool) -> u64 {
    use rigsmith::rig::{Uid, UidSource, operations::Operation};

    let mut rig = chain(count, |_| vec![]);
    let (copy, before) = (rig.clone(), rig.visits());
    let beside = glam::Vec3::new(0.3, 0.0, 0.2);
    let to: Vec<(Uid, glam::Vec3)> =
        rig.rest_globals().into_iter().map(|(joint, global)| (joint, global.translation + beside)).collect();
    let outcome =
        Operation::Move { to: to.clone(), with_children }.run(&mut rig, &mut UidSource::seeded(1), None).unwrap();
    for (joint, place) in to {
        let there = rig.rest_global(joint).translation;
        assert!(there.distance(place) < 0.01, "{joint}: {there} instead of {place}");
    }
    outcome.inverses.iter().for_each(|edit| drop(rig.apply(edit).unwrap()));
    assert_eq!(rig, copy);
    rig.visits() - before
}

#[test]
fn whole_chains_are_moved_in_proportion_to_their_length() {
    for with_children in [false, true] {
        let visits: Vec<u64> =
            [300, 600, 1200].into_iter().map(|count| visited_to_move(count, with_children)).collect();
        for pair in visits.windows(2) {
            assert!(pair[0] > 0 && pair[1] as f64 <= GROWTH * pair[0] as f64, "{with_children}: {visits:?}");
        }
    }
}

/// Joints of an extracted rig hang on the nearest of the chosen ones above them, wherever these stand.
#[test]
fn extracted_joints_hang_on_the_nearest_one_above() {
    use rigsmith::rig::{Uid, extract::extract};

    // A chain with a joint beside each of its joints.
    let beside = |number: usize| joint(&format!("b{number}"), Some(&format!("j{number}")), &[]);
    let along = |number: usize| {
        joint(&format!("j{number}"), number.checked_sub(1).map(|above| format!("j{above}")).as_deref(), &[])
    };
    let rig = template(&(0..60).flat_map(|number| [along(number), beside(number)]).collect::<Vec<_>>());
    for step in [1, 2, 7, 50] {
        let chosen: Vec<Uid> = rig.walk().map(|joint| joint.data.uid).step_by(step).collect();
        let out = extract(&rig, &chosen, "part", None).unwrap().rig;
        assert_eq!(out.len(), chosen.len(), "every {step}th");
        for uid in chosen.iter().copied() {
            let above = rig.ancestors(uid).map(|above| above.data.uid).find(|above| chosen.contains(above));
            assert_eq!(out.joint(uid).unwrap().parent, above, "every {step}th: {uid}");
            let [there, was] = [&out, &rig].map(|rig| rig.rest_global(uid).translation);
            assert!(there.distance(was) < 1e-3, "every {step}th: {uid}: {there} instead of {was}");
        }
    }
}

/// Tags that are looked at where each of many tags of one joint is found, set, moved to the end and deleted.
fn looked_at(count: usize) -> u64 {
    use rigsmith::rig::{
        TagData, UidSource,
        operations::{Operation, TagOperation},
    };

    let mut rig = all_tags_on_one_joint(count / 2);
    let (joint, copy) = (rig.roots()[0], rig.clone());
    let tags: Vec<TagData> = rig.joint(joint).unwrap().data.tags.clone();
    assert_eq!(tags.len(), count);
    let before = rig.visits();
    let mut inverses = Vec::new();
    for tag in &tags {
        assert_eq!(rig.find_tag(tag.uid).map(|(_, found)| found), Some(tag));
        let off = TagData { enabled: false, ..tag.clone() };
        inverses.push(rig.apply(&rigsmith::rig::RigEdit::SetTag(joint, Box::new(off))).unwrap());
    }
    let uids: Vec<_> = tags.iter().map(|tag| tag.uid).collect();
    let half = uids[..count / 2].to_vec();
    for operation in [TagOperation::Move { tags: half, joint, before: None }, TagOperation::Delete(uids)] {
        let outcome = Operation::Tags(operation).run(&mut rig, &mut UidSource::seeded(1), None).unwrap();
        inverses.extend(outcome.inverses.into_iter().rev());
    }
    assert!(rig.joint(joint).unwrap().data.tags.is_empty());
    inverses.iter().rev().for_each(|edit| drop(rig.apply(edit).unwrap()));
    assert_eq!(rig, copy);
    rig.visits() - before
}

#[test]
fn tags_of_one_joint_are_found_without_a_look_at_the_others() {
    let looked: Vec<u64> = [400, 800, 1600].into_iter().map(looked_at).collect();
    for pair in looked.windows(2) {
        assert!(pair[0] > 0 && pair[1] as f64 <= GROWTH * pair[0] as f64, "{looked:?}");
    }
}

/// Groups without joints are removed, and groups found by their names, without a look at all joints and groups.
#[test]
fn groups_are_found_and_removed_in_proportion_to_their_number() {
    use rigsmith::rig::{GroupData, RigEdit, Uid};

    let looked = |count: usize| {
        let mut rig = chain(count, |_| vec![]);
        let before = rig.visits();
        let uid = |number: usize| Uid(0x7000_0000 + number as u64);
        for number in 0..count {
            let name = format!("g{number}");
            let group = GroupData { uid: uid(number), name: name.clone(), color: [0.5; 3], enabled: true };
            assert_eq!(rig.group_named(&name), None);
            rig.apply(&RigEdit::AddLocalGroup(group.clone(), usize::MAX)).unwrap();
            assert_eq!(rig.group_named(&name), Some(&group));
        }
        for number in (0..count).rev() {
            rig.apply(&RigEdit::RemoveLocalGroup(uid(number))).unwrap();
            assert_eq!(rig.group_named(&format!("g{number}")), None);
        }
        rig.visits() - before
    };
    let looked: Vec<u64> = [300, 600, 1200].into_iter().map(looked).collect();
    for pair in looked.windows(2) {
        assert!(pair[0] > 0 && pair[1] as f64 <= GROWTH * pair[0] as f64, "{looked:?}");
    }
}
