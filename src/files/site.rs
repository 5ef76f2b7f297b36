//! Folders of the site: where templates and parts are looked for besides the folder of a project.
//!
//! They are those of the environment variable [`TEMPLATES_VARIABLE`], then those of the site file, `rigsmith.ron` in the
//! user's configuration folder (or in the folder of `RIGSMITH_CONFIG`):
//!
//! ```ron
//! (
//!     templates: ["/srv/rigs", "rigs"], // a relative folder is one beside this file
//! )
//! ```

use std::{
    collections::BTreeSet,
    env,
    ffi::OsString,
    path::{Path, PathBuf},
};

use serde::Deserialize;

use super::{Disk, EntryKind, FileKind, ReadError, RealDisk, read::is_missing, read_capped};
use crate::rig::SourceError;

/// Environment variable with folders of templates, separated as in `PATH`.
pub const TEMPLATES_VARIABLE: &str = "RIGSMITH_TEMPLATES";

/// Name of the site file.
pub const SITE_FILE: &str = "rigsmith.ron";

/// Largest number of bytes of a site file that are read.
const MAX_BYTES: u64 = 1 << 20;

/// Reason for not reading the site file.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum SiteError {
    /// The file cannot be read.
    #[error("the site file: {0}")]
    Read(#[from] ReadError),
    /// The file is no site file.
    #[error("the site file `{}`: {source}", path.display())]
    Source {
        /// The file.
        path: PathBuf,
        /// Place and reason.
        source: SourceError,
    },
}

/// Folders in which templates are looked for, in their order.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct SearchPaths {
    /// The folders.
    pub folders: Vec<PathBuf>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct SiteContent {
    #[serde(default)]
    templates: Vec<PathBuf>,
}

impl SearchPaths {
    /// The folders of this machine's site.
    ///
    /// # Errors
    /// A site file that cannot be read. One that is not there is no error.
    pub fn of_site() -> Result<Self, SiteError> {
        Self::read(&RealDisk, env::var_os(TEMPLATES_VARIABLE), configuration().as_deref())
    }

    /// The folders of a variable, then those of the site file in a folder.
    ///
    /// # Errors
    /// A site file that cannot be read. One that is not there is no error.
    pub fn read(disk: &dyn Disk, variable: Option<OsString>, folder: Option<&Path>) -> Result<Self, SiteError> {
        let mut folders: Vec<PathBuf> = variable.iter().flat_map(env::split_paths).collect();
        folders.retain(|folder| !folder.as_os_str().is_empty());
        if let Some(folder) = folder {
            let path = folder.join(SITE_FILE);
            match read_capped(disk, &path, MAX_BYTES) {
                Ok(bytes) => folders.extend(listed(&path, &bytes)?.into_iter().map(|listed| folder.join(listed))),
                Err(ReadError::Missing { .. } | ReadError::Empty { .. }) => {}
                Err(error) => return Err(error.into()),
            }
        }
        let mut seen = BTreeSet::new();
        folders.retain(|folder| seen.insert(folder.clone()));
        Ok(Self { folders })
    }

    /// Files that a name may mean, in order; none for an absolute path.
    pub fn candidates<'s>(&'s self, name: &'s Path) -> impl Iterator<Item = PathBuf> + 's {
        self.folders.iter().filter(|_| name.is_relative()).map(move |folder| folder.join(name))
    }

    /// The file of a template that is called by its name, with or without `.rig.ron`: the first of the folders that has it.
    /// Where it cannot be told whether a folder has it, it counts as found there: another one is not taken for it.
    pub fn find(&self, disk: &dyn Disk, name: &Path) -> Option<PathBuf> {
        let is_file = |path: &PathBuf| match disk.entry(path, true) {
            Ok(entry) => entry.kind == EntryKind::File,
            Err(error) => !is_missing(&error),
        };
        let named = with_ending(name);
        self.candidates(&named).find(is_file)
    }
}

/// The name of a template's file.
pub(super) fn with_ending(name: &Path) -> PathBuf {
    if FileKind::of(name) == Some(FileKind::Template) {
        return name.to_owned();
    }
    let mut named = name.as_os_str().to_owned();
    named.push(".rig.ron");
    named.into()
}

fn listed(path: &Path, bytes: &[u8]) -> Result<Vec<PathBuf>, SiteError> {
    let fault = |source| SiteError::Source { path: path.to_owned(), source };
    let text = std::str::from_utf8(bytes)
        .map_err(|error| fault(SourceError::at("", 0, format!("it is no UTF-8 text: {error}; save it as UTF-8"))))?;
    let content: SiteContent = ron::from_str(text).map_err(|error| fault(SourceError::from_ron(text, &error)))?;
    Ok(content.templates)
}

/// The user's configuration folder of Rigsmith; `None` where nobody knows a home.
fn configuration() -> Option<PathBuf> {
    let set = |name: &str| env::var_os(name).filter(|value| !value.is_empty()).map(PathBuf::from);
    if let Some(chosen) = set("RIGSMITH_CONFIG") {
        return Some(chosen);
    }
    if cfg!(windows) {
        return set("APPDATA").map(|folder| folder.join("rigsmith").join("config"));
    }
    let home = set("HOME");
    let folder = match cfg!(target_os = "macos") {
        true => home?.join("Library").join("Application Support"),
        false => {
            set("XDG_CONFIG_HOME").filter(|folder| folder.is_absolute()).or(home.map(|home| home.join(".config")))?
        }
    };
    Some(folder.join("rigsmith"))
}
