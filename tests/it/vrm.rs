//! Avatars in VRM 1.0, written by the commands and checked against the rules of the specification.

mod models;
mod schema;

use std::{fs, path::Path};

use glam::{Affine3A, Mat4, Quat, Vec3};
use rigsmith::{
    files::{RealDisk, load_model, load_rig_text, store_model},
    mesh::{
        gltf::{GltfWriteSettings, read_avatar},
        model::{Channel, ChannelTarget, Clip, Interpolation, Model, Node, Trs},
        similarity::Similarity,
        skinning::skin_points,
        vrm::ConstraintKind,
    },
    rig::{animation::file_clip::motion_of, vrm::spring_numbers},
};
use serde_json::Value;

use self::schema::{check_avatar, document, parents};
use crate::{cli_build::rigsmith, exports::exports, prerequisites::test_data};

const WALKER: &str = include_str!("retarget/walker.bvh");

/// A figure of few joints in an A-pose, with its toes turned out, hair that swings and a tail.
const FIGURE: &str = r#"(
    format: 2,
    name: "figure",
    version: "1.2.0",
    author: "Ann Example",
    joints: [
        (label: "hips", translation: (0, 1, 0)),
        (label: "tail_1", parent: "hips", translation: (0, 0, -0.1), tags: [
            spring(nodes: "@joint tail_1", frequency: 4.0, damping: 0.1, colliders: "@joint hips", radii: [0.12]),
        ]),
        (label: "tail_2", parent: "tail_1", translation: (0, -0.2, -0.1)),
        (label: "spine", parent: "hips", translation: (0, 0.2, 0)),
        (label: "chest", parent: "spine", translation: (0, 0.2, 0)),
        (label: "head", parent: "chest", translation: (0, 0.25, 0)),
        (label: "eye_l", parent: "head", translation: (0.03, 0.08, 0.08)),
        (label: "eye_r", parent: "head", translation: (-0.03, 0.08, 0.08)),
        (label: "jaw", parent: "head", translation: (0, 0.02, 0.03)),
        (label: "hair_1", parent: "head", translation: (0, 0.1, -0.1), tags: [
            spring(
                nodes: "@joint hair_1 + @joint hair_2 + @joint hair_3",
                frequency: 2.0,
                damping: 0.3,
                motion: 0.0,
                colliders: "@joint head + @joint upper_arm_l",
                collider_ends: "@joint jaw + @joint forearm_l",
                radii: [0.09, 0.05],
            ),
        ]),
        (label: "hair_2", parent: "hair_1", translation: (0, -0.1, -0.05)),
        (label: "hair_3", parent: "hair_2", translation: (0, -0.1, 0)),
        (label: "upper_arm_l", parent: "chest", translation: (0.15, 0.15, 0)),
        (label: "forearm_l", parent: "upper_arm_l", translation: (0.2, -0.2, 0)),
        (label: "hand_l", parent: "forearm_l", translation: (0.18, -0.18, 0.05)),
        (label: "upper_arm_r", parent: "chest", translation: (-0.15, 0.15, 0)),
        (label: "forearm_r", parent: "upper_arm_r", translation: (-0.2, -0.2, 0)),
        (label: "hand_r", parent: "forearm_r", translation: (-0.18, -0.18, 0.05)),
        (label: "thigh_l", parent: "hips", translation: (0.1, -0.05, 0)),
        (label: "shin_l", parent: "thigh_l", translation: (0.04, -0.42, 0.02)),
        (label: "foot_l", parent: "shin_l", translation: (0.04, -0.42, -0.02)),
        (label: "toe_l", parent: "foot_l", translation: (0.05, -0.08, 0.12)),
        (label: "thigh_r", parent: "hips", translation: (-0.1, -0.05, 0)),
        (label: "shin_r", parent: "thigh_r", translation: (-0.04, -0.42, 0.02)),
        (label: "foot_r", parent: "shin_r", translation: (-0.04, -0.42, -0.02)),
        (label: "toe_r", parent: "foot_r", translation: (-0.05, -0.08, 0.12)),
    ],
)"#;

