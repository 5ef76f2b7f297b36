//! Building rigs on the command line: the real binary, real files, exit codes.

mod faults;

use std::{collections::BTreeSet, fs, path::Path, process::Command, sync::Arc};

use rigsmith::{
    files::{BUNDLED_CHARACTERS, RealDisk, load_model, load_template},
    headless::Workbench,
    modules,
    plugins::commands::BuildStep,
    processor::Builder,
    rig::template,
};
use serde_json::Value;

use crate::exports::exports;

/// Answer of the binary.
pub struct Answer {
    pub code: i32,
    pub out: String,
    pub err: String,
}

impl Answer {
    pub fn json(&self) -> Value {
        serde_json::from_str(&self.out).unwrap_or_else(|error| panic!("{error} in {:?}", self.out))
    }
}

/// Runs the binary, which must not panic.
pub fn rigsmith(folder: &Path, args: &[&str]) -> Answer {
    let output = Command::new(env!("CARGO_BIN_EXE_rigsmith")).current_dir(folder).args(args).output().unwrap();
    let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
    let answer = Answer { code: output.status.code().unwrap(), out: text(output.stdout), err: text(output.stderr) };
    assert!(!answer.err.contains("panicked"), "{args:?} panicked: {}", answer.err);
    answer
}

/// A root, an arm of two joints in a group, a control, joints between, a feature with two switches, and an attribute
/// that turns the hand by a quarter as it is built.
const ARM: &str = r#"(
    format: 1,
    uid: "00000000000000ff",
    name: "arm",
    groups: [(uid: "0000000000000010", name: "arm", color: (0.9, 0.6, 0.0))],
    joints: [
        (
            uid: "0000000000000001",
            label: "root",
            translation: (0.0, 1.0, 0.0),
            tags: [
                Command(uid: "0000000000000020", module: "control", params: (shape: "circle")),
                Command(uid: "0000000000000021", module: "attribute",
                    params: (node: "@command control#0000000000000020 role:control", name: "turn", min: 0.0, max: 1.0, default: 1.0)),
            ],
        ),
        (
            uid: "0000000000000002",
            parent: "0000000000000001",
            label: "arm",
            group: "0000000000000010",
            translation: (0.5, 0.0, 0.0),
            tags: [
                Feature(uid: "0000000000000030", kind: "limb", name: "Arm", switch: "controls"),
                Feature(uid: "0000000000000031", enabled: false, kind: "limb", name: "Arm", switch: "joints"),
                Command(uid: "0000000000000022", module: "control", feature: "0000000000000030", params: ()),
                Command(uid: "0000000000000023", module: "insert_joints", feature: "0000000000000031", params: (count: 2)),
            ],
        ),
        (
            uid: "0000000000000003",
            parent: "0000000000000002",
            label: "hand",
            group: "0000000000000010",
            translation: (0.5, 0.0, 0.0),
            tags: [
                Command(uid: "0000000000000024", module: "driven_key", params: (
                    driver: "@command control#0000000000000020 role:control",
                    driver_attribute: "turn",
                    keys: [(0.0, 0.0), (1.0, 90.0)],
                    output: "@this",
                    output_channel: RotateZ,
                )),
            ],
        ),
    ],
)
"#;

fn with_arm() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("arm.rig.ron"), ARM).unwrap();
    folder
}

/// The states of the commands, in the order of the build.
fn states(json: &Value) -> Vec<String> {
    let commands = json["commands"].as_array().unwrap_or_else(|| panic!("no commands in {json}"));
    commands.iter().map(|command| command["state"].as_str().unwrap().to_owned()).collect()
}

