//! Updates of templates whose part instances have other fields: the instances get them, and what is different of them stays.

use std::{fs, path::Path};

use rigsmith::{
    files::{ProjectToSave, RealDisk, load_project, store_project},
    rig::{
        Rig, Uid,
        part::PartInstance,
        update::{Take, same_parts, update},
    },
};
use serde_json::Value;

use super::{
    cli_outputs::{json, rigsmith},
    part_instances::load,
    saved_text::joints,
};

pub(super) const PART: &str = r#"(
    format: 2,
    name: "finger",
    kind: "part",
    chains: [(name: "bones", joints: ["bone_1", "bone_2", "bone_3"], min: 2, max: 9)],
    options: [(name: "size", default: 0.5, form: Slider(min: 0, max: 1), sets: [(tag: "control/bone_2", param: "relative_size")])],
    joints: [
        (label: "bone_1", tags: [Feature(kind: "fk", name: "fk"), control(feature: "fk", creation: (name: "base"))]),
        (label: "bone_2", parent: "bone_1", translation: (0, 1, 0), tags: [control()]),
        (label: "bone_3", parent: "bone_2", translation: (0, 1, 0), tags: [control()]),
    ],
)
"#;

pub(super) const BASE: &str = r#"(
    format: 2,
    name: "hand",
    sockets: [(name: "side", joint: "palm", translation: (1, 0, 0))],
    joints: [
        (label: "palm", translation: (0.5, 1, 0), tags: [control()]),
        (label: "ring", parent: "palm", translation: (0, 1, 0), tags: [parent(targets: "@command control/a_base role:control")]),
    ],
    parts: [
        // The finger.
        (
            part: "finger.rig.ron",
            name: "index",
            parent: "palm",
            translation: (0, 0.1, 0),
            prefix: "a_",
        ),
    ],
)
"#;

/// Changes that a person made of the finger.
const CHANGES: &str = r#"            changes: [(tag: "control/base", params: (relative_size: 0.9))],
"#;

fn mine() -> String {
    BASE.replace("            prefix: \"a_\",\n", &format!("            prefix: \"a_\",\n{CHANGES}"))
}

fn folder(file: &str, mine: &str) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    for (name, text) in [("finger", PART), ("base", BASE), ("file", file), ("mine", mine)] {
        fs::write(folder.path().join(format!("{name}.rig.ron")), text).unwrap();
    }
    folder
}

pub(super) const UPDATE: [&str; 8] =
    ["update", "mine.rig.ron", "--from", "file.rig.ron", "--base", "base.rig.ron", "-o", "out.rig.ron"];

/// The updated text and what was said.
fn updated(folder: &Path, more: &[&str]) -> (String, String) {
    let (code, said) = rigsmith(folder, &[&UPDATE[..], more].concat());
    assert_eq!(code, 0, "{said}");
    assert!(!said.contains("written out") && !said.contains("conflict") || !more.is_empty(), "{said}");
    (fs::read_to_string(folder.join("out.rig.ron")).unwrap(), said)
}

#[test]
fn a_count_of_the_file_comes_to_the_instance_and_changes_of_it_stay() {
    let file = BASE.replace("prefix: \"a_\",", "prefix: \"a_\", count: 5,");
    let mine = mine().replace("changes: [", "changes: [(tag: \"control/bone_3\", enabled: false), ");
    let folder = folder(&file, &mine);
    let (before, (text, said)) = (load(&folder.path().join("mine.rig.ron")), updated(folder.path(), &[]));
    assert!(said.contains("changed  part index count: nothing to 5"), "{said}");
    assert!(said.contains("added"), "the joints are told, too: {said}");
    assert!(text.contains("count: 5") && text.contains("0.9") && text.contains("// The finger."), "{text}");
    // The last joint is the fifth now.
    assert!(text.contains("(tag: \"control/bone_5\", enabled: false)") && !text.contains("Command("), "{text}");
    let rig = load(&folder.path().join("out.rig.ron"));
    assert_eq!(rig.len(), before.len() + 2);
    for joint in before.walk() {
        assert!(rig.joint(joint.data.uid).is_some(), "{:?} keeps its identity", joint.data.label);
    }
    // A save of the same says the same.
    let again = ["update", "out.rig.ron", "--from", "file.rig.ron", "--base", "file.rig.ron", "-o", "again.rig.ron"];
    assert_eq!(rigsmith(folder.path(), &again).0, 0);
    assert_eq!(fs::read_to_string(folder.path().join("again.rig.ron")).unwrap(), text);
}

