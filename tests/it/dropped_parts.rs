//! Parts that are dropped onto joints: the rig's file has them as parts.

use std::{
    fs,
    path::{Path, PathBuf},
    sync::Arc,
};

use rigsmith::{
    files::{PartFiles, RealDisk, load_template, store_rig_over},
    instance::RigTemplate,
    rig::{
        GroupData, Rig, RigEdit, TagData, TagKind, Uid, UidSource,
        operations::{Operation, OperationError, Outcome, TagOperation},
        part::PartInstance,
        step::edits_from_empty,
    },
};

use super::{
    part_instances::{FINGER, hand, load},
    template_text::apply,
};

/// A part of the left side, with a group and a feature.
const LIMB: &str = r#"(
    format: 2,
    name: "limb",
    kind: "part",
    groups: [(name: "limb_l")],
    joints: [
        (
            label: "upper_l",
            group: "limb_l",
            tags: [Feature(kind: "fk", name: "fk"), control(feature: "fk", at: "@joint upper_l + @joint lower_l")],
        ),
        (label: "lower_l", parent: "upper_l", group: "limb_l", translation: (0, -0.3, 0), tags: [null()]),
    ],
)
"#;

const MAN: &str = r#"(
    format: 2,
    name: "man",
    joints: [
        // The hips carry everything.
        (label: "hips", translation: (0, 1, 0), tags: [control()]),
        (label: "arm_l", parent: "hips", translation: (0.2, 0.4, 0)),
        (label: "elbow_l", parent: "arm_l", translation: (0, -0.3, 0)), // It bends.
        (label: "arm_r", parent: "hips", translation: (-0.2, 0.4, 0)),
        (label: "elbow_r", parent: "arm_r", translation: (0, -0.3, 0)),
    ],
)
"#;

struct Desk {
    folder: tempfile::TempDir,
    rig: Rig,
    uids: UidSource,
}

impl Desk {
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join("limb.rig.ron"), LIMB).unwrap();
        fs::write(folder.path().join("man.rig.ron"), MAN).unwrap();
        let rig = load(&folder.path().join("man.rig.ron"));
        Self { folder, rig, uids: UidSource::seeded(7) }
    }

    fn path(&self) -> PathBuf {
        self.folder.path().join("man.rig.ron")
    }

    fn joint(&self, label: &str) -> Uid {
        self.rig.find_label(label).unwrap_or_else(|| panic!("no joint {label}"))
    }

    /// Drops the limb onto joints.
    fn drop(&mut self, labels: &[&str], mirror: bool) -> Outcome {
        self.add("limb.rig.ron", labels, mirror).unwrap()
    }

    /// Adds a part on joints, or is refused.
    fn add(&mut self, part: &str, labels: &[&str], mirror: bool) -> Result<Outcome, OperationError> {
        let part = part.to_owned();
        let onto = vec![String::new(); labels.len()];
        let instance = PartInstance { part: part.clone(), onto, mirror, ..PartInstance::default() };
        let fitted = Arc::new(PartFiles::new(&RealDisk).fitted_part(&self.path(), &instance).unwrap());
        let joints = labels.iter().map(|label| self.joint(label)).collect();
        let operation = Operation::Tags(TagOperation::AddPart { part, fitted, joints, mirror });
        operation.run(&mut self.rig, &mut self.uids, None)
    }

    /// Saves the rig; the text, which says what the rig is with all its parts.
    fn save(&self) -> String {
        let path = self.path();
        assert_eq!(store_rig_over(&RealDisk, &path, &self.rig, &[&path]).unwrap(), Vec::<String>::new());
        fs::read_to_string(path).unwrap()
    }

    /// The instances of the file, each with the joints that it goes onto.
    fn instances(&self) -> Vec<Vec<String>> {
        let template = load_template(&RealDisk, &self.path()).unwrap();
        template.instances.into_iter().map(|instance| instance.onto).collect()
    }
}

