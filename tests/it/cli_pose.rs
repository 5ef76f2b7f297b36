//! `rigsmith pose` and `render --build`: the app on the command line, with the real binary, real files and exit codes.

mod names;
mod rest;
mod several_meshes;

use std::{collections::BTreeSet, fs, path::Path, sync::Arc};

use bevy::math::{Quat, Vec3};
use rigsmith::{
    files::{MeshShape, MeshToSave, ProjectToSave, RealDisk, load_model, load_template, store_project},
    headless::Workbench,
    mesh::model::Weights,
    plugins::commands::BuildStep,
    rig::{
        JointData, NodeType, PoseOffset, Rig, RigEdit, SkinData, Uid,
        operations::Operation,
        project::{Project, ProjectRig, write_project},
    },
};
use serde_json::Value;

use crate::cli_build::rigsmith;

/// A turned root with a control and two attributes, a boom whose control has a name and a label, and a hook that one
/// attribute turns by a quarter, and the other, a choice, moves outwards.
const CRANE: &str = r#"(
    format: 2,
    name: "crane",
    groups: [(name: "arm", color: (0.9, 0.6, 0.0))],
    joints: [
        (
            label: "root",
            translation: (0, 1, 0),
            rotation: (0, 0, 90),
            tags: [
                control(creation: (name: "base")),
                attribute(node: "@command control/base role:control", name: "turn", min: 0.0, max: 1.0, default: 0.0),
                attribute(node: "@command control/base role:control", name: "mode", choices: ["slow", "fast", "0"]),
            ],
        ),
        (
            label: "boom",
            parent: "root",
            group: "arm",
            translation: (0, -0.5, 0),
            rotation: (0, 0, -90),
            tags: [
                control(follow_scale: true, creation: (name: "lift", label: "boom control")),
            ],
        ),
        (
            label: "hook",
            parent: "boom",
            group: "arm",
            translation: (0.5, 0, 0),
            tags: [
                driven_key(
                    driver: "@command control/base role:control",
                    driver_attribute: "mode",
                    keys: [(0.0, 0.0), (2.0, 1.0)],
                    ease: Linear,
                    output: "@this",
                    output_channel: TranslateX,
                ),
                driven_key(
                    driver: "@command control/base role:control",
                    driver_attribute: "turn",
                    keys: [(0.0, 0.0), (1.0, 90.0)],
                    output: "@this",
                    output_channel: RotateZ,
                ),
            ],
        ),
    ],
)
"#;

/// A block around the crane.
const BLOCK: &str = "o block\nv -0.1 0.9 -0.1\nv 1.1 0.9 -0.1\nv 1.1 1.1 -0.1\nv -0.1 1.1 -0.1\nv -0.1 0.9 0.1\n\
    v 1.1 0.9 0.1\nv 1.1 1.1 0.1\nv -0.1 1.1 0.1\nf 4 3 2 1\nf 5 6 7 8\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\n";

/// First control of the part `spring_chain`, as a reference.
const FIRST: &str = "@command control/chain_1 role:control pick:START";

fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("crane.rig.ron"), CRANE).unwrap();
    fs::write(folder.path().join("block.obj"), BLOCK).unwrap();
    folder
}

fn bundled(name: &str) -> String {
    format!("{}/assets/templates/{name}.rig.ron", env!("CARGO_MANIFEST_DIR"))
}

/// Output of `rigsmith pose RIG --json`, which must succeed, with entities and program at the same places.
#[track_caller]
fn pose(folder: &Path, rig: &str, args: &[&str]) -> Value {
    let answer = rigsmith(folder, &[&["pose", rig, "--json"], args].concat());
    assert_eq!(answer.code, 0, "{args:?}: {}{}", answer.out, answer.err);
    let json = answer.json();
    let error = json["error"].as_f64().expect("a number");
    assert!(error <= 1e-5, "{args:?}: entities and program differ by {error}");
    json
}

#[track_caller]
fn node<'a>(json: &'a Value, name: &str) -> &'a Value {
    let nodes = json["nodes"].as_array().unwrap();
    nodes.iter().find(|node| node["name"] == name).unwrap_or_else(|| panic!("no node {name} in {json}"))
}

