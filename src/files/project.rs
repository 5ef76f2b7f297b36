//! Projects on the disk: the project file, the weights beside it, and the meshes it names.

mod open;
mod path;
mod save;

use std::{path::PathBuf, sync::Arc};

use glam::Vec3;

pub use open::load_project;
pub use save::{ProjectFiles, project_files, store_project};

use super::LoadError;
use crate::{
    mesh::model::Model,
    rig::{
        Rig, Uid,
        project::{JournalReference, ProjectView},
        skin::{SkinFile, mesh_hash},
    },
};

/// What [`store_project`] saves. Meshes and weights are shared, so it is cheap to put together and to send to a task.
#[derive(Debug, Clone, Default)]
pub struct ProjectToSave {
    /// The project's name.
    pub name: String,
    /// Its rigs, with their weights and poses.
    pub rigs: Vec<Rig>,
    /// The meshes that they move.
    pub meshes: Vec<MeshToSave>,
    /// How it is looked at.
    pub view: ProjectView,
    /// The journal that goes on from here.
    pub journal: Option<JournalReference>,
}

/// A mesh of a project and its geometry: a [`MeshShape`] to save, or a [`MeshState`] as it was found.
#[derive(Debug, Clone)]
pub struct ProjectMesh<S> {
    /// Identity.
    pub uid: Uid,
    /// The rig that moves it.
    pub rig: Uid,
    /// Where its file is, or should be.
    pub path: PathBuf,
    /// The joint that each node of the file became.
    pub nodes: Arc<[Uid]>,
    /// Its geometry.
    pub shape: S,
}

/// A mesh of a project that is saved.
pub type MeshToSave = ProjectMesh<MeshShape>;

/// A mesh of a project as opened.
pub type LoadedMesh = ProjectMesh<MeshState>;

/// The geometry of a project's mesh, as far as there is any.
#[derive(Debug, Clone)]
pub enum MeshShape {
    /// The mesh is open.
    Open {
        /// The mesh where its file's joints hold it at rest.
        rest: Arc<Model>,
        /// Triangles over its points.
        triangles: Arc<[[u32; 3]]>,
    },
    /// The mesh was not found; what the project knows about it is kept.
    Missing {
        /// Its hash when it was there.
        hash: u128,
        /// Its weights as they were read.
        skin: Option<Arc<SkinFile>>,
    },
}

impl MeshShape {
    fn hash(&self) -> u128 {
        match self {
            Self::Open { rest, triangles } => mesh_hash(&rest.points, triangles),
            Self::Missing { hash, .. } => *hash,
        }
    }

    /// Points and triangles.
    fn geometry(&self) -> Option<(&[Vec3], &[[u32; 3]])> {
        match self {
            Self::Open { rest, triangles } => Some((&rest.points, triangles)),
            Self::Missing { skin, .. } => skin.as_ref()?.mesh().map(|mesh| (&mesh.points[..], &mesh.triangles[..])),
        }
    }
}

/// A project as opened.
#[derive(Debug)]
pub struct LoadedProject {
    /// The project's name.
    pub name: String,
    /// Its rigs, with their weights and poses.
    pub rigs: Vec<Rig>,
    /// The meshes that they move.
    pub meshes: Vec<LoadedMesh>,
    /// How it was looked at.
    pub view: ProjectView,
    /// The journal that goes on from here.
    pub journal: Option<JournalReference>,
    /// What was passed over, transferred or missing, a sentence each.
    pub notes: Vec<String>,
}

/// What became of a project's mesh.
#[derive(Debug)]
pub enum MeshState {
    /// It was found.
    Open {
        /// The mesh as its file has it.
        model: Box<Model>,
        /// True if that is another mesh than when the project was saved.
        changed: bool,
    },
    /// It was not. Its weights are in the rig all the same.
    Missing {
        /// Why.
        error: LoadError,
        /// What to save in its place.
        shape: MeshShape,
    },
}
