//! Model files of meshes: a version that is saved takes the mesh's place, in a game as in the window.
//!
//! The files are looked at again and again in the background, with those that they name ([`ModelWatch`]), so every way of
//! saving is noticed, on every file system. A file that cannot be read changes nothing and is told ([`ModelFault`]).

use std::{
    collections::{BTreeMap, BTreeSet},
    path::{Path, PathBuf},
    sync::Arc,
    time::{Duration, Instant},
};

use bevy::{
    prelude::*,
    tasks::{AsyncComputeTaskPool, Task, futures::check_ready},
};

use crate::{
    files::{LoadError, ModelWatch, RealDisk, SETTLE},
    mesh::model::Model,
    plugins::{
        limits::{LimitError, RigLimits},
        mesh_reload::{MeshReloadPlugin, ReloadRequest},
        surface::RigMesh,
    },
};

/// Plugin that follows [`ModelFile`]s. Add it after [`RigPlugins`](crate::plugins::RigPlugins) where an app has them; it adds
/// what it needs of them otherwise. [`ReloadAnswer`](crate::plugins::mesh_reload::ReloadAnswer) tells each exchange, and how far
/// points moved.
#[derive(Debug, Clone)]
pub struct ModelFilesPlugin {
    /// Time between two looks at the files.
    pub look: Duration,
    /// Time for which a file has to stand still before it is read.
    pub settle: Duration,
}

impl Default for ModelFilesPlugin {
    fn default() -> Self {
        Self { look: Duration::from_millis(100), settle: SETTLE }
    }
}

impl Plugin for ModelFilesPlugin {
    fn build(&self, app: &mut App) {
        if !app.is_plugin_added::<MeshReloadPlugin>() {
            app.add_plugins(MeshReloadPlugin);
        }
        app.init_resource::<RigLimits>()
            .insert_resource(FollowedModels {
                look: self.look,
                settle: self.settle,
                looked: None,
                watches: Some(BTreeMap::new()),
                task: None,
                known: BTreeSet::new(),
            })
            .add_message::<ModelFault>()
            .add_systems(PreUpdate, follow_models);
    }
}

/// File of the [`RigMesh`] on the same entity. When another version of it is saved, that takes the mesh's place: joints stay, and
/// weights are transferred. The version on the disk when the component is seen first counts as the mesh's own.
///
/// ```
/// use bevy::prelude::*;
/// use rigsmith::{
///     files::{RealDisk, load_model},
///     instance::ModelFile,
///     plugins::surface::{RigMesh, SkinOf},
///     rig::Uid,
/// };
///
/// /// Spawns the mesh of a character, which follows its file.
/// fn spawn_mesh(commands: &mut Commands, character: Entity, path: &str) {
///     if let Ok(model) = load_model(&RealDisk, path.as_ref()) {
///         let mesh = RigMesh::new(Uid(1), model, Vec::new());
///         commands.spawn((mesh, SkinOf(character), ModelFile(path.into())));
///     }
/// }
/// ```
#[derive(Component, Reflect, Debug, Clone, PartialEq, Eq)]
#[reflect(opaque)]
#[reflect(Component, Clone, Debug)]
pub struct ModelFile(pub PathBuf);

/// A changed model file cannot be taken over; the mesh stays as it is.
#[derive(Message, Debug, Clone)]
pub struct ModelFault {
    /// The mesh.
    pub mesh: Entity,
    /// The reason.
    pub error: Arc<ModelFileError>,
}

/// Reason for which a changed model file is not taken over.
#[derive(Debug, thiserror::Error)]
pub enum ModelFileError {
    /// The file cannot be read.
    #[error(transparent)]
    Load(#[from] LoadError),
    /// The model has more than is taken.
    #[error(transparent)]
    Limit(#[from] LimitError),
}

type Watches = BTreeMap<PathBuf, ModelWatch>;
type ReadModels = Vec<(PathBuf, Result<Model, LoadError>)>;

/// Files of [`ModelFile`]s that are followed.
#[derive(Resource)]
pub struct FollowedModels {
    look: Duration,
    settle: Duration,
    looked: Option<Instant>,
    /// The watches, unless a task looks at the files.
    watches: Option<Watches>,
    task: Option<Task<(Watches, ReadModels)>>,
    /// Files of the last finished look.
    known: BTreeSet<PathBuf>,
}

impl FollowedModels {
    /// True once a file has been looked at: a version that is saved from then on is noticed.
    pub fn is_followed(&self, file: &Path) -> bool {
        self.known.contains(file)
    }
}

/// Looks at the files of all meshes, and requests the exchange of those that changed.
fn follow_models(
    meshes: Query<(Entity, &ModelFile), With<RigMesh>>,
    limits: Res<RigLimits>,
    mut followed: ResMut<FollowedModels>,
    mut requests: MessageWriter<ReloadRequest>,
    mut faults: MessageWriter<ModelFault>,
) {
    let followed = followed.bypass_change_detection();
    let is_due = followed.looked.is_none_or(|looked| looked.elapsed() >= followed.look);
    let is_idle = meshes.is_empty() && followed.watches.as_ref().is_some_and(BTreeMap::is_empty);
    if let Some(watches) = followed.watches.take_if(|_| is_due && !is_idle) {
        followed.looked = Some(Instant::now());
        let wanted: BTreeSet<PathBuf> = meshes.iter().map(|(_, file)| file.0.clone()).collect();
        let settle = followed.settle;
        followed.task = Some(AsyncComputeTaskPool::get().spawn(async move { looked_at(watches, wanted, settle) }));
    }
    let Some((watches, read)) = followed.task.as_mut().and_then(check_ready) else { return };
    followed.task = None;
    if !followed.known.iter().eq(watches.keys()) {
        followed.known = watches.keys().cloned().collect();
    }
    followed.watches = Some(watches);
    for (path, model) in read {
        let checked = model.map_err(ModelFileError::from).and_then(|model| {
            limits.check_model(&path.display().to_string(), &model)?;
            Ok(model)
        });
        let users = meshes.iter().filter(|(_, file)| file.0 == path).map(|(mesh, _)| mesh);
        match checked {
            Ok(model) => {
                let model = Arc::new(model);
                for mesh in users {
                    requests.write(ReloadRequest { mesh, model: model.clone() });
                }
            }
            Err(error) => {
                let error = Arc::new(error);
                for mesh in users {
                    faults.write(ModelFault { mesh, error: error.clone() });
                }
            }
        }
    }
}

/// Looks at the files that are wanted. Returns the watches, and models of which another version was read.
fn looked_at(mut watches: Watches, wanted: BTreeSet<PathBuf>, settle: Duration) -> (Watches, ReadModels) {
    watches.retain(|path, _| wanted.contains(path));
    let mut read = Vec::new();
    for path in wanted {
        let watch = watches.entry(path.clone()).or_insert_with(|| {
            let mut watch = ModelWatch::new(&path).settling(settle);
            watch.know(&RealDisk);
            watch
        });
        if watch.look(&RealDisk)
            && let Some(model) = watch.read(&RealDisk)
        {
            read.push((path, model));
        }
    }
    (watches, read)
}