#[test]
fn rigs_of_projects_take_fields_of_parts_over_as_templates_do() {
    let folder = folder(&BASE.replace("prefix: \"a_\",", "prefix: \"a_\", count: 5,"), &mine());
    let at = |name: &str| folder.path().join(name);
    let rigs = vec![load(&at("mine.rig.ron"))];
    let project = ProjectToSave { name: "shot".into(), rigs: rigs.clone(), ..ProjectToSave::default() };
    store_project(&RealDisk, &at("shot.rigsmith.ron"), &project).unwrap();
    let update =
        ["update", "shot.rigsmith.ron", "--from", "file.rig.ron", "--base", "base.rig.ron", "-o", "out.rigsmith.ron"];
    let (code, said) = rigsmith(folder.path(), &update);
    assert!(code == 0 && said.contains("changed  part index count: nothing to 5"), "{said}");
    assert!(!said.contains("conflict"), "{said}");
    let out = load_project(&RealDisk, &at("out.rigsmith.ron")).unwrap();
    let (_, told) = updated(folder.path(), &[]);
    let template = load(&at("out.rig.ron"));
    assert!(told.contains("part index count"), "{told}");
    assert_eq!(joints(&out.rigs[0]), joints(&template), "the rig is the template's");
    assert!(rigs[0].walk().all(|joint| template.joint(joint.data.uid).is_some()), "all joints keep their identity");
}

#[test]
fn fewer_joints_take_what_was_changed_of_them_along_and_tell() {
    let mine = BASE.replace(
        "prefix: \"a_\",",
        "prefix: \"a_\", changes: [(joint: \"bone_2\", translation: (0, 1.5, 0)), (tag: \"control/base\", params: (relative_size: 2.0))],",
    );
    let file = BASE.replace("prefix: \"a_\",", "prefix: \"a_\", count: 2,");
    let folder = folder(&file, &mine);
    let (text, said) = updated(folder.path(), &[]);
    assert!(said.contains("part index change of joint bone_2"), "{said}");
    assert!(text.contains("count: 2") && text.contains("relative_size: 2.0") && !text.contains("1.5"), "{text}");
    assert_eq!(load(&folder.path().join("out.rig.ron")).len(), 4);
}

#[test]
fn a_prefix_of_the_file_comes_to_the_instance_and_references_hold() {
    let file = BASE.replace("a_", "b_");
    let folder = folder(&file, &mine());
    let (text, said) = updated(folder.path(), &[]);
    assert!(said.contains("changed  part index prefix: \"a_\" to \"b_\""), "{said}");
    assert!(text.contains("prefix: \"b_\"") && text.contains(CHANGES.trim()), "{text}");
    assert!(!text.contains("\"a_") && !text.contains("/a_") && !text.contains("label: \"b_"), "{text}");
    let (_, said) = rigsmith(folder.path(), &["diff", "file.rig.ron", "out.rig.ron"]);
    assert_eq!(said.lines().count(), 1, "only what the person changed differs: {said}");
    assert!(said.contains("relative_size"), "{said}");
}

#[test]
fn each_field_of_an_instance_is_taken_over() {
    let place = "            parent: \"palm\",\n            translation: (0, 0.1, 0),\n";
    let cases = [
        (
            "option",
            BASE.replace("prefix: \"a_\",", "prefix: \"a_\", options: {\"size\": 0.25},"),
            "options.size",
            "0.25",
        ),
        ("feature", BASE.replace("prefix: \"a_\",", "prefix: \"a_\", off: [\"fk\"],"), "off.fk", "off: [\"fk\"]"),
        ("side", BASE.replace("prefix: \"a_\",", "prefix: \"a_\", mirror: true,"), "mirror", "mirror: true"),
        ("socket", BASE.replace(place, "            socket: \"side\",\n"), "socket", "socket: \"side\""),
        (
            "parent",
            BASE.replace("parent: \"palm\",\n            translation", "parent: \"ring\",\n            translation"),
            "parent",
            "parent: \"ring\"",
        ),
        (
            "onto",
            BASE.replace(place, "            onto: [\"ring\"],\n            adds: true,\n"),
            "onto",
            "onto: [\"ring\"]",
        ),
        ("place", BASE.replace("(0, 0.1, 0)", "(0, 0.7, 0)"), "translation", "0.7"),
    ];
    for (name, file, field, written) in cases {
        assert_ne!(file, BASE, "{name}");
        let folder = folder(&file, &mine());
        let (text, said) = updated(folder.path(), &[]);
        let is_told = said.contains(&format!("part index {field}"));
        assert!(is_told && !said.contains('#'), "{name}, by labels that identify: {said}");
        assert!(text.contains(written) && text.contains(CHANGES.trim()), "{name}: {text}");
        let (_, said) = rigsmith(folder.path(), &["diff", "file.rig.ron", "out.rig.ron"]);
        assert!(said.lines().count() == 1 && said.contains("relative_size"), "{name}: {said}");
    }
}

