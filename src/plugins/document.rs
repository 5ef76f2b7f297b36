//! Rigs as entities, and the one place where they change.
//!
//! The [`Rig`] component is the document. Its groups, joints and tags stand in the world as entities of their own
//! ([`schema`](super::schema)), so that Bevy's transforms, skinning and animation work on them, and so that a game
//! finds them. An [`EditRequest`] changes the document and the entities follow; writing, spawning or despawning the
//! entities makes an edit. Both go through [`RigHistory`] in one system, the only one that changes a rig.

mod added_chains;
mod adopt;
pub(in crate::plugins) mod awaited_steps;
mod carry;
pub(in crate::plugins) mod entities;
mod error;
pub(in crate::plugins) mod follow;
mod follow_groups;
pub(in crate::plugins) mod refusals;
mod selection_operation;

use std::{borrow::Cow, sync::Arc};

use bevy::{ecs::message::MessageId, prelude::*};

pub(in crate::plugins) use self::selection_operation::chain_labels;
pub use self::{
    added_chains::ChainParent,
    entities::{GroupEntities, JointEntities, TagEntities},
    error::{ChangeError, EntityWrite, EntityWriteError},
    selection_operation::SelectionOperation,
};
use super::{
    RigSystems,
    animation::AutoKey,
    commands::{BuildResult, RigModules},
    configure_sets,
    history::{RecordedOperation, RigHistory, joint_name, quoted_name},
    runtime::despawn::allow_any_depth,
};
pub use super::{
    schema::{Joint, NodeLabel, NodeOf},
    selection::{HoveredNode, Selection},
};
use crate::rig::{
    EditError, Rig, RigEdit, Uid, UidSource,
    feature::FeatureKinds,
    operations::{MirrorPlane, Operation},
    step::Commit,
};

/// Adds rigs, their joint entities and the edit path.
pub struct DocumentPlugin;

impl Plugin for DocumentPlugin {
    fn build(&self, app: &mut App) {
        configure_sets(app);
        allow_any_depth(app);
        app.register_required_components::<Rig, Transform>();
        app.register_required_components::<Rig, Selection>();
        app.register_required_components::<Rig, HoveredNode>();
        app.register_required_components::<Rig, Symmetry>();
        app.register_required_components::<Rig, RigHistory>();
        app.register_required_components::<Rig, ShowRest>();
        app.register_required_components::<Rig, JointEntities>();
        app.register_required_components::<Rig, TagEntities>();
        app.register_required_components::<Rig, GroupEntities>();
        app.init_resource::<UidSource>()
            .init_resource::<FeatureKinds>()
            .init_resource::<entities::EntityIndex>()
            .init_resource::<adopt::EntityEdits>()
            .init_resource::<awaited_steps::AwaitedSteps>()
            .add_message::<EditRequest>()
            .add_message::<EditReport>()
            .add_message::<EditRefusal>()
            .add_message::<ChangeReport>()
            .add_systems(
                Update,
                (
                    (adopt::adopt_writes, apply_edits).chain().in_set(RigSystems::Edits),
                    (follow::follow_rigs, follow_groups::order_groups, follow::follow_tags)
                        .chain()
                        .in_set(RigSystems::Build),
                ),
            );
    }
}

/// True to show a rig at rest while its rest pose is edited. The pose stays in the document.
#[derive(Component, Reflect, Debug, Clone, Copy, PartialEq, Eq, Default)]
#[reflect(Component)]
pub struct ShowRest(pub bool);

/// Plane of live mirroring of a rig; `None` while mirroring is off.
#[derive(Component, Reflect, Debug, Clone, Copy, PartialEq, Default)]
#[reflect(Component)]
pub struct Symmetry(pub Option<MirrorPlane>);

/// Request for one change of a rig. Requests are carried out in the order in which they are sent.
///
/// Writing one gives its [`MessageId`]. All answers carry it, so that code that waits for an answer takes no other for its own.
#[derive(Message, Debug, Clone)]
pub struct EditRequest {
    /// The rig.
    pub rig: Entity,
    /// Change to make.
    pub change: Change,
}

