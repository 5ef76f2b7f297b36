//! Files that are dropped on the window together: one document, to which the others come.

use std::path::{Path, PathBuf};

use bevy::prelude::*;

use super::{LoadJob, OpenRequest, added_mesh, dialog::Dialog, open::recognise, request_mesh, request_open, template};
use crate::{editor::notice::Notice, files::FileKind};

/// Order in which files of several kinds are opened.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Turn {
    /// Projects have meshes of their own, beside which others come.
    Project,
    Mesh,
    /// Templates are put onto meshes.
    Rig,
    /// Motion is put onto rigs.
    Motion,
    /// Files that are no documents, such as the textures of a mesh.
    Never,
}

impl Turn {
    fn of(path: &Path) -> Self {
        match FileKind::of(path) {
            Some(FileKind::Project) => Self::Project,
            Some(FileKind::Obj | FileKind::Gltf | FileKind::Glb | FileKind::Vrm) => Self::Mesh,
            Some(FileKind::Template | FileKind::RigText) => Self::Rig,
            Some(FileKind::Bvh | FileKind::PackedClips | FileKind::Animation) => Self::Motion,
            Some(FileKind::Skin | FileKind::Gestures) | None => Self::Never,
        }
    }
}

/// Requests to open files that were dropped together. Those that cannot be opened are only named beside others that can.
pub(super) fn requests(world: &mut World, mut paths: Vec<PathBuf>) -> Vec<OpenRequest> {
    paths.sort_by_key(|path| Turn::of(path));
    let has_document = paths.first().is_some_and(|path| Turn::of(path) < Turn::Motion);
    if !has_document || paths.len() == 1 {
        return paths.into_iter().map(OpenRequest::File).collect();
    }
    let known = paths.partition_point(|path| Turn::of(path) < Turn::Never);
    for path in paths.drain(known..) {
        if let Err(error) = recognise(&path) {
            world.write_message(Notice::info(error.to_string()).quiet());
        }
    }
    let mut paths = paths.into_iter();
    let Some(first) = paths.next() else { return Vec::new() };
    vec![match paths.len() {
        0 => OpenRequest::File(first),
        _ => OpenRequest::Files { first, others: paths.collect() },
    }]
}

/// Opens the next of several files once the one before it is there, and nothing is asked about it any more.
pub(super) fn open_next(world: &mut World) {
    let loading = world.resource::<LoadJob>();
    let is_free = loading.name().is_none() && world.resource::<Dialog>().question().is_none();
    if loading.further.is_empty() || !is_free {
        return;
    }
    let mut further = std::mem::take(&mut world.resource_mut::<LoadJob>().further);
    if let Some(path) = further.pop_front() {
        if added_mesh::is_mesh_file(&path) && template::has_mesh(world) {
            request_mesh(world, path);
        } else {
            request_open(world, OpenRequest::File(path));
        }
    }
    // Each request to open something drops the files that waited before it.
    world.resource_mut::<LoadJob>().further = further;
}