#[test]
fn a_field_that_both_sides_changed_is_a_conflict_with_both_values() {
    let file = BASE.replace("a_", "b_").replace("prefix: \"b_\",", "prefix: \"b_\", count: 4,");
    let folder = folder(&file, &mine().replace("a_", "m_"));
    let (code, said) = rigsmith(folder.path(), &UPDATE);
    assert!(code == 1 && said.contains("conflict part index prefix: \"m_\" here, \"b_\" there"), "{said}");
    assert!(!folder.path().join("out.rig.ron").exists());
    assert_eq!(said.matches("conflict ").count(), 1, "one field, not a line for each joint: {said}");
    for (side, prefix, other) in [("mine", "m_", "b_"), ("theirs", "b_", "m_")] {
        let (text, _) = updated(folder.path(), &["--take", side]);
        assert!(text.contains(&format!("prefix: \"{prefix}\"")) && text.contains("count: 4"), "{side}: {text}");
        assert!(text.contains(CHANGES.trim()) && !text.contains(&format!("\"{other}")), "{side}: {text}");
        let rig = load(&folder.path().join("out.rig.ron"));
        assert!(rig.find_label(&format!("{prefix}bone_4")).is_some(), "{side}");
        fs::remove_file(folder.path().join("out.rig.ron")).unwrap();
    }
}

#[test]
fn fields_that_one_side_changed_each_come_together_and_so_do_more_parts() {
    let mine = mine().replace("prefix: \"a_\",", "prefix: \"a_\", options: {\"size\": 0.75},");
    let thumb = "        (part: \"finger.rig.ron\", name: \"thumb\", parent: \"palm\", translation: (0.3, 0, 0), prefix: \"t_\"),\n    ],\n)\n";
    let file = BASE.replace("prefix: \"a_\",", "prefix: \"a_\", count: 4,").replace("    ],\n)\n", thumb);
    let folder = folder(&file, &mine);
    let (text, said) = updated(folder.path(), &["--keep-base"]);
    assert!(!said.contains("written out") && !said.contains("conflict"), "{said}");
    assert!(text.contains("options: {\"size\": 0.75}") && text.contains("count: 4"), "{text}");
    assert!(text.contains("name: \"thumb\"") && !text.contains("label: \"t_"), "the part comes as a part: {text}");
    // The version that was taken over is kept with its parts, so that the next one is compared with it.
    let base = fs::read_to_string(folder.path().join("out.rig.ron.base")).unwrap();
    assert!(base.contains("count: 4") && base.contains("name: \"thumb\""), "{base}");
    fs::write(folder.path().join("file.rig.ron"), file.replace("count: 4", "count: 6")).unwrap();
    let next = ["update", "out.rig.ron", "--from", "file.rig.ron", "-o", "next.rig.ron"];
    let (code, said) = rigsmith(folder.path(), &next);
    assert!(code == 0 && said.contains("changed  part index count: 4 to 6"), "{said}");
    let text = fs::read_to_string(folder.path().join("next.rig.ron")).unwrap();
    assert!(text.contains("count: 6") && text.contains("options: {\"size\": 0.75}"), "{text}");
}

/// The finger with a joint more.
fn longer() -> String {
    let tip =
        "        (label: \"bone_4\", parent: \"bone_3\", translation: (0, 1, 0), tags: [control()]),\n    ],\n)\n";
    let longer = PART.replace("    ],\n)\n", tip);
    assert_ne!(longer, PART);
    longer
}

