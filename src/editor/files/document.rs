//! The open document: its name, its file, its saved state and its journal.

use std::{path::PathBuf, sync::Arc, time::Duration};

use bevy::{prelude::*, tasks::IoTaskPool};
use serde::{Deserialize, Serialize};

use super::{super::notice::Notice, active, file_name};
use crate::{
    files::{
        Disk, MeshToSave, RealDisk, TemplateBase,
        journal::{Journal, JournalPlaces, journal_beside},
    },
    plugins::{
        history::RigHistory,
        surface::{RigMesh, RigMeshes},
    },
    rig::{Uid, step::Step},
};

/// Component of the edited rig with its file and journal.
#[derive(Component)]
pub struct OpenDocument {
    /// Name in the window's title.
    pub name: String,
    /// The project file; `None` before the first save.
    pub project: Option<PathBuf>,
    /// The template that was opened; its text is what a template is saved over.
    pub(in crate::editor) template: Option<PathBuf>,
    /// The version of the template that a project's rig took over last.
    pub(in crate::editor) base: Option<TemplateBase>,
    pub(super) saved: SavedAt,
    pub(super) journal: Journal,
    /// Meshes of the project that were not found; they are saved again unchanged.
    pub(super) missing: Vec<MeshToSave>,
    /// Meshes that are not in the document at present, and that undo and redo bring back.
    pub(super) set_aside: Vec<(RigMesh, MeshSource)>,
    /// Marks that the place of the journal is known, and that a notice was sent if it is not the usual one.
    pub(super) is_placed: bool,
}

impl OpenDocument {
    /// The journal.
    pub fn journal(&self) -> &Journal {
        &self.journal
    }
}

/// State of the document that is in a file.
#[derive(Debug, Clone)]
pub(super) enum SavedAt {
    /// The state after this step; before the first for `None`.
    Step(Option<Arc<Step>>),
    /// The state is in no file.
    Nowhere,
}

/// Source of an open mesh.
#[derive(Component, Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub enum MeshSource {
    /// A mesh that comes with Rigsmith, by name.
    Bundled(String),
    /// A mesh file.
    File(PathBuf),
}

/// Folder for journals of documents without a project.
#[derive(Resource, Debug, Clone)]
pub struct StateFolder(pub Option<PathBuf>);

impl Default for StateFolder {
    /// `RIGSMITH_STATE`, or the user's folder for application state.
    fn default() -> Self {
        let chosen = std::env::var_os("RIGSMITH_STATE").filter(|folder| !folder.is_empty()).map(PathBuf::from);
        Self(chosen.or_else(|| {
            directories::ProjectDirs::from("", "", "rigsmith").map(|dirs| dirs.data_local_dir().to_owned())
        }))
    }
}

/// Places for the journal of a document.
pub(in crate::editor) fn places(world: &World, project: Option<PathBuf>) -> JournalPlaces {
    JournalPlaces { project, state: world.get_resource::<StateFolder>().and_then(|folder| folder.0.clone()) }
}

/// The last step in effect.
pub(super) fn last_step(world: &World, rig: Entity) -> Option<Arc<Step>> {
    world.get::<RigHistory>(rig)?.last().cloned()
}

/// Returns `true` if two steps are identical.
pub(super) fn is_same(a: &Option<Arc<Step>>, b: &Option<Arc<Step>>) -> bool {
    match (a, b) {
        (None, None) => true,
        (Some(a), Some(b)) => Arc::ptr_eq(a, b),
        _ => false,
    }
}

/// Returns `true` if no file holds the document's state.
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

/// Meshes of the rig, in the order of their uids.
pub(super) fn meshes(world: &World, rig: Entity) -> Vec<(Entity, &RigMesh, Option<&MeshSource>)> {
    let entities: Vec<Entity> = world.get::<RigMeshes>(rig).map(|meshes| meshes.iter().collect()).unwrap_or_default();
    let mut meshes: Vec<_> = entities
        .into_iter()
        .filter_map(|entity| Some((entity, world.get::<RigMesh>(entity)?, world.get::<MeshSource>(entity))))
        .collect();
    meshes.sort_by_key(|(_, mesh, _)| mesh.uid);
    meshes
}

