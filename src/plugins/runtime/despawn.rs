//! Nodes that are despawned, however deep their hierarchy is.
//!
//! Bevy despawns the children of an entity while it despawns that entity, and their children while it despawns them: a chain
//! of a few thousand joints takes more stack than a thread has. Deep hierarchies are taken apart before.

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
    let children = nodes.iter().filter_map(|node| world.get::<Children>(*node));
    let below = children.flat_map(|children| children.iter());
    let hung: Vec<Entity> = below.filter(|child| is_of_another(world, *child, instance)).collect();
    for child in hung {
        world.entity_mut(child).insert(ChildOf(instance));
    }
    let now = &*world;
    let is_top =
        |node: &Entity| now.get::<ChildOf>(*node).is_none_or(|above| is_of_another(now, above.parent(), instance));
    let tops: Vec<Entity> = nodes.into_iter().filter(is_top).collect();
    let deep = deep_below(tops, |entity| now.get(entity), |entity| now.get(entity));
    match deep {
        Some(found) => despawn_apart(world, &found),
        None => {
            world.entity_mut(instance).despawn_related::<RigNodes>();
        }
    }
}

/// True for an entity that is no node of an instance.
fn is_of_another(world: &World, entity: Entity, instance: Entity) -> bool {
    world.get::<NodeOf>(entity).is_none_or(|of| of.0 != instance)
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

/// All that is despawned together with the tops of hierarchies, and those themselves; `None` if the hierarchies are shallow.
fn deep_below<'w>(
    mut tops: Vec<Entity>,
    children: impl Fn(Entity) -> Option<&'w Children>,
    nodes: impl Fn(Entity) -> Option<&'w RigNodes>,
) -> Option<Vec<Entity>> {
    let (mut found, mut seen): (Vec<Entity>, _) = (Vec::new(), EntityHashSet::default());
    let mut depth = 0;
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
