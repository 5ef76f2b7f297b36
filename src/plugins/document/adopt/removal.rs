//! Despawned entities: deletions, and entities that are spawned again.

use std::collections::{HashMap, HashSet};

use bevy::prelude::*;

use super::{
    super::entities::{EntityPart, IndexedEntity},
    Adoption, EntityWrite, EntityWriteError,
    sorting::RigWrites,
};
use crate::rig::{RigEdit, Uid, operations::Operation};

impl Adoption<'_, '_, '_, '_, '_, '_> {
    /// Deletes the parts whose entities were despawned. A joint whose entity was despawned together with a created node
    /// above it stays in the document and gets a new entity.
    pub fn despawned(&mut self, writes: &RigWrites) {
        let dead: HashMap<Entity, IndexedEntity> = writes.dead.iter().copied().collect();
        let is_joint = |indexed: &IndexedEntity| indexed.part == EntityPart::Joint;
        let joints = writes.dead.iter().map(|(_, indexed)| *indexed).filter(is_joint);
        let mut tops = HashMap::new();
        let along: HashSet<Uid> =
            joints.map(|joint| joint.uid).filter(|joint| self.went_along(*joint, &dead, &mut tops)).collect();
        let mut deleted = Vec::new();
        for (entity, indexed) in &writes.dead {
            self.index.remove(*entity);
            self.trial.look_at(indexed.uid);
            match indexed.part {
                EntityPart::Joint if along.contains(&indexed.uid) => self.forget_joint(indexed.uid),
                EntityPart::Joint => deleted.push(indexed.uid),
                EntityPart::Node | EntityPart::Constraint => {
                    let constraint = self.built.as_mut().and_then(|built| {
                        built.nodes.remove(&indexed.uid);
                        built.constraints.remove(&indexed.uid)
                    });
                    self.trial.respawn = true;
                    self.trial.refuse(match constraint {
                        Some(mirrored) => EntityWriteError::CreatedConstraint { kind: mirrored.constraint.kind() },
                        None => EntityWriteError::CreatedNode,
                    });
                }
                EntityPart::Tag | EntityPart::Group => {}
            }
        }
        deleted.retain(|joint| self.rig().joint(*joint).is_some());
        deleted.sort_unstable();
        if !deleted.is_empty() {
            for joint in &deleted {
                self.forget_joint(*joint);
            }
            let delete = Operation::Delete { joints: deleted, keep_children: false };
            self.trial.look_at_entity(self.trial.rig_entity);
            self.trial.operate(EntityWrite::DespawnedJoint, &delete);
        }
        let uids_of = |part: EntityPart| -> HashSet<Uid> {
            writes.dead.iter().filter(|(_, indexed)| indexed.part == part).map(|(_, indexed)| indexed.uid).collect()
        };
        let (dead_tags, dead_groups) = (uids_of(EntityPart::Tag), uids_of(EntityPart::Group));
        let mut members: HashMap<Uid, Vec<Uid>> = HashMap::new();
        if !dead_groups.is_empty() {
            for joint in self.rig().walk() {
                if let Some(group) = joint.data.group.filter(|group| dead_groups.contains(group)) {
                    members.entry(group).or_default().push(joint.data.uid);
                }
            }
        }
        for (_, indexed) in &writes.dead {
            let uid = indexed.uid;
            self.trial.look_at(uid);
            match indexed.part {
                EntityPart::Tag => {
                    let bearer = self.rig().find_tag(uid).map(|(joint, _)| joint.data.uid);
                    // Tags of a joint that gets a new entity stay in the document.
                    if let Some(joint) = bearer.filter(|joint| self.joints.get(*joint).is_some()) {
                        self.trial.edit(EntityWrite::DespawnedTag, vec![RigEdit::RemoveTag(joint, uid)]);
                    }
                    self.tags.tags.remove(&uid);
                }
                EntityPart::Group => {
                    self.groups.groups.remove(&uid);
                    let members = members.remove(&uid).unwrap_or_default().into_iter();
                    let mut edits: Vec<RigEdit> = members.map(|joint| RigEdit::SetGroup(joint, None)).collect();
                    edits.push(RigEdit::RemoveLocalGroup(uid));
                    if self.rig().group(uid).is_some() {
                        self.trial.edit(EntityWrite::DespawnedLocalGroup, edits);
                    }
                }
                EntityPart::Joint | EntityPart::Node | EntityPart::Constraint => {}
            }
        }
        if dead_tags.is_empty() && dead_groups.is_empty() {
            return;
        }
        for mirrored in self.joints.joints.values_mut() {
            mirrored.tags.retain(|tag| !dead_tags.contains(tag));
            mirrored.group = mirrored.group.filter(|group| !dead_groups.contains(group));
        }
    }

    /// True if a joint's entity was despawned because of a created node above it, not by itself or because of another
    /// joint. `known` keeps the answer for each entity on the way up, so that a way that joints share is walked once.
    fn went_along(&self, joint: Uid, dead: &HashMap<Entity, IndexedEntity>, known: &mut HashMap<Entity, bool>) -> bool {
        let (mut way, mut is_created) = (Vec::new(), false);
        let mut above = self.joints.joints.get(&joint).and_then(|mirrored| mirrored.parent);
        while let Some((entity, indexed)) = above.and_then(|above| Some((above, dead.get(&above)?))) {
            if let Some(found) = known.get(&entity) {
                is_created = *found;
                break;
            }
            way.push(entity);
            is_created = indexed.part == EntityPart::Node;
            above = match indexed.part {
                EntityPart::Joint => self.joints.joints.get(&indexed.uid).and_then(|mirrored| mirrored.parent),
                _ => self.built.as_ref().and_then(|built| built.nodes.get(&indexed.uid)).and_then(|node| node.parent),
            };
        }
        known.extend(way.into_iter().map(|entity| (entity, is_created)));
        is_created
    }

    fn forget_joint(&mut self, joint: Uid) {
        self.trial.respawn = true;
        let Some(mirrored) = self.joints.joints.remove(&joint) else { return };
        self.joints.posed.remove(&joint);
        for tag in mirrored.tags {
            if let Some(tag) = self.tags.tags.remove(&tag) {
                self.index.remove(tag.entity);
                self.commands.entity(tag.entity).try_despawn();
            }
        }
    }
}