fn null(uid: u64) -> TagData {
    let kind = TagKind::Command { module: "null".into(), params: "()".into(), feature: None };
    TagData { uid: Uid(uid), enabled: true, comment: String::new(), kind }
}

#[test]
fn a_dropped_part_is_one_line_of_the_file() {
    let mut desk = Desk::new();
    let left = desk.drop(&["arm_l", "elbow_l"], false);
    assert_eq!(left.notes, Vec::<String>::new());
    let text = desk.save();
    let line = "    parts: [(part: \"limb.rig.ron\", onto: [\"arm_l\", \"elbow_l\"])],\n";
    assert_eq!(text.replace(line, ""), MAN);
    assert!(text.contains(line), "{text}");
    // A save of the same changes nothing, and neither does one of what was read.
    assert_eq!(desk.save(), text);
    let again = load(&desk.path());
    assert_eq!(again.walk().map(|joint| joint.data.tags.len()).sum::<usize>(), 4);
    desk.rig = again;
    assert_eq!(desk.save(), text);
    // The other side is another instance, behind the first.
    desk.drop(&["arm_r", "elbow_r"], true);
    let both = desk.save();
    assert!(both.contains("onto: [\"arm_r\", \"elbow_r\"], mirror: true"), "{both}");
    assert_eq!(desk.instances(), [["arm_l", "elbow_l"], ["arm_r", "elbow_r"]]);
    let group = |label: &str| {
        let group = desk.rig.joint(desk.joint(label)).unwrap().data.group.unwrap();
        desk.rig.group(group).unwrap().name.clone()
    };
    assert_eq!((group("elbow_l"), group("elbow_r")), ("limb_l".to_owned(), "limb_r".to_owned()));
}

#[test]
fn undo_takes_a_dropped_part_out_of_the_file_again() {
    let mut desk = Desk::new();
    let before = desk.rig.clone();
    let outcome = desk.drop(&["arm_l", "elbow_l"], false);
    let after = desk.rig.clone();
    assert!(desk.save().contains("parts:"));
    outcome.inverses.iter().for_each(|edit| apply(&mut desk.rig, edit.clone()));
    assert_eq!(desk.rig, before);
    assert_eq!(desk.save(), MAN);
    outcome.edits.iter().for_each(|edit| apply(&mut desk.rig, edit.clone()));
    assert_eq!(desk.rig, after);
    desk.save();
    assert_eq!(desk.instances(), [["arm_l", "elbow_l"]]);
}

#[test]
fn what_is_changed_of_a_dropped_part_before_a_save_is_a_change_of_its_instance() {
    let mut desk = Desk::new();
    desk.drop(&["arm_l", "elbow_l"], false);
    // A parameter, a tag behind those of the part, another label, and joints and a group of the rig's own.
    let (arm, elbow) = (desk.joint("arm_l"), desk.joint("elbow_l"));
    let is_control = |tag: &&TagData| matches!(&tag.kind, TagKind::Command { module, .. } if module == "control");
    let mut tag = desk.rig.joint(arm).unwrap().data.tags.iter().find(is_control).unwrap().clone();
    let TagKind::Command { params, .. } = &mut tag.kind else { panic!() };
    *params = params.replacen('(', "(shape: \"star\", ", 1);
    apply(&mut desk.rig, RigEdit::SetTag(arm, Box::new(tag)));
    apply(&mut desk.rig, RigEdit::AddTag { joint: elbow, tag: Box::new(null(0xab)), index: usize::MAX });
    apply(&mut desk.rig, RigEdit::SetLabel(arm, Some("shoulder_l".to_owned())));
    let operation = Operation::Group { joints: vec![desk.joint("hips")], name: "trunk".into(), color: None };
    operation.run(&mut desk.rig, &mut desk.uids, None).unwrap();
    let text = desk.save();
    assert_eq!(desk.instances(), [["shoulder_l", "elbow_l"]]);
    assert!(text.contains("shape: \"star\"") && text.contains("// It bends."), "{text}");
    let template = load_template(&RealDisk, &desk.path()).unwrap();
    let changed: Vec<String> = template.instances[0].overrides().into_iter().map(|one| one.target).collect();
    assert_eq!(changed.len(), 2, "{changed:?}");
    assert!(template.rig.find_tag(Uid(0xab)).is_some());
}

