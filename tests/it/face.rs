//! Faces through the plugins: one edit, undone and redone; touched bones stay; expressions are poses; bodies lend a head.

use std::{
    collections::{BTreeMap, BTreeSet},
    path::PathBuf,
    sync::Arc,
};

use bevy::prelude::*;
use rigsmith::{
    algo::face::{
        auto::{AutoSettings, FaceError, FaceStep},
        bones::FaceBoneKind,
    },
    files::{RealDisk, load_model},
    headless::Workbench,
    mesh::{model::Model, shapes::Shapes},
    plugins::{
        document::{Change, EditRequest},
        face::{
            ExpressError, ExpressionAnswer, Expressions, FaceJob, FacePlaced, FaceRequest, FaceRig, PlaceFaceError,
        },
        gesture::Gesture,
        history::RigHistory,
        surface::RigMesh,
    },
    rig::{NodeKind, Rig, Uid, operations::Operation},
};

use crate::{
    bench::{begin_drag, new_clip, undo_meanwhile, wait},
    heads,
    prerequisites::test_data,
};

/// A file of the test data; `None`, with a word, where there is none.
fn data(name: &str) -> Option<Model> {
    Some(heads::model(&test_data()?.join(name)))
}

fn bundled(name: &str) -> Model {
    load_model(&RealDisk, &PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("assets/models").join(name)).unwrap()
}

fn bench(model: Model) -> Workbench {
    let mut bench = Workbench::new(1, "face");
    bench.open(model, false).unwrap();
    bench
}

fn settings(bones: usize) -> AutoSettings {
    AutoSettings { bones, ..AutoSettings::default() }
}

fn place(bench: &mut Workbench, bones: usize) -> rigsmith::plugins::face::FaceReport {
    bench.face(settings(bones), None, &mut |_, _| {}).unwrap()
}

fn undo(bench: &mut Workbench) {
    let rig = bench.rig_entity();
    bench.app_mut().world_mut().write_message(EditRequest { rig, change: Change::Undo });
    bench.app_mut().update();
}

/// Weights sum to one, name joints that are there, and every point has some.
fn check_weights(bench: &Workbench) {
    let skin = bench.weights().expect("the mesh is skinned");
    assert_eq!(skin.weights.len(), bench.mesh().unwrap().rest.points.len());
    for point in 0..skin.weights.len() {
        let sum: f32 = skin.weights.of(point).map(|(_, weight)| weight).sum();
        assert!((sum - 1.0).abs() < 1e-4, "point {point} sums to {sum}");
        assert!(skin.weights.of(point).len() <= 8, "point {point}");
    }
    assert!(skin.joints.iter().all(|joint| bench.rig().joint(*joint).is_some()));
}

#[test]
fn the_bundled_head_gets_a_face() {
    let mut bench = bench(bundled("head.obj"));
    let empty = bench.rig().clone();
    let mut steps = BTreeSet::new();
    let report = bench
        .face(settings(24), None, &mut |step: FaceStep, part| {
            assert!((0.0..=1.0).contains(&part));
            steps.insert(step);
        })
        .unwrap();
    let rig = bench.rig();
    let known = FaceRig::read(rig);
    assert_eq!(report.bones.iter().filter(|bone| bone.kind == FaceBoneKind::Skin).count(), 24);
    assert_eq!(known.bones.len(), report.bones.len());
    assert!(known.bones.iter().all(|bone| !bone.touched), "nobody has touched anything");
    assert!(known.neck.is_some() && known.head.is_some());
    assert!(report.times.iter().any(|(step, _)| *step == "weights"));
    check_weights(&bench);
    // Bones have a control with limits, and one switch turns all of them off.
    let controls = rig.walk().flat_map(|joint| &joint.data.tags).filter(|tag| {
        matches!(&tag.kind, rigsmith::rig::TagKind::Command { module, params, feature: Some(_) }
            if module == "control" && params.contains("limits"))
    });
    assert_eq!(controls.count(), report.bones.len());
    let built = rigsmith::processor::Builder::build(rig, &Arc::new(rigsmith::modules::all())).unwrap();
    assert!(built.nodes.len() >= rig.len() + report.bones.len(), "each bone has its control");

    // One step, and exactly back.
    let placed = rig.clone();
    undo(&mut bench);
    assert_eq!(*bench.rig(), empty, "one undo takes all of it away");
    let entity = bench.rig_entity();
    bench.app_mut().world_mut().write_message(EditRequest { rig: entity, change: Change::Redo });
    bench.app_mut().update();
    assert_eq!(*bench.rig(), placed);
}

