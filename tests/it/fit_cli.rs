//! Fits on the command line: parts of the mesh and parts of the library.

use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
};

use bevy::math::Vec3;
use rigsmith::{
    files::{RealDisk, bundled_characters, load_model, load_template, store_model},
    mesh::{gltf::GltfWriteSettings, model::Model},
    rig::Rig,
};

use crate::{cli_build::rigsmith, prerequisites::test_data};

fn body() -> String {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("assets/models/biped.obj").display().to_string()
}

fn template(path: &Path) -> Rig {
    load_template(&RealDisk, path).unwrap().rig
}

fn at(rig: &Rig, label: &str) -> Vec3 {
    rig.position(rig.find_label(label).unwrap_or_else(|| panic!("no joint {label}")))
}

/// The part onto each hand, by a box; a file of the part is as good as its name, and the same input gives the same bytes.
#[test]
fn a_part_is_fitted_into_a_box() {
    let folder = tempfile::tempdir().unwrap();
    let run = |args: &[&str]| rigsmith(folder.path(), args);
    let biped = bundled_characters().into_iter().find(|rig| rig.about().name == "biped").unwrap();
    let file = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("assets/templates/parts/hand.rig.ron");
    let file = file.display().to_string();
    for (corners, ending) in [("0.5,0.7,-0.5,2,1.3,0.5", "_l"), ("-0.5,0.7,-0.5,-2,1.3,0.5", "_r")] {
        let mut texts = Vec::new();
        for part in ["parts/hand", "parts/hand.rig.ron", file.as_str()] {
            let fitted =
                run(&["--json", "fit", &body(), "--template", part, "--region", corners, "-o", "hand.rig.ron"]);
            assert_eq!(fitted.code, 0, "{part}: {}", fitted.err);
            assert_eq!(fitted.json()["joints"].as_array().unwrap().len(), 16);
            texts.push(std::fs::read_to_string(folder.path().join("hand.rig.ron")).unwrap());
            std::fs::remove_file(folder.path().join("hand.rig.ron")).unwrap();
        }
        assert!(texts.iter().all(|text| *text == texts[0]), "by name and by file");
        std::fs::write(folder.path().join("kept.rig.ron"), &texts[0]).unwrap();
        let hand = template(&folder.path().join("kept.rig.ron"));
        let mut sum = 0.0;
        for joint in hand.walk() {
            let label = joint.data.label.as_deref().unwrap();
            assert!(label.ends_with(ending), "{label} is of the other side");
            let off = at(&hand, label).distance(at(&biped, label));
            // The thumb's first joints and the wrist, which the cut hides, are 18 mm off; the hand is 200 mm long.
            assert!(off < 0.0205, "{label} is off by {off}");
            sum += off;
        }
        println!("hand{ending}: {:.4} off in the mean", sum / 16.0);
        assert!(sum / 16.0 < 0.0095, "{}", sum / 16.0);
    }
}

#[test]
fn regions_that_mean_nothing_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let run = |region: &str| rigsmith(folder.path(), &["fit", &body(), "--region", region, "-o", "x.rig.ron"]);
    let unknown = run("hat");
    assert!(unknown.code == 1 && unknown.err.contains("body"), "names what there is: {}", unknown.err);
    let empty = run("5,5,5,6,6,6");
    assert!(empty.code == 1 && empty.err.contains("no face of the mesh is in the region"), "{}", empty.err);
    for wrong in ["1,2,3", "1,2,3,4,5,nan"] {
        assert_eq!(run(wrong).code, 2, "{wrong}");
    }
    assert!(!folder.path().join("x.rig.ron").exists());
    // The only object is the whole mesh.
    let whole = run("body");
    assert_eq!(whole.code, 0, "{}", whole.err);
    assert!(template(&folder.path().join("x.rig.ron")).find_label("hips").is_some());
}

