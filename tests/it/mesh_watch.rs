//! The window reads a mesh again that another program saved, and keeps what it has where the file is none.

use std::{fs, time::Duration};

use bevy::prelude::*;
use rigsmith::{
    editor::{
        ActiveRig,
        files::{FilesPlugin, LoadJob, OpenRequest, StateFolder},
        mesh_watch::MeshWatchPlugin,
        notice::{Notice, Severity},
    },
    headless::headless_app,
    plugins::surface::{RigMesh, RigMeshes},
    test_app::strict_app,
};

use super::bench::HANG;

fn cube(half: f32) -> String {
    let mut text = String::new();
    for corner in 0..8 {
        let at = |axis: u32| if corner >> axis & 1 == 1 { half } else { -half };
        text += &format!("v {} {} {}\n", at(0), at(1) + 1.0, at(2));
    }
    for face in ["1 3 4 2", "5 6 8 7", "1 2 6 5", "3 7 8 4", "1 5 7 3", "2 4 8 6"] {
        text += &format!("f {face}\n");
    }
    text
}

#[test]
fn a_saved_mesh_is_read_again_and_a_broken_one_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("cube.obj");
    fs::write(&file, cube(0.5)).unwrap();
    let mut app = headless_app(7);
    app.insert_resource(StateFolder(Some(folder.path().join("state"))))
        .add_plugins((FilesPlugin, MeshWatchPlugin))
        .add_message::<AppExit>();
    let mut app = strict_app(app);
    app.world_mut().write_message(OpenRequest::File(file.clone()));
    let mut notices: Vec<Notice> = Vec::new();
    let mut cursor = bevy::ecs::message::MessageCursor::<Notice>::default();
    let mut until = |app: &mut App, what: &str, is_so: &dyn Fn(&World, &[Notice]) -> bool| {
        let start = std::time::Instant::now();
        loop {
            app.update();
            notices.extend(cursor.read(app.world().resource::<Messages<Notice>>()).cloned());
            if is_so(app.world(), &notices) {
                return;
            }
            assert!(start.elapsed() < HANG, "{what} does not come: {notices:?}");
            std::thread::sleep(Duration::from_millis(5));
        }
    };
    let half = |world: &World| {
        let rig = world.get_resource::<ActiveRig>()?.0;
        let mesh = world.get::<RigMeshes>(rig)?.iter().next()?;
        let points = &world.get::<RigMesh>(mesh)?.rest.points;
        points.iter().map(|point| point.x).reduce(f32::max)
    };
    until(&mut app, "the mesh", &|world, _| half(world) == Some(0.5) && world.resource::<LoadJob>().what().is_none());
    // The file is looked at before it changes.
    let looks = std::time::Instant::now();
    while looks.elapsed() < Duration::from_millis(700) {
        app.update();
        std::thread::sleep(Duration::from_millis(5));
    }
    fs::write(&file, cube(0.75)).unwrap();
    until(&mut app, "the next version", &|world, notices| {
        half(world) == Some(0.75) && notices.iter().any(|notice| notice.text.contains("was read again"))
    });
    fs::write(&file, "v 1 2\nf 1 2 3 4 5 6 7 8 9\n").unwrap();
    until(&mut app, "the error", &|_, notices| notices.iter().any(|notice| notice.severity == Severity::Error));
    assert_eq!(half(app.world()), Some(0.75), "a broken file changes nothing");
    fs::write(&file, cube(0.6)).unwrap();
    until(&mut app, "the version after the broken one", &|world, _| half(world) == Some(0.6));
}
