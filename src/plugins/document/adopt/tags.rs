//! Writes to the entities of tags: their content, their joints and their order.

use bevy::prelude::*;

use super::{
    super::{
        entities::{EntityPart, MirroredTag},
        follow::write_tag,
    },
    Adoption, EntityWrite, EntityWriteError,
    sorting::RigWrites,
};
use crate::{
    plugins::schema::{InFeature, Tag, TagOf},
    rig::{RigEdit, TagData, TagKind, Uid},
};

impl Adoption<'_, '_, '_, '_, '_, '_> {
    pub fn tags_written(&mut self, writes: &RigWrites) {
        // Features come first, because commands of the same frame may be in them.
        let is_feature = |entity: &Entity| self.views.get(*entity).is_ok_and(|view| view.command.is_none());
        let (features, commands): (Vec<Entity>, Vec<Entity>) = writes.spawned_tags.iter().partition(|e| is_feature(e));
        for entity in features.into_iter().chain(commands) {
            self.tag_spawned(entity);
        }
        for &(entity, uid) in &writes.tags {
            self.tag_written(entity, uid);
        }
    }

    /// Tag data from the components of an entity; `None` if the entity has neither a command nor a feature, or both, or
    /// its command is in something that is no feature of this rig.
    fn told_tag(&self, entity: Entity, uid: Uid) -> Option<TagData> {
        let view = self.views.get(entity).ok()?;
        let (enabled, comment) = view.tag.map_or((true, String::new()), |tag| (tag.enabled, tag.comment.clone()));
        let kind = match (view.command, view.feature) {
            (Some(command), None) => {
                let feature = match view.in_feature {
                    Some(feature) => Some(self.told_feature(feature.0, uid)?),
                    None => self.missing_feature(uid),
                };
                TagKind::Command { module: command.module.clone(), params: command.params.clone(), feature }
            }
            (None, Some(feature)) => TagKind::Feature {
                kind: feature.kind.clone(),
                name: feature.name.clone(),
                switch: feature.switch.clone(),
                choice: feature.choice.clone(),
            },
            (Some(_), Some(_)) | (None, None) => return None,
        };
        Some(TagData { uid, enabled, comment, kind })
    }

    /// Feature of this rig that an entity represents. The one that the tag is in already counts in any case.
    fn told_feature(&self, entity: Entity, tag: Uid) -> Option<Uid> {
        let feature = self.uid_of(entity, EntityPart::Tag)?;
        let (_, data) = self.rig().find_tag(feature)?;
        let is_feature = matches!(data.kind, TagKind::Feature { .. });
        (is_feature || self.mirrored_feature(tag) == Some(feature)).then_some(feature)
    }

    /// Feature of a tag that the document deleted: the relation went with its entity, and comes back with it.
    fn missing_feature(&self, tag: Uid) -> Option<Uid> {
        self.mirrored_feature(tag).filter(|feature| self.rig().find_tag(*feature).is_none())
    }

    /// Feature that a tag is in, as the document had it when the entities followed it last.
    fn mirrored_feature(&self, tag: Uid) -> Option<Uid> {
        match &self.tags.tags.get(&tag)?.data.kind {
            TagKind::Command { feature, .. } => *feature,
            TagKind::Feature { .. } => None,
        }
    }

    /// Takes a feature out of the feature that other code put it into.
    fn feature_written(&mut self, entity: Entity, uid: Uid) {
        let is_feature =
            self.tags.tags.get(&uid).is_some_and(|mirrored| matches!(mirrored.data.kind, TagKind::Feature { .. }));
        if is_feature && self.views.get(entity).is_ok_and(|view| view.in_feature.is_some()) {
            self.commands.entity(entity).try_remove::<InFeature>();
            self.trial.refuse(EntityWriteError::NestedFeature);
        }
    }

    fn tag_spawned(&mut self, entity: Entity) {
        let Ok(view) = self.views.get(entity) else { return };
        let Some(bearer) = view.tag_of.map(|of| of.0) else { return };
        self.trial.look_at_entity(entity);
        let Some(joint) = self.uid_of(bearer, EntityPart::Joint) else {
            return self.tag_refused(entity, Some(EntityWriteError::TagBearer));
        };
        let uid = self.trial.free_uid(view.uid.copied());
        let is_both = view.command.is_some() && view.feature.is_some();
        let Some(data) = self.told_tag(entity, uid) else {
            let reason = if is_both { EntityWriteError::TagKinds } else { EntityWriteError::ForeignFeature };
            return self.tag_refused(entity, Some(reason));
        };
        // Index of the tag among the tags of the joint that the document has.
        let before = self.views.get(bearer).ok().and_then(|view| view.tags).map_or(usize::MAX, |tags| {
            tags.iter()
                .take_while(|other| *other != entity)
                .filter(|other| self.uid_of(*other, EntityPart::Tag).is_some())
                .count()
        });
        let added = RigEdit::AddTag { joint, tag: Box::new(data.clone()), index: before };
        if !self.trial.edit(EntityWrite::SpawnedTag, vec![added]) {
            return self.tag_refused(entity, None);
        }
        self.commands.entity(entity).try_insert(uid);
        self.index.insert(entity, self.trial.rig_entity, uid, EntityPart::Tag);
        self.tags.tags.insert(uid, MirroredTag { entity, joint, data });
        self.tags.adopted.insert(uid, entity);
        if let Some(mirrored) = self.joints.joints.get_mut(&joint) {
            mirrored.tags.insert(before.min(mirrored.tags.len()), uid);
        }
        self.feature_written(entity, uid);
    }

