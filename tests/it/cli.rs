//! The command line as a user meets it: the real binary, real files, exit codes.

use std::{fs, path::PathBuf};

use serde_json::Value;

use crate::cli_build::rigsmith;

/// The parts of a reported error, none of which may be empty, as one text.
pub(super) fn explained(json: &Value) -> String {
    let part = |name: &str| json["error"][name].as_str().unwrap_or_else(|| panic!("no {name}: {json}"));
    let parts = ["where", "what", "do"].map(part);
    assert!(json["ok"] == false && parts.iter().all(|part| !part.trim().is_empty()), "{json}");
    parts.join("; ")
}

fn asset(path: &str) -> String {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("assets").join(path).display().to_string()
}

fn folder() -> tempfile::TempDir {
    tempfile::tempdir().unwrap()
}

/// A box from -1 to 1, as quads.
pub(super) const BOX: &str = "o box\nv -1 -1 -1\nv 1 -1 -1\nv 1 1 -1\nv -1 1 -1\nv -1 -1 1\nv 1 -1 1\nv 1 1 1\nv -1 1 1\n\
    f 4 3 2 1\nf 5 6 7 8\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\n";

const SPINE: &str = "[Stroke(points: [(0.0, -0.8), (0.0, 0.8)], joints: 3), Label(\"tip\")]";

fn with_box() -> tempfile::TempDir {
    let folder = folder();
    fs::write(folder.path().join("box.obj"), BOX).unwrap();
    fs::write(folder.path().join("spine.ron"), SPINE).unwrap();
    folder
}

#[test]
fn alone_does_the_whole_job() {
    let folder = folder();
    let answer = rigsmith(folder.path(), &[]);
    assert_eq!(answer.code, 0, "{}", answer.err);
    assert!(answer.err.is_empty(), "the bundled gestures must all work: {}", answer.err);
    assert!(answer.out.contains("rigsmith sketch"), "names the commands to go on with");
    let glb = rigsmith(folder.path(), &["--json", "info", "biped.glb"]).json();
    assert_eq!(glb["skinned"], true);
    assert_eq!(glb["unweighted"], 0);
    assert!(glb["joints"].as_u64().unwrap() >= 50, "{glb}");
    let rig = rigsmith(folder.path(), &["--json", "info", "biped.rig.ron"]).json();
    assert!(rig["joints"].as_array().unwrap().len() >= 50);
    // Somebody's work on the template survives a second run.
    let template = folder.path().join("biped.rig.ron");
    let changed = fs::read_to_string(&template).unwrap().replace("\"hips\"", "\"pelvis\"");
    fs::write(&template, &changed).unwrap();
    assert_eq!(rigsmith(folder.path(), &[]).code, 0);
    assert_eq!(fs::read_to_string(&template).unwrap(), changed);
}

#[test]
fn sketch_writes_every_format_and_the_same_bytes() {
    let folder = with_box();
    for name in ["a.rig", "a.rig.ron", "a.glb", "a.gltf"] {
        let mut first = Vec::new();
        for round in 0..2 {
            let answer = rigsmith(folder.path(), &["sketch", "box.obj", "spine.ron", "-o", name]);
            assert_eq!(answer.code, 0, "{}", answer.err);
            let bytes = fs::read(folder.path().join(name)).unwrap();
            if round == 1 {
                assert_eq!(bytes, first, "{name} differs from run to run");
            }
            first = bytes;
        }
    }
    let text = fs::read_to_string(folder.path().join("a.rig")).unwrap();
    assert!(text.starts_with("rig 1\n"));
    assert!(text.trim_end().ends_with("tip"));
    let info = rigsmith(folder.path(), &["--json", "info", "a.glb"]).json();
    assert_eq!((info["skinned"].clone(), info["unweighted"].clone()), (true.into(), 0.into()));
}

