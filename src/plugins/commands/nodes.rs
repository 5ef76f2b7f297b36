//! Created nodes as entities that follow the build, and the hierarchy of all nodes of a rig.

use std::collections::{BTreeMap, BTreeSet, HashSet};

use bevy::{
    ecs::{entity::EntityHashMap, entity_disabling::Disabled, query::Allow},
    prelude::*,
};

use super::{BuildResult, guard::role_of};
use crate::{
    plugins::{
        document::{
            GroupEntities, JointEntities, TagEntities,
            entities::{BuiltEntities, BuiltJoint, EntityIndex, EntityPart, MirroredNode},
        },
        history::RigHistory,
        runtime::RigRuntime,
        schema::{
            Attributes, Control, CreatedBy, CreatedRole, InGroup, Joint, NodeLabel, NodeLayer, NodeOf, Null, ParkedNode,
        },
    },
    rig::{BuiltNode, NodeType, RestTransform, Rig, RigJoint, Uid},
};

type FollowedNodes<'a> = (
    Entity,
    &'a Rig,
    Option<Ref<'a, BuildResult>>,
    &'a mut JointEntities,
    &'a TagEntities,
    &'a GroupEntities,
    &'a mut BuiltEntities,
    Has<RigRuntime>,
);

/// Spawns, parks, restores and updates the entities of created nodes so that they match the build, and puts every node
/// below its parent: the built parent, or, for joints that are not built, the parent in the document.
pub(super) fn follow_nodes(
    mut commands: Commands,
    mut rigs: Query<FollowedNodes, Or<(Changed<BuildResult>, Changed<Rig>)>>,
    parents: Query<&ChildOf, Allow<Disabled>>,
    mut places: Query<(&mut Transform, &mut RestTransform), Allow<Disabled>>,
    mut index: ResMut<EntityIndex>,
) {
    for (rig_entity, rig, built, mut joints, tags, groups, mut known, is_running) in &mut rigs {
        let joints = joints.bypass_change_detection();
        if joints.follow(rig) && !built.as_ref().is_some_and(DetectChanges::is_changed) {
            continue;
        }
        let nodes = built.as_ref().map_or(&[][..], |built| &built.0.nodes);
        let known = known.bypass_change_detection();
        // Without a build, joints stand below their parents in the document.
        let touched = if built.is_none() && known.is_empty() { joints.touched_of_all(rig) } else { None };
        if let Some(touched) = touched {
            let mut writer = Writer { commands: &mut commands, rig: rig_entity, tags, groups };
            joints.count(touched.len());
            for joint in touched.into_iter().filter_map(|uid| rig.joint(uid)) {
                writer.place_unbuilt(joints, joint, &parents);
            }
            continue;
        }
        joints.count(rig.len());
        park(&mut commands, known, nodes);
        let mut writer = Writer { commands: &mut commands, rig: rig_entity, tags, groups };
        for node in nodes {
            let parent = node.parent.map(|parent| nodes[parent].uid);
            let parent =
                parent.and_then(|parent| joints.get(parent).or_else(|| known.get(parent))).unwrap_or(rig_entity);
            let Some(origin) = &node.origin else {
                writer.place_joint(joints, node.uid, parent, &parents);
                let Some(entity) = joints.get(node.uid) else { continue };
                let now = BuiltJoint::of(entity, node);
                if known.joints.get(&node.uid) != Some(&now) {
                    let before = known.joints.insert(node.uid, now).filter(|before| before.entity == entity);
                    writer.describe_any(entity, rig, node, before.as_ref());
                }
                continue;
            };
            let uid = node.uid;
            let rest = RestTransform::from(node.base);
            let pose = rig.offset(node.uid).copied().unwrap_or_default().on(&rest);
            let Some(mirrored) = known.nodes.get_mut(&node.uid) else {
                let entity = writer.commands.spawn((node.uid, rest, pose, NodeOf(rig_entity), ChildOf(parent))).id();
                index.insert(entity, rig_entity, node.uid, EntityPart::Node);
                writer.describe(entity, rig, node, None);
                let (node, parent) = (Some(node.clone()), Some(parent));
                let (command, subject) = (origin.command, origin.subject);
                let mirrored = MirroredNode { entity, command, subject, is_parked: false, node, parent };
                known.nodes.insert(uid, mirrored);
                continue;
            };
            let entity = mirrored.entity;
            let is_back = std::mem::take(&mut mirrored.is_parked);
            if is_back {
                let placed = (rest, pose, NodeOf(rig_entity), ChildOf(parent));
                writer.commands.entity(entity).try_remove::<(ParkedNode, Disabled)>().try_insert(placed);
                mirrored.node = None;
            } else if mirrored.parent != Some(parent) || !parents.contains(entity) {
                writer.commands.entity(entity).try_insert(ChildOf(parent));
            }
            mirrored.parent = Some(parent);
            if mirrored.node.as_ref().is_some_and(|before| before == node && before.origin.as_ref() == Some(origin)) {
                continue;
            }
            if let Some(before) = mirrored.node.as_ref().filter(|before| before.base != node.base)
                && let Ok((mut transform, mut base)) = places.get_mut(entity)
            {
                let _ = before;
                base.set_if_neq(rest);
                // The program of a running rig writes the transforms of all its nodes.
                if !is_running {
                    transform.set_if_neq(pose);
                }
            }
            writer.describe(entity, rig, node, mirrored.node.as_ref());
            mirrored.node = Some(node.clone());
        }
        let built_uids: HashSet<Uid> = nodes.iter().map(|node| node.uid).collect();
        for joint in rig.walk().filter(|joint| !built_uids.contains(&joint.data.uid)) {
            writer.place_unbuilt(joints, joint, &parents);
        }
        let mut gone: Vec<Uid> = known.joints.keys().filter(|uid| !built_uids.contains(*uid)).copied().collect();
        gone.sort_unstable();
        for before in gone.into_iter().filter_map(|uid| known.joints.remove(&uid)) {
            writer.undescribe(&before);
        }
    }
}

