//! Tags, features and parts: every operation does what it says, and is taken back to the bit.

mod clipboard;
mod features;
mod many;

use std::{path::Path, sync::Arc};

use bevy::prelude::*;
use proptest::prelude::*;
use rigsmith::plugins::document::{EditReport, EditRequest};
use rigsmith::processor::form::{FormElement, read_form};
use rigsmith::rig::{
    EditError, GroupData, JointData, Rig, RigEdit, TagData, TagKind, Uid, UidSource,
    feature::{FeatureKey, FeatureKind, FeatureKinds, FeatureState, combined_features, features_named, is_active},
    operations::{
        Operation, OperationError, Outcome, PartOrder, PasteContent, PasteTo, TagClipboard, TagError, TagOperation,
        TagScope,
    },
    reference::NameKind,
    template::write_template,
};

const HIPS: Uid = Uid(1);
const ARM_L: Uid = Uid(2);
const HAND_L: Uid = Uid(3);
const ARM_R: Uid = Uid(4);
const HAND_R: Uid = Uid(5);
const LEFT: Uid = Uid(0x10);
const RIGHT: Uid = Uid(0x11);
const IK_L: Uid = Uid(0x20);
const HANDLE_L: Uid = Uid(0x21);
const GRIP_L: Uid = Uid(0x22);
const IK_R: Uid = Uid(0x23);
const SPACE_R: Uid = Uid(0x24);

fn tag(uid: Uid, kind: TagKind) -> TagData {
    TagData { uid, enabled: true, comment: String::new(), kind }
}

fn command(uid: Uid, module: &str, params: &str, feature: Option<Uid>) -> TagData {
    tag(uid, TagKind::Command { module: module.into(), params: params.into(), feature })
}

fn feature(uid: Uid, kind: &str, name: &str, switch: &str) -> TagData {
    tag(uid, TagKind::Feature { kind: kind.into(), name: name.into(), switch: switch.into(), choice: String::new() })
}

fn add(rig: &mut Rig, joint: JointData, parent: Option<Uid>) {
    rig.apply(&RigEdit::AddJoint { joint: Box::new(joint), parent, index: 9 }).unwrap();
}

fn joint(uid: Uid, label: &str, group: Option<Uid>, mirror: Option<Uid>, tags: Vec<TagData>) -> JointData {
    JointData { uid, label: Some(label.into()), group, mirror, tags, ..Default::default() }
}

/// Hips with two arms; the left one has a feature, a handle that refers to much, and a control.
fn body() -> Rig {
    let mut rig = Rig::new(Uid(0xb0d4), "body");
    for (uid, name) in [(LEFT, "arm_l"), (RIGHT, "arm_r")] {
        let group = GroupData { uid, name: name.into(), color: [0.5; 3], enabled: true };
        rig.apply(&RigEdit::AddLocalGroup(group, 9)).unwrap();
    }
    add(&mut rig, joint(HIPS, "hips", None, None, vec![]), None);
    let handle = "(\n  root: \"@joint arm_l#0000000000000002\", // the arm\n  goal: \"@command grip_control#0000000000000022 + @joint hips#0000000000000001\",\n  all: \"@joints group:arm_l#0000000000000010 label:hand_l#0000000000000003\", label: \"elbow_l\",\n  local_group: \"0000000000000010\", side: 1.0)";
    let tags = vec![feature(IK_L, "ik", "IK arm", ""), command(HANDLE_L, "ik_handle", handle, Some(IK_L))];
    add(&mut rig, joint(ARM_L, "arm_l", Some(LEFT), Some(ARM_R), tags), Some(HIPS));
    let grip = command(GRIP_L, "control", "(name: \"grip_l\", space: \"@command handle#0000000000000021\")", None);
    add(&mut rig, joint(HAND_L, "hand_l", Some(LEFT), Some(HAND_R), vec![grip]), Some(ARM_L));
    let tags = vec![feature(IK_R, "ik", "IK arm", ""), command(SPACE_R, "space", "()", None)];
    add(&mut rig, joint(ARM_R, "arm_r", Some(RIGHT), Some(ARM_L), tags), Some(HIPS));
    add(&mut rig, joint(HAND_R, "hand_r", Some(RIGHT), Some(HAND_L), vec![]), Some(ARM_R));
    rig
}

