//! Titles of steps: the history says what each step changed, in one short line.

use std::sync::Arc;

use rigsmith::{
    plugins::history::RigHistory,
    rig::{
        GroupData, JointData, PoseOffset, SelectionSet,
        animation::{Property, RigClip, TrackTarget},
        feature::FeatureKey,
        operations::{ClipOperation, KeyOperation},
    },
};

use super::*;

/// Title of the last step.
fn title(desk: &Desk) -> String {
    let history = desk.app.world().get::<RigHistory>(desk.rig).unwrap();
    history.steps().0.last().map(|title| (*title).to_owned()).unwrap_or_default()
}

fn command(module: &str, params: &str) -> TagKind {
    TagKind::Command { module: module.into(), params: params.into(), feature: None }
}

#[test]
fn steps_name_the_tags_that_they_change() {
    let mut desk = Desk::new(HistoryPanel::default());
    let joints = desk.chain(&["hips", "hand_l", "hand_r"]);
    let [hips, left, right] = joints[..] else { panic!() };
    let tags = |desk: &Desk, joint: Uid| -> Vec<Uid> {
        desk.rig().joint(joint).unwrap().data.tags.iter().map(|tag| tag.uid).collect()
    };
    let check = |desk: &mut Desk, operation: TagOperation, wanted: &str| {
        let steps = desk.steps().1;
        desk.edit(Operation::Tags(operation));
        assert_eq!((title(desk).as_str(), desk.steps().1), (wanted, steps + 1), "{:?}", desk.told());
    };
    let add = |joints: &[Uid], kind: TagKind| TagOperation::Add { joints: joints.to_vec(), kind, index: None };
    check(&mut desk, add(&[hips], command("control", "(size: 0.5)")), "Add control to hips");
    check(&mut desk, add(&joints, command("null", "()")), "Add null to hips and 2 more");
    let feature =
        TagKind::Feature { kind: "fk".into(), name: "legs".into(), switch: String::new(), choice: String::new() };
    check(&mut desk, add(&[hips], feature), "Add feature legs to hips");
    let [control, null, legs] = tags(&desk, hips)[..] else { panic!() };
    let set = |params: &str| TagOperation::Params(vec![(control, params.to_owned())]);
    check(&mut desk, set("(size: 0.7)"), "Set size of control of hips");
    // A drag shows the value before it is let go.
    for size in ["(size: 0.8)", "(size: 0.9)"] {
        let change = Change::Preview(Operation::Tags(set(size)));
        desk.app.world_mut().write_message(EditRequest { rig: desk.rig, change });
        desk.frames(2);
    }
    check(&mut desk, set("(size: 0.9)"), "Set size of control of hips");
    check(&mut desk, set("(size: 0.9, shape: \"circle\")"), "Set shape of control of hips");
    check(&mut desk, set("(size: 0.2)"), "Change control of hips");
    check(&mut desk, TagOperation::Comment(control, "root".to_owned()), "Comment control of hips");
    check(&mut desk, TagOperation::Enable(vec![control, null], false), "Disable control of hips and 1 more");
    check(&mut desk, TagOperation::Enable(vec![control, null], true), "Enable control of hips and 1 more");
    check(&mut desk, TagOperation::Attach(vec![control], Some(legs)), "Attach control of hips to feature legs");
    let key = FeatureKey { group: None, kind: "fk".into(), name: "legs".into() };
    check(&mut desk, TagOperation::SetFeature(key, false), "Turn legs off");
    check(&mut desk, TagOperation::Attach(vec![control], None), "Detach control of hips");
    let moved = TagOperation::Move { tags: vec![control], joint: left, before: None };
    check(&mut desk, moved, "Move control of hips");
    let of_right = tags(&desk, right);
    check(&mut desk, TagOperation::Delete(of_right), "Delete null of hand_r");
}