fn vector(value: &Value) -> Vec3 {
    Vec3::from([0, 1, 2].map(|axis| value[axis].as_f64().unwrap() as f32))
}

fn quat(value: &Value) -> Quat {
    Quat::from_array([0, 1, 2, 3].map(|axis| value[axis].as_f64().unwrap() as f32))
}

#[track_caller]
fn place(json: &Value, name: &str) -> Vec3 {
    vector(&node(json, name)["position"])
}

#[track_caller]
fn is_at(json: &Value, name: &str, wanted: [f32; 3]) {
    let place = place(json, name);
    assert!(place.distance(wanted.into()) < 1e-5, "{name} is at {place}, not at {wanted:?}");
}

#[test]
fn json_lists_every_node_in_rig_space() {
    let folder = folder();
    let json = pose(folder.path(), "crane.rig.ron", &["--set", "base.translate=(0.25,0,0)", "--set", "base.turn=1"]);
    let rig = load_template(&RealDisk, &folder.path().join("crane.rig.ron")).unwrap().rig;
    let mut bench = Workbench::with_rig(1, rig);
    bench.build(BuildStep::All);
    let built = bench.built().unwrap();
    let nodes = json["nodes"].as_array().unwrap();
    assert_eq!(nodes.len(), built.nodes.len());
    let keys = "name label uid kind parent position rotation scale program_position program_rotation deform";
    for (node, built) in nodes.iter().zip(&built.nodes) {
        let told: BTreeSet<&str> = node.as_object().unwrap().keys().map(String::as_str).collect();
        assert_eq!(told, keys.split(' ').collect::<BTreeSet<&str>>(), "{node}");
        assert_eq!(node["uid"].as_str().unwrap(), built.uid.to_string());
        let (kind, deform) = match built.kind {
            NodeType::Joint => ("joint", true),
            NodeType::Null => ("null", false),
            NodeType::Control => ("control", false),
        };
        assert_eq!((node["kind"].as_str(), node["deform"].as_bool()), (Some(kind), Some(deform)), "{node}");
        let parent = built.parent.map(|parent| bench.built().unwrap().nodes[parent].uid.to_string());
        assert_eq!(node["parent"].as_str(), parent.as_deref(), "{node}");
        assert_eq!(node["label"].as_str(), built.label.as_deref(), "{node}");
        assert!(vector(&node["position"]).distance(vector(&node["program_position"])) < 1e-5, "{node}");
        assert!(quat(&node["rotation"]).angle_between(quat(&node["program_rotation"])) < 1e-3, "{node}");
    }
    assert!(nodes.iter().any(|node| node["kind"] == "null"), "{json}");
    // The control's own X axis points up.
    is_at(&json, "root", [0.0, 1.25, 0.0]);
    is_at(&json, "boom", [0.5, 1.25, 0.0]);
    is_at(&json, "hook", [1.0, 1.25, 0.0]);
    let turned = quat(&node(&json, "hook")["rotation"]);
    assert!(turned.angle_between(Quat::from_rotation_z(std::f32::consts::FRAC_PI_2)) < 1e-3, "{turned}");
    // For people: how many nodes, and the largest difference.
    let answer = rigsmith(folder.path(), &["pose", "crane.rig.ron"]);
    assert!(answer.out.contains(&format!("posed {} nodes; an app shows them within ", nodes.len())), "{}", answer.out);
}

#[test]
fn channels_are_set_relative_to_rest_in_the_axes_of_the_control() {
    let folder = folder();
    let run = |sets: &[&str]| {
        let args: Vec<&str> = sets.iter().flat_map(|set| ["--set", set]).collect();
        pose(folder.path(), "crane.rig.ron", &args)
    };
    let rest = run(&[]);
    is_at(&rest, "boom", [0.5, 1.0, 0.0]);
    is_at(&rest, "hook", [1.0, 1.0, 0.0]);
    is_at(&run(&["lift.rotate=(0,0,90)"]), "hook", [0.5, 1.5, 0.0]);
    // About X, then about the turned Y.
    is_at(&run(&["lift.rotate=(90,90,0)"]), "hook", [0.5, 1.5, 0.0]);
    is_at(&run(&["lift.scale=(2,1,1)"]), "hook", [1.5, 1.0, 0.0]);
    // Channels of one control add up, and the last value of a channel counts.
    let all =
        run(&["lift.scale=(2,1,1)", "lift.rotate=(0,0,90)", "lift.translate=(0,0,9)", "lift.translate=(0,0,0.5)"]);
    is_at(&all, "boom", [0.5, 1.0, 0.5]);
    is_at(&all, "hook", [0.5, 2.0, 0.5]);
    let scale = vector(&node(&all, "lift")["scale"]);
    assert!(scale.distance(Vec3::new(2.0, 1.0, 1.0)) < 1e-5, "{scale}");
}

