//! A character whose template is changed while it moves: after two seconds the file gains a tail, and the arm goes on waving.
//!
//! ```text
//! cargo run --example hot_reload
//! cargo run --example hot_reload -- --screenshot hot_reload.png
//! ```
//!
//! The template is a copy in a temporary folder, whose path is printed: open it in a text editor and save changes of your own.

mod common;

use std::{fs, path::PathBuf};

use bevy::prelude::*;
use rigsmith::prelude::*;

const TEMPLATE: &str = include_str!("../assets/templates/biped.rig.ron");

/// A part that the file gains.
const TAIL: &str = r#"        (part: "parts/tail.rig.ron", parent: "hips", world: true, translation: (0, 0.13, 0.17)),
    ],
)
"#;

/// The file, and whether it has been changed.
#[derive(Resource)]
struct Template {
    file: PathBuf,
    is_changed: bool,
}

fn main() -> Result<AppExit> {
    let folder = std::env::temp_dir().join(format!("rigsmith-hot-reload-{}", std::process::id()));
    fs::create_dir_all(&folder)?;
    let file = folder.join("biped.rig.ron");
    fs::write(&file, TEMPLATE)?;
    println!("the template is {}", file.display());
    let mut app = common::app(&[(1.6, "-before"), (3.4, "")]);
    app.add_plugins((RigPlugins, DisplayPlugin, DrawingPlugin, RigInstancePlugin::live()))
        .insert_resource(Template { file, is_changed: false })
        .insert_resource(ControlsInUse(true))
        .insert_resource(MeshDisplay { xray: true, ..default() })
        .add_systems(Startup, spawn)
        .add_systems(Update, (wave, save))
        .add_observer(|updated: On<RigUpdated>| {
            println!("updated: {} changes, {} commands ran", updated.changes.len(), updated.ran.len());
        })
        .add_observer(|failed: On<RigFailed>| println!("not taken over: {}", failed.error));
    let exit = app.run();
    fs::remove_dir_all(folder)?;
    Ok(exit)
}

fn spawn(mut commands: Commands, template: Res<Template>, files: TemplateFiles, mut uids: ResMut<UidSource>) -> Result {
    let rig = commands.spawn(RigSource::live(files.open(template.file.clone()))).id();
    let model = load_model(&RealDisk, "assets/models/biped.obj".as_ref())?;
    commands.spawn((RigMesh::new(uids.next_uid(), model, Vec::new()), SkinOf(rig)));
    commands.spawn((common::camera(Vec3::new(2.2, 1.3, -2.4), Vec3::new(0.0, 0.95, 0.0)), RigViewport { focus: 3.2 }));
    Ok(())
}

fn wave(rigs: Query<Entity, With<RigSource>>, nodes: InstanceNodes, time: Res<Time>, mut poses: ControlPoses) {
    for rig in &rigs {
        let swing = ops::sin(4.0 * time.elapsed_secs());
        if let Some(hand) = nodes.find(rig, "hand_ik_l") {
            poses.set(hand, PoseOffset { translation: Vec3::new(0.15 * swing, -0.1, 0.2), ..default() });
        }
        for joint in ["tail_fk", "tail_fk_2", "tail_fk_3"] {
            if let Some(tail) = nodes.find(rig, joint) {
                poses.set(tail, PoseOffset::from_rotation(Quat::from_rotation_z(0.4 * swing)));
            }
        }
    }
}

/// Saves the template with a tail once the character has been there for two seconds.
fn save(
    time: Res<Time>,
    rigs: Query<(), With<BuildResult>>,
    mut template: ResMut<Template>,
    mut since: Local<f32>,
) -> Result {
    if !rigs.is_empty() && !template.is_changed {
        *since += time.delta_secs();
        if *since > 2.0 {
            template.is_changed = true;
            let end = TEMPLATE.rfind("    ],").unwrap_or(TEMPLATE.len());
            fs::write(&template.file, format!("{}{TAIL}", &TEMPLATE[..end]))?;
        }
    }
    Ok(())
}