fn json(folder: &Path, args: &[&str]) -> Value {
    let answer = rigsmith(folder, &[args, &["--json"]].concat());
    assert_eq!(answer.code, 0, "{args:?}: {} {}", answer.out, answer.err);
    answer.json()
}

/// An avatar, with the transforms of its nodes in its space.
struct Written {
    document: Value,
    globals: Vec<Trs>,
}

impl Written {
    /// Reads an avatar, which has to keep all rules.
    fn read(path: &Path) -> Self {
        let document = document(&fs::read(path).unwrap());
        check_avatar(&document);
        let parents = parents(&document);
        let list = |node: &Value, name: &str, otherwise: &[f32]| -> Vec<f32> {
            let list = node.get(name).and_then(Value::as_array);
            list.map_or(otherwise.to_vec(), |list| list.iter().map(|number| number.as_f64().unwrap() as f32).collect())
        };
        let local = |node: &Value| Trs {
            translation: Vec3::from_slice(&list(node, "translation", &[0.0; 3])),
            rotation: Quat::from_slice(&list(node, "rotation", &[0.0, 0.0, 0.0, 1.0])),
            scale: Vec3::ONE,
        };
        let nodes = document["nodes"].as_array().unwrap();
        let global = |node: usize| {
            let above = std::iter::successors(parents[node], |node| parents[*node]);
            above.fold(local(&nodes[node]), |global, above| local(&nodes[above]) * global)
        };
        let globals = (0..nodes.len()).map(global).collect();
        Self { document, globals }
    }

    fn vrm(&self) -> &Value {
        &self.document["extensions"]["VRMC_vrm"]
    }

    fn node(&self, bone: &str) -> usize {
        self.vrm()["humanoid"]["humanBones"][bone]["node"].as_u64().unwrap_or_else(|| panic!("no {bone}")) as usize
    }

    fn place(&self, bone: &str) -> Vec3 {
        self.globals[self.node(bone)].translation
    }

    fn named(&self, name: &str) -> usize {
        self.document["nodes"].as_array().unwrap().iter().position(|node| node["name"] == name).unwrap()
    }

    /// Checks the rest pose: definitions 1.1, 1.2, 1.4, 1.6 and 1.7 of the T-pose, to a degree.
    fn check_pose(&self) {
        let along = |from: &str, to: &str, direction: Vec3| {
            let way = (self.place(to) - self.place(from)).normalize();
            let angle = way.dot(direction).clamp(-1.0, 1.0).acos().to_degrees();
            assert!(angle < 1.0, "{from} to {to}: {way} is {angle} degrees from {direction}");
        };
        for (side, out) in [("left", Vec3::X), ("right", Vec3::NEG_X)] {
            let bone = |name: &str| format!("{side}{name}");
            along(&bone("UpperArm"), &bone("LowerArm"), out);
            along(&bone("LowerArm"), &bone("Hand"), out);
            along(&bone("UpperLeg"), &bone("Foot"), Vec3::NEG_Y);
            let human = &self.vrm()["humanoid"]["humanBones"];
            if human.get(bone("Toes")).is_some() {
                let way = self.place(&bone("Toes")) - self.place(&bone("Foot"));
                assert!(way.z > 0.0 && (way.x / way.z).abs() < 0.02, "{side} foot: {way}");
            }
            for finger in ["Index", "Middle", "Ring", "Little"] {
                let parts = ["Proximal", "Intermediate", "Distal"].map(|part| bone(&format!("{finger}{part}")));
                if parts.iter().all(|part| human.get(part).is_some()) {
                    along(&parts[0], &parts[1], out);
                    along(&parts[1], &parts[2], out);
                }
            }
            if human.get(bone("ThumbDistal")).is_some() {
                along(&bone("ThumbProximal"), &bone("ThumbDistal"), (out + Vec3::Z).normalize());
                // The palm is down: the index finger is in front of the little one, at the same height.
                let across = self.place(&bone("IndexProximal")) - self.place(&bone("LittleProximal"));
                assert!(across.z > 0.0 && (across.y / across.z).abs() < 0.02, "{side} palm: {across}");
            }
        }
        let (head, hips) = (self.place("head"), self.place("hips"));
        assert!(head.y > hips.y && hips.x.abs() < 0.05, "{hips} {head}");
    }
}

