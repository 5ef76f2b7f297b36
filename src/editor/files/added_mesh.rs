//! Meshes that are added to the open rig, and removed from it.

use std::{
    collections::{BTreeMap, BTreeSet, HashMap},
    path::Path,
    sync::Arc,
};

use bevy::prelude::*;

use super::{
    DocumentLanded, active,
    document::{Context, ContextMesh, OpenDocument, SavedAt, meshes},
    open::LoadedDocument,
};
use crate::{
    editor::{camera::FrameWhenReady, counts::counted, notice::Notice, settings::EditorSettings},
    files::{FileKind, journal::Origin},
    plugins::{document::EditRequest, surface::SkinOf},
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

/// Puts the mesh of a file below the open rig, which has none, and whose history goes on.
pub(super) fn put(world: &mut World, name: &str, opened: LoadedDocument) {
    let Some(entity) = active(world) else { return };
    let joints = world.get::<Rig>(entity).map_or(0, Rig::len);
    let told = Notice::done(format!(
        "Opened {name} with the {} that were there: Fit puts them into the mesh, New begins without them",
        counted(joints, "joint", "joints")
    ));
    land(world, entity, opened, told);
}

/// Puts the mesh of a file below the open rig, beside the meshes that it has. Joints of the file are left aside: joints of
/// the rig with their names take their places and weights, the weights as one step.
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
    land(world, entity, opened, Notice::done(told).at("Skinning"));
    if !edits.is_empty() {
        let operation = Operation::Named { name: "Add mesh", edits };
        world.write_message(EditRequest::operation(entity, operation));
    }
}

/// Removes a mesh from the open rig; its file stays. Its weights go as one step.
pub(super) fn remove(world: &mut World, uid: Uid) {
    let Some(rig) = active(world) else { return };
    let found = meshes(world, rig).into_iter().find(|(_, mesh, _)| mesh.uid == uid);
    let Some((mesh, name)) = found.map(|(entity, mesh, _)| (entity, mesh.file.name.clone())) else { return };
    world.despawn(mesh);
    note_meshes(world, rig);
    if world.get::<Rig>(rig).is_some_and(|rig| rig.skin(uid).is_some()) {
        let operation = Operation::Named { name: "Remove mesh", edits: vec![RigEdit::SetSkin(uid, None)] };
        world.write_message(EditRequest::operation(rig, operation));
    }
    world.write_message(Notice::done(format!("Removed the mesh {name}; its file stays, and Add mesh takes it again")));
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

/// Spawns the meshes of a file below the open rig.
fn land(world: &mut World, entity: Entity, opened: LoadedDocument, told: Notice) {
    if let Some(path) = opened.origin.path() {
        world.resource_mut::<EditorSettings>().remember(path.to_owned());
    }
    for (mesh, source) in opened.meshes {
        world.spawn((mesh, source, SkinOf(entity)));
    }
    note_meshes(world, entity);
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

/// Notes the meshes of the open rig in its journal; no file has them yet.
fn note_meshes(world: &mut World, entity: Entity) {
    let listed = meshes(world, entity).into_iter().filter_map(|(_, mesh, source)| {
        Some(ContextMesh { uid: mesh.uid, source: source?.clone(), nodes: mesh.nodes.to_vec() })
    });
    let listed: Vec<ContextMesh> = listed.collect();
    if let Some(mut document) = world.get_mut::<OpenDocument>(entity) {
        let context = Context { name: document.name.clone(), meshes: listed };
        document.journal.context(context.text());
        document.saved = SavedAt::Nowhere;
    }
}