#[test]
fn the_trace_tells_every_command() {
    let folder = with_arm();
    let answer = rigsmith(folder.path(), &["--json", "build", "arm.rig.ron", "--trace"]);
    assert_eq!(answer.code, 0, "{}{}", answer.out, answer.err);
    let json = answer.json();
    assert_eq!(json["ok"], true);
    let commands = json["commands"].as_array().unwrap();
    let told: Vec<(&str, &str, &str)> = commands
        .iter()
        .map(|c| (c["label"].as_str().unwrap(), c["module"].as_str().unwrap(), c["state"].as_str().unwrap()))
        .collect();
    let wanted = [
        ("root", "control", "done"),
        ("root", "attribute", "done"),
        ("arm", "control", "done"),
        ("arm", "insert_joints", "skipped"),
        ("hand", "driven_key", "done"),
    ];
    assert_eq!(told, wanted);
    for command in commands {
        let keys: BTreeSet<&str> = command.as_object().unwrap().keys().map(String::as_str).collect();
        let wanted = ["uid", "joint", "label", "module", "state", "micros", "executed", "error", "skipped"];
        assert_eq!(keys, BTreeSet::from(wanted), "{command}");
        assert_eq!(command["executed"], command["state"] == "done", "{command}");
        assert!(command["micros"].as_f64().unwrap() >= 0.0 && command["error"].is_null(), "{command}");
        assert_eq!(command["uid"].as_str().unwrap().len(), 16);
    }
    assert_eq!(commands[0]["joint"], "0000000000000001");
    // For people: a line for each command, and what came of it.
    let answer = rigsmith(folder.path(), &["build", "arm.rig.ron", "--trace"]);
    let lines: Vec<&str> = answer.out.lines().collect();
    assert_eq!(lines.len(), 6, "{}", answer.out);
    assert!(lines[0].contains("done") && lines[0].contains("root") && lines[0].contains("control"), "{}", answer.out);
    assert!(lines[3].contains("skipped"), "{}", answer.out);
    assert!(lines[5].starts_with("5 of 5 commands, 3 joints, 4 created nodes"), "{}", answer.out);
    assert_eq!(rigsmith(folder.path(), &["build", "arm.rig.ron"]).out.lines().count(), 1);
}

#[test]
fn a_build_stops_where_it_is_told_to() {
    let folder = with_arm();
    for (until, done) in [(0, 0), (1, 1), (3, 3), (5, 5), (99, 5)] {
        let until = until.to_string();
        let json = rigsmith(folder.path(), &["--json", "build", "arm.rig.ron", "--trace", "--until", &until]).json();
        assert_eq!(json["commands_done"], done, "{until}: {json}");
        let states = states(&json);
        for (place, state) in states.iter().enumerate() {
            let skipped = place == 3 && done > 3;
            let wanted = if skipped {
                "skipped"
            } else if place < done {
                "done"
            } else {
                "pending"
            };
            if place == 3 && !skipped {
                assert_ne!(state, "done", "{until}: {states:?}");
            } else {
                assert_eq!(state, wanted, "{until}: {states:?}");
            }
        }
    }
    // What is written is what stands there by then.
    let early = rigsmith(folder.path(), &["build", "arm.rig.ron", "--until", "0", "-o", "early.rig.ron"]);
    assert_eq!(early.code, 0, "{}", early.err);
    assert_eq!(load_template(&RealDisk, &folder.path().join("early.rig.ron")).unwrap().rig.len(), 3);
}

#[test]
fn features_and_groups_are_switched() {
    let folder = with_arm();
    let build = |args: &[&str]| {
        let all: Vec<&str> = ["--json", "build", "arm.rig.ron", "--trace"].iter().chain(args).copied().collect();
        let answer = rigsmith(folder.path(), &all);
        assert_eq!(answer.code, 0, "{args:?}: {}{}", answer.out, answer.err);
        answer.json()
    };
    let table: &[(&[&str], [&str; 5], u64)] = &[
        (&[], ["done", "done", "done", "skipped", "done"], 4),
        (&["--feature", "Arm=off"], ["done", "done", "skipped", "skipped", "done"], 2),
        (&["--feature", "Arm=on"], ["done", "done", "done", "done", "done"], 6),
        (&["--feature", "Arm=joints"], ["done", "done", "skipped", "done", "done"], 4),
        (&["--feature", "Arm=controls"], ["done", "done", "done", "skipped", "done"], 4),
        // Later wishes win.
        (&["--feature", "Arm=off", "--feature", "Arm=joints"], ["done", "done", "skipped", "done", "done"], 4),
    ];
    for (args, wanted, created) in table {
        let json = build(args);
        assert_eq!(states(&json), wanted, "{args:?}");
        assert_eq!(json["created"], *created, "{args:?}");
    }
    // Joints of a disabled group leave the built rig.
    build(&["--group", "arm=off", "-o", "short.rig.ron"]);
    assert_eq!(load_template(&RealDisk, &folder.path().join("short.rig.ron")).unwrap().rig.len(), 1);
    build(&["--group", "arm=off", "--group", "arm=on", "-o", "long.rig.ron"]);
    assert_eq!(load_template(&RealDisk, &folder.path().join("long.rig.ron")).unwrap().rig.len(), 3);
    // The file that was built stays as it was.
    assert_eq!(fs::read_to_string(folder.path().join("arm.rig.ron")).unwrap(), ARM);
}

