//! Maps between entities and the parts of a document or a build: from uid to entity on each rig, and from entity to uid
//! in one index.
//!
//! Each entity is stored with the value that this plugin last wrote to it. A different value on the entity was written
//! by other code; a different value in the document still has to be written to the entity.

use std::{
    collections::{BTreeMap, BTreeSet, HashMap, HashSet},
    sync::Arc,
};

use bevy::{ecs::entity::EntityHashMap, prelude::*};

use crate::rig::{
    Attribute, BuiltConstraint, BuiltNode, GroupData, LayerData, NodeKind, PoseOffset, RestTransform, Revision, Rig,
    TagData, Uid,
};

/// The parts of a rig that have entities.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::plugins) enum EntityPart {
    /// A joint of the document.
    Joint,
    /// A tag.
    Tag,
    /// A local group.
    Group,
    /// A created node.
    Node,
    /// A constraint.
    Constraint,
}

/// Part of a rig that an entity represents.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::plugins) struct IndexedEntity {
    /// The rig.
    pub rig: Entity,
    /// The uid of the part.
    pub uid: Uid,
    /// The kind of part.
    pub part: EntityPart,
}

/// Index from entities to the parts of rigs that they represent.
#[derive(Resource, Debug, Default)]
pub(in crate::plugins) struct EntityIndex(EntityHashMap<IndexedEntity>);

impl EntityIndex {
    /// Part that an entity represents; `None` if it represents no part of a rig.
    pub fn get(&self, entity: Entity) -> Option<IndexedEntity> {
        self.0.get(&entity).copied()
    }

    /// Uid of the joint, group, tag or node that an entity represents; `None` for an entity of another kind or another rig.
    pub fn uid_of(&self, entity: Entity, rig: Entity, part: EntityPart) -> Option<Uid> {
        self.get(entity).filter(|indexed| indexed.rig == rig && indexed.part == part).map(|indexed| indexed.uid)
    }

    /// Adds an entity with the part that it represents.
    pub fn insert(&mut self, entity: Entity, rig: Entity, uid: Uid, part: EntityPart) {
        self.0.insert(entity, IndexedEntity { rig, uid, part });
    }

    /// Removes an entity.
    pub fn remove(&mut self, entity: Entity) -> Option<IndexedEntity> {
        self.0.remove(&entity)
    }

    /// Removes all entities of rigs that no longer exist, and returns them with the parts that they represented.
    pub fn forget_rigs(&mut self, gone: &HashSet<Entity>) -> Vec<(Entity, IndexedEntity)> {
        let mut forgotten = Vec::new();
        self.0.retain(|entity, indexed| {
            let stays = !gone.contains(&indexed.rig);
            if !stays {
                forgotten.push((*entity, *indexed));
            }
            stays
        });
        forgotten.sort_unstable_by_key(|(entity, _)| *entity);
        forgotten
    }
}

/// Members of a relation that have to be added again, in this order, so that the members with ranks stand by rank.
pub(in crate::plugins) fn misplaced(
    members: impl Iterator<Item = Entity>,
    ranks: &EntityHashMap<usize>,
) -> Vec<Entity> {
    let members: Vec<Entity> = members.filter(|member| ranks.contains_key(member)).collect();
    let mut sorted = members.clone();
    sorted.sort_by_key(|member| ranks.get(member).copied());
    let mut kept = 0;
    for member in &members {
        kept += usize::from(sorted.get(kept) == Some(member));
    }
    sorted.split_off(kept)
}

/// The entities of a rig's joints.
#[derive(Component, Reflect, Debug, Clone, Default)]
#[reflect(opaque)]
#[reflect(Component, Debug, Clone, Default)]
pub struct JointEntities {
    /// Mirrors of joints, boxed: a table that grows is there twice for a moment, and up to half of its places are free.
    pub(super) joints: HashMap<Uid, Box<MirroredJoint>>,
    /// Pose offsets of the document that the joints' transforms were last set to.
    pub(super) posed: BTreeMap<Uid, PoseOffset>,
    /// Uid and name last written to the entity of the rig, or adopted from it.
    pub(super) rig_uid: Option<Uid>,
    pub(super) rig_name: Option<String>,
    /// Revision of the document that all entities of the rig follow; `None` if one of them has to be written again.
    revision: Option<Revision>,
    /// Revision that the entities of joints and groups follow, while those of tags and nodes may lag behind.
    of_joints: Option<Revision>,
    /// Revision that the entities of tags follow.
    of_tags: Option<Revision>,
    /// True if a joint's entity lacked a component that had to be written, so that all joints have to be looked at again.
    pub(super) is_behind: bool,
    /// Tags of joints that are gone, until their entities follow.
    pub(super) left_tags: Vec<Uid>,
    /// Number of joints that were looked at.
    visits: u64,
}

