//! Loader of projects.

use std::{path::Path, sync::Arc};

use super::{
    LoadedMesh, LoadedProject, MeshShape, MeshState,
    path::{below, located},
};
use crate::{
    algo::transfer::{TransferMesh, TransferSettings, transfer_weights},
    files::{
        Disk, LoadError,
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
/// # Errors
/// [`LoadError`] for errors in the project file itself.
pub fn load_project(disk: &dyn Disk, path: &Path) -> Result<LoadedProject, LoadError> {
    let read = load_project_file(disk, path)?;
    let Project { name, meshes: references, rigs: entries, view, journal } = read.project;
    let mut notes = read.notes;
    let (mut rigs, skins): (Vec<Rig>, Vec<Vec<SkinReference>>) =
        entries.into_iter().map(|entry| (entry.rig, entry.skins)).unzip();
    let mut meshes = Vec::with_capacity(references.len());
    for reference in references {
        // The reader has checked that this rig exists.
        let Some(number) = rigs.iter().position(|rig| rig.uid() == reference.rig) else { continue };
        let skin = skins[number].iter().find(|skin| skin.mesh == reference.uid);
        let skin = skin.and_then(|skin| Some((read_skin(disk, path, skin, &mut notes)?, skin.at_rest)));
        let (mesh, bound) = open_mesh(disk, path, reference, skin, &rigs[number], &mut notes);
        if let Some(bound) = bound
            && let Err(error) = rigs[number].apply(&RigEdit::SetSkin(mesh.uid, Some(Arc::new(bound))))
        {
            notes.push(format!("the weights of `{}` were left out: {error}", mesh.path.display()));
        }
        meshes.push(mesh);
    }
    Ok(LoadedProject { name, rigs, meshes, view, journal, notes })
}

/// Weights of a mesh from their file; `None`, with a note, if it cannot be read.
fn read_skin(disk: &dyn Disk, project: &Path, skin: &SkinReference, notes: &mut Vec<String>) -> Option<SkinFile> {
    let Some(path) = below(project, &skin.path) else {
        notes.push(format!("the weights `{}` are not below the project's folder: put them there", skin.path));
        return None;
    };
    match load_hashed_skin(disk, &path) {
        Ok((file, hash)) => {
            if hash != skin.hash {
                let name = path.display();
                notes.push(format!("the weights `{name}` were saved at another time than the project; they are used"));
            }
            Some(file)
        }
        Err(error) => {
            notes.push(format!("{error}; without its weights the mesh has to be skinned again"));
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
    notes: &mut Vec<String>,
) -> (LoadedMesh, Option<SkinData>) {
    let MeshReference { uid, rig: rig_uid, path, hash, mut nodes } = reference;
    let path = located(project, &path);
    let data = |file: &SkinFile, weights: Weights, at_rest: bool| {
        let joints = file.joints().iter().map(|joint| Uid(joint.uid)).collect();
        SkinData { joints, weights, at_rest, subjects: SkinJoint::subjects(file.joints()) }
    };
    let (state, bound) = match load_model(disk, &path) {
        Err(error) => {
            notes.push(format!(
                "a mesh of the project is not there: {error}; put it back and open the project again, its weights are kept"
            ));
            let bound = skin.as_ref().map(|(file, at_rest)| data(file, file.weights().clone(), *at_rest));
            let shape = MeshShape::Missing { hash, skin: skin.map(|(file, _)| Arc::new(file)) };
            (MeshState::Missing { error, shape }, bound)
        }
        Ok(model) => {
            let (rest, triangles) = (model.at_rest(), model.point_triangles());
            let changed = mesh_hash(&rest.points, &triangles) != hash;
            if changed {
                notes.push(format!("the mesh `{}` has changed since the project was saved", path.display()));
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
fn fitting(file: &SkinFile, target: TransferMesh, path: &Path, notes: &mut Vec<String>) -> Option<Weights> {
    if file.fits(target.points, target.triangles) {
        return Some(file.weights().clone());
    }
    let name = path.display();
    let Some(copy) = file.mesh() else {
        notes.push(format!("the weights of `{name}` are of another mesh and cannot be transferred; skin it again"));
        return None;
    };
    let source = TransferMesh { points: &copy.points, triangles: &copy.triangles };
    match transfer_weights(source, file.weights(), target, &TransferSettings::default()) {
        Ok((weights, told)) => {
            notes.push(format!(
                "the weights were transferred to `{name}`: {} points copied, {} matched, {} filled in, {} by the nearest",
                told.copied, told.matched, told.inpainted, told.nearest
            ));
            Some(weights)
        }
        Err(error) => {
            notes.push(format!("the weights of `{name}` cannot be transferred to the changed mesh: {error}"));
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
    let named = |name: &str| rig.find_label(name).filter(|_| !name.is_empty());
    model.nodes.iter().map(|node| named(&node.name).unwrap_or(Uid(0))).collect()
}