/// Points of a model skinned by its nodes where they stand.
fn skinned(model: &Model, globals: &[Trs]) -> Vec<Vec3> {
    let skin = &model.skins[0];
    let mut matrices = vec![Affine3A::IDENTITY; model.nodes.len()];
    for (joint, inverse) in skin.joints.iter().zip(&skin.inverse_binds) {
        matrices[*joint] = globals[*joint].affine() * Affine3A::from_mat4(*inverse);
    }
    let mut points = Vec::new();
    skin_points(&model.points, model.weights.as_ref().unwrap(), &matrices, &mut points);
    points
}

fn at_rest(model: &Model) -> Vec<Trs> {
    let mut globals: Vec<Trs> = Vec::new();
    for node in &model.nodes {
        globals.push(node.parent.map_or(node.rest, |parent| globals[parent] * node.rest));
    }
    globals
}

#[test]
fn a_walk_on_the_biped_becomes_an_avatar() {
    let work = tempfile::tempdir().unwrap();
    let (folder, _guard) = exports();
    fs::write(work.path().join("walker.bvh"), WALKER).unwrap();
    let mesh = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/models/biped.obj").display().to_string();
    let (vrm, again) = (folder.join("biped_walk.vrm"), work.path().join("again.vrm"));
    let glb = work.path().join("walk.glb");
    let run = |output: &Path, more: &[&str]| {
        let output = output.display().to_string();
        let args = ["animate", "biped", "walker.bvh", "--mesh", &mesh, "-o", &output];
        json(work.path(), &[&args[..], more].concat())
    };
    let answer = run(&vrm, &[]);
    assert_eq!(answer["vrm"]["authors"][0], "Rigsmith", "the header's author: {answer}");
    assert!(answer["vrm"]["bones"].as_array().unwrap().len() > 50, "{answer}");
    assert!(answer["vrm"]["turned_joints"].as_u64().unwrap() > 10, "{answer}");
    run(&again, &[]);
    assert_eq!(fs::read(&vrm).unwrap(), fs::read(&again).unwrap(), "the same bytes");
    let written = Written::read(&vrm);
    written.check_pose();
    let meta = &written.vrm()["meta"];
    assert_eq!((&meta["name"], &meta["version"]), (&"biped".into(), &"2.0.0".into()));
    assert_eq!((&meta["avatarPermission"], &meta["modification"]), (&"onlyAuthor".into(), &"prohibited".into()));
    assert_eq!(meta["allowRedistribution"], false);

    // Half joints follow by a constraint, and twist joints of forearms roll.
    let avatar = read_avatar(&fs::read(&vrm).unwrap(), "biped").unwrap().unwrap();
    let count = |is: fn(&ConstraintKind) -> bool| avatar.constraints.values().filter(|own| is(&own.constraint)).count();
    assert!(count(|kind| matches!(kind, ConstraintKind::Rotation { .. })) >= 4, "{:?}", avatar.constraints);
    assert!(count(|kind| matches!(kind, ConstraintKind::Roll { .. })) >= 4, "{:?}", avatar.constraints);

    // Joints are those of the .glb, and in the clip they and the skin are where they are there.
    run(&glb, &["--all-joints"]);
    let [plain, avatar] = [&glb, &vrm].map(|path| load_model(&RealDisk, path).unwrap());
    assert_eq!(plain.nodes.len(), avatar.nodes.len());
    let place_of = |node: &Node| {
        let mut places = (0..avatar.nodes.len()).filter(|other| avatar.nodes[*other].name == node.name);
        places.next().filter(|_| places.next().is_none())
    };
    let pairs: Vec<(usize, usize)> =
        plain.nodes.iter().enumerate().filter_map(|(at, node)| Some((at, place_of(node)?))).collect();
    assert!(pairs.len() > 60, "{}", pairs.len());
    assert_eq!((plain.points.len(), avatar.clips.len()), (avatar.points.len(), 1));
    let motions = [motion_of(&plain, &plain.clips[0]), motion_of(&avatar, &avatar.clips[0])];
    let (sole, _) = lowest(&skinned(&avatar, &at_rest(&avatar)));
    assert!(sole.abs() < 4e-3, "soles are on the ground: {sole}");
    for time in [0.0, 0.3, 0.65, 0.9] {
        let [was, is] = [&motions[0], &motions[1]].map(|motion| motion.globals_at(time));
        // The figure was moved to the ground as a whole.
        let hips = |model: &Model| model.nodes.iter().position(|node| node.name == "hips").unwrap();
        let shift = is[hips(&avatar)].translation - was[hips(&plain)].translation;
        assert!(shift.length() < 0.05 && shift.x.abs() + shift.z.abs() < 1e-3, "{shift}");
        for (a, b) in &pairs {
            let off = (was[*a].translation + shift).distance(is[*b].translation);
            assert!(off < 5e-4, "{} at {time}: {off}", plain.nodes[*a].name);
        }
        let (was, is) = (skinned(&plain, &was), skinned(&avatar, &is));
        let off = was.iter().zip(&is).map(|(was, is)| (*was + shift).distance(*is)).fold(0.0, f32::max);
        assert!(off < 2e-3, "skin at {time}: {off}");
    }
}

