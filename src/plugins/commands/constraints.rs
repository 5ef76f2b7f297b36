//! Constraints as entities: the node that each drives, the nodes that it reads, and their order of evaluation.

use std::{collections::BTreeSet, sync::Arc};

use bevy::{ecs::entity::EntityHashMap, prelude::*};

use super::BuildResult;
use crate::{
    plugins::{
        document::{
            JointEntities, TagEntities,
            entities::{BuiltEntities, EntityIndex, EntityPart, MirroredConstraint, misplaced},
        },
        schema::{Constrains, ConstraintKind, ConstraintTarget, ConstraintTargets, CreatedBy, NodeConstraints, NodeOf},
    },
    rig::{Constraint, Dependency, Scalar, Uid},
};

/// Spawns, updates and despawns the entities of constraints so that they match the build, and the nodes of which some may
/// have been spawned again.
pub(super) fn follow_constraints(
    mut commands: Commands,
    mut rigs: Query<
        (Entity, &BuildResult, &JointEntities, &TagEntities, &mut BuiltEntities),
        Or<(Changed<BuildResult>, Changed<JointEntities>)>,
    >,
    mut index: ResMut<EntityIndex>,
) {
    for (rig_entity, built, joints, tags, mut known) in &mut rigs {
        let known = known.bypass_change_detection();
        let constraints = &built.0.constraints;
        let kept = constraints.iter().filter(|constraint| known.constraints.contains_key(&constraint.uid)).count();
        if kept < known.constraints.len() {
            let is_built = |uid: &Uid| constraints.iter().any(|constraint| constraint.uid == *uid);
            let gone: Vec<Uid> = known.constraints.keys().filter(|uid| !is_built(uid)).copied().collect();
            for uid in gone {
                if let Some(mirrored) = known.constraints.remove(&uid) {
                    index.remove(mirrored.entity);
                    commands.entity(mirrored.entity).try_despawn();
                }
            }
        }
        for constraint in constraints {
            let entity_of = |node: Uid| joints.get(node).or_else(|| known.get(node));
            if let Some(mirrored) = known.constraints.get(&constraint.uid)
                && Arc::ptr_eq(&mirrored.constraint, &constraint.constraint)
                && mirrored.uids.iter().zip(&mirrored.nodes).all(|(uid, entity)| entity_of(*uid) == *entity)
            {
                continue;
            }
            let read = constraint.constraint.reads().into_iter().filter_map(|dependency| match dependency {
                Dependency::Node(node) => Some(node),
                Dependency::Attribute(..) => None,
            });
            let driven = constraint.constraint.drives().last().map(|dependency| match dependency {
                Dependency::Node(node) | Dependency::Attribute(node, _) => *node,
            });
            let read: Vec<Uid> = read.collect();
            let uids: Vec<Uid> = driven.iter().chain(&read).copied().collect();
            let nodes: Vec<Option<Entity>> = uids.iter().map(|node| entity_of(*node)).collect();
            if known.constraints.get(&constraint.uid).is_some_and(|mirrored| mirrored.is_same(constraint, &nodes)) {
                continue;
            }
            let kind = constraint.constraint.kind();
            let sources = &nodes[driven.iter().count()..];
            let targets = targets(&constraint.constraint, sources);
            let driven_entity = driven.and_then(entity_of);
            let entity = match known.constraints.get(&constraint.uid) {
                // Components whose values stay the same are not written.
                Some(before) => {
                    let mut target = commands.entity(before.entity);
                    if before.constraint.kind() != kind {
                        target.try_insert(ConstraintKind(kind));
                    }
                    let had_driven = usize::from(before.constraint.drives().last().is_some());
                    if self::targets(&before.constraint, before.nodes.get(had_driven..).unwrap_or_default()) != targets
                    {
                        target.try_insert(targets);
                    }
                    if before.nodes.first().copied().flatten() != driven_entity {
                        target.try_remove::<Constrains>();
                        if let Some(driven_entity) = driven_entity {
                            target.try_insert(Constrains(driven_entity));
                        }
                    }
                    before.entity
                }
                None => {
                    let named = (constraint.uid, Name::new(kind), ChildOf(rig_entity));
                    let mut fresh = commands.spawn((named, ConstraintKind(kind), targets));
                    if let Some(driven_entity) = driven_entity {
                        fresh.insert(Constrains(driven_entity));
                    }
                    if let Some(tag) = tags.get(constraint.command) {
                        fresh.insert(CreatedBy(tag));
                    }
                    index.insert(fresh.id(), rig_entity, constraint.uid, EntityPart::Constraint);
                    fresh.id()
                }
            };
            let mirrored = MirroredConstraint {
                entity,
                command: constraint.command,
                constraint: constraint.constraint.clone(),
                uids,
                nodes,
            };
            known.constraints.insert(constraint.uid, mirrored);
        }
    }
}

/// Puts the constraints on each node into the order in which they run, where a build or other code changed the order.
pub(super) fn order_constraints(
    mut commands: Commands,
    rebuilt: Query<Entity, Changed<BuildResult>>,
    written: Query<&NodeOf, Changed<NodeConstraints>>,
    rigs: Query<(&BuildResult, &BuiltEntities)>,
    constrained: Query<&Constrains>,
    lists: Query<(Entity, &NodeConstraints)>,
) {
    let mut unsorted: BTreeSet<Entity> = rebuilt.iter().collect();
    unsorted.extend(written.iter().map(|of| of.0));
    for (built, known) in unsorted.into_iter().filter_map(|rig| rigs.get(rig).ok()) {
        let mut ranks: EntityHashMap<usize> = EntityHashMap::default();
        let mut driven: BTreeSet<Entity> = BTreeSet::new();
        for (rank, constraint) in built.0.constraints.iter().enumerate() {
            let Some(entity) = known.constraint(constraint.uid) else { continue };
            ranks.insert(entity, rank);
            driven.extend(constrained.get(entity).map(|constrains| constrains.0));
        }
        for (node, constraints) in driven.into_iter().filter_map(|node| lists.get(node).ok()) {
            for constraint in misplaced(constraints.iter(), &ranks) {
                // Removing and inserting each constraint in turn puts it behind the ones before it.
                commands.entity(constraint).try_remove::<Constrains>().try_insert(Constrains(node));
            }
        }
    }
}

/// Targets of a constraint; `sources` are the entities of the nodes that it reads, in the order of [`Constraint::reads`].
pub(super) fn targets(constraint: &Constraint, sources: &[Option<Entity>]) -> ConstraintTargets {
    let weights = weights(constraint);
    let target = |(number, source): (usize, &Option<Entity>)| {
        Some(ConstraintTarget { node: (*source)?, weight: weights.get(number).copied().unwrap_or(Some(1.0)) })
    };
    ConstraintTargets(sources.iter().enumerate().filter_map(target).collect())
}

/// Weights of the targets, in the order of [`Constraint::reads`]; `None` where an attribute gives the weight. Empty for
/// kinds of constraints without weights.
fn weights(constraint: &Constraint) -> Vec<Option<f32>> {
    match constraint {
        Constraint::Transform { targets, .. } | Constraint::Aim { targets, .. } => targets
            .iter()
            .map(|target| match target.weight {
                Scalar::Value(weight) => Some(weight),
                _ => None,
            })
            .collect(),
        _ => Vec::new(),
    }
}
