//! Writer of projects.

use std::path::Path;

use super::{
    MeshShape, MeshToSave, ProjectToSave,
    path::{Place, is_of_site, place, reference},
};
use crate::{
    files::{Disk, FileSet, StoreError, TemplateBase, atomic::saved_file, save_set, stem, verify},
    rig::{
        Rig, SkinData,
        project::{self, MeshReference, Project, ProjectRig, SkinReference, TemplateReference, write_project},
        skin::{SkinError, SkinFile, SkinJoint, content_hash},
    },
};

/// The files of a project, ready to be saved together by [`save_set`].
#[derive(Debug, Clone, Default)]
pub struct ProjectFiles {
    /// Project file, with the weights as its companions.
    pub set: FileSet,
    /// Notes about content that could not be kept, a sentence each.
    pub notes: Vec<String>,
}

impl ProjectFiles {
    /// The [`content_hash`] of the project file, by which a [journal](crate::files::journal::SaveMark) identifies it.
    pub fn hash(&self) -> u64 {
        content_hash(self.set.bytes())
    }
}

/// Saves a project with the weights of its meshes beside it, whole or not at all. Returns notes about content that
/// could not be kept, a sentence each.
///
/// # Errors
/// [`StoreError`]; the former files are unchanged.
pub fn store_project(disk: &dyn Disk, path: &Path, project: &ProjectToSave) -> Result<Vec<String>, StoreError> {
    let ProjectFiles { set, notes } = project_files(disk, path, project)?;
    save_set(disk, &set)?;
    Ok(notes)
}

/// Makes the files of a project that is to be saved at `path`, and reads them back without writing them: for callers
/// that record the save in a journal first.
///
/// Meshes are named relative to the project's folder; where they have no folder in common, by their absolute path.
///
/// # Errors
/// [`StoreError`] if a file cannot hold its content.
pub fn project_files(disk: &dyn Disk, path: &Path, project: &ProjectToSave) -> Result<ProjectFiles, StoreError> {
    let mut notes = Vec::new();
    let mut set = FileSet::new(path);
    let mut rigs = Vec::with_capacity(project.rigs.len());
    for rig in &project.rigs {
        let mut skins = Vec::new();
        for (uid, skin) in rig.skins() {
            let mesh = project.meshes.iter().find(|mesh| mesh.uid == uid && mesh.rig == rig.uid());
            let bytes = mesh.map(|mesh| skin_file(rig, mesh, skin)).transpose();
            let Some(bytes) = bytes.map_err(|source| StoreError::Skin { path: path.into(), source })?.flatten() else {
                notes.push(format!("the weights of mesh {uid} were left out: that mesh is not open"));
                continue;
            };
            verify::skin(path, &bytes)?;
            let hash = content_hash(&bytes);
            let name = set.add(disk, &format!("{}.skin", stem(path)), bytes);
            skins.push(SkinReference { mesh: uid, path: name, hash, at_rest: skin.at_rest });
        }
        rigs.push(ProjectRig { rig: rig.clone(), skins });
    }
    // References are relative to the file that is written, also through a link.
    let main = saved_file(disk, path);
    let mut meshes = Vec::with_capacity(project.meshes.len());
    for mesh in &project.meshes {
        let named = reference(disk, &main, &mesh.path, &mut notes);
        if !matches!(place(disk, &main, &named), Place::Inside(_)) {
            notes.push(format!(
                "the mesh `{named}` is outside of the project's folder and does not open with the project; copy it into \
                 that folder"
            ));
        }
        meshes.push(MeshReference {
            uid: mesh.uid,
            rig: mesh.rig,
            path: named,
            hash: mesh.shape.hash(),
            nodes: mesh.nodes.to_vec(),
        });
    }
    let templates = project.templates.iter().map(|template| {
        let named = reference(disk, &main, &template.path, &mut notes);
        if !matches!(place(disk, &main, &named), Place::Inside(_)) && !is_of_site(disk, &template.path) {
            notes.push(format!(
                "the template `{named}` is outside of the project's folder and is not followed when the project is opened; \
                 copy it into that folder, or name its folder as one of templates (RIGSMITH_TEMPLATES)"
            ));
        }
        let TemplateBase { rig: base, text } = &template.base;
        TemplateReference {
            rig: template.rig,
            path: named,
            base: (**base).clone(),
            text: text.as_deref().map(str::to_owned),
        }
    });
    let templates = templates.collect();
    let (name, view, journal) = (project.name.clone(), project.view.clone(), project.journal.clone());
    let names = project.names.clone();
    let text = write_project(&Project { name, meshes, rigs, templates, view, journal, names });
    if text.len() > project::MAX_BYTES {
        return Err(StoreError::ProjectTooLarge { path: path.into(), mebibytes: text.len() >> 20 });
    }
    verify::project(path, text.as_bytes())?;
    set.finish(text.into_bytes());
    Ok(ProjectFiles { set, notes })
}

/// Content of the file with a mesh's weights; `None` if neither the mesh's geometry nor its former weight file is
/// known.
fn skin_file(rig: &Rig, mesh: &MeshToSave, skin: &SkinData) -> Result<Option<Vec<u8>>, SkinError> {
    if let Some((points, triangles)) = mesh.shape.geometry() {
        return Ok(Some(
            SkinFile::new(SkinJoint::list(rig, skin), skin.weights.clone(), points, triangles, true)?.write(),
        ));
    }
    let MeshShape::Missing { skin: Some(file), .. } = &mesh.shape else { return Ok(None) };
    Ok(Some(file.write()))
}
