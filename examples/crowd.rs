//! A thousand characters of one template, which share their mesh; each has a pose of its own.
//!
//! ```text
//! cargo run --release --example crowd
//! cargo run --release --example crowd -- --screenshot crowd.png
//! ```
//!
//! `--count NUMBER` shows fewer or more.

mod common;

use bevy::{
    diagnostic::{FrameTimeDiagnosticsPlugin, LogDiagnosticsPlugin},
    prelude::*,
};
use rigsmith::prelude::*;

fn main() -> AppExit {
    let mut app = common::app(&[(0.4, "")]);
    app.add_plugins((RigPlugins, DisplayPlugin, RigInstancePlugin::default()))
        .add_systems(Startup, spawn)
        .add_systems(Update, wave);
    if common::option("--screenshot").is_none() {
        app.add_plugins((FrameTimeDiagnosticsPlugin::default(), LogDiagnosticsPlugin::default()));
    }
    app.run()
}

fn spawn(mut commands: Commands, files: TemplateFiles, mut uids: ResMut<UidSource>) -> Result {
    let template = files.open("assets/templates/biped.rig.ron");
    // One of them has the mesh and its weights; it stays hidden, the others show its mesh.
    let tailor = commands.spawn((RigSource::new(template.clone()), Visibility::Hidden)).id();
    let model = load_model(&RealDisk, "assets/models/biped.obj".as_ref())?;
    commands.spawn((RigMesh::new(uids.next_uid(), model, Vec::new()), SkinOf(tailor)));
    let count = common::option("--count").and_then(|count| count.parse().ok()).unwrap_or(1000);
    let side = (count as f32).sqrt().ceil() as usize;
    for number in 0..count {
        let (row, column) = (number / side, number % side);
        let place = Vec3::new(1.7 * (column as f32 - 0.5 * (side - 1) as f32), 0.0, -1.4 * row as f32);
        commands.spawn((
            RigInstance(template.clone()),
            InstanceMode::Direct,
            SharedMesh(tailor),
            Transform::from_translation(place),
        ));
    }
    let back = 0.75 * side as f32;
    commands
        .spawn(common::camera(Vec3::new(0.3 * back, 2.0 + 0.5 * back, 2.0 + back), Vec3::new(0.0, 0.5, -0.5 * back)));
    Ok(())
}

/// Raises the left hand of each character at its own time.
fn wave(
    crowd: Query<Entity, With<RigInstance>>,
    nodes: InstanceNodes,
    time: Res<Time>,
    mut poses: ControlPoses,
    mut hands: Local<Vec<Entity>>,
) {
    if hands.is_empty() {
        *hands = crowd.iter().filter_map(|instance| nodes.find(instance, "hand_ik_l")).collect();
    }
    for (number, hand) in hands.iter().enumerate() {
        let height = 0.1 + 0.15 * ops::sin(3.0 * time.elapsed_secs() + number as f32);
        poses.set(*hand, PoseOffset { translation: Vec3::new(0.0, -0.1, height), ..default() });
    }
}
