//! Errors of parts of templates.

use std::{path::PathBuf, sync::Arc};

use super::{ReadError, SiteError};
use crate::rig::{SourceError, part::PartError};

/// Reason why a part of a template cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum PartFileError {
    /// A part that uses itself, at any depth.
    #[error("`{}` is a part of itself; take it out of one of the files", path.display())]
    Cycle {
        /// File of the part.
        path: PathBuf,
    },
    /// A file that the list of contents does not have.
    #[error("there is no file `{}`", path.display())]
    Missing {
        /// File of the part.
        path: PathBuf,
    },
    /// A file that neither the template's folder nor the folders of the site have.
    #[error("{source}; {folders} of the site's folders were searched, too")]
    Nowhere {
        /// Error of reading the file beside the template.
        source: ReadError,
        /// Number of folders of the site.
        folders: usize,
    },
    /// A file that no folder has, and parts that are called alike.
    #[error("there is no file `{}`; did you mean {nearest}?", path.display())]
    Similar {
        /// File of the part, beside its template.
        path: PathBuf,
        /// Names of such parts as a template calls them.
        nearest: String,
    },
    /// A file outside of the template's folder that the template names by an absolute path.
    #[error(
        "`{}` is outside of `{}`, the folder of the template that names it, and of the site's folders, and is not read; \
         name the part relative to the template, or name its folder as one of templates (RIGSMITH_TEMPLATES)",
        path.display(), folder.display()
    )]
    Outside {
        /// The file, as the template names it.
        path: PathBuf,
        /// The template's folder.
        folder: PathBuf,
    },
    /// A site file that cannot be read.
    #[error(transparent)]
    Site(#[from] SiteError),
    /// A file that cannot be read.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// A file that is no template, or has such a part itself.
    #[error("`{}`: {source}", path.display())]
    Template {
        /// File of the part.
        path: PathBuf,
        /// Place and reason in that file.
        source: SourceError,
    },
    /// A part that does not fit.
    #[error(transparent)]
    Part(#[from] PartError),
    /// A part that was refused before.
    #[error(transparent)]
    Again(Arc<PartFileError>),
}
