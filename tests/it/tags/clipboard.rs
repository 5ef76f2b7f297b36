//! Copied tags: their uids, their places, values, the other side, and identifiers.

use super::*;

#[test]
fn copies_have_uids_of_their_own_and_know_each_other() {
    let mut desk = Desk::new();
    let clipboard = copy(&desk.rig, TagScope::Hierarchy(vec![ARM_L]), false);
    let notes = desk.paste(&clipboard, PasteContent::Both, PasteTo::Joints(vec![ARM_R, HAND_R]));
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
    assert_eq!(desk.paste(&one, PasteContent::Both, PasteTo::Joints(vec![HIPS, HAND_R, HIPS])), [""; 0]);
    assert_eq!((desk.tags(HIPS).len(), desk.tags(HAND_R).len()), (1, 1));
    assert_ne!(desk.tags(HIPS), desk.tags(HAND_R));
    assert!(desk.params(desk.tags(HIPS)[0]).contains("ik_handle/arm_l#0000000000000021"), "outside of the set");

    let two = copy(&desk.rig, TagScope::Joints(vec![HAND_L, ARM_L]), false);
    let notes = desk.paste(&two, PasteContent::Both, PasteTo::Joints(vec![HAND_R]));
    assert!(notes[0].contains("1 copied joint is left over"), "{notes:?}");
    assert_eq!(desk.tags(HAND_R).len(), 2);
    let notes = desk.paste(&two, PasteContent::Both, PasteTo::Joints(vec![HAND_R, ARM_R, HIPS]));
    assert!(notes[0].contains("1 selected joint is left over"), "{notes:?}");

    let group = copy(&desk.rig, TagScope::Group(RIGHT), false);
    assert_eq!(group.joints.iter().map(|joint| joint.uid).collect::<Vec<_>>(), [ARM_R, HAND_R]);
    assert_eq!(copy(&desk.rig, TagScope::Rig, true).joints.len(), 5);
    let whole = TagScope::Hierarchy(vec![ARM_L, HIPS, HAND_L]);
    assert_eq!(whole.joints(&desk.rig).unwrap(), [HIPS, ARM_L, HAND_L, ARM_R, HAND_R]);

    let paste = |clipboard: &TagClipboard, to| TagOperation::Paste {
        clipboard: Arc::new(clipboard.clone()),
        what: PasteContent::Both,
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
    desk.paste(&clipboard, PasteContent::Tags, PasteTo::Joints(vec![ARM_R, HAND_R]));
    let handle = desk.tags(ARM_R)[3];
    assert_eq!(desk.params(handle), "()", "tags without values have the module's defaults");
    desk.run(TagOperation::Comment(handle, "mine".into()));
    desk.run(TagOperation::Feature { tag: IK_R, kind: "ik".into(), name: "Other".into(), switch: String::new() });
    desk.run(TagOperation::Attach(vec![handle], Some(IK_R)));
    let before = desk.tags(ARM_R);
    let notes = desk.paste(&clipboard, PasteContent::Values, PasteTo::Joints(vec![ARM_R, HAND_R]));
    assert_eq!((desk.tags(ARM_R), notes), (before, vec![]));
    let grip = desk.tags(HAND_R)[0];
    assert!(desk.params(handle).contains(&format!("control/hand_r#{grip}")), "{}", desk.params(handle));
    assert_eq!(desk.tag(handle).comment, "mine");
    assert_eq!(desk.feature_of(handle), Some(IK_R), "which feature it is in is no value");
    assert_eq!(desk.tag(IK_R).kind, feature(IK_R, "ik", "IK arm", "").kind);
    let notes = desk.paste(&clipboard, PasteContent::Values, PasteTo::Joints(vec![HIPS, HAND_R]));
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
    let notes = desk.paste(&mirrored, PasteContent::Both, PasteTo::Mirror);
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
    desk.paste(&alone, PasteContent::Both, PasteTo::Mirror);
    let second = *desk.tags(ARM_R).last().unwrap();
    assert!(desk.params(second).contains(&format!("control/hand_r#{grip}")), "{}", desk.params(second));
    assert_eq!(desk.feature_of(second), Some(IK_R));
    // Values only.
    desk.run(TagOperation::Params(vec![(GRIP_L, "(name: \"Left paw\", t: \"@joint arm_r + @joint arm_l\")".into())]));
    let alone = TagClipboard::copy_tags(&desk.rig, &[GRIP_L]).unwrap();
    desk.paste(&alone, PasteContent::Values, PasteTo::Mirror);
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
    desk.paste(&clipboard, PasteContent::Tags, PasteTo::Joints(vec![HIPS]));
    assert_eq!(identity(&desk, HIPS), ("hips".into(), String::new()), "identifier tags are all value");
    desk.paste(&clipboard, PasteContent::Values, PasteTo::Joints(vec![HIPS]));
    assert_eq!(identity(&desk, HIPS), ("arm_l".into(), "arm_l".into()));
    desk.rig.apply(&RigEdit::SetGroup(ARM_R, None)).unwrap();
    desk.rig.apply(&RigEdit::SetLabel(ARM_R, None)).unwrap();
    desk.paste(&clipboard, PasteContent::Both, PasteTo::Mirror);
    assert_eq!(identity(&desk, ARM_R), ("arm_r".into(), "arm_r".into()));

    desk.run(TagOperation::Cut(Arc::new(clipboard.clone())));
    assert_eq!(identity(&desk, ARM_L), (String::new(), String::new()));
    assert_eq!(desk.tags(ARM_L), []);

    // Into another rig: the group comes along.
    let mut other = Desk { rig: Rig::new(Uid(0x77), "other"), uids: UidSource::seeded(1) };
    add(&mut other.rig, JointData { uid: Uid(0x78), ..Default::default() }, None);
    other.paste(&clipboard, PasteContent::Both, PasteTo::Joints(vec![Uid(0x78)]));
    assert_eq!(identity(&other, Uid(0x78)), ("arm_l".into(), "arm_l".into()));
    assert_eq!(other.rig.groups()[0].color, [0.5; 3]);
    assert_eq!(other.tags(Uid(0x78)).len(), 2);
}
