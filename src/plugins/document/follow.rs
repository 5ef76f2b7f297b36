//! Entities of joints, groups and tags follow the document: a component is written only where its value changed.

use std::collections::{BTreeSet, HashMap, HashSet};

use bevy::{
    ecs::{
        entity::{Entities, EntityAllocator},
        world::CommandQueue,
    },
    prelude::*,
};

use super::{
    ShowRest,
    entities::{EntityIndex, EntityPart, GroupEntities, JointEntities, MirroredJoint, MirroredTag, TagEntities},
    follow_groups::follow_groups,
};
use crate::{
    plugins::{
        runtime::RigRuntime,
        schema::{CommandTag, FeatureTag, InFeature, InGroup, Joint, NodeLabel, NodeOf, Null, Tag, TagOf},
    },
    rig::{NodeKind, PoseOffset, RestTransform, Rig, RigJoint, TagKind, Uid},
};

/// Number of joints whose commands are carried out and freed together: the buffer of a system keeps its size.
const PIECE: usize = 128;

type FollowedRig<'a> = (
    Entity,
    Ref<'a, Rig>,
    &'a mut JointEntities,
    &'a mut GroupEntities,
    Option<&'a ShowRest>,
    Has<RigRuntime>,
    Option<&'a Name>,
    Option<&'a Uid>,
);

/// Spawns, updates and despawns the entities of groups and joints so that they match the document. The parent of a
/// joint is set after the build, which may put the joint below a created node.
pub(in crate::plugins) fn follow_rigs(
    mut commands: Commands,
    mut rigs: Query<FollowedRig, Or<(Changed<Rig>, Changed<ShowRest>)>>,
    mut places: Query<(&mut Transform, &mut RestTransform), With<Joint>>,
    mut index: ResMut<EntityIndex>,
    allocator: &EntityAllocator,
    entities: &Entities,
) {
    for (rig_entity, rig, mut joints, mut groups, show_rest, is_running, name, uid) in &mut rigs {
        let rig: &Rig = &rig;
        let known = joints.bypass_change_detection();
        describe_rig(&mut commands, rig_entity, rig, known, (name.is_none(), uid.is_none()));
        let is_posed = !show_rest.is_some_and(|show_rest| show_rest.0);
        if known.follow(rig) {
            follow_pose(known, rig, is_posed, is_running, &mut places);
            continue;
        }
        let groups = groups.bypass_change_detection();
        follow_groups(&mut commands, rig_entity, rig, known.touched_groups(rig).as_ref(), groups, &mut index);
        let touched = known.touched(rig);
        let mut is_other = remove_gone_joints(&mut commands, rig, known, touched.as_ref(), &mut index);
        let due: Vec<&RigJoint> = match &touched {
            Some(touched) => parents_first(rig, touched),
            None => rig.walk().collect(),
        };
        known.count(due.len());
        known.is_behind = false;
        for piece in due.chunks(PIECE) {
            let mut queue = CommandQueue::default();
            let mut of_piece = Commands::new_from_entities(&mut queue, allocator, entities);
            for &joint in piece {
                let offset = rig.offset(joint.data.uid).filter(|_| is_posed);
                if known.joints.contains_key(&joint.data.uid) {
                    follow_joint(&mut of_piece, joint, offset, known, groups, is_running, &mut places);
                } else {
                    spawn_joint(&mut of_piece, rig_entity, joint, offset, known, groups, &mut index);
                    is_other = true;
                }
            }
            if !queue.is_empty() {
                commands.queue(move |world: &mut World| queue.apply(world));
            }
        }
        if touched.is_some() {
            // The pose of the other joints, which is no matter of revisions.
            follow_pose(known, rig, is_posed, is_running, &mut places);
        }
        known.note_joints(rig);
        if is_other {
            joints.set_changed();
        }
    }
}

/// The listed joints of a document, each behind its parent if that is listed, too.
fn parents_first<'r>(rig: &'r Rig, listed: &BTreeSet<Uid>) -> Vec<&'r RigJoint> {
    let mut order = Vec::with_capacity(listed.len());
    let mut seen: HashSet<Uid> = HashSet::new();
    for uid in listed {
        let first = order.len();
        let mut at = rig.joint(*uid);
        while let Some(joint) = at.filter(|joint| listed.contains(&joint.data.uid) && seen.insert(joint.data.uid)) {
            order.push(joint);
            at = joint.parent.and_then(|parent| rig.joint(parent));
        }
        order[first..].reverse();
    }
    order
}