#[test]
fn a_rig_without_a_file_gets_one_with_parts() {
    let mut desk = Desk::new();
    desk.drop(&["arm_l", "elbow_l"], false);
    fs::remove_file(desk.path()).unwrap();
    let text = desk.save();
    assert!(
        text.contains("format: 2") && text.contains(r#"(part: "limb.rig.ron", onto: ["arm_l", "elbow_l"])"#),
        "{text}"
    );
    assert_eq!(desk.instances(), [["arm_l", "elbow_l"]]);
    // Beside another file, where the part is not found, it is written out, and the person is told.
    let elsewhere = tempfile::tempdir().unwrap();
    let other = elsewhere.path().join("man.rig.ron");
    let notes = store_rig_over(&RealDisk, &other, &desk.rig, &[&other, &desk.path()]).unwrap();
    assert!(notes.len() == 1 && notes[0].contains("written out"), "{notes:?}");
    let template = load_template(&RealDisk, &other).unwrap();
    assert_eq!(template.instances.len(), 0);
    assert_eq!(template.rig.walk().map(|joint| joint.data.tags.len()).sum::<usize>(), 4);
}

#[test]
fn joints_without_a_label_get_one_that_is_theirs_alone() {
    let mut desk = Desk::new();
    for label in ["arm_l", "elbow_l"] {
        let joint = desk.joint(label);
        apply(&mut desk.rig, RigEdit::SetLabel(joint, None));
    }
    let [arm, elbow] = [1, 2].map(|place| desk.rig.walk().nth(place).unwrap().data.uid);
    let hips = desk.joint("hips");
    apply(&mut desk.rig, RigEdit::SetLabel(hips, Some("lower_l".to_owned())));
    let part = LIMB.as_bytes();
    let fitted = Arc::new(rigsmith::rig::template::read_template(part).unwrap().rig);
    let operation =
        TagOperation::AddPart { part: "limb.rig.ron".to_owned(), fitted, joints: vec![arm, elbow], mirror: false };
    Operation::Tags(operation).run(&mut desk.rig, &mut desk.uids, None).unwrap();
    let label = |joint: Uid| desk.rig.joint(joint).unwrap().data.label.clone().unwrap();
    assert_eq!((label(arm), label(elbow)), ("upper_l".to_owned(), "lower_l_2".to_owned()));
    desk.save();
    assert_eq!(desk.instances(), [["upper_l", "lower_l_2"]]);
}

#[test]
fn the_record_of_dropped_parts_is_an_edit_like_any_other() {
    let mut desk = Desk::new();
    desk.drop(&["arm_l", "elbow_l"], false);
    let edit = RigEdit::SetDroppedParts(desk.rig.dropped_parts().to_vec());
    let text = ron::to_string(&edit).unwrap();
    assert_eq!(ron::from_str::<RigEdit>(&text).unwrap(), edit);
    let mut copy = Rig::new(desk.rig.uid(), "");
    edits_from_empty(&desk.rig).iter().for_each(|edit| apply(&mut copy, edit.clone()));
    assert_eq!(copy, desk.rig);
    let inverse = copy.apply(&RigEdit::SetDroppedParts(Vec::new())).unwrap();
    assert!(copy.dropped_parts().is_empty());
    apply(&mut copy, inverse);
    assert_eq!(copy, desk.rig);
}

#[test]
fn a_template_that_code_changes_keeps_its_parts() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("hand.rig.ron");
    fs::write(folder.path().join("finger.rig.ron"), FINGER).unwrap();
    let text = hand("hand", 2, false, "");
    let mut template = RigTemplate::read_with_parts(text.as_bytes(), &path, &mut PartFiles::new(&RealDisk)).unwrap();
    // The parts are known from the first reading: no file is asked for any more.
    drop(folder);
    assert_eq!(template.saved(), text);
    let mut rig = (**template.rig()).clone();
    let bone = rig.find_label("f1_bone_2").unwrap();
    let mut tag = rig.joint(bone).unwrap().data.tags[0].clone();
    let TagKind::Command { params, .. } = &mut tag.kind else { panic!() };
    *params = params.replace("0.4", "0.7");
    apply(&mut rig, RigEdit::SetTag(bone, Box::new(tag)));
    template.set_rig(rig.clone());
    let saved = template.saved();
    let fresh: Vec<&str> = saved.lines().filter(|line| !text.contains(line)).collect();
    assert!(matches!(fresh[..], [line] if line.contains("changes:") && line.contains("0.7")), "{saved}");
    // The bundled parts need no file at all, and neither does one that is dropped by code.
    let mut template = RigTemplate::read(
        b"(format: 2, name: \"horn\", joints: [(label: \"a\"), (label: \"b\", parent: \"a\", translation: (0, 1, 0))])",
    )
    .unwrap();
    let mut rig = (**template.rig()).clone();
    let part = "parts/fk_chain.rig.ron".to_owned();
    let onto = vec![String::new(); 2];
    let instance = PartInstance { part: part.clone(), onto, ..PartInstance::default() };
    let fitted = Arc::new(PartFiles::new(&RealDisk).fitted_part(Path::new(""), &instance).unwrap());
    let joints = rig.walk().map(|joint| joint.data.uid).collect();
    let operation = Operation::Tags(TagOperation::AddPart { part, fitted, joints, mirror: false });
    operation.run(&mut rig, &mut UidSource::seeded(3), None).unwrap();
    template.set_rig(rig);
    let saved = template.saved();
    assert!(saved.contains("parts: [(part: \"parts/fk_chain.rig.ron\", onto: [\"a\", \"b\"])]"), "{saved}");
}

