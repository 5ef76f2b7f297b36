//! `rigsmith animate`: clips and motion capture onto rigs, with the real binary, real files and exit codes.

mod options;
mod packed_clips;

use std::{fs, path::Path};

use rigsmith::{
    files::{RealDisk, load_animation, load_model},
    mesh::model::{Interpolation, Model, Trs},
    modules,
    processor::Builder,
    rig::{
        animation::{RigClip, clip_extras::ClipExtras, file_clip::motion_of},
        bake::baked,
    },
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

/// Transforms of a file's nodes at a moment of its first clip.
fn played(model: &Model, time: f32) -> Vec<Trs> {
    motion_of(model, &model.clips[0]).globals_at(time)
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
    assert!(answer["touches"].is_array() && answer["hand_slide"].is_number(), "{answer}");
    run(&["walker.bvh", "--free-hands", "--free-feet", "-o", "free.anim.ron"]);
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
    let facts = ClipExtras::read(model.clips[0].extras.as_ref());
    assert_eq!((facts.looped, facts.frame_rate), (true, Some(20.0)));
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

    // Importers drop tangents, so no file of what is baked or retargeted has them.
    for name in ["direct.glb", "clip.glb", "joints.glb"] {
        let model = load_model(&RealDisk, &folder.path().join(name)).unwrap();
        let channels = &model.clips[0].channels;
        assert!(channels.len() > 8 && channels.iter().all(|of| of.interpolation == Interpolation::Linear), "{name}");
    }
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
    check(&["biped.rig.ron", "walker.bvh", "-o", "a.obj"], 2, "give .glb, .gltf, .vrm, .anim.ron, .rigclip or .png");
    check(&["biped.rig.ron", "walker.obj", "-o", "a.glb"], 2, "give .bvh, .glb, .gltf, .vrm, .rigclip or .anim.ron");
    check(&["biped.rig.ron", "walker.bvh", "-o", "walker.bvh"], 2, "cannot write");
    check(&["biped.rig.ron", "missing.bvh", "-o", "a.glb"], 1, "missing.bvh");
    check(&["biped.rig.ron", "broken.bvh", "-o", "a.glb"], 1, "line ");
    check(&["biped.rig.ron", "walker.bvh", "--map", "map.ron", "-o", "a.glb"], 1, "did you mean \"LeftUpLeg\"");
    check(&["biped.rig.ron", "walker.bvh", "--mesh", "m.obj", "-o", "a.anim.ron"], 2, "--mesh is for a character");
    check(&["biped.rig.ron", "walker.bvh", "--fps", "0", "-o", "a.glb"], 2, "--fps");
    check(&["hand.rig.ron", "walker.bvh", "-o", "a.glb"], 1, "--map");
    assert!(!folder.path().join("a.glb").exists());
}

#[test]
fn clips_of_a_model_are_a_source() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    fs::write(path("walker.bvh"), WALKER).unwrap();
    let run = |args: &[&str]| json(folder.path(), &[&["animate"], args].concat());
    run(&["biped.rig.ron", "walker.bvh", "--onto", "joints", "-o", "walk.glb"]);

    // A character's own clip: its keys, on its joints, and the same bytes from the second round on.
    let answer = run(&["walk.glb", "walk.glb", "-o", "own.anim.ron"]);
    assert_eq!((&answer["found_by"], &answer["onto"]), (&"joints".into(), &"joints".into()), "{answer}");
    let own = load_animation(&RealDisk, &path("own.anim.ron")).unwrap().clips;
    let file = load_model(&RealDisk, &path("walk.glb")).unwrap();
    let keys: usize = file.clips[0].channels.iter().map(|channel| channel.times.len()).sum();
    assert_eq!((own.len(), own[0].name.as_str(), own[0].key_count()), (1, "walker", keys));
    run(&["walk.glb", "walk.glb", "-o", "first.glb"]);
    run(&["walk.glb", "first.glb", "-o", "second.glb"]);
    assert_eq!(fs::read(path("first.glb")).unwrap(), fs::read(path("second.glb")).unwrap());
    let (was, is) = (played(&file, 0.45), played(&load_model(&RealDisk, &path("second.glb")).unwrap(), 0.45));
    for (was, is) in was.iter().zip(&is) {
        assert!(was.translation.distance(is.translation) < 1e-4 && was.rotation.angle_between(is.rotation) < 3e-3);
    }

    // On another rig it is retargeted onto the controls.
    let answer = run(&["biped.rig.ron", "walk.glb", "-o", "controls.anim.ron"]);
    assert_eq!((&answer["found_by"], &answer["onto"]), (&"names".into(), &"controls".into()), "{answer}");
    assert!(
        answer["mapped"].as_array().unwrap().len() >= 8 && answer["foot_slide"].as_f64().unwrap() <= 1.0,
        "{answer}"
    );

    // Several files are several animations, and clips can be chosen by name and by number.
    let answer = run(&["biped.rig.ron", "walker.bvh", "walk.glb", "controls.anim.ron", "-o", "three.glb"]);
    assert_eq!((answer["clips"].as_array().unwrap().len(), answer["motions"].as_array().unwrap().len()), (3, 2));
    let three = load_model(&RealDisk, &path("three.glb")).unwrap();
    let names: Vec<&str> = three.clips.iter().map(|clip| clip.name.as_str()).collect();
    assert_eq!(names, ["walker", "walker 2", "walker 3"]);
    let answer = run(&["biped.rig.ron", "three.glb", "--clip", "walker 3", "--clip", "1", "-o", "two.glb"]);
    assert_eq!(answer["clips"].as_array().unwrap().len(), 2);
    let answer = rigsmith(folder.path(), &["animate", "biped.rig.ron", "three.glb", "--clip", "run", "-o", "no.glb"]);
    assert!(answer.code == 1 && answer.err.contains("\"run\""), "{} {}", answer.code, answer.err);
}

