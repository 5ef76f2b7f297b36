//! Adoption of entity writes: changes that a game, an animation tool or the editor makes to a rig's entities become
//! edits.
//!
//! Adoption runs each frame, before requested edits. A value that differs from the one this plugin last wrote was
//! written by other code; an entity without a place in the index was spawned; an indexed entity that no longer exists
//! was despawned. Each write is tried on the document by itself. Writes that the document accepts become one step of
//! the history; the others are reverted on the entities, with one message each.

mod groups;
mod joints;
mod removal;
mod rigs;
mod sorting;
mod tags;
mod trial;

use std::collections::{BTreeSet, HashSet};

use bevy::{
    ecs::{
        entity_disabling::Disabled,
        query::{Allow, QueryData},
        system::SystemParam,
    },
    prelude::*,
};

use self::trial::Trial;
use super::{
    EditRefusal, HoveredNode, Selection,
    entities::{BuiltEntities, EntityIndex, EntityPart, GroupEntities, JointEntities, TagEntities},
    error::{EntityWrite, EntityWriteError},
    refusals::{Bearer, RefusalLog},
};
use crate::{
    plugins::{
        commands::{BuildFailure, BuildResult, Processor, RunFailure},
        history::RigHistory,
        runtime::RigRuntime,
        schema::{
            CommandTag, ConstraintKind, CreatedRole, FeatureTag, GroupOf, InFeature, InGroup, Joint, LocalGroup,
            NodeLabel, NodeOf, NodeSlot, Null, ParkedNode, Tag, TagOf, Tags,
        },
        stage::RigStage,
    },
    rig::{RestTransform, Rig, RigEdit, Uid, UidSource},
};

/// Edits that writes to entities made, one list for each rig; carried out before the requests of the same frame.
#[derive(Resource, Debug, Default)]
pub(super) struct EntityEdits(pub Vec<(Entity, Vec<RigEdit>)>);

/// Components of an entity from which the document is read.
#[derive(QueryData)]
pub(super) struct View {
    joint: Has<Joint>,
    null: Has<Null>,
    name: Option<&'static Name>,
    label: Option<&'static NodeLabel>,
    in_group: Option<&'static InGroup>,
    rest: Option<&'static RestTransform>,
    transform: Option<&'static Transform>,
    child_of: Option<&'static ChildOf>,
    node_of: Option<&'static NodeOf>,
    uid: Option<&'static Uid>,
    tag: Option<&'static Tag>,
    command: Option<&'static CommandTag>,
    feature: Option<&'static FeatureTag>,
    tag_of: Option<&'static TagOf>,
    in_feature: Option<&'static InFeature>,
    group: Option<&'static LocalGroup>,
    group_of: Option<&'static GroupOf>,
    tags: Option<&'static Tags>,
    created: Has<CreatedRole>,
}

type JointWritten = Or<(
    Added<Joint>,
    Added<Null>,
    Changed<Name>,
    Changed<NodeLabel>,
    Changed<InGroup>,
    Changed<RestTransform>,
    Changed<ChildOf>,
    Changed<Uid>,
    Changed<Tags>,
)>;

type TagWritten =
    Or<(Changed<Tag>, Changed<CommandTag>, Changed<FeatureTag>, Changed<TagOf>, Changed<InFeature>, Changed<Uid>)>;

/// Entities other than the nodes of instances, which tell nothing of a document; a crowd has hundreds of thousands of them.
type OfDocument = (Without<NodeSlot>, Allow<Disabled>);