#[test]
fn another_file_of_a_part_is_a_field_of_the_instance() {
    let file = BASE.replace("finger.rig.ron", "finger_v2.rig.ron");
    let folder = folder(&file, &mine());
    fs::write(folder.path().join("finger_v2.rig.ron"), longer()).unwrap();
    let before = load(&folder.path().join("mine.rig.ron"));
    let (text, said) = updated(folder.path(), &[]);
    assert!(said.contains("changed  part index part: \"finger.rig.ron\" to \"finger_v2.rig.ron\""), "{said}");
    assert!(said.contains("added    a_bone_4") && !said.contains("renamed"), "{said}");
    assert!(text.contains("part: \"finger_v2.rig.ron\"") && text.contains(CHANGES.trim()), "{text}");
    assert!(!text.contains("label: \"a_") && text.contains("// The finger."), "{text}");
    let rig = load(&folder.path().join("out.rig.ron"));
    assert_eq!(rig.len(), before.len() + 1);
    for joint in before.walk() {
        assert!(rig.joint(joint.data.uid).is_some(), "{:?} keeps its identity", joint.data.label);
    }
    // The same version again says nothing more.
    let again = ["update", "out.rig.ron", "--from", "file.rig.ron", "--base", "file.rig.ron", "-o", "again.rig.ron"];
    let (code, said) = rigsmith(folder.path(), &again);
    assert!(code == 0 && !said.contains("renamed") && !said.contains("part index"), "{said}");
    assert_eq!(fs::read_to_string(folder.path().join("again.rig.ron")).unwrap(), text);
}

#[test]
fn another_file_of_a_part_on_both_sides_is_a_conflict() {
    let file = BASE.replace("finger.rig.ron", "finger_v2.rig.ron");
    let folder = folder(&file, &mine().replace("finger.rig.ron", "finger_own.rig.ron"));
    fs::write(folder.path().join("finger_v2.rig.ron"), longer()).unwrap();
    fs::write(folder.path().join("finger_own.rig.ron"), PART).unwrap();
    let (code, said) = rigsmith(folder.path(), &UPDATE);
    let told = "conflict part index part: \"finger_own.rig.ron\" here, \"finger_v2.rig.ron\" there";
    assert!(code == 1 && said.contains(told), "{said}");
    assert_eq!(said.matches("conflict ").count(), 1, "one field, not a line for each joint: {said}");
    for (side, joints, file) in [("mine", 5, "finger_own.rig.ron"), ("theirs", 6, "finger_v2.rig.ron")] {
        let (text, _) = updated(folder.path(), &["--take", side]);
        assert!(text.contains(&format!("part: \"{file}\"")) && text.contains(CHANGES.trim()), "{side}: {text}");
        assert_eq!(load(&folder.path().join("out.rig.ron")).len(), joints, "{side}");
        fs::remove_file(folder.path().join("out.rig.ron")).unwrap();
    }
}

#[test]
fn files_of_parts_are_compared_over_folders() {
    let folder = folder(BASE, &mine());
    let at = |name: &str| folder.path().join(name);
    fs::create_dir(at("new")).unwrap();
    let update =
        ["update", "mine.rig.ron", "--from", "new/file.rig.ron", "--base", "base.rig.ron", "-o", "out.rig.ron"];
    // The same file by another way is no change.
    let same =
        BASE.replace("finger.rig.ron", "../finger.rig.ron").replace("prefix: \"a_\",", "prefix: \"a_\", count: 5,");
    fs::write(at("new/file.rig.ron"), same).unwrap();
    let (code, said) = rigsmith(folder.path(), &update);
    assert!(code == 0 && said.contains("part index count") && !said.contains("part index part"), "{said}");
    let text = fs::read_to_string(at("out.rig.ron")).unwrap();
    assert!(text.contains("part: \"finger.rig.ron\"") && text.contains("count: 5"), "{text}");
    fs::remove_file(at("out.rig.ron")).unwrap();
    // Another file is called by its way from the rig.
    fs::write(at("new/file.rig.ron"), BASE.replace("finger.rig.ron", "finger_v2.rig.ron")).unwrap();
    fs::write(at("new/finger_v2.rig.ron"), longer()).unwrap();
    let (code, said) = rigsmith(folder.path(), &update);
    assert!(code == 0 && said.contains("part index part: \"finger.rig.ron\" to \"new/finger_v2.rig.ron\""), "{said}");
    let text = fs::read_to_string(at("out.rig.ron")).unwrap();
    assert!(text.contains("part: \"new/finger_v2.rig.ron\"") && text.contains(CHANGES.trim()), "{text}");
}

