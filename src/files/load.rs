//! Opening any file that Rigsmith reads, by path.

use std::path::{Path, PathBuf};

use super::{Disk, ModelFolder, ReadError, open, read_capped};
use crate::{
    mesh::{
        gltf::{self, GltfError, read_gltf},
        model::Model,
        obj::{self, ObjError, ObjSettings},
    },
    rig::{
        SourceError,
        project::{self, ReadProject, read_project},
        skin::{SkinFile, SkinFileError, content_hash},
        template::{self, Template, read_template},
        text::{self, RigText, RigTextError},
    },
};

/// Bytes of a glTF file, or of one of its buffers, that are read.
const MAX_GLTF_BYTES: u64 = 4 << 30;

/// Bytes of a `.rig` file that are read.
const MAX_RIG_BYTES: u64 = 1 << 30;

/// Bytes of a material library that are read.
const MAX_MTL_BYTES: u64 = 64 << 20;

/// The kinds of file, told apart by their names.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FileKind {
    /// `.obj`
    Obj,
    /// `.gltf`
    Gltf,
    /// `.glb`
    Glb,
    /// `.rig`
    RigText,
    /// `.rig.ron`
    Template,
    /// `.rigsmith.ron`
    Project,
    /// `.skin`
    Skin,
    /// `.ron` that is neither template nor project: a list of gestures
    Gestures,
}

impl FileKind {
    /// The kind of a file by its name; `None` if Rigsmith does not know it.
    pub fn of(path: &Path) -> Option<Self> {
        let name = path.file_name()?.to_string_lossy().to_ascii_lowercase();
        let endings = [
            (".rig.ron", Self::Template),
            (".rigsmith.ron", Self::Project),
            (".ron", Self::Gestures),
            (".rig", Self::RigText),
            (".skin", Self::Skin),
            (".obj", Self::Obj),
            (".gltf", Self::Gltf),
            (".glb", Self::Glb),
        ];
        endings.into_iter().find(|(ending, _)| name.ends_with(ending)).map(|(_, kind)| kind)
    }
}