/// Entities of a rig below which joints may stand in another order than in the document.
#[derive(Debug, Clone)]
pub(super) enum SortScope {
    /// The entities that bear joints, all of them.
    All,
    /// The listed ones.
    Below(BTreeSet<Entity>),
}

impl SortScope {
    /// Adds entities below which joints may stand in another order.
    fn add(&mut self, bearers: impl IntoIterator<Item = Entity>) {
        if let Self::Below(known) = self {
            known.extend(bearers);
        }
    }
}

impl Default for SortScope {
    fn default() -> Self {
        Self::Below(BTreeSet::new())
    }
}

/// Rigs whose joints may stand in another order than in the document: the document or the build changed, or somebody
/// wrote the parent of a node.
pub(super) fn unsorted_rigs(
    edited: Query<(Entity, &Rig, &JointEntities), Changed<Rig>>,
    rebuilt: Query<Entity, (With<Rig>, Changed<BuildResult>)>,
    of_rigs: Query<Entity, (With<Rig>, Changed<Children>)>,
    of_nodes: Query<(Entity, &NodeOf), Changed<Children>>,
    built: Query<(Has<BuildResult>, Option<&BuiltEntities>), With<Rig>>,
    parents: Query<&ChildOf>,
) -> BTreeMap<Entity, SortScope> {
    let mut rigs: BTreeMap<Entity, SortScope> = rebuilt.iter().map(|rig| (rig, SortScope::All)).collect();
    for rig in &of_rigs {
        rigs.entry(rig).or_default().add([rig]);
    }
    for (bearer, of) in &of_nodes {
        rigs.entry(of.0).or_default().add([bearer]);
    }
    for (rig_entity, rig, joints) in edited.iter().filter(|(_, rig, joints)| !joints.follow(rig)) {
        let parent = |uid: &Uid| parents.get(joints.get(*uid)?).ok().map(ChildOf::parent);
        match joints.touched_of_all(rig) {
            Some(touched) => rigs.entry(rig_entity).or_default().add(touched.iter().filter_map(parent)),
            None => {
                rigs.insert(rig_entity, SortScope::All);
            }
        }
    }
    for (rig, unsorted) in &mut rigs {
        // Joints of several parents in the document may stand below one node that a build created.
        if built.get(*rig).is_ok_and(|(is_built, known)| is_built || known.is_some_and(|known| !known.is_empty())) {
            *unsorted = SortScope::All;
        }
    }
    rigs
}

/// Notes that the entities of a rig follow its document, after all systems that write them.
pub(super) fn note_revisions(mut rigs: Query<(&Rig, &mut JointEntities)>) {
    for (rig, mut joints) in &mut rigs {
        if !joints.follow(rig) {
            joints.bypass_change_detection().note_all(rig);
        }
    }
}

