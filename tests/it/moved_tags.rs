//! Tags that move to another joint: one edit, with the pose, the attribute values and the keys of what their commands made.

use std::{collections::BTreeMap, sync::Arc};

use bevy::prelude::*;
use rigsmith::{
    modules,
    plugins::{
        commands::{BuildStep, TagEntities, TagOf},
        document::{Change, JointEntities},
    },
    processor::{Builder, keep_clips, keep_poses},
    rig::{
        PoseOffset, Rig, RigEdit, StoredPose, Uid,
        animation::{Key, Property, RigClip, TrackTarget},
        operations::{Operation, PasteContent, PasteTo, TagClipboard, TagOperation},
        update::{Change as TemplateChange, ChangeKind, Take, clip_edits, diff, edits_between, pose_edits, update},
    },
};

use crate::{
    bench::RigBench,
    template_text::{apply, read},
};

const TAG: Uid = Uid(0xC1);
const CLIP: Uid = Uid(0xC11);
const LAYER: Uid = Uid(0xC12);
const STORED: Uid = Uid(0xC13);

/// Two chains, with a control on one of the four joints and an attribute on that control.
pub(super) fn template(bearer: &str, more: &str) -> Rig {
    let joint = |label: &str, parent: &str| {
        let own = format!(
            "control(uid: \"{TAG}\", at: \"@hierarchy this\"{more}), attribute(uid: \"00000000000000c2\", \
             node: \"@command control/{label}#{TAG} role:control pick:START\", name: \"amount\", default: 0.5)"
        );
        let tags = if label == bearer { own.as_str() } else { "" };
        format!("(label: \"{label}\", {parent}translation: (0, 1, 0), tags: [{tags}])")
    };
    let joints = [joint("a", ""), joint("a_tip", "parent: \"a\", "), joint("b", ""), joint("b_tip", "parent: \"b\", ")];
    read(&format!("(format: 2, name: \"moved\", joints: [{}])", joints.join(", ")))
}

/// Controls of a rig by the labels of their joints.
pub(super) fn control(rig: &Rig, label: &str) -> Uid {
    let joint = rig.find_label(label).unwrap();
    let built = Builder::build(rig, &Arc::new(modules::all())).unwrap();
    let is_it = |node: &&rigsmith::rig::BuiltNode| {
        node.origin.as_ref().is_some_and(|origin| &*origin.role == "control" && origin.subject == joint)
    };
    built.nodes.iter().find(is_it).unwrap_or_else(|| panic!("{label} has no control")).uid
}

pub(super) fn turned(angle: f32) -> PoseOffset {
    PoseOffset::from_rotation(Quat::from_rotation_x(angle))
}

pub(super) fn target(node: Uid) -> TrackTarget {
    TrackTarget { node, property: Property::Rotation }
}

/// The controls of chain `a` posed, stored and animated.
fn animated(mut rig: Rig) -> Rig {
    let (root, tip) = (control(&rig, "a"), control(&rig, "a_tip"));
    apply(&mut rig, RigEdit::SetOffset(root, Some(turned(0.4))));
    apply(&mut rig, RigEdit::SetOffset(tip, Some(turned(0.2))));
    apply(&mut rig, RigEdit::SetAttributeValue(root, "amount".into(), Some(0.75)));
    let stored = StoredPose {
        uid: STORED,
        name: "bent".into(),
        offsets: BTreeMap::from([(root, turned(0.6))]),
        values: BTreeMap::from([(root, BTreeMap::from([("amount".to_owned(), 0.25)]))]),
    };
    apply(&mut rig, RigEdit::AddStoredPose(Box::new(stored), 0));
    apply(&mut rig, RigEdit::AddClip(Box::new(RigClip::new(CLIP, LAYER, "walk")), 0));
    for node in [root, tip] {
        let keys = [0.0, 0.5, 1.0].map(|time| Key::rotation(time, Quat::from_rotation_x(time)));
        apply(
            &mut rig,
            RigEdit::SetKeys {
                clip: CLIP,
                layer: LAYER,
                target: target(node),
                removed: Vec::new(),
                inserted: keys.to_vec(),
            },
        );
    }
    rig
}