#[test]
fn the_built_skeleton_is_a_rig_without_tags() {
    let folder = with_arm();
    let args = ["build", "arm.rig.ron", "--feature", "Arm=joints", "-o", "baked.rig.ron"];
    let answer = rigsmith(folder.path(), &args);
    assert_eq!(answer.code, 0, "{}", answer.err);
    assert!(answer.out.contains("wrote baked.rig.ron"), "{}", answer.out);
    let bytes = fs::read(folder.path().join("baked.rig.ron")).unwrap();
    let rig = template::read_template(&bytes).unwrap().rig;
    assert_eq!(rig.len(), 5, "two joints between the arm and the hand");
    assert!(rig.walk().all(|joint| joint.data.tags.is_empty()));
    // The hand stands where it stood, below what was put between.
    let (arm, hand) = (rig.find_label("arm").unwrap(), rig.find_label("hand").unwrap());
    assert!(rig.position(hand).distance([1.0, 1.0, 0.0].into()) < 1e-6);
    let mut up = 0;
    let mut at = hand;
    while at != arm {
        at = rig.joint(at).unwrap().parent.unwrap();
        up += 1;
    }
    assert_eq!(up, 3);
    // It builds again, and the same command writes the same bytes.
    assert_eq!(rigsmith(folder.path(), &["--json", "build", "baked.rig.ron"]).json()["commands_done"], 0);
    assert_eq!(rigsmith(folder.path(), &args).code, 0);
    assert_eq!(fs::read(folder.path().join("baked.rig.ron")).unwrap(), bytes);
}

#[test]
fn the_exported_skeleton_stands_as_it_was_built() {
    let folder = with_arm();
    let (out, _guard) = exports();
    for name in ["build_arm.glb", "build_arm.gltf"] {
        let path = out.join(name);
        let answer = rigsmith(folder.path(), &["build", "arm.rig.ron", "-o", path.to_str().unwrap()]);
        assert_eq!(answer.code, 0, "{}", answer.err);
        let model = load_model(&RealDisk, &path).unwrap();
        let node = |name: &str| model.nodes.iter().find(|node| node.name == name).unwrap();
        // The attribute turns the hand by its default.
        assert!((node("hand").rest.rotation.to_scaled_axis().z.to_degrees() - 90.0).abs() < 1e-3, "{name}");
        assert!(node("arm").rest.rotation.is_near_identity(), "{name}");
        assert!(node("arm").rest.translation.distance([0.5, 0.0, 0.0].into()) < 1e-6, "{name}");
        assert!(model.nodes.iter().all(|node| !node.name.contains("control")), "{name}: only joints are exported");
    }
}

#[test]
fn a_mesh_is_bound_to_what_is_built() {
    let folder = tempfile::tempdir().unwrap();
    let (out, _guard) = exports();
    let asset = |path: &str| format!("{}/assets/{path}", env!("CARGO_MANIFEST_DIR"));
    for name in ["biped", "hand"] {
        let (rig, mesh) = (asset(&format!("templates/{name}.rig.ron")), asset(&format!("models/{name}.obj")));
        let path = out.join(format!("build_{name}.glb"));
        let file = path.to_str().unwrap();
        let answer = rigsmith(folder.path(), &["--json", "build", &rig, "--mesh", &mesh, "-o", file]);
        assert_eq!(answer.code, 0, "{}{}", answer.out, answer.err);
        let json = answer.json();
        assert!(json["weights"]["points"].as_u64().unwrap() > 1000, "{json}");
        let info = rigsmith(folder.path(), &["--json", "info", file]).json();
        assert_eq!((&info["skinned"], &info["unweighted"]), (&true.into(), &0.into()), "{name}: {info}");
        let rig = load_template(&RealDisk, Path::new(&rig)).unwrap().rig;
        let model = load_model(&RealDisk, &path).unwrap();
        for joint in rig.walk().filter_map(|joint| joint.data.label.as_deref()) {
            assert!(model.nodes.iter().any(|node| node.name == joint), "{name}: {joint} is missing");
        }
    }
}

