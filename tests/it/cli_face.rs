//! Faces on the command line: the real binary, real files, exit codes.

use std::{
    fs,
    path::{Path, PathBuf},
};

use glam::Vec3;
use rigsmith::{
    algo::face::expression::ExpressionSet,
    files::{RealDisk, load_model, load_template},
};

use crate::{cli_build::rigsmith, face_arkit::skinned, prerequisites::test_data};

fn head() -> String {
    let path = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("assets/models/head.obj");
    path.display().to_string()
}

#[test]
fn a_head_becomes_a_character_and_a_rig() {
    let folder = tempfile::tempdir().unwrap();
    let exports = std::env::var_os("RIGSMITH_EXPORTS").map(PathBuf::from);
    let glb = exports.map_or_else(|| folder.path().join("face.glb"), |exports| exports.join("face.glb"));
    let glb = glb.display().to_string();
    let answer = rigsmith(folder.path(), &["face", &head(), "--bones", "24", "-o", &glb, "--json"]);
    assert_eq!(answer.code, 0, "{}", answer.err);
    let json = answer.json();
    for key in ["groups", "heights", "bones", "square_error", "milliseconds"] {
        assert!(!json[key].is_null(), "{key} is told: {json}");
    }
    let bones = json["bones"].as_array().unwrap();
    assert_eq!(bones.iter().filter(|bone| bone["kind"] == "skin").count(), 24);
    assert!(json["heights"].as_array().unwrap().windows(2).all(|pair| pair[0].as_f64() >= pair[1].as_f64()));
    let model = load_model(&RealDisk, Path::new(&glb)).unwrap();
    assert!(model.weights.is_some() && model.nodes.len() > 24);

    let rig = folder.path().join("face.rig.ron").display().to_string();
    let happy = ["face", &head(), "--bones", "12", "--expression", "happiness=1", "-o", &rig];
    assert_eq!(rigsmith(folder.path(), &happy).code, 0);
    let template = load_template(&RealDisk, Path::new(&rig)).unwrap();
    assert!(template.rig.find_label("head").is_some());
    // A template holds no pose of the moment: the expression is one of its stored poses.
    let stored = template.rig.stored_poses();
    assert!(stored.len() == 1 && stored[0].name == "happiness" && stored[0].offsets.len() > 4, "{stored:?}");
    let first = fs::read(&rig).unwrap();
    assert_eq!(rigsmith(folder.path(), &happy).code, 0);
    assert_eq!(fs::read(&rig).unwrap(), first, "the same command writes the same bytes");
}

/// Loss of each unit by the mending of folds is told, and is a twentieth of the unit at most.
#[test]
fn what_mending_takes_of_units_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let args = ["face", &head(), "--bones", "12", "-o", "face.rig.ron"];
    let answer = rigsmith(folder.path(), &[&args[..], &["--json"]].concat());
    assert_eq!(answer.code, 0, "{}", answer.err);
    let json = answer.json();
    let told = json["mended_percent"].as_object().unwrap();
    let units = ExpressionSet::bundled().units();
    assert_eq!(told.len(), units.len());
    for unit in units {
        let taken = told[&unit.name].as_f64().unwrap();
        assert!((0.0..=5.0).contains(&taken), "mending takes {taken} % of {}", unit.name);
    }
    let line = rigsmith(folder.path(), &args).out;
    let line = line.lines().find(|line| line.starts_with("mending of folds weakens")).unwrap();
    // For people: how many units, and the largest loss.
    let taken: Vec<f64> = told.values().map(|taken| taken.as_f64().unwrap()).filter(|taken| *taken > 0.0).collect();
    let most = taken.iter().copied().fold(0.0, f64::max);
    let said = format!("weakens {} of {} units, by {most} % at most", taken.len(), told.len());
    assert!(!taken.is_empty() && line.contains(&said), "{line}");
}

/// Bones and weights are fitted for as many influences as the file holds, and the error told is that of the file.
#[test]
fn a_fit_is_as_good_as_what_is_written() {
    let Some(data) = test_data() else { return };
    let folder = tempfile::tempdir().unwrap();
    let [head, shapes] =
        ["ict_neutral.obj", "ict_expressions.json"].map(|file| data.join("heads").join(file).display().to_string());
    // In centimetres, a tenth above what was measured, or the target.
    for (bones, influences, most) in
        [("10", "4", 0.0525), ("20", "4", 0.034), ("40", "4", 0.0235), ("80", "4", 0.018), ("20", "8", 0.0295)]
    {
        let args =
            ["face", &head, "--bones", bones, "--fit", &shapes, "--influences", influences, "-o", "fit.glb", "--json"];
        let answer = rigsmith(folder.path(), &args);
        assert_eq!(answer.code, 0, "{}", answer.err);
        let [fitted, written] = ["fit_error", "written_fit_error"].map(|key| answer.json()[key].as_f64().unwrap());
        println!("{bones} bones, {influences} influences: {fitted:.4} fitted, {written:.4} written");
        assert!(written < most, "{bones} bones, {influences} influences: {written}");
        assert!((written - fitted).abs() < 0.03 * fitted, "{written} is written, {fitted} was fitted");
    }
}

/// Marks triangles that turn by more than a right angle, but for slivers, which have no orientation.
fn is_folded(rest: &[Vec3], moved: &[Vec3], corners: &[u32; 3]) -> bool {
    let normal = |points: &[Vec3]| {
        let [a, b, c] = corners.map(|corner| points[corner as usize]);
        let longest = (b - a).length_squared().max((c - a).length_squared()).max((c - b).length_squared());
        ((b - a).cross(c - a), longest)
    };
    let ((before, longest), (after, _)) = (normal(rest), normal(moved));
    before.length() > 1e-3 * longest && before.dot(after) < 0.0
}

