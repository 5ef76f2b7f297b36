//! Created nodes as entities that follow what is built.

use std::collections::{BTreeMap, HashSet};

use bevy::{ecs::entity_disabling::Disabled, prelude::*};

use super::{Built, TagEntities};
use crate::{
    plugins::document::{InGroup, Joint, JointEntities, NodeLabel},
    rig::{ControlData, NodeType, PoseOffset, RestTransform, Rig, Uid},
};

/// The command tag that made a node.
#[derive(Component, Debug, Clone, Copy, PartialEq, Eq)]
#[relationship(relationship_target = CreatedNodes)]
pub struct CreatedBy(pub Entity);

/// The nodes that a command made.
#[derive(Component, Debug, Default)]
#[relationship_target(relationship = CreatedBy)]
pub struct CreatedNodes(Vec<Entity>);

/// What a node was made for.
#[derive(Component, Debug, Clone, PartialEq, Eq)]
pub struct CreatedRole {
    /// What the module says it is for.
    pub role: String,
    /// The node that it was made for.
    pub subject: Uid,
    /// Which of several for the same purpose.
    pub number: u32,
}

/// A node that people and animations move.
#[derive(Component, Debug, Clone, PartialEq)]
pub struct Control(pub ControlData);

/// A node that carries others.
#[derive(Component, Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Null;

/// A node that is rolled back. It has no place in the rig until it is built again.
#[derive(Component, Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Parked;

/// The entities of the nodes that a rig's commands created, parked ones included.
#[derive(Component, Debug, Default)]
pub struct BuiltEntities {
    nodes: BTreeMap<Uid, Entity>,
    parked: HashSet<Uid>,
}

impl BuiltEntities {
    /// The entity of a created node that is part of the rig at present.
    pub fn get(&self, node: Uid) -> Option<Entity> {
        self.nodes.get(&node).copied().filter(|_| !self.parked.contains(&node))
    }

    /// The entity of a created node, parked or not.
    pub fn any(&self, node: Uid) -> Option<Entity> {
        self.nodes.get(&node).copied()
    }

    /// All created nodes that are part of the rig at present, by uid.
    pub fn iter(&self) -> impl Iterator<Item = (Uid, Entity)> {
        self.nodes.iter().filter(|(uid, _)| !self.parked.contains(*uid)).map(|(uid, entity)| (*uid, *entity))
    }
}

/// Makes the entities of created nodes equal to what is built: spawns, parks, brings back and describes them.
pub(super) fn follow_nodes(
    mut commands: Commands,
    mut rigs: Query<
        (Entity, &Rig, &Built, &JointEntities, Option<&TagEntities>, Option<&mut BuiltEntities>),
        Or<(Changed<Built>, Changed<Rig>)>,
    >,
    mut nodes: Query<(&mut Transform, &mut RestTransform, Option<&ChildOf>)>,
) {
    for (rig_entity, rig, built, joints, tags, known) in &mut rigs {
        let mut own = BuiltEntities::default();
        let is_new = known.is_none();
        let known: &mut BuiltEntities = match known {
            Some(known) => known.into_inner(),
            None => &mut own,
        };
        let alive: HashSet<Uid> =
            built.0.nodes.iter().filter(|node| node.origin.is_some()).map(|node| node.uid).collect();
        let leaving: Vec<(Uid, Entity)> = known.iter().filter(|(uid, _)| !alive.contains(uid)).collect();
        for (uid, entity) in leaving {
            known.parked.insert(uid);
            commands
                .entity(entity)
                .detach_all_children()
                .remove::<(ChildOf, Control, Null, Joint, NodeLabel, Name, InGroup, CreatedBy, CreatedRole)>()
                .insert((Parked, Disabled));
        }
        for node in &built.0.nodes {
            let Some(origin) = &node.origin else { continue };
            let rest = RestTransform::from(node.base);
            let pose = rig.offset(node.uid).copied().unwrap_or(PoseOffset::IDENTITY).on(&rest);
            let back = known.parked.remove(&node.uid);
            let entity = *known.nodes.entry(node.uid).or_insert_with(|| commands.spawn((node.uid, rest, pose)).id());
            let parent = node.parent.map(|parent| built.0.nodes[parent].uid);
            let parent = parent.and_then(|parent| joints.get(parent).or_else(|| known.get(parent)));
            let parent = parent.unwrap_or(rig_entity);
            let mut target = commands.entity(entity);
            if back {
                target.remove::<(Parked, Disabled)>();
            }
            if let Ok((mut transform, mut base, child_of)) = nodes.get_mut(entity) {
                if *base != rest || back {
                    *base = rest;
                    *transform = pose;
                }
                if back || child_of.is_none_or(|child_of| child_of.parent() != parent) {
                    target.insert(ChildOf(parent));
                }
            } else {
                target.insert((rest, pose, ChildOf(parent)));
            }
            let role = CreatedRole { role: origin.role.to_string(), subject: origin.subject, number: origin.number };
            target.insert((role, Name::new(node.name.to_string())));
            if let Some(tag) = tags.and_then(|tags| tags.get(origin.command)) {
                target.insert(CreatedBy(tag));
            }
            match &node.label {
                Some(label) => target.insert(NodeLabel(label.to_string())),
                None => target.remove::<NodeLabel>(),
            };
            match node.group {
                Some(group) => target.insert(InGroup(group)),
                None => target.remove::<InGroup>(),
            };
            match node.kind {
                NodeType::Joint => target.insert(Joint).remove::<(Control, Null)>(),
                NodeType::Null => target.insert(Null).remove::<(Control, Joint)>(),
                NodeType::Control => target.remove::<(Null, Joint)>(),
            };
            match &node.control {
                Some(control) => target.insert(Control((**control).clone())),
                None => target.remove::<Control>(),
            };
        }
        if is_new {
            commands.entity(rig_entity).insert(own);
        }
    }
}