/// Runs an operation and checks that it is taken back and done again to the bit, or changes nothing if refused.
#[track_caller]
fn run(rig: &mut Rig, uids: &mut UidSource, operation: TagOperation) -> Result<Outcome, OperationError> {
    let (before, text) = (rig.clone(), write_template(rig));
    let operation = Operation::Tags(operation);
    let done = operation.run(rig, uids, None);
    let after = rig.clone();
    match &done {
        Err(_) => assert_eq!(*rig, before, "refused, but changed by {operation:?}"),
        Ok(outcome) => {
            outcome.inverses.iter().for_each(|inverse| drop(rig.apply(inverse).unwrap()));
            assert_eq!(*rig, before, "not taken back: {operation:?}");
            assert_eq!(write_template(rig), text, "not taken back: {operation:?}");
            outcome.edits.iter().for_each(|edit| drop(rig.apply(edit).unwrap()));
            assert_eq!(*rig, after, "not done again: {operation:?}");
        }
    }
    done
}

struct Desk {
    rig: Rig,
    uids: UidSource,
}

impl Desk {
    fn new() -> Self {
        Self { rig: body(), uids: UidSource::seeded(8) }
    }

    #[track_caller]
    fn run(&mut self, operation: TagOperation) -> Outcome {
        run(&mut self.rig, &mut self.uids, operation).unwrap()
    }

    #[track_caller]
    fn refusal(&mut self, operation: TagOperation) -> OperationError {
        run(&mut self.rig, &mut self.uids, operation).unwrap_err()
    }

    fn tags(&self, joint: Uid) -> Vec<Uid> {
        self.rig.joint(joint).unwrap().data.tags.iter().map(|tag| tag.uid).collect()
    }

    fn tag(&self, tag: Uid) -> &TagData {
        self.rig.find_tag(tag).unwrap().1
    }

    fn params(&self, tag: Uid) -> &str {
        let TagKind::Command { params, .. } = &self.tag(tag).kind else { panic!("{tag} is no command") };
        params
    }

    fn feature_of(&self, tag: Uid) -> Option<Uid> {
        let TagKind::Command { feature, .. } = &self.tag(tag).kind else { panic!("{tag} is no command") };
        *feature
    }

    fn paste(&mut self, clipboard: &TagClipboard, what: PasteContent, to: PasteTo) -> Vec<String> {
        self.run(TagOperation::Paste { clipboard: Arc::new(clipboard.clone()), what, to }).notes
    }
}

#[test]
fn tags_are_added_changed_and_deleted() {
    let mut desk = Desk::new();
    let aim = |params: &str| TagKind::Command { module: "aim".into(), params: params.into(), feature: None };
    desk.run(TagOperation::Add { joints: vec![HIPS, ARM_L], kind: aim("(t: \"@joint hand_r\")"), index: Some(0) });
    let (first, second) = (desk.tags(HIPS)[0], desk.tags(ARM_L)[0]);
    assert_ne!(first, second);
    assert_eq!(desk.params(second), "(t: \"@joint hand_r#0000000000000005\")");
    assert_eq!(desk.tags(ARM_L), [second, IK_L, HANDLE_L]);
    let error =
        desk.refusal(TagOperation::Add { joints: vec![HIPS], kind: aim("(t: \"@joint hnad_r\")"), index: None });
    assert!(error.to_string().contains("byte 4") && error.to_string().contains("did you mean \"hand_r\""), "{error}");
    let error = desk.refusal(TagOperation::Params(vec![(first, "(".into())]));
    assert!(matches!(error, OperationError::Edit(EditError::BadParams(..))), "{error}");

    desk.run(TagOperation::Params(vec![(first, "(1, \"@command control\")".into())]));
    assert_eq!(desk.params(first), "(1, \"@command control/hand_l#0000000000000022\")");
    desk.run(TagOperation::Comment(first, "looks".into()));
    desk.run(TagOperation::Enable(vec![first, IK_L], false));
    assert!(desk.tag(first).comment == "looks" && !desk.tag(first).enabled && !desk.tag(IK_L).enabled);
    assert_eq!(desk.run(TagOperation::Enable(vec![first, IK_L], false)).edits, [], "nothing to do is no edit");
    desk.run(TagOperation::Feature { tag: IK_L, kind: "limb".into(), name: "Arm".into(), switch: "bendy".into() });
    assert_eq!(desk.tag(IK_L).kind, feature(IK_L, "limb", "Arm", "bendy").kind);

    desk.run(TagOperation::Attach(vec![first, GRIP_L], Some(IK_R)));
    assert_eq!((desk.feature_of(first), desk.feature_of(GRIP_L)), (Some(IK_R), Some(IK_R)), "on another joint");
    desk.run(TagOperation::Attach(vec![GRIP_L], None));
    assert_eq!(desk.feature_of(GRIP_L), None);
    desk.run(TagOperation::Delete(vec![IK_R, GRIP_L]));
    assert_eq!((desk.feature_of(first), desk.tags(ARM_R)), (None, vec![SPACE_R]));

    for (operation, error) in [
        (TagOperation::Delete(vec![HANDLE_L, GRIP_L]), TagError::NoTag(GRIP_L)),
        (TagOperation::Comment(Uid(9), String::new()), TagError::NoTag(Uid(9))),
        (TagOperation::Params(vec![(IK_L, "()".into())]), TagError::NotCommand(IK_L)),
        (TagOperation::Attach(vec![IK_L], Some(IK_L)), TagError::NotCommand(IK_L)),
        (TagOperation::Attach(vec![HANDLE_L], Some(SPACE_R)), TagError::NotFeature(SPACE_R)),
        (
            TagOperation::Feature { tag: HANDLE_L, kind: "a".into(), name: "b".into(), switch: "c".into() },
            TagError::NotFeature(HANDLE_L),
        ),
    ] {
        assert_eq!(desk.refusal(operation.clone()), error.into(), "{operation:?}");
    }
}

