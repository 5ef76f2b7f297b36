//! Saves over texts that people write: what comes into a text looks like the rest of it, and parts stay parts.

use std::{
    collections::BTreeMap,
    fs,
    path::{Path, PathBuf},
};

use bevy::math::Vec3;
use rigsmith::{
    files::{PartFiles, RealDisk, load_template, store_rig_over},
    instance::RigTemplate,
    rig::{
        JointData, Rig, RigEdit, TagKind, Uid,
        template::{UidStyle, format_template, read_template, write_template_over},
    },
};

use super::{
    part_instances::{FINGER, hand, load},
    template_text::{CHAIN, apply, plain, read, without_blanks},
};

/// Joints of a rig with their parents and tags, whatever their order.
pub(super) fn joints(rig: &Rig) -> BTreeMap<Uid, String> {
    let text = |joint: &rigsmith::rig::RigJoint| {
        let mut data = joint.data.clone();
        for tag in &mut data.tags {
            if let TagKind::Command { params, .. } = &mut tag.kind {
                *params = without_blanks(params);
            }
        }
        (data.uid, format!("{:?} {data:?}", joint.parent))
    };
    rig.walk().map(text).collect()
}

#[test]
fn tags_that_come_have_the_form_and_the_layout_of_the_text() {
    let more = |with: &str| CHAIN.replace("tags: [control])", &format!("tags: [control, {with}])"));
    for with in ["null()", "aim()", "single()"] {
        let wanted = more(with);
        assert_eq!(write_template_over(&read(&wanted), CHAIN).as_ref(), Some(&wanted));
    }
    // A joint that comes is written like the others, too.
    let line = "        (parent: \"tail_2\", label: \"side\", translation: (0.0, 1.0, 0.0), tags: [control()]),\n";
    let wanted = CHAIN.replace("\n        // The tip", &format!("{line}\n        // The tip"));
    assert_eq!(write_template_over(&read(&wanted), CHAIN), Some(wanted));
    // What does not fit into the line any more has the layout of a formatted file.
    let formatted = |text: &str| format_template(text, UidStyle::Kept).unwrap();
    let wanted = formatted(&more(
        "null(comment: \"a tag that takes the joint far beyond the end of its only line, and its list, too\")",
    ));
    assert!(wanted.contains("\n            tags: [\n                control,\n                null("), "{wanted}");
    assert_eq!(write_template_over(&read(&wanted), &formatted(CHAIN)), Some(wanted));
    // A uid that does not follow from names stays, and references have names.
    let wanted = formatted(&more("null(uid: \"00000000000000ab\", parent: \"@joint tail_1\"), null(), null()"));
    assert_eq!(write_template_over(&read(&wanted), &formatted(CHAIN)), Some(wanted));
    // A text of the long form goes on in the long form.
    let long = |tags: &str| format!("(format: 2, name: \"n\", joints: [(label: \"a\", tags: [{tags}])])\n");
    let control = "Command(module: \"control\", params: ())";
    let rig = read(&long(&format!("{control}, null(size: 2.0)")));
    let saved = write_template_over(&rig, &long(control)).unwrap();
    assert!(saved.contains("Command(") && saved.contains("module: \"null\"") && saved.lines().count() == 1, "{saved}");
    assert_eq!(plain(read(&saved)), plain(rig));
}

#[test]
fn fields_that_a_header_lacked_come_into_the_header() {
    let mut rig = read(CHAIN);
    let mut about = rig.about().clone();
    (about.version, about.author) = ("2".to_owned(), "Ada".to_owned());
    apply(&mut rig, RigEdit::SetAbout(Box::new(about)));
    let fields = "// of a cat\n    version: \"2\",\n    author: \"Ada\",\n";
    assert_eq!(write_template_over(&rig, CHAIN), Some(CHAIN.replace("// of a cat\n", fields)));
}

#[test]
fn ends_of_lines_and_the_byte_order_mark_stay() {
    let marked = |text: &str| format!("\u{FEFF}{}", text.replace('\n', "\r\n"));
    let tag = CHAIN.replace("tags: [control])", "tags: [control, null()])");
    let side = "        (parent: \"tail_2\", label: \"side\", translation: (0.0, 1.0, 0.0)),\n";
    let line = CHAIN.replace("\n        // The tip", &format!("{side}\n        // The tip"));
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("tail.rig.ron");
    for wanted in [CHAIN, tag.as_str(), line.as_str()] {
        let rig = read(wanted);
        assert_eq!(write_template_over(&rig, &marked(CHAIN)), Some(marked(wanted)));
        fs::write(&path, marked(CHAIN)).unwrap();
        assert_eq!(store_rig_over(&RealDisk, &path, &rig, &[&path]).unwrap(), Vec::<String>::new());
        assert_eq!(fs::read_to_string(&path).unwrap(), marked(wanted));
        let mut template = RigTemplate::read(marked(CHAIN).as_bytes()).unwrap();
        assert_eq!(template.saved(), marked(CHAIN));
        template.set_rig(rig);
        assert_eq!(template.saved(), marked(wanted));
    }
    // Ends of lines within a text are no marks.
    let text = CHAIN.replace("control(shape: \"cube\")", "control(comment: \"two\nlines\")").replace('\n', "\r\n");
    assert_eq!(write_template_over(&read(&text), &text), Some(text));
}

