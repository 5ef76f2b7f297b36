//! Wishes of people for a fit on the command line: markers, directions, symmetry and names, and the notes where the mesh
//! shows something else.

use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
};

use bevy::math::Vec3;
use serde_json::Value;

use crate::{cli_build::rigsmith, fit_data::shapes::teapot};

fn body() -> String {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("assets/models/biped.obj").display().to_string()
}

/// Report of a fit of the biped to a mesh.
fn fitted(folder: &Path, mesh: &str, wishes: &[&str]) -> Value {
    let mut args = vec!["--json", "fit", mesh, "--template", "biped", "-o", "out.rig.ron"];
    args.extend_from_slice(wishes);
    let answer = rigsmith(folder, &args);
    assert_eq!(answer.code, 0, "{wishes:?}: {}", answer.err);
    for file in ["out.rig.ron", "out.rig.ron.base"] {
        std::fs::remove_file(folder.join(file)).unwrap();
    }
    answer.json()
}

fn places(report: &Value) -> BTreeMap<String, Vec3> {
    let place = |joint: &Value| {
        let number = |at: usize| joint["position"][at].as_f64().unwrap() as f32;
        (joint["label"].as_str().unwrap().to_owned(), Vec3::new(number(0), number(1), number(2)))
    };
    report["joints"].as_array().unwrap().iter().map(place).collect()
}

#[track_caller]
fn says(report: &Value, words: &[&str]) {
    let notes: Vec<&str> = report["notes"].as_array().unwrap().iter().filter_map(Value::as_str).collect();
    let has_all = |note: &&str| words.iter().all(|word| note.contains(word));
    assert!(notes.iter().any(has_all), "no note has {words:?}: {notes:?}");
}

fn direction(report: &Value, key: &str) -> Vec3 {
    let number = |at: usize| report[key][at].as_f64().unwrap() as f32;
    Vec3::new(number(0), number(1), number(2))
}

/// Markers that cannot be meant are refused with the place and the reach of the mesh, and nothing is written.
#[test]
fn markers_that_cannot_be_meant_are_refused() {
    let (folder, body) = (tempfile::tempdir().unwrap(), body());
    let cases: [(&[&str], i32, &str); 5] = [
        (&["--marker", "hand_l=1e30,0,0"], 1, "\"hand_l\" at"),
        (&["--marker", "hand_l=55,103,5"], 1, "reaches from"),
        (&["--marker", "hand_l=0.5,1,0", "--marker", "hand_l=0.5,1.1,0"], 1, "two markers for \"hand_l\""),
        (&["--marker", "hand_l=nan,0,0"], 2, "LABEL=X,Y,Z"),
        (&["--up", "y", "--forward", "y"], 1, "parallel"),
    ];
    for (wishes, code, words) in cases {
        let mut args = vec!["fit", body.as_str(), "--template", "biped", "-o", "x.rig.ron"];
        args.extend_from_slice(wishes);
        let answer = rigsmith(folder.path(), &args);
        assert!(answer.code == code && answer.err.contains(words), "{wishes:?}: {}", answer.err);
        assert!(!folder.path().join("x.rig.ron").exists(), "{wishes:?}");
    }
}

/// A marker that contradicts what the mesh shows for sure moves its own limb alone, and is told.
#[test]
fn markers_against_the_mesh_move_their_limb_alone() {
    let folder = tempfile::tempdir().unwrap();
    let plain = fitted(folder.path(), &body(), &[]);
    let (was, height) = (places(&plain), plain["height"].as_f64().unwrap() as f32);
    // Between the feet, and before the air beside the hand.
    for (marker, place) in
        [("hand_l=0,0.1,0", Vec3::new(0.0, 0.1, 0.0)), ("hand_l=0.9,1.1,0", Vec3::new(0.9, 1.1, 0.0))]
    {
        let report = fitted(folder.path(), &body(), &["--marker", marker]);
        says(&report, &["hand_l", "its own limb alone"]);
        assert_eq!(direction(&report, "up"), Vec3::Y, "{marker}");
        assert_eq!(direction(&report, "forward"), Vec3::Z, "{marker}");
        let is = places(&report);
        assert!(is["hand_l"].distance(place) < 1e-3 * height, "{marker}: {}", is["hand_l"]);
        for label in ["hips", "head", "foot_l", "foot_r", "hand_r", "shin_l"] {
            let moved = is[label].distance(was[label]) / height;
            assert!(moved < 0.02, "{marker}: {label} moved by {moved}");
        }
        let knuckle = (is["middle_01_l"] - is["hand_l"]).distance(was["middle_01_l"] - was["hand_l"]);
        assert!(knuckle < 0.02 * height, "{marker}: the hand stays as large as it is: {knuckle}");
    }
}

