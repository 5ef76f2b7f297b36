//! Rigs made of other templates, several times, and their updates: on the command line.

use std::{fs, path::Path};

use rigsmith::rig::{Rig, TagKind, update::Take};
use serde_json::Value;

use super::{
    cli_outputs::{json, rig, rigsmith},
    template_text::read,
};

const TAIL: &str = r#"(
    format: 2,
    name: "tail",
    groups: [(name: "back")],
    joints: [
        (label: "tail_1", group: "back", translation: (0, 1, 0), tags: [control(shape: "square")]),
        (label: "tail_2", parent: "tail_1", translation: (0, 0.3, 0), tags: [control(size: 0.5)]),
        (label: "tail_3", parent: "tail_2", translation: (0, 0.3, 0), tags: [parent(targets: "@joint tail_1")]),
    ],
)
"#;

/// A body, with a joint that has the label of one of the tail's and nothing to do with it.
const BODY: &str = r#"(
    format: 2,
    name: "body",
    joints: [
        (label: "hips", translation: (0, 0.9, 0)),
        (label: "tail_1", parent: "hips", translation: (0.5, 0, 0), tags: [null]),
    ],
)
"#;

/// The next version of the tail: the root stands elsewhere, a parameter has another value, and there is a joint more.
fn next_tail() -> String {
    TAIL.replace("(0, 1, 0)", "(0, 1, -0.25)").replace("size: 0.5", "size: 0.75").replace(
        "    ],\n)",
        "        (label: \"tail_4\", parent: \"tail_3\", translation: (0, 0.3, 0), tags: [control]),\n    ],\n)",
    )
}

fn written(folder: &Path, files: &[(&str, &str)]) {
    for (name, text) in files {
        fs::write(folder.join(name), text).unwrap();
    }
}

fn labels(rig: &Rig) -> Vec<&str> {
    rig.walk().filter_map(|joint| joint.data.label.as_deref()).collect()
}

/// Places in the rig's space of the joint with a label.
#[track_caller]
fn height_and_depth(rig: &Rig, label: &str) -> (f32, f32) {
    let at = rig.position(rig.find_label(label).unwrap_or_else(|| panic!("no {label}: {:?}", labels(rig))));
    ((at.y * 1000.0).round() / 1000.0, (at.z * 1000.0).round() / 1000.0)
}

#[test]
fn merging_a_rig_many_times_uses_no_label_twice() {
    let folder = tempfile::tempdir().unwrap();
    written(folder.path(), &[("tail.rig.ron", TAIL)]);
    let merge = ["merge", "tail.rig.ron", "tail.rig.ron", "tail.rig.ron", "tail.rig.ron", "-o", "x.rig.ron"];
    let (code, said) = rigsmith(folder.path(), &merge);
    assert_eq!(code, 0, "{said}");
    let (code, said) = rigsmith(folder.path(), &["check", "x.rig.ron"]);
    assert!(code == 0 && !said.contains("more than once"), "{said}");
    let merged = rig(folder.path(), "x.rig.ron");
    let all = labels(&merged);
    assert_eq!(all[..6], ["tail_1", "tail_2", "tail_3", "tail_tail_1", "tail_tail_2", "tail_tail_3"]);
    assert_eq!(
        all[6..],
        ["tail_2_tail_1", "tail_2_tail_2", "tail_2_tail_3", "tail_3_tail_1", "tail_3_tail_2", "tail_3_tail_3"]
    );
    let groups: Vec<&str> = merged.groups().iter().map(|group| group.name.as_str()).collect();
    assert_eq!(groups, ["back", "tail_back", "tail_2_back", "tail_3_back"]);
}

