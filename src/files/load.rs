//! Loader of any file that Rigsmith reads, by path.

use std::{
    panic::{AssertUnwindSafe, catch_unwind},
    path::{Path, PathBuf},
    sync::{Mutex, PoisonError},
};

use super::{
    Disk, ModelFolder, PartFiles, ReadError, UriError, open, parts::named_template, read::read_plausible, read_capped,
};
use crate::{
    mesh::{
        gltf::{self, ExternalError, ExternalFile, GltfError, read_gltf},
        model::Model,
        obj::{self, ObjError, ObjSettings, SidecarFile},
    },
    rig::{
        SourceError,
        animation::{
            joint_map::{self, NamePairs, read_joint_map},
            motion::Motion,
        },
        format::{
            animation::{self, ReadAnimation, read_animation},
            bvh::{self, BvhError, read_bvh},
        },
        project::{self, ReadProject, read_project},
        skin::{SkinFile, SkinFileError, content_hash},
        template::{self, Template},
        text::{self, RigText, RigTextError},
    },
    solve::packed_clip::{PackedClipError, PackedSkeleton},
};

/// Largest size in bytes of a glTF file, or of one of its buffers, that is read.
const MAX_GLTF_BYTES: u64 = 4 << 30;

/// Largest size in bytes of a `.rig` file that is read.
const MAX_RIG_BYTES: u64 = 1 << 30;

/// Largest size in bytes of a BVH file that is read.
const MAX_BVH_BYTES: u64 = 4 << 30;

/// Largest size in bytes of a file of packed clips that is read.
const MAX_PACKED_BYTES: u64 = 1 << 30;

/// Largest size in bytes of a material library that is read.
const MAX_MTL_BYTES: u64 = 64 << 20;

/// Kinds of files, which differ by the endings of their names.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FileKind {
    /// Wavefront OBJ mesh, `.obj`.
    Obj,
    /// glTF mesh as JSON, `.gltf`.
    Gltf,
    /// glTF mesh in binary form, `.glb`.
    Glb,
    /// Avatar in VRM 1.0, `.vrm`: glTF in binary form with extensions. It is read as a mesh.
    Vrm,
    /// Skeleton as text, `.rig`.
    RigText,
    /// Template of a rig, `.rig.ron`.
    Template,
    /// Clips of a rig, `.anim.ron`.
    Animation,
    /// Motion of a skeleton of its own, `.bvh`.
    Bvh,
    /// Skeleton with packed clips, `.rigclip`.
    PackedClips,
    /// Project, `.rigsmith.ron`.
    Project,
    /// Weights of a mesh, `.skin`.
    Skin,
    /// List of gestures, `.ron` that is neither template nor clips nor project.
    Gestures,
}

impl FileKind {
    /// Kind of a file by its name; `None` if the ending is unknown.
    pub fn of(path: &Path) -> Option<Self> {
        let name = path.file_name()?.to_string_lossy().to_ascii_lowercase();
        let endings = [
            (".rig.ron", Self::Template),
            (".rigsmith.ron", Self::Project),
            (".anim.ron", Self::Animation),
            (".ron", Self::Gestures),
            (".rig", Self::RigText),
            (".skin", Self::Skin),
            (".bvh", Self::Bvh),
            (".rigclip", Self::PackedClips),
            (".obj", Self::Obj),
            (".gltf", Self::Gltf),
            (".glb", Self::Glb),
            (".vrm", Self::Vrm),
        ];
        endings.into_iter().find(|(ending, _)| name.ends_with(ending)).map(|(_, kind)| kind)
    }

    /// Returns `true` for glTF in any form.
    pub fn is_gltf(self) -> bool {
        matches!(self, Self::Gltf | Self::Glb | Self::Vrm)
    }
}

/// Reason for not opening a file. The text names the file.
#[derive(Debug, thiserror::Error)]
pub enum LoadError {
    /// The file could not be read.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// The file's name has no known ending.
    #[error("`{}`: {wanted}", path.display())]
    Kind {
        /// The file.
        path: PathBuf,
        /// Expected kind of file with its endings, in words.
        wanted: &'static str,
    },
    /// The OBJ file is invalid.
    #[error("`{}`: {source}", path.display())]
    Obj {
        /// The file.
        path: PathBuf,
        /// Error of the reader.
        source: ObjError,
    },
    /// The glTF file is invalid; the text of the error names the file.
    #[error(transparent)]
    Gltf(#[from] GltfError),
    /// The `.rig` file is invalid.
    #[error("`{}`: {source}", path.display())]
    RigText {
        /// The file.
        path: PathBuf,
        /// Error of the reader, with its line.
        source: RigTextError,
    },
    /// The RON file is invalid.
    #[error("`{}`: {source}", path.display())]
    Source {
        /// The file.
        path: PathBuf,
        /// Text of the file, for reports that show the place of the error.
        text: String,
        /// Error of the reader, with its place.
        source: SourceError,
    },
    /// The BVH file is invalid.
    #[error("`{}`: {source}", path.display())]
    Bvh {
        /// The file.
        path: PathBuf,
        /// Error of the reader, with its line.
        source: BvhError,
    },
    /// The file of packed clips is invalid.
    #[error("`{}`: {source}", path.display())]
    PackedClips {
        /// The file.
        path: PathBuf,
        /// Error of the reader, with its place.
        source: PackedClipError,
    },
    /// The `.skin` file is invalid.
    #[error("`{}`: {source}", path.display())]
    Skin {
        /// The file.
        path: PathBuf,
        /// Error of the reader.
        source: SkinFileError,
    },
    /// A project names a mesh outside of its folder.
    #[error(
        "`{}` is outside of `{}`, the folder of the project that names it, and is not opened; copy it into that folder, or \
         give a command the mesh with --mesh", path.display(), folder.display()
    )]
    Outside {
        /// The file, as the project names it.
        path: PathBuf,
        /// The project's folder.
        folder: PathBuf,
    },
    /// The reader panicked.
    #[error("`{}`: the file broke the reader; it is damaged in a way that is not foreseen; export it again", path.display())]
    Broken {
        /// The file.
        path: PathBuf,
    },
}