/// A folder with the part of a finger, and a template that uses it.
pub(super) struct Desk {
    folder: tempfile::TempDir,
}

impl Desk {
    pub(super) fn new(text: &str) -> Self {
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join("finger.rig.ron"), FINGER).unwrap();
        fs::write(folder.path().join("hand.rig.ron"), text).unwrap();
        Self { folder }
    }

    pub(super) fn path(&self) -> PathBuf {
        self.folder.path().join("hand.rig.ron")
    }

    fn rig(&self) -> Rig {
        load(&self.path())
    }

    /// Saves a rig over the template; the notes, and the text, which says what the rig is.
    fn save(&self, rig: &Rig) -> (Vec<String>, String) {
        let path = self.path();
        let notes = store_rig_over(&RealDisk, &path, rig, &[&path]).unwrap();
        assert_eq!(joints(&load(&path)), joints(rig));
        (notes, fs::read_to_string(path).unwrap())
    }

    /// Saves a rig of which nothing is lost.
    fn saved(&self, rig: &Rig) -> String {
        let (notes, text) = self.save(rig);
        assert_eq!(notes, Vec::<String>::new());
        text
    }
}

fn joint(rig: &Rig, label: &str) -> Uid {
    rig.find_label(label).unwrap_or_else(|| panic!("no joint {label}"))
}

fn move_joint(rig: &mut Rig, label: &str, translation: Vec3) {
    let joint = joint(rig, label);
    let mut rest = rig.joint(joint).unwrap().data.rest;
    rest.translation = translation;
    apply(rig, RigEdit::SetRest(joint, rest));
}

#[test]
fn what_follows_from_a_change_of_the_template_is_no_change_of_its_parts() {
    let text = "(\n    format: 2,\n    name: \"host\",\n    joints: [\n        (label: \"palm\", translation: (0.5, 1, 0)),\n    ],\n    parts: [\n        (part: \"finger.rig.ron\", parent: \"palm\", world: true),\n    ],\n)\n";
    let moved = text.replace("(0.5, 1, 0)", "(0.5, 2.0, 0)");
    let rig = Desk::new(&moved).rig();
    let desk = Desk::new(text);
    assert_eq!(desk.saved(&rig), moved);
    // A finger that rides along does not stand where its file has it: that is a change.
    let desk = Desk::new(text);
    let mut rig = desk.rig();
    move_joint(&mut rig, "palm", Vec3::new(0.5, 2.0, 0.0));
    let saved = desk.saved(&rig);
    assert!(saved.contains("(0.5, 2.0, 0)") && saved.contains("(joint: \"bone_1\", translation: ("), "{saved}");
}

#[test]
fn references_to_what_parts_bring_stay_as_they_are_written() {
    let text = hand("hand", 1, false, "").replace(
        "tags: [control(creation: (name: \"palm\"))]",
        "tags: [null(parent: \"@joint f0_bone_1\", creation: (name: \"palm\"))]",
    );
    let desk = Desk::new(&text);
    let mut rig = desk.rig();
    move_joint(&mut rig, "palm", Vec3::new(0.5, 2.0, 0.0));
    assert_eq!(desk.saved(&rig), text.replace("(0.5, 1, 0)", "(0.5, 2.0, 0)"));
}

/// A hand of as many fingers, with a joint on the second bone of the last one.
fn with_ring(fingers: usize, parent: &str) -> String {
    let ring = format!(
        "\n        (label: \"ring\", parent: \"{parent}\", translation: (0, 0.01, 0), tags: [control()]),\n    ],\n    parts:"
    );
    hand("hand", fingers, false, "").replacen("\n    ],\n    parts:", &ring, 1)
}

