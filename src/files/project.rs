//! Projects on the disk: the project file, the weights beside it, and the meshes that it refers to.

mod note;
mod open;
mod path;
mod save;

use std::{path::PathBuf, sync::Arc};

use glam::Vec3;

pub use note::ProjectNote;
pub use open::load_project;
pub use save::{ProjectFiles, project_files, store_project};

use super::{LoadError, TemplateBase};
use crate::{
    mesh::model::Model,
    rig::{
        Rig, Uid,
        animation::NodeNames,
        project::{JournalReference, ProjectView},
        skin::{SkinFile, mesh_hash},
    },
};

/// Content of a project for [`store_project`]. Meshes and weights are shared, so that the value is cheap to make and to
/// send to a task.
#[derive(Debug, Clone, Default)]
pub struct ProjectToSave {
    /// The project's name.
    pub name: String,
    /// Rigs of the project, with their weights and poses.
    pub rigs: Vec<Rig>,
    /// Meshes that the rigs move.
    pub meshes: Vec<MeshToSave>,
    /// Templates that the rigs follow.
    pub templates: Vec<ProjectTemplate>,
    /// View of the project: camera, tool and display settings.
    pub view: ProjectView,
    /// Journal that continues from this save.
    pub journal: Option<JournalReference>,
    /// Names of animated nodes that are no joints of the rigs, nodes that were deleted included: see
    /// [`Project`](crate::rig::project::Project).
    pub names: NodeNames,
}

/// A template that a rig of a project follows.
#[derive(Debug, Clone, PartialEq)]
pub struct ProjectTemplate {
    /// The rig.
    pub rig: Uid,
    /// File of the template, which may be missing.
    pub path: PathBuf,
    /// The version of the template that the rig took over last.
    pub base: TemplateBase,
}

/// A mesh of a project and its geometry: a [`MeshShape`] to save, or a [`MeshState`] as it was loaded.
#[derive(Debug, Clone)]
pub struct ProjectMesh<S> {
    /// Uid of the mesh.
    pub uid: Uid,
    /// Rig that moves the mesh.
    pub rig: Uid,
    /// Path of the mesh's file, which may be missing.
    pub path: PathBuf,
    /// Joint that each node of the file became.
    pub nodes: Arc<[Uid]>,
    /// Geometry of the mesh.
    pub shape: S,
}

/// A mesh of a project that is saved.
pub type MeshToSave = ProjectMesh<MeshShape>;

/// A mesh of a project as opened.
pub type LoadedMesh = ProjectMesh<MeshState>;

/// Geometry of a project's mesh, or the data that stand in for a missing mesh.
#[derive(Debug, Clone)]
pub enum MeshShape {
    /// The mesh is open.
    Open {
        /// The mesh at rest, skinned to the joints of its own file.
        rest: Arc<Model>,
        /// Triangles over the mesh's points.
        triangles: Arc<[[u32; 3]]>,
    },
    /// The mesh was not found; the project's data about it are kept.
    Missing {
        /// Hash of the mesh when it was last open.
        hash: u128,
        /// Weights of the mesh, as they were read.
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

    /// Points (in the model's space) and triangles, if they are known.
    fn geometry(&self) -> Option<(&[Vec3], &[[u32; 3]])> {
        match self {
            Self::Open { rest, triangles } => Some((&rest.points, triangles)),
            Self::Missing { skin, .. } => skin.as_ref()?.mesh().map(|mesh| (&mesh.points[..], &mesh.triangles[..])),
        }
    }
}

/// An opened project.
#[derive(Debug)]
pub struct LoadedProject {
    /// The project's name.
    pub name: String,
    /// Rigs of the project, with their weights and poses.
    pub rigs: Vec<Rig>,
    /// Meshes that the rigs move.
    pub meshes: Vec<LoadedMesh>,
    /// Templates that the rigs follow.
    pub templates: Vec<ProjectTemplate>,
    /// View of the project: camera, tool and display settings.
    pub view: ProjectView,
    /// Journal that continues from this save.
    pub journal: Option<JournalReference>,
    /// Notes about ignored, transferred or missing content.
    pub notes: Vec<ProjectNote>,
}

/// Result of loading a project's mesh.
#[derive(Debug)]
pub enum MeshState {
    /// The mesh was found.
    Open {
        /// The mesh as its file has it.
        model: Box<Model>,
        /// True if the mesh differs from the one with which the project was saved.
        changed: bool,
    },
    /// The mesh was not found. Its weights are in the rig nevertheless.
    Missing {
        /// Reason for not loading the mesh.
        error: Arc<LoadError>,
        /// Geometry to save in place of the mesh's own.
        shape: MeshShape,
    },
}