/// Writes the components of a joint's entity where the document differs from the last written values.
fn follow_joint(
    commands: &mut Commands,
    joint: &RigJoint,
    offset: Option<&PoseOffset>,
    known: &mut JointEntities,
    groups: &GroupEntities,
    is_running: bool,
    places: &mut Query<(&mut Transform, &mut RestTransform), With<Joint>>,
) {
    let data = &joint.data;
    let Some(mirrored) = known.joints.get_mut(&data.uid) else { return };
    let entity = mirrored.entity;
    let old_rest = std::mem::replace(&mut mirrored.rest, data.rest);
    if mirrored.kind != data.kind {
        mirrored.kind = data.kind;
        write_kind(commands, entity, data.kind);
    }
    describe(commands, mirrored, data.label.as_deref(), data.group, groups);
    let is_posed_otherwise = known.posed.get(&data.uid) != offset;
    let Ok((mut pose, mut rest)) = places.get_mut(entity) else {
        known.is_behind = true;
        return;
    };
    // A rest pose that was written and undone in one frame is still on the entity.
    if !is_posed_otherwise && old_rest == data.rest && *rest == data.rest {
        return;
    }
    rest.set_if_neq(data.rest);
    // The program of a running rig writes the transforms of all its nodes.
    if !is_running {
        let before = known.posed.get(&data.uid).copied().unwrap_or_default();
        // Motion that an animation or a game has put on the joint stays on it, unless the document sets a new pose.
        let offset_now = match offset {
            _ if !is_posed_otherwise && *pose != before.on(&old_rest) => PoseOffset::between(&old_rest, &pose),
            offset => offset.copied().unwrap_or_default(),
        };
        pose.set_if_neq(offset_now.on(&data.rest));
    }
    known.set_posed(data.uid, offset);
}

/// Writes name and uid of a rig to its entity. A name or uid that other code gave to the rig, and that this plugin has not
/// written, waits for its adoption.
fn describe_rig(
    commands: &mut Commands,
    rig_entity: Entity,
    rig: &Rig,
    known: &mut JointEntities,
    (lacks_name, lacks_uid): (bool, bool),
) {
    if known.rig_name.as_ref() != Some(&rig.about().name) {
        if known.rig_name.is_some() || lacks_name {
            commands.entity(rig_entity).try_insert(Name::new(rig.about().name.clone()));
        }
        known.rig_name = Some(rig.about().name.clone());
    }
    if known.rig_uid != Some(rig.uid()) {
        if known.rig_uid.is_some() || lacks_uid {
            commands.entity(rig_entity).try_insert(rig.uid());
        }
        known.rig_uid = Some(rig.uid());
    }
}

/// Despawns the entities of joints that the document has no more; true if there were any. They are among the `touched`
/// joints, if these are known.
fn remove_gone_joints(
    commands: &mut Commands,
    rig: &Rig,
    known: &mut JointEntities,
    touched: Option<&BTreeSet<Uid>>,
    index: &mut EntityIndex,
) -> bool {
    let is_gone = |uid: &Uid| rig.joint(*uid).is_none();
    let mut gone: Vec<(Uid, Entity)> = match touched {
        Some(touched) => {
            touched.iter().copied().filter(is_gone).filter_map(|uid| Some((uid, known.get(uid)?))).collect()
        }
        None => known.joints.keys().copied().filter(is_gone).filter_map(|uid| Some((uid, known.get(uid)?))).collect(),
    };
    gone.sort_unstable();
    for (uid, entity) in &gone {
        index.remove(*entity);
        if let Ok(mut entity) = commands.get_entity(*entity) {
            // Remaining children get another parent after the build, so they must not be despawned with this entity.
            entity.detach_all_children().try_despawn();
        }
        known.left_tags.extend(known.joints.remove(uid).into_iter().flat_map(|joint| joint.tags));
        known.posed.remove(uid);
    }
    !gone.is_empty()
}

/// Spawns the entity of a joint, below that of its parent in the document.
fn spawn_joint(
    commands: &mut Commands,
    rig_entity: Entity,
    joint: &RigJoint,
    offset: Option<&PoseOffset>,
    known: &mut JointEntities,
    groups: &GroupEntities,
    index: &mut EntityIndex,
) {
    let data = &joint.data;
    let posed = offset.copied().unwrap_or_default().on(&data.rest);
    let parent = joint.parent.and_then(|parent| known.get(parent)).unwrap_or(rig_entity);
    let bundle = (Joint, data.uid, data.rest, posed, NodeOf(rig_entity), ChildOf(parent));
    let mut entity = commands.spawn(bundle);
    if data.kind == NodeKind::Null {
        entity.insert(Null);
    }
    let entity = entity.id();
    let mut mirrored = MirroredJoint {
        entity,
        label: None,
        group: None,
        rest: data.rest,
        parent: Some(parent),
        kind: data.kind,
        tags: Vec::new(),
    };
    describe(commands, &mut mirrored, data.label.as_deref(), data.group, groups);
    index.insert(entity, rig_entity, data.uid, EntityPart::Joint);
    known.joints.insert(data.uid, Box::new(mirrored));
    known.set_posed(data.uid, offset);
}

