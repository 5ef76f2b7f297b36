//! Saving projects.

use std::path::{Path, PathBuf};

use super::{MeshShape, MeshToSave, ProjectToSave, path::reference};
use crate::{
    files::{Disk, StoreError, save_all_atomic, stem},
    rig::{
        Rig, SkinData, Uid,
        project::{self, MeshReference, Project, ProjectRig, SkinReference, write_project},
        skin::{SkinError, SkinFile, SkinJoint, content_hash},
    },
};

/// The files of a project, ready to be saved: together by [`save_all_atomic`], in this order.
#[derive(Debug, Clone, Default)]
pub struct ProjectFiles {
    /// Paths and contents; the last one is the project itself.
    pub files: Vec<(PathBuf, Vec<u8>)>,
    /// What could not be kept, a sentence each.
    pub notes: Vec<String>,
}

impl ProjectFiles {
    /// The [`content_hash`] of the project itself, by which a [journal](crate::files::journal::SaveMark) knows it.
    pub fn hash(&self) -> u64 {
        self.files.last().map_or(0, |(_, bytes)| content_hash(bytes))
    }
}

/// Saves a project with the weights of its meshes beside it, whole or not at all. Returns what could not be kept, a
/// sentence each.
///
/// # Errors
/// [`StoreError`]; what was there before is still there.
pub fn store_project(disk: &dyn Disk, path: &Path, project: &ProjectToSave) -> Result<Vec<String>, StoreError> {
    let ProjectFiles { files, notes } = project_files(disk, path, project)?;
    save_all_atomic(disk, &files)?;
    Ok(notes)
}

/// Makes the files of a project that is to be saved at `path`, and writes nothing: for those who note what they are
/// about to save before they do.
///
/// Meshes are named relative to the project's folder; where they have no folder in common, by their absolute path.
///
/// # Errors
/// [`StoreError`] if a file cannot hold what it should.
pub fn project_files(disk: &dyn Disk, path: &Path, project: &ProjectToSave) -> Result<ProjectFiles, StoreError> {
    let mut notes = Vec::new();
    let mut files: Vec<(PathBuf, Vec<u8>)> = Vec::new();
    let mut rigs = Vec::with_capacity(project.rigs.len());
    for rig in &project.rigs {
        let mut skins = Vec::new();
        for (uid, skin) in rig.skins() {
            let name = format!("{}.{uid}.skin", stem(path));
            let file = path.with_file_name(&name);
            let mesh = project.meshes.iter().find(|mesh| mesh.uid == uid && mesh.rig == rig.uid());
            let bytes = mesh.map(|mesh| skin_file(rig, mesh, skin)).transpose();
            let Some(bytes) = bytes.map_err(|source| StoreError::Skin { path: file.clone(), source })?.flatten() else {
                notes.push(format!("the weights of mesh {uid} were left out: that mesh is not open"));
                continue;
            };
            skins.push(SkinReference { mesh: uid, path: name, hash: content_hash(&bytes), at_rest: skin.at_rest });
            files.push((file, bytes));
        }
        rigs.push(ProjectRig { rig: rig.clone(), skins });
    }
    let mut meshes = Vec::with_capacity(project.meshes.len());
    for mesh in &project.meshes {
        meshes.push(MeshReference {
            uid: mesh.uid,
            rig: mesh.rig,
            path: reference(disk, path, &mesh.path, &mut notes),
            hash: mesh.shape.hash(),
            nodes: mesh.nodes.to_vec(),
        });
    }
    let (name, view, journal) = (project.name.clone(), project.view.clone(), project.journal.clone());
    let text = write_project(&Project { name, meshes, rigs, view, journal });
    if text.len() > project::MAX_BYTES {
        return Err(StoreError::ProjectTooLarge { path: path.into(), mebibytes: text.len() >> 20 });
    }
    files.push((path.into(), text.into_bytes()));
    Ok(ProjectFiles { files, notes })
}

/// The bytes of the file with a mesh's weights; `None` if nothing is known about the mesh.
fn skin_file(rig: &Rig, mesh: &MeshToSave, skin: &SkinData) -> Result<Option<Vec<u8>>, SkinError> {
    let joint = |uid: &Uid| {
        let label = rig.joint(*uid).and_then(|joint| joint.data.label.clone()).unwrap_or_default();
        SkinJoint { uid: uid.0, label }
    };
    if let Some((points, triangles)) = mesh.shape.geometry() {
        let joints = skin.joints.iter().map(joint).collect();
        return Ok(Some(SkinFile::new(joints, skin.weights.clone(), points, triangles, true)?.write()));
    }
    let MeshShape::Missing { skin: Some(file), .. } = &mesh.shape else { return Ok(None) };
    Ok(Some(file.write()))
}