impl LoadError {
    /// The file; `None` for glTF, whose errors hold its name.
    pub fn path(&self) -> Option<&Path> {
        match self {
            Self::Read(error) => Some(error.path()),
            Self::Gltf(_) => None,
            Self::Kind { path, .. }
            | Self::Obj { path, .. }
            | Self::RigText { path, .. }
            | Self::Source { path, .. }
            | Self::Bvh { path, .. }
            | Self::PackedClips { path, .. }
            | Self::Skin { path, .. }
            | Self::Outside { path, .. }
            | Self::Broken { path } => Some(path),
        }
    }

    /// Line of the fault, counted from 1; `None` where the reader knows none, and for glTF, whose errors hold their places.
    pub fn line(&self) -> Option<u64> {
        match self {
            Self::Obj { source, .. } => source.line(),
            Self::RigText { source, .. } => source.line().map(|line| line as u64),
            Self::Source { source, .. } => Some(source.line as u64),
            Self::Bvh { source, .. } => Some(source.line() as u64),
            Self::Read(_)
            | Self::Kind { .. }
            | Self::Gltf(_)
            | Self::PackedClips { .. }
            | Self::Skin { .. }
            | Self::Outside { .. }
            | Self::Broken { .. } => None,
        }
    }
}

/// Reads a mesh: `.obj`, `.gltf`, `.glb` or `.vrm`.
pub fn load_model(disk: &dyn Disk, path: &Path) -> Result<Model, LoadError> {
    match FileKind::of(path) {
        Some(FileKind::Obj) => surviving(path, || load_obj(disk, path)),
        Some(kind) if kind.is_gltf() => surviving(path, || load_gltf(disk, path)),
        _ => Err(LoadError::Kind { path: path.into(), wanted: "no mesh; a mesh ends in .obj, .gltf, .glb or .vrm" }),
    }
}

/// Runs a reader on a thread of its own, so that a panic in a dependency becomes an error; on this one where no other can be started.
pub(super) fn surviving<T: Send>(
    path: &Path,
    read: impl FnOnce() -> Result<T, LoadError> + Send,
) -> Result<T, LoadError> {
    // A thread that does not start lets go of its work.
    let work = Mutex::new(Some(read));
    let take = || work.lock().unwrap_or_else(PoisonError::into_inner).take();
    let broken = || Err(LoadError::Broken { path: path.into() });
    std::thread::scope(|scope| {
        let run = || take().map_or_else(broken, |read| read());
        match std::thread::Builder::new().stack_size(16 << 20).spawn_scoped(scope, run) {
            Ok(worker) => worker.join().unwrap_or_else(|_| broken()),
            Err(_) => surviving_here(path, run),
        }
    })
}

/// Runs a reader on this thread, so that a panic in a dependency becomes an error. Memory that was let go of before serves it, while
/// a thread of its own has a heap of its own.
pub(super) fn surviving_here<T>(path: &Path, read: impl FnOnce() -> Result<T, LoadError>) -> Result<T, LoadError> {
    catch_unwind(AssertUnwindSafe(read)).unwrap_or_else(|_| Err(LoadError::Broken { path: path.into() }))
}

fn load_obj(disk: &dyn Disk, path: &Path) -> Result<Model, LoadError> {
    let file = open(disk, path)?;
    let folder = ModelFolder::of(disk, path)?;
    let mut sidecar = |uri: &str| {
        let limit = if uri.to_ascii_lowercase().ends_with(".mtl") { MAX_MTL_BYTES } else { gltf::MAX_IMAGE_BYTES };
        match folder.read(uri, limit) {
            Ok(bytes) => Some(SidecarFile::Bytes(bytes)),
            Err(error @ UriError::Outside { .. }) => Some(SidecarFile::Refused(error.to_string())),
            Err(UriError::Read { source, .. }) if !matches!(source, ReadError::Missing { .. }) => {
                Some(SidecarFile::Refused(source.to_string()))
            }
            Err(_) => None,
        }
    };
    obj::read_model(file, &stem(path), &ObjSettings::default(), &mut sidecar)
        .map_err(|source| LoadError::Obj { path: path.into(), source })
}

