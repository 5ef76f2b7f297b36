//! The open document: what it is called, where it is saved, what of it is saved, and its journal.

use std::{path::PathBuf, sync::Arc, time::Duration};

use bevy::{prelude::*, tasks::IoTaskPool};
use serde::{Deserialize, Serialize};

use super::{super::notice::Notice, active};
use crate::{
    files::{
        MeshToSave, RealDisk,
        journal::{Journal, JournalPlaces},
    },
    plugins::{
        history::RigHistory,
        surface::{RigMesh, RigMeshes},
    },
    rig::{Uid, step::Step},
};

/// On the rig that is edited: where it comes from and where it goes.
#[derive(Component)]
pub struct OpenDocument {
    /// What the title says.
    pub name: String,
    /// The project file; `None` before the first save.
    pub project: Option<PathBuf>,
    pub(super) saved: SavedAt,
    pub(super) journal: Journal,
    /// Meshes of the project that were not found, to be saved again as they were.
    pub(super) missing: Vec<MeshToSave>,
    /// True once it is known where the journal lies, and that was told if it is not where it should be.
    pub(super) is_placed: bool,
}

impl OpenDocument {
    /// The journal.
    pub fn journal(&self) -> &Journal {
        &self.journal
    }
}

/// Which state of the document is in a file.
#[derive(Debug, Clone)]
pub(super) enum SavedAt {
    /// The one after this step; before the first for `None`.
    Step(Option<Arc<Step>>),
    /// None.
    Nowhere,
}

/// Where an open mesh comes from.
#[derive(Component, Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub enum MeshSource {
    /// It comes with the program.
    Bundled,
    /// A file.
    File(PathBuf),
}

/// The folder for journals of what is in no project yet.
#[derive(Resource, Debug, Clone)]
pub struct StateFolder(pub Option<PathBuf>);

impl Default for StateFolder {
    /// `RIGSMITH_STATE`, or the user's folder for such data.
    fn default() -> Self {
        let chosen = std::env::var_os("RIGSMITH_STATE").filter(|folder| !folder.is_empty()).map(PathBuf::from);
        Self(chosen.or_else(|| {
            directories::ProjectDirs::from("", "", "rigsmith").map(|dirs| dirs.data_local_dir().to_owned())
        }))
    }
}

/// Where journals of a document may lie.
pub(in crate::editor) fn places(world: &World, project: Option<PathBuf>) -> JournalPlaces {
    JournalPlaces { project, state: world.get_resource::<StateFolder>().and_then(|folder| folder.0.clone()) }
}

/// The step that the document stands after.
pub(super) fn last_step(world: &World, rig: Entity) -> Option<Arc<Step>> {
    world.get::<RigHistory>(rig)?.last().cloned()
}

/// True if two steps are the same one.
pub(super) fn is_same(a: &Option<Arc<Step>>, b: &Option<Arc<Step>>) -> bool {
    match (a, b) {
        (None, None) => true,
        (Some(a), Some(b)) => Arc::ptr_eq(a, b),
        _ => false,
    }
}

/// True if the document is not as some file has it.
pub(in crate::editor) fn is_unsaved(world: &World, rig: Entity) -> bool {
    match world.get::<OpenDocument>(rig).map(|document| &document.saved) {
        Some(SavedAt::Step(saved)) => {
            let now = world.get::<RigHistory>(rig).and_then(RigHistory::last);
            !match (saved, now) {
                (None, None) => true,
                (Some(saved), Some(now)) => Arc::ptr_eq(saved, now),
                _ => false,
            }
        }
        Some(SavedAt::Nowhere) => true,
        None => false,
    }
}

/// The meshes that the rig moves, in the order of their uids.
pub(super) fn meshes(world: &World, rig: Entity) -> Vec<(Entity, &RigMesh, Option<&MeshSource>)> {
    let entities: Vec<Entity> = world.get::<RigMeshes>(rig).map(|meshes| meshes.iter().collect()).unwrap_or_default();
    let mut meshes: Vec<_> = entities
        .into_iter()
        .filter_map(|entity| Some((entity, world.get::<RigMesh>(entity)?, world.get::<MeshSource>(entity))))
        .collect();
    meshes.sort_by_key(|(_, mesh, _)| mesh.uid);
    meshes
}

/// What the journal keeps besides the rig: which meshes are open.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(default)]
pub(in crate::editor) struct Context {
    pub name: String,
    pub meshes: Vec<ContextMesh>,
}

/// An open mesh.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub(in crate::editor) struct ContextMesh {
    pub uid: Uid,
    pub source: MeshSource,
    pub nodes: Vec<Uid>,
}

impl Context {
    pub fn text(&self) -> String {
        ron::to_string(self).unwrap_or_default()
    }
}

/// Tells once if the journal lies somewhere else than it should.
pub(super) fn watch_places(world: &mut World) {
    let Some(rig) = active(world) else { return };
    let Some(document) = world.get::<OpenDocument>(rig).filter(|document| !document.is_placed) else { return };
    let Some(path) = document.journal.path() else { return };
    let folder = path.parent().map(std::path::Path::to_path_buf);
    let state = world.get_resource::<StateFolder>().and_then(|folder| folder.0.clone());
    let beside = document.project.as_ref().and_then(|project| project.parent().map(std::path::Path::to_path_buf));
    let expected = folder == state || folder == beside;
    if let Some(mut document) = world.get_mut::<OpenDocument>(rig) {
        document.is_placed = true;
    }
    if let (false, Some(folder)) = (expected, folder) {
        let wanted = state.map_or_else(|| "a folder of its own".to_owned(), |folder| folder.display().to_string());
        world.write_message(Notice::warning(format!(
            "Changes are kept in {} because {wanted} cannot be written; allow that, or set RIGSMITH_STATE to another folder",
            folder.display()
        )));
    }
}

/// Ends the journal of the open document: nothing of it is to be recovered. With `wait`, does so before it returns.
pub(super) fn close_journal(world: &World, wait: bool) {
    let Some(document) = active(world).and_then(|rig| world.get::<OpenDocument>(rig)) else { return };
    let journal = document.journal.clone();
    if wait {
        if let Err(reason) = journal.close(Duration::from_secs(1)) {
            warn!("the journal could not be removed: {reason}");
        }
    } else {
        // The last handle waits for the disk: not in a frame.
        let close = async move {
            if let Err(reason) = journal.close(Duration::from_secs(10)) {
                warn!("the journal could not be removed: {reason}");
            }
        };
        IoTaskPool::get().spawn(close).detach();
    }
}

/// The disk, for journals.
pub(in crate::editor) fn disk() -> Arc<dyn crate::files::Disk> {
    Arc::new(RealDisk)
}