/// Clips that come with characters of the data folder, edited on their joints without a template.
#[test]
fn clips_of_characters_are_edited_on_their_joints() {
    let Some(data) = test_data() else { return };
    let folder = tempfile::tempdir().unwrap();
    let fox = data.join("gltf_skinned/Fox.glb").display().to_string();
    let answer = json(folder.path(), &["animate", &fox, &fox, "--clip", "Walk", "--clip", "3", "-o", "fox.anim.ron"]);
    assert_eq!(answer["clips"].as_array().unwrap().len(), 2, "{answer}");
    assert_eq!(answer["motions"][1]["found_by"], "joints", "{answer}");
    json(folder.path(), &["animate", &fox, "fox.anim.ron", "-o", "fox.glb"]);
    let [was, is] = [Path::new(&fox), &folder.path().join("fox.glb")].map(|path| load_model(&RealDisk, path).unwrap());
    // Mesh and weights are those of the character.
    assert!(was.points.len() > 100 && is.points.len() == was.points.len());
    assert_eq!((is.skins.len(), is.clips.len()), (was.skins.len(), 2));
    assert_eq!(is.weights.as_ref().map(|weights| weights.len()), was.weights.as_ref().map(|weights| weights.len()));
    let walk = was.clips.iter().find(|clip| clip.name == "Walk").unwrap();
    let again = is.clips.iter().find(|clip| clip.name == "Walk").unwrap();
    let [was_motion, is_motion] = [motion_of(&was, walk), motion_of(&is, again)];
    assert!(was_motion.frames() > 10);
    let place = |motion: &rigsmith::rig::animation::motion::Motion, name: &str, time: f32| {
        motion.globals_at(time)[motion.find(name).unwrap()].translation
    };
    for time in [0.0, 0.2, 0.5] {
        for name in ["b_Head_05", "b_LeftHand_011", "b_Tail03_014"] {
            let off = place(&was_motion, name, time).distance(place(&is_motion, name, time));
            assert!(off < 0.05, "{name} at {time}: {off}");
        }
    }
}

/// Clips of a character with names of its own go onto the controls of the biped.
#[test]
fn clips_of_a_character_move_another_one() {
    let Some(data) = test_data() else { return };
    let folder = tempfile::tempdir().unwrap();
    let mage = data.join("characters/Mage.glb").display().to_string();
    let clips = ["--clip", "Walking_A", "--clip", "Jump_Full_Short"];
    let answer = json(folder.path(), &[&["animate", "biped", &mage], &clips[..], &["-o", "mage.anim.ron"]].concat());
    for motion in answer["motions"].as_array().unwrap() {
        assert_eq!((&motion["found_by"], &motion["onto"]), (&"names".into(), &"controls".into()), "{motion}");
        assert!(motion["mapped"].as_array().unwrap().len() >= 14, "{motion}");
    }
    let read = load_animation(&RealDisk, &folder.path().join("mage.anim.ron")).unwrap().clips;
    let names: Vec<&str> = read.iter().map(|clip| clip.name.as_str()).collect();
    assert_eq!(names.len(), 2, "{names:?}");
    assert!(read.iter().all(|clip| clip.duration() > 0.3 && clip.key_count() > 50));
}