/// Entity of a joint and the values last written to it.
#[derive(Debug, Clone, PartialEq)]
pub(in crate::plugins) struct MirroredJoint {
    pub entity: Entity,
    pub label: Option<String>,
    pub group: Option<Uid>,
    pub rest: RestTransform,
    /// Parent entity; `None` until the joint has been placed.
    pub parent: Option<Entity>,
    pub kind: NodeKind,
    /// Uids of the joint's tags, in order.
    pub tags: Vec<Uid>,
}

impl JointEntities {
    /// The entity of a joint.
    pub fn get(&self, joint: Uid) -> Option<Entity> {
        self.joints.get(&joint).map(|mirrored| mirrored.entity)
    }

    /// Number of joints that were looked at so far, so that entities follow the document; for tests of growth.
    pub fn visits(&self) -> u64 {
        self.visits
    }

    /// Counts joints that are looked at.
    pub(in crate::plugins) fn count(&mut self, joints: usize) {
        self.visits += joints as u64;
    }

    /// Joints that edits touched since their entities followed the document; `None` if all have to be looked at.
    pub(super) fn touched(&self, rig: &Rig) -> Option<BTreeSet<Uid>> {
        rig.touched_since(self.of_joints.as_ref().filter(|_| !self.is_behind)?)
    }

    /// Local groups that edits touched since their entities followed the document; `None` if all have to be looked at.
    pub(super) fn touched_groups(&self, rig: &Rig) -> Option<BTreeSet<Uid>> {
        rig.touched_groups_since(self.of_joints.as_ref()?)
    }

    /// Joints that edits touched since all entities followed the document; `None` if all have to be looked at.
    pub(in crate::plugins) fn touched_of_all(&self, rig: &Rig) -> Option<BTreeSet<Uid>> {
        rig.touched_since(self.revision.as_ref()?)
    }

    /// True if the entities of joints, tags, groups and created nodes follow the document in everything but its pose.
    pub(in crate::plugins) fn follow(&self, rig: &Rig) -> bool {
        is_of(self.revision.as_ref(), rig)
    }

    /// True if the entities of tags have to follow the document, whose joints have entities already.
    pub(super) fn are_tags_due(&self, rig: &Rig) -> bool {
        is_of(self.of_joints.as_ref(), rig) && !is_of(self.of_tags.as_ref(), rig)
    }

    /// Joints that edits touched since the entities of tags followed the document; `None` if all have to be looked at.
    pub(super) fn touched_of_tags(&self, rig: &Rig) -> Option<BTreeSet<Uid>> {
        rig.touched_since(self.of_tags.as_ref()?)
    }

    pub(super) fn note_joints(&mut self, rig: &Rig) {
        self.of_joints = Some(rig.revision().clone());
    }

    pub(super) fn note_tags(&mut self, rig: &Rig) {
        self.of_tags = Some(rig.revision().clone());
    }

    /// Notes that all entities follow the document, unless it was replaced after those of joints or tags followed it.
    pub(in crate::plugins) fn note_all(&mut self, rig: &Rig) {
        if is_of(self.of_joints.as_ref(), rig) && is_of(self.of_tags.as_ref(), rig) {
            self.revision.clone_from(&self.of_tags);
        }
    }

    /// Lets all entities be written again.
    pub(super) fn forget_revision(&mut self) {
        (self.revision, self.of_joints, self.of_tags) = (None, None, None);
    }

    pub(in crate::plugins) fn mirrored_mut(&mut self, joint: Uid) -> Option<&mut MirroredJoint> {
        self.joints.get_mut(&joint).map(|mirrored| &mut **mirrored)
    }

    /// Pose offset of the document that a joint's transform was last set to.
    pub(in crate::plugins) fn posed(&self, joint: Uid) -> Option<&PoseOffset> {
        self.posed.get(&joint)
    }

    pub(super) fn set_posed(&mut self, joint: Uid, offset: Option<&PoseOffset>) {
        match offset {
            Some(offset) => self.posed.insert(joint, *offset),
            None => self.posed.remove(&joint),
        };
    }
}

fn is_of(revision: Option<&Revision>, rig: &Rig) -> bool {
    revision.is_some_and(|revision| revision.is_same(rig.revision()))
}

/// The entities of a rig's tags.
#[derive(Component, Reflect, Debug, Clone, Default)]
#[reflect(opaque)]
#[reflect(Component, Debug, Clone, Default)]
pub struct TagEntities {
    pub(super) tags: HashMap<Uid, MirroredTag>,
    /// Entities of other code that became tags since the entities followed the document last.
    pub(super) adopted: HashMap<Uid, Entity>,
}

/// Entity of a tag and the values last written to it.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct MirroredTag {
    pub entity: Entity,
    pub joint: Uid,
    pub data: TagData,
}

