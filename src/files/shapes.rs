//! Loader of face shapes.

use std::path::{Path, PathBuf};

use super::{Disk, EntryKind, FileKind, LoadError, ReadError, load_model, read_capped, stem};
use crate::mesh::{
    model::Model,
    shapes::{ShapeError, Shapes},
};

/// Largest size in bytes of shapes that are read.
const MAX_SHAPE_BYTES: u64 = 4 << 30;

/// Largest size in bytes of an index of shapes that is read.
const MAX_INDEX_BYTES: u64 = 16 << 20;

/// Largest number of meshes in a folder that are read.
const MAX_SHAPES: usize = 4096;

/// Reason for not opening shapes. The text names the file.
#[derive(Debug, thiserror::Error)]
pub enum LoadShapesError {
    /// A file could not be opened.
    #[error(transparent)]
    Load(#[from] LoadError),
    /// A file is invalid, or holds shapes of another mesh.
    #[error("`{}`: {source}", path.display())]
    Shapes {
        /// The file.
        path: PathBuf,
        /// Error of the reader.
        source: ShapeError,
    },
    /// A folder has more meshes than shapes are read.
    #[error(
        "`{}` has {found} meshes, and {} at most are read as shapes; move some to another folder",
        path.display(),
        MAX_SHAPES
    )]
    TooMany {
        /// The folder.
        path: PathBuf,
        /// Number of its meshes.
        found: usize,
    },
    /// The file is of a kind that holds no shapes.
    #[error(
        "`{}` holds no shapes; give a .glb or .gltf with morph targets, a folder of meshes, or a .json beside its .f32",
        path.display()
    )]
    Kind {
        /// The file.
        path: PathBuf,
    },
}

/// Reads shapes of `rest`: a .glb, .gltf or .vrm with morph targets, a folder with one mesh a shape (.obj, in the order of
/// their names), or a .json that names raw displacements in the .f32 beside it.
pub fn load_shapes(disk: &dyn Disk, path: &Path, rest: &Model) -> Result<Shapes, LoadShapesError> {
    let wrong = |path: &Path| {
        let path = path.to_owned();
        move |source| LoadShapesError::Shapes { path, source }
    };
    if disk.entry(path, true).is_ok_and(|entry| entry.kind == EntryKind::Folder) {
        let io = |error: std::io::Error| LoadError::from(ReadError::Io { path: path.into(), source: error.into() });
        let mut shapes = Shapes::default();
        let mut meshes = disk.list(path, usize::MAX).map_err(io)?;
        meshes.retain(|name| FileKind::of(Path::new(name)) == Some(FileKind::Obj));
        if meshes.len() > MAX_SHAPES {
            return Err(LoadShapesError::TooMany { path: path.into(), found: meshes.len() });
        }
        for name in meshes {
            let file = path.join(name);
            let model = load_model(disk, &file)?;
            shapes.add_mesh(&stem(&file), &rest.points, &model.points).map_err(wrong(&file))?;
        }
        return if shapes.names.is_empty() { Err(LoadShapesError::Kind { path: path.into() }) } else { Ok(shapes) };
    }
    match FileKind::of(path) {
        Some(kind) if kind.is_gltf() => {
            let model = load_model(disk, path)?;
            let shapes = Shapes::of_morphs(&model).map_err(wrong(path))?;
            let (found, wanted) = (model.points.len(), rest.points.len());
            let name = shapes.names.first().cloned().unwrap_or_default();
            if found != wanted {
                return Err(wrong(path)(ShapeError::Points { name, found, wanted }));
            }
            Ok(shapes)
        }
        _ if path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("json")) => {
            let read = |path: &Path, limit| read_capped(disk, path, limit).map_err(LoadError::from);
            let index = read(path, MAX_INDEX_BYTES)?;
            let numbers = read(&path.with_extension("f32"), MAX_SHAPE_BYTES)?;
            Shapes::of_numbers(&index, &numbers, rest.points.len()).map_err(wrong(path))
        }
        _ => Err(LoadShapesError::Kind { path: path.into() }),
    }
}