    /// Removes a spawned tag that the document refuses from its joint; the entity stays.
    fn tag_refused(&mut self, entity: Entity, reason: Option<EntityWriteError>) {
        self.commands.entity(entity).try_remove::<TagOf>();
        if let Some(reason) = reason {
            self.trial.refuse(reason);
        }
    }

    fn tag_written(&mut self, entity: Entity, uid: Uid) {
        let Some(mirrored) = self.tags.tags.get(&uid).filter(|mirrored| mirrored.entity == entity).cloned() else {
            return;
        };
        let Ok(view) = self.views.get(entity) else { return };
        let Some((bearer, _)) = self.rig().find_tag(uid) else { return };
        let joint = bearer.data.uid;
        self.trial.look_at(uid);
        self.hold_uid(entity, uid, view.uid.copied());
        let told = self.told_tag(entity, uid);
        if told.as_ref() != Some(&mirrored.data) {
            let is_taken = match &told {
                Some(told) => self.trial.edit(EntityWrite::Tag, vec![RigEdit::SetTag(joint, Box::new(told.clone()))]),
                None => {
                    let is_both = view.command.is_some() && view.feature.is_some();
                    let reason = if is_both { EntityWriteError::TagKinds } else { EntityWriteError::TagContent(uid) };
                    self.trial.refuse(reason);
                    false
                }
            };
            match told.filter(|_| is_taken) {
                Some(told) => {
                    if let Some(known) = self.tags.tags.get_mut(&uid) {
                        known.data = told;
                    }
                }
                None => write_tag(self.commands, entity, &mirrored.data, None, self.tags),
            }
        }
        self.feature_written(entity, uid);
        if view.tag.is_none()
            && let Some(known) = self.tags.tags.get(&uid)
        {
            // A tag without the component counts as one that is enabled and has no comment.
            let (enabled, comment) = (known.data.enabled, known.data.comment.clone());
            self.commands.entity(entity).try_insert(Tag { enabled, comment });
        }
        let above = view.tag_of.map(|of| of.0);
        let known = self.joints.get(mirrored.joint);
        if above == known {
            return;
        }
        let target = above.and_then(|above| self.uid_of(above, EntityPart::Joint));
        let is_taken = match target {
            Some(target) if self.rig().joint(target).is_some() => {
                let moved = RigEdit::MoveTag { tag: uid, joint: target, index: usize::MAX };
                self.trial.edit(EntityWrite::TagJoint, vec![moved])
            }
            _ => {
                self.trial.refuse(EntityWriteError::TagJoint(uid));
                false
            }
        };
        if let (true, Some(target)) = (is_taken, target) {
            // The mirror notes what the entity says now, so that an undo in the same frame is written to it.
            if let Some(known) = self.tags.tags.get_mut(&uid) {
                known.joint = target;
            }
            if let Some(left) = self.joints.joints.get_mut(&mirrored.joint) {
                left.tags.retain(|other| *other != uid);
            }
            if let Some(reached) = self.joints.joints.get_mut(&target) {
                reached.tags.push(uid);
            }
        }
        if let (false, Some(known)) = (is_taken, known) {
            self.commands.entity(entity).try_insert(TagOf(known));
            // Clearing the list makes the follow system write the order of the tags again.
            if let Some(joint) = self.joints.joints.get_mut(&mirrored.joint) {
                joint.tags.clear();
            }
            self.trial.respawn = true;
        }
    }

    /// Adopts the order of tags where other code changed a joint's `Tags`.
    pub fn orders_written(&mut self, writes: &RigWrites) {
        for &(entity, uid) in &writes.joints {
            let Some(mirrored) = self.joints.joints.get(&uid).filter(|mirrored| mirrored.entity == entity) else {
                continue;
            };
            let Some(joint) = self.rig().joint(uid) else { continue };
            let known: Vec<Uid> = joint.data.tags.iter().map(|tag| tag.uid).collect();
            let told: Vec<Uid> = self.views.get(entity).ok().and_then(|view| view.tags).map_or_else(Vec::new, |tags| {
                tags.iter()
                    .filter_map(|tag| self.uid_of(tag, EntityPart::Tag))
                    .filter(|tag| known.contains(tag))
                    .collect()
            });
            let is_same_set = told.len() == known.len();
            if !is_same_set || told == known || told == mirrored.tags {
                continue;
            }
            self.trial.look_at(uid);
            let mut edits = Vec::new();
            let mut now = known;
            for (at, tag) in told.iter().enumerate() {
                if now[at] == *tag {
                    continue;
                }
                edits.push(RigEdit::MoveTag { tag: *tag, joint: uid, index: at });
                now.retain(|other| other != tag);
                now.insert(at, *tag);
            }
            let is_taken = self.trial.edit(EntityWrite::TagOrder, edits);
            // Without tags in the mirror the follow system writes the document's order again.
            self.trial.respawn |= !is_taken;
            if let Some(mirrored) = self.joints.joints.get_mut(&uid) {
                mirrored.tags = if is_taken { told } else { Vec::new() };
            }
        }
    }
}