#[test]
fn tags_are_moved_within_and_between_joints() {
    let relocate = |tags: &[Uid], joint, before| TagOperation::Move { tags: tags.to_vec(), joint, before };
    for (tags, joint, before, left, hips) in [
        (&[IK_L][..], ARM_L, None, &[HANDLE_L, IK_L][..], &[][..]),
        (&[HANDLE_L], ARM_L, Some(IK_L), &[HANDLE_L, IK_L], &[]),
        (&[IK_L], ARM_L, Some(HANDLE_L), &[IK_L, HANDLE_L], &[]),
        (&[IK_L], ARM_L, Some(IK_L), &[IK_L, HANDLE_L], &[]),
        (&[HANDLE_L, IK_L], ARM_L, Some(IK_L), &[HANDLE_L, IK_L], &[]),
        (&[GRIP_L, SPACE_R], ARM_L, Some(HANDLE_L), &[IK_L, GRIP_L, SPACE_R, HANDLE_L], &[]),
        (&[HANDLE_L, GRIP_L, IK_L], HIPS, None, &[], &[HANDLE_L, GRIP_L, IK_L]),
    ] {
        let mut desk = Desk::new();
        desk.run(relocate(tags, joint, before));
        assert_eq!((&desk.tags(ARM_L)[..], &desk.tags(HIPS)[..]), (left, hips), "{tags:?} before {before:?}");
        assert_eq!(desk.feature_of(HANDLE_L), Some(IK_L));
    }
    let mut desk = Desk::new();
    assert_eq!(desk.refusal(relocate(&[Uid(9)], HIPS, None)), TagError::NoTag(Uid(9)).into());
    assert_eq!(desk.refusal(relocate(&[IK_L], Uid(9), None)), EditError::NoJoint(Uid(9)).into());
    assert_eq!(desk.refusal(relocate(&[IK_L], HIPS, Some(IK_R))), EditError::NoTag(HIPS, IK_R).into());
}

fn copy(rig: &Rig, scope: TagScope, identifiers: bool) -> TagClipboard {
    let clipboard = TagClipboard::copy(rig, &scope, identifiers, |_| true).unwrap();
    assert_eq!(TagClipboard::from_text(&clipboard.to_text()), Ok(clipboard.clone()), "through the system's clipboard");
    clipboard
}

