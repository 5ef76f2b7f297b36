//! `rigsmith update --clips`: files of clips go with their rig to a new version of its template.

use std::{collections::BTreeSet, fs, path::Path, sync::Arc};

use bevy::math::Quat;
use rigsmith::{
    files::{ProjectTemplate, ProjectToSave, RealDisk, load_animation, load_project, load_template, store_project},
    modules,
    processor::Builder,
    rig::{
        Rig, RigEdit, Uid,
        animation::{Key, Property, RigClip, Track, TrackTarget},
        format::animation::write_animation,
        template::write_template,
    },
    solve::program::{CompileOptions, RigProgram},
};
use serde_json::Value;

use crate::{
    animation::keep::{NEAR, flip_all, gentle, joints_off},
    cli_build::rigsmith,
};

fn json(folder: &Path, args: &[&str]) -> Value {
    let answer = rigsmith(folder, &[args, &["--json"]].concat());
    assert_eq!(answer.code, 0, "{args:?}: {} {}", answer.out, answer.err);
    serde_json::from_str(&answer.out).unwrap()
}

fn program(rig: &Rig) -> Arc<RigProgram> {
    let built = Builder::build(rig, &Arc::new(modules::all())).unwrap();
    Arc::new(RigProgram::compile(&built, &CompileOptions::default()).unwrap())
}

/// Joints that the notes of updated clips name.
fn noted_joints(facts: &Value) -> BTreeSet<Uid> {
    let notes = facts["notes"].as_array().unwrap().iter();
    notes.map(|note| note["joint"].as_str().unwrap().parse().unwrap()).collect()
}

#[test]
fn clips_are_written_beside_the_output_and_move_the_joints_as_before() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let mut mine = gentle();
    let built = Builder::build(&mine, &Arc::new(modules::all())).unwrap();
    let clip = mine.clips()[0].clone();
    let text = write_animation(&mine, Some(&built), mine.clips());
    mine.apply(&RigEdit::RemoveClip(clip.uid)).unwrap();
    let mut next = mine.clone();
    flip_all(&mut next);
    fs::write(at("mine.rig.ron"), write_template(&mine)).unwrap();
    fs::write(at("next.rig.ron"), write_template(&next)).unwrap();
    fs::write(at("sway.anim.ron"), &text).unwrap();
    fs::create_dir(at("out")).unwrap();
    let base = ["update", "mine.rig.ron", "--from", "next.rig.ron", "--base", "mine.rig.ron"];
    let update = [&base[..], &["--clips", "sway.anim.ron"]].concat();

    // Without an output the command only tells.
    let told = json(folder.path(), &[&update[..], &["--dry-run"]].concat());
    assert_eq!((&told["clips"][0]["re_expressed"], &told["clips"][0]["clips"]), (&1.into(), &1.into()), "{told}");
    assert_eq!(fs::read_dir(at("out")).unwrap().count(), 0);

    let told = json(folder.path(), &[&update[..], &["-o", "out/new.rig.ron"]].concat());
    assert_eq!(fs::read_to_string(at("sway.anim.ron")).unwrap(), text, "an input stays");
    let updated = load_template(&RealDisk, &at("out/new.rig.ron")).unwrap().rig;
    let read = load_animation(&RealDisk, &at("out/sway.anim.ron")).unwrap();
    let facts = &told["clips"][0];
    assert_eq!((&facts["set_aside"], &facts["missing"]), (&Value::Array(vec![]), &Value::Array(vec![])), "{facts}");
    let listed = noted_joints(facts);
    assert!(listed.len() * 2 < mine.len(), "{facts}");
    let (from, to) = (program(&mine), program(&updated));
    let times: Vec<f32> = (0..=60).map(|frame| frame as f32 / clip.frame_rate).chain(clip.key_times()).collect();
    for (joint, (distance, angle)) in joints_off((&from, &clip), (&to, &read.clips[0]), &times) {
        let is_held = distance <= NEAR.0 && angle <= NEAR.1;
        assert!(is_held || listed.contains(&joint), "{joint} is off by {distance} m and {angle}°");
    }
    let plain = joints_off((&from, &clip), (&to, &clip), &times);
    assert!(plain.values().any(|(distance, _)| *distance > 0.01), "the change would move joints");

    // Beside an output in the folder of the clips they would be replaced, which has to be allowed.
    let beside = [&update[..], &["-o", "new.rig.ron"]].concat();
    let answer = rigsmith(folder.path(), &beside);
    assert!(answer.code == 2 && answer.err.contains("sway.anim.ron"), "{} {}", answer.out, answer.err);
    assert_eq!(fs::read_to_string(at("sway.anim.ron")).unwrap(), text);
    assert!(!at("new.rig.ron").exists());
    json(folder.path(), &[&beside[..], &["--in-place"]].concat());
    assert_eq!(fs::read(at("sway.anim.ron")).unwrap(), fs::read(at("out/sway.anim.ron")).unwrap());

    // What is no clip is told before anything is written.
    let answer = rigsmith(folder.path(), &[&base[..], &["--clips", "next.rig.ron", "-o", "out/x.rig.ron"]].concat());
    assert!(answer.code == 2 && !at("out/x.rig.ron").exists(), "{}", answer.err);
}