/// Changes of an [`EditRequest`].
#[derive(Debug, Clone)]
pub enum Change {
    /// Runs an operation as one new step of the history.
    Do(Operation),
    /// Places a joint at a position of the rig's space, at rest, below the joint that is active when the request is carried
    /// out, or as a root; answered by a [`ChangeReport`], too.
    Place(Vec3),
    /// Draws a chain of joints, at rest; answered by a [`ChangeReport`], too.
    Draw {
        /// Positions of the joints in the rig's space, in their order.
        positions: Vec<Vec3>,
        /// Joint that the first one hangs on.
        parent: ChainParent,
    },
    /// Names the joint that is active when the request is carried out; answered by a [`ChangeReport`], too.
    LabelActive(String),
    /// Names the joints of the chain that ends at the joint that is active when the request is carried out, first to last; answered
    /// by a [`ChangeReport`], too.
    LabelChain(Vec<String>),
    /// Puts the joints that are selected when the request is carried out into a local group, with a colour if one is given;
    /// answered by a [`ChangeReport`], too.
    GroupSelected {
        /// Name of the group; an empty one takes the joints out of their groups.
        name: String,
        /// sRGB colour of the group.
        color: Option<[f32; 3]>,
    },
    /// Locks the weights of the joints that are selected when the request is carried out, or unlocks them; answered by a
    /// [`ChangeReport`], too.
    LockSelected(bool),
    /// Runs an operation on the joints that are selected when the request is carried out; answered by a [`ChangeReport`], too.
    OperateSelected(SelectionOperation),
    /// Selects one joint. It is no edit: undo passes over it. Answered by a [`ChangeReport`].
    Pick(JointPick),
    /// Selects the listed joints, the active one last. It is no edit: nothing answers, and undo passes over it.
    Select(Vec<Uid>),
    /// Undoes the last step; answered by a [`ChangeReport`], too.
    Undo,
    /// Redoes the last undone step; answered by a [`ChangeReport`], too.
    Redo,
    /// Previews an operation while a drag lasts: the rig changes, history and journal do not. The next preview starts
    /// from the rig as it was before this one; any other change reverts it first.
    Preview(Operation),
    /// Records the preview as one step of the history; does nothing without a preview.
    Commit,
    /// Reverts the preview; does nothing without a preview.
    CancelPreview,
}

/// Joint of a [`Change::Pick`].
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum JointPick {
    /// The joint with that uid.
    Joint(Uid),
    /// The first joint that has the label when the request is carried out.
    Label(String),
}

impl EditRequest {
    /// Request to run an operation.
    pub fn operation(rig: Entity, operation: Operation) -> Self {
        Self { rig, change: Change::Do(operation) }
    }
}

/// Message that a rig was changed.
#[derive(Message, Debug, Clone)]
pub struct EditReport {
    /// The rig.
    pub rig: Entity,
    /// Request that was carried out; `None` for writes to entities.
    pub request: Option<MessageId<EditRequest>>,
    /// Short name of the step that was done, undone or redone.
    pub name: Cow<'static, str>,
    /// Committed change; `None` if the operation had nothing to do or is only previewed.
    pub committed: Option<Commit>,
    /// True if a preview began, changed or ended.
    pub preview: bool,
    /// Notes for people, a sentence each: copied tags that found no place, for example.
    pub notes: Vec<String>,
}

impl EditReport {
    /// True if a step was made, and not one undone or redone.
    pub fn is_new_step(&self) -> bool {
        matches!(self.committed, Some(Commit::Done(_)))
    }
}

/// Answer to a [`Change::Place`], [`Change::Draw`], [`Change::LabelActive`], [`Change::LabelChain`], [`Change::GroupSelected`],
/// [`Change::LockSelected`], [`Change::OperateSelected`], [`Change::Pick`], [`Change::Undo`] or [`Change::Redo`], in the order
/// of the requests.
#[derive(Message, Debug, Clone)]
pub struct ChangeReport {
    /// The rig.
    pub rig: Entity,
    /// Request that is answered.
    pub request: MessageId<EditRequest>,
    /// Step that was made, undone or redone; or the reason of the refusal.
    pub step: Result<ReportedStep, ChangeError>,
}

/// Effect of a change that was carried out.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ReportedStep {
    /// Short name of the step.
    pub name: Cow<'static, str>,
    /// Number of joints that it added, with those of the other side.
    pub added: usize,
    /// Number of joints that the rig has after it.
    pub joints: usize,
    /// Chain of a [`Change::Draw`]; `None` for other changes.
    pub chain: Option<ReportedChain>,
    /// Name of the joint of a [`Change::Pick`], as sentences have it; `None` for other changes.
    pub picked: Option<String>,
}

/// Chain that was drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ReportedChain {
    /// Joint that the first joint hangs on; `None` for a root.
    pub parent: Option<Uid>,
    /// Last joint of the chain.
    pub tip: Option<Uid>,
}

/// Message that a change was refused; the rig stays as it was.
#[derive(Message, Debug, Clone)]
pub struct EditRefusal {
    /// Requested rig.
    pub rig: Entity,
    /// Refused request; `None` for writes to entities, and for switches that became no request.
    pub request: Option<MessageId<EditRequest>>,
    /// Reason for the refusal.
    pub reason: ChangeError,
}