/// Directions are obeyed; where the mesh shows other ones, that is told, and the fit is not trusted.
#[test]
fn directions_against_the_mesh_are_told() {
    let folder = tempfile::tempdir().unwrap();
    let cases = [
        (["--up", "z"], "up", Vec3::Z, ["up", "along y"]),
        (["--forward", "x"], "forward", Vec3::X, ["forward", "along z"]),
    ];
    for (wish, key, given, words) in cases {
        let report = fitted(folder.path(), &body(), &wish);
        assert_eq!(direction(&report, key), given, "{wish:?}");
        assert!(report["confidence"].as_f64().unwrap() < 0.5, "{wish:?}: {}", report["confidence"]);
        says(&report, &words);
    }
    let right = fitted(folder.path(), &body(), &["--up", "y", "--forward", "z"]);
    assert!(right["confidence"].as_f64().unwrap() > 0.9, "{}", right["confidence"]);
}

/// A figure with one arm raised, made symmetric as asked, says so.
#[test]
fn symmetry_that_is_asked_for_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let text = std::fs::read_to_string(body()).unwrap();
    let raised = text.lines().map(|line| {
        let Some(place) = line.strip_prefix("v ") else { return format!("{line}\n") };
        let numbers: Vec<f32> = place.split(' ').map(|number| number.parse().unwrap()).collect();
        let up = 0.8 * (numbers[0] - 0.25).max(0.0);
        format!("v {} {} {}\n", numbers[0], numbers[1] + up, numbers[2])
    });
    std::fs::write(folder.path().join("raised.obj"), raised.collect::<String>()).unwrap();
    let report = fitted(folder.path(), "raised.obj", &["--symmetry", "on"]);
    assert_eq!(report["symmetric"].as_bool(), Some(true));
    says(&report, &["as asked", "pairs of joints"]);
    let joints = places(&report);
    let [left, right] = ["hand_l", "hand_r"].map(|hand| joints[hand].distance(joints["hips"]));
    assert!((left - right).abs() < 0.01, "{left} and {right} from the hips");
}

/// Names that do not exist are told with what to do.
#[test]
fn names_that_do_not_exist_are_told() {
    let folder = tempfile::tempdir().unwrap();
    let nameless = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n";
    std::fs::write(folder.path().join("nameless.obj"), nameless).unwrap();
    let body = body();
    let cases: [(&[&str], i32, &str); 3] = [
        (&[body.as_str(), "--template", "bipd"], 1, "\"biped\""),
        (&["nameless.obj", "--region", "foo"], 1, "corners of a box"),
        (&["nameless.obj", "--region="], 2, "two corners"),
    ];
    for (wishes, code, words) in cases {
        let mut args = vec!["fit", "-o", "x.rig.ron"];
        args.extend_from_slice(wishes);
        let answer = rigsmith(folder.path(), &args);
        assert!(answer.code == code && answer.err.contains(words), "{wishes:?}: {}", answer.err);
    }
}

/// A mesh that shows no figure is refused with the reason, and nothing is written; whoever names a template gets a guess that
/// says so.
#[test]
fn a_teapot_gets_a_skeleton_only_by_name() {
    let folder = tempfile::tempdir().unwrap();
    let (points, triangles) = teapot();
    let corners = points.iter().map(|point| format!("v {} {} {}\n", point.x, point.y, point.z));
    let faces = triangles.iter().map(|[a, b, c]| format!("f {} {} {}\n", a + 1, b + 1, c + 1));
    std::fs::write(folder.path().join("teapot.obj"), corners.chain(faces).collect::<String>()).unwrap();
    let answer = rigsmith(folder.path(), &["fit", "teapot.obj", "-o", "out.rig.ron"]);
    assert!(answer.code == 1 && answer.err.contains("the mesh shows no figure"), "{}: {}", answer.code, answer.err);
    assert!(answer.err.contains("confidence 0.") && answer.err.contains("choose the template"), "{}", answer.err);
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1, "nothing is written");
    let answer = rigsmith(folder.path(), &["--json", "fit", "teapot.obj", "--template", "bird", "-o", "out.rig.ron"]);
    assert_eq!(answer.code, 0, "{}", answer.err);
    says(&answer.json(), &["a guess"]);
}