#[test]
fn switches_keep_the_pose_and_values_hold_after_them() {
    let folder = folder();
    let arm = bundled("parts/arm");
    let joints = |json: &Value| -> Vec<(String, Vec3)> {
        let nodes = json["nodes"].as_array().unwrap().iter().filter(|node| node["kind"] == "joint");
        nodes.map(|node| (node["uid"].as_str().unwrap().to_owned(), vector(&node["position"]))).collect()
    };
    let rest = joints(&pose(folder.path(), &arm, &[]));
    // By group, by the control that carries the attribute, by a joint of the limb; by name and by number.
    let switches = ["arm_l=fk", "arm_l=ik", "arm_settings_l=fk", "forearm_l=fk", "forearm_l=0", "hand_ik_l=chest"];
    for switch in switches {
        let json = pose(folder.path(), &arm, &["--switch", switch]);
        for ((uid, before), (_, after)) in rest.iter().zip(joints(&json)) {
            assert!(before.distance(after) < 1e-4, "{switch} moves {uid} from {before} to {after}");
        }
    }
    let bend = format!("{}.rotate=(40,0,0)", "@command control/arm_fk_l role:control pick:1");
    let hand = |switch: &str| {
        let json = pose(folder.path(), &arm, &["--switch", switch, "--set", &bend]);
        place(&json, "hand_l").distance(place(&pose(folder.path(), &arm, &[]), "hand_l"))
    };
    assert!(hand("arm_l=fk") > 0.1, "forward controls drive the arm");
    assert!(hand("arm_l=ik") < 1e-4, "forward controls have no effect");
    // A goal that is moved, then left for forward kinematics; by the name of the goal and by the label that both controls have.
    for goal in ["hand_ik_l", "hand_l"] {
        let set = format!("{goal}.translate=(0,-0.05,0.1)");
        let led = pose(folder.path(), &arm, &["--set", &set]);
        let forward = pose(folder.path(), &arm, &["--set", &set, "--switch", "arm_l=fk"]);
        assert!(place(&led, "hand_l").distance(place(&pose(folder.path(), &arm, &[]), "hand_l")) > 0.05, "{goal}");
        for ((uid, before), (_, after)) in joints(&led).into_iter().zip(joints(&forward)) {
            assert!(before.distance(after) < 1e-4, "{goal}: {uid} from {before} to {after}");
        }
    }
}

/// A foot that rolls stands as it stood when its leg goes over to forward kinematics, and when it comes back.
#[test]
fn a_rolled_foot_keeps_its_place_through_switches() {
    let folder = folder();
    let leg = bundled("biped");
    let all = |more: &[&str]| {
        let rolled =
            ["--set", "foot_ik_l.translate=(0,0.2,0.1)", "--set", "foot_ik_l.roll=40", "--set", "foot_ik_l.bank=10"];
        let json = pose(folder.path(), &leg, &[&rolled[..], more].concat());
        ["shin_l", "foot_l", "toe_l"].map(|name| (place(&json, name), quat(&node(&json, name)["rotation"])))
    };
    let before = all(&[]);
    for switches in [&["--switch", "leg_l=fk"][..], &["--switch", "leg_l=fk", "--switch", "leg_l=ik"]] {
        for ((at, turn), (at_before, turn_before)) in all(switches).into_iter().zip(before) {
            let angle = turn.angle_between(turn_before).to_degrees();
            assert!(at.distance(at_before) < 1e-4 && angle < 0.1, "{switches:?}: {at_before} to {at}, {angle} degrees");
        }
    }
}