/// Puts the joints below each node into the order that the document gives them. Created nodes keep their places among
/// them.
pub(super) fn order_siblings(
    In(unsorted): In<BTreeMap<Entity, SortScope>>,
    mut rigs: Query<(&Rig, &mut JointEntities)>,
    index: Res<EntityIndex>,
    parents: Query<&ChildOf>,
    mut lists: Query<&mut Children>,
) {
    for (rig_entity, unsorted) in unsorted {
        let Ok((rig, mut joints)) = rigs.get_mut(rig_entity) else { continue };
        let joints = joints.bypass_change_detection();
        let mut ranks: EntityHashMap<usize> = EntityHashMap::default();
        let bearers = match unsorted {
            SortScope::Below(bearers) => {
                for bearer in &bearers {
                    let joint = index.uid_of(*bearer, rig_entity, EntityPart::Joint);
                    if joint.is_some() || *bearer == rig_entity {
                        let children = rig.children(joint).iter().enumerate();
                        ranks.extend(children.filter_map(|(rank, child)| Some((joints.get(*child)?, rank))));
                    }
                }
                bearers
            }
            SortScope::All => {
                let mut bearers: BTreeSet<Entity> = BTreeSet::new();
                for (rank, joint) in rig.walk().enumerate() {
                    let Some(entity) = joints.get(joint.data.uid) else { continue };
                    ranks.insert(entity, rank);
                    bearers.extend(parents.get(entity).map(ChildOf::parent));
                }
                bearers
            }
        };
        joints.count(ranks.len());
        for bearer in bearers {
            let Ok(mut children) = lists.get_mut(bearer) else { continue };
            let mut order: Vec<Entity> = children.iter().filter(|child| ranks.contains_key(child)).collect();
            if order.is_sorted_by_key(|child| ranks.get(child)) {
                continue;
            }
            order.sort_by_key(|child| ranks.get(child));
            let mut sorted = order.into_iter();
            let places: EntityHashMap<usize> = (children.iter().enumerate())
                .filter_map(|(place, child)| {
                    let child = if ranks.contains_key(&child) { sorted.next()? } else { child };
                    Some((child, place))
                })
                .collect();
            children.sort_by_key(|child| places.get(child).copied());
        }
    }
}

/// Removes nodes that are no longer built from the rig; their entities stay, disabled.
fn park(commands: &mut Commands, known: &mut BuiltEntities, nodes: &[BuiltNode]) {
    let alive: HashSet<Uid> = nodes.iter().filter(|node| node.origin.is_some()).map(|node| node.uid).collect();
    for (_, mirrored) in known.nodes.iter_mut().filter(|(uid, mirrored)| !mirrored.is_parked && !alive.contains(*uid)) {
        (mirrored.is_parked, mirrored.node, mirrored.parent) = (true, None, None);
        if let Ok(mut entity) = commands.get_entity(mirrored.entity) {
            entity.detach_all_children();
            entity.try_remove::<(ChildOf, NodeOf, Control, Null, Joint, NodeLabel, Name, InGroup)>();
            entity.try_remove::<(CreatedBy, CreatedRole, NodeLayer, Attributes)>().try_insert((ParkedNode, Disabled));
        }
    }
}

/// Despawns parked nodes that no build can bring back: their commands, or the joints that they were made for, are deleted,
/// and neither undo nor redo restores them. Both leave the history only where steps do, so nothing is searched at other
/// times.
pub(super) fn despawn_parked(
    mut commands: Commands,
    mut rigs: Query<(Entity, &Rig, Ref<RigHistory>, &mut BuiltEntities)>,
    mut index: ResMut<EntityIndex>,
    mut discarded: Local<EntityHashMap<u64>>,
) {
    for (entity, rig, history, mut known) in &mut rigs {
        if discarded.insert(entity, history.discarded()) == Some(history.discarded()) && !history.is_added() {
            continue;
        }
        let known = known.bypass_change_detection();
        if !known.nodes.values().any(|node| node.is_parked) {
            continue;
        }
        let restorable = history.restorable();
        // Nodes that were made for other nodes stay as long as those.
        let made: HashSet<Uid> = known.nodes.keys().copied().collect();
        let is_there = |uid: &Uid| rig.is_taken(*uid) || *uid == rig.uid() || restorable.contains(uid);
        let is_gone = |node: &MirroredNode| {
            !is_there(&node.command) || !(is_there(&node.subject) || made.contains(&node.subject))
        };
        known.nodes.retain(|_, node| {
            let stays = !node.is_parked || !is_gone(node);
            if !stays {
                index.remove(node.entity);
                commands.entity(node.entity).try_despawn();
            }
            stays
        });
    }
    discarded.retain(|entity, _| rigs.contains(*entity));
}

/// Writes the components of one rig's nodes.
struct Writer<'a, 'w, 's> {
    commands: &'a mut Commands<'w, 's>,
    rig: Entity,
    tags: &'a TagEntities,
    groups: &'a GroupEntities,
}