/// A part without a name.
const NAMELESS: &str = r#"(
    format: 2,
    name: "hand",
    joints: [
        (label: "palm", translation: (0.5, 1, 0)),
        (label: "ring", parent: "palm", translation: (0, 1, 0)),
    ],
    parts: [
        (part: "finger.rig.ron", onto: ["palm"], adds: true, prefix: "a_"),
    ],
)
"#;

/// Asserts that the joints of a rig, and the tags on them, have their identities in the updated rig.
#[track_caller]
fn assert_same_identities(before: &Rig, updated: &Rig) {
    for joint in before.walk() {
        assert!(updated.joint(joint.data.uid).is_some(), "{:?} keeps its identity", joint.data.label);
        for tag in &joint.data.tags {
            assert!(updated.find_tag(tag.uid).is_some(), "{:?} keeps the identities of its tags", joint.data.label);
        }
    }
}

#[test]
fn a_nameless_part_that_goes_onto_other_joints_is_the_same_part() {
    let own = "prefix: \"a_\", changes: [(tag: \"control/bone_2\", params: (relative_size: 0.9))]";
    let mine = NAMELESS.replace("prefix: \"a_\"", own);
    let file = NAMELESS.replace("onto: [\"palm\"]", "onto: [\"ring\"]");
    let folder = folder(&file, &mine);
    fs::write(folder.path().join("base.rig.ron"), NAMELESS).unwrap();
    let before = load(&folder.path().join("mine.rig.ron"));
    let (text, said) = updated(folder.path(), &["--keep-base"]);
    assert!(said.contains("renamed  part finger.rig.ron on palm to finger.rig.ron on ring?"), "{said}");
    assert!(said.contains("part finger.rig.ron onto: [palm] to [ring]") && !said.contains("conflict"), "{said}");
    assert!(text.contains("onto: [\"ring\"]") && text.contains("relative_size: 0.9"), "{text}");
    assert!(!text.contains("label: \"a_"), "the part stays a part: {text}");
    assert_same_identities(&before, &load(&folder.path().join("out.rig.ron")));
    // The next version is compared with this one, and does not tell of it again.
    fs::write(folder.path().join("file.rig.ron"), file.replace("adds: true", "adds: true, count: 4")).unwrap();
    let next = ["update", "out.rig.ron", "--from", "file.rig.ron", "-o", "next.rig.ron"];
    let (code, said) = rigsmith(folder.path(), &next);
    assert!(code == 0 && said.contains("count: nothing to 4") && !said.contains("renamed"), "{said}");
    let text = fs::read_to_string(folder.path().join("next.rig.ron")).unwrap();
    assert!(text.contains("count: 4") && text.contains("relative_size: 0.9"), "{text}");
}

/// The text with another name of the finger.
fn called(text: &str, name: &str) -> String {
    let called = text.replace("name: \"index\"", &format!("name: \"{name}\""));
    assert_ne!(called, text);
    called
}