#[test]
fn frames_move_springs_and_are_the_same_every_time() {
    let folder = folder();
    let chain = bundled("parts/spring_chain");
    let bend = format!("{FIRST}.rotate=(60,0,0)");
    let run = |frames: &str, more: &[&str]| {
        let args = [&["--set", &bend, "--frames", frames], more].concat();
        pose(folder.path(), &chain, &args)
    };
    let tip = |json: &Value| place(json, "chain_5");
    let still = tip(&run("0", &["--set", &format!("{FIRST}.swing=0")]));
    let start = tip(&pose(folder.path(), &chain, &[]));
    assert!(still.distance(start) > 0.1, "the chain hangs on its first control");
    let (early, late) = (run("3", &[]), run("1200", &[]));
    assert!(tip(&early).distance(still) > 0.02, "three frames in, the chain still swings");
    assert!(tip(&late).distance(still) < 1e-3, "{} is not {still}: the chain has settled", tip(&late));
    assert_eq!(early["nodes"], run("3", &[])["nodes"], "no time but that of the frames passes");
    assert_eq!(run("0", &[])["nodes"], run("0", &[])["nodes"]);
}

/// A project with the crane: posed, and with a stored pose `up`.
fn with_project() -> tempfile::TempDir {
    let folder = folder();
    let rig = load_template(&RealDisk, &folder.path().join("crane.rig.ron")).unwrap().rig;
    let mut bench = Workbench::with_rig(1, rig);
    bench.build(BuildStep::All);
    let control = |bench: &Workbench, name: &str| -> Uid {
        bench.built().unwrap().nodes.iter().find(|node| *node.name == *name).unwrap().uid
    };
    let (base, lift) = (control(&bench, "base"), control(&bench, "lift"));
    let up = PoseOffset::from_rotation(Quat::from_rotation_z(std::f32::consts::FRAC_PI_2));
    bench.operate(Operation::Pose(vec![(lift, up)])).unwrap();
    bench.operate(Operation::StorePose("up".into())).unwrap();
    bench.operate(Operation::ResetPose(Vec::new())).unwrap();
    let raised = PoseOffset { translation: Vec3::new(0.25, 0.0, 0.0), ..PoseOffset::IDENTITY };
    bench.operate(Operation::Pose(vec![(base, raised)])).unwrap();
    let rig = ProjectRig { rig: bench.rig().clone(), skins: Vec::new() };
    let project = Project { name: "crane".into(), rigs: vec![rig], ..Project::default() };
    fs::write(folder.path().join("crane.rigsmith.ron"), write_project(&project)).unwrap();
    folder
}

#[test]
fn a_project_keeps_its_pose_and_shows_stored_ones() {
    let folder = with_project();
    let run = |args: &[&str]| pose(folder.path(), "crane.rigsmith.ron", args);
    let current = run(&[]);
    is_at(&current, "boom", [0.5, 1.25, 0.0]);
    is_at(&current, "hook", [1.0, 1.25, 0.0]);
    let stored = run(&["--pose", "up"]);
    is_at(&stored, "boom", [0.5, 1.0, 0.0]);
    is_at(&stored, "hook", [0.5, 1.5, 0.0]);
    // Values are set on top of it.
    is_at(&run(&["--pose", "up", "--set", "base.translate=(0.25,0,0)"]), "hook", [0.5, 1.75, 0.0]);
    let written = run(&["--pose", "up", "-o", "up.rig.ron"]);
    assert_eq!(written["output"], "up.rig.ron");
    let rig = load_template(&RealDisk, &folder.path().join("up.rig.ron")).unwrap().rig;
    let hook = rig.position(rig.find_label("hook").unwrap());
    assert!(hook.distance(Vec3::new(0.5, 1.5, 0.0)) < 1e-5, "{hook}");
    let missing = rigsmith(folder.path(), &["pose", "crane.rigsmith.ron", "--pose", "down"]);
    assert!(missing.code == 1 && missing.err.contains("up"), "names the stored poses: {}", missing.err);
    let none = rigsmith(folder.path(), &["pose", "crane.rig.ron", "--pose", "up"]);
    assert!(none.code == 1 && none.err.contains("none"), "{}", none.err);
}