#[test]
fn sketch_answers_each_gesture() {
    let folder = with_box();
    fs::write(folder.path().join("g.ron"), "[Click((0.1, 0.2)), Click((5.0, 5.0)), Undo, Redo, Redo]").unwrap();
    let answer = rigsmith(folder.path(), &["--json", "sketch", "box.obj", "g.ron", "-o", "a.rig"]);
    assert_eq!(answer.code, 0);
    let json = answer.json();
    let done: Vec<bool> = json["gestures"].as_array().unwrap().iter().map(|g| g["done"].as_bool().unwrap()).collect();
    assert_eq!(done, [true, false, true, true, false]);
    let place = &json["joints"][0]["position"];
    assert!((place[0].as_f64().unwrap() - 0.1).abs() < 1e-6 && place[2].as_f64().unwrap().abs() < 1e-6, "{place}");
}

#[test]
fn convert_does_what_makes_sense() {
    let folder = with_box();
    let run = |args: &[&str]| rigsmith(folder.path(), args);
    assert_eq!(run(&["sketch", "box.obj", "spine.ron", "-o", "a.glb"]).code, 0);
    assert_eq!(run(&["sketch", "box.obj", "spine.ron", "-o", "a.rig.ron"]).code, 0);
    let sensible = [
        ("box.obj", "b.glb"),
        ("box.obj", "b.gltf"),
        ("box.obj", "c.obj"),
        ("a.glb", "b.obj"),
        ("a.glb", "c.gltf"),
        ("a.glb", "c.rig"),
        ("a.glb", "c.rig.ron"),
        ("a.rig.ron", "d.rig"),
        ("d.rig", "d.rig.ron"),
        ("d.rig", "d.glb"),
    ];
    for (from, to) in sensible {
        let answer = run(&["convert", from, to]);
        assert_eq!(answer.code, 0, "{from} to {to}: {}", answer.err);
        assert_eq!(run(&["check", to]).code, 0, "{to}");
    }
    for (from, to) in [("box.obj", "e.rig"), ("a.rig.ron", "e.obj"), ("box.obj", "e.png"), ("spine.ron", "e.glb")] {
        let answer = run(&["convert", from, to]);
        assert_eq!(answer.code, 2, "{from} to {to}");
        assert!(answer.err.contains("cannot make"), "{}", answer.err);
        assert_eq!(answer.err.contains("rigsmith fit"), to == "e.rig", "a mesh has no skeleton yet: {}", answer.err);
    }
    let rig = fs::read_to_string(folder.path().join("d.rig")).unwrap();
    assert_eq!(rig.lines().filter(|line| line.starts_with("joint")).count(), 3);
}

#[test]
fn weights_travel_by_file() {
    let folder = with_box();
    let run = |args: &[&str]| rigsmith(folder.path(), args);
    assert_eq!(run(&["sketch", "box.obj", "spine.ron", "-o", "a.rig.ron"]).code, 0);
    assert_eq!(run(&["skin", "a.rig.ron", "box.obj", "-o", "a.glb", "--save-weights", "a.skin"]).code, 0);
    let exact = run(&["--json", "skin", "a.rig.ron", "box.obj", "-o", "b.glb", "--weights-from", "a.skin"]);
    assert_eq!(exact.json()["weights"]["exact"], true, "{}", exact.err);
    let bytes = |name: &str| fs::read(folder.path().join(name)).unwrap();
    assert_eq!(bytes("a.glb"), bytes("b.glb"));
    fs::write(folder.path().join("moved.obj"), BOX.replace("v 1 1 1", "v 1.01 1 1")).unwrap();
    let moved = run(&["--json", "skin", "a.rig.ron", "moved.obj", "-o", "c.glb", "--weights-from", "a.skin"]);
    assert_eq!(moved.json()["weights"]["exact"], false, "{}", moved.err);
    assert_eq!(run(&["--json", "info", "c.glb"]).json()["unweighted"], 0);
    // Options of weights that are made would be passed over in silence.
    for option in [&["--rigid", "box=tip"][..], &["--blend", "box"], &["--claim", "tip"], &["--smoothing", "2"]] {
        let both = ["skin", "a.rig.ron", "box.obj", "-o", "d.glb", "--weights-from", "a.skin"];
        let refused = run(&[&both[..], option].concat());
        assert_eq!(refused.code, 2, "{option:?}");
        assert!(refused.err.contains("--weights-from"), "{}", refused.err);
    }
    assert!(!folder.path().join("d.glb").exists());
}

