//! Files of open meshes: a version that is saved while its mesh is open takes the mesh's place.
//!
//! The window looks at the files when it draws, so a window at rest stays at rest; the first movement of the mouse after a save
//! in another program reloads the mesh.

use bevy::prelude::*;

use super::{
    counts::counted,
    files::{MeshSource, attend},
    notice::Notice,
};
use crate::{
    instance::{ModelFault, ModelFile, ModelFilesPlugin},
    plugins::{
        RigSystems,
        mesh_reload::{ReloadAnswer, ReloadError},
        surface::RigMesh,
    },
};

/// Plugin that follows the files of open meshes.
pub struct MeshWatchPlugin;

impl Plugin for MeshWatchPlugin {
    fn build(&self, app: &mut App) {
        app.add_plugins(ModelFilesPlugin::default())
            .add_message::<ReloadAnswer>()
            .add_message::<Notice>()
            .add_systems(Update, (follow_sources, tell).chain().after(attend).before(RigSystems::Script));
    }
}

/// Follows the files that meshes are opened from, or saved to.
fn follow_sources(meshes: Query<(Entity, &MeshSource), (With<RigMesh>, Changed<MeshSource>)>, mut commands: Commands) {
    for (entity, source) in &meshes {
        let mut entity = commands.entity(entity);
        match source {
            MeshSource::File(path) => entity.try_insert(ModelFile(path.clone())),
            MeshSource::Bundled(_) => entity.try_remove::<ModelFile>(),
        };
    }
}

fn tell(
    mut faults: MessageReader<ModelFault>,
    mut answers: MessageReader<ReloadAnswer>,
    meshes: Query<&RigMesh>,
    mut commands: Commands,
) {
    for ModelFault { error, .. } in faults.read() {
        commands.write_message(Notice::error(format!("The changed mesh is not taken over: {error}")));
    }
    for ReloadAnswer { mesh, result } in answers.read() {
        let name = meshes.get(*mesh).map_or("The mesh", |mesh| mesh.file.name.as_str());
        let notice = match result {
            Ok(report) => {
                let [before, now] = report.points;
                let points = match counted(now, "point", "points") {
                    _ if before == now => String::new(),
                    now => format!("{now} instead of {before}; "),
                };
                let weights = if report.weights.is_some() { "; its weights were transferred" } else { "" };
                let moved = report.moved;
                Notice::done(format!("{name} was read again: {points}points moved by {moved:.4} at most{weights}."))
                    .named()
            }
            Err(error @ ReloadError::Discarded) => Notice::info(format!("{name} was not read again: {error}.")).named(),
            Err(error) => Notice::error(format!("{name} was not read again: {error}.")).named(),
        };
        commands.write_message(notice);
    }
}
