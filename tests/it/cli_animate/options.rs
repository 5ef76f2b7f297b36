//! Options of `rigsmith animate` on each kind of file: they work, or are refused or told.

use std::{fs, path::Path, sync::Arc};

use rigsmith::{
    files::{RealDisk, load_animation, load_model},
    mesh::model::Model,
    modules,
    processor::Builder,
    rig::{
        RigEdit,
        animation::{NodeNames, file_clip::motion_of, motion::Motion, orphaned_keys},
        project::{Project, ProjectRig, read_project, write_project},
    },
};
use serde_json::Value;

use super::{WALKER, json, played};
use crate::{bench::shipped, cli_build::rigsmith, prerequisites::test_data};

/// A folder with a motion, and with its clip on the biped's controls.
fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("walker.bvh"), WALKER).unwrap();
    json(folder.path(), &["animate", "biped", "walker.bvh", "-o", "walk.anim.ron"]);
    folder
}

fn refused(folder: &Path, args: &[&str], code: i32, told: &[&str]) {
    let answer = rigsmith(folder, &[&["animate"], args].concat());
    assert_eq!(answer.code, code, "{args:?}: {} {}", answer.out, answer.err);
    assert!(told.iter().all(|text| answer.err.contains(text)), "{args:?}: {}", answer.err);
}

fn notes(answer: &Value) -> String {
    answer["notes"].as_array().unwrap().iter().filter_map(Value::as_str).collect::<Vec<_>>().join("\n")
}

#[test]
fn options_of_motion_are_refused_or_told_on_clips_of_a_rig() {
    let folder = folder();
    for option in [&["--in-place"][..], &["--root-motion"], &["--free-feet"], &["--free-hands"], &["--tolerance", "5"]]
    {
        refused(folder.path(), &[&["biped", "walk.anim.ron", "-o", "b.anim.ron"], option].concat(), 2, &[option[0]]);
    }
    assert!(!folder.path().join("b.anim.ron").exists());
    // Beside a motion they work for that one.
    let args = ["animate", "biped", "walk.anim.ron", "walker.bvh", "--in-place", "-o", "both.anim.ron"];
    let told = notes(&json(folder.path(), &args));
    assert!(told.contains("`walk.anim.ron`") && told.contains("without effect on it: --in-place"), "{told}");
    let told = json(folder.path(), &["animate", "biped", "walker.bvh", "--root-motion", "-o", "root.anim.ron"]);
    assert_eq!(told["root"]["name"], "root", "{told}");
    // A frame rate works.
    json(folder.path(), &["animate", "biped", "walk.anim.ron", "--fps", "60", "-o", "fast.anim.ron"]);
    let fast = &load_animation(&RealDisk, &folder.path().join("fast.anim.ron")).unwrap().clips[0];
    assert_eq!(fast.frame_rate, 60.0);
    for (file, output) in [("walker.bvh", "c.anim.ron"), ("walk.anim.ron", "c.anim.ron"), ("walk.anim.ron", "c.glb")] {
        refused(folder.path(), &["biped", file, "--fps", "0.01", "-o", output], 1, &["walker", "--fps 0.01"]);
        assert!(!folder.path().join(output).exists());
    }
}

#[test]
fn clips_of_controls_are_baked_where_joints_have_keys() {
    let folder = folder();
    let args = ["animate", "biped", "walk.anim.ron", "walker.bvh", "--onto", "joints", "-o", "joints.glb"];
    let answer = json(folder.path(), &args);
    for animation in answer["animations"].as_array().unwrap() {
        assert!(animation["channels"].as_u64().unwrap() > 8, "{answer}");
    }
    json(folder.path(), &["animate", "biped", "walk.anim.ron", "-o", "controls.glb"]);
    let [baked, plain] =
        ["joints.glb", "controls.glb"].map(|name| load_model(&RealDisk, &folder.path().join(name)).unwrap());
    assert_eq!((baked.clips.len(), plain.clips.len()), (2, 1));
    let only = |model: &Model, name: &str| {
        let found: Vec<usize> = (0..model.nodes.len()).filter(|node| model.nodes[*node].name == name).collect();
        assert_eq!(found.len(), 1, "{name}");
        found[0]
    };
    for time in [0.0, 0.3, 0.65, 0.9] {
        let (is, was) = (played(&baked, time), played(&plain, time));
        for name in ["hips", "thigh_l", "shin_l", "foot_l", "foot_r", "head"] {
            let off = is[only(&baked, name)].translation.distance(was[only(&plain, name)].translation);
            assert!(off < 2e-3, "{name} at {time}: {off}");
        }
    }
}

