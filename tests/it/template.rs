//! Templates: what is saved comes back, and what is wrong is named with its place.

use proptest::prelude::*;
use rigsmith::{
    mesh::model::Weights,
    plugins::face::FaceRig,
    rig::{
        FaceBonePart, NodeKind, Rig, RigEdit, TagKind, Uid,
        template::{MAX_BYTES, read_header, read_template, write_template},
    },
};

use crate::edits::{command, random_rig, steps};

const FROZEN: &str = include_str!("../frozen/format-1.rig.ron");

/// A face as format 2 stores it.
const FROZEN_FACE: &str = include_str!("../frozen/format-2.rig.ron");

fn frozen() -> Rig {
    read_template(FROZEN.as_bytes()).unwrap().rig
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 96, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn what_is_saved_comes_back(steps in steps(60)) {
        let first = random_rig(&steps);
        let text = write_template(&first);
        let read = read_template(text.as_bytes());
        prop_assert!(read.is_ok(), "{:?}\n{}", read, text);
        let read = read.unwrap();
        prop_assert_eq!(&read.notes, &Vec::<String>::new());
        prop_assert_eq!(write_template(&read.rig), text.clone());
        let again = read_template(text.as_bytes()).unwrap().rig;
        prop_assert_eq!(&again, &read.rig);
        prop_assert_eq!(storable_rig(first), read.rig.clone());
        let header = read_header(text.as_bytes()).unwrap();
        prop_assert_eq!((&header.name, header.joint_count), (&read.rig.about().name, read.rig.len()));
    }
}

/// The rig without its current pose, which templates never store, and without names of pairs and features that were deleted.
fn storable_rig(mut rig: Rig) -> Rig {
    for joint in rig.pose().keys().copied().collect::<Vec<_>>() {
        rig.apply(&RigEdit::SetOffset(joint, None)).unwrap();
    }
    for (node, values) in rig.attribute_values().clone() {
        for name in values.keys() {
            rig.apply(&RigEdit::SetAttributeValue(node, name.clone(), None)).unwrap();
        }
    }
    let joints: Vec<_> = rig.walk().map(|joint| joint.data.clone()).collect();
    let is_feature = |uid: &Uid| {
        joints
            .iter()
            .flat_map(|joint| &joint.tags)
            .any(|tag| tag.uid == *uid && matches!(tag.kind, TagKind::Feature { .. }))
    };
    for joint in &joints {
        if joint.mirror.is_some_and(|mirror| rig.joint(mirror).is_none()) {
            rig.apply(&RigEdit::SetMirror(joint.uid, None)).unwrap();
        }
        for tag in &joint.tags {
            if let TagKind::Command { feature: Some(feature), .. } = &tag.kind
                && !is_feature(feature)
            {
                let mut tag = tag.clone();
                if let TagKind::Command { feature, .. } = &mut tag.kind {
                    *feature = None;
                }
                rig.apply(&RigEdit::SetTag(joint.uid, Box::new(tag))).unwrap();
            }
        }
    }
    rig
}

#[test]
fn the_frozen_file_of_format_1_opens() {
    let template = read_template(FROZEN.as_bytes()).unwrap();
    assert_eq!(template.notes, Vec::<String>::new());
    let rig = template.rig;
    assert_eq!(write_template(&rig), FROZEN);
    assert_eq!(rig.uid(), Uid(0x00c0_ffee_00c0_ffee));
    assert_eq!(rig.about().description, "Two lines,\nand 左.");
    assert_eq!(rig.roots(), &[Uid(1), Uid(4)]);
    assert_eq!(rig.children(Some(Uid(1))), &[Uid(2), Uid(3)]);
    let arm = &rig.joint(Uid(2)).unwrap().data;
    assert!(arm.locked && arm.mirror == Some(Uid(3)) && arm.rest.scale.y == 2.0);
    let TagKind::Command { params, feature, .. } = &arm.tags[0].kind else { panic!("{:?}", arm.tags) };
    assert_eq!(params, "(chain: [1, 2], target: Some(\"hand, (l)\"), uid: \"0000000000000001\")");
    assert_eq!(*feature, Some(Uid(0x20)));
    assert_eq!(rig.joint(Uid(4)).unwrap().data.kind, NodeKind::Null);
    assert!(!rig.groups()[1].enabled);
}

