//! Choice of a template for figures in turned files, by directions and markers, and doubt about assignments of limbs.

use std::{path::Path, sync::Arc};

use bevy::math::Vec3;
use rigsmith::{
    algo::fit_template::FitReason,
    files::{RealDisk, bundled_characters, load_model},
    headless::Workbench,
    mesh::model::Model,
    plugins::fit::{FitReport, FitRequest, FitTemplate, FitTemplates},
};

use crate::prerequisites::test_data;

fn fitted(model: Model, ask: impl Fn(&mut FitRequest)) -> Arc<FitReport> {
    let mut bench = Workbench::new(7, "choice");
    bench.open(model, true).unwrap();
    bench.offer_templates(FitTemplates(Arc::new(bundled_characters)));
    let choose = |request: &mut FitRequest| {
        request.template = FitTemplate::Choose;
        ask(request);
    };
    bench.fit(choose, &mut |_| ()).unwrap()
}

fn turned(path: &Path, turn: impl Fn(Vec3) -> Vec3) -> Model {
    let mut model = load_model(&RealDisk, path).unwrap().at_rest();
    model.weights = None;
    model.points.iter_mut().for_each(|point| *point = turn(*point));
    model
}

/// A cow stands on four legs whichever way its file is turned, with and without a word about up.
#[test]
fn a_turned_cow_gets_the_template_of_an_animal() {
    let Some(data) = test_data() else { return };
    let path = data.join("creatures/spot.obj");
    let turns: [(&str, fn(Vec3) -> Vec3); 6] = [
        ("Y up", |p| p),
        ("Z up", |p| Vec3::new(p.x, -p.z, p.y)),
        ("X up", |p| Vec3::new(p.y, -p.x, p.z)),
        ("Y down", |p| Vec3::new(-p.x, -p.y, p.z)),
        ("Z up, about", |p| Vec3::new(-p.x, p.z, p.y)),
        ("Z down", |p| Vec3::new(p.x, p.z, -p.y)),
    ];
    for (name, turn) in turns {
        let report = fitted(turned(&path, turn), |_| ());
        assert_eq!(report.template, "quadruped", "{name}: {}", report.choice);
        let up = turn(Vec3::Y);
        let report = fitted(turned(&path, turn), |request| request.up = Some(up));
        assert_eq!(report.template, "quadruped", "{name}, up given: {}", report.choice);
        assert!(report.fit.up.distance(up) < 1e-4, "{name}: {}", report.fit.up);
    }
}

/// Turned or not, bodies are bipeds without a doubt.
#[test]
fn a_turned_body_is_a_biped() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/models/biped.obj");
    let turns: [fn(Vec3) -> Vec3; 3] = [|p| p, |p| Vec3::new(p.x, -p.z, p.y), |p| Vec3::new(p.y, -p.x, p.z)];
    for turn in turns {
        let report = fitted(turned(&path, turn), |_| ());
        assert_eq!(report.template, "biped", "{}", report.choice);
        assert!(report.fit.confidence > 0.9, "{}", report.fit.confidence);
        assert!(report.fit.joints.iter().all(|joint| joint.reason != FitReason::Ambiguous));
    }
}

/// A marker of a joint that only one template has chooses that template.
#[test]
fn markers_choose_a_template() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/models/biped.obj");
    let report = fitted(turned(&path, |p| p), |request| {
        request.markers = vec![("wing_1_l".to_owned(), Vec3::new(0.2, 1.4, 0.0))];
    });
    assert_eq!(report.template, "bird", "{}", report.choice);
}

/// The robot of the test data has another branch that is nearly as good an arm: joints of the arms are doubted for it.
#[test]
fn joints_that_another_assignment_has_elsewhere_are_doubted() {
    let Some(data) = test_data() else { return };
    let report = fitted(turned(&data.join("gltf_skinned/RobotExpressive.glb"), |p| p), |_| ());
    assert_eq!(report.template, "biped", "{}", report.choice);
    let doubted: Vec<&str> = (report.joints.iter().zip(&report.fit.joints))
        .filter(|(_, joint)| joint.reason == FitReason::Ambiguous)
        .map(|((_, label), _)| label.as_str())
        .collect();
    assert!(doubted.contains(&"forearm_l"), "{doubted:?}");
    assert!(!doubted.iter().any(|label| label.starts_with("foot")), "{doubted:?}");
}