/// Expressions of the written file, in which few joints move a point, fold one in a thousand triangles of the facial mask at
/// most; a mask has twice as many triangles as points.
#[test]
fn written_expressions_hardly_fold_the_skin() {
    let Some(data) = test_data() else { return };
    let folder = tempfile::tempdir().unwrap();
    for (head, expression, bones) in [
        ("ict_neutral", "happiness", "40"),
        ("ict_identity_1", "disgust", "40"),
        ("ict_identity_3", "disgust", "40"),
        ("ict_identity_3", "surprise", "60"),
    ] {
        let mesh = data.join("heads").join(format!("{head}.obj")).display().to_string();
        let shown = format!("{expression}=1");
        let args = ["face", &mesh, "--bones", bones, "--expression", &shown, "-o", "posed.glb", "--json"];
        let answer = rigsmith(folder.path(), &args);
        assert_eq!(answer.code, 0, "{}", answer.err);
        let model = load_model(&RealDisk, &folder.path().join("posed.glb")).unwrap();
        let moved = skinned(&model);
        let folded = |corners: &&[u32; 3]| is_folded(&model.points, &moved, corners);
        let folds = model.point_triangles().iter().filter(folded).count();
        let most = 2 * answer.json()["groups"]["mask"].as_u64().unwrap() as usize / 1000;
        println!("{head}, {expression}, {bones} bones: {folds} triangles folded, {most} at most");
        assert!(folds <= most, "{head}, {expression}, {bones} bones: {folds} triangles are folded, {most} may be");
    }
}

#[test]
fn an_expression_poses_the_character() {
    let folder = tempfile::tempdir().unwrap();
    let (still, moved) = ("still.glb", "moved.glb");
    for (name, more) in [(still, &[][..]), (moved, &["--expression", "surprise=1"][..])] {
        let head = head();
        let mut args = vec!["face", &head, "--bones", "20", "-o", name];
        args.extend(more);
        let answer = rigsmith(folder.path(), &args);
        assert_eq!(answer.code, 0, "{}", answer.err);
    }
    let [still, moved] = [still, moved].map(|name| load_model(&RealDisk, &folder.path().join(name)).unwrap());
    let differ = still.nodes.iter().zip(&moved.nodes).filter(|(a, b)| a.rest != b.rest).count();
    assert!(differ > 4, "{differ} nodes are posed");
    assert_eq!(still.points, moved.points, "the mesh itself stays");
}

/// Shapes of the mesh stay as they are where shapes of these names are baked, which is told.
#[test]
fn shapes_that_the_mesh_has_already_are_told() {
    let folder = tempfile::tempdir().unwrap();
    let head = head();
    let first = rigsmith(folder.path(), &["face", &head, "--bones", "12", "--arkit", "-o", "first.glb", "--json"]);
    assert_eq!(first.code, 0, "{}", first.err);
    assert!(!first.json()["notes"].to_string().contains("stay as they are"), "{}", first.out);
    let args = ["face", "first.glb", "--bones", "8", "--arkit", "-o", "second.glb", "--json"];
    let second = rigsmith(folder.path(), &args).json();
    let baked = second["arkit"].as_array().unwrap().len();
    let told = second["notes"].to_string();
    assert!(told.contains(&format!("{baked} morph targets of the mesh with names of ARKit stay")), "{told}");
}

#[test]
fn wrong_use_is_told() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("flat.obj"), "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").unwrap();
    fs::write(folder.path().join("shapes.json"), "{}").unwrap();
    fs::write(folder.path().join("shapes.f32"), "x").unwrap();
    let head = head();
    let cases: &[(&[&str], i32, &str)] = &[
        (&["face", &head, "--bones", "0", "-o", "a.glb"], 2, "at least 1"),
        (&["face", &head, "--bones", "9999999", "-o", "a.glb"], 1, "bones"),
        (&["face", &head, "--bones", "5000", "-o", "a.glb"], 1, "bones"),
        (&["face", &head, "--bones", "501", "-o", "a.glb"], 1, "500 at most"),
        (&["face", &head, "-o", "a.obj"], 2, ".glb"),
        (&["face", &head, "--expression", "hapiness=1", "-o", "a.glb"], 2, "happiness"),
        (&["face", &head, "--expression", "happiness=2", "-o", "a.glb"], 2, "0 to 1"),
        (&["face", &head, "--expression", "happiness", "-o", "a.glb"], 2, "NAME=STRENGTH"),
        (&["face", &head, "--up", "w", "-o", "a.glb"], 2, "x, y or z"),
        (&["face", "flat.obj", "-o", "a.glb"], 1, ""),
        (&["face", "none.obj", "-o", "a.glb"], 1, "none.obj"),
        (&["face", &head, "--fit", "shapes.json", "-o", "a.glb"], 1, "vertices"),
        (&["face", &head, "--fit", "none.txt", "-o", "a.glb"], 2, "morph targets"),
    ];
    for (args, code, words) in cases {
        let answer = rigsmith(folder.path(), args);
        assert_eq!(answer.code, *code, "{args:?}: {}", answer.err);
        assert!(answer.err.contains(words), "{args:?} must say \"{words}\": {}", answer.err);
        assert!(!folder.path().join("a.glb").exists(), "{args:?} writes nothing");
    }
}