#[test]
fn the_frozen_face_of_format_2_opens() {
    let template = read_template(FROZEN_FACE.as_bytes()).unwrap();
    assert_eq!(template.notes, Vec::<String>::new());
    assert_eq!(write_template(&template.rig), FROZEN_FACE);
    let placed = |uid: u64| template.rig.joint(Uid(uid)).unwrap().data.face.clone();
    assert_eq!(placed(1), None);
    let jaw = placed(3).unwrap();
    assert_eq!((jaw.part, jaw.label.as_str()), (FaceBonePart::Jaw, "jaw"));
    // The face is known by what was placed, whatever its group is called.
    let face = FaceRig::read(&template.rig);
    assert_eq!((face.head, face.group, face.feature), (Some(Uid(1)), Some(Uid(0x10)), Some(Uid(0x20))));
    assert_eq!(face.bones.iter().map(|bone| bone.touched).collect::<Vec<_>>(), [false, true]);
    let wrong = FROZEN_FACE.replacen("at: (0.02, 1.55, 0.1)", "at: (inf, 1.55, 0.1)", 1);
    assert_eq!(read_template(wrong.as_bytes()).unwrap_err().line, place(&wrong, "face: (").0);
}

#[test]
fn comments_of_format_1_become_placements() {
    let comment = |text: &str| {
        text.replacen("comment: \"face bone lip_l\"", "comment: \"face bone lip_l, placed at 0.02 1.55 0.1\"", 1)
    };
    let old = FROZEN_FACE
        .replacen("format: 2", "format: 1", 1)
        .replacen("            face: (part: Skin, label: \"lip_l\", at: (0.02, 1.55, 0.1)),\n", "", 1)
        .replacen("            face: (part: Jaw, label: \"jaw\", at: (0.0, 1.48, 0.08)),\n", "", 1);
    let joint = |text: &str| read_template(text.as_bytes()).unwrap().rig.joint(Uid(2)).unwrap().data.clone();
    let read = joint(&comment(&old));
    assert_eq!(read, joint(FROZEN_FACE));
    assert_eq!(read.tags[0].comment, "face bone lip_l");
    // In a file of format 2 a comment is a note for people.
    let noted = joint(&comment(FROZEN_FACE));
    assert_eq!((noted.face, noted.tags[0].comment.as_str()), (read.face, "face bone lip_l, placed at 0.02 1.55 0.1"));
    assert_eq!(joint(&old).face, None);
}

#[test]
fn one_change_is_one_line() {
    let rig = frozen();
    let before = write_template(&rig);
    let arm = rig.joint(Uid(2)).unwrap().data.clone();
    let mut moved = arm.rest;
    moved.translation.x = 0.25;
    let mut turned = arm.rest;
    turned.rotation = -turned.rotation;
    let mut about = rig.about().clone();
    about.description = "one\ntwo\nthree".into();
    let mut tag = arm.tags[0].clone();
    tag.comment = "another".into();
    let mut group = rig.groups()[0].clone();
    group.color = [0.0; 3];
    for edit in [
        RigEdit::SetRest(Uid(2), moved),
        RigEdit::SetRest(Uid(2), turned),
        RigEdit::SetLabel(Uid(2), Some("upper_arm_l".into())),
        RigEdit::SetGroup(Uid(2), Some(Uid(0x10))),
        RigEdit::SetAbout(Box::new(about)),
        RigEdit::SetTag(Uid(2), Box::new(tag)),
        RigEdit::SetLocalGroup(group),
    ] {
        let mut rig = rig.clone();
        rig.apply(&edit).unwrap();
        let after = write_template(&rig);
        assert_eq!(before.lines().count(), after.lines().count(), "{edit:?}");
        let changed = before.lines().zip(after.lines()).filter(|(a, b)| a != b).count();
        assert_eq!(changed, 1, "{edit:?}");
    }
}

