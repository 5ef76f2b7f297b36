//! Entities of local groups follow the document, in its order.

use std::collections::BTreeSet;

use bevy::{ecs::entity::EntityHashMap, prelude::*};

use super::entities::{EntityIndex, EntityPart, GroupEntities, misplaced};
use crate::{
    plugins::schema::{GroupOf, LocalGroup, LocalGroups},
    rig::{GroupData, Rig, Uid},
};

/// Spawns, updates and despawns the entities of local groups so that they match the document: of the `touched` groups, or of
/// all of them where these are not known.
pub(super) fn follow_groups(
    commands: &mut Commands,
    rig_entity: Entity,
    rig: &Rig,
    touched: Option<&BTreeSet<Uid>>,
    known: &mut GroupEntities,
    index: &mut EntityIndex,
) {
    let is_gone = |uid: &&Uid| rig.group(**uid).is_none();
    let mut gone: Vec<Uid> = match touched {
        Some(touched) => touched.iter().filter(is_gone).copied().collect(),
        None => known.groups.keys().filter(is_gone).copied().collect(),
    };
    gone.sort_unstable();
    for uid in gone {
        if let Some((entity, _)) = known.groups.remove(&uid) {
            index.remove(entity);
            commands.entity(entity).try_despawn();
        }
    }
    let due: Vec<&GroupData> = match touched {
        Some(touched) => rig.groups_in_order(touched),
        None => rig.groups().iter().collect(),
    };
    known.visits += due.len() as u64;
    known.is_unsorted |= !due.is_empty();
    for group in due {
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
    mut rigs: Query<(Entity, &Rig, &mut GroupEntities, Ref<LocalGroups>), Or<(Changed<Rig>, Changed<LocalGroups>)>>,
) {
    for (rig_entity, rig, mut known, groups) in &mut rigs {
        let known = known.bypass_change_detection();
        if !std::mem::take(&mut known.is_unsorted) && !groups.is_changed() {
            continue;
        }
        known.visits += rig.groups().len() as u64;
        let ranks: EntityHashMap<usize> =
            (rig.groups().iter().enumerate()).filter_map(|(rank, group)| Some((known.get(group.uid)?, rank))).collect();
        for group in misplaced(groups.iter(), &ranks) {
            // Removing and inserting each group in turn puts it behind the ones before it.
            commands.entity(group).try_remove::<GroupOf>().try_insert(GroupOf(rig_entity));
        }
    }
}
