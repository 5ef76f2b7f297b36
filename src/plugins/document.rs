//! Rigs as entities, and the one place where they change.
//!
//! The [`Rig`] component is the document. Its joints stand in the world as entities of their own, in the same
//! hierarchy, so that Bevy's transforms, skinning and animation work on them; they follow the document and are never
//! edited themselves. An [`EditRequest`] is the only way to change a rig.

use std::{
    borrow::Cow,
    collections::{BTreeMap, HashMap},
};

use bevy::prelude::*;

pub use super::selection::{Hovered, Selection};
use super::{RigSystems, configure_sets, history::RigHistory};
use crate::rig::{
    PoseOffset, RestTransform, Rig, Uid, UidSource,
    operations::{MirrorPlane, Operation},
    step::Committed,
};

/// Adds rigs, their joint entities and the edit path.
pub struct DocumentPlugin;

impl Plugin for DocumentPlugin {
    fn build(&self, app: &mut App) {
        configure_sets(app);
        app.init_resource::<UidSource>()
            .add_message::<EditRequest>()
            .add_message::<Edited>()
            .add_message::<EditRefused>()
            .add_systems(Update, (apply_edits.in_set(RigSystems::Edits), follow_rigs.in_set(RigSystems::Build)));
    }
}

/// Everything a rig entity carries besides its [`Rig`].
#[derive(Bundle, Default)]
pub struct RigBundle {
    /// The document.
    pub rig: Rig,
    /// Where the rig stands in the world.
    pub transform: Transform,
    /// What is selected.
    pub selection: Selection,
    /// What a click would pick.
    pub hovered: Hovered,
    /// Live mirroring.
    pub symmetry: Symmetry,
    /// Undo and redo.
    pub history: RigHistory,
    /// The entities of its joints.
    pub entities: JointEntities,
}

/// The plane of live mirroring of a rig; `None` while it is off.
#[derive(Component, Debug, Clone, Copy, PartialEq, Default)]
pub struct Symmetry(pub Option<MirrorPlane>);

/// The entities of a rig's joints.
#[derive(Component, Debug, Default)]
pub struct JointEntities {
    entities: HashMap<Uid, Entity>,
    /// The offsets of the document that the joints' transforms were last set to.
    posed: BTreeMap<Uid, PoseOffset>,
}

impl JointEntities {
    /// The entity of a joint.
    pub fn get(&self, joint: Uid) -> Option<Entity> {
        self.entities.get(&joint).copied()
    }

    fn set_posed(&mut self, joint: Uid, offset: Option<&PoseOffset>) {
        match offset {
            Some(offset) => self.posed.insert(joint, *offset),
            None => self.posed.remove(&joint),
        };
    }
}

/// Marks an entity that stands for a joint. Its [`Transform`] is the pose, its [`RestTransform`] the rest pose.
#[derive(Component, Debug, Clone, Copy, Default)]
#[require(Transform, RestTransform)]
pub struct Joint;

/// The rig that a joint entity belongs to.
#[derive(Component, Debug, Clone, Copy)]
#[relationship(relationship_target = Joints)]
pub struct JointOf(pub Entity);

/// The joint entities of a rig.
#[derive(Component, Debug, Default)]
#[relationship_target(relationship = JointOf)]
pub struct Joints(Vec<Entity>);

/// The label of a joint entity.
#[derive(Component, Debug, Clone, PartialEq, Eq)]
pub struct NodeLabel(pub String);

/// The local group of a joint entity.
#[derive(Component, Debug, Clone, Copy, PartialEq, Eq)]
pub struct InGroup(pub Uid);

/// Asks for one change of a rig. Requests are carried out in the order they are sent.
#[derive(Message, Debug, Clone)]
pub struct EditRequest {
    /// The rig.
    pub rig: Entity,
    /// What to do.
    pub change: Change,
}

/// What an [`EditRequest`] does.
#[derive(Debug, Clone)]
pub enum Change {
    /// Something new: one step of the history.
    Do(Operation),
    /// Takes the last step back.
    Undo,
    /// Does the last undone step again.
    Redo,
}

impl EditRequest {
    /// Asks for an operation.
    pub fn operation(rig: Entity, operation: Operation) -> Self {
        Self { rig, change: Change::Do(operation) }
    }
}

/// A rig was changed.
#[derive(Message, Debug, Clone)]
pub struct Edited {
    /// The rig.
    pub rig: Entity,
    /// What was done, undone or redone, in a few words.
    pub name: Cow<'static, str>,
    /// The change; `None` if the operation had nothing to do.
    pub committed: Option<Committed>,
}

/// A change was refused; the rig is as it was.
#[derive(Message, Debug, Clone)]
pub struct EditRefused {
    /// The rig that was asked for.
    pub rig: Entity,
    /// Why.
    pub reason: String,
}