#[test]
fn presets_change_names_and_axes_and_nothing_else() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    fs::write(path("walker.bvh"), WALKER).unwrap();
    let run = |preset: &str, output: &str| {
        json(folder.path(), &["animate", "biped.rig.ron", "walker.bvh", "--preset", preset, "-o", output])
    };
    run("plain", "plain.glb");
    let plain = load_model(&RealDisk, &path("plain.glb")).unwrap();
    let of_plain = motion_of(&plain, &plain.clips[0]);
    for (preset, thigh, chest) in [
        ("mixamo", "mixamorig:LeftUpLeg", "mixamorig:Spine1"),
        ("unreal", "thigh_l", "spine_02"),
        ("unity", "LeftUpperLeg", "Chest"),
        ("vrm", "leftUpperLeg", "chest"),
    ] {
        let answer = run(preset, "other.glb");
        assert!(answer["renamed"].as_u64().unwrap() >= 10, "{answer}");
        let other = load_model(&RealDisk, &path("other.glb")).unwrap();
        let find = |name: &str| {
            let mut found = (0..other.nodes.len()).filter(|node| other.nodes[*node].name == name);
            let place = found.next().unwrap_or_else(|| panic!("{preset}: no {name}"));
            assert_eq!(found.next(), None, "{preset}: several {name}");
            place
        };
        let (thigh, _) = (find(thigh), find(chest));
        assert_eq!(plain.nodes[thigh].name, "thigh_l");
        assert_eq!(other.nodes.len(), plain.nodes.len());
        // Joints are where they were, at rest and in the clip.
        let of_other = motion_of(&other, &other.clips[0]);
        for time in [0.0, 0.3, 0.65, 0.9] {
            let (was, is) = (of_plain.globals_at(time), of_other.globals_at(time));
            for (at, (was, is)) in was.iter().zip(&is).enumerate() {
                let off = was.translation.distance(is.translation);
                assert!(off < 1e-4, "{preset}: {} at {time}: {off}", other.nodes[at].name);
            }
        }
        // What is bound moves as before.
        let globals = other.rest_globals();
        for (joint, bind) in other.skins[0].joints.iter().zip(&other.skins[0].inverse_binds) {
            let moved = bevy::math::Mat4::from(globals[*joint]) * *bind;
            assert!(moved.abs_diff_eq(bevy::math::Mat4::IDENTITY, 1e-3), "{preset}: {}", other.nodes[*joint].name);
        }
        let at_rest = globals[thigh];
        let axis = |axis: usize| at_rest.matrix3.col(axis).normalize();
        match preset {
            "mixamo" => assert!(axis(1).y < -0.9, "{}", axis(1)),
            "unreal" => assert!(axis(0).y < -0.9, "{}", axis(0)),
            _ => assert!((0..3).all(|at| axis(at)[at] > 0.9999), "{preset}: {at_rest}"),
        }
    }
    let answer = rigsmith(folder.path(), &["animate", "biped", "walker.bvh", "--preset", "vrm", "-o", "a.anim.ron"]);
    assert!(answer.code == 2 && answer.err.contains("--preset"), "{}", answer.err);
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

/// A triangle with a morph target beside a node; ANIMATIONS is the place of its animations.
const FACE: &str = r#"{"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0, 1]}],
"nodes": [{"name": "root", "translation": [0, 0.1, 0]}, {"name": "body", "mesh": 0}],
"meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "targets": [{"POSITION": 1}]}]}],
"accessors": [
{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3", "min": [0, 0, 0], "max": [1, 1, 0]},
{"bufferView": 1, "componentType": 5126, "count": 3, "type": "VEC3", "min": [0, 0, 0], "max": [0, 0.5, 0]},
{"bufferView": 2, "componentType": 5126, "count": 2, "type": "SCALAR", "min": [0], "max": [1]},
{"bufferView": 3, "componentType": 5126, "count": 2, "type": "SCALAR"},
{"bufferView": 4, "componentType": 5126, "count": 2, "type": "VEC4"}],
"bufferViews": [
{"buffer": 0, "byteOffset": 0, "byteLength": 36}, {"buffer": 0, "byteOffset": 36, "byteLength": 36},
{"buffer": 0, "byteOffset": 72, "byteLength": 8}, {"buffer": 0, "byteOffset": 80, "byteLength": 8},
{"buffer": 0, "byteOffset": 88, "byteLength": 32}],
"buffers": [{"byteLength": 120, "uri": "data:application/octet-stream;base64,BUFFER"}],
"animations": [ANIMATIONS]}"#;
/// Bytes of [`FACE`].
const BUFFER: &str = concat!(
    "AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAA",
    "AAAAAAAAAD8AAAAAAAAAAAAAgD8AAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAAAAAAAJqZGT/NzEw/"
);
const BLINK: &str = r#"{"name": "blink", "channels": [{"sampler": 0, "target": {"node": 1, "path": "weights"}}],
"samplers": [{"input": 2, "output": 3}]}"#;
const TURN: &str = r#"{"name": "turn", "channels": [{"sampler": 0, "target": {"node": 0, "path": "rotation"}}],
"samplers": [{"input": 2, "output": 4}]}"#;