#[test]
fn joints_in_another_order_are_refused_and_other_partners_are_told() {
    let mut desk = Desk::new();
    let before = desk.rig.clone();
    let error = desk.add("limb.rig.ron", &["elbow_l", "arm_l"], false).unwrap_err().to_string();
    assert!(error.contains("\"arm_l\" is not next below \"elbow_l\""), "{error}");
    assert_eq!(desk.rig, before);
    let notes = desk.drop(&["hips", "arm_l"], false).notes;
    assert!(notes.iter().any(|note| note.starts_with("1 other pair of joints are partners now")), "{notes:?}");
    let own = "limb was added to joints that have 1 command of their own, which stays";
    assert!(notes.iter().any(|note| note.starts_with(own)), "{notes:?}");
}

#[test]
fn a_file_may_use_the_first_joints_of_a_part_that_a_drop_takes_as_a_whole() {
    let claw = r#"(
        format: 2,
        name: "claw",
        kind: "part",
        joints: [
            (label: "root", tags: [control()]),
            (label: "middle", parent: "root", tags: [control(at: "@joint tip")]),
            (label: "tip", parent: "middle"),
        ],
    )"#;
    let mut desk = Desk::new();
    fs::write(desk.folder.path().join("claw.rig.ron"), claw).unwrap();
    let error = desk.add("claw.rig.ron", &["hips"], false).unwrap_err().to_string();
    assert!(error.contains("needs 3 joints"), "{error}");
    let path = desk.folder.path().join("short.rig.ron");
    let parts = "    parts: [(part: \"claw.rig.ron\", onto: [\"hips\"])],\n)";
    fs::write(&path, MAN.trim_end().trim_end_matches(')').to_owned() + parts).unwrap();
    let hips = desk.joint("hips");
    assert_eq!(load(&path).joint(hips).unwrap().data.tags.len(), 2);
}

