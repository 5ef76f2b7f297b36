//! Tags as entities that follow the document.

use std::collections::{HashMap, HashSet};

use bevy::prelude::*;

use super::super::document::JointEntities;
use crate::rig::{Rig, TagKind, Uid};

/// The joint entity that carries a tag. A joint's tags are in its [`Tags`], in order.
#[derive(Component, Debug, Clone, Copy)]
#[relationship(relationship_target = Tags)]
pub struct TagOf(pub Entity);

/// The tag entities of a joint, in order.
#[derive(Component, Debug, Default)]
#[relationship_target(relationship = TagOf, linked_spawn)]
pub struct Tags(Vec<Entity>);

/// A command: what is done when the rig is built.
#[derive(Component, Debug, Clone, PartialEq, Eq)]
pub struct CommandTag {
    /// The module.
    pub module: String,
    /// Its parameters as RON.
    pub params: String,
}

/// A feature: turns the commands that are in it on and off.
#[derive(Component, Debug, Clone, PartialEq, Eq)]
pub struct FeatureTag {
    /// The kind, from the registry.
    pub kind: String,
    /// The name; empty if it only organises.
    pub name: String,
    /// The part of the combined feature.
    pub switch: String,
}

/// Whether a tag is on.
#[derive(Component, Debug, Clone, Copy, PartialEq, Eq)]
pub struct TagEnabled(pub bool);

/// A note for people on a tag.
#[derive(Component, Debug, Clone, PartialEq, Eq)]
pub struct TagComment(pub String);

/// The feature tag that a command is in.
#[derive(Component, Debug, Clone, Copy, PartialEq, Eq)]
#[relationship(relationship_target = FeatureCommands)]
pub struct InFeature(pub Entity);

/// The commands in a feature.
#[derive(Component, Debug, Default)]
#[relationship_target(relationship = InFeature)]
pub struct FeatureCommands(Vec<Entity>);

/// The entities of a rig's tags.
#[derive(Component, Debug, Default)]
pub struct TagEntities {
    entities: HashMap<Uid, Entity>,
}

impl TagEntities {
    /// The entity of a tag.
    pub fn get(&self, tag: Uid) -> Option<Entity> {
        self.entities.get(&tag).copied()
    }
}

/// Makes the tag entities equal to their rig.
pub(super) fn follow_tags(
    mut commands: Commands,
    mut rigs: Query<(Entity, &Rig, &JointEntities, Option<&mut TagEntities>), Changed<Rig>>,
    tags: Query<(
        Option<&CommandTag>,
        Option<&FeatureTag>,
        Option<&TagEnabled>,
        Option<&TagComment>,
        Option<&TagOf>,
        Option<&InFeature>,
    )>,
    orders: Query<&Tags>,
) {
    for (rig_entity, rig, joints, known) in &mut rigs {
        let mut own = TagEntities::default();
        let is_new = known.is_none();
        let known: &mut TagEntities = match known {
            Some(known) => known.into_inner(),
            None => &mut own,
        };
        let mut seen: HashSet<Uid> = HashSet::new();
        // Features before commands: these point at them.
        for joint in rig.walk() {
            for tag in &joint.data.tags {
                seen.insert(tag.uid);
                known.entities.entry(tag.uid).or_insert_with(|| commands.spawn(tag.uid).id());
            }
        }
        let mut gone: Vec<(Uid, Entity)> = known
            .entities
            .iter()
            .filter(|(uid, _)| !seen.contains(*uid))
            .map(|(uid, entity)| (*uid, *entity))
            .collect();
        gone.sort_unstable();
        for (uid, entity) in gone {
            commands.entity(entity).try_despawn();
            known.entities.remove(&uid);
        }
        for joint in rig.walk() {
            let Some(bearer) = joints.get(joint.data.uid) else { continue };
            let wanted: Vec<Entity> = joint.data.tags.iter().filter_map(|tag| known.get(tag.uid)).collect();
            let order: Vec<Entity> = orders.get(bearer).map(|tags| tags.iter().collect()).unwrap_or_default();
            let reorder = order != wanted;
            for tag in &joint.data.tags {
                let Some(entity) = known.get(tag.uid) else { continue };
                let now = tags.get(entity).ok();
                let mut target = commands.entity(entity);
                if reorder || now.and_then(|now| now.4).is_none_or(|of| of.0 != bearer) {
                    // Taken out and put in again, each in turn: the last comes last.
                    target.remove::<TagOf>();
                    target.insert(TagOf(bearer));
                }
                let enabled = TagEnabled(tag.enabled);
                if now.and_then(|now| now.2) != Some(&enabled) {
                    target.insert(enabled);
                }
                let comment = TagComment(tag.comment.clone());
                if now.and_then(|now| now.3) != Some(&comment) {
                    target.insert(comment);
                }
                match &tag.kind {
                    TagKind::Command { module, params, feature } => {
                        let command = CommandTag { module: module.clone(), params: params.clone() };
                        if now.and_then(|now| now.0) != Some(&command) {
                            target.insert(command).remove::<FeatureTag>();
                        }
                        let feature = feature.and_then(|feature| known.get(feature)).map(InFeature);
                        match feature {
                            Some(feature) if now.and_then(|now| now.5) != Some(&feature) => {
                                target.insert(feature);
                            }
                            None if now.and_then(|now| now.5).is_some() => {
                                target.remove::<InFeature>();
                            }
                            _ => {}
                        }
                    }
                    TagKind::Feature { kind, name, switch } => {
                        let feature = FeatureTag { kind: kind.clone(), name: name.clone(), switch: switch.clone() };
                        if now.and_then(|now| now.1) != Some(&feature) {
                            target.insert(feature).remove::<(CommandTag, InFeature)>();
                        }
                    }
                }
            }
        }
        if is_new {
            commands.entity(rig_entity).insert(own);
        }
    }
}
