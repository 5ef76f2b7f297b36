//! A character in a game: a template, a mesh, and a system that moves a control.
//!
//! ```text
//! cargo run --example embed
//! cargo run --example embed -- --screenshot embed.png
//! ```

mod common;

use bevy::prelude::*;
use rigsmith::prelude::*;

fn main() -> AppExit {
    let mut app = common::app(&[(1.0, "")]);
    app.add_plugins((RigPlugins, DisplayPlugin, RigInstancePlugin::default()));
    app.add_systems(Startup, spawn).add_systems(Update, wave).run()
}

fn spawn(mut commands: Commands, files: TemplateFiles, mut uids: ResMut<UidSource>) -> Result {
    let rig = commands.spawn(RigSource::new(files.open("assets/templates/biped.rig.ron"))).id();
    let model = load_model(&RealDisk, "assets/models/biped.obj".as_ref())?;
    commands.spawn((RigMesh::new(uids.next_uid(), model, Vec::new()), SkinOf(rig)));
    commands.spawn(common::camera(Vec3::new(0.9, 1.4, 3.2), Vec3::new(0.0, 0.9, 0.0)));
    Ok(())
}

fn wave(rigs: Query<Entity, With<RigSource>>, nodes: InstanceNodes, time: Res<Time>, mut poses: ControlPoses) {
    for rig in &rigs {
        if let Some(hand) = nodes.find(rig, "hand_ik_l") {
            let swing = ops::sin(4.0 * time.elapsed_secs());
            poses.set(hand, PoseOffset { translation: Vec3::new(0.15 * swing, -0.1, 0.2), ..default() });
        }
    }
}
