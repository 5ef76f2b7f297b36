//! Meshes that are added to the open rig, and removed from it: steps of its history. The document holds those that are gone,
//! so that undo and redo bring them back.

use std::{
    collections::{BTreeMap, BTreeSet, HashMap},
    path::Path,
    sync::Arc,
};

use bevy::prelude::*;

use super::{
    DocumentLanded, active,
    bundle::BODY,
    document::{MeshSource, OpenDocument, context, meshes},
    open::LoadedDocument,
};
use crate::{
    editor::{camera::FrameWhenReady, counts::counted, notice::Notice, settings::EditorSettings},
    files::{FileKind, journal::Origin},
    plugins::{
        document::EditRequest,
        surface::{RigMesh, SkinOf},
    },
    rig::{Rig, RigEdit, SkinData, Uid, operations::Operation},
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

/// Puts the mesh of a file below the open rig, which has none, as a step of its history.
pub(super) fn put(world: &mut World, name: &str, opened: LoadedDocument) {
    let Some(entity) = active(world) else { return };
    let joints = world.get::<Rig>(entity).map_or(0, Rig::len);
    let told = Notice::done(format!(
        "Opened {name} with the {} that were there: Fit puts them into the mesh, New begins without them",
        counted(joints, "joint", "joints")
    ));
    land(world, entity, opened, Vec::new(), told);
}

/// Puts the mesh of a file below the open rig, beside the meshes that it has, as one step. Joints of the file are left aside:
/// joints of the rig with their names take their places and weights.
pub(super) fn add(world: &mut World, name: &str, mut opened: LoadedDocument) {
    let Some(entity) = active(world) else { return };
    let Some(rig) = world.get::<Rig>(entity) else { return };
    let NamedJoints { edits, is_lost } = take_joints(rig, &mut opened);
    let told = match (edits.is_empty(), rig.is_empty()) {
        (false, _) => format!("Added {name} with its weights"),
        (true, true) => format!("Added {name}"),
        (true, false) if is_lost => {
            format!(
                "Added {name} without its weights, which are for joints of other names: the Skinning panel binds it"
            )
        }
        (true, false) => format!("Added {name}: the Skinning panel binds it"),
    };
    land(world, entity, opened, edits, Notice::done(told).at("Skinning"));
}

/// Removes a mesh and its weights from the open rig, as one step; its file stays.
pub(super) fn remove(world: &mut World, uid: Uid) {
    let Some(rig) = active(world) else { return };
    let found = meshes(world, rig).into_iter().find(|(_, mesh, _)| mesh.uid == uid);
    let Some((mesh, name)) = found.map(|(entity, mesh, _)| (entity, mesh.file.name.clone())) else { return };
    let is_bound = world.get::<Rig>(rig).is_some_and(|rig| rig.skin(uid).is_some());
    let mut edits = vec![RigEdit::RemoveMesh(uid)];
    edits.extend(is_bound.then_some(RigEdit::SetSkin(uid, None)));
    // At once, since a mesh without its weights would show its rest pose for a frame.
    set_aside(world, rig, mesh);
    note_meshes(world, rig);
    world.write_message(EditRequest::operation(rig, Operation::Named { name: "Remove mesh", edits }));
    world.write_message(Notice::done(format!("Removed the mesh {name}; its file stays, and undo brings it back")));
}

/// Follows steps of the open rig that were done, undone or redone: the meshes that came with them (`true`) or left.
pub(super) fn follow(world: &mut World, changes: &BTreeMap<Uid, bool>) {
    let Some(rig) = active(world) else { return };
    let open: BTreeMap<Uid, Entity> =
        meshes(world, rig).into_iter().map(|(entity, mesh, _)| (mesh.uid, entity)).collect();
    let mut is_changed = false;
    for (uid, is_there) in changes {
        is_changed |= match (is_there, open.get(uid)) {
            (true, None) => bring_back(world, rig, *uid),
            (false, Some(mesh)) => set_aside(world, rig, *mesh),
            _ => false,
        };
    }
    if is_changed {
        note_meshes(world, rig);
    }
}

/// Spawns a mesh that was set aside; returns `false` without such a mesh.
fn bring_back(world: &mut World, rig: Entity, uid: Uid) -> bool {
    let Some(mut document) = world.get_mut::<OpenDocument>(rig) else { return false };
    let Some(place) = document.set_aside.iter().position(|(mesh, _)| mesh.uid == uid) else { return false };
    let (mesh, source) = document.set_aside.remove(place);
    world.spawn((mesh, source, SkinOf(rig)));
    true
}

/// Despawns a mesh, which the document holds from now on; returns `false` without such a mesh.
fn set_aside(world: &mut World, rig: Entity, entity: Entity) -> bool {
    let Some(mesh) = world.get::<RigMesh>(entity).cloned() else { return false };
    let source = world.get::<MeshSource>(entity).cloned().unwrap_or_else(|| MeshSource::Bundled(BODY.to_owned()));
    world.despawn(entity);
    if let Some(mut document) = world.get_mut::<OpenDocument>(rig) {
        document.set_aside.push((mesh, source));
    }
    true
}

/// Result of [`take_joints`].
struct NamedJoints {
    /// Edits that bind meshes with the weights of their file.
    edits: Vec<RigEdit>,
    /// Marks weights that are for joints without a namesake.
    is_lost: bool,
}

/// Has joints of a rig take the places of joints of a file with their names.
fn take_joints(rig: &Rig, opened: &mut LoadedDocument) -> NamedJoints {
    let mut named: HashMap<&str, Uid> = HashMap::new();
    for joint in rig.walk() {
        if let Some(label) = joint.data.label.as_deref() {
            named.entry(label).or_insert(joint.data.uid);
        }
    }
    let LoadedDocument { rig: own, meshes, .. } = opened;
    let own: &Rig = own;
    let same = |joint: Uid| named.get(own.joint(joint)?.data.label.as_deref()?).copied();
    let mut taken = NamedJoints { edits: Vec::new(), is_lost: false };
    for (mesh, _) in meshes {
        if let Some(skin) = own.skin(mesh.uid) {
            match weights_of_named(skin, same) {
                Some(skin) => taken.edits.push(RigEdit::SetSkin(mesh.uid, Some(Arc::new(skin)))),
                None => taken.is_lost = true,
            }
        }
        mesh.nodes = mesh.nodes.iter().map(|node| same(*node).unwrap_or(*node)).collect();
    }
    taken
}

/// Weights of a file over the joints of a rig that take the places of its joints. `None` if one that has weights finds none,
/// or if two find the same.
fn weights_of_named(skin: &SkinData, same: impl Fn(Uid) -> Option<Uid>) -> Option<SkinData> {
    let used: BTreeSet<u32> = skin.weights.joints.iter().copied().collect();
    let mut joints: Vec<Uid> = Vec::with_capacity(used.len());
    let (mut numbers, mut taken) = (BTreeMap::new(), BTreeSet::new());
    for number in used {
        let joint = same(*skin.joints.get(number as usize)?)?;
        if !taken.insert(joint) {
            return None;
        }
        numbers.insert(number, joints.len() as u32);
        joints.push(joint);
    }
    let mut weights = skin.weights.clone();
    for number in &mut weights.joints {
        *number = *numbers.get(&*number)?;
    }
    // The mesh is taken as it stands at rest, whatever bind pose its file has.
    Some(SkinData { joints, weights, at_rest: true, ..SkinData::default() })
}

/// Spawns the meshes of a file below the open rig, and requests the step that they are part of, with their weights.
fn land(world: &mut World, entity: Entity, opened: LoadedDocument, weights: Vec<RigEdit>, told: Notice) {
    if let Some(path) = opened.origin.path() {
        world.resource_mut::<EditorSettings>().remember(path.to_owned());
    }
    let mut edits: Vec<RigEdit> = opened.meshes.iter().map(|(mesh, _)| RigEdit::AddMesh(mesh.uid)).collect();
    edits.extend(weights);
    for (mesh, source) in opened.meshes {
        world.spawn((mesh, source, SkinOf(entity)));
    }
    note_meshes(world, entity);
    world.write_message(EditRequest::operation(entity, Operation::Named { name: "Add mesh", edits }));
    world.write_message(DocumentLanded { origin: Origin::Empty });
    world.resource_mut::<FrameWhenReady>().0 = true;
    world.write_message(told);
    for warning in opened.warnings {
        world.write_message(Notice::warning(warning));
    }
    for note in opened.notes {
        world.write_message(Notice::info(note).quiet());
    }
}

/// Notes the meshes of the open rig in its journal.
fn note_meshes(world: &World, entity: Entity) {
    let Some(document) = world.get::<OpenDocument>(entity) else { return };
    let listed = context(world, entity, document.name.clone());
    document.journal.context(listed.text());
}