#[test]
fn an_update_reaches_every_copy_and_nothing_else() {
    let folder = tempfile::tempdir().unwrap();
    let next = next_tail();
    let bare = BODY.replace("\"tail_1\"", "\"bag\"");
    written(
        folder.path(),
        &[("tail.rig.ron", TAIL), ("next.rig.ron", &next), ("body.rig.ron", BODY), ("bare.rig.ron", &bare)],
    );
    // Where a joint of the body has a label of the tail's, and where all labels and uids are free for the first tail.
    for (body, firsts, own) in [
        ("body.rig.ron", ["tail_tail_1", "tail_2", "tail_4"], "tail_1"),
        ("bare.rig.ron", ["tail_1", "tail_2", "tail_4"], "bag"),
    ] {
        let merge = ["merge", body, "tail.rig.ron", "tail.rig.ron", "--parent", "hips", "-o", "r.rig.ron"];
        let (code, said) = rigsmith(folder.path(), &merge);
        assert_eq!(code, 0, "{said}");
        let merged = rig(folder.path(), "r.rig.ron");
        let second = labels(&merged)[5].to_owned();
        assert_eq!(height_and_depth(&merged, &second), (1.0, 0.0), "{:?}", labels(&merged));
        let update = ["update", "r.rig.ron", "--from", "next.rig.ron", "--base", "tail.rig.ron"];
        let (code, told) = json(folder.path(), &[&update[..], &["-o", "out.rig.ron"]].concat());
        assert_eq!((code, &told["conflicts"]), (0, &Value::from(0)), "{body}: {told}");
        let added = told["changes"].as_array().unwrap().iter().filter(|change| change["kind"] == "added").count();
        assert_eq!(added, 2, "{told}");

        let out = rig(folder.path(), "out.rig.ron");
        assert_eq!(out.len(), merged.len() + 2);
        assert_eq!(out.about(), merged.about(), "the header is the body's");
        for label in [firsts[0], &second] {
            assert_eq!(height_and_depth(&out, label), (1.0, -0.25), "{body} {label}");
        }
        let sizes = out
            .walk()
            .flat_map(|joint| &joint.data.tags)
            .filter(|tag| matches!(&tag.kind, TagKind::Command { params, .. } if params.contains("size: 0.75")));
        assert_eq!(sizes.count(), 2, "{body}");
        for label in firsts {
            assert!(out.find_label(label).is_some(), "{body}: {label} of {:?}", labels(&out));
        }
        let uid = merged.find_label(own).unwrap();
        assert_eq!(out.joint(uid).unwrap().data, merged.joint(uid).unwrap().data, "the body's own joint");
        // Once more there is nothing to change.
        let (_, told) = json(
            folder.path(),
            &["update", "out.rig.ron", "--from", "next.rig.ron", "--base", "next.rig.ron", "--dry-run"],
        );
        assert_eq!(told["changes"], Value::Array(Vec::new()));
    }
}

#[test]
fn what_a_person_changed_of_a_copy_stays() {
    let folder = tempfile::tempdir().unwrap();
    let bare = BODY.replace("\"tail_1\"", "\"bag\"");
    written(folder.path(), &[("tail.rig.ron", TAIL), ("next.rig.ron", &next_tail()), ("body.rig.ron", &bare)]);
    let merge = ["merge", "body.rig.ron", "tail.rig.ron", "tail.rig.ron", "--parent", "hips", "-o", "r.rig.ron"];
    assert_eq!(rigsmith(folder.path(), &merge).0, 0);
    let text = fs::read_to_string(folder.path().join("r.rig.ron")).unwrap();
    let place = text.rfind("size: 0.5").unwrap();
    let text = format!("{}size: 0.6{}", &text[..place], &text[place + "size: 0.5".len()..]);
    written(folder.path(), &[("mine.rig.ron", &text)]);
    let update = ["update", "mine.rig.ron", "--from", "next.rig.ron", "--base", "tail.rig.ron", "--dry-run"];
    let (_, told) = json(folder.path(), &update);
    let conflicts: Vec<&Value> =
        told["changes"].as_array().unwrap().iter().filter(|change| change["conflict"] == true).collect();
    let [one] = conflicts[..] else { panic!("{told}") };
    assert_eq!((&one["from"], &one["to"]), (&"0.6".into(), &"0.75".into()), "{told}");
    assert_eq!(one["joint"], "tail_tail_2", "{told}");
}