#[test]
fn the_first_failing_command_stops_the_build() {
    let folder = with_arm();
    let text = ARM.replace("module: \"control\", feature", "module: \"controll\", feature");
    fs::write(folder.path().join("typo.rig.ron"), text).unwrap();
    fs::write(folder.path().join("range.rig.ron"), ARM.replace("shape: \"circle\"", "size: -1.0")).unwrap();
    fs::write(folder.path().join("field.rig.ron"), ARM.replace("min: 0.0", "mini: 0.0")).unwrap();
    let table = [
        ("typo.rig.ron", 2, ["there is no module \"controll\"", "control", "tag 0000000000000022"]),
        ("range.rig.ron", 0, ["size", "write", "tag 0000000000000020"]),
        ("field.rig.ron", 1, ["mini", "min", "tag 0000000000000021"]),
    ];
    for (file, place, wanted) in table {
        let answer = rigsmith(folder.path(), &["build", file, "--trace", "-o", "never.glb"]);
        assert_eq!(answer.code, 1, "{file}: {}{}", answer.out, answer.err);
        for words in wanted {
            assert!(answer.err.contains(words), "{file} must say \"{words}\": {}", answer.err);
        }
        assert!(!folder.path().join("never.glb").exists(), "{file}: nothing is written");
        let json = rigsmith(folder.path(), &["--json", "build", file, "--trace"]);
        assert_eq!(json.code, 1);
        let json = json.json();
        assert_eq!(json["ok"], false);
        assert!(crate::cli::explained(&json).contains(wanted[0]), "{json}");
        let commands = json["commands"].as_array().unwrap();
        assert_eq!(commands[place]["state"], "failed", "{file}");
        assert!(commands[place]["error"].as_str().unwrap().contains(wanted[0]), "{file}: {}", commands[place]);
        assert!(commands[..place].iter().all(|command| command["state"] == "done"), "{file}");
        assert!(commands[place + 1..].iter().all(|command| command["executed"] == false), "{file}");
    }
    // Up to the failing command all is well; and what cannot be built can still be opened.
    assert_eq!(rigsmith(folder.path(), &["build", "typo.rig.ron", "--until", "2", "-o", "part.glb"]).code, 0);
    let info = rigsmith(folder.path(), &["--json", "info", "typo.rig.ron"]);
    assert_eq!(info.json()["joints"].as_array().unwrap().len(), 3, "{}", info.err);
    assert_eq!(load_template(&RealDisk, &folder.path().join("typo.rig.ron")).unwrap().rig.len(), 3);
    // Switched off, a command that nobody knows harms nothing.
    assert_eq!(rigsmith(folder.path(), &["build", "typo.rig.ron", "--feature", "Arm=off"]).code, 0);
}

/// A bundled template.
fn bundled(name: &str) -> String {
    format!("{}/assets/templates/{name}.rig.ron", env!("CARGO_MANIFEST_DIR"))
}

#[test]
fn templates_build_with_any_group_off_and_say_what_is_passed_over() {
    let folder = tempfile::tempdir().unwrap();
    let groups = [
        ("biped", &["head", "spine", "arm_l", "arm_r", "hand_l", "leg_r"] as &[&str]),
        ("bird", &["body", "head", "tail"]),
        ("quadruped", &["body", "head"]),
        ("hand", &["arm_l", "hand_l"]),
    ];
    for (template, groups) in groups {
        for group in groups {
            let answer = rigsmith(folder.path(), &["build", &bundled(template), "--group", &format!("{group}=off")]);
            assert_eq!(answer.code, 0, "{template} without {group}: {}", answer.err);
        }
    }
    let biped = bundled("biped");
    let answer = rigsmith(folder.path(), &["build", &biped, "--group", "arm_r=off", "--trace"]);
    assert!(answer.out.contains("in the group arm_r, which is off"), "{}", answer.out);
    let controls = |answer: &Answer| -> BTreeSet<String> {
        let nodes = answer.json()["nodes"].as_array().unwrap().clone();
        nodes.iter().filter(|node| node["kind"] == "control").map(|node| node["name"].to_string()).collect()
    };
    let pose = |args: &[&str]| {
        let all: Vec<&str> = ["pose", &biped, "--json"].into_iter().chain(args.iter().copied()).collect();
        let answer = rigsmith(folder.path(), &all);
        assert_eq!(answer.code, 0, "{args:?}: {}", answer.err);
        controls(&answer)
    };
    let all = pose(&[]);
    // A limb's end means the control that moves it, also where its goal is a node below that control.
    for end in ["hand_l", "foot_l"] {
        assert_eq!(pose(&["--set", &format!("{end}.translate=(0,0.05,0)")]), all);
    }
    // One switch of a combined feature, in all limbs and in one.
    let unrolled = pose(&["--feature", "ik=foot_roll=off"]);
    assert!(unrolled.len() <= all.len() && unrolled.contains("\"foot_ik_l\""));
    let without = pose(&["--feature", "ik=off"]);
    assert!(!without.contains("\"hand_ik_l\"") && !without.contains("\"hand_ik_r\""));
    let one = pose(&["--feature", "arm_l:ik=off"]);
    assert!(!one.contains("\"hand_ik_l\"") && one.contains("\"hand_ik_r\"") && one.contains("\"foot_ik_l\""));
    let answer =
        rigsmith(folder.path(), &["pose", &biped, "--group", "arm_r=off", "--set", "@joint hand_r.translate=(0,0,1)"]);
    assert_eq!(answer.code, 1);
    assert!(answer.err.contains("hand_r is in the group arm_r, which is off"), "{}", answer.err);
    let answer =
        rigsmith(folder.path(), &["pose", &biped, "--group", "arm_r=off", "--set", "hand_ik_r.translate=(0,0,1)"]);
    assert_eq!(answer.code, 1);
    assert!(answer.err.contains("in the group arm_r, which is off"), "{}", answer.err);
    for (wish, wanted) in [("ik=foot_rol=off", "foot_roll"), ("ik=space=maybe", "space"), ("arm_x:ik=off", "arm_x:ik")]
    {
        let answer = rigsmith(folder.path(), &["build", &biped, "--feature", wish]);
        assert_eq!(answer.code, 2, "{wish}: {}", answer.err);
        assert!(answer.err.contains(wanted), "{wish}: {}", answer.err);
    }
}

