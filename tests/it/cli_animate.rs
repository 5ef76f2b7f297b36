//! `rigsmith animate`: clips and motion capture onto rigs, with the real binary, real files and exit codes.

use std::{fs, path::Path};

use bevy::math::Vec3;
use rigsmith::{
    files::{RealDisk, load_animation, load_model},
    mesh::model::{Channel, ChannelTarget, Model, Trs},
    modules,
    processor::Builder,
    rig::bake::baked,
    solve::{
        bake_clip::strike,
        program::{CompileOptions, RigProgram, RigState},
    },
};
use serde_json::Value;

use crate::{bench::shipped, cli_build::rigsmith, exports::exports, prerequisites::test_data};

/// Two legs and a trunk that stand on a step and turn a little.
const WALKER: &str = include_str!("retarget/walker.bvh");

fn json(folder: &Path, args: &[&str]) -> Value {
    let answer = rigsmith(folder, &[args, &["--json"]].concat());
    assert_eq!(answer.code, 0, "{args:?}: {} {}", answer.out, answer.err);
    serde_json::from_str(&answer.out).unwrap()
}

/// Value of a linear channel, three or four numbers.
fn sampled(channel: &Channel, time: f32) -> Vec<f32> {
    let width = channel.values.len() / channel.times.len();
    let next = channel.times.partition_point(|key| *key <= time).clamp(1, channel.times.len().max(2) - 1);
    let of = |key: usize| &channel.values[key * width..(key + 1) * width];
    if channel.times.len() == 1 {
        return of(0).to_vec();
    }
    let (from, to) = (channel.times[next - 1], channel.times[next]);
    let share = ((time - from) / (to - from)).clamp(0.0, 1.0);
    if width == 4 {
        let [from, to] = [next - 1, next].map(|key| bevy::math::Quat::from_slice(of(key)));
        return from.slerp(to, share).to_array().to_vec();
    }
    of(next - 1).iter().zip(of(next)).map(|(a, b)| a + (b - a) * share).collect()
}

/// Transforms of a file's nodes at a moment of its first clip.
fn played(model: &Model, time: f32) -> Vec<Trs> {
    let mut locals: Vec<Trs> = model.nodes.iter().map(|node| node.rest).collect();
    for channel in &model.clips[0].channels {
        let value = sampled(channel, time);
        match channel.target {
            ChannelTarget::Translation(node) => locals[node].translation = Vec3::from_slice(&value),
            ChannelTarget::Rotation(node) => locals[node].rotation = bevy::math::Quat::from_slice(&value),
            ChannelTarget::Scale(node) => locals[node].scale = Vec3::from_slice(&value),
            ChannelTarget::MorphWeights(_) => {}
        }
    }
    let mut globals: Vec<Trs> = Vec::new();
    for (node, local) in model.nodes.iter().zip(locals) {
        globals.push(node.parent.map_or(local, |parent| globals[parent] * local));
    }
    globals
}

#[test]
fn a_motion_becomes_a_clip_and_an_animated_character() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("walker.bvh"), WALKER).unwrap();
    let run = |args: &[&str]| json(folder.path(), &[&["animate", "biped.rig.ron"], args].concat());
    let answer = run(&["walker.bvh", "--map-out", "map.ron", "-o", "walk.anim.ron"]);
    assert_eq!((&answer["onto"], &answer["found_by"]), (&"controls".into(), &"names".into()));
    assert_eq!(answer["clips"][0]["name"], "walker");
    assert!(answer["mapped"].as_array().unwrap().len() >= 8, "{answer}");
    assert!(answer["unmapped_target"].as_array().unwrap().iter().any(|label| label == "hand_l"));
    assert!(answer["foot_slide"].as_f64().unwrap() <= 1.0, "{answer}");
    assert!(answer["reduction"].as_f64().unwrap() >= 1.0);
    let clip = &load_animation(&RealDisk, &folder.path().join("walk.anim.ron")).unwrap().clips[0];
    assert!((clip.duration() - 0.9).abs() < 1e-3 && clip.frame_rate == 20.0, "{} {}", clip.duration(), clip.frame_rate);

    // The written map gives the same clip, and the clip plays on.
    run(&["walker.bvh", "--map", "map.ron", "-o", "again.anim.ron"]);
    let read = |name: &str| fs::read(folder.path().join(name)).unwrap();
    assert_eq!(read("walk.anim.ron"), read("again.anim.ron"));
    run(&["walker.bvh", "-o", "direct.glb", "--fps", "30"]);
    run(&["walk.anim.ron", "-o", "clip.glb", "--fps", "20", "--loop"]);

    // The file's nodes stand where the program has them.
    let model = load_model(&RealDisk, &folder.path().join("clip.glb")).unwrap();
    assert_eq!((model.clips.len(), model.clips[0].name.as_str()), (1, "walker"));
    let rig = shipped("biped");
    let built = Builder::build(&rig, &std::sync::Arc::new(modules::all())).unwrap();
    let program = std::sync::Arc::new(RigProgram::compile(&built, &CompileOptions::default()).unwrap());
    let mut state = RigState::new(program);
    // Names that only one node has.
    let place = |name: &str| {
        let mut found = model.nodes.iter().enumerate().filter(|(_, node)| node.name == name).map(|(at, _)| at);
        found.next().filter(|_| found.next().is_none())
    };
    let skeleton = baked(&rig, &built);
    let nodes = skeleton.walk().filter_map(|joint| Some((joint.data.uid, place(joint.data.label.as_deref()?)?)));
    let nodes: Vec<_> = nodes.collect();
    assert!(nodes.len() > 60, "{}", nodes.len());
    for frame in 0..=18 {
        let time = frame as f32 / 20.0;
        strike(&mut state, &clip.sample(time));
        let globals = played(&model, time);
        for (uid, place) in &nodes {
            let off = state.global(*uid).unwrap().translation.distance(globals[*place].translation);
            assert!(off < 2e-3, "{} at {time}: {off}", model.nodes[*place].name);
        }
    }

    // Onto joints, the commands are left out.
    let answer = run(&["walker.bvh", "--onto", "joints", "-o", "joints.glb"]);
    assert_eq!(answer["onto"], "joints");
    assert!(answer["notes"][0].as_str().unwrap().contains("commands of the rig are left out"), "{answer}");
}