#[test]
fn an_update_reaches_injected_tags() {
    let folder = tempfile::tempdir().unwrap();
    let host = r#"(
    format: 2,
    name: "host",
    joints: [
        (label: "a"),
        (label: "b", parent: "a", translation: (0, 1, 0)),
        (label: "c", parent: "b", translation: (0, 1, 0)),
        (label: "tail_2", translation: (3, 0, 0), tags: [control(size: 0.1)]),
    ],
)
"#;
    written(folder.path(), &[("tail.rig.ron", TAIL), ("next.rig.ron", &next_tail()), ("host.rig.ron", host)]);
    let inject = ["inject", "tail.rig.ron", "host.rig.ron", "--joints", "a,b,c", "-o", "r.rig.ron"];
    let (code, said) = rigsmith(folder.path(), &inject);
    assert_eq!(code, 0, "{said}");
    let before = rig(folder.path(), "r.rig.ron");
    let update = ["update", "r.rig.ron", "--from", "next.rig.ron", "--base", "tail.rig.ron", "-o", "out.rig.ron"];
    let (code, told) = json(folder.path(), &update);
    let changes = told["changes"].as_array().unwrap();
    assert_eq!((code, changes.len()), (0, 1), "{told}");
    assert_eq!((&changes[0]["joint"], &changes[0]["to"]), (&"b".into(), &"0.75".into()), "{told}");
    let out = rig(folder.path(), "out.rig.ron");
    let joints = |rig: &Rig| rig.walk().map(|joint| (joint.data.label.clone(), joint.data.rest)).collect::<Vec<_>>();
    assert_eq!(joints(&out), joints(&before), "joints are the host's");
}

#[test]
fn other_names_of_features_groups_and_inputs_are_told_as_such() {
    let first = r#"(
    format: 2,
    name: "r",
    groups: [(name: "arm")],
    inputs: [(name: "wheel")],
    joints: [
        (label: "a", group: "arm", tags: [
            Feature(kind: "generic", name: "ik"),
            control(feature: "ik"),
            parent(targets: "@input wheel"),
        ]),
        (label: "b", parent: "a", group: "arm"),
    ],
)
"#;
    let next = first.replace("\"ik\"", "\"kin\"").replace("\"arm\"", "\"limb\"").replace("wheel", "rudder");
    let mine = first.replace("name: \"ik\")", "name: \"ik\", enabled: false)");
    let folder = tempfile::tempdir().unwrap();
    written(folder.path(), &[("first.rig.ron", first), ("next.rig.ron", &next), ("mine.rig.ron", &mine)]);
    let update = ["update", "mine.rig.ron", "--from", "next.rig.ron", "--base", "first.rig.ron", "--dry-run"];
    let (code, told) = json(folder.path(), &update);
    let kinds: Vec<&Value> = told["changes"].as_array().unwrap().iter().map(|change| &change["kind"]).collect();
    assert_eq!((code, kinds), (0, vec![&Value::from("renamed"); 3]), "{told}");
    let (_, said) = rigsmith(folder.path(), &["diff", "first.rig.ron", "next.rig.ron"]);
    for line in
        ["renamed  generic/ik to generic/kin?", "renamed  group arm to limb?", "renamed  input wheel to rudder?"]
    {
        assert!(said.contains(line), "{line}: {said}");
    }
    // What was off stays off, and everything keeps its identity.
    let [first, next, mine] = [first, &next, &mine].map(read);
    let updated = rigsmith::rig::update::update(Some(&first), &mine, &next, Take::Mine).rig;
    assert_eq!((&updated.groups()[0].name, updated.groups()[0].uid), (&"limb".to_owned(), first.groups()[0].uid));
    assert_eq!((&updated.inputs()[0].name, updated.inputs()[0].uid), (&"rudder".to_owned(), first.inputs()[0].uid));
    let tag = |rig: &Rig| rig.walk().next().unwrap().data.tags[0].clone();
    assert_eq!((tag(&updated).uid, tag(&updated).enabled), (tag(&first).uid, false));
    assert!(matches!(tag(&updated).kind, TagKind::Feature { name, .. } if name == "kin"));
    // Another feature with other commands is another one.
    let other = read(
        r#"(format: 2, name: "r", joints: [(label: "a", tags: [Feature(kind: "generic", name: "new"), null(feature: "new")])])"#,
    );
    let old = read(
        r#"(format: 2, name: "r", joints: [(label: "a", tags: [Feature(kind: "generic", name: "ik"), control(feature: "ik")])])"#,
    );
    let changes = rigsmith::rig::update::diff(&old, &other);
    assert!(changes.iter().all(|change| change.conflict || !format!("{change}").starts_with("renamed")), "{changes:?}");
}

