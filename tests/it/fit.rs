//! Fit in an app: templates move into meshes, through the request, the command and gestures, and are corrected by moving joints.

use std::{collections::BTreeMap, path::Path, sync::Arc};

use bevy::{math::Vec3, prelude::*};
use rigsmith::{
    algo::fit_template::{FitError, FitReason, FitSymmetry, MeshAnalysis},
    files::{RealDisk, bundled_characters, bundled_part, load_model},
    headless::{Workbench, WorkbenchError},
    mesh::model::Model,
    plugins::{
        commands::BuildStep,
        fit::{FitFailure, FitParts, FitReport, FitTemplate, FitTemplates},
        gesture::Gesture,
    },
    rig::{NodeType, Rig, operations::Operation, template::write_template},
};

use crate::prerequisites::{BODIES, test_data};

/// Labels of the biped's joints, and the bones of the bodies' `game_engine` rig that begin there.
const JOINTS: [(&str, &str); 13] = [
    ("hips", "pelvis"),
    ("neck", "neck_01"),
    ("head", "head"),
    ("upper_arm_l", "upperarm_l"),
    ("forearm_l", "lowerarm_l"),
    ("hand_l", "hand_l"),
    ("thigh_l", "thigh_l"),
    ("shin_l", "calf_l"),
    ("foot_l", "foot_l"),
    ("upper_arm_r", "upperarm_r"),
    ("hand_r", "hand_r"),
    ("shin_r", "calf_r"),
    ("foot_r", "foot_r"),
];

fn model(path: &Path) -> Model {
    load_model(&RealDisk, path).unwrap()
}