#[test]
fn a_joint_of_the_template_hangs_on_a_joint_of_a_part() {
    let text = with_ring(2, "f1_bone_2");
    let desk = Desk::new(&text);
    let rig = desk.rig();
    let (ring, bone) = (joint(&rig, "ring"), joint(&rig, "f1_bone_2"));
    assert_eq!(rig.joint(ring).unwrap().parent, Some(bone));
    assert_eq!(rig.children(Some(bone)), [joint(&rig, "f1_bone_3"), ring]);
    assert_eq!(desk.saved(&rig), text);
    // The uid of the parent does as well.
    assert_eq!(Desk::new(&with_ring(2, &bone.to_string())).rig(), rig);
    // Another place is one value, another label of the bone goes on in the joint, and so does another parent.
    let mut changed = rig.clone();
    move_joint(&mut changed, "ring", Vec3::new(0.0, 0.02, 0.0));
    assert_eq!(desk.saved(&changed), text.replace("(0, 0.01, 0)", "(0, 0.02, 0)"));
    apply(&mut changed, RigEdit::SetLabel(bone, Some("knuckle".to_owned())));
    let saved = desk.saved(&changed);
    assert!(
        saved.contains("(label: \"ring\", parent: \"knuckle\",") && saved.contains("label: \"knuckle\")"),
        "{saved}"
    );
    let palm = joint(&rig, "palm");
    apply(&mut changed, RigEdit::SetParent { joint: ring, parent: Some(palm), index: usize::MAX });
    assert!(desk.saved(&changed).contains("(label: \"ring\", parent: \"palm\","));
    apply(&mut changed, RigEdit::SetParent { joint: ring, parent: Some(bone), index: 0 });
    assert!(desk.saved(&changed).contains("(label: \"ring\", parent: \"knuckle\","));
    // A part may hang on the joint.
    let text = "(format: 2, name: \"hand\", joints: [(label: \"palm\"), (label: \"ring\", parent: \"a_bone_2\")], parts: [\
                (part: \"finger.rig.ron\", name: \"a\", parent: \"palm\", prefix: \"a_\"), \
                (part: \"finger.rig.ron\", name: \"b\", parent: \"ring\", prefix: \"b_\")])";
    let rig = Desk::new(text).rig();
    assert_eq!(rig.joint(joint(&rig, "b_bone_1")).unwrap().parent, Some(joint(&rig, "ring")));
    assert_eq!(rig.joint(joint(&rig, "ring")).unwrap().parent, Some(joint(&rig, "a_bone_2")));
}

#[test]
fn a_joint_that_comes_below_one_of_a_part_is_a_line_of_the_text() {
    let text = hand("hand", 3, false, "");
    let desk = Desk::new(&text);
    let mut rig = desk.rig();
    let data = |uid: u64, label: &str| {
        Box::new(JointData { uid: Uid(uid), label: Some(label.to_owned()), ..JointData::default() })
    };
    let (tip, palm) = (joint(&rig, "f0_bone_3"), joint(&rig, "palm"));
    apply(&mut rig, RigEdit::AddJoint { joint: data(7, "nail"), parent: Some(tip), index: usize::MAX });
    let line =
        "        (uid: \"0000000000000007\", parent: \"f0_bone_3\", label: \"nail\", translation: (0.0, 0.0, 0.0)),\n";
    let saved = desk.saved(&rig);
    assert_eq!(saved.replace(line, ""), text, "{saved}");
    assert!(saved.contains(line), "{saved}");
    // Behind the fingers of the palm, or between them.
    for (uid, label, index) in [(8, "last", usize::MAX), (9, "middle", 1)] {
        apply(&mut rig, RigEdit::AddJoint { joint: data(uid, label), parent: Some(palm), index });
        let saved = desk.saved(&rig);
        assert!(saved.contains(&format!("parent: \"palm\", label: \"{label}\"")), "{saved}");
        assert_eq!(saved.matches("finger.rig.ron").count(), 3);
    }
}

#[test]
fn parents_that_no_part_brings_are_told_with_their_place() {
    let told = |desk: &Desk, text: &str| PartFiles::new(&RealDisk).complete(&desk.path(), text.as_bytes());
    let text = with_ring(2, "f1_bone_9");
    let desk = Desk::new(&text);
    let error = told(&desk, &text).unwrap_err();
    assert!(
        text.lines().nth(error.line - 1).unwrap()[error.column - 1..].starts_with("parent: \"f1_bone_9\""),
        "{error}"
    );
    assert!(error.message.contains("there is no joint \"f1_bone_9\", neither in the file nor"), "{error}");
    assert!(error.message.contains("did you mean \"f1_bone_1\", \"f1_bone_2\" or \"f1_bone_3\"?"), "{error}");
    // A label of two, and a joint that would hang below itself.
    let folder = |parts: &str| {
        format!(
            "(\n    format: 2,\n    name: \"hand\",\n    joints: [\n        (label: \"palm\"),\n        (label: \"ring\", parent: \"bone_3\"),\n    ],\n    parts: [{parts}],\n)\n"
        )
    };
    for (parts, message) in [
        (
            "(part: \"finger.rig.ron\", name: \"a\", parent: \"palm\"), (part: \"finger.rig.ron\", name: \"b\", parent: \"palm\")",
            "2 joints are called \"bone_3\"; write the uid",
        ),
        ("(part: \"finger.rig.ron\", parent: \"ring\")", "joint \"bone_3\" hangs on this joint"),
    ] {
        let text = folder(parts);
        let desk = Desk::new(&text);
        let error = told(&desk, &text).unwrap_err();
        assert!(error.message.contains(message) && error.line == 6, "{error}");
    }
    // Without its part a parent is no fault of its own; without parts it is one at once.
    let text = with_ring(2, "f1_bone_2").replace("finger.rig.ron", "lost.rig.ron");
    let desk = Desk::new(&text);
    let template = read_template(text.as_bytes()).unwrap();
    let (_, faults) = PartFiles::new(&RealDisk).survey(&desk.path(), &text, template);
    assert!(!faults.is_empty() && faults.iter().all(|fault| fault.message.contains("lost.rig.ron")), "{faults:?}");
    let error = read_template(CHAIN.replace("parent: \"tail_1\"", "parent: \"tial_1\"").as_bytes()).unwrap_err();
    assert!(error.message.contains("there is no joint \"tial_1\" in the file; did you mean \"tail_1\""), "{error}");
}

