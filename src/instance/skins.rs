//! Skinned meshes that instances move: those of files that Bevy loaded, and those of another rig.

use bevy::{
    mesh::skinning::{SkinnedMesh, SkinnedMeshInverseBindposes},
    prelude::*,
};

use super::{
    RigInstance, RunningTemplate, UpdateInstances, apply,
    file_nodes::{self, FileRest, FollowedNode, LoadedSkin, file_rests},
};
#[cfg(feature = "draw")]
use crate::plugins::display::DisplayPiece;
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

/// Filter for skinned meshes that no instance moves. Pieces of a drawn mesh have the joints that they are drawn with.
#[cfg(feature = "draw")]
type Unbound = (Without<BoundTo>, Without<DisplayPiece>);
#[cfg(not(feature = "draw"))]
type Unbound = Without<BoundTo>;

/// Adds the systems that let the nodes of instances move skinned meshes.
pub(super) fn add(app: &mut App) {
    let systems = (
        release_skins.run_if(release_is_due),
        bind_skins.run_if(is_due),
        file_nodes::fit_skins.run_if(file_nodes::fit_is_due),
    );
    app.add_systems(UpdateInstances, systems.chain().after(apply::update_instances));
    #[cfg(feature = "draw")]
    app.add_systems(UpdateInstances, share_meshes.after(apply::update_instances).before(release_skins));
}

/// Joints and inverse bind poses of a skinned mesh from before an instance moved it.
#[derive(Component)]
struct OwnJoints {
    bindposes: Handle<SkinnedMeshInverseBindposes>,
    joints: Vec<Entity>,
}

/// Entities that were put below others, without the nodes of rigs.
type MovedEntities<'w, 's> = Query<'w, 's, (), (Changed<ChildOf>, Without<NodeOf>)>;

/// True if a skinned mesh may follow nodes that are not those of the instance above it any more.
fn release_is_due(
    bound: Query<(), With<OwnJoints>>,
    instances: Query<(), Changed<RunningTemplate>>,
    left: RemovedComponents<RunningTemplate>,
    moved: MovedEntities,
    freed: RemovedComponents<ChildOf>,
) -> bool {
    let is_other = !instances.is_empty() || !left.is_empty() || !moved.is_empty() || !freed.is_empty();
    is_other && !bound.is_empty()
}

/// Gives skinned meshes their own joints back where their instance has other nodes now, in another mode or of another template,
/// is none any more, or is not above them. Those below an instance are bound again.
fn release_skins(
    mut skins: Query<(Entity, &mut SkinnedMesh, &BoundTo, &OwnJoints, Option<&LoadedSkin>)>,
    instances: Query<(Ref<RunningTemplate>, &RigRuntime), With<RigInstance>>,
    parents: Query<&ChildOf>,
    joints: Query<(Option<&Uid>, Option<&Name>)>,
    own: Query<&NodeOf>,
    mut commands: Commands,
) {
    for (mesh, mut skin, BoundTo(instance), before, loaded) in &mut skins {
        let is_held = match instances.get(*instance) {
            Err(_) => false,
            Ok(_) if !parents.iter_ancestors(mesh).any(|above| above == *instance) => false,
            Ok((template, _)) if !template.is_changed() => true,
            Ok((template, runtime)) => skin.joints.iter().zip(&before.joints).all(|(joint, before)| {
                let is_node = own.get(*joint).is_ok_and(|own| own.0 == *instance);
                let node = || runtime.entity(slot_of(*before, &template, runtime, &joints)?);
                is_node || joint == before && node().is_none()
            }),
        };
        if is_held {
            continue;
        }
        skin.joints.clone_from(&before.joints);
        skin.inverse_bindposes = before.bindposes.clone();
        for (node, above) in loaded.into_iter().flat_map(|loaded| &loaded.parents) {
            let is_elsewhere = parents.get(*node).is_ok_and(|of| of.parent() != *above);
            if is_elsewhere && joints.contains(*above) {
                commands.entity(*node).try_insert(ChildOf(*above));
            }
        }
        for node in loaded.into_iter().flat_map(|loaded| loaded.rests.keys()) {
            commands.entity(*node).try_remove::<FollowedNode>();
        }
        commands.entity(mesh).try_remove::<(BoundTo, OwnJoints, LoadedSkin)>();
    }
}