/// Checks that what chain `a` of the first rig had, chain `b` of the second one has, and nothing else is stored.
#[track_caller]
fn check_carried(before: &Rig, after: &Rig) {
    let chain = |rig: &Rig, labels: [&str; 2]| labels.map(|label| control(rig, label));
    let (was, is) = (chain(before, ["a", "a_tip"]), chain(after, ["b", "b_tip"]));
    assert!(was.iter().all(|node| !is.contains(node)), "another joint gives another uid");
    let [stored, kept] = [before, after].map(|rig| rig.stored_pose(STORED).unwrap());
    let [clip, moved] = [before, after].map(|rig| &rig.clip(CLIP).unwrap().layers[0].tracks);
    for (was, is) in was.into_iter().zip(is) {
        assert_eq!(after.offset(is), before.offset(was));
        assert_eq!(after.attribute_values().get(&is), before.attribute_values().get(&was));
        assert_eq!(kept.offsets.get(&is), stored.offsets.get(&was));
        assert_eq!(kept.values.get(&is), stored.values.get(&was));
        assert_eq!(moved.get(&target(is)).map(|track| &track.keys), clip.get(&target(was)).map(|track| &track.keys));
        assert!(clip.contains_key(&target(was)));
    }
    let counts = |rig: &Rig| (rig.pose().len(), rig.attribute_values().len(), rig.clip(CLIP).unwrap().key_count());
    assert_eq!(counts(after), counts(before), "nothing stays at the former nodes");
}

#[test]
fn a_tag_moves_in_one_edit_with_an_exact_inverse() {
    let before = template("a", "");
    let [a, b] = ["a", "b"].map(|label| before.find_label(label).unwrap());
    let mut rig = before.clone();
    let back = rig.apply(&RigEdit::MoveTag { tag: TAG, joint: b, index: 9 }).unwrap();
    assert_eq!(back, RigEdit::MoveTag { tag: TAG, joint: a, index: 0 });
    assert_eq!(rig.find_tag(TAG).unwrap().0.data.uid, b);
    apply(&mut rig, back);
    assert_eq!(rig, before);
    // Refused moves change nothing.
    for (tag, joint) in [(TAG, Uid(9)), (Uid(9), b)] {
        assert!(rig.apply(&RigEdit::MoveTag { tag, joint, index: 0 }).is_err());
    }
    assert_eq!(rig, before);
}

#[test]
fn what_is_stored_of_nodes_is_exchanged_exactly() {
    let before = animated(template("a", ""));
    let nodes = ["a", "a_tip"].map(|label| control(&before, label));
    let mut rig = before.clone();
    let back = rig.apply(&RigEdit::ExchangeNodes(vec![(nodes[0], Uid(7)), (nodes[1], nodes[0])])).unwrap();
    assert_eq!(rig.offset(Uid(7)), before.offset(nodes[0]));
    assert_eq!(rig.offset(nodes[0]), before.offset(nodes[1]));
    assert_eq!(rig.offset(nodes[1]), None);
    apply(&mut rig, back);
    assert_eq!(rig, before);
}

#[test]
fn a_file_that_moves_a_tag_takes_poses_and_keys_along() {
    let base = template("a", "");
    let now = animated(base.clone());
    let file = template("b", ", shape: \"cube\"");
    let told: Vec<TemplateChange> = diff(&base, &file);
    let kinds: Vec<ChangeKind> = told.iter().map(|change| change.kind).collect();
    assert_eq!(kinds.iter().filter(|kind| **kind == ChangeKind::Moved).count(), 2, "{told:?}");
    assert!(!kinds.contains(&ChangeKind::Added) && !kinds.contains(&ChangeKind::Removed), "{told:?}");
    assert!(told[0].to_string().starts_with("moved    control: from a"), "{}", told[0]);

    let mut updated = update(Some(&base), &now, &file, Take::Mine).rig;
    let modules = Arc::new(modules::all());
    keep_poses(&now, &mut updated, &modules).unwrap();
    let report = keep_clips(&now, &mut updated, &modules).unwrap();
    assert!(report.set_aside.is_empty(), "{report:?}");
    check_carried(&now, &updated);
    let (bearer, tag) = updated.find_tag(TAG).unwrap();
    assert_eq!((bearer.data.label.as_deref(), bearer.data.tags.len()), (Some("b"), 2));
    assert!(format!("{tag:?}").contains("cube"));

    // The edits of it do the same, move and do not remove, and can be taken back.
    let mut edits = edits_between(&now, &updated).unwrap();
    assert!(edits.iter().all(|edit| !matches!(edit, RigEdit::RemoveTag(..) | RigEdit::AddTag { .. })), "{edits:?}");
    edits.extend(pose_edits(&now, &updated));
    edits.extend(clip_edits(&now, &updated).unwrap());
    let stored = |rig: &Rig| rig.stored_pose(STORED).cloned();
    let mut rig = now.clone();
    let back = rig.apply(&RigEdit::Batch(edits)).unwrap();
    assert_eq!((&rig, stored(&rig)), (&updated, stored(&updated)));
    apply(&mut rig, back);
    assert_eq!(rig, now);
}

