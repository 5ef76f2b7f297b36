//! Frames of an app that shows a mesh of a million triangles and draws a rig of a thousand joints, without a renderer.

use std::{
    sync::Arc,
    time::{Duration, Instant},
};

use bevy::{asset::AssetPlugin, math::Affine3A, mesh::MeshPlugin, platform::collections::HashMap, prelude::*};
use rigsmith::{
    headless::headless_app,
    mesh::model::{Faces, Model, Object, Part, Weights},
    plugins::{
        display::{DisplayJob, DisplayPlugin, MeshDisplay, WeightColors},
        document::{HoveredNode, JointEntities},
        drawing::{
            RigDrawing,
            ink::Ink,
            skeleton::{draw_skeleton, drawn_joints},
        },
        viewport::{RigViewport, Sight},
    },
    prelude::*,
    rig::SkinData,
};

const MESH: Uid = Uid(99);

/// Prints the median and the longest time of each phase, in milliseconds.
pub fn run() {
    println!("\n{:<44} {:>8} {:>8}", "shown: milliseconds a frame", "median", "longest");
    let mut app = headless_app(1);
    app.add_plugins((AssetPlugin::default(), MeshPlugin));
    app.init_asset::<Image>().init_asset::<StandardMaterial>().add_plugins(DisplayPlugin);
    app.finish();
    app.cleanup();
    let rig = app.world_mut().spawn(Rig::default()).id();
    let positions = (0..40).map(|i| Vec3::new(i as f32 * 17.0, 350.0, 0.0)).collect();
    app.world_mut().write_message(EditRequest::operation(rig, Operation::Chain { positions, parent: None }));
    app.update();
    let joints: Vec<Uid> =
        app.world().get::<Rig>(rig).into_iter().flat_map(Rig::walk).map(|joint| joint.data.uid).collect();
    let Some(&middle) = joints.get(20) else { return };
    let model = field(707);
    let skin = skin(&model, joints);
    let mesh = app.world_mut().spawn((RigMesh::new(MESH, model, Vec::new()), SkinOf(rig))).id();
    report("load", until_shown(&mut app, mesh));
    let bind = Operation::Edits(vec![RigEdit::SetSkin(MESH, Some(skin))]);
    app.world_mut().write_message(EditRequest::operation(rig, bind));
    report("bind given weights", until_shown(&mut app, mesh));
    *app.world_mut().resource_mut::<MeshDisplay>() =
        MeshDisplay { weights: WeightColors::AllJoints, wireframe: true, ..default() };
    report("colours and edges", until_shown(&mut app, mesh));
    report("idle", (0..200).map(|_| frame(&mut app)).collect());
    let entity = app.world().get::<JointEntities>(rig).and_then(|entities| entities.get(middle));
    let turned = (0..200).map(|_| {
        if let Some(mut transform) = entity.and_then(|entity| app.world_mut().get_mut::<Transform>(entity)) {
            transform.rotate_local_z(0.01);
        }
        frame(&mut app)
    });
    report("pose", turned.collect());
    let moved = (0..200).map(|step| {
        let to = vec![(middle, Vec3::new(340.0, 350.0, step as f32 * 0.1))];
        let operation = Operation::Move { to, with_children: false };
        app.world_mut().write_message(EditRequest::operation(rig, operation));
        frame(&mut app)
    });
    report("move a joint at rest", moved.collect());
    draw_joints();
}

fn frame(app: &mut App) -> Duration {
    let started = Instant::now();
    app.update();
    started.elapsed()
}

fn until_shown(app: &mut App, mesh: Entity) -> Vec<Duration> {
    let mut times = vec![frame(app)];
    while app.world().get::<DisplayJob>(mesh).is_some() || times.len() < 20 {
        times.push(frame(app));
        std::thread::sleep(Duration::from_millis(5));
    }
    times
}

fn report(what: &str, mut times: Vec<Duration>) {
    times.sort_unstable();
    let at = |index: usize| times[index].as_secs_f64() * 1e3;
    println!("{what:<44} {:>8.3} {:>8.3}", at(times.len() / 2), at(times.len() - 1));
}

/// A square of `side` by `side` quads.
fn field(side: u32) -> Model {
    let across = side + 1;
    let points: Vec<Vec3> =
        (0..across * across).map(|i| Vec3::new((i % across) as f32, (i / across) as f32, 0.0)).collect();
    let corners = |i: u32| {
        let low = i / side * across + i % side;
        [low, low + 1, low + across + 1, low + across]
    };
    let quads: Vec<[u32; 4]> = (0..side * side).map(corners).collect();
    let part = Part {
        vertices: (0..across * across).collect(),
        normals: vec![Vec3::Z; points.len()],
        faces: Faces { starts: (0..=quads.len() as u32).map(|i| 4 * i).collect(), corners: quads.concat() },
        triangles: quads.iter().flat_map(|q| [[q[0], q[1], q[2]], [q[0], q[2], q[3]]]).collect(),
        ..default()
    };
    Model { points, objects: vec![Object::default()], parts: vec![part], ..default() }
}

/// Weights that blend from joint to joint along the field.
fn skin(model: &Model, joints: Vec<Uid>) -> Arc<SkinData> {
    let mut weights = Weights::default();
    for point in &model.points {
        let place = (point.x / 17.0).clamp(0.0, 38.99);
        let (first, part) = (place as u32, place.fract());
        weights.push([(first, 1.0 - part), (first + 1, part)].into_iter().filter(|(_, weight)| *weight > 0.0));
    }
    Arc::new(SkinData { joints, weights, at_rest: true, ..Default::default() })
}

/// The ink of a rig of a thousand joints.
fn draw_joints() {
    let mut app = headless_app(1);
    app.finish();
    let rig = app.world_mut().spawn(Rig::default()).id();
    let place = |n: usize| Vec3::new((n % 40) as f32 * 0.05, (n / 40) as f32 * 0.05, (n % 7) as f32 * 0.03);
    let positions = (0..1000).map(place).collect();
    app.world_mut().write_message(EditRequest::operation(rig, Operation::Chain { positions, parent: None }));
    app.update();
    let (eye, target) = (Vec3::new(1.0, 0.6, 2.5), Vec3::new(1.0, 0.6, 0.0));
    let camera = GlobalTransform::from(Transform::from_translation(eye).looking_at(target, Vec3::Y));
    let viewport = RigViewport { focus: eye.distance(target) };
    let size = Vec2::new(1280.0, 720.0);
    let sight = Sight::new(&camera, &Projection::default(), &viewport, size, &GlobalTransform::IDENTITY);
    let (Some(rig), Some(sight)) = (app.world().get::<Rig>(rig), sight) else { return };
    let globals: HashMap<Uid, Affine3A> =
        rig.rest_globals().into_iter().map(|(uid, global)| (uid, global.into())).collect();
    let mut ink = Ink::default();
    let times = (0..100).map(|_| {
        let started = Instant::now();
        let mut next = Ink::with_capacity_of(&ink);
        let joints = drawn_joints(rig, &Selection::default(), &HoveredNode(None), |uid| globals.get(&uid).copied());
        draw_skeleton(&joints, &[], &sight, &RigDrawing::default(), &mut next);
        ink = next;
        started.elapsed()
    });
    report("ink of 1000 joints", times.collect());
}