#[test]
fn a_part_that_changes_cannot_express_is_written_out_alone() {
    let text = hand("hand", 3, false, "");
    let changes: [fn(&mut Rig); 3] = [
        |rig| {
            let tip = joint(rig, "f1_bone_3");
            apply(rig, RigEdit::RemoveJoint(tip));
        },
        |rig| {
            let (tip, palm) = (joint(rig, "f1_bone_3"), joint(rig, "palm"));
            apply(rig, RigEdit::SetParent { joint: tip, parent: Some(palm), index: usize::MAX });
        },
        // What a change can say of another part is said.
        |rig| {
            let tip = joint(rig, "f1_bone_3");
            apply(rig, RigEdit::RemoveJoint(tip));
            move_joint(rig, "f2_bone_3", Vec3::new(0.0, 0.05, 0.0));
        },
    ];
    for change in changes {
        let desk = Desk::new(&text);
        let mut rig = desk.rig();
        change(&mut rig);
        let (notes, saved) = desk.save(&rig);
        assert!(
            matches!(&notes[..], [note] if note.contains("the part \"finger 1\" was written out") && !note.contains("finger 0")),
            "{notes:?}"
        );
        assert!(saved.contains("// The palm.") && saved.contains("format: 2"), "{saved}");
        assert!(saved.contains("name: \"finger 0\"") && saved.contains("name: \"finger 2\""), "{saved}");
        assert!(!saved.contains("name: \"finger 1\"") && saved.contains("label: \"f1_bone_1\""), "{saved}");
        // It is told once.
        assert_eq!(desk.saved(&rig), saved);
    }
    // A part that hangs on the one that is written out stays one.
    let two = text.replacen("parent: \"palm\", translation: (0, 0.1, 0.02)", "parent: \"f0_bone_2\"", 1);
    assert!(two != text);
    let desk = Desk::new(&two);
    let mut rig = desk.rig();
    let tip = joint(&rig, "f0_bone_3");
    apply(&mut rig, RigEdit::RemoveJoint(tip));
    let (notes, saved) = desk.save(&rig);
    assert!(notes.len() == 1 && notes[0].contains("\"finger 0\""), "{notes:?}");
    assert!(saved.contains("name: \"finger 1\", parent: \"f0_bone_2\""), "{saved}");
}

#[test]
fn a_joint_in_the_group_of_a_part_leaves_the_group_to_the_part() {
    let bundled = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/templates/biped.rig.ron");
    let text = fs::read_to_string(&bundled).unwrap();
    let mut rig = load_template(&RealDisk, &bundled).unwrap().rig;
    for (uid, on) in [(0xa1, "hand_l"), (0xa2, "hips")] {
        let parent = joint(&rig, on);
        let group = rig.joint(parent).unwrap().data.group;
        assert!(group.is_some());
        let data = JointData { uid: Uid(uid), label: Some(format!("on_{on}")), group, ..JointData::default() };
        apply(&mut rig, RigEdit::AddJoint { joint: Box::new(data), parent: Some(parent), index: usize::MAX });
    }
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("biped.rig.ron");
    fs::write(&out, &text).unwrap();
    assert_eq!(store_rig_over(&RealDisk, &out, &rig, &[&out]).unwrap(), Vec::<String>::new());
    let saved = fs::read_to_string(&out).unwrap();
    assert_eq!(saved.matches("part: \"parts/").count(), 8, "{saved}");
    assert!(saved.contains("label: \"on_hand_l\"") && saved.lines().count() < text.lines().count() + 16, "{saved}");
    let again = load(&out);
    assert_eq!(again.groups().len(), rig.groups().len());
    assert_eq!(again.len(), rig.len());
}
