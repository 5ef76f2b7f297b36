//! Limits of an app with rigs: a resource that builds, background jobs and gesture lists obey.

use std::{path::Path, time::Instant};

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

use crate::bench::HANG;

const RIG: &str = r#"(format: 2, name: "n", joints: [
    (label: "root", tags: [null(), null()]),
    (label: "tip", parent: "root", translation: (0, 1, 0)),
])"#;

/// An app with limits, a rig, and the bundled biped as its mesh.
struct Bench {
    app: App,
    rig: Entity,
    mesh: Entity,
}

fn biped() -> Model {
    load_model(&RealDisk, &Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/models/biped.obj")).unwrap()
}

impl Bench {
    fn new(limits: RigLimits) -> Self {
        let mut app = test_app();
        app.insert_resource(limits);
        let rig = app.world_mut().spawn(read_template(RIG.as_bytes()).unwrap().rig).id();
        let mesh = app.world_mut().spawn((RigMesh::new(Uid(9), biped(), Vec::new()), SkinOf(rig))).id();
        app.update();
        Self { app, rig, mesh }
    }

    /// Sends a request and waits for the answer.
    fn ask<Q: Message, A: Message + Clone>(&mut self, request: Q) -> A {
        self.app.world_mut().write_message(request);
        let start = Instant::now();
        loop {
            self.app.update();
            if let Some(answer) = self.app.world_mut().resource_mut::<Messages<A>>().drain().last() {
                return answer;
            }
            assert!(start.elapsed() < HANG, "no answer");
            std::thread::sleep(std::time::Duration::from_millis(2));
        }
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
        match bench.ask::<_, BindAnswer>(BindRequest::new(mesh)).result {
            Err(SkinningError::Limit(error)) => check_limit(&error, name),
            other => panic!("{other:?}"),
        }
        match bench.ask::<_, FitAnswer>(FitRequest::new(mesh)).result {
            Err(FitFailure::Limit(error)) => check_limit(&error, name),
            other => panic!("{other:?}"),
        }
        let request = FaceRequest { mesh, settings: Default::default(), fit: None };
        match bench.ask::<_, FacePlaced>(request).result {
            Err(PlaceFaceError::Limit(error)) => check_limit(&error, name),
            other => panic!("{other:?}"),
        }
        // With the limits that hold otherwise the same mesh is bound.
        bench.app.insert_resource(RigLimits::default());
        assert!(bench.ask::<_, BindAnswer>(BindRequest::new(mesh)).result.is_ok());
    }
}

#[test]
fn jobs_are_given_up_when_their_time_is_over() {
    let mut bench = Bench::new(RigLimits::default().with(Limit::Seconds, 0));
    let mesh = bench.mesh;
    let late = |work| OutOfTime { work, seconds: 0 };
    let text = late("binding the mesh").to_string();
    assert!(text.starts_with("binding the mesh took") && text.contains("raise the limit `seconds`"), "{text}");
    let bound = bench.ask::<_, BindAnswer>(BindRequest::new(mesh));
    assert_eq!(bound.result.unwrap_err(), SkinningError::OutOfTime(late("binding the mesh")));
    let fitted = bench.ask::<_, FitAnswer>(FitRequest::new(mesh));
    assert_eq!(fitted.result.unwrap_err(), FitFailure::OutOfTime(late("fitting the template")));
    let placed = bench.ask::<_, FacePlaced>(FaceRequest { mesh, settings: Default::default(), fit: None });
    assert_eq!(placed.result.unwrap_err(), PlaceFaceError::OutOfTime(late("placing the face")));
    // The jobs are gone, and the rig is as it was.
    bench.app.update();
    assert!(bench.app.world().get::<SkinningJob>(mesh).is_none() && bench.app.world().get::<FitJob>(mesh).is_none());
    let rig = bench.app.world().get::<Rig>(bench.rig).unwrap();
    assert!(rig.skins().next().is_none() && rig.len() == 2);
}

#[test]
fn builds_obey_the_limits_of_the_app() {
    let mut bench = Bench::new(RigLimits::default().with(Limit::Nodes, 1));
    let build = |bench: &mut Bench| {
        bench.app.world_mut().write_message(BuildRequest { rig: bench.rig, step: BuildStep::All });
        bench.app.update();
        bench.app.update();
        let failure = bench.app.world().get::<BuildFailure>(bench.rig).map(|failure| failure.0.to_string());
        let made = bench.app.world().get::<BuildResult>(bench.rig).map(|built| built.0.nodes.len());
        (failure, made)
    };
    let (failure, _) = build(&mut bench);
    assert!(failure.as_ref().is_some_and(|failure| failure.contains("nodes")), "{failure:?}");
    // Limits that are set anew hold from the next start of a build.
    bench.app.insert_resource(RigLimits::default());
    bench.app.update();
    bench.app.world_mut().write_message(BuildRequest { rig: bench.rig, step: BuildStep::Restart });
    let (failure, made) = build(&mut bench);
    assert_eq!(failure, None);
    assert!(made.is_some_and(|made| made >= 4), "{made:?}");
}

#[test]
fn lists_of_gestures_obey_the_limits() {
    let limits = RigLimits::default().with(Limit::Gestures, 2).with(Limit::StrokePoints, 2);
    let mut bench = Bench::new(limits);
    let long = Gesture::Stroke { points: vec![(0.0, 0.2), (0.0, 0.3), (0.0, 0.5)], threshold: None, joints: None };
    let gestures = [long, Gesture::SelectAll, Gesture::Deselect, Gesture::SelectAll];
    bench.app.world_mut().entity_mut(bench.rig).insert(GestureScript::new(gestures));
    let start = Instant::now();
    while !bench.app.world().get::<GestureScript>(bench.rig).unwrap().is_done() {
        bench.app.update();
        assert!(start.elapsed() < HANG, "the list never ends");
    }
    let answers = &bench.app.world().get::<GestureScript>(bench.rig).unwrap().answers;
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