#[test]
fn parts_that_a_save_cannot_keep_are_told_once() {
    let notes_of = |desk: &Desk| store_rig_over(&RealDisk, &desk.path(), &desk.rig, &[&desk.path()]).unwrap();
    let is_told = |notes: &[String]| matches!(notes, [note] if note.contains("written out"));
    let tags = |rig: &Rig| rig.walk().map(|joint| joint.data.tags.len()).sum::<usize>();
    // Two joints with one label.
    let mut desk = Desk::new();
    desk.drop(&["arm_l", "elbow_l"], false);
    let other = desk.joint("arm_r");
    apply(&mut desk.rig, RigEdit::SetLabel(other, Some("arm_l".to_owned())));
    let notes = notes_of(&desk);
    assert!(is_told(&notes), "{notes:?}");
    assert_eq!(tags(&load(&desk.path())), 4);
    assert_eq!(notes_of(&desk), Vec::<String>::new());
    // No file of the part any more.
    let mut desk = Desk::new();
    desk.drop(&["arm_l", "elbow_l"], false);
    fs::remove_file(desk.folder.path().join("limb.rig.ron")).unwrap();
    let notes = notes_of(&desk);
    assert!(is_told(&notes), "{notes:?}");
    assert_eq!(tags(&load(&desk.path())), 4);
    // Another file of the part, of which nothing is in the rig.
    let mut desk = Desk::new();
    desk.drop(&["arm_l", "elbow_l"], false);
    desk.save();
    desk.rig = load(&desk.path());
    let renamed = LIMB.replace("upper_l", "over_l").replace("lower_l", "under_l");
    fs::write(desk.folder.path().join("limb.rig.ron"), renamed).unwrap();
    let notes = notes_of(&desk);
    assert!(is_told(&notes), "{notes:?}");
    assert_eq!((desk.instances().len(), tags(&load(&desk.path()))), (0, 4));
}

#[test]
fn a_part_that_is_added_again_for_the_other_side_takes_the_place_of_the_first() {
    let mut desk = Desk::new();
    let knob = "(format: 2, name: \"knob\", kind: \"part\", joints: [\
        (label: \"knob_l\", tags: [control(creation: (name: \"knob_l\"))])])";
    fs::write(desk.folder.path().join("knob.rig.ron"), knob).unwrap();
    desk.add("knob.rig.ron", &["arm_l"], false).unwrap();
    desk.save();
    desk.rig = load(&desk.path());
    let arm = desk.joint("arm_l");
    let tag = desk.rig.joint(arm).unwrap().data.tags[0].uid;
    apply(&mut desk.rig, RigEdit::RemoveTag(arm, tag));
    desk.add("knob.rig.ron", &["arm_l"], true).unwrap();
    let text = desk.save();
    assert!(text.contains("onto: [\"arm_l\"], mirror: true)"), "{text}");
    assert!(!text.contains("changes"), "{text}");
    assert_eq!(desk.instances(), [["arm_l"]]);
}

#[test]
fn the_order_of_own_groups_is_saved_beside_parts() {
    let mut desk = Desk::new();
    let group = |uid: u64, name: &str| GroupData { uid: Uid(uid), name: name.into(), color: [0.5; 3], enabled: true };
    for group in [group(0x91, "one"), group(0x92, "two")] {
        apply(&mut desk.rig, RigEdit::AddLocalGroup(group, usize::MAX));
    }
    desk.drop(&["arm_l", "elbow_l"], false);
    desk.save();
    apply(&mut desk.rig, RigEdit::RemoveLocalGroup(Uid(0x91)));
    apply(&mut desk.rig, RigEdit::AddLocalGroup(group(0x91, "one"), usize::MAX));
    let text = desk.save();
    let own: Vec<String> = load(&desk.path()).groups().iter().map(|group| group.name.clone()).collect();
    assert_eq!(own, ["two", "one", "limb_l"]);
    assert!(text.contains("// It bends."), "{text}");
    assert_eq!(desk.instances(), [["arm_l", "elbow_l"]]);
}