#[test]
fn the_posed_character_and_the_posed_skeleton_are_written() {
    let folder = folder();
    let set = ["--set", "lift.rotate=(0,0,90)", "--set", "base.translate=(0.25,0,0)"];
    for (file, more) in [
        ("bare.glb", &[] as &[&str]),
        ("skinned.glb", &["--mesh", "block.obj"]),
        ("skinned.gltf", &["--mesh", "block.obj"]),
    ] {
        let json = pose(folder.path(), "crane.rig.ron", &[&set, more, &["-o", file]].concat());
        let model = load_model(&RealDisk, &folder.path().join(file)).unwrap();
        let globals = model.rest_globals();
        for joint in ["root", "boom", "hook"] {
            let at =
                model.nodes.iter().position(|node| node.name == joint).unwrap_or_else(|| panic!("{file}: {joint}"));
            let is = Vec3::from(globals[at].translation);
            assert!(is.distance(place(&json, joint)) < 1e-5, "{file}: {joint} is at {is}");
        }
        assert_eq!(model.weights.is_some(), !more.is_empty(), "{file}");
        assert_eq!(model.points.len(), if more.is_empty() { 0 } else { 8 }, "{file}");
    }
    let args = [&set[..], &["-o", "posed.rig.ron"]].concat();
    let json = pose(folder.path(), "crane.rig.ron", &args);
    let bytes = fs::read(folder.path().join("posed.rig.ron")).unwrap();
    let rig = load_template(&RealDisk, &folder.path().join("posed.rig.ron")).unwrap().rig;
    assert!(rig.walk().all(|joint| joint.data.tags.is_empty()), "a skeleton");
    for joint in rig.walk() {
        let (label, at) = (joint.data.label.clone().unwrap(), rig.position(joint.data.uid));
        assert!(at.distance(place(&json, &label)) < 1e-5, "{label} is at {at}");
    }
    pose(folder.path(), "crane.rig.ron", &args);
    assert_eq!(fs::read(folder.path().join("posed.rig.ron")).unwrap(), bytes, "the same bytes every time");
}

#[test]
fn the_hand_of_the_biped_goes_where_its_control_goes() {
    let folder = folder();
    let json = pose(folder.path(), &bundled("biped"), &["--set", "hand_l.translate=(-0.1,0.15,0.1)"]);
    let rest = pose(folder.path(), &bundled("biped"), &[]);
    assert!((place(&json, "hand_ik_l").distance(place(&rest, "hand_ik_l")) - 0.206).abs() < 1e-3);
    let off = place(&json, "hand_l").distance(place(&json, "hand_ik_l"));
    assert!(off < 1e-4, "the hand is off by {off}");
    assert!(place(&json, "hand_r").distance(place(&rest, "hand_r")) < 1e-5, "the other hand stays");
}

/// Locks and limits hold what is set, which is told with the value that holds.
#[test]
fn held_values_are_told() {
    let folder = folder();
    let biped = bundled("biped");
    let notes = |sets: &[&str]| -> Vec<String> {
        let sets = sets.iter().flat_map(|set| ["--set", set]);
        let json = pose(folder.path(), &biped, &sets.collect::<Vec<_>>());
        let notes = json["notes"].as_array().map_or(&[][..], Vec::as_slice);
        notes.iter().map(|note| note.as_str().unwrap().to_owned()).collect()
    };
    for (set, held) in [
        ("arm_settings_l.ik_fk=7", "arm_settings_l.ik_fk=7 is held at 1"),
        ("arm_settings_l.translate=(1,0,0)", "arm_settings_l.translate=(1,0,0) is held at (0,0,0)"),
    ] {
        let told = notes(&[set]);
        assert!(told.iter().any(|note| note.starts_with(held)), "{set}: {told:?}");
    }
    assert_eq!(notes(&["hand_ik_l.translate=(0,0.1,0)", "hand_ik_l.rotate=(0,0,30)"]), Vec::<String>::new());
    // The last of several values counts.
    assert_eq!(notes(&["arm_settings_l.ik_fk=7", "arm_settings_l.ik_fk=1"]), Vec::<String>::new());
}