/// Applies the edits that writes to entities made, then requests in the order in which they came.
fn apply_edits(
    (mut requests, mut held): (MessageReader<EditRequest>, Local<awaited_steps::HeldRequests>),
    awaited: Res<awaited_steps::AwaitedSteps>,
    mut entity_edits: ResMut<adopt::EntityEdits>,
    mut rigs: Query<(&mut Rig, &mut Selection, &mut RigHistory, &Symmetry, Option<&AutoKey>, Option<&BuildResult>)>,
    (mut uids, modules): (ResMut<UidSource>, Option<Res<RigModules>>),
    mut edited: MessageWriter<EditReport>,
    mut refused: MessageWriter<EditRefusal>,
    mut reported: MessageWriter<ChangeReport>,
) {
    let mut added = added_chains::AddedChains::default();
    let of_entities = std::mem::take(&mut entity_edits.bypass_change_detection().0).into_iter().map(|(rig, edits)| {
        let operation = Operation::Named { name: "Edit entities", edits };
        (None, EditRequest { rig, change: Change::Do(operation) })
    });
    let asked = requests.read_with_id().map(|(request, id)| (id, request.clone()));
    let due = held.due(asked, &awaited, |rig| rigs.contains(rig));
    for (request, asked) in of_entities.chain(due.into_iter().map(|(id, asked)| (Some(id), asked))) {
        let is_of_entities = request.is_none();
        let EditRequest { rig, change: requested } = &asked;
        let rig = *rig;
        let Ok((mut document, mut selection, mut history, symmetry, auto_key, built)) = rigs.get_mut(rig) else {
            refused.write(EditRefusal { rig, request, reason: ChangeError::NoRig(rig) });
            continue;
        };
        let reported_request = request.filter(|_| has_report(requested));
        let before = document.len();
        let operation;
        let bound = match requested {
            Change::Draw { positions, parent } => {
                let parent = added.parent(rig, &document, *parent, selection.active());
                Some(Operation::Chain { positions: positions.clone(), parent })
            }
            _ => on_selection(requested, &document, &selection),
        };
        let change = match bound {
            Some(bound) => {
                operation = Change::Do(bound);
                &operation
            }
            None => requested,
        };
        if let Change::Select(joints) = change {
            selection.set_if_neq(Selection(joints.clone()));
            continue;
        }
        if let Change::Pick(pick) = change {
            let step = picked(pick, &document).map(|joint| {
                selection.set_if_neq(Selection(vec![joint]));
                let picked = Some(quoted_name(&document, joint));
                ReportedStep { name: Cow::Borrowed("Pick"), added: 0, joints: before, chain: None, picked }
            });
            if let Err(reason) = &step {
                refused.write(EditRefusal { rig, request, reason: reason.clone() });
            }
            reported.write_batch(request.map(|request| ChangeReport { rig, request, step }));
            continue;
        }
        // The selection is written only where it changes.
        let mut selected = selection.clone();
        let done = |name, committed| EditReport { rig, request, name, committed, preview: false, notes: Vec::new() };
        let previewed = |name: &'static str| EditReport {
            rig,
            request,
            name: name.into(),
            committed: None,
            preview: true,
            notes: Vec::new(),
        };
        let recorded =
            |RecordedOperation { name, step, notes }| EditReport { notes, ..done(name, step.map(Commit::Done)) };
        // A write to an entity concerns that entity only; live mirroring does not apply to it.
        let plane = symmetry.0.filter(|_| !is_of_entities);
        let keyed = |operation| auto_key.map_or(Cow::Borrowed(operation), |auto_key| auto_key.keyed(operation));
        let result = match change {
            Change::Do(operation) => {
                // Titles are about what the document has without a preview.
                history.cancel_preview(&mut document);
                let title = titled(operation, &document, built);
                let operation = of_built(keyed(operation), built, is_of_entities);
                let known = (built, modules.as_deref());
                let operation = carry::carried(operation, &history.settled(&document), known, &uids, plane);
                history
                    .edit_as(title, &mut document, &mut selected, &mut uids, plane, &operation)
                    .map(recorded)
                    .map_err(ChangeError::from)
            }
            Change::Undo => history
                .undo(&mut document, &mut selected)
                .ok_or(ChangeError::NothingToUndo)
                .and_then(|undone| Ok(undone?))
                .map(|step| done(step.name.clone(), Some(Commit::Undone(step)))),
            Change::Redo => history
                .redo(&mut document, &mut selected)
                .ok_or(ChangeError::NothingToRedo)
                .and_then(|redone| Ok(redone?))
                .map(|step| done(step.name.clone(), Some(Commit::Redone(step)))),
            Change::Preview(operation) => {
                history.cancel_preview(&mut document);
                let title = titled(operation, &document, built);
                history
                    .preview(title, &mut document, &mut uids, symmetry.0, &keyed(operation))
                    .map(previewed)
                    .map_err(ChangeError::from)
            }
            Change::LabelChain(names) => Err(match selection.active() {
                Some(active) => chain_labels(&document, active, names).err().unwrap_or(ChangeError::NoActive),
                None => ChangeError::NoActive,
            }),
            Change::LabelActive(_)
            | Change::GroupSelected { .. }
            | Change::LockSelected(_)
            | Change::OperateSelected(_) => Err(ChangeError::NoActive),
            // Joints to place or draw have become an operation, and joints to select are selected.
            Change::Place(_) | Change::Draw { .. } | Change::Select(_) | Change::Pick(_) => continue,
            Change::Commit | Change::CancelPreview if !history.is_previewing() => continue,
            Change::Commit => {
                let Some(step) = history.commit_preview(&mut selected) else { continue };
                Ok(recorded(step))
            }
            Change::CancelPreview => {
                history.cancel_preview(&mut document);
                Ok(previewed("Cancel"))
            }
        };
        selection.set_if_neq(selected);
        let tip = selection.active().filter(|_| result.is_ok());
        added.note(rig, &document, requested, tip);
        if let Some(request) = reported_request {
            let chain = match (requested, change) {
                (Change::Draw { .. }, Change::Do(Operation::Chain { parent, .. })) => {
                    Some(ReportedChain { parent: *parent, tip })
                }
                _ => None,
            };
            let joints = document.len();
            let step = result.as_ref().map(|done| ReportedStep {
                name: done.name.clone(),
                added: joints.saturating_sub(before),
                joints,
                chain,
                picked: None,
            });
            reported.write(ChangeReport { rig, request, step: step.map_err(ChangeError::clone) });
        }
        match result {
            Ok(message) => {
                edited.write(message);
            }
            Err(reason) => {
                refused.write(EditRefusal { rig, request, reason });
            }
        }
    }
}