#[test]
fn an_object_can_be_rigid() {
    let folder = with_box();
    let run = |args: &[&str]| rigsmith(folder.path(), args);
    assert_eq!(run(&["sketch", "box.obj", "spine.ron", "-o", "a.rig.ron"]).code, 0);
    let rigid = run(&["--json", "skin", "a.rig.ron", "box.obj", "-o", "a.glb", "--rigid", "box=tip"]);
    assert_eq!(rigid.json()["weights"]["given"], 8, "{}", rigid.err);
    let wrong = run(&["skin", "a.rig.ron", "box.obj", "-o", "a.glb", "--rigid", "hat=tip"]);
    assert_eq!(wrong.code, 1);
    assert!(wrong.err.contains("box"), "names the objects there are: {}", wrong.err);
}

/// A template is fitted into the bundled body: what was found is told joint by joint, the file builds, and what a person knows
/// holds.
#[test]
fn a_template_is_fitted() {
    let folder = folder();
    let run = |args: &[&str]| rigsmith(folder.path(), args);
    let body = asset("models/biped.obj");
    let fitted = run(&["--json", "fit", &body, "-o", "body.rig.ron", "--marker", "hand_l=0.60,1.05,0.05"]);
    assert_eq!(fitted.code, 0, "{}", fitted.err);
    let json = fitted.json();
    assert_eq!((json["template"].as_str(), json["symmetric"].is_boolean()), (Some("biped"), true));
    for key in ["up", "forward", "height", "confidence", "hypotheses", "notes", "millis"] {
        assert!(!json[key].is_null(), "{key} is missing");
    }
    let joints = json["joints"].as_array().unwrap();
    let hand = joints.iter().find(|joint| joint["label"] == "hand_l").unwrap();
    let place: Vec<f64> = hand["position"].as_array().unwrap().iter().map(|number| number.as_f64().unwrap()).collect();
    assert!((place[0] - 0.60).abs() < 1e-4 && (place[1] - 1.05).abs() < 1e-4, "{place:?}");
    assert!(joints.iter().all(|joint| joint["confidence"].is_number() && joint["reason"].is_string()));
    let built = run(&["--json", "build", "body.rig.ron"]);
    assert_eq!(built.code, 0, "{}", built.err);

    let wrong = run(&["fit", &body, "-o", "x.rig.ron", "--marker", "hand_q=0,1,0"]);
    assert!(wrong.code == 1 && wrong.err.contains("hand_"), "names the nearest joints: {}", wrong.err);
    for args in [["--up", "w"], ["--marker", "hand_l"], ["--marker", "hand_l=1,2"]] {
        assert_eq!(run(&["fit", &body, "-o", "x.rig.ron", args[0], args[1]]).code, 2, "{args:?}");
    }
    assert_eq!(run(&["fit", &body, "-o", "x.obj"]).code, 2);
    fs::write(folder.path().join("plane.obj"), "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\n").unwrap();
    let flat = run(&["fit", "plane.obj", "-o", "x.rig.ron"]);
    assert!(flat.code == 1 && flat.err.contains("flat"), "{}", flat.err);
    assert!(!folder.path().join("x.rig.ron").exists());
}

#[test]
fn what_bends_and_how_is_said_by_options() {
    let folder = with_box();
    let run = |args: &[&str]| rigsmith(folder.path(), args);
    assert_eq!(run(&["sketch", "box.obj", "spine.ron", "-o", "a.rig.ron"]).code, 0);
    assert_eq!(run(&["skin", "a.rig.ron", "box.obj", "-o", "a.glb", "--bend", "box"]).code, 0);
    let wrong = run(&["skin", "a.rig.ron", "box.obj", "-o", "a.glb", "--bend", "hat"]);
    assert!(wrong.code == 1 && wrong.err.contains("box"), "names the objects there are: {}", wrong.err);
    #[cfg(feature = "render")]
    {
        let file = run(&["pose", "a.rig.ron", "--deform", "dqs", "-o", "a.glb"]);
        assert!(file.code == 2 && file.err.contains(".png"), "{}", file.err);
    }
}