#[test]
fn wrong_uses_are_told() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("walker.bvh"), WALKER).unwrap();
    fs::write(folder.path().join("broken.bvh"), WALKER.replace("MOTION", "MOTOIN")).unwrap();
    fs::write(folder.path().join("map.ron"), "[(\"LeftUpLag\", \"thigh_l\")]").unwrap();
    let check = |args: &[&str], code: i32, told: &str| {
        let answer = rigsmith(folder.path(), &[&["animate"], args].concat());
        assert_eq!(answer.code, code, "{args:?}: {}", answer.err);
        assert!(answer.err.contains(told), "{args:?}: {}", answer.err);
    };
    check(&["biped.rig.ron", "walker.bvh", "-o", "a.obj"], 2, "give .glb, .gltf, .anim.ron or .png");
    check(&["biped.rig.ron", "walker.obj", "-o", "a.glb"], 2, "give .bvh or .anim.ron");
    check(&["biped.rig.ron", "walker.bvh", "-o", "walker.bvh"], 2, "cannot write");
    check(&["biped.rig.ron", "missing.bvh", "-o", "a.glb"], 1, "missing.bvh");
    check(&["biped.rig.ron", "broken.bvh", "-o", "a.glb"], 1, "line ");
    check(&["biped.rig.ron", "walker.bvh", "--map", "map.ron", "-o", "a.glb"], 1, "did you mean \"LeftUpLeg\"");
    check(&["biped.rig.ron", "walker.bvh", "--mesh", "m.obj", "-o", "a.anim.ron"], 2, "--mesh is for a character");
    check(&["biped.rig.ron", "walker.bvh", "--fps", "0", "-o", "a.glb"], 2, "--fps");
    check(&["hand.rig.ron", "walker.bvh", "-o", "a.glb"], 1, "--map");
    assert!(!folder.path().join("a.glb").exists());
}

/// Characters for the validator: the walk on the biped and on a body.
#[test]
fn walks_are_exported() {
    let Some(data) = test_data() else { return };
    let (folder, _guard) = exports();
    let work = tempfile::tempdir().unwrap();
    let walk = data.join("bvh/makehuman_walk1.bvh").display().to_string();
    let body = data.join("bodies/male_young/body.obj").display().to_string();
    let bare = folder.join("animate_walk_biped.glb").display().to_string();
    let dressed = folder.join("animate_walk_male_young.glb").display().to_string();
    json(work.path(), &["animate", "biped", &walk, "--loop", "-o", &bare]);
    json(work.path(), &["fit", &body, "-o", "fitted.rig.ron"]);
    let answer = json(work.path(), &["animate", "fitted.rig.ron", &walk, "--mesh", &body, "-o", &dressed]);
    assert!(answer["foot_slide"].as_f64().unwrap() <= 1.0 && answer["ankle_off"].as_f64().unwrap() <= 1.5, "{answer}");
    for file in [bare, dressed] {
        let model = load_model(&RealDisk, Path::new(&file)).unwrap();
        assert!(
            model.clips.len() == 1 && model.clips[0].channels.len() > 30,
            "{file}: {}",
            model.clips[0].channels.len()
        );
    }
}
