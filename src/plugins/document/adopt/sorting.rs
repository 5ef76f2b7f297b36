//! Assignment of written entities to the rigs that they belong to or ask to belong to.

use std::collections::BTreeMap;

use bevy::prelude::*;

use super::{
    super::entities::{EntityIndex, EntityPart, IndexedEntity},
    Views, WrittenByKind,
};
use crate::{
    plugins::schema::{GroupOf, NodeOf},
    rig::Uid,
};

/// Written entities of one rig, by kind of part.
#[derive(Default)]
pub(super) struct RigWrites {
    pub joints: Vec<(Entity, Uid)>,
    pub spawned_joints: Vec<Entity>,
    /// Created nodes and constraints.
    pub nodes: Vec<(Entity, Uid)>,
    pub tags: Vec<(Entity, Uid)>,
    pub spawned_tags: Vec<Entity>,
    pub groups: Vec<(Entity, Uid)>,
    pub spawned_groups: Vec<Entity>,
    pub dead: Vec<(Entity, IndexedEntity)>,
    /// True if the entity of the rig itself was written.
    pub is_rig_written: bool,
}

/// Largest depth of a hierarchy; a longer chain of parents is a cycle.
const MAX_DEPTH: usize = 1 << 20;

/// Assigns written entities to the rigs that they belong to or ask to belong to.
pub(super) fn sort_by_rig(
    touched: &WrittenByKind,
    views: &Views,
    index: &EntityIndex,
    is_rig: impl Fn(Entity) -> bool,
) -> BTreeMap<Entity, RigWrites> {
    let mut rigs: BTreeMap<Entity, RigWrites> = BTreeMap::new();
    // Rig of the nearest ancestor that is a rig or in the index; the entity itself counts as one.
    let rig_above = |joint: Entity| {
        let mut at = joint;
        for _ in 0..MAX_DEPTH {
            if is_rig(at) {
                return Some(at);
            }
            if let Some(indexed) = index.get(at) {
                return Some(indexed.rig);
            }
            at = views.get(at).ok()?.child_of?.parent();
        }
        None
    };
    for rig in touched.rigs.iter().filter(|entity| is_rig(**entity)) {
        rigs.entry(*rig).or_default().is_rig_written = true;
    }
    for entity in &touched.uids {
        let Some(indexed) = index.get(*entity) else { continue };
        let writes = rigs.entry(indexed.rig).or_default();
        match (views.contains(*entity), indexed.part) {
            (false, _) => writes.dead.push((*entity, indexed)),
            (true, EntityPart::Joint) => writes.joints.push((*entity, indexed.uid)),
            (true, EntityPart::Tag) => writes.tags.push((*entity, indexed.uid)),
            (true, EntityPart::Group) => writes.groups.push((*entity, indexed.uid)),
            (true, EntityPart::Node | EntityPart::Constraint) => writes.nodes.push((*entity, indexed.uid)),
        }
    }
    for entity in touched.joints.iter().filter(|entity| views.contains(**entity)) {
        match index.get(*entity) {
            Some(IndexedEntity { rig, uid, part: EntityPart::Joint }) => {
                rigs.entry(rig).or_default().joints.push((*entity, uid))
            }
            Some(IndexedEntity { rig, uid, part: EntityPart::Node | EntityPart::Constraint }) => {
                rigs.entry(rig).or_default().nodes.push((*entity, uid))
            }
            Some(_) => {}
            None => {
                // Nodes of a game's instance that hangs on a rig are no joints of the document.
                let is_own = |of: &NodeOf| is_rig(of.0);
                let is_joint =
                    views.get(*entity).is_ok_and(|view| view.joint && !view.created && view.node_of.is_none_or(is_own));
                if let Some(rig) = rig_above(*entity).filter(|rig| is_joint && rig != entity) {
                    rigs.entry(rig).or_default().spawned_joints.push(*entity);
                }
            }
        }
    }
    for entity in touched.tags.iter().filter(|entity| views.contains(**entity)) {
        match index.get(*entity) {
            Some(IndexedEntity { rig, uid, part: EntityPart::Tag }) => {
                rigs.entry(rig).or_default().tags.push((*entity, uid))
            }
            Some(_) => {}
            None => {
                let Ok(view) = views.get(*entity) else { continue };
                let is_tag = view.command.is_some() || view.feature.is_some();
                let rig = view.tag_of.filter(|_| is_tag).and_then(|of| rig_above(of.0));
                if let Some(rig) = rig {
                    rigs.entry(rig).or_default().spawned_tags.push(*entity);
                }
            }
        }
    }
    for entity in touched.groups.iter().filter(|entity| views.contains(**entity)) {
        match index.get(*entity) {
            Some(IndexedEntity { rig, uid, part: EntityPart::Group }) => {
                rigs.entry(rig).or_default().groups.push((*entity, uid))
            }
            Some(_) => {}
            None => {
                let Ok(view) = views.get(*entity) else { continue };
                // A part of a rig is no bearer of groups; the rig tells so.
                let rig_of = |bearer: Entity| is_rig(bearer).then_some(bearer).or_else(|| Some(index.get(bearer)?.rig));
                if let (Some(_), Some(GroupOf(bearer))) = (view.group, view.group_of)
                    && let Some(rig) = rig_of(*bearer)
                {
                    rigs.entry(rig).or_default().spawned_groups.push(*entity);
                }
            }
        }
    }
    rigs
}