#[test]
fn the_same_seed_gives_the_same_rig() {
    let make = || {
        let mut bench = bench(bundled("head.obj"));
        place(&mut bench, 16);
        bench.rig().clone()
    };
    assert_eq!(make(), make());
}

#[test]
fn touched_bones_keep_their_uid_and_place() {
    let mut bench = bench(bundled("head.obj"));
    place(&mut bench, 12);
    let before = FaceRig::read(bench.rig());
    let skin: Vec<Uid> =
        before.bones.iter().filter(|bone| bone.kind == FaceBoneKind::Skin).map(|bone| bone.uid).collect();
    let (moved, renamed, deleted) = (skin[0], skin[3], skin[5]);
    let to = bench.rig().position(moved) + Vec3::new(0.002, 0.001, 0.0);
    bench.operate(Operation::Move { to: vec![(moved, to)], with_children: true }).unwrap();
    bench.operate(Operation::Labels(vec![(renamed, "dimple".to_owned())])).unwrap();
    bench.operate(Operation::Delete { joints: vec![deleted], keep_children: false }).unwrap();
    let added_at = bench.rig().position(skin[1]) + Vec3::new(0.0, 0.004, 0.001);
    bench.operate(Operation::Place { position: added_at, parent: before.head }).unwrap();
    let added = bench.rig().children(before.head).last().copied().unwrap();
    bench.operate(Operation::Group { joints: vec![added], name: "face".to_owned(), color: None }).unwrap();

    let report = place(&mut bench, 20);
    let rig = bench.rig();
    let known = FaceRig::read(rig);
    assert_eq!(report.kept, 3);
    assert_eq!(known.bones.iter().filter(|bone| bone.kind == FaceBoneKind::Skin).count(), 20);
    for uid in [moved, renamed, added] {
        assert!(known.bones.iter().any(|bone| bone.uid == uid && bone.touched), "{uid} stays");
    }
    assert!((rig.position(moved) - to).length() < 1e-6);
    assert!((rig.position(added) - added_at).length() < 1e-6);
    assert!(rig.joint(renamed).is_some_and(|joint| joint.data.label.as_deref() == Some("dimple")));
    assert!(rig.joint(deleted).is_none());
    let others: Vec<Uid> = skin.iter().copied().filter(|uid| ![moved, renamed].contains(uid)).collect();
    assert!(others.iter().all(|uid| rig.joint(*uid).is_none()), "the others are clustered anew");
    check_weights(&bench);
    let labels: Vec<&str> = known.bones.iter().map(|bone| bone.label.as_str()).filter(|l| !l.is_empty()).collect();
    assert_eq!(labels.iter().collect::<BTreeSet<_>>().len(), labels.len(), "labels are told apart: {labels:?}");
}