/// Entities that were written since the last frame, by this plugin or by other code.
#[derive(SystemParam)]
pub(super) struct WrittenEntities<'w, 's> {
    nodes:
        Query<'w, 's, Entity, (Or<(With<Joint>, With<CreatedRole>, With<ConstraintKind>)>, JointWritten, OfDocument)>,
    tags: Query<'w, 's, Entity, (TagWritten, OfDocument)>,
    groups: Query<
        'w,
        's,
        Entity,
        (
            Or<(Changed<LocalGroup>, Changed<GroupOf>, Changed<Name>, Changed<Uid>)>,
            Or<(With<LocalGroup>, With<GroupOf>)>,
            Allow<Disabled>,
        ),
    >,
    /// Rigs whose name or uid was written, and fresh ones: the history comes with the rig.
    of_rigs: Query<'w, 's, Entity, (Or<(Changed<Name>, Changed<Uid>, Added<RigHistory>)>, With<Rig>, Allow<Disabled>)>,
    uid: RemovedComponents<'w, 's, Uid>,
    of_joints: (
        RemovedComponents<'w, 's, Joint>,
        RemovedComponents<'w, 's, Null>,
        RemovedComponents<'w, 's, Name>,
        RemovedComponents<'w, 's, NodeLabel>,
        RemovedComponents<'w, 's, InGroup>,
        RemovedComponents<'w, 's, RestTransform>,
        RemovedComponents<'w, 's, ChildOf>,
    ),
    of_tags: (
        RemovedComponents<'w, 's, Tag>,
        RemovedComponents<'w, 's, CommandTag>,
        RemovedComponents<'w, 's, FeatureTag>,
        RemovedComponents<'w, 's, TagOf>,
        RemovedComponents<'w, 's, InFeature>,
    ),
    of_groups: (RemovedComponents<'w, 's, LocalGroup>, RemovedComponents<'w, 's, GroupOf>),
    rigs: RemovedComponents<'w, 's, Rig>,
}

/// Written entities by their kind of part; sorted, so that the same writes give the same edits.
#[derive(Default)]
struct WrittenByKind {
    joints: BTreeSet<Entity>,
    tags: BTreeSet<Entity>,
    groups: BTreeSet<Entity>,
    rigs: BTreeSet<Entity>,
    uids: BTreeSet<Entity>,
}

impl WrittenByKind {
    fn is_empty(&self) -> bool {
        [&self.joints, &self.tags, &self.groups, &self.rigs, &self.uids].into_iter().all(BTreeSet::is_empty)
    }
}

impl WrittenEntities<'_, '_> {
    fn take(&mut self) -> WrittenByKind {
        let mut touched = WrittenByKind::default();
        touched.joints.extend(self.nodes.iter());
        touched.tags.extend(self.tags.iter());
        touched.groups.extend(self.groups.iter());
        touched.rigs.extend(self.of_rigs.iter());
        touched.uids.extend(self.uid.read());
        touched.rigs.extend(&touched.uids);
        let (joint, null, name, label, group, rest, child_of) = &mut self.of_joints;
        // Groups and rigs have names, too.
        let names: Vec<Entity> = name.read().collect();
        touched.groups.extend(&names);
        touched.rigs.extend(&names);
        let markers = joint.read().chain(null.read()).chain(names).chain(label.read());
        touched.joints.extend(markers.chain(group.read()).chain(rest.read()).chain(child_of.read()));
        let (tag, command, feature, tag_of, in_feature) = &mut self.of_tags;
        touched.tags.extend(
            tag.read().chain(command.read()).chain(feature.read()).chain(tag_of.read()).chain(in_feature.read()),
        );
        let (group, group_of) = &mut self.of_groups;
        touched.groups.extend(group.read().chain(group_of.read()));
        touched
    }
}

type Views<'w, 's> = Query<'w, 's, View, Allow<Disabled>>;

/// The components of a rig that a trial works on.
pub(super) type RigParts = (
    &'static mut Rig,
    &'static mut JointEntities,
    &'static mut TagEntities,
    &'static mut GroupEntities,
    Option<&'static mut BuiltEntities>,
);