/// Keys of nodes that another rig does not have keep the names of their nodes, in files and in projects.
#[test]
fn nodes_that_a_rig_lacks_keep_their_names() {
    let folder = folder();
    let answer = json(folder.path(), &["animate", "quadruped", "walk.anim.ron", "-o", "other.anim.ron"]);
    let aside: Vec<&str> =
        answer["set_aside"][0]["nodes"].as_array().unwrap().iter().filter_map(Value::as_str).collect();
    assert!(!aside.is_empty() && aside.iter().all(|label| label.parse::<rigsmith::rig::Uid>().is_err()), "{aside:?}");
    assert!(notes(&answer).contains(aside[0]), "{answer}");
    let labels = |name: &str| fs::read_to_string(folder.path().join(name)).unwrap().matches("label: ").count();
    assert_eq!(labels("other.anim.ron"), labels("walk.anim.ron"));

    // Back on the biped they are found.
    let read = load_animation(&RealDisk, &folder.path().join("other.anim.ron")).unwrap();
    let build = |name: &str| {
        let rig = shipped(name);
        let built = Builder::build(&rig, &Arc::new(modules::all())).unwrap();
        (rig, built)
    };
    let (biped, biped_built) = build("biped");
    let (mut rig, built) = build("quadruped");
    let bound = read.onto(&rig, Some(&built));
    assert!(!bound.missing.is_empty());
    let back = read.onto(&biped, Some(&biped_built)).missing;
    assert!(bound.missing.iter().all(|node| !back.contains(node)), "{back:?}");

    // A project of the other rig knows what is set aside.
    rig.apply(&RigEdit::AddClip(Box::new(bound.clips[0].clone()), usize::MAX)).unwrap();
    let project = Project { rigs: vec![ProjectRig { rig, skins: Vec::new() }], ..Project::default() };
    let again = read_project(write_project(&project).as_bytes()).unwrap().project.rigs.remove(0).rig;
    let orphans = orphaned_keys(&again, Some(&built), &NodeNames::default());
    assert_eq!(orphans.len(), bound.missing.len());
    assert!(orphans.iter().all(|orphan| !orphan.name.label.is_empty()), "{orphans:?}");
}

#[test]
fn a_map_is_for_the_motions_that_have_its_joints() {
    let folder = folder();
    let write = |name: &str, text: &str| fs::write(folder.path().join(name), text).unwrap();
    write("odd.bvh", &WALKER.replace("LeftUpLeg", "Oberschenkel"));
    write("map.ron", "[(\"Oberschenkel\", \"thigh_l\")]");
    let answer =
        json(folder.path(), &["animate", "biped", "walker.bvh", "odd.bvh", "--map", "map.ron", "-o", "two.anim.ron"]);
    let found: Vec<&str> =
        answer["motions"].as_array().unwrap().iter().filter_map(|of| of["found_by"].as_str()).collect();
    assert_eq!(found, ["names", "map"], "{answer}");
    let mapped: Vec<usize> =
        answer["motions"].as_array().unwrap().iter().map(|of| of["mapped"].as_array().unwrap().len()).collect();
    assert_eq!(mapped[0], mapped[1], "{answer}");
    assert!(notes(&answer).contains("`walker.bvh`: the map"), "{answer}");
    // A joint that no file has is told, with the file if there is one.
    write("wrong.ron", "[(\"LeftUpLag\", \"thigh_l\")]");
    let two = ["biped", "walker.bvh", "odd.bvh", "--map", "wrong.ron", "-o", "no.anim.ron"];
    refused(folder.path(), &two, 1, &["none of the files", "\"LeftUpLag\""]);
    let one = ["biped", "walker.bvh", "--map", "wrong.ron", "-o", "no.anim.ron"];
    refused(folder.path(), &one, 1, &["none of the files", "did you mean \"LeftUpLeg\""]);
}

#[test]
fn a_baked_clip_tells_its_reduction() {
    let folder = folder();
    let answer = json(folder.path(), &["animate", "biped", "walk.anim.ron", "-o", "walk.glb"]);
    let [before, after] = ["keys_before", "keys_after"].map(|name| answer[name].as_f64().unwrap());
    let told = answer["reduction"].as_f64().unwrap();
    assert!(before > after && after > 0.0 && (told - before / after).abs() < 1e-3, "{answer}");
    assert_eq!(answer["animations"][0]["keys_after"], answer["keys_after"]);
}