impl TagEntities {
    /// The entity of a tag.
    pub fn get(&self, tag: Uid) -> Option<Entity> {
        self.tags.get(&tag).map(|mirrored| mirrored.entity)
    }
}

/// The entities of a rig's local groups.
#[derive(Component, Reflect, Debug, Clone, Default)]
#[reflect(opaque)]
#[reflect(Component, Debug, Clone, Default)]
pub struct GroupEntities {
    pub(super) groups: HashMap<Uid, (Entity, GroupData)>,
    /// True if groups came, left or changed since their entities were put into the order of the document.
    pub(super) is_unsorted: bool,
    /// Number of groups that were looked at.
    pub(super) visits: u64,
}

impl GroupEntities {
    /// The entity of a local group.
    pub fn get(&self, group: Uid) -> Option<Entity> {
        self.groups.get(&group).map(|(entity, _)| *entity)
    }

    /// Number of groups that were looked at so far, so that entities follow the document; for tests of growth.
    pub fn visits(&self) -> u64 {
        self.visits
    }
}

/// The entities of the nodes and constraints that a rig's commands created, parked ones included.
#[derive(Component, Reflect, Debug, Clone, Default)]
#[reflect(opaque)]
#[reflect(Component, Debug, Clone, Default)]
pub struct BuiltEntities {
    pub(in crate::plugins) nodes: BTreeMap<Uid, MirroredNode>,
    pub(in crate::plugins) constraints: BTreeMap<Uid, MirroredConstraint>,
    /// Built values last written to the entities of the document's joints.
    pub(in crate::plugins) joints: HashMap<Uid, BuiltJoint>,
}

/// Entity of a joint of the document, the built values last written to it, and the name that it had then.
#[derive(Debug, Clone, PartialEq)]
pub(in crate::plugins) struct BuiltJoint {
    pub entity: Entity,
    pub name: Arc<str>,
    pub layer: Option<Arc<LayerData>>,
    pub attributes: Arc<[Attribute]>,
}

impl BuiltJoint {
    /// Values of a built node for its entity.
    pub fn of(entity: Entity, node: &BuiltNode) -> Self {
        let (layer, attributes) = (node.layer.clone(), Arc::clone(&node.attributes));
        Self { entity, name: Arc::clone(&node.name), layer, attributes }
    }
}

/// Entity of a created node and the values last written to it.
#[derive(Debug, Clone, PartialEq)]
pub(in crate::plugins) struct MirroredNode {
    pub entity: Entity,
    /// Uid of the command that creates the node.
    pub command: Uid,
    /// Uid of the joint or node that it is made for.
    pub subject: Uid,
    pub is_parked: bool,
    pub node: Option<BuiltNode>,
    pub parent: Option<Entity>,
}

/// Entity of a constraint and the values last written to it.
#[derive(Debug, Clone)]
pub(in crate::plugins) struct MirroredConstraint {
    pub entity: Entity,
    /// Uid of the command that creates the constraint.
    pub command: Uid,
    pub constraint: Arc<crate::rig::Constraint>,
    /// The driven node and the nodes that it reads.
    pub uids: Vec<Uid>,
    /// Entities of the driven node and of the nodes that it reads, when they were last written.
    pub nodes: Vec<Option<Entity>>,
}

impl MirroredConstraint {
    pub fn is_same(&self, built: &BuiltConstraint, nodes: &[Option<Entity>]) -> bool {
        self.nodes == nodes
            && (Arc::ptr_eq(&self.constraint, &built.constraint) || *self.constraint == *built.constraint)
    }
}

impl BuiltEntities {
    /// True if no build has given a node, or anything to a joint.
    pub(in crate::plugins) fn is_empty(&self) -> bool {
        self.nodes.is_empty() && self.joints.is_empty()
    }

    /// The entity of a created node that is part of the rig at present.
    pub fn get(&self, node: Uid) -> Option<Entity> {
        self.nodes.get(&node).filter(|mirrored| !mirrored.is_parked).map(|mirrored| mirrored.entity)
    }

    /// The entity of a created node, parked or not.
    pub fn any(&self, node: Uid) -> Option<Entity> {
        self.nodes.get(&node).map(|mirrored| mirrored.entity)
    }

    /// Created nodes that are part of the rig at present (not parked), by uid.
    pub fn iter(&self) -> impl Iterator<Item = (Uid, Entity)> {
        self.nodes.iter().filter(|(_, mirrored)| !mirrored.is_parked).map(|(uid, mirrored)| (*uid, mirrored.entity))
    }

    /// The entity of a constraint.
    pub fn constraint(&self, constraint: Uid) -> Option<Entity> {
        self.constraints.get(&constraint).map(|mirrored| mirrored.entity)
    }
}