#[test]
fn the_header_reads_alone() {
    let whole = read_header(FROZEN.as_bytes()).unwrap();
    assert_eq!((whole.name.as_str(), whole.joint_count, whole.features.len()), ("Biped \"frozen\"", 4, 1));
    assert_eq!(whole.features[0].switches, ["ik", "stretch"]);
    let lists = FROZEN.find("groups:").unwrap() + "groups: [".len();
    for cut in lists..FROZEN.len() {
        assert_eq!(read_header(&FROZEN.as_bytes()[..cut]).as_ref(), Ok(&whole), "cut at {cut}");
    }
    let broken = format!("{}uid: nonsense }} ) ]", &FROZEN[..lists]);
    assert_eq!(read_header(broken.as_bytes()), Ok(whole.clone()));
    let marked = format!("\u{FEFF}{FROZEN}");
    assert_eq!(read_header(marked.as_bytes()), Ok(whole));
    assert!(read_template(marked.as_bytes()).is_ok());
    // Lists before the rest, which a person may write.
    let turned = "(joints: [], groups: [], format: 1, uid: \"0000000000000001\", name: \"n\", version: \"3\")";
    assert_eq!(read_header(turned.as_bytes()).unwrap().version, "3");
    assert!(read_template(turned.as_bytes()).is_ok());
}

/// Line and column, from one, of the first place of `needle` in `text`.
pub fn place(text: &str, needle: &str) -> (usize, usize) {
    let at = text.find(needle).unwrap_or_else(|| panic!("no {needle}"));
    let line = text[..at].matches('\n').count() + 1;
    (line, text[..at].chars().rev().take_while(|c| *c != '\n').count() + 1)
}

#[test]
fn mistakes_are_named_with_their_place() {
    // What is replaced, by what, what the error is about, and the text whose place it names.
    let exact = [
        ("label: \"hips\"", "label: \"hips\", mirror: \"0000000000000099\"", "mirror", "mirror: \"0000000000000099\""),
        (
            "uid: \"0000000000000011\"",
            "uid: \"0000000000000010\"",
            "used twice",
            "uid: \"0000000000000010\", name: \"arm_l\"",
        ),
        (
            "parent: \"0000000000000001\",\n            label: \"arm_r\"",
            "parent: \"0000000000000077\"",
            "not in the file",
            "parent: \"0000000000000077\"",
        ),
        (
            "uid: \"0000000000000001\",\n",
            "uid: \"0000000000000001\",\n            parent: \"0000000000000002\",\n",
            "ancestor",
            "parent: \"0000000000000002\"",
        ),
        ("translation: (-0.2,", "translation: (NaN,", "finite", "translation: (NaN"),
        ("translation: (-0.2,", "translation: (1e39,", "finite", "translation: (1e39"),
        ("rotation: (0.0, 0.0, 0.7", "rotation: (0.0, 0.0, 0.9", "rotation", "rotation: (0.0, 0.0, 0.9"),
        ("scale: (1.0,", "scale: (inf,", "finite", "scale: (inf"),
        ("color: (0.9,", "color: (inf,", "colour", "color: (inf"),
        ("group: \"0000000000000011\"", "group: \"0000000000000012\"", "local group", "group: \"0000000000000012\""),
        ("feature: \"0000000000000020\"", "feature: \"0000000000000022\"", "feature", "feature: \"0000000000000022\""),
        ("format: 1", "format: 0", "format 0", "format: 0"),
    ];
    for (from, to, about, at) in exact {
        let text = FROZEN.replacen(from, to, 1);
        assert_ne!(text, FROZEN, "{from}");
        let error = read_template(text.as_bytes()).unwrap_err();
        assert!(error.message.contains(about), "{to}: {error}");
        assert_eq!((error.line, error.column), place(&text, at), "{error}");
        assert_eq!(text[..error.offset].matches('\n').count() + 1, error.line);
    }
    // Errors of the RON reader: on the line, within the value.
    for (from, to, about) in [
        ("locked: true", "lockd: true", "lockd"),
        ("locked: true", "locked: 3", "bool"),
        ("joint_count: 4", "joint_count: \"4\"", "integer"),
        ("kind: Null", "kind: Nil", "Nil"),
        ("uid: \"0000000000000004\"", "uid: \"4\"", "no uid"),
        ("uid: \"0000000000000004\"", "uid: \"000000000000000g\"", "no uid"),
        ("version: \"1.2.0\"", "verson: \"1.2.0\"", "verson"),
        ("switch: \"ik\"", "swatch: \"ik\"", "swatch"),
        ("label: \"hips\"", "label: \"hips\", label: \"hips\"", "label"),
        ("Command(", "Comand(", "Comand"),
    ] {
        let text = FROZEN.replacen(from, to, 1);
        let error = read_template(text.as_bytes()).unwrap_err();
        assert!(error.message.contains(about), "{to}: {error}");
        let (line, column) = place(&text, to);
        assert_eq!(error.line, line, "{error}");
        assert!((column..=column + to.len()).contains(&error.column), "{error}, for column {column}");
    }
    let missing = read_template(FROZEN.replacen("    uid: \"00c0ffee00c0ffee\",\n", "", 1).as_bytes()).unwrap_err();
    assert!(missing.message.contains("`uid`") && missing.message.contains("add it"), "{missing}");
}