#[test]
fn wrong_usage_of_build_exits_with_2_and_bad_input_with_1() {
    let folder = with_arm();
    fs::write(folder.path().join("box.obj"), "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").unwrap();
    fs::write(folder.path().join("broken.rig.ron"), "(format: 1,").unwrap();
    let table: &[(&[&str], i32, &str)] = &[
        (&["build"], 2, "RIG"),
        (&["build", "arm.rig.ron", "--until", "many"], 2, "--until"),
        (&["build", "arm.rig.ron", "-o", "a.png"], 2, ".rig.ron"),
        (&["build", "arm.rig.ron", "-o", "a.obj"], 2, ".rig.ron"),
        (&["build", "box.obj"], 2, "box.obj"),
        (&["build", "arm.rig.ron", "--mesh", "box.obj"], 2, "--mesh"),
        (&["build", "arm.rig.ron", "--mesh", "box.obj", "-o", "a.rig.ron"], 2, "--mesh"),
        (&["build", "arm.rig.ron", "--feature", "Arm"], 2, "NAME=VALUE"),
        (&["build", "arm.rig.ron", "--feature", "Amr=off"], 2, "Arm"),
        (&["build", "arm.rig.ron", "--feature", "=off"], 2, "--feature"),
        (&["build", "arm.rig.ron", "--feature", "Arm=sideways"], 2, "joints"),
        (&["build", "arm.rig.ron", "--group", "arm"], 2, "NAME=VALUE"),
        (&["build", "arm.rig.ron", "--group", "leg=off"], 2, "arm"),
        (&["build", "arm.rig.ron", "--group", "arm=maybe"], 2, "arm=on"),
        (&["build", "missing.rig.ron"], 1, "missing.rig.ron"),
        (&["build", "broken.rig.ron"], 1, "broken.rig.ron"),
        (&["build", "arm.rig.ron", "--mesh", "missing.obj", "-o", "a.glb"], 1, "missing.obj"),
        (&["build", "arm.rig.ron", "-o", "no/such/folder/a.glb"], 1, "folder"),
    ];
    for (args, code, wanted) in table {
        let answer = rigsmith(folder.path(), args);
        assert_eq!(answer.code, *code, "{args:?}: {}{}", answer.out, answer.err);
        assert!(answer.err.contains(wanted), "{args:?} must say \"{wanted}\": {}", answer.err);
        let all: Vec<&str> = ["--json"].iter().chain(*args).copied().collect();
        let json = rigsmith(folder.path(), &all);
        assert_eq!((json.code, json.json()["ok"].clone()), (*code, false.into()), "{args:?}");
    }
}

