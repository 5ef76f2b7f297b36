//! Saving models, rigs and weights, whole or not at all.

use std::path::{Path, PathBuf};

use super::{Disk, FileKind, SaveError, save_all_atomic, save_atomic, stem};
use crate::{
    mesh::{
        gltf::{GltfError, GltfWriteSettings, write_glb, write_gltf},
        model::Model,
        obj::write_obj,
    },
    rig::{
        Rig,
        character::rig_text,
        project,
        skin::{SkinError, SkinFile},
        template::{self, write_template},
        text::{self, RigTextError},
    },
};

/// Why a file was not saved. What was there before is still there, whole.
#[derive(Debug, thiserror::Error)]
pub enum StoreError {
    /// The disk refused.
    #[error(transparent)]
    Save(#[from] SaveError),
    /// glTF cannot hold the model.
    #[error("`{}`: {source}", path.display())]
    Gltf {
        /// The file.
        path: PathBuf,
        /// Why not.
        source: GltfError,
    },
    /// The `.rig` format cannot hold the rig.
    #[error("`{}`: {source}", path.display())]
    RigText {
        /// The file.
        path: PathBuf,
        /// Why not.
        source: RigTextError,
    },
    /// The template would be longer than any that is read.
    #[error(
        "`{}`: the template would have {mebibytes} MiB, and no more than {} are read; save as .rig, or split the rig",
        path.display(),
        template::MAX_BYTES >> 20
    )]
    TooLarge {
        /// The file.
        path: PathBuf,
        /// How long it would be.
        mebibytes: usize,
    },
    /// The project would be longer than any that is read.
    #[error(
        "`{}`: the project would have {mebibytes} MiB, and no more than {} are read; delete stored poses, or split the rig",
        path.display(),
        project::MAX_BYTES >> 20
    )]
    ProjectTooLarge {
        /// The file.
        path: PathBuf,
        /// How long it would be.
        mebibytes: usize,
    },
    /// Weights that no file can hold.
    #[error("`{}`: {source}", path.display())]
    Skin {
        /// The file.
        path: PathBuf,
        /// What is wrong with them.
        source: SkinError,
    },
    /// Its name has no ending that fits.
    #[error("`{}`: {wanted}", path.display())]
    Kind {
        /// The file.
        path: PathBuf,
        /// What would do.
        wanted: &'static str,
    },
}

/// Saves a model as `.glb`, `.gltf` (with its buffer and images beside it) or `.obj` (with its materials).
pub fn store_model(
    disk: &dyn Disk,
    path: &Path,
    model: &Model,
    settings: &GltfWriteSettings,
) -> Result<Vec<String>, StoreError> {
    let gltf_error = |source| StoreError::Gltf { path: path.into(), source };
    match FileKind::of(path) {
        Some(FileKind::Glb) => {
            save_atomic(disk, path, &write_glb(model, settings).map_err(gltf_error)?)?;
            Ok(Vec::new())
        }
        Some(FileKind::Gltf) => {
            let stem = stem(path);
            let written = write_gltf(model, settings, &stem).map_err(gltf_error)?;
            let mut files: Vec<(PathBuf, Vec<u8>)> =
                written.images.into_iter().map(|(name, bytes)| (path.with_file_name(name), bytes)).collect();
            if !written.bin.is_empty() {
                files.push((path.with_file_name(format!("{stem}.bin")), written.bin));
            }
            files.push((path.into(), written.json));
            save_all_atomic(disk, &files)?;
            Ok(Vec::new())
        }
        Some(FileKind::Obj) => {
            let library = format!("{}.mtl", stem(path));
            let posed = (!model.skins.is_empty()).then(|| model.at_rest());
            let written = write_obj(posed.as_ref().unwrap_or(model), &library);
            let beside = |name: &str| path.with_file_name(name);
            let mut files: Vec<(PathBuf, Vec<u8>)> =
                written.images.into_iter().map(|(name, bytes)| (beside(&name), bytes)).collect();
            files.extend(written.mtl.map(|bytes| (beside(&library), bytes)));
            files.push((path.into(), written.obj));
            save_all_atomic(disk, &files)?;
            Ok(lost_in_obj(model))
        }
        _ => Err(StoreError::Kind { path: path.into(), wanted: "a model is saved as .glb, .gltf or .obj" }),
    }
}

/// What OBJ has no place for, as a note.
fn lost_in_obj(model: &Model) -> Vec<String> {
    let morphs = model.objects.iter().any(|object| !object.morph_names.is_empty());
    let lost: Vec<&str> = [
        (!model.nodes.is_empty(), "the skeleton"),
        (model.weights.is_some(), "weights"),
        (morphs, "morph targets"),
        (!model.clips.is_empty(), "animation clips"),
    ]
    .into_iter()
    .filter_map(|(there, what)| there.then_some(what))
    .collect();
    if lost.is_empty() { Vec::new() } else { vec![format!("OBJ cannot hold {}: left out", lost.join(", "))] }
}

/// Saves a rig as `.rig.ron`, or its skeleton as `.rig`. Returns what the format could not keep, a sentence each.
pub fn store_rig(disk: &dyn Disk, path: &Path, rig: &Rig) -> Result<Vec<String>, StoreError> {
    match FileKind::of(path) {
        Some(FileKind::Template) => {
            let text = write_template(rig);
            if text.len() > template::MAX_BYTES {
                return Err(StoreError::TooLarge { path: path.into(), mebibytes: text.len() >> 20 });
            }
            save_atomic(disk, path, text.as_bytes())?;
            Ok(Vec::new())
        }
        Some(FileKind::RigText) => {
            let written =
                text::write(&rig_text(rig)).map_err(|source| StoreError::RigText { path: path.into(), source })?;
            save_atomic(disk, path, written.text.as_bytes())?;
            Ok(written
                .relabelled
                .iter()
                .map(|label| {
                    format!("a .rig label has no white space: \"{}\" was written as \"{}\"", label.from, label.to)
                })
                .collect())
        }
        _ => Err(StoreError::Kind { path: path.into(), wanted: "a rig is saved as .rig.ron or .rig" }),
    }
}

/// Saves weights as `.skin`.
pub fn store_skin(disk: &dyn Disk, path: &Path, skin: &SkinFile) -> Result<(), StoreError> {
    Ok(save_atomic(disk, path, &skin.write())?)
}