/// Why a file could not be opened. The text names the file.
#[derive(Debug, thiserror::Error)]
pub enum LoadError {
    /// It could not be read at all.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// Its name has no ending that is known here.
    #[error("`{}`: {wanted}", path.display())]
    Kind {
        /// The file.
        path: PathBuf,
        /// What would do.
        wanted: &'static str,
    },
    /// An OBJ that is wrong.
    #[error("`{}`: {source}", path.display())]
    Obj {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        source: ObjError,
    },
    /// A glTF that is wrong; its text names the file.
    #[error(transparent)]
    Gltf(#[from] GltfError),
    /// A `.rig` that is wrong.
    #[error("`{}`: {source}", path.display())]
    RigText {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        source: RigTextError,
    },
    /// A RON file that is wrong.
    #[error("`{}`: {source}", path.display())]
    Source {
        /// The file.
        path: PathBuf,
        /// Its text, for reports that show the place.
        text: String,
        /// What is wrong, and where.
        source: SourceError,
    },
    /// A `.skin` that is wrong.
    #[error("`{}`: {source}", path.display())]
    Skin {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        source: SkinFileError,
    },
    /// The reader broke on the file.
    #[error("`{}`: the file broke the reader; it is damaged in a way that is not foreseen: export it again", path.display())]
    Broken {
        /// The file.
        path: PathBuf,
    },
}

/// Reads a mesh: `.obj`, `.gltf` or `.glb`.
pub fn load_model(disk: &dyn Disk, path: &Path) -> Result<Model, LoadError> {
    match FileKind::of(path) {
        Some(FileKind::Obj) => surviving(path, || load_obj(disk, path)),
        Some(FileKind::Gltf | FileKind::Glb) => surviving(path, || load_gltf(disk, path)),
        _ => Err(LoadError::Kind { path: path.into(), wanted: "no mesh; a mesh ends in .obj, .gltf or .glb" }),
    }
}

/// Runs a reader on a thread of its own, so that a panic in a dependency is an error here.
pub(super) fn surviving<T: Send>(
    path: &Path,
    read: impl FnOnce() -> Result<T, LoadError> + Send,
) -> Result<T, LoadError> {
    std::thread::scope(|scope| {
        let worker = std::thread::Builder::new().stack_size(16 << 20).spawn_scoped(scope, read);
        match worker {
            Ok(worker) => worker.join().unwrap_or_else(|_| Err(LoadError::Broken { path: path.into() })),
            Err(source) => Err(ReadError::Io { path: path.into(), source }.into()),
        }
    })
}

fn load_obj(disk: &dyn Disk, path: &Path) -> Result<Model, LoadError> {
    let file = open(disk, path)?;
    let folder = ModelFolder::of(disk, path)?;
    let mut sidecar = |uri: &str| {
        let limit = if uri.to_ascii_lowercase().ends_with(".mtl") { MAX_MTL_BYTES } else { gltf::MAX_IMAGE_BYTES };
        folder.read(uri, limit).ok()
    };
    obj::read_model(file, &stem(path), &ObjSettings::default(), &mut sidecar)
        .map_err(|source| LoadError::Obj { path: path.into(), source })
}

fn load_gltf(disk: &dyn Disk, path: &Path) -> Result<Model, LoadError> {
    let bytes = read_capped(disk, path, MAX_GLTF_BYTES)?;
    let folder = ModelFolder::of(disk, path)?;
    let mut external = |uri: &str| folder.read(uri, MAX_GLTF_BYTES).map_err(|error| error.to_string());
    Ok(read_gltf(&bytes, &path.display().to_string(), &mut external)?)
}

/// Reads a template.
pub fn load_template(disk: &dyn Disk, path: &Path) -> Result<Template, LoadError> {
    let bytes = read_capped(disk, path, template::MAX_BYTES as u64)?;
    read_template(&bytes).map_err(|source| in_source(path, &bytes, source))
}

/// Reads a `.rig` text.
pub fn load_rig_text(disk: &dyn Disk, path: &Path) -> Result<RigText, LoadError> {
    let bytes = read_capped(disk, path, MAX_RIG_BYTES)?;
    text::parse(&bytes).map_err(|source| LoadError::RigText { path: path.into(), source })
}

/// Reads a list of gestures.
pub fn load_gestures(disk: &dyn Disk, path: &Path) -> Result<Vec<crate::plugins::gesture::Gesture>, LoadError> {
    let bytes = read_capped(disk, path, crate::plugins::gesture::MAX_BYTES as u64)?;
    crate::plugins::gesture::read_gestures(&bytes).map_err(|source| in_source(path, &bytes, source))
}

/// Reads weights.
pub fn load_skin(disk: &dyn Disk, path: &Path) -> Result<SkinFile, LoadError> {
    Ok(load_hashed_skin(disk, path)?.0)
}

/// Reads weights, and tells the hash of the file.
pub(super) fn load_hashed_skin(disk: &dyn Disk, path: &Path) -> Result<(SkinFile, u64), LoadError> {
    let bytes = read_capped(disk, path, MAX_GLTF_BYTES)?;
    let file = SkinFile::read(&bytes).map_err(|source| LoadError::Skin { path: path.into(), source })?;
    Ok((file, content_hash(&bytes)))
}

/// Reads a project file alone, without what it names.
pub(super) fn load_project_file(disk: &dyn Disk, path: &Path) -> Result<ReadProject, LoadError> {
    let bytes = read_capped(disk, path, project::MAX_BYTES as u64)?;
    read_project(&bytes).map_err(|source| in_source(path, &bytes, source))
}

pub(super) fn in_source(path: &Path, bytes: &[u8], source: SourceError) -> LoadError {
    LoadError::Source { path: path.into(), text: String::from_utf8_lossy(bytes).into_owned(), source }
}

/// A file's name without folder and endings.
pub fn stem(path: &Path) -> String {
    let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    for ending in [".rig.ron", ".rigsmith.ron", ".obj", ".gltf", ".glb", ".rig", ".ron", ".skin"] {
        let split = name.len().saturating_sub(ending.len());
        if split > 0 && name.is_char_boundary(split) && name[split..].eq_ignore_ascii_case(ending) {
            return name[..split].to_owned();
        }
    }
    name
}