/// Context stored in the journal besides the rig: the open meshes, and those that are set aside.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(default)]
pub(in crate::editor) struct Context {
    pub name: String,
    pub meshes: Vec<ContextMesh>,
}

/// A mesh of a document.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub(in crate::editor) struct ContextMesh {
    pub uid: Uid,
    pub source: MeshSource,
    pub nodes: Vec<Uid>,
    /// Marks a mesh that was not in the document when this was written. Changes of the journal that name the mesh count
    /// more.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub is_set_aside: bool,
}

impl ContextMesh {
    pub fn of(mesh: &RigMesh, source: &MeshSource, is_set_aside: bool) -> Self {
        Self { uid: mesh.uid, source: source.clone(), nodes: mesh.nodes.to_vec(), is_set_aside }
    }
}

/// Context of the open document under a name.
pub(super) fn context(world: &World, rig: Entity, name: String) -> Context {
    let open = meshes(world, rig).into_iter();
    let mut listed: Vec<ContextMesh> =
        open.filter_map(|(_, mesh, source)| Some(ContextMesh::of(mesh, source?, false))).collect();
    let set_aside = world.get::<OpenDocument>(rig).into_iter().flat_map(|document| &document.set_aside);
    listed.extend(set_aside.map(|(mesh, source)| ContextMesh::of(mesh, source, true)));
    Context { name, meshes: listed }
}

impl Context {
    pub fn text(&self) -> String {
        ron::to_string(self).unwrap_or_default()
    }
}

/// Sends a notice once if the journal is not at its usual place: where it cannot be written, or where the journal of
/// another window on the same project is.
pub(super) fn watch_places(world: &mut World) {
    let Some(rig) = active(world) else { return };
    let Some(document) = world.get::<OpenDocument>(rig).filter(|document| !document.is_placed) else { return };
    let Some(path) = document.journal.path() else { return };
    let folder = path.parent().map(std::path::Path::to_path_buf);
    let state = world.get_resource::<StateFolder>().and_then(|folder| folder.0.clone());
    let beside = document.project.as_ref().and_then(|project| project.parent().map(std::path::Path::to_path_buf));
    let expected = folder == state || folder == beside;
    let elsewhere = document.project.as_ref().filter(|project| {
        let beside = journal_beside(project);
        beside != path && RealDisk.is_locked(&beside).unwrap_or(false)
    });
    let other_window = elsewhere.map(|project| {
        Notice::warning(format!(
            "{} is open in another window, too: whoever saves last replaces the work of the other; close one of the two",
            file_name(project)
        ))
        .named()
    });
    if let Some(mut document) = world.get_mut::<OpenDocument>(rig) {
        document.is_placed = true;
    }
    if let Some(notice) = other_window {
        world.write_message(notice);
        return;
    }
    if let (false, Some(folder)) = (expected, folder) {
        let wanted = state.map_or_else(|| "a folder of its own".to_owned(), |folder| folder.display().to_string());
        world.write_message(Notice::warning(format!(
            "Changes are kept in {} because {wanted} cannot be written; allow that, or set RIGSMITH_STATE to another folder",
            folder.display()
        )));
    }
}

/// Ends the journal of the open document, so that no recovery of it is offered later. With `wait`, it ends before the
/// function returns.
pub(super) fn close_journal(world: &World, wait: bool) {
    let Some(document) = active(world).and_then(|rig| world.get::<OpenDocument>(rig)) else { return };
    let journal = document.journal.clone();
    if wait {
        if let Err(reason) = journal.close(Duration::from_secs(1)) {
            warn!("the journal could not be removed: {reason}");
        }
    } else {
        // Dropping the last handle waits for the disk, which must not happen in a frame.
        let close = async move {
            if let Err(reason) = journal.close(Duration::from_secs(10)) {
                warn!("the journal could not be removed: {reason}");
            }
        };
        IoTaskPool::get().spawn(close).detach();
    }
}

/// The disk on which journals are written.
pub(in crate::editor) fn disk() -> Arc<dyn crate::files::Disk> {
    Arc::new(RealDisk)
}