#[test]
fn steps_name_poses_clips_groups_and_sets() {
    let mut desk = Desk::new(HistoryPanel::default());
    let [hips, left] = desk.chain(&["hips", "hand_l"])[..] else { panic!() };
    let check = |desk: &mut Desk, operation: Operation, wanted: &str| {
        desk.edit(operation);
        assert_eq!(title(desk), wanted, "{:?}", desk.told());
    };
    let bent = PoseOffset::from_rotation(Quat::from_rotation_z(1.0));
    check(&mut desk, Operation::Pose(vec![(left, bent)]), "Pose hand_l");
    let mirrored = Operation::SetPose { name: "Mirror pose", offsets: vec![(hips, bent)], values: Vec::new() };
    check(&mut desk, mirrored, "Mirror pose of hips");
    check(&mut desk, Operation::StorePose("wave".to_owned()), "Store pose wave");
    let pose = desk.rig().stored_poses()[0].uid;
    check(&mut desk, Operation::ResetPose(vec![left]), "Reset hand_l");
    check(&mut desk, Operation::ApplyPose(pose), "Apply pose wave");
    check(&mut desk, Operation::RenamePose(pose, "hello".to_owned()), "Rename pose wave");
    check(&mut desk, Operation::DeletePose(pose), "Delete pose hello");

    let clip = RigClip { range: [0.0, 1.0], ..RigClip::new(Uid(70), Uid(71), "walk") };
    check(&mut desk, Operation::Clips(ClipOperation::Add(Box::new(clip))), "Add clip walk");
    let change = KeyOperation::Pose { time: 0.5, nodes: vec![hips, left] };
    let keys = ClipOperation::Keys { clip: Uid(70), layer: Uid(71), change };
    check(&mut desk, Operation::Clips(keys), "Set keys of hips and 1 more");
    let target = TrackTarget { node: left, property: Property::Rotation };
    let change = KeyOperation::Delete([(target, vec![0.5])].into());
    let keys = ClipOperation::Keys { clip: Uid(70), layer: Uid(71), change };
    check(&mut desk, Operation::Clips(keys), "Delete keys of hand_l");
    check(&mut desk, Operation::Clips(ClipOperation::Rename(Uid(70), "run".to_owned())), "Rename clip walk");
    check(&mut desk, Operation::Clips(ClipOperation::Delete(Uid(70))), "Delete clip run");

    let arms = Operation::Group { joints: vec![hips, left], name: "arms".into(), color: None };
    check(&mut desk, arms, "Group hips and 1 more in arms");
    let group: GroupData = desk.rig().groups()[0].clone();
    let edit = |group: GroupData| Operation::Edits(vec![RigEdit::SetLocalGroup(group)]);
    check(&mut desk, edit(GroupData { color: [0.1, 0.2, 0.3], ..group.clone() }), "Recolour group arms");
    let named = GroupData { name: "limbs".into(), color: [0.1, 0.2, 0.3], ..group.clone() };
    check(&mut desk, edit(named), "Rename group arms");
    check(&mut desk, Operation::Tags(TagOperation::EnableGroup(group.uid, false)), "Disable group limbs");
    let set = SelectionSet { name: "Both".to_owned(), nodes: vec![hips, left] };
    let store = |sets: Vec<SelectionSet>, name: &'static str| Operation::Named {
        name,
        edits: vec![RigEdit::SetSelectionSets(sets)],
    };
    check(&mut desk, store(vec![set], "Store selection set"), "Store selection set Both");
    check(&mut desk, store(Vec::new(), "Delete selection set"), "Delete selection set Both");
    check(&mut desk, Operation::Place { position: Vec3::ONE, parent: Some(left) }, "Place joint below hand_l");

    let mut horse = Rig::new(Uid(9), "horse");
    let joint = Box::new(JointData { uid: Uid(90), ..default() });
    horse.apply(&RigEdit::AddJoint { joint, parent: None, index: 0 }).unwrap();
    check(&mut desk, Operation::Merge { other: Arc::new(horse), parent: None }, "Merge rig horse");
}

/// Long names are cut, and nothing breaks the line.
#[test]
fn titles_are_short_and_of_one_line() {
    let mut desk = Desk::new(HistoryPanel::default());
    let name = format!("a\nlong {}", "label ".repeat(40));
    let [joint] = desk.chain(&[name.as_str()])[..] else { panic!() };
    let kind = command("control", "(size: 0.5)");
    desk.edit(Operation::Tags(TagOperation::Add { joints: vec![joint], kind, index: None }));
    let added = title(&desk);
    let tag = desk.rig().joint(joint).unwrap().data.tags[0].uid;
    desk.edit(Operation::Tags(TagOperation::Params(vec![(tag, "(size: 0.7)".to_owned())])));
    let set = title(&desk);
    assert!(added.starts_with("Add control to a") && set.starts_with("Set size of control of a"), "{added} {set}");
    for title in [added, set] {
        assert!(title.ends_with('…') && title.chars().count() < 80 && !title.contains('\n'), "{title:?}");
    }
}