/// Height of the lowest and of the highest point.
fn lowest(points: &[Vec3]) -> (f32, f32) {
    points.iter().fold((f32::MAX, f32::MIN), |(low, high), point| (low.min(point.y), high.max(point.y)))
}

#[test]
fn springs_swing_as_in_the_rig() {
    let work = tempfile::tempdir().unwrap();
    let (folder, _guard) = exports();
    let vrm = folder.join("figure.vrm");
    fs::write(work.path().join("figure.rig.ron"), FIGURE).unwrap();
    let answer = json(work.path(), &["build", "figure.rig.ron", "-o", &vrm.display().to_string()]);
    assert_eq!(answer["vrm"]["authors"][0], "Ann Example");
    assert_eq!(
        (answer["vrm"]["springs"].as_u64(), answer["vrm"]["colliders"].as_u64()),
        (Some(2), Some(3)),
        "{answer}"
    );
    let written = Written::read(&vrm);
    written.check_pose();
    let springs = &written.document["extensions"]["VRMC_springBone"];
    let chain = |name: &str| {
        let found = springs["springs"].as_array().unwrap().iter().find(|spring| spring["name"] == name);
        found.unwrap_or_else(|| panic!("no {name}"))
    };
    let names = |chain: &Value| -> Vec<String> {
        let node = |joint: &Value| joint["node"].as_u64().unwrap() as usize;
        let joints = chain["joints"].as_array().unwrap().iter();
        joints.map(|joint| written.document["nodes"][node(joint)]["name"].as_str().unwrap().to_owned()).collect()
    };
    let (hair, tail) = (chain("hair_1"), chain("tail_1"));
    assert_eq!(names(hair), ["hair_1", "hair_2", "hair_3", "hair_3_end"]);
    assert_eq!(names(tail), ["tail_1", "tail_2"]);
    // The hair does not feel the rig's motion, the tail does.
    assert_eq!(hair["center"].as_u64().map(|node| node as usize), Some(written.named("hips")));
    assert!(tail.get("center").is_none());
    let [stiffness, drag] = spring_numbers(2.0, 0.3, Vec3::new(0.0, -0.1, -0.05).length());
    let joint = &hair["joints"][0];
    assert!((joint["stiffness"].as_f64().unwrap() as f32 - stiffness).abs() < 1e-4 * stiffness, "{joint}");
    assert!((joint["dragForce"].as_f64().unwrap() as f32 - drag).abs() < 1e-4, "{joint}");
    assert_eq!((joint["gravityPower"].as_f64(), joint["hitRadius"].as_f64()), (Some(0.0), Some(0.0)));
    // Two capsules and a ball, in the spaces of their joints.
    let collider = |chain: &Value, at: usize| {
        let group = chain["colliderGroups"][0].as_u64().unwrap() as usize;
        let collider = springs["colliderGroups"][group]["colliders"][at].as_u64().unwrap() as usize;
        springs["colliders"][collider].clone()
    };
    let vector = |value: &Value| Vec3::from_array([0, 1, 2].map(|at| value[at].as_f64().unwrap() as f32));
    let (head, arm, ball) = (collider(hair, 0), collider(hair, 1), collider(tail, 0));
    assert_eq!(head["node"].as_u64().unwrap() as usize, written.node("head"));
    assert!(vector(&head["shape"]["capsule"]["tail"]).distance(Vec3::new(0.0, 0.02, 0.03)) < 1e-5, "{head}");
    assert!((head["shape"]["capsule"]["radius"].as_f64().unwrap() - 0.09).abs() < 1e-6, "{head}");
    assert_eq!(arm["node"].as_u64().unwrap() as usize, written.node("leftUpperArm"));
    assert!(vector(&arm["shape"]["capsule"]["tail"]).distance(Vec3::new(0.2, -0.2, 0.0)) < 1e-4, "{arm}");
    assert!((ball["shape"]["sphere"]["radius"].as_f64().unwrap() - 0.12).abs() < 1e-6, "{ball}");
    // Eyes move by their bones, about the middle between them.
    let look = &written.vrm()["lookAt"];
    assert_eq!(look["type"], "bone");
    assert!(vector(&look["offsetFromHeadBone"]).distance(Vec3::new(0.0, 0.08, 0.08)) < 1e-5, "{look}");
    assert!(written.vrm()["humanoid"]["humanBones"].get("jaw").is_some());
}

