//! Entities of local groups follow the document, in its order.

use bevy::{ecs::entity::EntityHashMap, prelude::*};

use super::entities::{EntityIndex, EntityPart, GroupEntities, misplaced};
use crate::{
    plugins::schema::{GroupOf, LocalGroup, LocalGroups},
    rig::{Rig, Uid},
};

/// Spawns, updates and despawns the entities of local groups so that they match the document.
pub(super) fn follow_groups(
    commands: &mut Commands,
    rig_entity: Entity,
    rig: &Rig,
    known: &mut GroupEntities,
    index: &mut EntityIndex,
) {
    let mut gone: Vec<Uid> = known.groups.keys().filter(|uid| rig.group(**uid).is_none()).copied().collect();
    gone.sort_unstable();
    for uid in gone {
        if let Some((entity, _)) = known.groups.remove(&uid) {
            index.remove(entity);
            commands.entity(entity).try_despawn();
        }
    }
    for group in rig.groups() {
        let told = LocalGroup { name: group.name.clone(), color: group.color, enabled: group.enabled };
        match known.groups.get_mut(&group.uid) {
            Some((_, data)) if data == group => {}
            Some((entity, data)) => {
                data.clone_from(group);
                commands.entity(*entity).try_insert((told, Name::new(group.name.clone())));
            }
            None => {
                let bundle = (told, group.uid, GroupOf(rig_entity), Name::new(group.name.clone()));
                let entity = commands.spawn(bundle).id();
                index.insert(entity, rig_entity, group.uid, EntityPart::Group);
                known.groups.insert(group.uid, (entity, group.clone()));
            }
        }
    }
}

/// Puts the local groups of rigs into the order of the document, where the document or other code changed the order.
pub(in crate::plugins) fn order_groups(
    mut commands: Commands,
    rigs: Query<(Entity, &Rig, &GroupEntities, &LocalGroups), Or<(Changed<Rig>, Changed<LocalGroups>)>>,
) {
    for (rig_entity, rig, known, groups) in &rigs {
        let ranks: EntityHashMap<usize> =
            (rig.groups().iter().enumerate()).filter_map(|(rank, group)| Some((known.get(group.uid)?, rank))).collect();
        for group in misplaced(groups.iter(), &ranks) {
            // Removing and inserting each group in turn puts it behind the ones before it.
            commands.entity(group).try_remove::<GroupOf>().try_insert(GroupOf(rig_entity));
        }
    }
}
