//! Templates that are written for the first time: as people go on to write them.

use std::{fmt::Write, fs, path::Path};

use rigsmith::{
    files::{RealDisk, load_template, store_rig, store_rig_over},
    instance::RigTemplate,
    rig::{
        JointData, Rig, RigEdit, Uid,
        template::{read_template, write_template},
    },
};

use crate::cli_outputs::{rig, rigsmith};

/// True if a text is in the short form.
fn is_short(text: &str) -> bool {
    let long = ["Command(", "joint_count", "version: \"\"", "features: [", "author: \"\""];
    text.contains("format: 2") && !long.iter().any(|word| text.contains(word))
}

#[track_caller]
fn check_short(folder: &Path, name: &str) {
    let text = fs::read_to_string(folder.join(name)).unwrap();
    assert!(is_short(&text), "{name}: {text}");
    assert_eq!(rigsmith(folder, &["format", "--check", name]).0, 0, "{name} is in its layout: {text}");
}

/// Everything that a rig has, with its uids.
fn whole(rig: &Rig) -> String {
    write_template(rig)
}

#[test]
fn commands_write_what_people_go_on_to_write() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    fs::write(at("a.rig"), "rig 1\njoint 0 -1 0 -0.5 0 root\njoint 1 0 0 0.5 0 tip\n").unwrap();
    let run = |args: &[&str]| {
        let (code, said) = rigsmith(folder.path(), args);
        assert_eq!(code, 0, "{args:?}: {said}");
    };
    run(&["new", "limb", "-o", "limb.rig.ron"]);
    run(&["convert", "a.rig", "text.rig.ron"]);
    run(&["convert", "a.rig", "a.glb"]);
    run(&["convert", "a.glb", "file.rig.ron"]);
    run(&["build", "limb.rig.ron", "-o", "built.rig.ron"]);
    run(&["extract", "limb.rig.ron", "--joints", "clavicle_l", "--hierarchy", "-o", "out.rig.ron"]);
    for name in ["text.rig.ron", "file.rig.ron", "built.rig.ron", "out.rig.ron"] {
        check_short(folder.path(), name);
    }
    for name in ["text.rig.ron", "file.rig.ron"] {
        let labels: Vec<_> = rig(folder.path(), name).walk().map(|joint| joint.data.label.clone()).collect();
        assert_eq!(labels, [Some("root".to_owned()), Some("tip".to_owned())], "{name}");
    }
    let text = fs::read_to_string(at("out.rig.ron")).unwrap();
    assert!(text.contains("feature: \"ik\"") && text.contains("Feature(kind: \"ik\", name: \"ik\")"), "{text}");
}

#[test]
fn every_save_of_a_rig_without_a_file_is_short_and_says_the_same() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    assert_eq!(rigsmith(folder.path(), &["new", "limb", "-o", "limb.rig.ron"]).0, 0);
    let rig = load_template(&RealDisk, &at("limb.rig.ron")).unwrap().rig;
    assert_eq!(store_rig(&RealDisk, &at("stored.rig.ron"), &rig).unwrap(), Vec::<String>::new());
    assert_eq!(store_rig_over(&RealDisk, &at("over.rig.ron"), &rig, &[]).unwrap(), Vec::<String>::new());
    for name in ["stored.rig.ron", "over.rig.ron"] {
        check_short(folder.path(), name);
        let read = load_template(&RealDisk, &at(name)).unwrap().rig;
        let uids = |rig: &Rig| -> Vec<(Uid, Vec<Uid>)> {
            rig.walk().map(|one| (one.data.uid, one.data.tags.iter().map(|tag| tag.uid).collect())).collect()
        };
        assert_eq!((read.uid(), uids(&read)), (rig.uid(), uids(&rig)), "{name}: the same things");
    }
    let made = RigTemplate::new(rig);
    let saved = made.saved();
    assert!(is_short(&saved), "{saved}");
}

/// A text of which nobody reads much is written at once.
#[test]
fn large_rigs_are_written_in_full() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("long.rig.ron");
    let mut rig = Rig::new(Uid(1), "long");
    for number in 0..2001_u64 {
        let mut label = String::new();
        write!(label, "j{number}").unwrap();
        let data = JointData { uid: Uid(10 + number), label: Some(label), ..JointData::default() };
        rig.apply(&RigEdit::AddJoint { joint: Box::new(data), parent: None, index: number as usize }).unwrap();
    }
    store_rig(&RealDisk, &path, &rig).unwrap();
    let text = fs::read_to_string(&path).unwrap();
    assert_eq!(text, whole(&rig));
    assert!(!is_short(&text));
    assert_eq!(whole(&read_template(text.as_bytes()).unwrap().rig), text);
}
