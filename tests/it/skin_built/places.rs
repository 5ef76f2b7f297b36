//! Library, app and command line: the same weights of the same joints, and the surface where they take it.

use bevy::{
    app::App,
    math::{Quat, Vec3},
};
use rigsmith::{
    algo::weights::WeightSettings,
    headless::Workbench,
    mesh::skinning::skin_points_dual,
    plugins::{
        commands::{BuildRequest, BuildResult, BuildStep},
        skinning::SkinningInput,
        surface::RigSurface,
    },
    rig::{PoseOffset, RigEdit, operations::Operation},
};

use super::figure::Figure;

/// An app in which the rig's commands are carried out, as the window does it.
fn app(figure: &Figure) -> Workbench {
    let mut bench = figure.bench(None);
    let rig = bench.rig_entity();
    bench.app_mut().world_mut().write_message(BuildRequest { rig, step: BuildStep::All });
    bench.app_mut().update();
    assert_eq!(bench.built(), Some(&*figure.built));
    bench
}

#[test]
fn library_and_app_bind_to_the_same_joints() {
    let figure = Figure::bundled();
    let mut bench = app(&figure);
    bench.skin(WeightSettings::default(), Vec::new(), &mut |_| {}).unwrap();
    assert_eq!(bench.weights(), Some(&figure.skin));
    let mesh = bench.mesh().unwrap().clone();
    let modules = rigsmith::modules::all();
    let input = SkinningInput::new(&figure.rig, Some(&figure.built), Some(&modules), &mesh, &[]);
    let bound = input.compute(&mesh, &WeightSettings::default(), &|_| true).unwrap();
    assert_eq!(*bound.skin, figure.skin);
}

#[cfg(feature = "cli")]
#[test]
fn the_command_binds_to_the_same_joints() {
    use rigsmith::{
        files::{RealDisk, load_model, store_model},
        mesh::gltf::GltfWriteSettings,
    };

    let figure = Figure::bundled();
    let mut bench = app(&figure);
    bench.skin(WeightSettings::default(), Vec::new(), &mut |_| {}).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let (ours, theirs) = (folder.path().join("app.glb"), folder.path().join("command.glb"));
    store_model(&RealDisk, &ours, &bench.character(), &GltfWriteSettings::default()).unwrap();
    let asset = |path: &str| format!("{}/assets/{path}", env!("CARGO_MANIFEST_DIR"));
    let (rig, mesh) = (asset("templates/biped.rig.ron"), asset("models/biped.obj"));
    let answer =
        crate::cli_build::rigsmith(folder.path(), &["build", &rig, "--mesh", &mesh, "-o", theirs.to_str().unwrap()]);
    assert_eq!(answer.code, 0, "{}{}", answer.out, answer.err);
    let [ours, theirs] = [ours, theirs].map(|path| load_model(&RealDisk, &path).unwrap());
    assert_eq!(ours.weights, theirs.weights);
    assert_eq!(ours.skins, theirs.skins);
    let names = |model: &rigsmith::mesh::model::Model| -> Vec<String> {
        model.nodes.iter().map(|node| node.name.clone()).collect()
    };
    assert_eq!(names(&ours), names(&theirs));
    assert!(names(&ours).iter().filter(|name| name.contains("_twist_")).count() >= 32);
}

/// A control is posed in the document: the surface that rays meet is where the program takes the skin.
#[test]
fn the_posed_surface_hangs_on_created_joints() {
    let figure = Figure::bundled();
    let mut bench = app(&figure);
    bench.skin(WeightSettings::default(), Vec::new(), &mut |_| {}).unwrap();
    let hand = figure.control("hand_ik_l");
    let offset = PoseOffset {
        rotation: Quat::from_rotation_y(1.2),
        translation: Vec3::new(0.02, -0.05, 0.03),
        ..PoseOffset::IDENTITY
    };
    bench.operate(Operation::Edits(vec![RigEdit::SetOffset(hand, Some(offset))])).unwrap();
    let rig = bench.rig_entity();
    let mut state = figure.state();
    state.set_offset(hand, offset).unwrap();
    state.evaluate(0.0);
    let wanted = figure.posed(&state);
    let moved = wanted.iter().zip(&figure.model.points).filter(|(a, b)| a.distance(**b) > 1e-3).count();
    assert!(moved > 300, "{moved} points move");
    assert!(bench.app_mut().world().get::<BuildResult>(rig).is_some());
    let app = bench.app_mut();
    app.update();
    crate::bench::wait(app, "the surface", App::update, |app| {
        let surface = app.world().get::<RigSurface>(rig);
        surface.is_some_and(|surface| surface.ready().is_some() && !surface.is_stale())
    });
    let surface = bench.app_mut().world().get::<RigSurface>(rig).unwrap();
    // Every moved point lies on the surface.
    for point in wanted.iter().step_by(37) {
        let closest = surface.ready().unwrap().closest_point(*point).unwrap().point;
        assert!(closest.distance(*point) < 2e-3, "{point} is {closest} on the surface");
    }
}

/// Dual quaternions blend the joints of an app as they blend those of the program, and otherwise than linear blending does.
#[test]
fn dual_quaternions_show_the_posed_mesh() {
    let figure = Figure::bundled();
    let mut bench = app(&figure);
    bench.skin(WeightSettings::default(), Vec::new(), &mut |_| {}).unwrap();
    let hand = figure.control("hand_ik_l");
    let offset = PoseOffset {
        rotation: Quat::from_rotation_x(1.2),
        translation: Vec3::new(0.02, -0.05, 0.03),
        ..PoseOffset::IDENTITY
    };
    bench.operate(Operation::Edits(vec![RigEdit::SetOffset(hand, Some(offset))])).unwrap();
    (0..3).for_each(|_| bench.app_mut().update());
    let mut state = figure.state();
    state.set_offset(hand, offset).unwrap();
    state.evaluate(0.0);
    let wanted = skin_points_dual(&figure.model.points, &figure.skin.weights, &figure.matrices(&state));
    let rig = bench.rig_entity();
    let models = bench.app_mut().world().get::<RigSurface>(rig).unwrap().dual_quaternion_models();
    assert!(models.len() == 1 && models[0].weights.is_none());
    let mut other = 0.0_f32;
    for ((is, wanted), linear) in models[0].points.iter().zip(&wanted).zip(figure.posed(&state)) {
        assert!(is.distance(wanted.position) < 5e-4, "{is} is not {}", wanted.position);
        other = other.max(is.distance(linear));
    }
    assert!(other > 1e-3, "linear blending differs by {other}");
}