#[test]
fn expressions_are_poses_and_can_be_undone() {
    let mut bench = bench(bundled("head.obj"));
    place(&mut bench, 30);
    let rest = bench.rig().clone();
    bench.express(BTreeMap::from([("happiness".to_owned(), 1.0)])).unwrap();
    let happy = bench.rig().pose().clone();
    assert!(happy.len() > 4, "{} joints move", happy.len());
    bench.express(BTreeMap::from([("happiness".to_owned(), 0.5), ("surprise".to_owned(), 0.5)])).unwrap();
    assert_ne!(*bench.rig().pose(), happy);
    undo(&mut bench);
    assert_eq!(*bench.rig().pose(), happy);
    bench.express(BTreeMap::new()).unwrap();
    assert_eq!(*bench.rig(), rest, "no expression is rest");
    let refused = bench.express(BTreeMap::from([("hapiness".to_owned(), 1.0)])).unwrap_err().to_string();
    assert!(refused.contains("happiness"), "{refused}");
    assert!(bench.express(BTreeMap::from([("joy".to_owned(), f32::NAN)])).is_err());
    // One side of a unit.
    bench.express(BTreeMap::from([("brow_outer_up_l".to_owned(), 1.0)])).unwrap();
    let plane = bench.placed_face().unwrap().analysis.landmarks.middle;
    // Bones on the plane belong to both sides.
    let beside = 0.1 * bench.placed_face().unwrap().analysis.landmarks.eye_distance();
    let furthest = |left: bool| {
        let away = |uid: &Uid| (bench.rig().position(*uid).x - plane) * if left { 1.0 } else { -1.0 };
        let own = bench.rig().pose().iter().filter(|(uid, _)| away(uid) > beside);
        own.map(|(_, offset)| offset.translation.length()).fold(0.0, f32::max)
    };
    println!("right {} of left {}", furthest(false), furthest(true));
    assert!(furthest(true) > 0.0 && furthest(false) < 0.05 * furthest(true), "only the left moves");
}

#[test]
fn an_opened_rig_shows_expressions_again() {
    let model = bundled("head.obj");
    let mut first = bench(model.clone());
    place(&mut first, 20);
    let (rig, skin) = (first.rig().clone(), first.weights().unwrap().clone());
    let mut second = Workbench::with_rig(7, rig);
    second.open(model, true).unwrap();
    second.bind(skin).unwrap();
    assert!(second.placed_face().is_none());
    second.express(BTreeMap::from([("anger".to_owned(), 1.0)])).unwrap();
    assert!(!second.rig().pose().is_empty());
}

#[test]
fn a_body_lends_its_head() {
    let mut bench = bench(bundled("biped.obj"));
    let template = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("assets/templates/biped.rig.ron");
    let rig: Rig = rigsmith::files::load_template(&RealDisk, &template).unwrap().rig;
    let mut with_rig = Workbench::with_rig(3, rig);
    with_rig.open(bundled("biped.obj"), true).unwrap();
    with_rig.skin(default(), Vec::new(), &mut |_| {}).unwrap();
    let joints = with_rig.rig().len();
    let before = with_rig.weights().unwrap().clone();
    let report = place(&mut with_rig, 16);
    assert!(report.is_part, "the bundled body is more than a head");
    assert!(report.points[0] < report.points[1]);
    let known = FaceRig::read(with_rig.rig());
    let head = with_rig.rig().find_label("head");
    assert_eq!(known.head, head, "the face hangs on the head that is there");
    assert_eq!(with_rig.rig().len(), joints + report.bones.len(), "no second skull");
    check_weights(&with_rig);
    // Feet do not feel the face.
    let after = with_rig.weights().unwrap();
    let points = &with_rig.mesh().unwrap().rest.points;
    let lowest = (0..points.len()).min_by(|a, b| points[*a].y.total_cmp(&points[*b].y)).unwrap();
    let named = |skin: &rigsmith::rig::SkinData| -> Vec<(Uid, u32)> {
        skin.weights.of(lowest).map(|(joint, w)| (skin.joints[joint as usize], (w * 1e4) as u32)).collect()
    };
    assert_eq!(named(&before), named(after));

    // Without a rig the head part gets neck and head of its own.
    let report = place(&mut bench, 16);
    assert!(report.is_part);
    check_weights(&bench);
}

