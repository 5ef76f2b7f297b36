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
        let along: HashSet<Uid> =
            joints.map(|joint| joint.uid).filter(|joint| self.went_along(*joint, &dead)).collect();
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
                    for mirrored in self.joints.joints.values_mut() {
                        mirrored.tags.retain(|tag| *tag != uid);
                    }
                }
                EntityPart::Group => {
                    self.groups.groups.remove(&uid);
                    let members =
                        self.rig().walk().filter(|joint| joint.data.group == Some(uid)).map(|joint| joint.data.uid);
                    let mut edits: Vec<RigEdit> = members.map(|joint| RigEdit::SetGroup(joint, None)).collect();
                    edits.push(RigEdit::RemoveLocalGroup(uid));
                    if self.rig().group(uid).is_some() {
                        self.trial.edit(EntityWrite::DespawnedLocalGroup, edits);
                    }
                    for mirrored in self.joints.joints.values_mut().filter(|mirrored| mirrored.group == Some(uid)) {
                        mirrored.group = None;
                    }
                }
                EntityPart::Joint | EntityPart::Node | EntityPart::Constraint => {}
            }
        }
    }

    /// True if a joint's entity was despawned because of a created node above it, not by itself or because of another
    /// joint.
    fn went_along(&self, joint: Uid, dead: &HashMap<Entity, IndexedEntity>) -> bool {
        let mut above = self.joints.joints.get(&joint).and_then(|mirrored| mirrored.parent);
        let mut is_created = false;
        while let Some(indexed) = above.and_then(|above| dead.get(&above)) {
            is_created = indexed.part == EntityPart::Node;
            above = match indexed.part {
                EntityPart::Joint => self.joints.joints.get(&indexed.uid).and_then(|mirrored| mirrored.parent),
                _ => self.built.as_ref().and_then(|built| built.nodes.get(&indexed.uid)).and_then(|node| node.parent),
            };
        }
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
