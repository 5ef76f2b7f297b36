//! Meshes of a project's rig, for commands that write or draw a character.

use std::path::Path;

use super::{Failure, InPlaceArgs, Report};
use crate::{
    files::{LoadedMesh, LoadedProject, MeshState},
    plugins::surface::RigMesh,
    rig::Rig,
};

/// Checks that `output` is neither a mesh nor a template of a project, unless replacing inputs was allowed.
pub(super) fn check_output(
    project: &LoadedProject,
    output: Option<&Path>,
    in_place: InPlaceArgs,
) -> Result<(), Failure> {
    let meshes = project.meshes.iter().map(|mesh| mesh.path.as_path());
    let templates = project.templates.iter().map(|template| template.path.as_path());
    let inputs: Vec<&Path> = meshes.chain(templates).collect();
    in_place.check_names(&inputs, output, &[])
}

/// Meshes of a rig among those of its project: those that have weights, or the first one if none has. The others are told.
pub(super) fn own_meshes(meshes: Vec<LoadedMesh>, rig: &Rig, report: &mut Report) -> Vec<RigMesh> {
    let open = meshes.into_iter().filter(|mesh| mesh.rig == rig.uid()).filter_map(|mesh| match mesh.shape {
        MeshState::Open { model, .. } => Some((mesh.uid, model, mesh.nodes)),
        // The notes mention a missing mesh already.
        MeshState::Missing { .. } => None,
    });
    let open: Vec<_> = open.collect();
    let is_any_bound = open.iter().any(|(uid, ..)| rig.skin(*uid).is_some());
    let mut own = Vec::new();
    for (uid, model, nodes) in open {
        let is_kept = if is_any_bound { rig.skin(uid).is_some() } else { own.is_empty() };
        if !is_kept {
            report
                .notes
                .push(format!("the mesh \"{}\" is left out: it has no weights; skin it in the window", model.name));
            continue;
        }
        own.push(RigMesh::new(uid, *model, nodes.to_vec()));
    }
    own
}
