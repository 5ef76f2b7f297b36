//! Meshes that are added to the open rig.

use std::path::Path;

use bevy::prelude::*;

use super::{
    DocumentLanded, active,
    document::{Context, ContextMesh, OpenDocument, SavedAt, meshes},
    open::LoadedDocument,
};
use crate::{
    editor::{camera::FrameWhenReady, counts::counted, notice::Notice, settings::EditorSettings},
    files::{FileKind, journal::Origin},
    plugins::surface::SkinOf,
    rig::Rig,
};

/// Returns `true` if the open rig has joints and no mesh, not even one that was not found.
pub(super) fn is_awaited(world: &World) -> bool {
    let Some(entity) = active(world) else { return false };
    let has_joints = world.get::<Rig>(entity).is_some_and(|rig| !rig.is_empty());
    let misses_none = world.get::<OpenDocument>(entity).is_some_and(|document| document.missing.is_empty());
    has_joints && misses_none && meshes(world, entity).is_empty()
}

/// Returns `true` for files with meshes, by their names.
pub(super) fn is_mesh_file(path: &Path) -> bool {
    matches!(FileKind::of(path), Some(FileKind::Obj | FileKind::Gltf | FileKind::Glb | FileKind::Vrm))
}

/// Returns `true` for the mesh of a file that has neither joints nor clips: with them it is a document of its own.
pub(super) fn is_alone(opened: &LoadedDocument) -> bool {
    let is_of_mesh = matches!(opened.origin, Origin::Mesh { .. }) && opened.work.is_none();
    is_of_mesh && opened.rig.is_empty() && opened.rig.clips().is_empty()
}

/// Puts the mesh of a file below the open rig, whose history goes on.
pub(super) fn put(world: &mut World, name: &str, opened: LoadedDocument) {
    let Some(entity) = active(world) else { return };
    if let Some(path) = opened.origin.path() {
        world.resource_mut::<EditorSettings>().remember(path.to_owned());
    }
    for (mesh, source) in opened.meshes {
        world.spawn((mesh, source, SkinOf(entity)));
    }
    let listed = meshes(world, entity).into_iter().filter_map(|(_, mesh, source)| {
        Some(ContextMesh { uid: mesh.uid, source: source?.clone(), nodes: mesh.nodes.to_vec() })
    });
    let listed: Vec<ContextMesh> = listed.collect();
    if let Some(mut document) = world.get_mut::<OpenDocument>(entity) {
        let context = Context { name: document.name.clone(), meshes: listed };
        document.journal.context(context.text());
        // No file has both yet.
        document.saved = SavedAt::Nowhere;
    }
    world.write_message(DocumentLanded { origin: Origin::Empty });
    world.resource_mut::<FrameWhenReady>().0 = true;
    let joints = world.get::<Rig>(entity).map_or(0, Rig::len);
    world.write_message(Notice::done(format!(
        "Opened {name} with the {} that were there: Fit puts them into the mesh, New begins without them",
        counted(joints, "joint", "joints")
    )));
    for warning in opened.warnings {
        world.write_message(Notice::warning(warning));
    }
    for note in opened.notes {
        world.write_message(Notice::info(note).quiet());
    }
}