#[cfg(feature = "render")]
#[test]
fn pictures_show_the_pose_and_its_controls_on_a_gpu() {
    if rigsmith::render::adapter().is_none() {
        crate::prerequisites::skip("there is no graphics adapter, not even a software one", "RIGSMITH_REQUIRE_GPU");
        return;
    }
    let folder = with_project();
    let set = "lift.rotate=(0,0,70)";
    let picture = |args: &[&str], file: &str| -> image::RgbImage {
        let answer = rigsmith(folder.path(), &[args, &["-o", file]].concat());
        assert_eq!(answer.code, 0, "{args:?}: {}", answer.err);
        image::open(folder.path().join(file)).unwrap_or_else(|error| panic!("{args:?}: {error}")).to_rgb8()
    };
    let differing = |a: &image::RgbImage, b: &image::RgbImage| {
        assert_eq!(a.dimensions(), b.dimensions());
        let is_other =
            |(a, b): &(&image::Rgb<u8>, &image::Rgb<u8>)| a.0.iter().zip(b.0).any(|(a, b)| a.abs_diff(b) > 24);
        a.pixels().zip(b.pixels()).filter(is_other).count()
    };
    let render = |more: &[&str], file: &str| {
        picture(&[&["render", "crane.rig.ron", "--no-grid", "--size", "320x240"], more].concat(), file)
    };
    let skeleton = render(&[], "skeleton.png");
    let controls = render(&["--build"], "controls.png");
    let posed = render(&["--build", "--set", set], "posed.png");
    assert!(differing(&skeleton, &controls) > 50, "controls are drawn");
    assert!(differing(&controls, &posed) > 50, "controls are drawn in the pose");
    assert!(differing(&posed, &render(&["--set", set], "again.png")) < 20, "--set builds");
    let rest = picture(&["pose", "crane.rig.ron", "--mesh", "block.obj"], "rest.png");
    let up = picture(&["pose", "crane.rig.ron", "--mesh", "block.obj", "--set", set], "up.png");
    assert!(differing(&rest, &up) > 500, "the mesh follows");
    let stored = picture(&["pose", "crane.rigsmith.ron", "--pose", "up", "--mesh", "block.obj"], "stored.png");
    assert!(differing(&rest, &stored) > 500, "a stored pose is drawn");
    let chain = bundled("parts/spring_chain");
    let bend = format!("{FIRST}.rotate=(60,0,0)");
    let swinging = |command: &str, frames: &str| {
        picture(&[command, &chain, "--set", &bend, "--frames", frames], &format!("{command}_{frames}.png"))
    };
    for command in ["pose", "render"] {
        let (early, late) = (swinging(command, "3"), swinging(command, "1200"));
        assert!(differing(&early, &late) > 200, "{command}: springs are drawn on their way");
        assert!(differing(&early, &swinging(command, "3")) == 0, "{command}: no time passes in a picture");
    }
    let wrong = rigsmith(folder.path(), &["render", "crane.rig.ron", "--set", "lift", "-o", "no.png"]);
    assert!(wrong.code == 2 && !folder.path().join("no.png").exists(), "{}", wrong.err);
    let bare = rigsmith(folder.path(), &["render", "block.obj", "--build", "-o", "bare.png"]);
    assert!(bare.code == 0 && bare.err.contains("no commands"), "a mesh has no controls: {}", bare.err);
}

