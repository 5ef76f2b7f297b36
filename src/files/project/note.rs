//! Notes about content of a project that was ignored, transferred or not found.

use std::{path::PathBuf, sync::Arc};

use crate::{
    algo::transfer::{TransferError, TransferReport},
    files::LoadError,
    rig::EditError,
};

/// Note about an opened project; a sentence for people without its full stop.
#[derive(Debug, Clone, thiserror::Error)]
pub enum ProjectNote {
    /// The reader of the project file ignored or corrected something.
    #[error("{0}")]
    File(String),
    /// A mesh cannot be loaded.
    #[error("a mesh of the project is not there: {0}; put it back and open the project again, its weights are kept")]
    MeshMissing(Arc<LoadError>),
    /// A mesh lies outside of the project's folder, and is not opened.
    #[error("a mesh of the project was refused: {0}; its weights are kept")]
    MeshOutside(Arc<LoadError>),
    /// A template lies outside of the project's folder, and is not followed.
    #[error(
        "the template `{0}` is outside of the project's folder and is not followed; copy it into that folder, or name its \
         folder as one of templates (RIGSMITH_TEMPLATES), and open the project again"
    )]
    TemplateOutside(String),
    /// A file outside of the project's folder is not opened, but one of its name in the folder is.
    #[error("the project names `{named}`, which is outside of its folder; `{}` is used instead", path.display())]
    FileBeside {
        /// The file as the project names it.
        named: String,
        /// The file that is used.
        path: PathBuf,
    },
    /// A mesh differs from the one with which the project was saved.
    #[error("the mesh `{}` has changed since the project was saved", .0.display())]
    MeshChanged(PathBuf),
    /// The project refers to weights outside of its folder.
    #[error("the weights `{0}` are not below the project's folder; put them there")]
    WeightsOutside(String),
    /// The file of weights differs from the one that the project was saved with.
    #[error("the weights `{}` were saved at another time than the project; they are used", .0.display())]
    WeightsOfAnotherTime(PathBuf),
    /// The file of weights cannot be read.
    #[error("{0}; without its weights the mesh has to be skinned again")]
    WeightsUnreadable(Arc<LoadError>),
    /// The rig refuses the weights.
    #[error("the weights of `{}` were left out: {error}", mesh.display())]
    WeightsRefused {
        /// File of the mesh.
        mesh: PathBuf,
        /// Answer of the rig.
        error: EditError,
    },
    /// The weights are of another mesh, and their file has no copy of that mesh.
    #[error("the weights of `{}` are of another mesh and cannot be transferred; skin it again", .0.display())]
    WeightsOfAnotherMesh(PathBuf),
    /// The weights were transferred to the changed mesh.
    #[error(
        "the weights were transferred to `{}`: {} points copied, {} matched, {} filled in, {} by the nearest",
        mesh.display(), report.copied, report.matched, report.inpainted, report.nearest
    )]
    WeightsTransferred {
        /// File of the mesh.
        mesh: PathBuf,
        /// Sources of the new weights.
        report: TransferReport,
    },
    /// The weights do not fit the changed mesh.
    #[error("the weights of `{}` cannot be transferred to the changed mesh: {error}", mesh.display())]
    WeightsNotTransferred {
        /// File of the mesh.
        mesh: PathBuf,
        /// Reason for the failure.
        error: TransferError,
    },
}

impl ProjectNote {
    /// True if a mesh or weights are missing, or may not be those that were saved.
    pub fn is_serious(&self) -> bool {
        !matches!(self, Self::File(_) | Self::MeshChanged(_) | Self::FileBeside { .. })
    }
}