#[test]
fn a_part_with_another_name_is_the_same_part() {
    let part = PART.replace("    joints: [", "    sockets: [(name: \"tip\", joint: \"bone_3\")],\n    joints: [");
    let part = part.replace("(name: \"size\"", "(name: \"size by name\"");
    // A part of one's own hangs on the one that is called otherwise.
    let own = "        (part: \"finger.rig.ron\", name: \"nail\", socket: \"index.tip\", prefix: \"n_\"),\n    ],\n)\n";
    let mine = mine().replace("    ],\n)\n", own);
    let fields = "prefix: \"a_\", count: 4, options: {\"size by name\": 0.25},";
    let file = called(BASE, "pointer").replace("prefix: \"a_\",", fields);
    let folder = folder(&file, &mine);
    fs::write(folder.path().join("finger.rig.ron"), part).unwrap();
    let before = load(&folder.path().join("mine.rig.ron"));
    let (text, said) = updated(folder.path(), &["--keep-base"]);
    assert!(said.contains("renamed  part index to pointer?") && !said.contains("index name"), "{said}");
    assert!(said.contains("count: nothing to 4") && !said.contains("conflict"), "{said}");
    assert!(said.contains("options.size by name: nothing to 0.25"), "no change of the name: {said}");
    assert!(text.contains("name: \"pointer\"") && text.contains(CHANGES.trim()), "{text}");
    assert!(text.contains("socket: \"pointer.tip\"") && text.contains("// The finger."), "{text}");
    assert!(!text.contains("label: \"a_"), "the part stays a part: {text}");
    assert_same_identities(&before, &load(&folder.path().join("out.rig.ron")));
    // The next version is compared with this one, and does not tell of the name again.
    fs::write(folder.path().join("file.rig.ron"), file.replace("count: 4", "count: 5")).unwrap();
    let next = ["update", "out.rig.ron", "--from", "file.rig.ron", "-o", "next.rig.ron"];
    let (code, said) = rigsmith(folder.path(), &next);
    assert!(code == 0 && said.contains("count: 4 to 5") && !said.contains("renamed"), "{said}");
}

#[test]
fn two_names_of_one_part_are_a_conflict() {
    let folder = folder(&called(BASE, "pointer"), &called(&mine(), "forefinger"));
    let (code, said) = rigsmith(folder.path(), &UPDATE);
    assert!(code == 1 && said.contains("name: \"forefinger\" here, \"pointer\" there"), "{said}");
    assert!(!said.contains("renamed"), "{said}");
    assert_eq!(said.matches("conflict ").count(), 1, "{said}");
    for (side, name) in [("mine", "forefinger"), ("theirs", "pointer")] {
        let (text, _) = updated(folder.path(), &["--take", side]);
        assert!(text.contains(&format!("name: \"{name}\"")) && text.contains(CHANGES.trim()), "{side}: {text}");
        fs::remove_file(folder.path().join("out.rig.ron")).unwrap();
    }
}

#[test]
fn what_a_part_with_another_name_brings_onto_joints_is_the_same() {
    // References to commands of the part have uids that follow from its instance.
    let part = PART.replace(
        "(label: \"bone_3\", parent: \"bone_2\", translation: (0, 1, 0), tags: [control()])",
        "(label: \"bone_3\", parent: \"bone_2\", translation: (0, 1, 0), tags: [parent(targets: \"@command control/base role:control\"), point(targets: \"@command control/base role:control\")])",
    );
    assert_ne!(part, PART);
    let file = |name: &str| {
        format!(
            "(\n    format: 2,\n    name: \"hand\",\n    joints: [\n        (label: \"a\"),\n        (label: \"b\", parent: \"a\", translation: (0, 1, 0)),\n        (label: \"c\", parent: \"b\", translation: (0, 1, 0)),\n    ],\n    parts: [(part: \"finger.rig.ron\", name: \"{name}\", onto: [\"a\", \"b\", \"c\"])],\n)\n"
        )
    };
    let folder = folder(&file("pointer"), &file("index"));
    fs::write(folder.path().join("finger.rig.ron"), part).unwrap();
    let [before, after] = ["mine", "file"].map(|name| load(&folder.path().join(format!("{name}.rig.ron"))));
    let tags = |rig: &Rig| rig.walk().flat_map(|joint| &joint.data.tags).map(|tag| tag.uid).collect::<Vec<_>>();
    assert_eq!(tags(&before).len(), 5);
    assert!(tags(&before).iter().all(|tag| after.find_tag(*tag).is_none()), "all have other uids in the file");
    // As rigs that run are updated, whose document has the joints and tags alone.
    let updated = update(Some(&before), &before, &after, Take::Mine);
    assert_eq!(tags(&updated.rig), tags(&before));
    assert!(updated.changes.is_empty(), "{:?}", updated.changes);
}