/// VRM's algorithm swings with the frequency and the damping of the rig's spring.
#[test]
fn spring_numbers_are_those_of_the_oscillator() {
    let frame = 1.0 / 60.0_f32;
    for (frequency, damping, length) in
        [(1.0, 0.1, 0.1), (2.0, 0.3, 0.1), (2.0, 0.4, 0.25), (3.0, 0.2, 0.04), (4.0, 0.3, 1.5), (5.0, 0.5, 0.1)]
    {
        let [stiffness, drag] = spring_numbers(frequency, damping, length);
        assert!(stiffness > 0.0 && (0.0..=1.0).contains(&drag), "{frequency} {damping}: {stiffness} {drag}");
        // A bone along X that is turned a little, at the algorithm's own steps.
        let start = Vec3::new(1.0, 0.02, 0.0).normalize() * length;
        let (mut end, mut before) = (start, start);
        let mut heights = vec![end.y];
        for _ in 0..240 {
            let next = end + (end - before) * (1.0 - drag) + Vec3::X * frame * stiffness;
            before = std::mem::replace(&mut end, next.normalize() * length);
            heights.push(end.y);
        }
        // The oscillator that is at the same place in the first frame and in the one before.
        let own = std::f32::consts::TAU * frequency * frame;
        let (decay, turn) = ((-damping * own).exp(), own * (1.0 - damping * damping).sqrt());
        let phase = (decay - turn.cos()) / turn.sin();
        let expected = |at: f32| start.y * decay.powf(at) * ((turn * at).cos() - phase * (turn * at).sin());
        let off = heights.iter().enumerate().map(|(at, height)| (height - expected(at as f32)).abs());
        let off = off.fold(0.0, f32::max) / start.y;
        assert!(off < 0.01, "{frequency} Hz, damping {damping}: off by {off}");
    }
    // Faster and stiffer springs than a frame can follow stay in range.
    for (frequency, damping) in [(12.0, 0.1), (60.0, 0.0), (60.0, 10.0), (0.01, 10.0), (2.0, 1.0), (2.0, 3.0)] {
        let [stiffness, drag] = spring_numbers(frequency, damping, 0.1);
        assert!(stiffness > 0.0 && stiffness.is_finite() && (0.0..=1.0).contains(&drag), "{frequency} {damping}");
    }
}