#[test]
fn a_face_fits_shapes() {
    let model = bundled("head.obj");
    let points = model.points.clone();
    let mut bench = bench(model);
    place(&mut bench, 14);
    let analysis = bench.placed_face().unwrap().analysis.clone();
    let lip = analysis.to_mesh() * analysis.landmarks.points[51];
    let reach = 0.3 * analysis.landmarks.eye_distance();
    let raised: Vec<Vec3> =
        points.iter().map(|point| Vec3::Y * (0.2 * reach * (1.0 - point.distance(lip) / reach).max(0.0))).collect();
    let shapes = Shapes { names: vec!["sneer".to_owned()], displacements: vec![raised.clone()] };
    let report = bench.face(settings(14), Some(Arc::new(shapes)), &mut |_, _| {}).unwrap();
    let mean = (raised.iter().map(|moved| moved.length_squared()).sum::<f32>() / points.len() as f32).sqrt();
    let error = report.fit_error.unwrap();
    assert!(error < 0.35 * mean, "error {error} of {mean}");
    assert_eq!(bench.rig().stored_poses().len(), 1);
    assert_eq!(bench.rig().stored_poses()[0].name, "sneer");
    check_weights(&bench);
    // Shapes of another mesh are refused in words.
    let short = Shapes { names: vec!["short".to_owned()], displacements: vec![vec![Vec3::X; 3]] };
    let refused = bench.face(settings(14), Some(Arc::new(short)), &mut |_, _| {}).unwrap_err().to_string();
    assert!(refused.contains("3 points"), "{refused}");
}

#[test]
fn bad_meshes_are_told_in_words() {
    let triangles = |points: Vec<Vec3>, faces: Vec<[u32; 3]>| {
        let part =
            rigsmith::mesh::model::Part { vertices: (0..points.len() as u32).collect(), triangles: faces, ..default() };
        Model { points, parts: vec![part], objects: vec![default()], ..default() }
    };
    let flat = |n: u32| {
        let at = |i: u32| Vec3::new((i % n) as f32, (i / n) as f32, 0.0);
        let quads = (0..n * (n - 1)).filter(|i| i % n + 1 < n);
        triangles(
            (0..n * n).map(at).collect(),
            quads.flat_map(|i| [[i, i + 1, i + n], [i + 1, i + n + 1, i + n]]).collect(),
        )
    };
    let sphere = {
        let (n, rings) = (48_u32, 32_u32);
        let at = |i: u32| {
            let (a, b) = (
                (i % n) as f32 / n as f32 * std::f32::consts::TAU,
                ((i / n) as f32 + 0.5) / rings as f32 * std::f32::consts::PI,
            );
            Vec3::new(b.sin() * a.sin(), b.cos(), b.sin() * a.cos())
        };
        let faces = (0..n * (rings - 1)).flat_map(|i| {
            let next = i / n * n + (i + 1) % n;
            [[i, i + n, next], [next, i + n, next + n]]
        });
        triangles((0..n * rings).map(at).collect(), faces.collect())
    };
    let cases: Vec<(&str, Model, usize)> = vec![
        ("empty", Model::default(), 10),
        ("one triangle", triangles(vec![Vec3::ZERO, Vec3::X, Vec3::Y], vec![[0, 1, 2]]), 10),
        ("flat", flat(20), 10),
        ("sphere", sphere, 10),
        ("no bones", bundled("head.obj"), 0),
        ("too many bones", bundled("head.obj"), 1_000_000),
        ("one bone", bundled("head.obj"), 1),
    ];
    for (name, model, bones) in cases {
        let mut bench = bench(model);
        let before = bench.rig().clone();
        match bench.face(settings(bones), None, &mut |_, _| {}) {
            Ok(_) => check_weights(&bench),
            Err(error) => {
                assert!(error.to_string().len() > 15, "{name}: {error}");
                assert_eq!(*bench.rig(), before, "{name} changes nothing");
                println!("{name}: {error}");
            }
        }
        if bones == 0 || bones > 1000 || name == "empty" {
            assert_eq!(*bench.rig(), before, "{name} is refused");
        }
    }
}