/// Slot of the node that takes the place of a joint: the one with its uid, or with its name.
fn slot_of(
    joint: Entity,
    template: &RunningTemplate,
    runtime: &RigRuntime,
    joints: &Query<(Option<&Uid>, Option<&Name>)>,
) -> Option<usize> {
    let program = runtime.state().program();
    let (uid, name) = joints.get(joint).ok()?;
    let by_name = || {
        let name = name?.as_str();
        let named = |node: &&BuiltNode| node.label.as_deref() == Some(name) || &*node.name == name;
        program.node(template.get().built.nodes.iter().find(named)?.uid)
    };
    uid.and_then(|uid| program.node(*uid)).or_else(by_name)
}

/// True if a mesh without an instance may be below one.
fn is_due(
    skins: Query<(), (With<SkinnedMesh>, Unbound)>,
    added: Query<(), (Added<SkinnedMesh>, Unbound)>,
    instances: Query<(), Changed<RunningTemplate>>,
    moved: MovedEntities,
) -> bool {
    !skins.is_empty() && (!added.is_empty() || !instances.is_empty() || !moved.is_empty())
}

/// Lets the nodes of instances move the skinned meshes below them: a joint of the mesh is replaced by the node with its uid, or
/// with its name as label.
fn bind_skins(
    mut skins: Query<(Entity, &mut SkinnedMesh), Unbound>,
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
        let slot = |joint: Entity| slot_of(joint, template, runtime, &joints);
        let node = |joint: Entity| {
            if own.get(joint).is_ok_and(|own| own.0 == instance) {
                return Some(joint);
            }
            runtime.entity(slot(joint)?)
        };
        if skin.joints.iter().any(|joint| !own.get(*joint).is_ok_and(|own| own.0 == instance)) {
            let (bindposes, joints) = (skin.inverse_bindposes.clone(), skin.joints.clone());
            commands.entity(mesh).try_insert(OwnJoints { bindposes, joints });
        }
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

/// Pieces of a shared mesh that an instance has.
#[cfg(feature = "draw")]
#[derive(Component)]
struct SharedPieces {
    of: Entity,
    pieces: Vec<Entity>,
}

/// Gives instances their pieces of shared meshes, once these are there, and takes away what they do not share any more.
#[cfg(feature = "draw")]
fn share_meshes(
    sharing: Query<(Entity, &SharedMesh, Option<&SharedPieces>), With<RigInstance>>,
    left: Query<(Entity, &SharedPieces), Or<(Without<SharedMesh>, Without<RigInstance>)>>,
    children: Query<&Children>,
    drawn: Query<(&Mesh3d, &MeshMaterial3d<StandardMaterial>, &SkinnedMesh)>,
    mut commands: Commands,
) {
    for (instance, SharedPieces { pieces, .. }) in &left {
        pieces.iter().for_each(|piece| commands.entity(*piece).try_despawn());
        commands.entity(instance).try_remove::<SharedPieces>();
    }
    for (instance, SharedMesh(of), had) in &sharing {
        if had.is_some_and(|had| had.of == *of) {
            continue;
        }
        let below = std::iter::once(*of).chain(children.iter_descendants(*of));
        let mut pieces = Vec::new();
        for (mesh, material, skin) in below.filter_map(|piece| drawn.get(piece).ok()) {
            let piece = (mesh.clone(), material.clone(), skin.clone(), Transform::default(), ChildOf(instance));
            pieces.push(commands.spawn(piece).id());
        }
        // The former mesh is shown until there is another one.
        if pieces.is_empty() {
            continue;
        }
        let former = had.into_iter().flat_map(|had| &had.pieces);
        former.for_each(|piece| commands.entity(*piece).try_despawn());
        commands.entity(instance).try_insert(SharedPieces { of: *of, pieces });
    }
}