#[test]
fn modules_are_listed_with_parameters_and_defaults() {
    let folder = tempfile::tempdir().unwrap();
    let answer = rigsmith(folder.path(), &["modules", "--json"]);
    assert_eq!(answer.code, 0, "{}", answer.err);
    let told = answer.json();
    assert_eq!(told["ok"], true);
    let list = told["modules"].as_array().expect("an array");
    let names: Vec<&str> = list.iter().map(|module| module["name"].as_str().unwrap()).collect();
    assert!(names.is_sorted() && names.len() >= 19, "{names:?}");
    for name in ["control", "null", "attribute", "ik_handle", "ik_fk_switch", "spline_ik", "reverse_foot", "spring"] {
        assert!(names.contains(&name), "{name}");
    }
    for module in list {
        assert!(module["doc"].as_str().unwrap().ends_with('.'), "{module}");
        for parameter in module["parameters"].as_array().unwrap() {
            for key in ["name", "kind", "doc", "default"] {
                let text = parameter[key].as_str().unwrap_or_else(|| panic!("{key} in {module}"));
                assert!(!text.is_empty(), "{}: {key} of {parameter}", module["name"]);
            }
        }
        // The defaults are what a tag may hold.
        let one = |parameter: &Value| {
            format!("{}: {}", parameter["name"].as_str().unwrap(), parameter["default"].as_str().unwrap())
        };
        let params: Vec<String> = module["parameters"].as_array().unwrap().iter().map(one).collect();
        let params = format!("({})", params.join(", "));
        let name = module["name"].as_str().unwrap();
        let read = rigsmith::modules::all().get(name).unwrap().parse(&params);
        assert!(read.is_ok(), "{name} {params}: {}", read.err().unwrap());
    }
    // For people, and only some.
    let some = rigsmith(folder.path(), &["modules", "spring", "null"]);
    assert_eq!(some.code, 0);
    assert!(some.out.starts_with("null: ") && some.out.contains("\nspring: "), "{}", some.out);
    assert!(some.out.contains("frequency = 2.0"), "{}", some.out);
    assert_eq!(
        rigsmith(folder.path(), &["--json", "modules", "spring"]).json()["modules"].as_array().unwrap().len(),
        1
    );
    let unknown = rigsmith(folder.path(), &["--json", "modules", "sprign"]);
    assert!(crate::cli::explained(&unknown.json()).contains("did you mean \"spring\"?"), "{}", unknown.out);
    let wrong = rigsmith(folder.path(), &["modules", "sprign"]);
    assert_eq!(wrong.code, 1);
    assert!(wrong.err.contains("sprign") && wrong.err.contains("spring"), "{}", wrong.err);
}

/// `check` takes what `build` writes.
#[test]
fn a_joint_that_is_its_own_partner_has_none_in_the_skeleton() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("t.rig.ron"), "(format: 2, name: \"t\", joints: [(label: \"a\", mirror: \"a\")])")
        .unwrap();
    assert_eq!(rigsmith(folder.path(), &["check", "t.rig.ron"]).code, 1);
    assert_eq!(rigsmith(folder.path(), &["build", "t.rig.ron", "-o", "built.rig.ron"]).code, 0);
    let checked = rigsmith(folder.path(), &["check", "built.rig.ron"]);
    assert_eq!(checked.code, 0, "{}{}", checked.out, checked.err);
}

#[test]
fn the_command_builds_what_an_app_builds() {
    let folder = tempfile::tempdir().unwrap();
    for (name, text) in BUNDLED_CHARACTERS {
        let path = folder.path().join("t.rig.ron");
        fs::write(&path, text).unwrap();
        let rig = load_template(&RealDisk, &path).unwrap().rig;
        let alone = Builder::build(&rig, &Arc::new(modules::all())).unwrap();
        let mut bench = Workbench::with_rig(1, rig);
        bench.build(BuildStep::All);
        assert!(bench.built() == Some(&alone), "{name}: the processor of an app builds the same");
        let json = rigsmith(folder.path(), &["build", "t.rig.ron", "--json"]).json();
        let told = |key: &str| json[key].as_u64().unwrap() as usize;
        assert_eq!((told("nodes"), told("constraints")), (alone.nodes.len(), alone.constraints.len()), "{name}");
        let count = bench.processor().unwrap().builder().cursor();
        // As far as a build that stops on the way.
        let until = (count / 2).to_string();
        let json = rigsmith(folder.path(), &["build", "t.rig.ron", "--json", "--until", &until]).json();
        bench.build(BuildStep::To(count / 2));
        assert_eq!(json["nodes"].as_u64().unwrap() as usize, bench.built().unwrap().nodes.len(), "{name}, half");
    }
}
