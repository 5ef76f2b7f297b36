//! Writes to the entities of local groups.

use bevy::prelude::*;

use super::{super::entities::EntityPart, Adoption, EntityWrite, EntityWriteError, sorting::RigWrites};
use crate::{
    plugins::schema::{GroupOf, LocalGroup},
    rig::{GroupData, RigEdit},
};

impl Adoption<'_, '_, '_, '_, '_, '_> {
    pub fn groups_written(&mut self, writes: &RigWrites) {
        for &entity in &writes.spawned_groups {
            let Ok(view) = self.views.get(entity) else { continue };
            let (Some(group), asked) = (view.group.cloned(), view.uid.copied()) else { continue };
            self.trial.look_at_entity(entity);
            if view.group_of != Some(&GroupOf(self.trial.rig_entity)) {
                self.commands.entity(entity).try_remove::<GroupOf>();
                self.trial.refuse(EntityWriteError::GroupBearer);
                continue;
            }
            let uid = self.trial.free_uid(asked);
            let data = GroupData { uid, name: group.name, color: group.color, enabled: group.enabled };
            let added = RigEdit::AddLocalGroup(data.clone(), usize::MAX);
            if self.trial.edit(EntityWrite::SpawnedLocalGroup, vec![added]) {
                self.commands.entity(entity).try_insert((uid, Name::new(data.name.clone())));
                self.index.insert(entity, self.trial.rig_entity, uid, EntityPart::Group);
                self.groups.groups.insert(uid, (entity, data));
            } else {
                // The refused entity stays, but belongs to no rig.
                self.commands.entity(entity).try_remove::<GroupOf>();
            }
        }
        for &(entity, uid) in &writes.groups {
            let Some((_, data)) = self.groups.groups.get(&uid).cloned() else { continue };
            let Ok(view) = self.views.get(entity) else { continue };
            self.trial.look_at(uid);
            self.hold_uid(entity, uid, view.uid.copied());
            if view.group_of != Some(&GroupOf(self.trial.rig_entity)) {
                self.commands.entity(entity).try_insert(GroupOf(self.trial.rig_entity));
                self.trial.refuse(EntityWriteError::GroupRig { name: data.name.clone() });
            }
            // Inspectors write the name of an entity.
            let name = view.name.map(Name::as_str).filter(|name| *name != data.name && !name.is_empty());
            let told = view.group.map(|group| GroupData {
                uid,
                name: name.filter(|_| group.name == data.name).unwrap_or(&group.name).to_owned(),
                color: group.color,
                enabled: group.enabled,
            });
            let is_taken = match &told {
                Some(told) if *told == data => {
                    if view.name.is_none_or(|name| name.as_str() != data.name) {
                        self.commands.entity(entity).try_insert(Name::new(data.name.clone()));
                    }
                    continue;
                }
                Some(told) => self.trial.edit(EntityWrite::LocalGroup, vec![RigEdit::SetLocalGroup(told.clone())]),
                None => {
                    self.trial.refuse(EntityWriteError::GroupContent { name: data.name.clone() });
                    false
                }
            };
            match told.filter(|_| is_taken) {
                Some(told) => {
                    let group = LocalGroup { name: told.name.clone(), color: told.color, enabled: told.enabled };
                    if view.group != Some(&group) {
                        self.commands.entity(entity).try_insert(group);
                    }
                    self.commands.entity(entity).try_insert(Name::new(told.name.clone()));
                    self.groups.groups.insert(uid, (entity, told));
                }
                None => {
                    let group = LocalGroup { name: data.name, color: data.color, enabled: data.enabled };
                    self.commands.entity(entity).try_insert(group);
                }
            }
        }
    }
}