/// A part with three joints in a group, a feature, and references to joints, commands, groups and labels.
fn part() -> Rig {
    let mut rig = Rig::new(Uid(0xaaa), "arm part");
    let group = GroupData { uid: Uid(0xa0), name: "arm".into(), color: [0.1; 3], enabled: true };
    rig.apply(&RigEdit::AddLocalGroup(group, 0)).unwrap();
    let tags = vec![
        feature(Uid(0xf0), "ik", "IK", ""),
        command(
            Uid(0xc0),
            "ik_handle",
            "(a: \"@joint upper#00000000000000e0 + @joint lower#00000000000000e1\", b: \"@joints group:arm#00000000000000a0 label:upper#00000000000000e0\", c: \"@command control#00000000000000c1 rig:arm_part#0000000000000aaa\")",
            Some(Uid(0xf0)),
        ),
    ];
    add(&mut rig, joint(Uid(0xe0), "upper", Some(Uid(0xa0)), None, tags), None);
    let tags = vec![command(Uid(0xc1), "control", "(t: \"@joint end#00000000000000e2\")", None)];
    add(&mut rig, joint(Uid(0xe1), "lower", Some(Uid(0xa0)), None, tags), Some(Uid(0xe0)));
    add(&mut rig, joint(Uid(0xe2), "end", None, None, vec![command(Uid(0xc2), "null", "()", None)]), Some(Uid(0xe1)));
    rig
}

#[test]
fn a_part_is_dropped_onto_a_chain_until_either_list_ends() {
    let drop_on = |joints: &[Uid]| TagOperation::Drop {
        part: Arc::new(part().into()),
        joints: joints.to_vec(),
        bindings: [].into(),
    };
    let mut desk = Desk::new();
    for (bare, parent) in [(0x50, HIPS), (0x51, Uid(0x50)), (0x52, Uid(0x51)), (0x53, Uid(0x52))] {
        add(&mut desk.rig, JointData { uid: Uid(bare), ..Default::default() }, Some(parent));
    }
    let notes = desk.run(drop_on(&[Uid(0x50), Uid(0x51), Uid(0x52), Uid(0x53)])).notes;
    assert_eq!(notes, ["1 selected joint is left over: the part has only 3"]);
    let [ik, handle] = desk.tags(Uid(0x50))[..] else { panic!() };
    let control = desk.tags(Uid(0x51))[0];
    let group = desk.rig.joint(Uid(0x51)).unwrap().data.group.unwrap();
    assert_eq!(desk.rig.group(group).unwrap().name, "arm", "created");
    assert_eq!(desk.rig.joint(Uid(0x50)).unwrap().data.group, Some(group));
    assert_eq!(desk.rig.joint(Uid(0x52)).unwrap().data.group, None, "the part's joint is in none");
    assert_eq!(desk.feature_of(handle), Some(ik));
    let expected = format!(
        "(a: \"@joint upper#0000000000000050 + @joint lower#0000000000000051\", b: \"@joints group:arm#{group} label:upper#0000000000000050\", c: \"@command control/lower#{control}\")"
    );
    assert_eq!(desk.params(handle), expected);
    assert_eq!(desk.params(control), "(t: \"@joint end#0000000000000052\")");

    // Joints that are named and grouped stay so, and a second arm is another group.
    let mut desk = Desk::new();
    let tip = JointData { uid: Uid(0x54), label: Some("tip_r".into()), ..Default::default() };
    add(&mut desk.rig, tip, Some(HAND_R));
    desk.run(drop_on(&[ARM_R, HAND_R, Uid(0x54)]));
    assert_eq!(desk.rig.groups().len(), 2);
    let handle = *desk.tags(ARM_R).last().unwrap();
    let start = "(a: \"@joint arm_r#0000000000000004 + @joint hand_r#0000000000000005\", b: \"@joints group:arm_r#0000000000000011 label:arm_r#";
    assert!(desk.params(handle).starts_with(start), "{}", desk.params(handle));

    // Fewer joints than the part needs: it says which, and nothing changes.
    let before = desk.rig.clone();
    let needs = |given| TagError::PartNeeds {
        part: "arm part".into(),
        joints: vec!["upper".into(), "lower".into(), "end".into()],
        given,
    };
    assert_eq!(desk.refusal(drop_on(&[ARM_L])), needs(1).into());
    assert_eq!(desk.refusal(drop_on(&[ARM_L, HAND_L])), needs(2).into());
    assert!(desk.rig == before, "a refused part changes nothing");
    assert!(needs(2).to_string().contains("needs 3 joints, from the first on upper, lower, end; it gets 2:"));

    // A joint that is left out is found by its label, if the rig has it; the last joint's own tags are extras.
    desk.rig.apply(&RigEdit::SetLabel(HIPS, Some("end".into()))).unwrap();
    let notes = desk.run(drop_on(&[ARM_L, HAND_L])).notes;
    assert!(notes.iter().any(|note| note.contains("1 joint of the part is left over")), "{notes:?}");
    let control = *desk.tags(HAND_L).last().unwrap();
    assert!(desk.params(control).contains("@joint end#0000000000000001"), "{}", desk.params(control));

    // Two joints with the label: it is asked which.
    desk.rig.apply(&RigEdit::SetLabel(HAND_R, Some("end".into()))).unwrap();
    let error = desk.refusal(drop_on(&[ARM_L, HAND_L]));
    let candidates = vec![HIPS, HAND_R];
    let ambiguous = TagError::Ambiguous { kind: NameKind::Joint, uid: Uid(0xe2), name: "end".into(), candidates };
    assert_eq!(error, ambiguous.into());
    let bindings = [(Uid(0xe2), HAND_R)].into();
    desk.run(TagOperation::Drop { part: Arc::new(part().into()), joints: vec![ARM_L, HAND_L], bindings });
    let control = *desk.tags(HAND_L).last().unwrap();
    assert!(desk.params(control).contains("@joint end#0000000000000005"), "{}", desk.params(control));
    assert_eq!(desk.refusal(drop_on(&[])), TagError::NoTarget.into());

    // A joint twice, and joints that hang on each other otherwise than the part's.
    let error = desk.refusal(drop_on(&[ARM_R, HAND_R, HAND_R]));
    assert_eq!(error, TagError::JointTwice { part: "arm part".into(), joint: "end".into() }.into());
    assert_eq!(error.to_string(), "\"end\" is given twice for the part \"arm part\"; give each joint once");
    let order = |joint: &str, parent: &str, onto: &str, above: &str| {
        TagError::PartOrder(Box::new(PartOrder {
            part: "arm part".into(),
            joint: joint.into(),
            parent: parent.into(),
            onto: onto.into(),
            above: above.into(),
            joints: vec!["upper".into(), "lower".into(), "end".into()],
        }))
    };
    let error = desk.refusal(drop_on(&[Uid(0x54), HAND_R, ARM_R]));
    assert_eq!(error, order("lower", "upper", "end", "tip_r").into());
    assert!(error.to_string().contains("give joints that follow each other as upper, lower, end"), "{error}");
    let error = desk.refusal(drop_on(&[ARM_R, Uid(0x54), HAND_R]));
    assert_eq!(error, order("lower", "upper", "tip_r", "arm_r").into());
    assert_eq!(desk.refusal(drop_on(&[ARM_L, HAND_R, Uid(0x54)])), order("lower", "upper", "end", "arm_l").into());
    assert_eq!(desk.refusal(drop_on(&[HIPS, Uid(9)])), EditError::NoJoint(Uid(9)).into());
}