/// The entity of the mesh.
fn mesh_of(bench: &mut Workbench) -> Entity {
    let world = bench.app_mut().world_mut();
    world.query_filtered::<Entity, With<RigMesh>>().single(world).unwrap()
}

#[test]
fn a_face_waits_for_steps_that_were_undone_while_it_was_placed() {
    let mut bench = bench(bundled("head.obj"));
    let (mesh, rig) = (mesh_of(&mut bench), bench.rig_entity());
    let app = bench.app_mut();
    let waits = |app: &App| app.world().get::<FaceJob>(mesh).is_some_and(FaceJob::waits);
    let waiting = |app: &mut App, step: &str| {
        begin_drag(app, rig);
        app.world_mut().write_message(FaceRequest { mesh, settings: settings(24), fit: None });
        wait(app, "the face", App::update, waits);
        undo_meanwhile(app, rig, new_clip(step));
        (0..3).for_each(|_| app.update());
        let history = app.world().get::<RigHistory>(rig).unwrap();
        assert!(waits(app) && history.can_redo() && app.world().get::<Rig>(rig).unwrap().is_empty());
    };
    let redo = |app: &mut App| {
        app.world_mut().write_message(EditRequest { rig, change: Change::Redo });
        wait(app, "the end of the job", App::update, |app| app.world().get::<FaceJob>(mesh).is_none());
        (0..2).for_each(|_| app.update());
    };
    // It can be dropped, and the step can be redone.
    waiting(app, "wave");
    app.world().get::<FaceJob>(mesh).unwrap().cancel();
    redo(app);
    assert!(app.world().get::<Rig>(rig).unwrap().is_empty());
    // After a redo it lands.
    waiting(app, "run");
    redo(app);
    assert_eq!(bench.rig().clips().len(), 2);
    assert!(!bench.rig().is_empty());
}

#[test]
fn placing_can_be_cancelled() {
    let mut bench = bench(bundled("head.obj"));
    let mesh = mesh_of(&mut bench);
    let (rig, before) = (bench.rig_entity(), bench.rig().clone());
    let app = bench.app_mut();
    // Nothing lands during a drag, however fast it is computed.
    begin_drag(app, rig);
    app.world_mut().write_message(FaceRequest { mesh, settings: settings(60), fit: None });
    app.update();
    app.world().get::<FaceJob>(mesh).expect("the job is under way").cancel();
    wait(app, "an answer", App::update, |app| !app.world().resource::<Messages<FacePlaced>>().is_empty());
    let result = app.world_mut().resource_mut::<Messages<FacePlaced>>().drain().last().unwrap().result;
    assert_eq!(result.unwrap_err(), PlaceFaceError::Face(FaceError::Cancelled));
    app.world_mut().write_message(EditRequest { rig, change: Change::CancelPreview });
    app.update();
    assert_eq!(*bench.rig(), before);
}

#[test]
fn real_heads_and_creatures_get_faces() {
    // The folds of the six expressions together, a tenth or one above what was measured.
    let files = [
        ("heads/ict_neutral.obj", 1),
        ("heads/ict_identity_1.obj", 1),
        ("heads/ict_identity_2.obj", 6),
        ("heads/lee_perry_smith.obj", 1),
        ("creatures/fox-fox.glb", 0),
        ("creatures/fox-dog.glb", 0),
        ("creatures/bird-eagle.glb", 0),
        ("creatures/spot.obj", 0),
        ("bodies/female_young/full.obj", 1),
        ("bodies/baby/body.obj", 4),
    ];
    for (file, most) in files {
        let Some(model) = data(file) else { return };
        let mut bench = bench(model);
        let report = bench.face(settings(24), None, &mut |_, _| {}).unwrap_or_else(|error| panic!("{file}: {error}"));
        check_weights(&bench);
        println!("{file}: {} folds, {most} at most", report.folds);
        assert!(report.folds <= most, "{file}: {} folds, {most} at most", report.folds);
        let known = FaceRig::read(bench.rig());
        assert_eq!(known.bones.iter().filter(|bone| bone.kind == FaceBoneKind::Skin).count(), 24, "{file}");
        let joints = bench.rig().walk().filter(|joint| joint.data.kind == NodeKind::Joint).count();
        assert!(joints >= known.bones.len(), "{file}");
        bench.express(BTreeMap::from([("surprise".to_owned(), 1.0)])).unwrap_or_else(|error| panic!("{file}: {error}"));
    }
}

