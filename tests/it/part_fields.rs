//! Updates of templates whose part instances have other fields: the instances get them, and what is different of them stays.

use std::{fs, path::Path};

use super::{cli_outputs::rigsmith, part_instances::load};

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

const BASE: &str = r#"(
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

const UPDATE: [&str; 8] =
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
        assert!(said.contains(&format!("part index {field}")), "{name}: {said}");
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