#[test]
fn files_that_are_none_are_refused() {
    for cut in 1..FROZEN.len() - 2 {
        let Some(text) = FROZEN.get(..cut) else { continue };
        let error = read_template(text.as_bytes()).unwrap_err();
        assert!(error.line <= text.matches('\n').count() + 1, "{error}");
    }
    for empty in ["", " \n\t\n", "\u{FEFF}"] {
        assert!(read_template(empty.as_bytes()).unwrap_err().message.contains("empty"));
    }
    let mut bytes = FROZEN.as_bytes().to_vec();
    let at = FROZEN.find("arm_r").unwrap();
    bytes[at] = 0xFF;
    let error = read_template(&bytes).unwrap_err();
    assert_eq!((error.line, error.column), place(FROZEN, "arm_r"));
    assert!(error.message.contains("UTF-8"), "{error}");
    let error = read_template(&vec![b' '; 17 << 20]).unwrap_err();
    assert!(error.message.contains("17 MiB"), "{error}");
    for deep in ["(", "[", "{", "(a:", "[(", "Some("] {
        for head in ["", "(format: 1, joints: ", "(format: 3, x: "] {
            assert!(read_template(format!("{head}{}", deep.repeat(10_000)).as_bytes()).is_err());
            assert!(read_header(format!("{head}{}", deep.repeat(10_000)).as_bytes()).is_err());
        }
    }
}

#[test]
fn large_nonsense_is_refused_and_never_hangs() {
    let started = std::time::Instant::now();
    for piece in ["a:", "a:(", "/*", "\"", "r#\"", "'", "),", "uid:\"0000000000000001\","] {
        let text = format!("(format: 3, joints: [{}", piece.repeat((4 << 20) / piece.len()));
        assert!(text.len() < MAX_BYTES);
        assert!(read_template(text.as_bytes()).is_err());
    }
    // What takes time with the square of a text of 4 MiB takes hours.
    assert!(started.elapsed() < 10 * crate::bench::HANG, "{:?}", started.elapsed());
}