#[test]
fn figures_are_stood_up_in_metres() {
    let work = tempfile::tempdir().unwrap();
    // In centimetres, by a scaled root, lying on the back and looking elsewhere.
    let root = r#"joints: [
        (label: "world", translation: (300, 0, 40), rotation: (-90, 0, 90), scale: (100, 100, 100)),"#;
    let turned = FIGURE.replacen("joints: [", root, 1).replacen(
        r#"(label: "hips", translation"#,
        r#"(label: "hips", parent: "world", translation"#,
        1,
    );
    fs::write(work.path().join("turned.rig.ron"), turned).unwrap();
    fs::write(work.path().join("figure.rig.ron"), FIGURE).unwrap();
    let answer = json(work.path(), &["build", "turned.rig.ron", "-o", "turned.vrm"]);
    assert_eq!(answer["vrm"]["scale"].as_f64().map(|scale| (scale * 1e4).round()), Some(100.0), "{answer}");
    let notes = answer["notes"].as_array().unwrap();
    assert!(notes.iter().any(|note| note.as_str().unwrap().contains("metres")), "{notes:?}");
    json(work.path(), &["build", "figure.rig.ron", "-o", "figure.vrm"]);
    let [turned, figure] = ["turned.vrm", "figure.vrm"].map(|name| Written::read(&work.path().join(name)));
    turned.check_pose();
    let height = |written: &Written| written.place("head").y - written.place("leftFoot").y;
    assert!((height(&turned) - height(&figure)).abs() < 1e-3, "{} {}", height(&turned), height(&figure));
    let numbers = |written: &Written| {
        let springs = &written.document["extensions"]["VRMC_springBone"]["springs"];
        let joints = springs.as_array().unwrap().iter().flat_map(|spring| spring["joints"].as_array().unwrap());
        joints.map(|joint| joint["stiffness"].as_f64().unwrap()).collect::<Vec<_>>()
    };
    for (a, b) in numbers(&turned).iter().zip(&numbers(&figure)) {
        assert!((a - b).abs() <= 1e-2 * b, "{a} {b}");
    }
}