impl Writer<'_, '_, '_> {
    /// Puts a joint of the document below its parent.
    fn place_joint(
        &mut self,
        joints: &mut JointEntities,
        joint: Uid,
        parent: Entity,
        parents: &Query<&ChildOf, Allow<Disabled>>,
    ) {
        let Some(mirrored) = joints.mirrored_mut(joint) else { return };
        debug_assert_ne!(parent, mirrored.entity, "a joint cannot hang below itself in rig {}", self.rig);
        if mirrored.parent != Some(parent) || !parents.contains(mirrored.entity) {
            mirrored.parent = Some(parent);
            self.commands.entity(mirrored.entity).try_insert(ChildOf(parent));
        }
    }

    /// Puts a joint that is not built below its parent in the document.
    fn place_unbuilt(
        &mut self,
        joints: &mut JointEntities,
        joint: &RigJoint,
        parents: &Query<&ChildOf, Allow<Disabled>>,
    ) {
        let parent = joint.parent.and_then(|parent| joints.get(parent)).unwrap_or(self.rig);
        self.place_joint(joints, joint.data.uid, parent, parents);
    }

    /// Writes the components of a created node that differ from `before`; all of them without `before`.
    fn describe(&mut self, entity: Entity, rig: &Rig, node: &BuiltNode, before: Option<&BuiltNode>) {
        let differs = |of: fn(&BuiltNode, &BuiltNode) -> bool| before.is_none_or(|before| !of(before, node));
        let mut target = self.commands.entity(entity);
        if differs(|a, b| a.origin == b.origin)
            && let (Some(origin), Some(role)) = (&node.origin, role_of(node))
        {
            target.try_insert(role);
            if let Some(tag) = self.tags.get(origin.command) {
                target.try_insert(CreatedBy(tag));
            }
        }
        if differs(|a, b| a.name == b.name) {
            target.try_insert(Name::new(node.name.to_string()));
        }
        if differs(|a, b| a.label == b.label) {
            match &node.label {
                Some(label) => target.try_insert(NodeLabel(label.to_string())),
                None => target.try_remove::<NodeLabel>(),
            };
        }
        if differs(|a, b| a.group == b.group) {
            match node.group.and_then(|group| self.groups.get(group)) {
                Some(group) => target.try_insert(InGroup(group)),
                None => target.try_remove::<InGroup>(),
            };
        }
        if differs(|a, b| a.kind == b.kind) {
            match node.kind {
                NodeType::Joint => target.try_insert(Joint).try_remove::<Null>(),
                NodeType::Null => target.try_insert(Null).try_remove::<Joint>(),
                NodeType::Control => target.try_remove::<(Null, Joint)>(),
            };
        }
        if differs(|a, b| a.control == b.control) {
            match &node.control {
                Some(control) => target.try_insert(Control((**control).clone())),
                None => target.try_remove::<Control>(),
            };
        }
        let before = before.map(|before| BuiltJoint::of(entity, before));
        self.describe_any(entity, rig, node, before.as_ref());
    }

    /// Takes layer and attributes off a joint of the document that is not built any more. Once it is built again, it gets
    /// the ones of then.
    fn undescribe(&mut self, before: &BuiltJoint) {
        let mut target = self.commands.entity(before.entity);
        if before.layer.is_some() {
            target.try_remove::<NodeLayer>();
        }
        if !before.attributes.is_empty() {
            target.try_remove::<Attributes>();
        }
    }

    /// Writes the components that a build gives both to created nodes and to joints of the document: layer and
    /// attributes.
    fn describe_any(&mut self, entity: Entity, rig: &Rig, node: &BuiltNode, before: Option<&BuiltJoint>) {
        let mut target = self.commands.entity(entity);
        if before.and_then(|before| before.layer.as_ref()) != node.layer.as_ref() {
            match &node.layer {
                Some(layer) => target.try_insert(NodeLayer((**layer).clone())),
                None => target.try_remove::<NodeLayer>(),
            };
        }
        let had_any = before.is_some_and(|before| !before.attributes.is_empty());
        if node.attributes.is_empty() {
            if had_any {
                target.try_remove::<Attributes>();
            }
        } else if before.is_none_or(|before| before.attributes != node.attributes) {
            let values: BTreeMap<String, f32> = (node.attributes.iter())
                .map(|attribute| {
                    let value = rig.attribute_value(node.uid, &attribute.name).unwrap_or(attribute.default);
                    (attribute.name.to_string(), attribute.clamp(value))
                })
                .collect();
            target.queue_silenced(move |mut entity: EntityWorldMut| {
                let values = Attributes(values);
                if entity.get::<Attributes>() != Some(&values) {
                    entity.insert(values);
                }
            });
        }
    }
}