#[test]
fn fields_of_a_newer_format_are_named_before_they_are_lost() {
    let text = FROZEN
        .replacen("format: 1,", "format: 3, /* a /* nested */ \" comment */ licence: (name: \"(\\\"\", uid: \"1\"),", 1)
        .replacen(
            "            label: \"arm_r\",",
            "            // mood: 1,\n            mood: {'\"': [r#\"a \" ) b\"#]},\n            label: \"arm_r\",",
            1,
        )
        .replacen("module: \"ik_handle\",", "module: \"ik_handle\", weight: 0.5,", 1)
        .replacen("color: (0.9, 0.62, 0.0)", "color: (0.9, 0.62, 0.0), shape: Round", 1);
    let template = read_template(text.as_bytes()).unwrap();
    assert_eq!(template.rig, frozen());
    assert!(template.notes[0].contains("format 3"), "{:?}", template.notes);
    let mut named = Vec::new();
    for (field, at) in [("licence", "licence:"), ("shape", "shape:"), ("weight", "weight:"), ("mood", "mood: {")] {
        named.push(format!("line {}: the field `{field}` is of a newer format and is not kept", place(&text, at).0));
    }
    assert_eq!(template.notes[1..], named);
    // Known fields are still checked, with the place in the file as it is.
    let wrong = text.replacen("locked: true", "locked: 3", 1);
    let error = read_template(wrong.as_bytes()).unwrap_err();
    assert_eq!(error.line, place(&wrong, "locked: 3").0);
    assert_eq!(wrong[..error.offset].matches('\n').count() + 1, error.line);
    // In a file of our own format the same fields are mistakes.
    assert!(read_template(text.replacen("format: 3", "format: 1", 1).as_bytes()).is_err());
    // Many of them take no longer than few.
    let joint = |i: usize| format!("(uid: \"{i:016x}\", translation: (0, 0, 0), extra: [{i}], more: (a: ({i}))),\n");
    let many =
        format!("(format: 3, uid: \"{:016x}\", name: \"\", joints: [{}])", 0, (1..5000).map(joint).collect::<String>());
    assert_eq!(read_template(many.as_bytes()).unwrap().notes.len(), 2 * 4999 + 1);
}

#[test]
fn order_and_counts_in_the_file_may_differ() {
    let text = "(format: 1, uid: \"0000000000000001\", name: \"n\", joint_count: 9, joints: [
        (uid: \"0000000000000003\", parent: \"0000000000000002\", translation: (1, 0, 0)),
        (uid: \"0000000000000002\", translation: (0, 1, 0)),
    ])";
    let template = read_template(text.as_bytes()).unwrap();
    assert_eq!(template.rig.position(Uid(3)).to_array(), [1.0, 1.0, 0.0]);
    assert_eq!(template.notes.len(), 1);
    assert!(template.notes[0].contains("9 joints"), "{:?}", template.notes);
}

#[test]
fn names_of_the_deleted_do_not_make_a_file_unreadable() {
    let mut rig = frozen();
    rig.apply(&RigEdit::RemoveJoint(Uid(3))).unwrap();
    rig.apply(&RigEdit::RemoveTag(Uid(1), Uid(0x20))).unwrap();
    let read = read_template(write_template(&rig).as_bytes()).unwrap().rig;
    assert_eq!(read.joint(Uid(2)).unwrap().data.mirror, None);
    assert_eq!(read, storable_rig(rig));
}

#[test]
fn parameters_keep_their_text_but_not_what_is_around_it() {
    let mut rig = frozen();
    let tag = command(Uid(0x30), "  /* before */ ( a : 1 , // in\n b:[ ] ) // after", None);
    rig.apply(&RigEdit::AddTag { joint: Uid(4), tag: Box::new(tag), index: 0 }).unwrap();
    let TagKind::Command { params, .. } = &rig.joint(Uid(4)).unwrap().data.tags[0].kind else { panic!() };
    assert_eq!(params, "( a : 1 , // in\n b:[ ] )");
    assert_eq!(read_template(write_template(&rig).as_bytes()).unwrap().rig, rig);
}

#[test]
fn weights_are_not_part_of_a_template() {
    let mut rig = frozen();
    let skin = rigsmith::rig::SkinData {
        joints: vec![Uid(1)],
        weights: Weights::default(),
        at_rest: true,
        ..Default::default()
    };
    rig.apply(&RigEdit::SetSkin(Uid(5), Some(skin.into()))).unwrap();
    assert_eq!(write_template(&rig), FROZEN);
}
