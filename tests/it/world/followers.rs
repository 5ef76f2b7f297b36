//! Entities that follow a document: an edit costs what it touches, whatever the size of the rig.

use bevy::prelude::*;
use rigsmith::{
    plugins::{
        document::{JointEntities, TagEntities},
        schema::TagOf,
    },
    prelude::*,
    rig::{JointData, TagData, TagKind},
};

use super::RigBench;

/// Number of rounds of edits.
const ROUNDS: usize = 20;

/// A command without effect on joints.
fn null_tag(uid: u64) -> TagData {
    let kind = TagKind::Command { module: "null".to_owned(), params: "(at: \"@this\")".to_owned(), feature: None };
    TagData { uid: Uid(uid), kind, enabled: true, comment: String::new() }
}

/// Entities of tags are those of the document's tags.
#[track_caller]
fn assert_tagged(stage: &RigBench) {
    let known = stage.get::<TagEntities>(stage.rig).unwrap();
    for joint in stage.rig().walk() {
        for tag in &joint.data.tags {
            let entity = known.get(tag.uid).unwrap();
            let bearer = stage.get::<TagOf>(entity).map(|of| of.0);
            assert_eq!(bearer, Some(stage.joint(joint.data.uid)), "tag {}", tag.uid);
        }
    }
}

/// Joints that are looked at when single joints of a chain, which all have a tag or none, are named, moved, joined by others
/// and undone.
fn visits(count: usize, is_tagged: bool) -> u64 {
    let mut stage = RigBench::new();
    stage.app.update();
    let places: Vec<[f32; 3]> = (0..count).map(|number| [0.0, 0.1 * number as f32, 0.0]).collect();
    let joints = stage.chain(&places);
    assert_eq!(joints.len(), count);
    if is_tagged {
        let tagged =
            |(joint, uid): (&Uid, u64)| RigEdit::AddTag { joint: *joint, tag: Box::new(null_tag(uid)), index: 0 };
        stage.apply_all(joints.iter().zip(0x7000..).map(tagged).collect());
        assert_tagged(&stage);
    }
    stage.frames(3);
    let looked_at = |stage: &RigBench| stage.get::<JointEntities>(stage.rig).unwrap().visits();
    let before = looked_at(&stage);
    for round in 0..ROUNDS {
        // Never the last joint, whose chain another joint would go on with.
        let joint = joints[round * (count - 2) / ROUNDS];
        stage.edit(Operation::Labels(vec![(joint, format!("name{round}"))]));
        let entity = stage.joint(joint);
        assert_eq!(stage.get::<Name>(entity).map(Name::as_str), Some(format!("name{round}").as_str()));
        let position = stage.rig().position(joint) + Vec3::X;
        stage.edit(Operation::Place { position, parent: Some(joint) });
        let added = *stage.rig().children(Some(joint)).last().unwrap();
        assert_eq!(stage.get::<ChildOf>(stage.joint(added)).map(ChildOf::parent), Some(entity));
        stage.frames(2);
        let is_even = round.is_multiple_of(2);
        if is_tagged {
            let tag = null_tag(0x9000 + round as u64);
            let uid = tag.uid;
            stage.apply(RigEdit::AddTag { joint: added, tag: Box::new(tag), index: 0 });
            assert_tagged(&stage);
            // The tag goes with its joint, or alone.
            if is_even {
                stage.apply(RigEdit::RemoveJoint(added));
            } else {
                stage.change(Change::Undo);
            }
            assert_eq!(stage.get::<TagEntities>(stage.rig).unwrap().get(uid), None);
        } else if is_even {
            stage.change(Change::Undo);
        }
        assert_eq!(stage.find(added).is_none(), is_even);
    }
    assert_tagged(&stage);
    assert_eq!(stage.rig().len(), count + ROUNDS / 2);
    looked_at(&stage) - before
}

#[test]
fn edits_of_single_joints_are_followed_by_these_alone() {
    for is_tagged in [false, true] {
        let visits = [100, 200, 400].map(|count| visits(count, is_tagged));
        for more in &visits[1..] {
            assert!(visits[0] > 0 && *more <= visits[0] + visits[0] / 10, "{is_tagged}: {visits:?}");
        }
    }
}

/// Siblings stand in the order of the document, wherever a joint comes among them.
#[test]
fn joints_come_among_their_siblings() {
    let mut stage = RigBench::new();
    let root = stage.chain(&[[0.0; 3]])[0];
    let mut added = Vec::new();
    for number in 0..12_u64 {
        let joint = JointData { uid: Uid(1000 - number), ..default() };
        added.push(joint.uid);
        // In the middle, and behind the first one.
        let index = if number.is_multiple_of(2) { added.len() / 2 } else { 1 };
        stage.apply(RigEdit::AddJoint { joint: Box::new(joint), parent: Some(root), index });
        assert_ordered(&stage, root);
    }
    for (number, joint) in added.iter().enumerate() {
        stage.apply(RigEdit::SetParent { joint: *joint, parent: Some(root), index: number * 5 % 12 });
        assert_ordered(&stage, root);
    }
    // Several steps in one frame, and all of them undone.
    for number in 0..6 {
        let edit = RigEdit::SetParent { joint: added[number], parent: Some(added[11 - number]), index: 0 };
        stage.app.world_mut().write_message(EditRequest::operation(stage.rig, Operation::Edits(vec![edit])));
    }
    stage.app.update();
    assert_ordered(&stage, root);
    while stage.steps() > 1 {
        stage.change(Change::Undo);
        assert_ordered(&stage, root);
    }
    assert_eq!(stage.rig().len(), 1);
}

/// Fails unless the entities below that of each joint stand as the document has them.
#[track_caller]
fn assert_ordered(stage: &RigBench, top: Uid) {
    for joint in stage.rig().hierarchy(top) {
        let children = stage.get::<Children>(stage.joint(joint.data.uid));
        let found: Vec<Entity> = children.map_or_else(Vec::new, |children| children.iter().collect());
        let wanted: Vec<Entity> = joint.children.iter().map(|child| stage.joint(*child)).collect();
        assert_eq!(found, wanted, "below {}", joint.data.uid);
    }
}