fn bundled_body() -> Model {
    model(&Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/models/biped.obj"))
}

fn character(name: &str) -> Arc<Rig> {
    bundled_characters().into_iter().find(|rig| rig.about().name == name).unwrap()
}

fn bench(model: Model) -> Workbench {
    let mut bench = Workbench::new(7, "fit");
    bench.open(model, true).unwrap();
    bench.offer_templates(FitTemplates(Arc::new(bundled_characters)));
    bench
}

fn fit(bench: &mut Workbench) -> Result<Arc<FitReport>, WorkbenchError> {
    bench.fit(|_| (), &mut |_| ())
}

fn at(rig: &Rig, label: &str) -> Vec3 {
    rig.position(rig.find_label(label).unwrap_or_else(|| panic!("no joint {label}")))
}

/// Every joint of the template is in the body that it was made for, and everything else of the template is as it was.
#[test]
fn the_biped_fits_the_body_it_was_made_for() {
    let mut bench = bench(bundled_body());
    let report = fit(&mut bench).unwrap();
    assert_eq!(report.template, "biped", "{}", report.choice);
    let (template, rig) = (character("biped"), bench.rig().clone());
    let height = report.fit.height;
    let mut sum = 0.0;
    for (label, _) in JOINTS {
        let off = at(&rig, label).distance(at(&template, label)) / height;
        assert!(off < 0.04, "{label} is off by {off} of the height");
        sum += off;
    }
    assert!(sum / (JOINTS.len() as f32) < 0.015, "the mean is {}", sum / JOINTS.len() as f32);
    for label in ["hips", "chest", "head"] {
        assert!(at(&rig, label).x.abs() < 1e-6, "{label} is on neither side");
    }
    assert_eq!(rig.len(), template.len());
    for (is, was) in rig.walk().zip(template.walk()) {
        assert_eq!((is.data.uid, &is.data.label, is.parent), (was.data.uid, &was.data.label, was.parent));
        assert_eq!((is.data.group, is.data.mirror), (was.data.group, was.data.mirror));
        let tags = |joint: &rigsmith::rig::RigJoint| joint.data.tags.iter().map(|tag| tag.uid).collect::<Vec<_>>();
        assert_eq!(tags(is), tags(was));
    }
    // It builds, binds and moves.
    assert_eq!(bench.build(BuildStep::All).error, None);
    bench.skin(Default::default(), Vec::new(), &mut |_| {}).unwrap();
    bench.pose(&["hand_l.translate=(0,0.2,0.1)".parse().unwrap()]).unwrap();
    let nodes = bench.nodes().unwrap();
    let goal = nodes.iter().find(|node| &*node.node.name == "hand_ik_l").unwrap().entity.translation;
    let hand =
        nodes.iter().find(|node| node.node.label.as_deref() == Some("hand_l") && node.node.kind == NodeType::Joint);
    assert!(hand.unwrap().entity.translation.distance(goal) < 1e-3 * height);
}

/// A figure that stands along Z has controls that do, too: up is Y of its foot's control.
#[test]
fn controls_stand_as_the_figure_does() {
    let mut model = bundled_body();
    model.points.iter_mut().for_each(|point| *point = Vec3::new(point.x, -point.z, point.y));
    let mut bench = bench(model);
    let report = fit(&mut bench).unwrap();
    assert_eq!((report.fit.up, report.fit.forward), (Vec3::Z, Vec3::NEG_Y));
    assert_eq!(bench.build(BuildStep::All).error, None);
    let place = |bench: &mut Workbench, name: &str| {
        let nodes = bench.nodes().unwrap();
        let node = nodes.iter().find(|node| &*node.node.name == name).unwrap_or_else(|| panic!("no node {name}"));
        node.entity.translation
    };
    for control in ["root", "foot_ik_l"] {
        let before = place(&mut bench, control);
        let by = |offset: &str| format!("{control}.translate={offset}").parse().unwrap();
        bench.pose(&[by("(0,0.2,0)")]).unwrap();
        let moved = place(&mut bench, control) - before;
        assert!(moved.distance(Vec3::new(0.0, 0.0, 0.2)) < 1e-3, "{control} is moved by {moved}");
        bench.pose(&[by("(0,0,0)")]).unwrap();
    }
}

/// One step of the history; undone, the rig has the first bytes again. The same input gives the same bytes.
#[test]
fn a_fit_is_one_step_and_repeats_exactly() {
    let texts: Vec<String> = (0..2)
        .map(|_| {
            let mut bench = bench(bundled_body());
            let before = write_template(bench.rig());
            fit(&mut bench).unwrap();
            let text = write_template(bench.rig());
            let answers = bench.gestures(vec![Gesture::Undo]);
            assert!(answers[0].done, "{answers:?}");
            assert_eq!(write_template(bench.rig()), before);
            text
        })
        .collect();
    assert_eq!(texts[0], texts[1]);
}

/// A joint that is moved stays where it was put, the others of its limb follow, and the legs stay where they are.
#[test]
fn a_moved_joint_is_a_marker() {
    let mut bench = bench(bundled_body());
    fit(&mut bench).unwrap();
    let before = bench.rig().clone();
    let elbow = before.find_label("forearm_l").unwrap();
    let to = before.position(elbow) + Vec3::new(0.03, 0.04, 0.0);
    bench.operate(Operation::Move { to: vec![(elbow, to)], with_children: false }).unwrap();
    bench.operate(Operation::Edits(Vec::new())).unwrap();
    let after = bench.rig().clone();
    assert!(after.position(elbow).distance(to) < 1e-4, "{} is not {to}", after.position(elbow));
    for label in ["shin_l", "shin_r", "foot_r"] {
        let moved = at(&after, label).distance(at(&before, label));
        assert!(moved < 0.02, "{label} moved by {moved}");
    }
}

/// The other side of a symmetric figure goes along with a joint that is put right, and says so; left and right that are fitted
/// apart, and a joint that is put outside of the mesh, move alone.
#[test]
fn a_moved_joint_takes_its_partner_along() {
    let image = |place: Vec3| place * Vec3::new(-1.0, 1.0, 1.0);
    let moved = |symmetry: FitSymmetry, by: Vec3| {
        let mut bench = bench(bundled_body());
        let report = bench.fit(|request| request.symmetry = symmetry, &mut |_| ()).unwrap();
        let before = bench.rig().clone();
        let knee = before.find_label("shin_l").unwrap();
        let to = before.position(knee) + by;
        bench.operate(Operation::Move { to: vec![(knee, to)], with_children: false }).unwrap();
        bench.operate(Operation::Edits(Vec::new())).unwrap();
        assert!(bench.rig().position(knee).distance(to) < 1e-4 * report.fit.height, "{symmetry:?}");
        (before, bench.rig().clone(), to)
    };
    let (before, after, to) = moved(FitSymmetry::Auto, Vec3::new(0.0, 0.04, 0.0));
    let off = at(&after, "shin_r").distance(image(to));
    assert!(off < 0.004, "the right knee is {off} off the image of the left one");
    let [left, right] = ["foot_l", "foot_r"].map(|foot| at(&after, foot));
    assert!(left.distance(image(right)) < 0.006, "{left} and {right}");
    assert!(at(&after, "forearm_l").distance(at(&before, "forearm_l")) < 0.02, "arms stay");

    // The model of bodies has legs of one length, so that the other knee follows on its own leg.
    let (_, after, to) = moved(FitSymmetry::Off, Vec3::new(0.0, 0.04, 0.0));
    let off = at(&after, "shin_r").distance(image(to));
    assert!(off > 0.006, "fitted apart, the right knee is {off} off the image of the left one");

    let (before, after, _) = moved(FitSymmetry::Auto, Vec3::new(0.35, 0.0, 0.0));
    let went = at(&after, "shin_r").distance(at(&before, "shin_r"));
    assert!(went < 0.02, "of a place in the air, the right knee went {went}");
}

/// A place for a joint by the command is one for its partner, which is trusted for that reason.
#[test]
fn a_marker_is_one_for_both_sides() {
    let mut bench = bench(bundled_body());
    let plain = fit(&mut bench).unwrap();
    let at = |report: &FitReport, label: &str| {
        let joint = report.joints.iter().position(|(_, known)| known == label).unwrap();
        report.fit.joints[joint]
    };
    let place = at(&plain, "shin_l").position + Vec3::new(0.0, 0.03, 0.0);
    let mut bench = self::bench(bundled_body());
    let report = bench.fit(|request| request.markers = vec![("shin_l".to_owned(), place)], &mut |_| ()).unwrap();
    let (left, right) = (at(&report, "shin_l"), at(&report, "shin_r"));
    assert_eq!((left.position, left.reason, right.reason), (place, FitReason::Marker, FitReason::Partner));
    assert_eq!(right.confidence, 1.0);
    let off = right.position.distance(place * Vec3::new(-1.0, 1.0, 1.0));
    assert!(off < 0.004, "{off}");
    // A place of its own goes before that of its partner.
    let own = at(&plain, "shin_r").position;
    let markers = vec![("shin_l".to_owned(), place), ("shin_r".to_owned(), own)];
    let mut bench = self::bench(bundled_body());
    let report = bench.fit(|request| request.markers = markers, &mut |_| ()).unwrap();
    assert_eq!((at(&report, "shin_l").position, at(&report, "shin_r").position), (place, own));
}

/// Whatever a person adds after a fit stays: other edits accept the fit, and joints that are moved then move alone. Of
/// corrections that were undone nothing comes back.
#[test]
fn corrections_take_nothing_back() {
    let mut bench = bench(bundled_body());
    fit(&mut bench).unwrap();
    let fitted = bench.rig().clone();
    let (elbow, knee) = (fitted.find_label("forearm_l").unwrap(), fitted.find_label("shin_r").unwrap());
    let moved = |rig: &Rig, joint| rig.position(joint) + Vec3::new(0.02, 0.03, 0.0);
    let shift = |joint, to| Operation::Move { to: vec![(joint, to)], with_children: false };
    let settle = |bench: &mut Workbench| bench.operate(Operation::Edits(Vec::new())).unwrap();
    bench.operate(shift(elbow, moved(&fitted, elbow))).unwrap();
    settle(&mut bench);
    assert!(bench.gestures(vec![Gesture::Undo, Gesture::Undo]).iter().all(|answer| answer.done));
    assert!(bench.rig().position(elbow).distance(fitted.position(elbow)) < 1e-5, "both steps are undone");
    let to = moved(&fitted, knee);
    bench.operate(shift(knee, to)).unwrap();
    settle(&mut bench);
    assert!(bench.rig().position(knee).distance(to) < 1e-4);
    let back = bench.rig().position(elbow).distance(moved(&fitted, elbow));
    assert!(back > 0.02, "the undone marker is {back} away");

    // A joint and a tag of one's own, and then a move: nothing follows any more, and both stay.
    let own =
        rigsmith::rig::JointData { uid: rigsmith::rig::Uid(0x77), label: Some("tip".into()), ..Default::default() };
    let add = rigsmith::rig::RigEdit::AddJoint { joint: Box::new(own), parent: Some(elbow), index: usize::MAX };
    bench.operate(Operation::Edits(vec![add])).unwrap();
    settle(&mut bench);
    let before = bench.rig().clone();
    bench.operate(shift(elbow, moved(&before, elbow))).unwrap();
    settle(&mut bench);
    assert!(bench.rig().find_label("tip").is_some());
    let hand = before.find_label("hand_l").unwrap();
    assert!(bench.rig().position(hand).distance(before.position(hand)) < 1e-5, "the fit was accepted");
}

/// Gestures fit as the window does, by name or by choice; a template that does not exist is told with the nearest name.
#[test]
fn gestures_fit() {
    let mut bench = bench(bundled_body());
    let answers = bench.gestures(vec![
        Gesture::Fit { template: Some("biqed".into()) },
        Gesture::Fit { template: Some("biped".into()) },
        Gesture::SelectLabel("hand_l".into()),
    ]);
    assert!(!answers[0].done && answers[0].message.contains("\"biped\""), "{answers:?}");
    assert!(answers[1].done && answers[1].joints_added == character("biped").len(), "{answers:?}");
    assert!(answers[2].done, "{answers:?}");
}

/// A hand of the bundled body and the end of its forearm: the left one for 1, the right one for -1.
fn hand_mesh(side: f32) -> Model {
    let mut model = bundled_body();
    for part in &mut model.parts {
        let is_of_hand = |corner: &u32| side * model.points[part.vertices[*corner as usize] as usize].x > 0.5;
        part.triangles.retain(|corners| corners.iter().all(is_of_hand));
        part.faces.starts = (0..=part.triangles.len() as u32).map(|face| 3 * face).collect();
        part.faces.corners = part.triangles.concat();
    }
    model
}

/// The hand as a skeleton of its own is that of the side that the mesh shows, by its name and by choice.
#[test]
fn hands_are_of_their_side() {
    for (side, ending) in [(1.0, "_l"), (-1.0, "_r")] {
        for template in [FitTemplate::Named("hand".into()), FitTemplate::Choose] {
            let mut bench = bench(hand_mesh(side));
            let report = bench.fit(|request| request.template = template.clone(), &mut |_| ()).unwrap();
            assert_eq!(report.template, "hand", "{}", report.choice);
            let labels: Vec<&str> = report.joints.iter().map(|(_, label)| label.as_str()).collect();
            assert!(labels.iter().all(|label| label.ends_with(ending)), "{template:?} {labels:?}");
            assert!(at(bench.rig(), labels[0]).x * side > 0.0);
        }
    }
}

/// A part is a skeleton of its own in an empty rig, and comes below the selected joint of another one.
#[test]
fn gestures_fit_parts() {
    let mut bench = bench(hand_mesh(1.0));
    bench.offer_parts(FitParts(Arc::new(bundled_part)));
    let fit = || Gesture::Fit { template: Some("parts/hand".into()) };
    let answers = bench.gestures(vec![Gesture::Fit { template: Some("parts/hund".into()) }, fit(), Gesture::Undo]);
    assert!(!answers[0].done && answers[0].message.contains("parts/hund"), "{answers:?}");
    assert!(answers[1].done && answers[1].joints_added == 16, "{answers:?}");
    assert!(bench.rig().is_empty());

    let biped = character("biped");
    let positions = vec![at(&biped, "upper_arm_l"), at(&biped, "forearm_l")];
    bench.operate(Operation::Chain { positions, parent: None }).unwrap();
    let arm: Vec<_> = bench.rig().walk().map(|joint| joint.data.uid).collect();
    bench.operate(Operation::Labels(vec![(arm[1], "forearm_l".into())])).unwrap();
    let before = write_template(bench.rig());
    let answers = bench.gestures(vec![Gesture::SelectLabel("forearm_l".into()), fit()]);
    assert!(answers.iter().all(|answer| answer.done), "{answers:?}");
    let rig = bench.rig();
    let hand = rig.find_label("hand_l").unwrap();
    assert_eq!((rig.len(), rig.joint(hand).unwrap().parent), (18, Some(arm[1])));
    let mut sum = 0.0;
    for joint in rig.walk().filter(|joint| !arm.contains(&joint.data.uid)) {
        let label = joint.data.label.as_deref().unwrap();
        let off = at(rig, label).distance(at(&biped, label));
        println!("{label} is off by {off:.4}");
        assert!(off < 0.025, "{label} is off by {off}");
        sum += off;
    }
    // The hand is 0.2 long; without the arm the mean is 0.0086.
    assert!(sum / 16.0 < 0.0125, "{}", sum / 16.0);
    assert!(bench.gestures(vec![Gesture::Undo])[0].done);
    assert_eq!(write_template(bench.rig()), before);
}

/// A rig with joints of its own has those moved: a template that a person opened and changed stays what it is.
#[test]
fn own_joints_are_moved() {
    let mut bench = Workbench::with_rig(7, (*character("biped")).clone());
    let mut body = bundled_body();
    body.points.iter_mut().for_each(|point| *point = *point * 0.5 + Vec3::new(3.0, 1.0, 0.0));
    bench.open(body, true).unwrap();
    let report = fit(&mut bench).unwrap();
    let template = character("biped");
    for (label, _) in JOINTS {
        let wanted = at(&template, label) * 0.5 + Vec3::new(3.0, 1.0, 0.0);
        let off = at(bench.rig(), label).distance(wanted) / report.fit.height;
        assert!(off < 0.04, "{label} is off by {off} of the height");
    }
    // Lengths in commands follow: the root's control stands on the floor below the figure.
    assert_eq!(bench.build(BuildStep::All).error, None);
    let nodes = bench.nodes().unwrap();
    let root = nodes.iter().find(|node| &*node.node.name == "root").unwrap().entity.translation;
    assert!((root.y - 1.0).abs() < 0.02 * report.fit.height, "the root stands at {root}");
}

/// Meshes that cannot be fitted are refused with a reason, and nothing changes.
#[test]
fn meshes_without_a_figure_are_refused() {
    let triangle = crate::gestures::boxes(&[[[0.0; 3], [1.0, 1.0, 1.0]]]);
    let mut flat = triangle.clone();
    flat.points.iter_mut().for_each(|point| point.z = 0.0);
    for (name, model) in [("a plane", flat), ("nothing", Model::default())] {
        let mut bench = bench(model);
        let result = fit(&mut bench);
        let is_told =
            matches!(&result, Err(WorkbenchError::Fit(FitFailure::Fit(FitError::Flat | FitError::NoSurface))));
        assert!(is_told, "{name}: {:?}", result.map(|report| report.template.clone()));
        assert!(bench.rig().is_empty(), "{name}");
    }
    // A box shows no limbs: refused, or fitted without confidence.
    let mut bench = bench(triangle);
    match fit(&mut bench) {
        Ok(report) => {
            assert!(report.fit.confidence < 0.5, "a box is a {} with {}", report.template, report.fit.confidence)
        }
        Err(error) => assert!(bench.rig().is_empty(), "{error}"),
    }
}

/// The bodies of the test data, whose joints are known.
#[test]
fn bodies_are_fitted() {
    let Some(data) = test_data() else { return };
    let mut table = BTreeMap::new();
    for name in BODIES {
        let folder = data.join("bodies").join(name);
        let truth: serde_json::Value =
            serde_json::from_slice(&std::fs::read(folder.join("joints.json")).unwrap()).unwrap();
        let mut bench = bench(model(&folder.join("body.obj")));
        let report = fit(&mut bench).unwrap();
        assert_eq!(report.template, "biped", "{name}: {}", report.choice);
        let (mut sum, mut worst) = (0.0, (0.0, ""));
        for (label, bone) in JOINTS {
            let head: Vec<f32> = serde_json::from_value(truth["game_engine"][bone]["head"].clone()).unwrap();
            let off = at(bench.rig(), label).distance(Vec3::new(head[0], head[1], head[2])) / report.fit.height;
            sum += off;
            if off > worst.0 {
                worst = (off, label);
            }
        }
        let mean = sum / JOINTS.len() as f32;
        println!("{name}: mean {:.2} %, worst {} {:.2} %", mean * 100.0, worst.1, worst.0 * 100.0);
        table.insert(name, (mean, worst));
    }
    for (name, (mean, (worst, label))) in table {
        assert!(mean <= 0.015 && worst <= 0.04, "{name}: mean {mean}, {label} {worst}");
    }
}

/// A request for a template that the mesh cannot be is answered with what the mesh shows.
#[test]
fn a_given_template_is_taken() {
    let mut bench = bench(bundled_body());
    let hand = character("hand");
    let result = bench.fit(|request| request.template = FitTemplate::Rig(hand), &mut |_| ());
    if let Ok(report) = result {
        assert_eq!(report.template, "hand");
    }
}

/// A block, which is solid all through, is looked at in about as many cells as a body.
#[test]
fn blocks_take_as_few_cells_as_bodies() {
    let cells = |model: &Model| {
        MeshAnalysis::new(&model.points, &model.point_triangles(), None, &|_| true).map(|analysis| analysis.cells())
    };
    let body = cells(&bundled_body()).unwrap();
    let block = cells(&crate::gestures::boxes(&[[[0.0; 3], [1.0; 3]]])).unwrap();
    assert!(block < 2 * body, "{block} cells of a block, {body} of a body");
}
