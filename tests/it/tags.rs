//! Tags, features and parts: every operation does what it says, and is taken back to the bit.

use std::{path::Path, sync::Arc};

use bevy::prelude::*;
use proptest::prelude::*;
use rigsmith::plugins::document::{EditReport, EditRequest};
use rigsmith::processor::form::{FormElement, read_form};
use rigsmith::rig::{
    EditError, GroupData, JointData, Rig, RigEdit, TagData, TagKind, Uid, UidSource,
    feature::{FeatureKey, FeatureKind, FeatureKinds, FeatureState, combined_features, features_named, is_active},
    operations::{
        Operation, OperationError, Outcome, PartOrder, PasteTo, PasteWhat, TagClipboard, TagError, TagOperation,
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

    fn paste(&mut self, clipboard: &TagClipboard, what: PasteWhat, to: PasteTo) -> Vec<String> {
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

#[test]
fn a_command_is_active_if_all_that_governs_it_is_on() {
    for (tag, group, feature) in (0..8).map(|bits| (bits & 1 > 0, bits & 2 > 0, bits & 4 > 0)) {
        let mut desk = Desk::new();
        // The feature may be anywhere in the rig.
        desk.run(TagOperation::Move { tags: vec![IK_L], joint: HAND_R, before: None });
        desk.run(TagOperation::Enable(vec![HANDLE_L], tag));
        desk.run(TagOperation::EnableGroup(LEFT, group));
        desk.run(TagOperation::Enable(vec![IK_L], feature));
        let arm = &desk.rig.joint(ARM_L).unwrap().data;
        assert_eq!(is_active(&desk.rig, arm, desk.tag(HANDLE_L)), tag && group && feature);
        let hand = &desk.rig.joint(HAND_R).unwrap().data;
        assert!(is_active(&desk.rig, hand, desk.tag(SPACE_R)));
    }
    let mut desk = Desk::new();
    desk.run(TagOperation::Enable(vec![IK_L], false));
    desk.rig.apply(&RigEdit::RemoveTag(ARM_L, IK_L)).unwrap();
    let arm = &desk.rig.joint(ARM_L).unwrap().data;
    assert!(is_active(&desk.rig, arm, desk.tag(HANDLE_L)), "a feature that is gone turns nothing off");
}

/// Features of two groups: `IK` on the left with two switches, on the right without; one unnamed.
fn features() -> Desk {
    let mut desk = Desk::new();
    let put = |desk: &mut Desk, joint, tag: TagData| {
        desk.rig.apply(&RigEdit::AddTag { joint, tag: Box::new(tag), index: 9 }).unwrap();
    };
    put(&mut desk, HAND_L, feature(Uid(0x30), "ik", "IK arm", "soft"));
    put(&mut desk, HAND_L, feature(Uid(0x31), "ik", "IK arm", "stretch"));
    put(&mut desk, ARM_L, feature(Uid(0x32), "ik", "IK arm", "soft"));
    put(&mut desk, ARM_L, feature(Uid(0x33), "ik", "", "soft"));
    put(&mut desk, ARM_L, feature(Uid(0x34), "fk", "IK arm", ""));
    put(&mut desk, HIPS, feature(Uid(0x35), "ik", "IK arm", ""));
    desk
}

#[test]
fn features_of_one_kind_and_name_in_one_group_act_as_one() {
    let mut desk = features();
    let key = |group, kind: &str| FeatureKey { group, kind: kind.into(), name: "IK arm".into() };
    let listed: Vec<_> = combined_features(&desk.rig).into_iter().map(|feature| (feature.key, feature.tags)).collect();
    let expected = [
        (key(None, "ik"), vec![Uid(0x35)]),
        (key(Some(LEFT), "ik"), vec![IK_L, Uid(0x32), Uid(0x30), Uid(0x31)]),
        (key(Some(LEFT), "fk"), vec![Uid(0x34)]),
        (key(Some(RIGHT), "ik"), vec![IK_R]),
    ];
    assert_eq!(listed, expected, "and the unnamed one is not offered");

    let off = |desk: &Desk| {
        let all = [IK_L, Uid(0x30), Uid(0x31), Uid(0x32), Uid(0x33), Uid(0x34), Uid(0x35), IK_R];
        all.into_iter().filter(|uid| !desk.tag(*uid).enabled).map(|uid| uid.0).collect::<Vec<_>>()
    };
    let state = |desk: &Desk| {
        let feature = combined_features(&desk.rig).swap_remove(1);
        let active: Vec<String> = feature.active_switches().map(str::to_owned).collect();
        (feature.state, active.join(" "))
    };
    let left = key(Some(LEFT), "ik");
    assert_eq!(state(&desk), (FeatureState::On, "soft stretch".into()));
    desk.run(TagOperation::SetSwitch(left.clone(), "soft".into(), false));
    assert_eq!(off(&desk), [0x30, 0x32]);
    assert_eq!(state(&desk), (FeatureState::Mixed, "stretch".into()));
    desk.run(TagOperation::ChooseSwitch(left.clone(), "soft".into()));
    assert_eq!(off(&desk), [0x31]);
    desk.run(TagOperation::SetFeature(left.clone(), false));
    assert_eq!(off(&desk), [0x20, 0x30, 0x31, 0x32]);
    assert_eq!(state(&desk), (FeatureState::Off, String::new()));
    desk.run(TagOperation::ChooseSwitch(left.clone(), "stretch".into()));
    assert_eq!(off(&desk), [0x30, 0x32]);
    desk.run(TagOperation::SetFeature(left.clone(), true));
    assert_eq!(off(&desk), [0; 0]);
    desk.run(TagOperation::Enable(vec![Uid(0x30)], false));
    assert_eq!(combined_features(&desk.rig)[1].switches[0].state, FeatureState::Mixed);

    assert_eq!(features_named(&desk.rig, "IK arm").unwrap().len(), 4);
    for (error, says) in [
        (desk.refusal(TagOperation::SetSwitch(left, "sotf".into(), true)), "did you mean \"soft\"?"),
        (desk.refusal(TagOperation::SetFeature(key(Some(RIGHT), "fk"), true)), "\"IK arm\" of kind \"fk\""),
        (features_named(&desk.rig, "IK amr").unwrap_err().into(), "did you mean \"IK arm\"?"),
    ] {
        assert!(error.to_string().contains(says), "{error}");
    }
}

#[test]
fn kinds_of_feature_are_registered_from_outside_and_unknown_ones_told() {
    let mut desk = Desk::new();
    desk.run(TagOperation::Feature { tag: IK_L, kind: "wing".into(), name: "W".into(), switch: String::new() });
    desk.run(TagOperation::Feature { tag: IK_R, kind: "spnie".into(), name: "S".into(), switch: String::new() });
    let mut kinds = FeatureKinds::default();
    let unknown = kinds.unknown_in(&desk.rig);
    assert_eq!(unknown.iter().map(|unknown| unknown.tag).collect::<Vec<_>>(), [IK_L, IK_R]);
    assert!(unknown[1].to_string().contains("did you mean \"spine\"?"), "{}", unknown[1]);
    assert!(unknown[1].to_string().starts_with("the feature \"S\" on joint "), "{}", unknown[1]);
    assert!(!unknown[1].to_string().contains(&IK_R.to_string()), "{}", unknown[1]);
    let wing = FeatureKind { icon: "wing.svg".into(), ..FeatureKind::new("wing", "Wing", "Feathers.") };
    assert_eq!(kinds.register(wing.clone()), None);
    assert_eq!(kinds.get("wing"), Some(&wing));
    assert_eq!(kinds.unknown_in(&desk.rig).len(), 1);
    assert!(kinds.iter().any(|kind| kind.name == "ik" && !kind.icon.is_empty() && !kind.form.is_empty()));
}

#[test]
fn every_kind_of_feature_has_its_form_and_icon() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/modules");
    for kind in FeatureKinds::default().iter() {
        let form = read_form(&std::fs::read(folder.join(&kind.form)).unwrap()).unwrap();
        let edited: Vec<&str> = form.elements().iter().filter_map(|e| e.bound()).map(|(param, _)| param).collect();
        assert_eq!(edited, ["kind", "name", "switch"]);
        let offers = |e: &&FormElement| matches!(e, FormElement::Menu { options, .. } if options.contains(&kind.name));
        assert!(form.elements().iter().any(offers), "the form does not offer {}", kind.name);
        let icon = std::fs::read_to_string(folder.join(&kind.icon)).unwrap();
        assert!(icon.starts_with("<svg") && icon.contains("viewBox=\"0 0 24 24\""), "{}", kind.name);
    }
}

fn copy(rig: &Rig, scope: TagScope, identifiers: bool) -> TagClipboard {
    let clipboard = TagClipboard::copy(rig, &scope, identifiers, |_| true).unwrap();
    assert_eq!(TagClipboard::from_text(&clipboard.to_text()), Ok(clipboard.clone()), "through the system's clipboard");
    clipboard
}

#[test]
fn copies_have_uids_of_their_own_and_know_each_other() {
    let mut desk = Desk::new();
    let clipboard = copy(&desk.rig, TagScope::Hierarchy(vec![ARM_L]), false);
    let notes = desk.paste(&clipboard, PasteWhat::Both, PasteTo::Joints(vec![ARM_R, HAND_R]));
    assert_eq!(notes, [""; 0]);
    let [ik, space, new_ik, handle] = desk.tags(ARM_R)[..] else { panic!("{:?}", desk.tags(ARM_R)) };
    let [grip] = desk.tags(HAND_R)[..] else { panic!("{:?}", desk.tags(HAND_R)) };
    assert_eq!((ik, space), (IK_R, SPACE_R), "what was there stays first");
    assert_eq!(desk.feature_of(handle), Some(new_ik));
    let expected = format!(
        "(\n  root: \"@joint arm_r#0000000000000004\", // the arm\n  goal: \"@command control/hand_r#{grip} + @joint hips#0000000000000001\",\n  all: \"@joints group:arm_r#0000000000000011 label:hand_r#0000000000000005\", label: \"elbow_l\",\n  local_group: \"0000000000000011\", side: 1.0)"
    );
    assert_eq!(desk.params(handle), expected, "inside the set onto the copies, outside as it was");
    assert_eq!(desk.params(grip), format!("(name: \"grip_l\", space: \"@command ik_handle/arm_r#{handle}\")"));
}

#[test]
fn one_joint_is_pasted_onto_each_and_several_in_order() {
    let mut desk = Desk::new();
    let one = TagClipboard::copy_tags(&desk.rig, &[GRIP_L]).unwrap();
    assert_eq!(one.joints.len(), 1);
    assert_eq!(desk.paste(&one, PasteWhat::Both, PasteTo::Joints(vec![HIPS, HAND_R, HIPS])), [""; 0]);
    assert_eq!((desk.tags(HIPS).len(), desk.tags(HAND_R).len()), (1, 1));
    assert_ne!(desk.tags(HIPS), desk.tags(HAND_R));
    assert!(desk.params(desk.tags(HIPS)[0]).contains("ik_handle/arm_l#0000000000000021"), "outside of the set");

    let two = copy(&desk.rig, TagScope::Joints(vec![HAND_L, ARM_L]), false);
    let notes = desk.paste(&two, PasteWhat::Both, PasteTo::Joints(vec![HAND_R]));
    assert!(notes[0].contains("1 copied joint is left over"), "{notes:?}");
    assert_eq!(desk.tags(HAND_R).len(), 2);
    let notes = desk.paste(&two, PasteWhat::Both, PasteTo::Joints(vec![HAND_R, ARM_R, HIPS]));
    assert!(notes[0].contains("1 selected joint is left over"), "{notes:?}");

    let group = copy(&desk.rig, TagScope::Group(RIGHT), false);
    assert_eq!(group.joints.iter().map(|joint| joint.uid).collect::<Vec<_>>(), [ARM_R, HAND_R]);
    assert_eq!(copy(&desk.rig, TagScope::Rig, true).joints.len(), 5);
    let whole = TagScope::Hierarchy(vec![ARM_L, HIPS, HAND_L]);
    assert_eq!(whole.joints(&desk.rig).unwrap(), [HIPS, ARM_L, HAND_L, ARM_R, HAND_R]);

    let paste = |clipboard: &TagClipboard, to| TagOperation::Paste {
        clipboard: Arc::new(clipboard.clone()),
        what: PasteWhat::Both,
        to,
    };
    let nothing = TagClipboard::default();
    for (operation, error) in [
        (paste(&nothing, PasteTo::Mirror), TagError::EmptyClipboard.into()),
        (paste(&one, PasteTo::Joints(vec![])), TagError::NoTarget.into()),
        (paste(&one, PasteTo::Joints(vec![Uid(9)])), EditError::NoJoint(Uid(9)).into()),
        (paste(&copy(&desk.rig, TagScope::Joints(vec![HIPS]), true), PasteTo::Mirror), TagError::NoMirror.into()),
    ] {
        assert_eq!(desk.refusal(operation), error);
    }
    for text in ["", "hello", "TagClipboard(", "TagClipboard(rig: 3)"] {
        assert!(matches!(TagClipboard::from_text(text), Err(TagError::NoClipboard(_))), "{text}");
    }
}

#[test]
fn values_go_into_tags_of_the_same_module_in_order() {
    let mut desk = Desk::new();
    let clipboard = copy(&desk.rig, TagScope::Hierarchy(vec![ARM_L]), false);
    desk.paste(&clipboard, PasteWhat::Tags, PasteTo::Joints(vec![ARM_R, HAND_R]));
    let handle = desk.tags(ARM_R)[3];
    assert_eq!(desk.params(handle), "()", "tags without values have the module's defaults");
    desk.run(TagOperation::Comment(handle, "mine".into()));
    desk.run(TagOperation::Feature { tag: IK_R, kind: "ik".into(), name: "Other".into(), switch: String::new() });
    desk.run(TagOperation::Attach(vec![handle], Some(IK_R)));
    let before = desk.tags(ARM_R);
    let notes = desk.paste(&clipboard, PasteWhat::Values, PasteTo::Joints(vec![ARM_R, HAND_R]));
    assert_eq!((desk.tags(ARM_R), notes), (before, vec![]));
    let grip = desk.tags(HAND_R)[0];
    assert!(desk.params(handle).contains(&format!("control/hand_r#{grip}")), "{}", desk.params(handle));
    assert_eq!(desk.tag(handle).comment, "mine");
    assert_eq!(desk.feature_of(handle), Some(IK_R), "which feature it is in is no value");
    assert_eq!(desk.tag(IK_R).kind, feature(IK_R, "ik", "IK arm", "").kind);
    let notes = desk.paste(&clipboard, PasteWhat::Values, PasteTo::Joints(vec![HIPS, HAND_R]));
    assert!(notes[0].contains("2 copied tags found no tag"), "{notes:?}");
}

#[test]
fn the_other_side_gets_mirrored_references_and_names() {
    let mut desk = Desk::new();
    let clipboard = copy(&desk.rig, TagScope::Hierarchy(vec![HIPS]), false);
    let left_only = TagClipboard { joints: clipboard.joints[..3].to_vec(), ..clipboard };
    // Values with a side are for modules.
    let mirrored = left_only
        .map_params(|module, params| (module == "ik_handle").then(|| params.replace("side: 1.0", "side: -1.0")));
    let notes = desk.paste(&mirrored, PasteWhat::Both, PasteTo::Mirror);
    assert!(notes[0].contains("1 copied joint has no joint on the other side"), "{notes:?}");
    let [_, _, ik, handle] = desk.tags(ARM_R)[..] else { panic!("{:?}", desk.tags(ARM_R)) };
    let grip = desk.tags(HAND_R)[0];
    let expected = format!(
        "(\n  root: \"@joint arm_r#0000000000000004\", // the arm\n  goal: \"@command control/hand_r#{grip} + @joint hips#0000000000000001\",\n  all: \"@joints group:arm_r#0000000000000011 label:hand_r#0000000000000005\", label: \"elbow_r\",\n  local_group: \"0000000000000011\", side: -1.0)"
    );
    assert_eq!(desk.params(handle), expected);
    assert_eq!(desk.feature_of(handle), Some(ik));
    assert_eq!(desk.params(grip), format!("(name: \"grip_r\", space: \"@command ik_handle/arm_r#{handle}\")"));

    // A command and a feature that are not copied: the ones that are their pairs already.
    let alone = TagClipboard::copy_tags(&desk.rig, &[HANDLE_L]).unwrap();
    desk.paste(&alone, PasteWhat::Both, PasteTo::Mirror);
    let second = *desk.tags(ARM_R).last().unwrap();
    assert!(desk.params(second).contains(&format!("control/hand_r#{grip}")), "{}", desk.params(second));
    assert_eq!(desk.feature_of(second), Some(IK_R));
    // Values only.
    desk.run(TagOperation::Params(vec![(GRIP_L, "(name: \"Left paw\", t: \"@joint arm_r + @joint arm_l\")".into())]));
    let alone = TagClipboard::copy_tags(&desk.rig, &[GRIP_L]).unwrap();
    desk.paste(&alone, PasteWhat::Values, PasteTo::Mirror);
    let expected = "(name: \"Right paw\", t: \"@joint arm_l#0000000000000002 + @joint arm_r#0000000000000004\")";
    assert_eq!(desk.params(grip), expected);
}

#[test]
fn identifier_tags_are_copied_too() {
    let mut desk = Desk::new();
    let identity = |desk: &Desk, joint| {
        let data = &desk.rig.joint(joint).unwrap().data;
        let group = data.group.map(|group| desk.rig.group(group).unwrap().name.clone());
        (data.label.clone().unwrap_or_default(), group.unwrap_or_default())
    };
    let clipboard = copy(&desk.rig, TagScope::Joints(vec![ARM_L]), true);
    desk.paste(&clipboard, PasteWhat::Tags, PasteTo::Joints(vec![HIPS]));
    assert_eq!(identity(&desk, HIPS), ("hips".into(), String::new()), "identifier tags are all value");
    desk.paste(&clipboard, PasteWhat::Values, PasteTo::Joints(vec![HIPS]));
    assert_eq!(identity(&desk, HIPS), ("arm_l".into(), "arm_l".into()));
    desk.rig.apply(&RigEdit::SetGroup(ARM_R, None)).unwrap();
    desk.rig.apply(&RigEdit::SetLabel(ARM_R, None)).unwrap();
    desk.paste(&clipboard, PasteWhat::Both, PasteTo::Mirror);
    assert_eq!(identity(&desk, ARM_R), ("arm_r".into(), "arm_r".into()));

    desk.run(TagOperation::Cut(Arc::new(clipboard.clone())));
    assert_eq!(identity(&desk, ARM_L), (String::new(), String::new()));
    assert_eq!(desk.tags(ARM_L), []);

    // Into another rig: the group comes along.
    let mut other = Desk { rig: Rig::new(Uid(0x77), "other"), uids: UidSource::seeded(1) };
    add(&mut other.rig, JointData { uid: Uid(0x78), ..Default::default() }, None);
    other.paste(&clipboard, PasteWhat::Both, PasteTo::Joints(vec![Uid(0x78)]));
    assert_eq!(identity(&other, Uid(0x78)), ("arm_l".into(), "arm_l".into()));
    assert_eq!(other.rig.groups()[0].color, [0.5; 3]);
    assert_eq!(other.tags(Uid(0x78)).len(), 2);
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
    assert!(needs(2).to_string().contains("needs 3 joints, from the first on upper, lower, end; 2 are selected"));

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
    let what = [PasteWhat::Tags, PasteWhat::Values, PasteWhat::Both][usize::from(c) % 3];
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
    let paste = Operation::Tags(TagOperation::Paste { clipboard, what: PasteWhat::Both, to });
    app.world_mut().write_message(EditRequest::operation(rig, paste));
    app.update();
    let edited: Vec<EditReport> = app.world_mut().resource_mut::<Messages<EditReport>>().drain().collect();
    assert!(edited[0].name == "Paste tags" && edited[0].notes[0].contains("1 copied joint "), "{edited:?}");
    let names: Vec<_> = app.world().resource::<FeatureKinds>().iter().map(|kind| kind.name.clone()).collect();
    assert!(names.contains(&"wing".to_owned()) && names.contains(&"ik".to_owned()), "{names:?}");
}
