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
use super::{
    RigSystems, configure_sets,
    history::{Recorded, RigHistory},
};
use crate::rig::{
    PoseOffset, RestTransform, Rig, Uid, UidSource,
    feature::FeatureKinds,
    operations::{MirrorPlane, Operation},
    step::Committed,
};

/// Adds rigs, their joint entities and the edit path.
pub struct DocumentPlugin;

impl Plugin for DocumentPlugin {
    fn build(&self, app: &mut App) {
        configure_sets(app);
        app.init_resource::<UidSource>()
            .init_resource::<FeatureKinds>()
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
    /// Whether its pose is shown.
    pub show_rest: ShowRest,
}

/// True to show a rig at rest whatever its pose, which stays in the document: while the rest pose is edited.
#[derive(Component, Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct ShowRest(pub bool);

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
    /// Shows what an operation would do, for as long as a drag lasts: in the rig, but in neither history nor journal. The
    /// next preview starts from the rig as it was before this one; any other change takes it back first.
    Preview(Operation),
    /// Makes what is previewed one step of the history; does nothing if nothing is.
    Commit,
    /// Takes back what is previewed; does nothing if nothing is.
    CancelPreview,
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
    /// The change; `None` if the operation had nothing to do, or is only previewed.
    pub committed: Option<Committed>,
    /// True if something is only previewed, or was and no longer is.
    pub preview: bool,
    /// What people should know about it, a sentence each: copied tags that had no place, for example.
    pub notes: Vec<String>,
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
        let rig = *entity;
        let Ok((mut document, mut selection, mut history, symmetry)) = rigs.get_mut(rig) else {
            refused.write(EditRefused { rig, reason: format!("entity {rig} is no rig; it may have been closed") });
            continue;
        };
        let done = |name, committed| Edited { rig, name, committed, preview: false, notes: Vec::new() };
        let previewed =
            |name: &'static str| Edited { rig, name: name.into(), committed: None, preview: true, notes: Vec::new() };
        let recorded = |Recorded { name, step, notes }| Edited { notes, ..done(name, step.map(Committed::Done)) };
        let result = match change {
            Change::Do(operation) => history
                .edit(&mut document, &mut selection, &mut uids, symmetry.0, operation)
                .map(recorded)
                .map_err(|error| error.to_string()),
            Change::Undo => history
                .undo(&mut document, &mut selection)
                .unwrap_or_else(|| Err("there is nothing to undo".to_owned()))
                .map(|step| done(step.name.clone(), Some(Committed::Undone(step)))),
            Change::Redo => history
                .redo(&mut document, &mut selection)
                .unwrap_or_else(|| Err("there is nothing to redo".to_owned()))
                .map(|step| done(step.name.clone(), Some(Committed::Redone(step)))),
            Change::Preview(operation) => history
                .preview(&mut document, &mut uids, symmetry.0, operation)
                .map(previewed)
                .map_err(|error| error.to_string()),
            Change::Commit | Change::CancelPreview if !history.is_previewing() => continue,
            Change::Commit => {
                let Some(step) = history.commit_preview(&mut document, &mut selection) else { continue };
                Ok(recorded(step))
            }
            Change::CancelPreview => {
                history.cancel_preview(&mut document);
                Ok(previewed("Cancel"))
            }
        };
        match result {
            Ok(message) => {
                edited.write(message);
            }
            Err(reason) => {
                refused.write(EditRefused { rig, reason });
            }
        }
    }
}

/// Makes the joint entities equal to their rig: spawns, despawns, reparents, moves what moved at rest, and poses what
/// the document poses otherwise than before (at rest while [`ShowRest`] says so). As long as the document's pose stays, so does what an animation, a game or
/// a drag under way put on top of the rest pose.
pub(super) fn follow_rigs(
    mut commands: Commands,
    mut rigs: Query<(Entity, &Rig, &mut JointEntities, Option<&ShowRest>), Or<(Changed<Rig>, Changed<ShowRest>)>>,
    mut joints: Query<
        (&mut Transform, &mut RestTransform, Option<&ChildOf>, Option<&NodeLabel>, Option<&InGroup>),
        With<Joint>,
    >,
) {
    for (rig_entity, rig, mut known, show_rest) in &mut rigs {
        let is_posed = !show_rest.is_some_and(|show_rest| show_rest.0);
        let offset_of = |joint: Uid| rig.offset(joint).filter(|_| is_posed);
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
                    let offset = offset_of(data.uid);
                    let posed = offset.copied().unwrap_or_default().on(&data.rest);
                    let bundle = (Joint, data.uid, data.rest, posed, JointOf(rig_entity));
                    let entity = commands.spawn((bundle, ChildOf(parent))).id();
                    known.entities.insert(data.uid, entity);
                    known.set_posed(data.uid, offset);
                    entity
                }
            };
            let Ok((mut pose, mut rest, child_of, label, group)) = joints.get_mut(entity) else {
                describe(&mut commands.entity(entity), data.label.as_deref(), data.group, None, None);
                continue;
            };
            let offset = offset_of(data.uid);
            if known.posed.get(&data.uid) != offset {
                *pose = offset.copied().unwrap_or_default().on(&data.rest);
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