/// True for changes that a [`ChangeReport`] answers.
fn has_report(change: &Change) -> bool {
    matches!(
        change,
        Change::Place(_)
            | Change::Draw { .. }
            | Change::LabelActive(_)
            | Change::LabelChain(_)
            | Change::GroupSelected { .. }
            | Change::LockSelected(_)
            | Change::OperateSelected(_)
            | Change::Undo
            | Change::Redo
    )
}

/// Operation of a change that is about the active joint or the selected ones; `None` for all other changes, and where it needs
/// a selected joint and there is none.
fn on_selection(change: &Change, rig: &Rig, selection: &Selection) -> Option<Operation> {
    let active = selection.active();
    let selected = || active.map(|_| selection.0.clone());
    match change {
        Change::Place(position) => Some(Operation::Place { position: *position, parent: active }),
        Change::LabelActive(label) => Some(Operation::Labels(vec![(active?, label.clone())])),
        Change::LabelChain(names) => chain_labels(rig, active?, names).ok(),
        Change::GroupSelected { name, color } => {
            Some(Operation::Group { joints: selected()?, name: name.clone(), color: *color })
        }
        Change::LockSelected(locked) => Some(Operation::Lock(selected()?, *locked)),
        Change::OperateSelected(operation) => operation.on(rig, selection),
        _ => None,
    }
}

/// The joint of a pick.
fn picked(pick: &JointPick, rig: &Rig) -> Result<Uid, ChangeError> {
    match pick {
        JointPick::Joint(joint) => {
            rig.joint(*joint).map(|joint| joint.data.uid).ok_or(EditError::NoJoint(*joint).into())
        }
        JointPick::Label(label) => rig.labelled(label).ok_or_else(|| ChangeError::NoLabel(label.clone())),
    }
}

/// An operation that deletes joints, as one on the built rig, so that nothing of what was made for them stays. Lists of
/// edits say themselves what goes, but for those that writes to entities made.
fn of_built<'o>(
    operation: Cow<'o, Operation>,
    built: Option<&BuildResult>,
    is_of_entities: bool,
) -> Cow<'o, Operation> {
    let is_deletion = match &*operation {
        Operation::Delete { .. } => true,
        Operation::Named { edits, .. } => is_of_entities && deletes(edits),
        _ => false,
    };
    match built {
        Some(built) if is_deletion => {
            Cow::Owned(Operation::Built { operation: Box::new(operation.into_owned()), built: Arc::clone(&built.0) })
        }
        _ => operation,
    }
}

/// True if edits delete joints.
fn deletes(edits: &[RigEdit]) -> bool {
    edits.iter().any(|edit| match edit {
        RigEdit::RemoveJoint(_) => true,
        RigEdit::Batch(edits) => deletes(edits),
        _ => false,
    })
}

/// Title of an operation's step, with the names of joints and of nodes that commands created.
pub(crate) fn titled(operation: &Operation, rig: &Rig, built: Option<&BuildResult>) -> Cow<'static, str> {
    operation.title(rig, &|node| {
        let created = || Some(built?.0.node(node)?.name.to_string());
        joint_name(rig, node).or_else(created)
    })
}