/// A random operation: kind, and three numbers that choose among what there is.
fn random_operation(rig: &Rig, copied: &mut TagClipboard, (kind, a, b, c): (u8, u16, u16, u16)) -> TagOperation {
    let joints: Vec<Uid> = rig.walk().map(|joint| joint.data.uid).chain([Uid(9)]).collect();
    let tags: Vec<Uid> = rig.walk().flat_map(|joint| &joint.data.tags).map(|tag| tag.uid).chain([Uid(9)]).collect();
    let joint = |n: u16| joints[usize::from(n) % joints.len()];
    let tag = |n: u16| tags[usize::from(n) % tags.len()];
    let odd = c % 2 == 1;
    let params = format!("(t: \"@command #{} + @joint #{} group:#{}\", u: \"{LEFT}\")", tag(a), joint(b), RIGHT);
    let name = ["", "IK", "IK_l", "left"][usize::from(b) % 4].to_owned();
    let key =
        FeatureKey { group: [None, Some(LEFT), Some(RIGHT)][usize::from(a) % 3], kind: "ik".into(), name: "IK".into() };
    let what = [PasteContent::Tags, PasteContent::Values, PasteContent::Both][usize::from(c) % 3];
    let feature =
        TagKind::Feature { kind: "ik".into(), name: name.clone(), switch: name.clone(), choice: String::new() };
    match kind % 14 {
        0 => TagOperation::Add { joints: vec![joint(a), joint(b)], kind: feature, index: Some(usize::from(c % 3)) },
        1 | 2 => {
            let kind = TagKind::Command { module: "m".into(), params, feature: odd.then(|| tag(c)) };
            TagOperation::Add { joints: vec![joint(a)], kind, index: None }
        }
        3 => TagOperation::Delete(vec![tag(a)]),
        4 => TagOperation::Enable(vec![tag(a), tag(b)], odd),
        5 => TagOperation::Move { tags: vec![tag(a), tag(b)], joint: joint(c), before: odd.then(|| tag(c)) },
        6 => TagOperation::Params(vec![(tag(a), params)]),
        7 => TagOperation::Attach(vec![tag(a)], odd.then(|| tag(b))),
        8 => {
            let scope = match a % 3 {
                0 => TagScope::Hierarchy(vec![joint(b)]),
                1 => TagScope::Joints(vec![joint(b), joint(c)]),
                _ => TagScope::Group(LEFT),
            };
            *copied = TagClipboard::copy(rig, &scope, odd, |tag| tag.enabled).unwrap_or_default();
            TagOperation::Cut(Arc::new(copied.clone()))
        }
        9 | 10 => TagOperation::Paste {
            clipboard: Arc::new(copied.clone()),
            what,
            to: PasteTo::Joints(vec![joint(a), joint(b)]),
        },
        11 => TagOperation::Paste { clipboard: Arc::new(copied.clone()), what, to: PasteTo::Mirror },
        12 => {
            TagOperation::Drop { part: Arc::new(part().into()), joints: vec![joint(a), joint(b)], bindings: [].into() }
        }
        _ => match b % 4 {
            0 => TagOperation::SetFeature(key, odd),
            1 => TagOperation::SetSwitch(key, name, odd),
            2 => TagOperation::ChooseSwitch(key, name),
            _ => TagOperation::EnableGroup(LEFT, odd),
        },
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn every_operation_on_tags_is_taken_back_exactly(
        steps in proptest::collection::vec(any::<(u8, u16, u16, u16)>(), 1..30),
    ) {
        let mut desk = Desk::new();
        let mut copied = copy(&desk.rig, TagScope::Hierarchy(vec![ARM_L]), true);
        for step in steps {
            let operation = random_operation(&desk.rig, &mut copied, step);
            let _ = run(&mut desk.rig, &mut desk.uids, operation);
            prop_assert!(copied.is_empty() || TagClipboard::from_text(&copied.to_text()).as_ref() == Ok(&copied));
            let tags: Vec<Uid> = desk.rig.walk().flat_map(|joint| &joint.data.tags).map(|tag| tag.uid).collect();
            prop_assert!(tags.iter().all(|tag| desk.rig.find_tag(*tag).is_some_and(|(_, found)| found.uid == *tag)));
        }
    }
}

#[test]
fn random_operations_do_something() {
    let mut desk = Desk::new();
    let mut copied = copy(&desk.rig, TagScope::Hierarchy(vec![ARM_L]), true);
    let mut numbers = UidSource::seeded(21);
    let mut done = std::collections::BTreeSet::new();
    for _ in 0..600 {
        let mut number = || numbers.next_uid().0 as u16;
        let step = ((number() % 251) as u8, number(), number(), number());
        let operation = random_operation(&desk.rig, &mut copied, step);
        let name = operation.name();
        if run(&mut desk.rig, &mut desk.uids, operation).is_ok_and(|outcome| !outcome.edits.is_empty()) {
            done.insert(name);
        }
        if desk.rig.walk().map(|joint| joint.data.tags.len()).sum::<usize>() > 200 {
            desk = Desk::new();
        }
    }
    assert!(done.len() >= 15, "{done:?}");
}

#[test]
fn notes_reach_those_who_asked_and_kinds_are_a_resource() {
    let mut app = rigsmith::test_app::test_app();
    let rig = app.world_mut().spawn(body()).id();
    app.world_mut().resource_mut::<FeatureKinds>().register(FeatureKind::new("wing", "Wing", "Feathers."));
    let clipboard = Arc::new(copy(&body(), TagScope::Joints(vec![ARM_L, HAND_L]), false));
    let to = PasteTo::Joints(vec![HIPS]);
    let paste = Operation::Tags(TagOperation::Paste { clipboard, what: PasteContent::Both, to });
    app.world_mut().write_message(EditRequest::operation(rig, paste));
    app.update();
    let edited: Vec<EditReport> = app.world_mut().resource_mut::<Messages<EditReport>>().drain().collect();
    assert!(edited[0].name == "Paste tags" && edited[0].notes[0].contains("1 copied joint "), "{edited:?}");
    let names: Vec<_> = app.world().resource::<FeatureKinds>().iter().map(|kind| kind.name.clone()).collect();
    assert!(names.contains(&"wing".to_owned()) && names.contains(&"ik".to_owned()), "{names:?}");
}