/// Applies requests in the order they came.
fn apply_edits(
    mut requests: MessageReader<EditRequest>,
    mut rigs: Query<(&mut Rig, &mut Selection, &mut RigHistory, &Symmetry)>,
    mut uids: ResMut<UidSource>,
    mut edited: MessageWriter<Edited>,
    mut refused: MessageWriter<EditRefused>,
) {
    for EditRequest { rig: entity, change } in requests.read() {
        let result = match rigs.get_mut(*entity) {
            Ok((mut rig, mut selection, mut history, symmetry)) => match change {
                Change::Do(operation) => history
                    .edit(&mut rig, &mut selection, &mut uids, symmetry.0, operation)
                    .map(|recorded| (recorded.name, recorded.step.map(Committed::Done)))
                    .map_err(|error| error.to_string()),
                Change::Undo => history
                    .undo(&mut rig, &mut selection)
                    .unwrap_or_else(|| Err("there is nothing to undo".to_owned()))
                    .map(|step| (step.name.clone(), Some(Committed::Undone(step)))),
                Change::Redo => history
                    .redo(&mut rig, &mut selection)
                    .unwrap_or_else(|| Err("there is nothing to redo".to_owned()))
                    .map(|step| (step.name.clone(), Some(Committed::Redone(step)))),
            },
            Err(_) => Err(format!("entity {entity} is no rig; it may have been closed")),
        };
        match result {
            Ok((name, committed)) => {
                edited.write(Edited { rig: *entity, name, committed });
            }
            Err(reason) => {
                refused.write(EditRefused { rig: *entity, reason });
            }
        }
    }
}

/// Makes the joint entities equal to their rig: spawns, despawns, reparents, moves what moved at rest, and poses what
/// the document poses otherwise than before. As long as the document's pose stays, so does what an animation, a game or
/// a drag under way put on top of the rest pose.
fn follow_rigs(
    mut commands: Commands,
    mut rigs: Query<(Entity, &Rig, &mut JointEntities), Changed<Rig>>,
    mut joints: Query<
        (&mut Transform, &mut RestTransform, Option<&ChildOf>, Option<&NodeLabel>, Option<&InGroup>),
        With<Joint>,
    >,
) {
    for (rig_entity, rig, mut known) in &mut rigs {
        let mut gone: Vec<(Uid, Entity)> =
            known.entities.iter().filter(|(uid, _)| rig.joint(**uid).is_none()).map(|(u, e)| (*u, *e)).collect();
        gone.sort_unstable();
        for (uid, entity) in gone {
            // Children that stay have been listed below another parent by now; they must not go along.
            commands.entity(entity).detach_all_children().despawn();
            known.entities.remove(&uid);
            known.posed.remove(&uid);
        }
        for joint in rig.walk() {
            let data = &joint.data;
            let parent = joint.parent.and_then(|parent| known.get(parent)).unwrap_or(rig_entity);
            let entity = match known.get(data.uid) {
                Some(entity) => entity,
                None => {
                    let bundle = (Joint, data.uid, data.rest, rig.posed_local(data.uid), JointOf(rig_entity));
                    let entity = commands.spawn((bundle, ChildOf(parent))).id();
                    known.entities.insert(data.uid, entity);
                    known.set_posed(data.uid, rig.offset(data.uid));
                    entity
                }
            };
            let Ok((mut pose, mut rest, child_of, label, group)) = joints.get_mut(entity) else {
                describe(&mut commands.entity(entity), data.label.as_deref(), data.group, None, None);
                continue;
            };
            let offset = rig.offset(data.uid);
            if known.posed.get(&data.uid) != offset {
                *pose = rig.posed_local(data.uid);
                known.set_posed(data.uid, offset);
            } else if *rest != data.rest {
                let before = offset.copied().unwrap_or_default();
                let is_documents = *pose == before.on(&rest);
                let offset = if is_documents { before } else { PoseOffset::between(&rest, &pose) };
                *pose = offset.on(&data.rest);
            }
            if *rest != data.rest {
                *rest = data.rest;
            }
            if child_of.is_none_or(|child_of| child_of.parent() != parent) {
                commands.entity(entity).insert(ChildOf(parent));
            }
            describe(&mut commands.entity(entity), data.label.as_deref(), data.group, label, group);
        }
    }
}

fn describe(
    entity: &mut EntityCommands,
    label: Option<&str>,
    group: Option<Uid>,
    old_label: Option<&NodeLabel>,
    old_group: Option<&InGroup>,
) {
    match label {
        Some(label) if old_label.is_none_or(|old| old.0 != label) => {
            entity.insert((NodeLabel(label.to_owned()), Name::new(label.to_owned())));
        }
        None if old_label.is_some() => {
            entity.remove::<(NodeLabel, Name)>();
        }
        _ => {}
    }
    match group {
        Some(group) if old_group.is_none_or(|old| old.0 != group) => {
            entity.insert(InGroup(group));
        }
        None if old_group.is_some() => {
            entity.remove::<InGroup>();
        }
        _ => {}
    }
}
