//! Limits of an app with rigs: a resource that builds, background jobs and gesture lists obey.

use std::path::Path;

use bevy::prelude::*;
use rigsmith::{
    files::{RealDisk, load_model},
    mesh::model::Model,
    plugins::{
        commands::{BuildFailure, BuildRequest, BuildResult, BuildStep},
        face::{FacePlaced, FaceRequest, PlaceFaceError},
        fit::{FitAnswer, FitFailure, FitJob, FitRequest},
        gesture::{Gesture, GestureScript},
        limits::{Limit, LimitError, OutOfTime, RigLimits},
        skinning::{BindAnswer, BindRequest, SkinningError, SkinningJob},
        surface::{RigMesh, SkinOf},
    },
    prelude::*,
    rig::template::read_template,
    test_app::test_app,
};

use crate::bench::RigBench;

const RIG: &str = r#"(format: 2, name: "n", joints: [
    (label: "root", tags: [null(), null()]),
    (label: "tip", parent: "root", translation: (0, 1, 0)),
])"#;

/// An app with limits, a rig, and the bundled biped as its mesh.
struct Bench {
    base: RigBench,
    mesh: Entity,
}

fn biped() -> Model {
    load_model(&RealDisk, &Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/models/biped.obj")).unwrap()
}

impl Bench {
    fn new(limits: RigLimits) -> Self {
        let mut app = test_app();
        app.insert_resource(limits);
        let mut base = RigBench::with(app, read_template(RIG.as_bytes()).unwrap().rig);
        let mesh = base.app.world_mut().spawn((RigMesh::new(Uid(9), biped(), Vec::new()), SkinOf(base.rig))).id();
        base.app.update();
        Self { base, mesh }
    }
}

/// The name of the limit and of the mesh that an error tells.
fn check_limit(error: &LimitError, name: &str) {
    assert_eq!(error.name, name);
    assert!(error.to_string().contains("biped") && error.to_string().contains(&format!("--limit {name}=")), "{error}");
}

#[test]
fn jobs_refuse_meshes_above_the_limits() {
    for (limit, name) in [(Limit::Points, "points"), (Limit::Triangles, "triangles")] {
        let mut bench = Bench::new(RigLimits::default().with(limit, 10));
        let mesh = bench.mesh;
        match bench.base.ask::<_, BindAnswer>(BindRequest::new(mesh)).result {
            Err(SkinningError::Limit(error)) => check_limit(&error, name),
            other => panic!("{other:?}"),
        }
        match bench.base.ask::<_, FitAnswer>(FitRequest::new(mesh)).result {
            Err(FitFailure::Limit(error)) => check_limit(&error, name),
            other => panic!("{other:?}"),
        }
        let request = FaceRequest { mesh, settings: Default::default(), fit: None };
        match bench.base.ask::<_, FacePlaced>(request).result {
            Err(PlaceFaceError::Limit(error)) => check_limit(&error, name),
            other => panic!("{other:?}"),
        }
        // With the limits that hold otherwise the same mesh is bound.
        bench.base.app.insert_resource(RigLimits::default());
        assert!(bench.base.ask::<_, BindAnswer>(BindRequest::new(mesh)).result.is_ok());
    }
}

#[test]
fn jobs_are_given_up_when_their_time_is_over() {
    let mut bench = Bench::new(RigLimits::default().with(Limit::Seconds, 0));
    let mesh = bench.mesh;
    let late = |work| OutOfTime { work, seconds: 0 };
    let text = late("binding the mesh").to_string();
    assert!(text.starts_with("binding the mesh took") && text.contains("raise the limit `seconds`"), "{text}");
    let bound = bench.base.ask::<_, BindAnswer>(BindRequest::new(mesh));
    assert_eq!(bound.result.unwrap_err(), SkinningError::OutOfTime(late("binding the mesh")));
    let fitted = bench.base.ask::<_, FitAnswer>(FitRequest::new(mesh));
    assert_eq!(fitted.result.unwrap_err(), FitFailure::OutOfTime(late("fitting the template")));
    let placed = bench.base.ask::<_, FacePlaced>(FaceRequest { mesh, settings: Default::default(), fit: None });
    assert_eq!(placed.result.unwrap_err(), PlaceFaceError::OutOfTime(late("placing the face")));
    // The jobs are gone, and the rig is as it was.
    bench.base.app.update();
    assert!(bench.base.get::<SkinningJob>(mesh).is_none() && bench.base.get::<FitJob>(mesh).is_none());
    let rig = bench.base.rig();
    assert!(rig.skins().next().is_none() && rig.len() == 2);
}

#[test]
fn builds_obey_the_limits_of_the_app() {
    let mut bench = Bench::new(RigLimits::default().with(Limit::Nodes, 1));
    let build = |bench: &mut Bench| {
        bench.base.step(BuildStep::All);
        bench.base.app.update();
        let failure = bench.base.get::<BuildFailure>(bench.base.rig).map(|failure| failure.0.to_string());
        let made = bench.base.get::<BuildResult>(bench.base.rig).map(|built| built.0.nodes.len());
        (failure, made)
    };
    let (failure, _) = build(&mut bench);
    assert!(failure.as_ref().is_some_and(|failure| failure.contains("nodes")), "{failure:?}");
    // Limits that are set anew hold from the next start of a build.
    bench.base.app.insert_resource(RigLimits::default());
    bench.base.app.update();
    bench.base.app.world_mut().write_message(BuildRequest { rig: bench.base.rig, step: BuildStep::Restart });
    let (failure, made) = build(&mut bench);
    assert_eq!(failure, None);
    assert!(made.is_some_and(|made| made >= 4), "{made:?}");
}

/// The window, `watch` and games build in an app: what they build ends with its time, and says where.
#[test]
fn builds_of_an_app_are_given_up_when_their_time_is_over() {
    let mut bench = Bench::new(RigLimits::default().with(Limit::Seconds, 0));
    let rig = bench.base.rig;
    let failure = |bench: &Bench| bench.base.get::<BuildFailure>(rig).map(|failure| failure.0.to_string());
    bench.base.step(BuildStep::All);
    bench.base.app.update();
    let told = failure(&bench).unwrap_or_default();
    for wanted in ["null", "root", "building the rig took longer than 0 s", "raise the limit `seconds`"] {
        assert!(told.contains(wanted), "{wanted}: {told}");
    }
    // The time is that of one build, however long the app has been open.
    bench.base.app.insert_resource(RigLimits::default());
    bench.base.app.update();
    for step in [BuildStep::Restart, BuildStep::All] {
        bench.base.step(step);
        bench.base.app.update();
    }
    assert_eq!(failure(&bench), None);
    assert!(bench.base.built().nodes.len() >= 4);
}

#[test]
fn lists_of_gestures_obey_the_limits() {
    let limits = RigLimits::default().with(Limit::Gestures, 2).with(Limit::StrokePoints, 2);
    let mut bench = Bench::new(limits);
    let long = Gesture::Stroke { points: vec![(0.0, 0.2), (0.0, 0.3), (0.0, 0.5)], threshold: None, joints: None };
    let gestures = [long, Gesture::SelectAll, Gesture::Deselect, Gesture::SelectAll];
    bench.base.app.world_mut().entity_mut(bench.base.rig).insert(GestureScript::new(gestures));
    bench.base.wait("the end of the list", |bench| bench.get::<GestureScript>(bench.rig).unwrap().is_done());
    let answers = &bench.base.get::<GestureScript>(bench.base.rig).unwrap().answers;
    let told: Vec<(bool, &str)> = answers.iter().map(|answer| (answer.done, answer.message.as_str())).collect();
    assert_eq!(told.len(), 3, "{told:?}");
    assert!(!told[0].0 && told[0].1.contains("has 3 points") && told[0].1.contains("stroke_points"), "{told:?}");
    assert!(told[1].0, "{told:?}");
    assert!(!told[2].0 && told[2].1.contains("--limit gestures="), "{told:?}");
}

#[test]
fn every_limit_has_a_name_and_can_be_set() {
    let mut limits = RigLimits::default();
    for (number, limit) in Limit::all().enumerate() {
        assert_eq!(Limit::named(limit.name()), Some(limit));
        assert_eq!(limits.get(limit), limit.default_value());
        limits.set(limit, number as u64);
    }
    assert!(Limit::all().enumerate().all(|(number, limit)| limits.get(limit) == number as u64));
    assert_eq!(Limit::named("nothing"), None);
}