#[test]
fn bad_input_is_said_and_exits_with_1() {
    let folder = with_box();
    let write = |name: &str, bytes: &[u8]| fs::write(folder.path().join(name), bytes).unwrap();
    fs::create_dir(folder.path().join("folder.obj")).unwrap();
    write("empty.obj", b"");
    write("index.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n");
    write("nan.obj", b"v 0 0 0\nv nan 0 0\nv 0 1 0\nf 1 2 3\n");
    write("inf.obj", b"v 0 0 0\nv 1e999 0 0\nv 0 1 0\nf 1 2 3\n");
    write("two.obj", b"v 0 0 0\nv 1 0 0\nf 1 2\n");
    write("short.glb", b"glTF\x02\0\0\0\xff\xff\xff\x7f");
    write("text.glb", b"this is no model");
    write("cycle.rig", b"rig 1\njoint 0 1 0 0 0\njoint 1 0 0 0 0\n");
    write("field.rig.ron", b"(\n    format: 1,\n    uid: \"0000000000000001\",\n    name: \"x\",\n    colour: 3,\n)\n");
    write("type.ron", b"[\n    Click(\"here\"),\n]\n");
    write("gesture.ron", b"[\n    Klick((0.0, 0.0)),\n]\n");
    write("one.rig", b"rig 1\njoint 0 -1 0 0 0\n");
    let table: &[(&[&str], &str)] = &[
        (&["info", "missing.obj"], "missing.obj"),
        (&["info", "folder.obj"], "folder"),
        (&["info", "empty.obj"], "empty"),
        (&["info", "index.obj"], "line 4"),
        (&["info", "nan.obj"], "line 2"),
        (&["info", "inf.obj"], "line 2"),
        (&["info", "two.obj"], "line 3"),
        (&["info", "short.glb"], "short.glb"),
        (&["info", "text.glb"], "text.glb"),
        (&["info", "cycle.rig"], "cycle"),
        (&["info", "field.rig.ron"], "line 5"),
        (&["sketch", "box.obj", "type.ron", "-o", "a.rig"], "line 2"),
        (&["sketch", "box.obj", "gesture.ron", "-o", "a.rig"], "line 2"),
        (&["sketch", "box.obj", "spine.ron", "-o", "no/such/folder/a.rig"], "folder"),
        (&["skin", "one.rig", "empty.obj", "-o", "a.glb"], "empty"),
    ];
    for (args, wanted) in table {
        let answer = rigsmith(folder.path(), args);
        assert_eq!(answer.code, 1, "{args:?}: {}{}", answer.out, answer.err);
        assert!(answer.err.contains(wanted), "{args:?} must say \"{wanted}\": {}", answer.err);
        assert!(answer.out.is_empty(), "{args:?}");
        let mut args = args.to_vec();
        args.insert(0, "--json");
        let json = rigsmith(folder.path(), &args).json();
        assert_eq!(json["ok"], false);
        assert!(explained(&json).contains(wanted), "{args:?}: {json}");
    }
}

#[test]
fn wrong_usage_exits_with_2() {
    let folder = with_box();
    let table: &[&[&str]] = &[
        &["frobnicate"],
        &["sketch", "box.obj"],
        &["sketch", "box.obj", "spine.ron", "-o", "a.png"],
        &["skin", "box.obj", "box.obj", "-o", "a.glb"],
        &["skin", "a.rig", "box.obj", "-o", "a.glb", "--influences", "9"],
        &["info", "box.txt"],
    ];
    for args in table {
        let answer = rigsmith(folder.path(), args);
        assert_eq!(answer.code, 2, "{args:?}: {}", answer.err);
        assert!(!answer.err.is_empty());
        let mut args = args.to_vec();
        args.insert(0, "--json");
        let json = rigsmith(folder.path(), &args);
        assert_eq!((json.code, json.json()["ok"].clone()), (2, false.into()), "{args:?}");
    }
}