#[test]
fn both_sides_moving_a_tag_is_a_choice() {
    let base = template("a", "");
    let (mine, theirs) = (template("a_tip", ""), template("b", ""));
    let bearer = |take: Take| {
        let updated = update(Some(&base), &mine, &theirs, take);
        let conflict = updated.changes.iter().find(|change| change.uid == TAG).unwrap();
        assert!(conflict.conflict && conflict.kind == ChangeKind::Moved, "{conflict:?}");
        let (bearer, _) = updated.rig.find_tag(TAG).unwrap();
        bearer.data.label.clone().unwrap()
    };
    assert_eq!((bearer(Take::Mine), bearer(Take::Theirs)), ("a_tip".to_owned(), "b".to_owned()));
    // One side alone is no conflict: what a person moved stays there, with what the file changed of it.
    let updated = update(Some(&base), &mine, &template("a", ", shape: \"cube\""), Take::Mine);
    assert_eq!(updated.conflicts(), 0, "{:?}", updated.changes);
    let (bearer, tag) = updated.rig.find_tag(TAG).unwrap();
    assert_eq!(bearer.data.label.as_deref(), Some("a_tip"));
    assert!(format!("{tag:?}").contains("cube"));
    // A joint that comes with the file gets the tag that moves to it.
    let without = |rig: &Rig| {
        let mut rig = rig.clone();
        for label in ["b_tip", "b"] {
            let joint = rig.find_label(label).unwrap();
            apply(&mut rig, RigEdit::RemoveJoint(joint));
        }
        rig
    };
    let small = without(&base);
    let updated = update(Some(&small), &small, &theirs, Take::Mine);
    assert_eq!(updated.rig.find_tag(TAG).unwrap().0.data.label.as_deref(), Some("b"));
    let mut rig = small.clone();
    let back = rig.apply(&RigEdit::Batch(edits_between(&small, &updated.rig).unwrap())).unwrap();
    assert_eq!(rig, updated.rig);
    apply(&mut rig, back);
    assert_eq!(rig, small);
}

/// Moves of the tags of `a` to `b` in the window, all of them undone.
#[test]
fn the_window_takes_poses_and_keys_along() {
    let before = animated(template("a", ""));
    let [a, b] = ["a", "b"].map(|label| before.find_label(label).unwrap());
    let tags: Vec<Uid> = before.joint(a).unwrap().data.tags.iter().map(|tag| tag.uid).collect();
    let mut bench = RigBench::of(before.clone());
    bench.step(BuildStep::All);

    // Dragged, or moved by a key.
    bench.edit(Operation::Tags(TagOperation::Move { tags: tags.clone(), joint: b, before: None }));
    check_carried(&before, bench.rig());
    assert_eq!(bench.steps(), 1, "one step");
    bench.change(Change::Undo);
    assert_eq!(bench.rig(), &before);
    bench.change(Change::Redo);
    check_carried(&before, bench.rig());
    bench.change(Change::Undo);

    // Cut and pasted: the tags are the same ones.
    let clipboard = Arc::new(TagClipboard::copy_tags(&before, &tags).unwrap());
    bench.edit(Operation::Tags(TagOperation::Cut(clipboard.clone())));
    assert!(bench.rig().find_tag(TAG).is_none());
    let paste = TagOperation::Paste { clipboard, what: PasteContent::Both, to: PasteTo::Joints(vec![b]) };
    bench.edit(Operation::Tags(paste.clone()));
    assert_eq!(bench.rig().find_tag(TAG).unwrap().0.data.uid, b);
    check_carried(&before, bench.rig());
    // Once more they are copies.
    bench.edit(Operation::Tags(paste));
    assert_eq!(bench.rig().joint(b).unwrap().data.tags.len(), 4);
    check_carried_keys_stay(&before, bench.rig());
    for _ in 0..3 {
        bench.change(Change::Undo);
    }
    assert_eq!(bench.rig(), &before);

    // The entity of the tag on another joint.
    let of = bench.get::<JointEntities>(bench.rig).unwrap().get(b).unwrap();
    for tag in tags {
        let entity = bench.get::<TagEntities>(bench.rig).unwrap().get(tag).unwrap();
        bench.app.world_mut().entity_mut(entity).insert(TagOf(of));
    }
    bench.frames(2);
    check_carried(&before, bench.rig());
    bench.change(Change::Undo);
    assert_eq!(bench.rig(), &before);
}

/// Checks that another copy of a tag leaves the keys where they are.
#[track_caller]
fn check_carried_keys_stay(before: &Rig, after: &Rig) {
    let nodes = after.clip(CLIP).unwrap().nodes();
    assert_eq!(nodes.len(), before.clip(CLIP).unwrap().nodes().len());
    let own = Builder::build(after, &Arc::new(modules::all())).unwrap();
    for node in nodes {
        let origin = own.node(node).and_then(|node| node.origin.as_ref()).unwrap_or_else(|| panic!("{node} is gone"));
        assert_eq!(origin.command, TAG);
    }
}