/// A clip of a face counts among the clips of its file, and is passed over where joints are animated.
#[test]
fn clips_of_morph_targets_are_passed_over() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, animations: String| {
        let text = FACE.replace("BUFFER", BUFFER).replace("ANIMATIONS", &animations);
        fs::write(folder.path().join(name), text).unwrap();
    };
    write("both.gltf", format!("{BLINK}, {TURN}"));
    write("blink.gltf", BLINK.to_owned());
    let rig = "(format: 2, name: \"n\", joints: [(label: \"root\", translation: (0, 0.1, 0))])";
    fs::write(folder.path().join("stand.rig.ron"), rig).unwrap();
    let run = |args: &[&str]| json(folder.path(), &[&["animate", "stand.rig.ron"], args].concat());
    let answer = run(&["both.gltf", "-o", "all.anim.ron"]);
    assert_eq!((answer["clips"].as_array().unwrap().len(), &answer["clips"][0]["name"]), (1, &"turn".into()));
    assert_eq!(answer["motions"][0]["found_by"], "joints", "{answer}");
    assert!(answer["notes"].to_string().contains("\\\"blink\\\" moves no joint"), "{answer}");
    // Its number is that in the file.
    let answer = run(&["both.gltf", "--clip", "2", "-o", "second.anim.ron"]);
    assert_eq!((answer["clips"].as_array().unwrap().len(), &answer["clips"][0]["name"]), (1, &"turn".into()));
    let answer = rigsmith(folder.path(), &["animate", "stand.rig.ron", "blink.gltf", "-o", "no.anim.ron"]);
    assert!(answer.code == 1 && answer.err.contains("no clips that move joints"), "{} {}", answer.code, answer.err);
}

/// A switch is thrown over frames of a clip, and the joints stay; what is asked for wrongly is told.
#[test]
fn switches_are_thrown_over_clips() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    fs::write(path("walker.bvh"), WALKER).unwrap();
    let run = |args: &[&str]| json(folder.path(), &[&["animate", "biped.rig.ron"], args].concat());
    run(&["walker.bvh", "-o", "walk.anim.ron"]);
    let read = |name: &str| load_animation(&RealDisk, &path(name)).unwrap().clips.swap_remove(0);
    let first = read("walk.anim.ron");
    let rig = shipped("biped");
    let built = Builder::build(&rig, &std::sync::Arc::new(modules::all())).unwrap();
    let program = std::sync::Arc::new(RigProgram::compile(&built, &CompileOptions::default()).unwrap());
    let switch = built.switches.iter().find(|switch| {
        let thigh = rig.find_label("thigh_l").unwrap();
        matches!(&switch.matching, rigsmith::rig::Matching::IkFk { joints, .. } if joints.contains(&thigh))
    });
    let switch = switch.unwrap();
    let attribute = rigsmith::rig::animation::TrackTarget {
        node: switch.control,
        property: rigsmith::rig::animation::Property::Attribute(switch.attribute.to_string()),
    };
    let default = RigState::new(program.clone()).attribute(switch.control, &switch.attribute).unwrap();
    let at = |clip: &RigClip, time: f32| clip.value(&attribute, time).map_or(default, |value| value[0]);
    let (other, number) = if at(&first, 0.0) >= 0.5 { ("fk", 0.0) } else { ("ik", 1.0) };
    let thrown = format!("thigh_l={other}");
    let answer = run(&["walk.anim.ron", "--switch", &thrown, "--range", "4..12", "-o", "over.anim.ron"]);
    let told = &answer["switched"][0];
    assert_eq!((&told["clip"], &told["off"]), (&"walker".into(), &Value::Array(vec![])), "{answer}");
    assert!(told["frames"].as_u64().unwrap() >= 9 && told["keys"].as_u64().unwrap() >= 1, "{answer}");
    let over = read("over.anim.ron");
    let mut states = [RigState::new(program.clone()), RigState::new(program.clone())];
    for frame in 0..=18u8 {
        let time = f32::from(frame) / 20.0;
        let wanted = if (4..12).contains(&frame) { number } else { at(&first, time) };
        assert_eq!(at(&over, time), wanted, "frame {frame}");
        for (state, clip) in states.iter_mut().zip([&first, &over]) {
            strike(state, &clip.sample(time));
        }
        for (slot, node) in program.nodes().iter().enumerate() {
            if node.kind == rigsmith::rig::NodeType::Joint {
                let [was, is] = [0, 1].map(|state: usize| states[state].global_at(slot).translation);
                assert!(was.distance(is) <= 1e-4, "{:?} in frame {frame}: {}", node.label, was.distance(is));
            }
        }
    }

    // The whole clip; a second time there is nothing to do.
    run(&["walk.anim.ron", "--switch", &thrown, "-o", "whole.anim.ron"]);
    assert!((0..=18u8).all(|frame| at(&read("whole.anim.ron"), f32::from(frame) / 20.0) == number));
    let answer = run(&["whole.anim.ron", "--switch", &thrown, "-o", "again.anim.ron"]);
    assert_eq!(answer["switched"], Value::Array(vec![]));
    assert!(answer["notes"].to_string().contains("holds in the whole range already"), "{answer}");
    assert_eq!(read("whole.anim.ron"), read("again.anim.ron"));

    let check = |args: &[&str], code: i32, told: &str| {
        let args = [&["animate", "biped.rig.ron", "walk.anim.ron", "-o", "x.anim.ron"], args].concat();
        let answer = rigsmith(folder.path(), &args);
        assert_eq!(answer.code, code, "{args:?}: {}", answer.err);
        assert!(answer.err.contains(told), "{args:?}: {}", answer.err);
    };
    check(&["--switch", "thigh_l"], 2, "NAME=VALUE");
    check(&["--switch", "thigh_l=sideways"], 1, "has no value");
    check(&["--switch", "nobody=fk"], 1, "no switch");
    check(&["--switch", &thrown, "--range", "12..4"], 2, "write two frames");
    check(&["--range", "4..12"], 2, "--switch");
    assert!(!path("x.anim.ron").exists());
}