#[test]
fn a_file_that_cannot_be_written_leaves_the_old_one() {
    let folder = with_box();
    fs::create_dir(folder.path().join("a.rig")).unwrap();
    let answer = rigsmith(folder.path(), &["sketch", "box.obj", "spine.ron", "-o", "a.rig"]);
    assert_eq!(answer.code, 1, "{}", answer.err);
    assert!(folder.path().join("a.rig").is_dir());
    // A sketch that fails keeps the rig that is there.
    fs::write(folder.path().join("b.rig"), "rig 1\n").unwrap();
    fs::write(folder.path().join("bad.ron"), "[Click((0.0, 0.0)").unwrap();
    assert_eq!(rigsmith(folder.path(), &["sketch", "box.obj", "bad.ron", "-o", "b.rig"]).code, 1);
    assert_eq!(fs::read_to_string(folder.path().join("b.rig")).unwrap(), "rig 1\n");
}

#[test]
fn check_looks_at_every_file() {
    let folder = with_box();
    fs::write(folder.path().join("hole.obj"), BOX.replace("f 4 1 5 8\n", "")).unwrap();
    fs::write(folder.path().join("bad.obj"), "v 0 0\n").unwrap();
    let fine = rigsmith(folder.path(), &["--json", "check", "box.obj", "hole.obj", "spine.ron"]);
    assert_eq!(fine.code, 0);
    let files = fine.json()["files"].clone();
    assert_eq!(files[0]["remarks"].as_array().unwrap().len(), 0, "{files}");
    assert!(files[1]["remarks"][0].as_str().unwrap().contains("4 edges have one face only"), "{files}");
    let bad = rigsmith(folder.path(), &["--json", "check", "box.obj", "bad.obj"]);
    assert_eq!(bad.code, 1);
    assert!(bad.json()["files"][1]["error"].as_str().unwrap().contains("line 1"));
}

#[test]
fn any_unit_gives_the_same_skeleton() {
    let folder = folder();
    let mut shapes: Vec<Vec<f64>> = Vec::new();
    for scale in [0.001_f64, 1.0, 1000.0] {
        let scaled: String = BOX
            .lines()
            .map(|line| match line.strip_prefix("v ") {
                Some(rest) => {
                    let numbers: Vec<f64> = rest.split(' ').map(|n| n.parse::<f64>().unwrap() * scale).collect();
                    format!("v {} {} {}\n", numbers[0], numbers[1], numbers[2])
                }
                None => format!("{line}\n"),
            })
            .collect();
        fs::write(folder.path().join("box.obj"), scaled).unwrap();
        let at = |x: f64, y: f64| format!("({:?}, {:?})", x * scale, y * scale);
        let gestures = format!("[Stroke(points: [{}, {}], joints: 3)]", at(0.1, -0.8), at(0.1, 0.8));
        fs::write(folder.path().join("g.ron"), gestures).unwrap();
        let answer = rigsmith(folder.path(), &["--json", "sketch", "box.obj", "g.ron", "-o", "a.glb"]);
        assert_eq!(answer.code, 0, "{}", answer.err);
        let json = answer.json();
        let joints = json["joints"].as_array().unwrap().iter();
        shapes.push(
            joints
                .flat_map(|j| j["position"].as_array().unwrap().iter().map(|x| x.as_f64().unwrap() / scale))
                .collect(),
        );
        assert_eq!(rigsmith(folder.path(), &["--json", "info", "a.glb"]).json()["unweighted"], 0);
    }
    for other in [&shapes[0], &shapes[2]] {
        assert_eq!(other.len(), shapes[1].len());
        assert!(other.iter().zip(&shapes[1]).all(|(a, b)| (a - b).abs() < 1e-4), "{shapes:?}");
    }
}

#[test]
fn bundled_templates_open_and_fit_their_models() {
    for name in ["biped", "hand"] {
        let folder = folder();
        let (rig, mesh) = (asset(&format!("templates/{name}.rig.ron")), asset(&format!("models/{name}.obj")));
        let answer = rigsmith(folder.path(), &["skin", &rig, &mesh, "-o", "out.glb"]);
        assert_eq!(answer.code, 0, "{}", answer.err);
        let info = rigsmith(folder.path(), &["--json", "info", "out.glb"]).json();
        assert_eq!(info["unweighted"], 0, "{name}: {info}");
        assert!(info["joints"].as_u64().unwrap() >= 15);
    }
}