#[test]
fn the_mesh_of_a_project_is_posed_with_its_own_weights() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    let square = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\n";
    fs::write(path("square.obj"), square).unwrap();
    let (mut rig, mesh) = (Rig::new(Uid(1), "rig"), Uid(0x50));
    for number in 0..2 {
        let mut joint = JointData { uid: Uid(10 + number), label: Some(format!("j{number}")), ..Default::default() };
        joint.rest.translation = Vec3::Y * number as f32;
        rig.apply(&RigEdit::AddJoint { joint: Box::new(joint), parent: None, index: usize::MAX }).unwrap();
    }
    let model = load_model(&RealDisk, &path("square.obj")).unwrap();
    let mut weights = Weights::default();
    // No binding would give these.
    model.points.iter().for_each(|_| weights.push([(1, 0.75), (0, 0.25)]));
    let skin = SkinData { joints: vec![Uid(10), Uid(11)], weights, at_rest: true, ..Default::default() };
    rig.apply(&RigEdit::SetSkin(mesh, Some(Arc::new(skin)))).unwrap();
    let shape = MeshShape::Open { triangles: model.point_triangles().into(), rest: Arc::new(model.at_rest()) };
    let mesh = MeshToSave { uid: mesh, rig: rig.uid(), path: path("square.obj"), nodes: Arc::default(), shape };
    let rigs = vec![rig, Rig::new(Uid(2), "bystander")];
    let project = ProjectToSave { name: "square".into(), rigs, meshes: vec![mesh], ..Default::default() };
    store_project(&RealDisk, &path("square.rigsmith.ron"), &project).unwrap();

    let answer = rigsmith(folder.path(), &["pose", "square.rigsmith.ron", "-o", "square.glb"]);
    assert_eq!(answer.code, 0, "{}", answer.err);
    assert!(answer.err.contains("bystander"), "what is left out is told: {}", answer.err);
    let written = load_model(&RealDisk, &path("square.glb")).unwrap();
    assert_eq!(written.points.len(), 4);
    let weights = written.weights.unwrap();
    let shares: Vec<f32> = (0..4).flat_map(|point| weights.of(point).map(|(_, share)| share)).collect();
    assert!(shares.len() == 8 && shares.iter().all(|share| (share - 0.25).abs() < 1e-3 || (share - 0.75).abs() < 1e-3));
    // The project's own mesh is an input, although nobody has named it.
    let text = fs::read_to_string(path("square.rigsmith.ron")).unwrap();
    fs::write(path("of_glb.rigsmith.ron"), text.replace("\"square.obj\"", "\"square.glb\"")).unwrap();
    let before = fs::read(path("square.glb")).unwrap();
    for args in [
        &["pose", "of_glb.rigsmith.ron", "-o", "square.glb"][..],
        &["animate", "of_glb.rigsmith.ron", "walk.bvh", "-o", "./square.glb"],
    ] {
        let answer = rigsmith(folder.path(), args);
        assert!(answer.code == 2 && answer.err.contains("is an input"), "{args:?}: {}", answer.err);
        assert!(fs::read(path("square.glb")).unwrap() == before, "{args:?}");
    }
    // A mesh that is given stands in for it.
    fs::write(path("other.obj"), format!("{square}v 0 2 0\nf 4 3 5\n")).unwrap();
    let args = ["pose", "square.rigsmith.ron", "--mesh", "other.obj", "-o", "other.glb"];
    let answer = rigsmith(folder.path(), &args);
    assert!(answer.code == 0 && answer.err.contains("stands in"), "{}", answer.err);
    assert_eq!(load_model(&RealDisk, &path("other.glb")).unwrap().points.len(), 5);
    // Outside of the project's folder, its mesh is refused, and a person's own is taken.
    fs::create_dir(path("inner")).unwrap();
    let text = fs::read_to_string(path("square.rigsmith.ron")).unwrap();
    fs::write(path("inner/away.rigsmith.ron"), text.replace("\"square.obj\"", "\"../square.obj\"")).unwrap();
    for command in ["pose", "check"] {
        let mut args = vec![command, "inner/away.rigsmith.ron"];
        args.extend(["-o", "away.glb"].iter().filter(|_| command == "pose"));
        let answer = rigsmith(folder.path(), &args);
        let told = format!("{}{}", answer.out, answer.err);
        assert!(answer.code == 1 && told.contains("is outside of") && told.contains("--mesh"), "{command}: {told}");
        assert!(!path("away.glb").exists());
    }
    let args = ["pose", "inner/away.rigsmith.ron", "--mesh", "square.obj", "-o", "away.glb"];
    let answer = rigsmith(folder.path(), &args);
    assert!(answer.code == 0 && path("away.glb").exists(), "{}", answer.err);
    // Without a file to write, a mesh would be for nothing.
    let answer = rigsmith(folder.path(), &["pose", "square.rigsmith.ron", "--mesh", "other.obj"]);
    assert!(answer.code == 2 && answer.err.contains("-o"), "{}", answer.err);
}

#[test]
fn frames_end_with_the_time_that_a_command_may_take() {
    let folder = folder();
    // The build before the frames counts, too, and takes a while on a machine that does something else.
    let limits = ["--limit", "seconds=4", "--limit", "frames=100000000"];
    let answer = rigsmith(folder.path(), &[&limits[..], &["pose", "crane.rig.ron", "--frames", "100000000"]].concat());
    assert!(answer.code == 1 && answer.err.contains("the frames took longer than 4 s"), "{}", answer.err);
}
