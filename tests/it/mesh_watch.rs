//! The window reads a mesh again that another program saved, and keeps what it has where the file is none.

use std::fs;

use bevy::prelude::*;
use rigsmith::{
    editor::{
        ActiveRig,
        files::{FilesPlugin, OpenRequest},
        mesh_watch::MeshWatchPlugin,
        notice::Severity,
    },
    instance::FollowedModels,
    plugins::surface::{RigMesh, RigMeshes},
};

use super::{bench::save_whole, window_app::WindowBench};

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
    let state = folder.path().join("state");
    let mut window = WindowBench::with_files(state, (FilesPlugin, MeshWatchPlugin));
    window.base.app.world_mut().write_message(OpenRequest::File(file.clone()));
    let half = |window: &WindowBench| {
        let world = window.world();
        let rig = world.get_resource::<ActiveRig>()?.0;
        let mesh = world.get::<RigMeshes>(rig)?.iter().next()?;
        let points = &world.get::<RigMesh>(mesh)?.rest.points;
        points.iter().map(|point| point.x).reduce(f32::max)
    };
    window.until("the mesh", |window| half(window) == Some(0.5) && !window.base.has_file_jobs());
    // The file is looked at before it changes.
    window.until("the first look", |window| window.world().resource::<FollowedModels>().is_followed(&file));
    save_whole(&file, cube(0.75));
    window.until("the next version", |window| {
        let is_told = window.notices.list.iter().any(|notice| notice.text.contains("was read again"));
        half(window) == Some(0.75) && is_told
    });
    save_whole(&file, "v 1 2\nf 1 2 3 4 5 6 7 8 9\n");
    window.until("the error", |window| window.notices.include(Severity::Error, ""));
    assert_eq!(half(&window), Some(0.75), "a broken file changes nothing");
    save_whole(&file, cube(0.6));
    window.until("the version after the broken one", |window| half(window) == Some(0.6));
}
