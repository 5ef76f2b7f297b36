//! Loader of projects.

use std::{
    collections::HashMap,
    path::{Path, PathBuf},
    sync::Arc,
};

use super::{
    LoadedMesh, LoadedProject, MeshShape, MeshState, ProjectNote, ProjectTemplate,
    path::{Place, below, is_of_site, place},
};
use crate::{
    algo::transfer::{TransferMesh, TransferSettings, transfer_weights},
    files::{
        Disk, LoadError, TemplateBase,
        atomic::folder_of,
        load::{load_hashed_skin, load_project_file},
        load_model,
    },
    mesh::model::{Model, Weights},
    rig::{
        Rig, RigEdit, SkinData, Uid,
        project::{MeshReference, Project, SkinReference},
        skin::{SkinFile, SkinJoint, mesh_hash},
    },
};

/// Opens a project with its meshes and weights.
///
/// A mesh or weights that are missing, changed or damaged are no error: the rest opens, and the notes describe each of
/// them and its remedy. Weights of a mesh that has changed are transferred to it.
///
/// Files outside of the project's folder are refused like missing ones ([`LoadError::Outside`]), whether the project names
/// them by an absolute path, by `..` or by a link; a file of the same name in the folder stands in. Templates may be in the
/// folders of the site, too ([`SearchPaths`](crate::files::SearchPaths)).
///
/// # Errors
/// [`LoadError`] for errors in the project file itself.
pub fn load_project(disk: &dyn Disk, path: &Path) -> Result<LoadedProject, LoadError> {
    let read = load_project_file(disk, path)?;
    let Project { name, meshes: references, rigs: entries, templates, view, journal, .. } = read.project;
    let mut notes: Vec<ProjectNote> = read.notes.into_iter().map(ProjectNote::File).collect();
    let templates = templates.into_iter().filter_map(|template| {
        let file = template_file(disk, path, &template.path, &mut notes)?;
        let base = TemplateBase { rig: Arc::new(template.base), text: template.text.map(Arc::from) };
        Some(ProjectTemplate { rig: template.rig, path: file, base })
    });
    let templates = templates.collect();
    let (mut rigs, skins): (Vec<Rig>, Vec<Vec<SkinReference>>) =
        entries.into_iter().map(|entry| (entry.rig, entry.skins)).unzip();
    let mut meshes = Vec::with_capacity(references.len());
    let places: HashMap<Uid, usize> = rigs.iter().enumerate().rev().map(|(place, rig)| (rig.uid(), place)).collect();
    let skins_of =
        skins.iter().zip(0..).flat_map(|(skins, rig)| skins.iter().map(move |skin| ((rig, skin.mesh), skin)));
    let skins_of: Vec<((usize, Uid), &SkinReference)> = skins_of.collect();
    let skins_of: HashMap<(usize, Uid), &SkinReference> = skins_of.into_iter().rev().collect();
    for reference in references {
        // The reader has checked that this rig exists.
        let Some(number) = places.get(&reference.rig).copied() else { continue };
        let skin = skins_of.get(&(number, reference.uid)).copied();
        let skin = skin.and_then(|skin| Some((read_skin(disk, path, skin, &mut notes)?, skin.at_rest)));
        let (mesh, bound) = open_mesh(disk, path, reference, skin, &rigs[number], &mut notes);
        if let Some(bound) = bound
            && let Err(error) = rigs[number].apply(&RigEdit::SetSkin(mesh.uid, Some(Arc::new(bound))))
        {
            notes.push(ProjectNote::WeightsRefused { mesh: mesh.path.clone(), error });
        }
        meshes.push(mesh);
    }
    Ok(LoadedProject { name, rigs, meshes, templates, view, journal, notes })
}

/// File of a template; `None`, with a note, if it is not to be followed.
fn template_file(disk: &dyn Disk, project: &Path, text: &str, notes: &mut Vec<ProjectNote>) -> Option<PathBuf> {
    match place(disk, project, text) {
        Place::Inside(path) => Some(path),
        Place::Outside(path) if is_of_site(disk, &path) => Some(path),
        Place::Beside(path) => {
            notes.push(ProjectNote::FileBeside { named: text.to_owned(), path: path.clone() });
            Some(path)
        }
        Place::Outside(_) => {
            notes.push(ProjectNote::TemplateOutside(text.to_owned()));
            // The version that the rig took over stays with the name that the template has once it is there.
            below(disk, project, Path::new(text).file_name()?.to_str()?)
        }
    }
}