/// Writes the transforms of joints that the document poses otherwise than before.
fn follow_pose(
    known: &mut JointEntities,
    rig: &Rig,
    is_posed: bool,
    is_running: bool,
    places: &mut Query<(&mut Transform, &mut RestTransform), With<Joint>>,
) {
    let touched: BTreeSet<Uid> = known.posed.keys().chain(rig.pose().keys()).copied().collect();
    for uid in touched {
        let offset = rig.offset(uid).filter(|_| is_posed);
        let (Some(joint), Some(mirrored)) = (rig.joint(uid), known.joints.get(&uid)) else { continue };
        if known.posed.get(&uid) == offset {
            continue;
        }
        // The program of a running rig writes the transforms of all its nodes.
        if let Ok((mut pose, _)) = places.get_mut(mirrored.entity)
            && !is_running
        {
            pose.set_if_neq(offset.copied().unwrap_or_default().on(&joint.data.rest));
        }
        known.set_posed(uid, offset);
    }
}

/// Writes label, name and group where they differ from the last written values.
fn describe(
    commands: &mut Commands,
    mirrored: &mut MirroredJoint,
    label: Option<&str>,
    group: Option<Uid>,
    groups: &GroupEntities,
) {
    if mirrored.label.as_deref() != label {
        mirrored.label = label.map(str::to_owned);
        write_label(commands, mirrored.entity, label);
    }
    if mirrored.group != group {
        mirrored.group = group;
        write_group(commands, mirrored.entity, group.and_then(|group| groups.get(group)));
    }
}

pub(super) fn write_label(commands: &mut Commands, entity: Entity, label: Option<&str>) {
    match label {
        Some(label) => commands.entity(entity).try_insert((NodeLabel(label.to_owned()), Name::new(label.to_owned()))),
        None => commands.entity(entity).try_remove::<(NodeLabel, Name)>(),
    };
}

pub(super) fn write_kind(commands: &mut Commands, entity: Entity, kind: NodeKind) {
    match kind {
        NodeKind::Null => commands.entity(entity).try_insert(Null),
        NodeKind::Joint => commands.entity(entity).try_remove::<Null>(),
    };
}

pub(super) fn write_group(commands: &mut Commands, entity: Entity, group: Option<Entity>) {
    match group {
        Some(group) => commands.entity(entity).try_insert(InGroup(group)),
        None => commands.entity(entity).try_remove::<InGroup>(),
    };
}