#[test]
fn lacks_are_told_and_nothing_is_written() {
    let work = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| fs::write(work.path().join(name), text).unwrap();
    write("handless.rig.ron", &FIGURE.replace("hand_l", "paw_l").replace("hand_r", "paw_r"));
    write("legless.rig.ron", &FIGURE.replace("shin_l", "stilt_l"));
    write("trunkless.rig.ron", &FIGURE.replace(r#""head""#, r#""top""#).replace("@joint head", "@joint top"));
    write("nobody.rig.ron", &FIGURE.replace(r#"author: "Ann Example","#, ""));
    write("figure.rig.ron", FIGURE);
    write("old.vrm", "before");
    let check = |args: &[&str], code: i32, told: &[&str]| {
        let answer = rigsmith(work.path(), args);
        assert_eq!(answer.code, code, "{args:?}: {} {}", answer.out, answer.err);
        for told in told {
            assert!(answer.err.contains(told), "{args:?}: {}", answer.err);
        }
        assert_eq!(fs::read_to_string(work.path().join("old.vrm")).unwrap(), "before");
        assert!(!answer.err.contains("rightFoot"), "{args:?} lists what is there: {}", answer.err);
    };
    check(&["build", "handless.rig.ron", "-o", "old.vrm"], 1, &["lacks bones", ": leftHand, rightHand;"]);
    check(&["build", "legless.rig.ron", "-o", "old.vrm"], 1, &["lacks bones", ": leftLowerLeg;"]);
    check(&["build", "trunkless.rig.ron", "-o", "old.vrm"], 1, &["lacks bones", ": head;"]);
    check(&["build", "nobody.rig.ron", "-o", "old.vrm"], 1, &["author", "--author NAME", "figure"]);
    check(&["build", "nobody.rig.ron", "--author", " ", "-o", "old.vrm"], 1, &["author"]);
    check(&["build", "figure.rig.ron", "--author", "Ann", "-o", "a.glb"], 2, &["--author is for an avatar"]);
    check(&["convert", "figure.rig.ron", "old.vrm"], 2, &["a .vrm is written by build"]);
    // A rig of something else lacks all that it lacks.
    let hand = rigsmith(work.path(), &["build", "hand.rig.ron", "-o", "hand.vrm"]);
    assert!(hand.code == 1 && !work.path().join("hand.vrm").exists(), "{}", hand.err);
    let list = hand.err.split("requires: ").nth(1).unwrap_or_default().split(';').next().unwrap_or_default();
    // All but the hand itself and the forearm that it hangs on.
    assert_eq!(list.split(", ").count(), 13, "{}", hand.err);

    // Authors that are given take the place of the header's.
    json(work.path(), &["build", "nobody.rig.ron", "--author", "A. One", "--author", "B. Two", "-o", "two.vrm"]);
    let authors = |name: &str| Written::read(&work.path().join(name)).vrm()["meta"]["authors"].clone();
    assert_eq!(authors("two.vrm"), serde_json::json!(["A. One", "B. Two"]));
    json(work.path(), &["build", "figure.rig.ron", "--author", "C. Three", "-o", "three.vrm"]);
    assert_eq!(authors("three.vrm"), serde_json::json!(["C. Three"]));
}

#[test]
fn avatars_are_read_as_models() {
    let work = tempfile::tempdir().unwrap();
    let path = |name: &str| work.path().join(name);
    fs::write(path("figure.rig.ron"), FIGURE).unwrap();
    fs::write(path("walker.bvh"), WALKER).unwrap();
    let run = |args: &[&str]| json(work.path(), args);
    run(&["animate", "figure.rig.ron", "walker.bvh", "--onto", "joints", "-o", "figure.vrm"]);
    let own = load_model(&RealDisk, &path("figure.vrm")).unwrap();
    assert_eq!((own.name.as_str(), own.clips.len()), ("figure", 1));
    run(&["convert", "figure.vrm", "back.glb", "--all-joints"]);
    let back = load_model(&RealDisk, &path("back.glb")).unwrap();
    assert!(!fs::read(path("back.glb")).unwrap().windows(8).any(|bytes| bytes == b"VRMC_vrm"));
    let names = |model: &Model| model.nodes.iter().map(|node| node.name.clone()).collect::<Vec<_>>();
    assert_eq!(names(&own), names(&back));
    run(&["convert", "figure.vrm", "back.rig"]);
    assert_eq!(load_rig_text(&RealDisk, &path("back.rig")).unwrap().joints.len(), own.nodes.len());
    assert_eq!(run(&["info", "figure.vrm"])["joints"], run(&["info", "back.glb"])["joints"]);
    run(&["check", "figure.vrm"]);
    // As a rig and as a source of motion, and the second round is an avatar again.
    run(&["animate", "figure.vrm", "figure.vrm", "--author", "Ann", "-o", "second.vrm"]);
    Written::read(&path("second.vrm")).check_pose();
    let answer = run(&["animate", "biped", "figure.vrm", "-o", "walk.anim.ron"]);
    assert_eq!(answer["clips"].as_array().unwrap().len(), 1, "{answer}");
}
