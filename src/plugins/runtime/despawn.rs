//! Nodes that are despawned, however deep their hierarchy is.
//!
//! Bevy despawns the children of an entity within the despawning of that entity, and their children within theirs: a chain of a
//! few thousand joints takes more stack than a thread has. Deep hierarchies are taken apart before.

use bevy::{ecs::entity::EntityHashSet, prelude::*};

use super::{NodeOf, RigNodes};

/// Levels of a hierarchy that are left to Bevy.
const SHALLOW: usize = 100;

/// Marks an app in which deep hierarchies are taken apart.
#[derive(Resource)]
struct DeepDespawns;

/// Lets rigs of any depth be despawned. Every plugin with nodes asks for it; harmless when repeated.
pub(in crate::plugins) fn allow_any_depth(app: &mut App) {
    if !app.world().contains_resource::<DeepDespawns>() {
        app.insert_resource(DeepDespawns).add_observer(take_apart);
    }
}

/// Despawns the nodes of an instance. What others hung on them stays, on the instance.
pub(crate) fn despawn_nodes(world: &mut World, instance: Entity) {
    let nodes: Vec<Entity> = world.get::<RigNodes>(instance).map(|nodes| nodes.iter().collect()).unwrap_or_default();
    let is_hung = |child: &Entity| world.get::<NodeOf>(*child).is_none_or(|of| of.0 != instance);
    let children = nodes.iter().filter_map(|node| world.get::<Children>(*node));
    let hung: Vec<Entity> = children.flat_map(|children| children.iter()).filter(is_hung).collect();
    for child in hung {
        world.entity_mut(child).insert(ChildOf(instance));
    }
    let deep = deep_below(nodes, |entity| world.get(entity), |entity| world.get(entity));
    match deep {
        Some(found) => despawn_apart(world, &found),
        None => {
            world.entity_mut(instance).despawn_related::<RigNodes>();
        }
    }
}

/// Queues the despawning of all that goes with a rig, if it hangs deep below it. Commands of observers run before those with
/// which Bevy despawns children.
fn take_apart(
    despawned: On<Despawn, RigNodes>,
    children: Query<&Children>,
    nodes: Query<&RigNodes>,
    mut commands: Commands,
) {
    let deep = deep_below(vec![despawned.entity], |entity| children.get(entity).ok(), |entity| nodes.get(entity).ok());
    if let Some(found) = deep {
        commands.queue(move |world: &mut World| despawn_apart(world, &found));
    }
}

/// All that is despawned together with some entities, and those themselves; `None` if the hierarchy is shallow.
fn deep_below<'w>(
    entities: Vec<Entity>,
    children: impl Fn(Entity) -> Option<&'w Children>,
    nodes: impl Fn(Entity) -> Option<&'w RigNodes>,
) -> Option<Vec<Entity>> {
    let (mut found, mut seen) = (Vec::new(), EntityHashSet::default());
    let (mut tops, mut depth) = (entities, 0);
    while !tops.is_empty() {
        let first = found.len();
        found.extend(tops.into_iter().filter(|entity| seen.insert(*entity)));
        let mut level = first..found.len();
        while !level.is_empty() {
            for at in level.clone() {
                let below = children(found[at]).into_iter().flat_map(|children| children.iter());
                found.extend(below.filter(|entity| seen.insert(*entity)));
            }
            level = level.end..found.len();
            depth += 1;
        }
        // Nodes without a hierarchy are tied to their rig alone.
        let owned = found[first..].iter().filter_map(|entity| nodes(*entity)).flat_map(|nodes| nodes.iter());
        tops = owned.filter(|entity| !seen.contains(entity)).collect();
    }
    (depth > SHALLOW).then_some(found)
}

/// Despawns entities after all children were taken off them, so that no despawning leads to another.
fn despawn_apart(world: &mut World, entities: &[Entity]) {
    for entity in entities {
        if let Ok(mut entity) = world.get_entity_mut(*entity) {
            entity.detach_all_children();
        }
    }
    for entity in entities {
        if let Ok(entity) = world.get_entity_mut(*entity) {
            entity.despawn();
        }
    }
}
