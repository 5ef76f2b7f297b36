//! Verification before a save: the bytes to be written are read back with the readers of their format.
//!
//! A file is never replaced by one that cannot be read. The bytes that arrive on the disk are compared with these when
//! they are saved.

use std::path::Path;

use super::{
    FileKind, FileSet, LoadError, StoreError,
    load::{in_source, surviving_here},
    stem,
};
use crate::{
    mesh::{
        gltf::{ExternalError, ExternalFile, read_avatar, read_gltf},
        model::Model,
        obj::{self, ObjSettings, SidecarFile},
        vrm::Avatar,
    },
    rig::{
        animation::{NodeNames, RigClip},
        format::animation::read_animation,
        project::read_project,
        skin::SkinFile,
        template::read_template,
        text,
    },
    solve::packed_clip::PackedSkeleton,
};

/// Counts of the content of a model.
#[derive(Debug, Clone, Copy)]
pub(super) struct ModelCounts {
    points: usize,
    triangles: usize,
}

impl ModelCounts {
    pub fn of(model: &Model) -> Self {
        let triangles = model.parts.iter().map(|part| part.triangles.len()).sum();
        Self { points: model.points.len(), triangles }
    }
}

/// Reads back a model before it is saved, and compares the counts of its content with those that it had.
pub(super) fn model(set: &FileSet, written: ModelCounts) -> Result<(), StoreError> {
    let path = set.path();
    let is_obj = FileKind::of(path) == Some(FileKind::Obj);
    let read = || {
        if is_obj {
            let mut sidecar = |name: &str| set.companion(name).map(|bytes| SidecarFile::Bytes(bytes.to_vec()));
            obj::read_model(set.bytes(), &stem(path), &ObjSettings::default(), &mut sidecar)
                .map_err(|source| LoadError::Obj { path: path.into(), source })
        } else {
            let none = || ExternalError::new("it is not among the companions");
            let mut external = |file: ExternalFile| set.companion(file.path).map(<[u8]>::to_vec).ok_or_else(none);
            Ok(read_gltf(set.bytes(), &path.display().to_string(), &mut external)?)
        }
    };
    let back = readable(path, surviving_here(path, read))?;
    let same = |what, written: usize, read: usize| match written == read {
        true => Ok(()),
        false => Err(StoreError::Lost { path: path.into(), what, written, read }),
    };
    if is_obj {
        same("points", written.points, back.points.len())?;
    }
    same("triangles", written.triangles, ModelCounts::of(&back).triangles)?;
    same("finite points", back.points.len(), back.points.iter().filter(|point| point.is_finite()).count())
}

/// Reads back an avatar before it is saved, and compares the counts of its content.
pub(super) fn avatar(set: &FileSet, avatar: &Avatar) -> Result<(), StoreError> {
    let path = set.path();
    let back = read_avatar(set.bytes(), &path.display().to_string()).map_err(LoadError::from);
    let back = readable(path, back)?;
    let counts = |avatar: &Avatar| {
        let Avatar { vrm, springs, constraints } = avatar;
        let joints = springs.springs.iter().map(|chain| chain.joints.len()).sum::<usize>();
        [
            ("authors", vrm.meta.authors.len()),
            ("humanoid bones", vrm.humanoid.human_bones.len()),
            ("expressions", vrm.expressions.preset.len() + vrm.expressions.custom.len()),
            ("ranges of the eyes", usize::from(vrm.look_at.is_some())),
            ("joints of springs", joints),
            ("colliders", if joints == 0 { 0 } else { springs.colliders.len() }),
            ("constraints", constraints.len()),
        ]
    };
    let read = back.as_ref().map_or([0; 7], |back| counts(back).map(|(_, count)| count));
    for ((what, written), read) in counts(avatar).into_iter().zip(read) {
        if written != read {
            return Err(StoreError::Lost { path: path.into(), what, written, read });
        }
    }
    Ok(())
}

/// Reads back a template before it is saved.
pub(super) fn template(path: &Path, bytes: &[u8]) -> Result<(), StoreError> {
    readable(path, read_template(bytes).map(drop).map_err(|source| in_source(path, bytes, source)))
}

/// Reads back a `.rig` text before it is saved.
pub(super) fn rig_text(path: &Path, bytes: &[u8]) -> Result<(), StoreError> {
    readable(path, text::parse(bytes).map(drop).map_err(|source| LoadError::RigText { path: path.into(), source }))
}

/// Reads back weights before they are saved.
pub(super) fn skin(path: &Path, bytes: &[u8]) -> Result<(), StoreError> {
    readable(path, SkinFile::read(bytes).map(drop).map_err(|source| LoadError::Skin { path: path.into(), source }))
}

/// Reads back a project before it is saved.
pub(super) fn project(path: &Path, bytes: &[u8]) -> Result<(), StoreError> {
    readable(path, read_project(bytes).map(drop).map_err(|source| in_source(path, bytes, source)))
}

/// Reads back clips before they are saved, and compares them.
pub(super) fn animation(path: &Path, bytes: &[u8], clips: &[RigClip]) -> Result<(), StoreError> {
    let read = read_animation(bytes).map_err(|source| in_source(path, bytes, source));
    let read = readable(path, read)?.clips;
    let count = |clips: &[RigClip]| clips.iter().map(RigClip::key_count).sum();
    // Names of nodes that are gone come back when the clips are put onto a rig.
    let plain: Vec<RigClip> =
        clips.iter().map(|clip| RigClip { names: NodeNames::default(), ..clip.clone() }).collect();
    if read == plain {
        return Ok(());
    }
    Err(StoreError::Lost { path: path.into(), what: "keys", written: count(clips), read: count(&read) })
}

/// Reads back packed clips before they are saved, and compares them.
pub(super) fn packed_clips(path: &Path, bytes: &[u8], packed: &PackedSkeleton) -> Result<(), StoreError> {
    let read = PackedSkeleton::from_bytes(bytes).map_err(|source| LoadError::PackedClips { path: path.into(), source });
    let read = readable(path, read)?;
    if read == *packed {
        return Ok(());
    }
    let (written, read) = (packed.clips.len(), read.clips.len());
    Err(StoreError::Lost { path: path.into(), what: "packed clips", written, read })
}

fn readable<T>(path: &Path, read: Result<T, LoadError>) -> Result<T, StoreError> {
    read.map_err(|source| StoreError::Unreadable { path: path.into(), source: Box::new(source) })
}
