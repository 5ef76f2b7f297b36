//! Files of open meshes: a version that is saved while its mesh is open takes the mesh's place.
//!
//! The window looks at the files when it draws, so a window at rest stays at rest; the first movement of the mouse after a save
//! in another program reloads the mesh.

use std::{path::PathBuf, sync::Arc, time::Duration};

use bevy::{
    ecs::entity::EntityHashMap,
    prelude::*,
    tasks::{AsyncComputeTaskPool, Task, futures::check_ready},
};

use super::{
    files::{MeshSource, attend},
    notice::Notice,
};
use crate::{
    files::{Disk, LoadError, RealDisk, load_model},
    mesh::model::Model,
    plugins::{
        RigSystems,
        limits::RigLimits,
        mesh_reload::{ReloadAnswer, ReloadError, ReloadRequest},
        surface::RigMesh,
    },
};

/// Least time between two looks at the files.
const LOOK: Duration = Duration::from_millis(250);

/// Plugin that follows the files of open meshes.
pub struct MeshWatchPlugin;

impl Plugin for MeshWatchPlugin {
    fn build(&self, app: &mut App) {
        app.init_resource::<MeshWatches>()
            .init_resource::<RigLimits>()
            .add_message::<ReloadRequest>()
            .add_message::<ReloadAnswer>()
            .add_message::<Notice>()
            .add_systems(Update, (look, land, tell).chain().after(attend).before(RigSystems::Script));
    }
}

/// State of a file: its size and the time of its last change.
type FileState = Option<(u64, Option<std::time::SystemTime>)>;

/// Files of the open meshes.
#[derive(Resource, Default)]
struct MeshWatches {
    watches: EntityHashMap<MeshWatch>,
    since: Duration,
}

struct MeshWatch {
    path: PathBuf,
    /// State of the content that is open.
    known: FileState,
    /// Another state, seen once: a file that is being written is waited for.
    next: FileState,
    job: Option<Task<Result<Model, LoadError>>>,
}

fn state(path: &std::path::Path) -> FileState {
    RealDisk.entry(path, true).ok().map(|entry| (entry.len, entry.modified))
}

/// Looks whether a file has another state than that which is open, the same at two looks in a row.
fn look(meshes: Query<(Entity, &MeshSource), With<RigMesh>>, time: Res<Time<Real>>, mut watches: ResMut<MeshWatches>) {
    watches.since += time.delta();
    if watches.since < LOOK {
        return;
    }
    watches.since = Duration::ZERO;
    watches.watches.retain(|entity, _| meshes.contains(*entity));
    for (entity, source) in &meshes {
        let MeshSource::File(path) = source else { continue };
        let now = state(path);
        let watch = watches.watches.entry(entity).or_insert_with(|| MeshWatch {
            path: path.clone(),
            known: now,
            next: now,
            job: None,
        });
        if watch.path != *path {
            *watch = MeshWatch { path: path.clone(), known: now, next: now, job: None };
        }
        let is_settled = now == watch.next;
        watch.next = now;
        // A file that is not there for the moment, as between two steps of a save, is waited for.
        if now.is_none() || now == watch.known || !is_settled || watch.job.is_some() {
            continue;
        }
        watch.known = now;
        let path = path.clone();
        watch.job = Some(AsyncComputeTaskPool::get().spawn(async move { load_model(&RealDisk, &path) }));
    }
}

fn land(mut watches: ResMut<MeshWatches>, limits: Res<RigLimits>, mut commands: Commands) {
    for (entity, watch) in &mut watches.watches {
        let Some(result) = watch.job.as_mut().and_then(check_ready) else { continue };
        watch.job = None;
        let refused = match result {
            Ok(model) => match limits.check_model(&watch.path.display().to_string(), &model) {
                Ok(()) => {
                    commands.write_message(ReloadRequest { mesh: *entity, model: Arc::new(model) });
                    continue;
                }
                Err(error) => error.to_string(),
            },
            Err(error) => error.to_string(),
        };
        commands.write_message(Notice::error(format!("The changed mesh is not taken over: {refused}")));
    }
}

fn tell(mut answers: MessageReader<ReloadAnswer>, meshes: Query<&RigMesh>, mut commands: Commands) {
    for ReloadAnswer { mesh, result } in answers.read() {
        let name = meshes.get(*mesh).map_or("The mesh", |mesh| mesh.file.name.as_str());
        let notice = match result {
            Ok(report) => {
                let [before, now] = report.points;
                let points = if before == now { String::new() } else { format!("{now} points instead of {before}; ") };
                let weights = if report.weights.is_some() { "; its weights were transferred" } else { "" };
                let moved = report.moved;
                Notice::done(format!("{name} was read again: {points}points moved by {moved:.4} at most{weights}."))
            }
            Err(error @ ReloadError::Discarded) => Notice::info(format!("{name} was not read again: {error}.")),
            Err(error) => Notice::error(format!("{name} was not read again: {error}.")),
        };
        commands.write_message(notice);
    }
}