#[test]
fn parts_that_could_be_several_are_none_of_them() {
    let part = |uid: u64, name: &str, onto: &[&str]| {
        let onto: Vec<String> = onto.iter().map(|label| (*label).to_owned()).collect();
        PartInstance {
            uid: Uid(uid),
            part: "finger.rig.ron".to_owned(),
            name: name.to_owned(),
            onto,
            ..PartInstance::default()
        }
    };
    let derived = |onto: &str| PartInstance {
        uid: Uid::derived(["part instance", "finger.rig.ron", onto]),
        ..part(0, "", &[onto])
    };
    let uids = |own: &[&PartInstance], other: &[&PartInstance]| {
        let lists = [own, other].map(|list| list.iter().map(|part| (*part).clone()).collect::<Vec<_>>());
        same_parts(&lists[0], &lists[1]).into_iter().collect::<Vec<_>>()
    };
    let (a, b, c, d) = (derived("a"), derived("b"), derived("c"), derived("d"));
    assert_eq!(uids(&[&a], &[&b]), [(b.uid, a.uid)]);
    assert_eq!(uids(&[&a, &c], &[&b, &c]), [(b.uid, a.uid)], "one stays as it is");
    assert!(uids(&[&a, &c], &[&b, &d]).is_empty(), "two moved");
    assert!(uids(&[&part(1, "", &["a"])], &[&part(2, "", &["b"])]).is_empty(), "both uids are written");
    assert!(uids(&[&part(1, "index", &[])], &[&b]).is_empty(), "one has a name");
    let named = |name: &str| PartInstance { name: name.to_owned(), ..derived(name) };
    let (one, other) = (named("one"), named("other"));
    let moved = PartInstance { parent: Some("palm".to_owned()), ..other.clone() };
    let of = |part: &PartInstance| PartInstance { onto: Vec::new(), ..part.clone() };
    assert_eq!(uids(&[&of(&one)], &[&of(&other)]), [(other.uid, one.uid)], "another name in one place");
    assert!(uids(&[&of(&one)], &[&of(&moved)]).is_empty(), "another name in another place");
    let with = |part: &PartInstance| PartInstance { prefix: "r_".to_owned(), ..of(part) };
    assert_eq!(uids(&[&with(&one)], &[&with(&moved)]), [(moved.uid, one.uid)], "with one prefix");
    assert!(uids(&[&of(&one), &of(&named("third"))], &[&of(&other)]).is_empty(), "two in one place");
}

/// Differences that `rigsmith diff` lists: kind, field and the values of each change.
fn differences(folder: &Path, from: &str, to: &str) -> Vec<[Value; 4]> {
    let (code, told) = json(folder, &["diff", from, to]);
    assert_eq!(code, 0, "{told}");
    let changes = told["changes"].as_array().unwrap();
    changes.iter().map(|change| ["kind", "field", "from", "to"].map(|key| change[key].clone())).collect()
}

#[test]
fn differences_of_parts_are_told_at_their_instances() {
    let thumb = "        (part: \"finger.rig.ron\", name: \"thumb\", parent: \"palm\", translation: (0.3, 0, 0), prefix: \"t_\"),\n    ],\n)\n";
    let text = |text: &str| Value::from(text);
    let finger = "\"finger.rig.ron\"";
    let cases: [(String, [Value; 4]); 4] = [
        (
            BASE.replace("prefix: \"a_\",", "prefix: \"a_\", count: 5,"),
            [text("changed"), text("part index count"), Value::Null, text("5")],
        ),
        (
            BASE.replace("\"a_\"", "\"b_\"").replace("/a_base", "/b_base"),
            [text("changed"), text("part index prefix"), text("\"a_\""), text("\"b_\"")],
        ),
        (
            BASE.replace("finger.rig.ron", "finger_v2.rig.ron"),
            [text("changed"), text("part index part"), text(finger), text("\"finger_v2.rig.ron\"")],
        ),
        (BASE.replace("    ],\n)\n", thumb), [text("added"), text("part thumb"), Value::Null, text(finger)]),
    ];
    for (file, told) in cases {
        assert_ne!(file, BASE);
        let folder = folder(&file, BASE);
        fs::write(folder.path().join("finger_v2.rig.ron"), longer()).unwrap();
        assert_eq!(differences(folder.path(), "base.rig.ron", "file.rig.ron"), std::slice::from_ref(&told));
        let [kind, field, from, to] = told;
        let back = if kind == "added" { text("removed") } else { kind };
        assert_eq!(differences(folder.path(), "file.rig.ron", "base.rig.ron"), [[back, field, to, from]]);
    }
}