/// A character that is bound to a skeleton: the part goes into what one of its bones moves.
#[test]
fn a_part_is_fitted_into_what_a_bone_moves() {
    let Some(data) = test_data() else { return };
    let folder = tempfile::tempdir().unwrap();
    let fox = data.join("creatures/fox-fox.glb").display().to_string();
    let run = |args: &[&str]| rigsmith(folder.path(), args);
    let tail = ["--json", "fit", &fox, "--template", "parts/tail", "--region", "Tail_Base", "-o", "tail.rig.ron"];
    let fitted = run(&tail);
    assert_eq!(fitted.code, 0, "{}", fitted.err);
    let tail = template(&folder.path().join("tail.rig.ron"));
    // The fox looks along Z; its tail is behind its hind legs.
    assert!(tail.walk().all(|joint| tail.position(joint.data.uid).z < 0.0), "the tail is behind");
    let unknown = run(&["fit", &fox, "--region", "Tail_Bass", "-o", "x.rig.ron"]);
    assert!(unknown.code == 1 && unknown.err.contains("Tail_Base"), "names the bones: {}", unknown.err);
}

/// An arm without its hand shows no side: that of the body on which it is.
#[test]
fn an_arm_is_of_the_side_on_which_it_is() {
    let (folder, body) = (tempfile::tempdir().unwrap(), body());
    for (region, ending) in [("0.2,0.5,-0.5,1.0,1.6,0.6", "_l"), ("-0.2,0.5,-0.5,-1.0,1.6,0.6", "_r")] {
        let args = ["fit", &body, "--template", "parts/arm", "--region", region, "-o", "arm.rig.ron"];
        let fitted = rigsmith(folder.path(), &args);
        assert_eq!(fitted.code, 0, "{}", fitted.err);
        let arm = template(&folder.path().join("arm.rig.ron"));
        let labels: Vec<_> = arm.walk().filter_map(|joint| joint.data.label.clone()).collect();
        assert!(labels.iter().any(|label| label == &format!("forearm{ending}")), "{region}: {labels:?}");
    }
}

/// A wing shows one branch, whatever feathers the part has: they go along with its bones.
#[test]
fn a_wing_is_fitted_into_what_a_bone_moves() {
    let Some(data) = test_data() else { return };
    let folder = tempfile::tempdir().unwrap();
    let eagle = data.join("creatures/bird-eagle.glb").display().to_string();
    let span = load_model(&RealDisk, Path::new(&eagle)).unwrap().at_rest();
    let span = span.points.iter().map(|point| point.x).fold(0.0, f32::max);
    let args = ["--json", "fit", &eagle, "--template", "parts/wing", "--region", "wing_1_L", "-o", "wing.rig.ron"];
    let fitted = rigsmith(folder.path(), &args);
    assert_eq!(fitted.code, 0, "{}", fitted.err);
    let wing = template(&folder.path().join("wing.rig.ron"));
    let across = ["wing_1_l", "wing_2_l", "wing_3_l"].map(|label| at(&wing, label).x);
    assert!(across[0] < across[1] && across[1] < across[2], "from the body outwards: {across:?}");
    assert!(across[0] > 0.0 && across[2] > 0.3 * span, "{across:?} of {span}");
    for joint in wing.walk() {
        let place = wing.position(joint.data.uid);
        assert!((0.0..1.1 * span).contains(&place.x), "{:?} is at {place}", joint.data.label);
    }
}

/// The root of a tail is where it hangs on the body, without a word about the front.
#[test]
fn a_tail_begins_at_the_body() {
    let Some(data) = test_data() else { return };
    let folder = tempfile::tempdir().unwrap();
    for (name, tip) in [("fox-fox", Vec3::new(0.0, 1.1, -2.07)), ("fox-dog", Vec3::new(0.0, 1.1, -2.01))] {
        let skinned = data.join("creatures").join(name).with_extension("glb");
        // The mesh alone, too, in which no bone names the part.
        let bare = folder.path().join(name).with_extension("obj");
        let rest = load_model(&RealDisk, &skinned).unwrap().at_rest();
        store_model(&RealDisk, &bare, &rest, &GltfWriteSettings::default()).unwrap();
        let inputs = [
            (&skinned, "Tail_Base", -0.83, "skinned.rig.ron"),
            (&bare, "-0.4,0.7,-1.05,0.4,1.6,-3", -1.05, "bare.rig.ron"),
        ];
        for (mesh, region, base, output) in inputs {
            let mesh = mesh.display().to_string();
            let output = format!("{name}_{output}");
            let args = ["fit", &mesh, "--template", "parts/tail", "--region", region, "-o", &output];
            let fitted = rigsmith(folder.path(), &args);
            assert_eq!(fitted.code, 0, "{output}: {}", fitted.err);
            let rig = template(&folder.path().join(&output));
            let (first, last) = (at(&rig, "tail_1"), at(&rig, "tail_6"));
            assert!(first.distance(Vec3::new(0.0, 1.07, base)) < 0.3, "{output}: begins at {first}");
            assert!(last.distance(tip) < 0.3, "{output}: ends at {last}");
        }
    }
}