/// Skeletons that share nothing but a root.
#[test]
fn a_motion_of_which_only_a_root_is_mapped_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let rig = r#"(format: 2, name: "arm", joints: [
        (label: "root", translation: (0, 0.1, 0)),
        (label: "one", parent: "root", translation: (0, 0.2, 0)),
        (label: "two", parent: "one", translation: (0, 0.2, 0)),
    ])"#;
    let motion = "HIERARCHY\nROOT root\n{\nOFFSET 0 0 0\nCHANNELS 3 Xrotation Yrotation Zrotation\nJOINT first\n{\n\
        OFFSET 0 1 0\nCHANNELS 3 Xrotation Yrotation Zrotation\nJOINT second\n{\nOFFSET 0 1 0\n\
        CHANNELS 3 Xrotation Yrotation Zrotation\nEnd Site\n{\nOFFSET 0 1 0\n}\n}\n}\n}\nMOTION\nFrames: 2\n\
        Frame Time: 0.1\n0 0 0 0 0 0 0 0 0\n0 0 9 0 0 9 0 0 9\n";
    fs::write(folder.path().join("arm.rig.ron"), rig).unwrap();
    fs::write(folder.path().join("arm.bvh"), motion).unwrap();
    fs::write(folder.path().join("map.ron"), "[(\"first\", \"one\"), (\"second\", \"two\")]").unwrap();
    let args = ["arm.rig.ron", "arm.bvh", "-o", "arm.anim.ron"];
    refused(folder.path(), &args, 1, &["`arm.bvh`", "only \"root\"", "--map"]);
    let answer = json(folder.path(), &[&["animate"], &args[..], &["--map", "map.ron"]].concat());
    assert!(answer["keys_after"].as_u64().unwrap() >= 3, "{answer}");
}

/// Foxes with joints of other names, other proportions and other numbers of joints in spine, neck, tail and legs.
#[test]
fn an_animal_moves_another_one_by_the_chains_of_its_skeleton() {
    let Some(data) = test_data() else { return };
    let folder = tempfile::tempdir().unwrap();
    let [fox, other] =
        ["gltf_skinned/Fox.glb", "creatures/fox-fox.glb"].map(|path| data.join(path).display().to_string());
    let run =
        |rig: &str, args: &[&str]| json(folder.path(), &[&["animate", rig, &fox, "--clip", "Walk"], args].concat());
    let source = |answer: &Value, to: &str| -> String {
        let mapped = answer["motions"][0]["mapped"].as_array().unwrap();
        let pair = mapped.iter().find(|pair| pair["to"][0] == to).unwrap_or_else(|| panic!("{to}: {answer}"));
        pair["from"][0].as_str().unwrap().to_owned()
    };
    let answer = run(&other, &["--map-out", "map.ron", "-o", "walk.anim.ron"]);
    assert_eq!(answer["motions"][0]["found_by"], "shape", "{answer}");
    for (to, from) in [
        ("Hips", "b_Hip"),
        ("Spine_1", "b_Spine01"),
        ("Nose", "b_Head"),
        ("Tail_End", "b_Tail"),
        ("Front_Leg_Upper_L", "b_LeftUpperArm"),
        ("Front_Leg_Foot_R", "b_RightHand"),
        ("Back_Leg_Lower_L", "b_LeftLeg02"),
        ("Back_Leg_Foot_R", "b_RightFoot"),
    ] {
        let source = source(&answer, to);
        assert!(source.starts_with(from), "{to} moves as {source}");
    }
    assert!(answer["clips"][0]["tracks"].as_u64().unwrap() > 20, "{answer}");
    for field in ["seconds", "tracks"] {
        assert_eq!(answer[field], answer["clips"][0][field], "a single clip is told without a list, too");
    }
    run(&other, &["--map", "map.ron", "-o", "again.anim.ron"]);
    let read = |name: &str| fs::read(folder.path().join(name)).unwrap();
    assert!(read("walk.anim.ron") == read("again.anim.ron"), "the written map gives another clip");

    // Legs swing as those of the other fox do, about the axis across the body.
    run(&other, &["-o", "walk.glb"]);
    let [was, is] = [Path::new(&fox), &folder.path().join("walk.glb")].map(|path| load_model(&RealDisk, path).unwrap());
    let was_clip = was.clips.iter().find(|clip| clip.name == "Walk").unwrap();
    let (was_motion, is_motion) = (motion_of(&was, was_clip), motion_of(&is, &is.clips[0]));
    let turn = |motion: &Motion, name: &str, time: f32| {
        let joint = motion.find(name).unwrap();
        let at = |time: f32| motion.globals_at(time)[joint].rotation;
        at(time) * at(0.0).inverse()
    };
    for time in [0.2, 0.4, 0.6] {
        let turns = [turn(&was_motion, "b_LeftUpperArm_09", time), {
            let to = "Front_Leg_Shoulder_L";
            assert!(source(&answer, to).starts_with("b_LeftUpperArm"), "{answer}");
            turn(&is_motion, to, time)
        }];
        assert!(turns[0].angle_between(turns[1]) < 0.05, "{turns:?}");
    }

    // Onto the controls of the quadruped, too.
    let answer = run("quadruped", &["-o", "quadruped.anim.ron"]);
    assert_eq!(answer["motions"][0]["onto"], "controls", "{answer}");
    assert!(source(&answer, "upper_arm_l").starts_with("b_Left"), "{answer}");
    assert!(answer["clips"][0]["tracks"].as_u64().unwrap() > 15, "{answer}");
}