#[test]
fn faces_of_real_heads_hardly_fold() {
    // The folds of the six expressions together, a tenth or one above what was measured.
    let heads = [
        ("ict_neutral", [1, 1, 9, 4]),
        ("ict_identity_1", [1, 1, 4, 2]),
        ("ict_identity_2", [1, 7, 6, 17]),
        ("ict_identity_3", [1, 3, 24, 9]),
        ("lee_perry_smith", [1, 1, 14, 7]),
    ];
    for (head, folds) in heads {
        let file = format!("heads/{head}.obj");
        let Some(model) = data(&file) else { return };
        let mut bench = bench(model);
        for (bones, most) in [12, 40, 60, 80].into_iter().zip(folds) {
            let report = place(&mut bench, bones);
            println!("{file} with {bones} bones: {} folds, {most} at most", report.folds);
            assert!(report.folds <= most, "{file} with {bones} bones: {} folds, {most} at most", report.folds);
        }
    }
}

/// A game sets expressions by name, by writing a component.
#[test]
fn written_expressions_move_the_face() {
    let mut bench = bench(bundled("head.obj"));
    place(&mut bench, 24);
    let rig = bench.rig_entity();
    let world = bench.app_mut().world_mut();
    let mesh = world.query_filtered::<Entity, With<RigMesh>>().single(world).unwrap();
    let write = |bench: &mut Workbench, name: &str, strength: f32| {
        let world = bench.app_mut().world_mut();
        world.entity_mut(mesh).insert(Expressions([(name.to_owned(), strength)].into()));
        bench.app_mut().update();
        let world = bench.app_mut().world_mut();
        let steps = world.get::<RigHistory>(rig).unwrap().steps().0.len();
        let answer = world.resource_mut::<Messages<ExpressionAnswer>>().drain().last();
        (steps, answer.map(|answer| answer.result))
    };
    let (before, first) = write(&mut bench, "happiness", 0.0);
    assert_eq!(first, Some(Ok(())));
    let (steps, answer) = write(&mut bench, "happiness", 1.0);
    assert_eq!((steps, answer), (before + 1, Some(Ok(()))));
    let by_component = bench.rig().pose().clone();
    assert!(by_component.len() > 5, "{by_component:?}");
    let (steps, answer) = write(&mut bench, "happiness", 1.0);
    assert_eq!((steps, answer), (before + 1, Some(Ok(()))), "what is shown already is no step");
    let (steps, answer) = write(&mut bench, "hapiness", 1.0);
    assert_eq!(steps, before + 1);
    assert!(matches!(answer, Some(Err(ExpressError::Unknown { .. }))), "{answer:?}");
    // After an undo the same expression moves the face again.
    assert!(bench.gestures(vec![Gesture::Undo]).iter().all(|answer| answer.done));
    assert!(bench.rig().pose().is_empty());
    assert_eq!(write(&mut bench, "happiness", 1.0), (before + 1, Some(Ok(()))));
    assert_eq!(*bench.rig().pose(), by_component);
    write(&mut bench, "surprise", 1.0);
    bench.express([("happiness".to_owned(), 1.0)].into()).unwrap();
    assert_eq!(*bench.rig().pose(), by_component, "as by request");
}