/// Turns the writes to entities of all rigs into edits.
pub(super) fn adopt_writes(
    mut commands: Commands,
    mut written: WrittenEntities,
    views: Views,
    mut rigs: Query<RigParts>,
    mut uids: ResMut<UidSource>,
    mut index: ResMut<EntityIndex>,
    mut edits: ResMut<EntityEdits>,
    mut refused: MessageWriter<EditRefusal>,
    parked: Query<(), (With<ParkedNode>, Allow<Disabled>)>,
    mut told: Local<RefusalLog>,
) {
    let touched = written.take();
    let closed: HashSet<Entity> = written.rigs.read().filter(|rig| !rigs.contains(*rig)).collect();
    if !closed.is_empty() {
        for (entity, indexed) in index.forget_rigs(&closed) {
            // Nodes that were rolled back have no place below the rig, with which they would have gone, and an entity that
            // lost its document alone takes nothing along.
            if parked.contains(entity) || views.contains(indexed.rig) {
                commands.entity(entity).try_despawn();
            }
        }
        for rig in closed.into_iter().filter(|rig| views.contains(*rig)) {
            clear_rig(&mut commands, rig);
        }
    }
    if touched.is_empty() {
        return;
    }
    // Usually only this plugin has written, so that nothing differs.
    let by_rig = sorting::sort_by_rig(&touched, &views, &index, |entity| rigs.contains(entity));
    let mut has_told = false;
    for (rig_entity, writes) in by_rig {
        let Ok((mut rig, mut joints, mut tags, mut groups, mut built)) = rigs.get_mut(rig_entity) else { continue };
        let mut trial = Trial::new(rig_entity, rig.bypass_change_detection(), &mut uids);
        let mut adoption = Adoption {
            commands: &mut commands,
            views: &views,
            index: &mut index,
            trial: &mut trial,
            joints: joints.bypass_change_detection(),
            tags: tags.bypass_change_detection(),
            groups: groups.bypass_change_detection(),
            built: built.as_mut().map(|built| built.bypass_change_detection()),
        };
        adoption.rig_written(&writes);
        adoption.groups_written(&writes);
        adoption.joints_spawned(&writes);
        adoption.joints_written(&writes);
        adoption.tags_written(&writes);
        adoption.despawned(&writes);
        // Among the tags that are left: one of them may have been despawned in the same frame.
        adoption.orders_written(&writes);
        let mut outcome = trial.finish();
        for reason in outcome.take_refused(&mut told) {
            warn!("{reason}");
            refused.write(EditRefusal { rig: rig_entity, request: None, reason: reason.into() });
            has_told = true;
        }
        if outcome.respawn {
            rig.set_changed();
            joints.set_changed();
            joints.forget_revision();
        }
        if !outcome.edits.is_empty() {
            edits.0.push((rig_entity, outcome.edits));
        }
    }
    if has_told {
        told.retain(|bearer| match bearer {
            Bearer::Part(rig, _) => rigs.contains(rig),
            Bearer::Entity(entity) => views.contains(entity),
        });
    }
}

/// Takes off what an entity had because of its document, so that another document on it begins anew.
fn clear_rig(commands: &mut Commands, rig: Entity) {
    commands
        .entity(rig)
        .try_remove::<(JointEntities, TagEntities, GroupEntities, BuiltEntities, RigHistory, Uid, Name)>()
        .try_remove::<(Processor, BuildResult, BuildFailure, RigRuntime, RunFailure, RigStage)>()
        .try_remove::<(Selection, HoveredNode)>();
}

/// State of the adoption of one rig's writes.
struct Adoption<'a, 'b, 'w, 's, 'v, 'q> {
    pub commands: &'a mut Commands<'w, 's>,
    pub views: &'a Views<'v, 'q>,
    pub index: &'a mut EntityIndex,
    pub trial: &'a mut Trial<'b>,
    pub joints: &'a mut JointEntities,
    pub tags: &'a mut TagEntities,
    pub groups: &'a mut GroupEntities,
    pub built: Option<&'a mut BuiltEntities>,
}

impl Adoption<'_, '_, '_, '_, '_, '_> {
    pub(super) fn rig(&self) -> &Rig {
        self.trial.rig()
    }

    pub(super) fn uid_of(&self, entity: Entity, part: EntityPart) -> Option<Uid> {
        self.index.uid_of(entity, self.trial.rig_entity, part)
    }

    /// Restores the uid of an entity whose uid was removed or replaced.
    pub(super) fn hold_uid(&mut self, entity: Entity, uid: Uid, told: Option<Uid>) {
        if told != Some(uid) {
            self.commands.entity(entity).try_insert(uid);
            self.trial.refuse(EntityWriteError::Uid { entity, uid });
        }
    }
}