/// Joints of the hand of the test data by the label of a template's joint; templates differ in what they have of a palm.
fn true_hand(model: &Model) -> BTreeMap<String, Vec3> {
    let globals = model.rest_globals();
    let place = |name: &str| {
        let node = model.nodes.iter().position(|node| node.name == name).unwrap_or_else(|| panic!("no joint {name}"));
        Vec3::from(globals[node].translation)
    };
    let mut joints = BTreeMap::from([("hand_l".to_owned(), place("wrist"))]);
    for (number, bone) in [("01", "metacarpal"), ("02", "phalanx-proximal"), ("03", "phalanx-distal")] {
        joints.insert(format!("thumb_{number}_l"), place(&format!("thumb-{bone}")));
    }
    let bones =
        [("00", "metacarpal"), ("01", "phalanx-proximal"), ("02", "phalanx-intermediate"), ("03", "phalanx-distal")];
    for finger in ["index", "middle", "ring", "pinky"] {
        for (number, bone) in bones {
            joints.insert(format!("{finger}_{number}_l"), place(&format!("{finger}-finger-{bone}")));
        }
    }
    joints
}

/// The hand of the test data, alone in its file: the character of a hand, which takes 4.0 hundredths of the hand's length, and
/// the part, whose wrist and thumb the cut through the forearm misleads.
#[test]
fn hands_are_fitted_onto_a_hand() {
    let Some(data) = test_data() else { return };
    let folder = tempfile::tempdir().unwrap();
    let file = data.join("hands/webxr_generic_hand_left.glb");
    let model = load_model(&RealDisk, &file).unwrap();
    let truth = true_hand(&model);
    let points = model.at_rest().points;
    let (low, high) = points.iter().fold((Vec3::MAX, Vec3::MIN), |(a, b), point| (a.min(*point), b.max(*point)));
    let length = (high - low).max_element();
    let part = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("assets/templates/parts/hand.rig.ron");
    let (part, hand) = (part.display().to_string(), file.display().to_string());
    for (template, joints, known, most) in [("hand", 21, 20, 4.4), (part.as_str(), 16, 16, 6.4)] {
        let output = format!("{joints}.rig.ron");
        let args = ["--json", "fit", &hand, "--template", template, "-o", &output];
        let fitted = rigsmith(folder.path(), &args);
        assert_eq!(fitted.code, 0, "{}", fitted.err);
        let json = fitted.json();
        assert_eq!(json["template"].as_str(), Some("hand"));
        let rig = self::template(&folder.path().join(&output));
        assert_eq!(rig.len(), joints);
        assert!(rig.walk().all(|joint| joint.data.label.as_deref().is_some_and(|label| label.ends_with("_l"))));
        let found = |label: &str| rig.find_label(label).map(|joint| rig.position(joint));
        let off: Vec<(&str, f32)> = (truth.iter())
            .filter_map(|(label, place)| Some((label.as_str(), 100.0 * found(label)?.distance(*place) / length)))
            .collect();
        assert_eq!(off.len(), known, "{off:?}");
        let mean = off.iter().map(|(_, off)| off).sum::<f32>() / off.len() as f32;
        println!("{template}: {mean:.2} off in the mean, confidence {}, {off:.1?}", json["confidence"]);
        assert!(mean <= most, "{template}: {mean}: {off:?}");
        // Every finger is in its own: its last joint lies nearest to that finger's.
        for finger in ["thumb", "index", "middle", "ring", "pinky"] {
            let label = format!("{finger}_03_l");
            let place = at(&rig, &label);
            let ends = truth.iter().filter(|(label, _)| label.ends_with("_03_l"));
            let nearest = ends.min_by(|a, b| a.1.distance(place).total_cmp(&b.1.distance(place))).unwrap();
            assert_eq!(*nearest.0, label, "{template}");
        }
    }
}