/// Spawns, updates and despawns the entities of tags so that they match the document.
pub(in crate::plugins) fn follow_tags(
    mut commands: Commands,
    mut rigs: Query<(Entity, &Rig, &mut JointEntities, &mut TagEntities)>,
    mut index: ResMut<EntityIndex>,
) {
    for (rig_entity, rig, mut joints, mut tags) in &mut rigs {
        let (joints, known) = (joints.bypass_change_detection(), &mut *tags.bypass_change_detection());
        if !joints.are_tags_due(rig) {
            continue;
        }
        // Tags that other code spawned may belong to any joint.
        let touched = joints.touched_of_tags(rig).filter(|_| known.adopted.is_empty());
        let left = std::mem::take(&mut joints.left_tags);
        joints.note_tags(rig);
        if !rig.has_tags() && known.tags.is_empty() && known.adopted.is_empty() {
            continue;
        }
        let mut due: Vec<&RigJoint> = match &touched {
            Some(touched) => touched.iter().filter_map(|uid| rig.joint(*uid)).collect(),
            None => rig.walk().collect(),
        };
        joints.count(due.len());
        let is_gone = |uid: &Uid| rig.find_tag(*uid).is_none();
        let mut gone: Vec<Uid> = match &touched {
            Some(touched) => {
                let before = touched.iter().filter_map(|uid| joints.joints.get(uid)).flat_map(|joint| &joint.tags);
                before.copied().chain(left).filter(is_gone).collect()
            }
            None => known.tags.keys().copied().filter(is_gone).collect(),
        };
        gone.sort_unstable();
        for uid in gone {
            if let Some(mirrored) = known.tags.remove(&uid) {
                index.remove(mirrored.entity);
                commands.entity(mirrored.entity).try_despawn();
            }
        }
        // Entities of all tags are spawned first, because a command may refer to a feature further down.
        let mut fresh: HashMap<Uid, Entity> = HashMap::new();
        let mut adopted = std::mem::take(&mut known.adopted);
        adopted.retain(|uid, entity| known.get(*uid) == Some(*entity));
        let mut has_fresh_feature = false;
        for joint in &due {
            for tag in &joint.data.tags {
                if known.get(tag.uid).is_some() {
                    continue;
                }
                let entity = commands.spawn(tag.uid).id();
                index.insert(entity, rig_entity, tag.uid, EntityPart::Tag);
                known.insert_fresh(joint.data.uid, tag, entity);
                fresh.insert(tag.uid, entity);
                has_fresh_feature |= matches!(tag.kind, TagKind::Feature { .. });
            }
        }
        if has_fresh_feature && touched.is_some() {
            // Commands of any joint may be in it.
            due = rig.walk().collect();
            joints.count(due.len());
        }
        for joint in due {
            let data = &joint.data;
            let Some(mirrored) = joints.joints.get_mut(&data.uid) else { continue };
            let is_ordered = mirrored.tags.iter().copied().eq(data.tags.iter().map(|tag| tag.uid));
            let bearer = mirrored.entity;
            if !is_ordered {
                mirrored.tags = data.tags.iter().map(|tag| tag.uid).collect();
            }
            for tag in &data.tags {
                let is_fresh = fresh.contains_key(&tag.uid);
                let Some(before) = known.tags.get_mut(&tag.uid) else { continue };
                let entity = before.entity;
                if !is_ordered || before.joint != data.uid {
                    before.joint = data.uid;
                    // Removing and inserting each tag in turn puts the tags into the document's order.
                    commands.entity(entity).try_remove::<TagOf>().try_insert(TagOf(bearer));
                }
                // With the entity of a feature went the relation of its commands. One that came with the feature's entity
                // says itself what it is in.
                if let TagKind::Command { feature: Some(feature), .. } = &tag.kind
                    && let Some(entity_of) =
                        fresh.get(feature).or_else(|| adopted.get(feature).filter(|_| !adopted.contains_key(&tag.uid)))
                {
                    commands.entity(entity).try_insert(InFeature(*entity_of));
                }
                if !is_fresh && before.data == *tag {
                    continue;
                }
                let old = std::mem::replace(&mut before.data, tag.clone());
                write_tag(&mut commands, entity, tag, (!is_fresh).then_some(&old), known);
            }
        }
    }
}

/// Writes the components of a tag that differ from `old`; all of them without `old`.
pub(super) fn write_tag(
    commands: &mut Commands,
    entity: Entity,
    tag: &crate::rig::TagData,
    old: Option<&crate::rig::TagData>,
    known: &TagEntities,
) {
    let mut target = commands.entity(entity);
    if old.is_none_or(|old| (old.enabled, &old.comment) != (tag.enabled, &tag.comment)) {
        target.try_insert(Tag { enabled: tag.enabled, comment: tag.comment.clone() });
    }
    let parts = |kind: &TagKind| match kind {
        TagKind::Command { feature, .. } => *feature,
        TagKind::Feature { .. } => None,
    };
    match &tag.kind {
        TagKind::Command { module, params, .. } => {
            let is_same = |old: &crate::rig::TagData| matches!(&old.kind, TagKind::Command { module: m, params: p, .. } if (m, p) == (module, params));
            if !old.is_some_and(is_same) {
                let command = CommandTag { module: module.clone(), params: params.clone() };
                target.try_insert(command).try_remove::<FeatureTag>();
            }
        }
        TagKind::Feature { kind, name, switch, choice } => {
            if old.is_none_or(|old| old.kind != tag.kind) {
                let feature = FeatureTag {
                    kind: kind.clone(),
                    name: name.clone(),
                    switch: switch.clone(),
                    choice: choice.clone(),
                };
                target.try_insert(feature).try_remove::<CommandTag>();
            }
        }
    }
    let feature = parts(&tag.kind);
    if old.map(|old| parts(&old.kind)) != Some(feature) {
        match feature.and_then(|feature| known.get(feature)) {
            Some(feature) => target.try_insert(InFeature(feature)),
            None => target.try_remove::<InFeature>(),
        };
    }
}

impl TagEntities {
    fn insert_fresh(&mut self, joint: Uid, tag: &crate::rig::TagData, entity: Entity) {
        self.tags.insert(tag.uid, MirroredTag { entity, joint, data: tag.clone() });
    }
}

/// Rest pose, relative to the parent, of a joint that other code spawned: its rest transform, or its transform if the
/// rest transform was left out.
pub(super) fn rest_of(rest: Option<&RestTransform>, transform: Option<&Transform>) -> RestTransform {
    match (rest, transform) {
        (Some(rest), _) if *rest != RestTransform::default() => *rest,
        (_, Some(transform)) => (*transform).into(),
        (rest, None) => rest.copied().unwrap_or_default(),
    }
}