#[test]
fn clips_of_a_project_move_the_joints_as_before() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let mine = gentle();
    let clip = mine.clips()[0].clone();
    let mut first = mine.clone();
    first.apply(&RigEdit::RemoveClip(clip.uid)).unwrap();
    let mut next = first.clone();
    flip_all(&mut next);
    fs::write(at("biped.rig.ron"), write_template(&first)).unwrap();
    fs::write(at("next.rig.ron"), write_template(&next)).unwrap();
    let followed = ProjectTemplate { rig: mine.uid(), path: at("biped.rig.ron"), base: Arc::new(first).into() };
    let rigs = vec![mine.clone()];
    let project = ProjectToSave { name: "shot".into(), rigs, templates: vec![followed], ..Default::default() };
    store_project(&RealDisk, &at("shot.rigsmith.ron"), &project).unwrap();
    let saved = fs::read(at("shot.rigsmith.ron")).unwrap();
    let update = ["update", "shot.rigsmith.ron", "--from", "next.rig.ron"];

    let told = json(folder.path(), &[&update[..], &["--dry-run"]].concat());
    assert_eq!(told["conflicts"], 0, "the project knows the version that it took over last: {told}");
    let answer = rigsmith(folder.path(), &[&update[..], &["-o", "out.rig.ron"]].concat());
    assert!(answer.code == 2 && answer.err.contains("give a .rigsmith.ron"), "{} {}", answer.out, answer.err);
    let told = json(folder.path(), &[&update[..], &["-o", "out.rigsmith.ron"]].concat());
    assert_eq!(fs::read(at("shot.rigsmith.ron")).unwrap(), saved, "an input stays");
    let facts = &told["own_clips"];
    assert_eq!((&facts["clips"], &facts["re_expressed"]), (&1.into(), &1.into()), "{facts}");
    let updated = load_project(&RealDisk, &at("out.rigsmith.ron")).unwrap();
    let (rig, kept) = (&updated.rigs[0], updated.rigs[0].clip(clip.uid).unwrap());
    let listed = noted_joints(facts);
    assert!(listed.len() * 2 < mine.len(), "{facts}");
    let (from, to) = (program(&mine), program(rig));
    let times: Vec<f32> = (0..=60).map(|frame| frame as f32 / clip.frame_rate).chain(clip.key_times()).collect();
    for (joint, (distance, angle)) in joints_off((&from, &clip), (&to, kept), &times) {
        let is_held = distance <= NEAR.0 && angle <= NEAR.1;
        assert!(is_held || listed.contains(&joint), "{joint} is off by {distance} m and {angle}°");
    }
    let plain = joints_off((&from, &clip), (&to, &clip), &times);
    assert!(plain.values().any(|(distance, _)| *distance > 0.01), "the change would move joints");

    // The project follows that version now, and the next update begins with it.
    assert!(updated.templates[0].path.ends_with("next.rig.ron"), "{:?}", updated.templates[0].path);
    let again = ["update", "out.rigsmith.ron", "--from", "next.rig.ron", "--in-place", "-o", "out.rigsmith.ron"];
    let told = json(folder.path(), &again);
    assert_eq!((&told["changes"], &told["own_clips"]["re_expressed"]), (&Value::Array(vec![]), &0.into()), "{told}");
}

/// A joint with a control, and another that hangs on it.
const ARM: &str = r#"(
    format: 2,
    name: "arm",
    joints: [
        (label: "arm", translation: (0, 1, 0), tags: [control(creation: (name: "ctl_arm"))]),
        (label: "end", parent: "arm", translation: (0, 0.5, 0)),
    ],
)
"#;

#[test]
fn keys_of_nodes_that_are_gone_are_listed_and_stay_in_the_file() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    fs::write(at("arm.rig.ron"), ARM).unwrap();
    let without = ARM.replace(", tags: [control(creation: (name: \"ctl_arm\"))]", "");
    assert_ne!(without, ARM);
    fs::write(at("next.rig.ron"), &without).unwrap();
    let rig = load_template(&RealDisk, &at("arm.rig.ron")).unwrap().rig;
    let built = Builder::build(&rig, &Arc::new(modules::all())).unwrap();
    let control = built.nodes.iter().find(|node| &*node.name == "ctl_arm").unwrap().uid;
    let mut clip = RigClip::new(Uid(0xC1), Uid(0xC2), "wave");
    let keys = vec![Key::rotation(0.0, Quat::IDENTITY), Key::rotation(1.0, Quat::from_rotation_z(1.0))];
    let target = TrackTarget { node: control, property: Property::Rotation };
    clip.layers[0].tracks.insert(target.clone(), Arc::new(Track { keys: keys.clone() }));
    fs::write(at("wave.anim.ron"), write_animation(&rig, Some(&built), &[clip])).unwrap();
    fs::create_dir(at("out")).unwrap();
    let update = ["update", "arm.rig.ron", "--from", "next.rig.ron", "--base", "arm.rig.ron"];
    let update = [&update[..], &["--clips", "wave.anim.ron", "-o", "out/arm.rig.ron"]].concat();
    let told = json(folder.path(), &update);
    let aside = &told["clips"][0]["set_aside"][0];
    assert_eq!((&aside["clip_name"], &aside["keys"]), (&"wave".into(), &2.into()), "{told}");
    assert_eq!(aside["node"].as_str(), Some(control.to_string().as_str()), "{told}");
    let answer = rigsmith(folder.path(), &[&update[..], &["--in-place"]].concat());
    assert!(answer.code == 0 && answer.out.contains("2 keys of"), "{} {}", answer.out, answer.err);

    // The keys and their label are in the file, and go back to the control in the version that has it.
    let text = fs::read_to_string(at("out/wave.anim.ron")).unwrap();
    assert!(text.contains(&control.to_string()) && text.contains("role: "), "{text}");
    let read = load_animation(&RealDisk, &at("out/wave.anim.ron")).unwrap();
    assert_eq!(read.clips[0].layers[0].tracks[&target].keys, keys);
    assert!(read.onto(&rig, Some(&built)).missing.is_empty());
    let next = load_template(&RealDisk, &at("out/arm.rig.ron")).unwrap().rig;
    assert_eq!(read.onto(&next, None).missing, [control]);
}
