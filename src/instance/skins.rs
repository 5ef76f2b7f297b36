//! Skinned meshes that instances move: those of files that Bevy loaded, and those of another rig.

use bevy::{mesh::skinning::SkinnedMesh, prelude::*};

use super::{
    RigInstance, RunningTemplate,
    file_nodes::{FileRest, LoadedSkin, file_rests},
};
use crate::{
    plugins::{runtime::RigRuntime, schema::NodeOf},
    rig::{BuiltNode, Uid},
};

/// Skinned mesh below an instance, whose joints are the instance's nodes.
#[derive(Component, Reflect, Debug, Clone, Copy, PartialEq, Eq)]
#[reflect(Component)]
pub struct BoundTo(pub Entity);

/// A skinned mesh below an instance follows it from now on.
#[derive(EntityEvent, Debug, Clone)]
pub struct SkinBound {
    /// The mesh.
    pub entity: Entity,
    /// The instance.
    pub instance: Entity,
    /// Names of joints that the instance does not have. They hang on the nearest joint above them that it has.
    pub unknown: Vec<String>,
}

/// True if a mesh or an instance is new.
pub(super) fn is_due(
    skins: Query<(), (Added<SkinnedMesh>, Without<BoundTo>)>,
    instances: Query<(), Added<RunningTemplate>>,
) -> bool {
    !skins.is_empty() || !instances.is_empty()
}

/// Lets the nodes of instances move the skinned meshes below them: a joint of the mesh is replaced by the node with its uid, or
/// with its name as label.
pub(super) fn bind_skins(
    mut skins: Query<(Entity, &mut SkinnedMesh), Without<BoundTo>>,
    parents: Query<&ChildOf>,
    instances: Query<(&RunningTemplate, &RigRuntime), With<RigInstance>>,
    joints: Query<(Option<&Uid>, Option<&Name>)>,
    own: Query<&NodeOf>,
    files: Query<(&Transform, Option<&FileRest>), Without<NodeOf>>,
    mut commands: Commands,
) {
    for (mesh, mut skin) in &mut skins {
        let Some(instance) = parents.iter_ancestors(mesh).find(|above| instances.contains(*above)) else { continue };
        let Ok((template, runtime)) = instances.get(instance) else { continue };
        let program = runtime.state().program();
        let slot = |joint: Entity| {
            let (uid, name) = joints.get(joint).ok()?;
            let by_name = || {
                let name = name?.as_str();
                let named = |node: &&BuiltNode| node.label.as_deref() == Some(name) || &*node.name == name;
                program.node(template.get().built.nodes.iter().find(named)?.uid)
            };
            uid.and_then(|uid| program.node(*uid)).or_else(by_name)
        };
        let node = |joint: Entity| {
            if own.get(joint).is_ok_and(|own| own.0 == instance) {
                return Some(joint);
            }
            runtime.entity(slot(joint)?)
        };
        if skin.joints.iter().any(|joint| !own.contains(*joint)) {
            let rests = file_rests(&skin.joints, instance, &parents, &files);
            let above = |node: &Entity| parents.get(*node).ok().map(ChildOf::parent).filter(|above| *above != instance);
            let taken = |node: &Entity| slot(*node).filter(|slot| runtime.entity(*slot).is_some());
            commands.entity(mesh).try_insert(LoadedSkin {
                bindposes: skin.inverse_bindposes.clone(),
                joints: skin.joints.clone(),
                parents: rests.keys().filter_map(|node| Some((*node, above(node)?))).collect(),
                nodes: rests.keys().filter_map(|node| Some((*node, program.nodes()[taken(node)?].uid))).collect(),
                rests: rests.clone(),
            });
            for (node, rest) in rests {
                commands.entity(node).try_insert_if_new(rest);
            }
        }
        let mut unknown = Vec::new();
        for joint in &mut skin.joints {
            if let Some(node) = node(*joint) {
                *joint = node;
                continue;
            }
            unknown.push(joints.get(*joint).ok().and_then(|(_, name)| name).map_or_else(String::new, Name::to_string));
            if let Ok(above) = parents.get(*joint)
                && let Some(node) = node(above.parent())
            {
                commands.entity(*joint).try_insert(ChildOf(node));
            }
        }
        commands.entity(mesh).try_insert(BoundTo(instance));
        commands.trigger(SkinBound { entity: mesh, instance, unknown });
    }
}

/// Shows the drawn mesh of another entity on an instance, moved by the instance: a crowd shares one mesh. The other entity
/// has the pieces of the mesh below it, as a [`RigMesh`](crate::plugins::surface::RigMesh) with the display plugin or a loaded
/// scene has, and may be hidden.
#[cfg(feature = "draw")]
#[derive(Component, Reflect, Debug, Clone, Copy, PartialEq, Eq)]
#[reflect(Component)]
#[require(Visibility)]
pub struct SharedMesh(pub Entity);

/// Instance that has its pieces of a shared mesh.
#[cfg(feature = "draw")]
#[derive(Component)]
pub(super) struct HasPieces;

/// Gives instances their pieces of shared meshes, once these are there.
#[cfg(feature = "draw")]
pub(super) fn share_meshes(
    sharing: Query<(Entity, &SharedMesh), (With<RigInstance>, Without<HasPieces>)>,
    children: Query<&Children>,
    pieces: Query<(&Mesh3d, &MeshMaterial3d<StandardMaterial>, &SkinnedMesh)>,
    mut commands: Commands,
) {
    for (instance, SharedMesh(of)) in &sharing {
        let below = std::iter::once(*of).chain(children.iter_descendants(*of));
        let mut is_there = false;
        for (mesh, material, skin) in below.filter_map(|piece| pieces.get(piece).ok()) {
            is_there = true;
            commands.spawn((mesh.clone(), material.clone(), skin.clone(), Transform::default(), ChildOf(instance)));
        }
        if is_there {
            commands.entity(instance).try_insert(HasPieces);
        }
    }
}