/// Weights of a mesh from their file; `None`, with a note, if it cannot be read.
fn read_skin(disk: &dyn Disk, project: &Path, skin: &SkinReference, notes: &mut Vec<ProjectNote>) -> Option<SkinFile> {
    let Some(path) = below(disk, project, &skin.path) else {
        notes.push(ProjectNote::WeightsOutside(skin.path.clone()));
        return None;
    };
    match load_hashed_skin(disk, &path) {
        Ok((file, hash)) => {
            if hash != skin.hash {
                notes.push(ProjectNote::WeightsOfAnotherTime(path));
            }
            Some(file)
        }
        Err(error) => {
            notes.push(ProjectNote::WeightsUnreadable(Arc::new(error)));
            None
        }
    }
}

fn open_mesh(
    disk: &dyn Disk,
    project: &Path,
    reference: MeshReference,
    skin: Option<(SkinFile, bool)>,
    rig: &Rig,
    notes: &mut Vec<ProjectNote>,
) -> (LoadedMesh, Option<SkinData>) {
    let MeshReference { uid, rig: rig_uid, path, hash, mut nodes } = reference;
    let (path, read) = match place(disk, project, &path) {
        Place::Inside(path) => {
            let read = load_model(disk, &path);
            (path, read)
        }
        Place::Beside(beside) => {
            notes.push(ProjectNote::FileBeside { named: path, path: beside.clone() });
            let read = load_model(disk, &beside);
            (beside, read)
        }
        Place::Outside(outside) => {
            let refused = LoadError::Outside { path: outside.clone(), folder: folder_of(project).to_path_buf() };
            (outside, Err(refused))
        }
    };
    let data = |file: &SkinFile, weights: Weights, at_rest: bool| {
        let joints = file.joints().iter().map(|joint| Uid(joint.uid)).collect();
        SkinData { joints, weights, at_rest, subjects: SkinJoint::subjects(file.joints()) }
    };
    let (state, bound) = match read {
        Err(error) => {
            let error = Arc::new(error);
            notes.push(match *error {
                LoadError::Outside { .. } => ProjectNote::MeshOutside(error.clone()),
                _ => ProjectNote::MeshMissing(error.clone()),
            });
            let bound = skin.as_ref().map(|(file, at_rest)| data(file, file.weights().clone(), *at_rest));
            let shape = MeshShape::Missing { hash, skin: skin.map(|(file, _)| Arc::new(file)) };
            (MeshState::Missing { error, shape }, bound)
        }
        Ok(model) => {
            let (rest, triangles) = (model.at_rest(), model.point_triangles());
            let changed = mesh_hash(&rest.points, &triangles) != hash;
            if changed {
                notes.push(ProjectNote::MeshChanged(path.clone()));
            }
            nodes = known_nodes(nodes, &model, rig);
            let bound = skin.and_then(|(file, at_rest)| {
                let target = TransferMesh { points: &rest.points, triangles: &triangles };
                let weights = fitting(&file, target, &path, notes)?;
                // A mesh whose file no longer has a bind pose is bound in its present state.
                Some(data(&file, weights, at_rest || model.weights.is_none()))
            });
            (MeshState::Open { model: Box::new(model), changed }, bound)
        }
    };
    (LoadedMesh { uid, rig: rig_uid, path, nodes: nodes.into(), shape: state }, bound)
}

/// Weights for a mesh: unchanged if the mesh is the one they were made for, else transferred.
fn fitting(file: &SkinFile, target: TransferMesh, path: &Path, notes: &mut Vec<ProjectNote>) -> Option<Weights> {
    if file.fits(target.points, target.triangles) {
        return Some(file.weights().clone());
    }
    let mesh = path.to_path_buf();
    let Some(copy) = file.mesh() else {
        notes.push(ProjectNote::WeightsOfAnotherMesh(mesh));
        return None;
    };
    let source = TransferMesh { points: &copy.points, triangles: &copy.triangles };
    match transfer_weights(source, file.weights(), target, &TransferSettings::default()) {
        Ok((weights, report)) => {
            notes.push(ProjectNote::WeightsTransferred { mesh, report });
            Some(weights)
        }
        Err(error) => {
            notes.push(ProjectNote::WeightsNotTransferred { mesh, error });
            None
        }
    }
}

/// Joints that the nodes of a mesh became. If the file has other nodes now, they are matched by names; a node without a
/// joint gets a uid that no joint has.
fn known_nodes(nodes: Vec<Uid>, model: &Model, rig: &Rig) -> Vec<Uid> {
    if nodes.is_empty() || nodes.len() == model.nodes.len() {
        return nodes;
    }
    let labelled = rig.joints_by_label();
    let named = |name: &str| labelled.get(name).copied().filter(|_| !name.is_empty());
    model.nodes.iter().map(|node| named(&node.name).unwrap_or(Uid(0))).collect()
}
