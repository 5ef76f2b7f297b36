//! Motion of the file that the open mesh has come from: clips of a character whose joints a template has replaced.

use std::path::PathBuf;

use bevy::prelude::*;

use crate::{
    editor::{ActiveRig, files::MeshSource},
    files::FileKind,
    plugins::surface::RigMeshes,
};

/// The first file with a skeleton of its own that a mesh of the active rig has come from.
pub(in crate::editor) fn own_file(world: &World) -> Option<PathBuf> {
    let active = world.get_resource::<ActiveRig>()?.0;
    let meshes = world.get::<RigMeshes>(active)?;
    let file = |mesh: Entity| match world.get::<MeshSource>(mesh)? {
        MeshSource::File(path) if FileKind::of(path).is_some_and(FileKind::is_gltf) => Some(path.clone()),
        MeshSource::File(_) | MeshSource::Bundled(_) => None,
    };
    meshes.iter().find_map(file)
}