#[test]
fn roundings_are_no_differences() {
    let folder = tempfile::tempdir().unwrap();
    let biped = include_str!("../../assets/templates/biped.rig.ron");
    let longer = biped.replace("onto: [\"hips\"], adds: true)", "onto: [\"hips\"], adds: true, count: 6)");
    assert_ne!(biped, longer);
    written(folder.path(), &[("biped.rig.ron", biped), ("longer.rig.ron", &longer)]);
    let (code, told) = json(folder.path(), &["diff", "biped.rig.ron", "longer.rig.ron"]);
    let changes = told["changes"].as_array().unwrap();
    assert!(code == 0 && changes.len() == 1, "the number of joints alone is told: {told}");
    assert_eq!(changes[0]["field"], "part parts/spine.rig.ron count", "{told}");
    // Of the rigs as they are, only the spine differs.
    let [biped, longer] = ["biped.rig.ron", "longer.rig.ron"].map(|name| rig(folder.path(), name));
    let changes = rigsmith::rig::update::diff(&biped, &longer);
    let joints: Vec<&str> = changes.iter().filter_map(|change| change.joint.as_deref()).collect();
    assert!(joints.contains(&"spine") && joints.contains(&"chest"), "{joints:?}");
    assert!(joints.iter().all(|joint| joint.starts_with("spine") || *joint == "chest"), "{joints:?}");
}

#[test]
fn roots_that_a_part_adds_stand_beside_the_joint_that_it_goes_onto() {
    let folder = tempfile::tempdir().unwrap();
    let head = |more: &str| {
        format!(
            "(format: 2, name: \"h\", joints: [(label: \"head\", translation: (0, 3, 0)), \
             (label: \"j\", parent: \"head\", translation: (0, 0.5, 0.25), rotation: (20, 0, 0))], \
             parts: [(part: \"parts/lips.rig.ron\", onto: [\"j\"], adds: true{more})])"
        )
    };
    written(folder.path(), &[("h.rig.ron", &head("")), ("big.rig.ron", &head(", scale: 2"))]);
    for (name, scale) in [("h.rig.ron", 1.0), ("big.rig.ron", 2.0)] {
        let lips = rig(folder.path(), name);
        let find = |label: &str| lips.find_label(label).unwrap_or_else(|| panic!("{label}: {:?}", labels(&lips)));
        assert_eq!(lips.roots(), [find("head")]);
        // As in the part's file: the jaw is at (0, 1.55, 0.02), the upper lip at (0, 1.535, 0.105).
        let offset = bevy::math::Vec3::new(0.0, -0.015, 0.085) * scale;
        let (lip, jaw) = (find("lip_upper"), find("j"));
        assert_eq!(lips.joint(lip).unwrap().parent, lips.joint(jaw).unwrap().parent);
        assert!((lips.position(lip) - lips.position(jaw)).distance(offset) < 1e-5, "{}", lips.position(lip));
    }
}