/// Parts of the mesh above the joints, such as a hat, are in the strip; and the strip says that it shows one clip of several.
#[cfg(feature = "render")]
#[test]
fn a_strip_shows_the_whole_mesh() {
    if rigsmith::render::adapter().is_none() {
        crate::prerequisites::skip("there is no graphics adapter, not even a software one", "RIGSMITH_REQUIRE_GPU");
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    fs::write(path("walker.bvh"), WALKER).unwrap();
    let body = include_str!("../../assets/models/biped.obj");
    let points = || body.lines().filter_map(|line| line.strip_prefix("v "));
    let top = points().map(|line| line.split_whitespace().nth(1).unwrap().parse::<f32>().unwrap()).fold(0.0, f32::max);
    let count = points().count();
    // A hat half a metre high.
    let mut hat = String::from("o hat\n");
    for (x, y, z) in [(-0.1, -0.1, -0.1), (0.1, -0.1, -0.1), (0.1, -0.1, 0.1), (-0.1, -0.1, 0.1), (0.0, 0.5, 0.0)] {
        hat += &format!("v {x} {} {z}\n", top + y);
    }
    for [a, b, c] in [[1, 2, 3], [1, 3, 4], [1, 5, 2], [2, 5, 3], [3, 5, 4], [4, 5, 1]] {
        hat += &format!("f {} {} {}\n", count + a, count + b, count + c);
    }
    fs::write(path("hatter.obj"), format!("{body}\n{hat}")).unwrap();
    let args = ["animate", "biped.rig.ron", "walker.bvh", "walker.bvh", "--mesh", "hatter.obj", "--frames", "2"];
    let answer = json(folder.path(), &[&args[..], &["-o", "strip.png"]].concat());
    assert!(answer["notes"].to_string().contains("the first of 2 clips"), "{answer}");
    let strip = image::open(path("strip.png")).unwrap().to_rgb8();
    let (width, height) = strip.dimensions();
    for frame in 0..2 {
        let (left, right) = (frame * width / 2, (frame + 1) * width / 2);
        let apart = |x: u32, y: u32| {
            let (a, b) = (strip.get_pixel(x, y), strip.get_pixel(left, y));
            a.0.iter().zip(b.0).map(|(a, b)| a.abs_diff(b)).max().unwrap()
        };
        let is_empty = |y: u32| (left..right).all(|x| apart(x, y) < 12);
        assert!(is_empty(0) && is_empty(1), "frame {frame}: something is cut off at the top");
        assert!((2..height / 3).any(|y| !is_empty(y)), "frame {frame}: nothing is at the top");
    }
}