fn load_gltf(disk: &dyn Disk, path: &Path) -> Result<Model, LoadError> {
    let bytes = read_plausible(disk, path, MAX_GLTF_BYTES, gltf::may_begin_with)?;
    let folder = ModelFolder::of(disk, path)?;
    let mut external =
        |file: ExternalFile| folder.read(file.path, file.limit.min(MAX_GLTF_BYTES)).map_err(ExternalError::new);
    Ok(read_gltf(&bytes, &path.display().to_string(), &mut external)?)
}

/// Reads a template with its parts: see [`PartFiles`]. Where there is no such file, a relative path is the name of a template, with
/// or without its ending, in the folders of the site ([`SearchPaths`](super::SearchPaths)), or of one that comes with Rigsmith.
pub fn load_template(disk: &dyn Disk, path: &Path) -> Result<Template, LoadError> {
    let (path, bytes) = template_file(disk, path)?;
    PartFiles::new(disk).complete(&path, &bytes).map_err(|source| in_source(&path, &bytes, source))
}

/// The file that [`load_template`] reads, with its content.
pub(super) fn template_file(disk: &dyn Disk, path: &Path) -> Result<(PathBuf, Vec<u8>), LoadError> {
    match read_capped(disk, path, template::MAX_BYTES as u64) {
        Ok(bytes) => Ok((path.to_owned(), bytes)),
        Err(error @ ReadError::Missing { .. }) => Ok(named_template(disk, path)?.ok_or(error)?),
        Err(error) => Err(error.into()),
    }
}

/// Reads clips.
pub fn load_animation(disk: &dyn Disk, path: &Path) -> Result<ReadAnimation, LoadError> {
    let bytes = read_capped(disk, path, animation::MAX_BYTES as u64)?;
    read_animation(&bytes).map_err(|source| in_source(path, &bytes, source))
}

/// Reads the motion of a BVH file.
pub fn load_motion(disk: &dyn Disk, path: &Path) -> Result<Motion, LoadError> {
    let bytes = read_plausible(disk, path, MAX_BVH_BYTES, bvh::may_begin_with)?;
    read_bvh(&bytes, &stem(path)).map_err(|source| LoadError::Bvh { path: path.into(), source })
}

/// Reads packed clips with their skeleton.
pub fn load_packed_clips(disk: &dyn Disk, path: &Path) -> Result<PackedSkeleton, LoadError> {
    let bytes = read_plausible(disk, path, MAX_PACKED_BYTES, PackedSkeleton::may_begin_with)?;
    PackedSkeleton::from_bytes(&bytes).map_err(|source| LoadError::PackedClips { path: path.into(), source })
}

/// Reads a map of joints.
pub fn load_joint_map(disk: &dyn Disk, path: &Path) -> Result<NamePairs, LoadError> {
    let bytes = read_capped(disk, path, joint_map::MAX_BYTES as u64)?;
    read_joint_map(&bytes).map_err(|source| in_source(path, &bytes, source))
}

/// Reads a `.rig` text.
pub fn load_rig_text(disk: &dyn Disk, path: &Path) -> Result<RigText, LoadError> {
    let bytes = read_plausible(disk, path, MAX_RIG_BYTES, text::may_begin_with)?;
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

/// Reads weights and the hash of their file.
pub(super) fn load_hashed_skin(disk: &dyn Disk, path: &Path) -> Result<(SkinFile, u64), LoadError> {
    let bytes = read_plausible(disk, path, MAX_GLTF_BYTES, SkinFile::may_begin_with)?;
    let file = SkinFile::read(&bytes).map_err(|source| LoadError::Skin { path: path.into(), source })?;
    Ok((file, content_hash(&bytes)))
}

/// Reads a project file alone, without the files that it refers to.
pub(super) fn load_project_file(disk: &dyn Disk, path: &Path) -> Result<ReadProject, LoadError> {
    let bytes = read_capped(disk, path, project::MAX_BYTES as u64)?;
    read_project(&bytes).map_err(|source| in_source(path, &bytes, source))
}

pub(super) fn in_source(path: &Path, bytes: &[u8], source: SourceError) -> LoadError {
    LoadError::Source { path: path.into(), text: String::from_utf8_lossy(bytes).into_owned(), source }
}

/// Name of a file without folder and endings.
pub fn stem(path: &Path) -> String {
    let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let endings = [
        ".rig.ron",
        ".rigsmith.ron",
        ".anim.ron",
        ".obj",
        ".gltf",
        ".glb",
        ".vrm",
        ".rig",
        ".ron",
        ".skin",
        ".bvh",
        ".rigclip",
    ];
    for ending in endings {
        let split = name.len().saturating_sub(ending.len());
        if split > 0 && name.is_char_boundary(split) && name[split..].eq_ignore_ascii_case(ending) {
            return name[..split].to_owned();
        }
    }
    name
}
