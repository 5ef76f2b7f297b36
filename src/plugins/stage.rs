//! Stages of a rig: its skeleton alone, the skeleton being edited, built, or deleted; forwards and backwards at any time.
//!
//! A [`StageRequest`] brings a rig to a [`RigStage`]. The tags stay in the document at every stage, and poses, stored poses
//! and weights stay with it; deleting is a step of the history, so that undoing it, or asking for another stage, brings the
//! rig back as it was.

use std::sync::Arc;

use bevy::prelude::*;

use super::{
    RigSystems,
    commands::{BuildRequest, BuildStep, Processor},
    configure_sets,
    document::{Change, EditReport, EditRequest, ShowRest},
    history::RigHistory,
};
use crate::rig::{
    Rig, RigEdit, Uid,
    operations::Operation,
    step::{Commit, Step},
};

/// Name of the step that deletes a rig.
pub const DELETE: &str = "Delete rig";

/// Name of the step that brings a deleted rig back after other steps.
pub const RESTORE: &str = "Restore rig";

/// Plugin of stages.
pub struct StagePlugin;

impl Plugin for StagePlugin {
    fn build(&self, app: &mut App) {
        configure_sets(app);
        app.register_required_components::<Rig, Deletions>();
        app.add_message::<StageRequest>().add_systems(
            Update,
            (
                carry_out.after(RigSystems::Gesture).before(RigSystems::Edits),
                (follow_steps, follow_builds).chain().in_set(RigSystems::Bind),
            ),
        );
    }
}

/// Stage of a rig; on rigs that are built, or that a [`StageRequest`] has been sent for. Other code reads it.
#[derive(Component, Reflect, Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[component(immutable)]
#[reflect(Component)]
pub enum RigStage {
    /// The joints of the template in their pose; no command is in effect.
    Skeleton,
    /// The joints at rest, to be edited; no command is in effect, and none runs after an edit.
    Edit,
    /// All commands are in effect, and follow every edit.
    Built,
    /// The joints and their tags are deleted; the name, the stored poses and the weights are left; see [`DELETE`].
    Deleted,
}

impl RigStage {
    /// All stages, in their order.
    pub const ALL: [Self; 4] = [Self::Skeleton, Self::Edit, Self::Built, Self::Deleted];

    /// Name for people.
    pub fn name(self) -> &'static str {
        match self {
            Self::Skeleton => "Skeleton",
            Self::Edit => "Edit",
            Self::Built => "Built",
            Self::Deleted => "Deleted",
        }
    }

    /// True if a request for this stage changes nothing: the rig is at it, and commands were not stepped since.
    pub fn is_kept(self, now: Option<Self>, processor: Option<&Processor>) -> bool {
        let are_in_effect =
            |processor: &Processor| processor.follows() && processor.builder().cursor() == processor.builder().len();
        let are_rolled_back = |processor: &Processor| !processor.follows() && processor.builder().cursor() == 0;
        now == Some(self)
            && match self {
                Self::Skeleton | Self::Edit => processor.is_none_or(are_rolled_back),
                Self::Built => processor.is_some_and(are_in_effect),
                Self::Deleted => true,
            }
    }
}

/// Asks for a rig to be brought to a stage.
#[derive(Message, Debug, Clone, Copy, PartialEq, Eq)]
pub struct StageRequest {
    /// The rig.
    pub rig: Entity,
    /// The stage.
    pub stage: RigStage,
}

/// Steps that deleted a rig or brought it back.
#[derive(Component, Default)]
pub struct Deletions {
    /// Steps, each with the deletion that is in effect after it, and before it.
    steps: Vec<Crossing>,
    /// The deletion that is in effect.
    current: Option<Arc<Step>>,
    /// Stage before the deletion.
    before: Option<RigStage>,
}

struct Crossing {
    step: Arc<Step>,
    before: Option<Arc<Step>>,
    after: Option<Arc<Step>>,
}

fn carry_out(
    mut requests: MessageReader<StageRequest>,
    rigs: Query<(&Rig, &RigHistory, &Deletions, Has<Processor>)>,
    mut edits: MessageWriter<EditRequest>,
    mut builds: MessageWriter<BuildRequest>,
    mut commands: Commands,
) {
    for StageRequest { rig: entity, stage } in requests.read().copied() {
        let Ok((rig, history, deletions, is_built)) = rigs.get(entity) else {
            warn!("entity {entity} is no rig and has no stages; it may have been closed");
            continue;
        };
        if stage == RigStage::Deleted {
            if deletions.current.is_none() {
                let operation = Operation::Named { name: DELETE, edits: deleting(rig) };
                edits.write(EditRequest::operation(entity, operation));
            }
            continue;
        }
        if let Some(deletion) = &deletions.current {
            let is_last = history.last().is_some_and(|last| Arc::ptr_eq(last, deletion));
            let change = if is_last {
                Change::Undo
            } else {
                Change::Do(Operation::Named { name: RESTORE, edits: deletion.backward.clone() })
            };
            edits.write(EditRequest { rig: entity, change });
        }
        let steps: &[BuildStep] = match stage {
            RigStage::Built => &[BuildStep::Follow(true), BuildStep::All],
            // Of a rig without a processor no command is in effect.
            _ if !is_built => &[BuildStep::Follow(false)],
            _ => &[BuildStep::Follow(false), BuildStep::RollBack],
        };
        // The first request makes the processor; a second one in the same frame would make another.
        let steps = if is_built { steps } else { &steps[steps.len() - 1..] };
        builds.write_batch(steps.iter().map(|step| BuildRequest { rig: entity, step: step.clone() }));
        commands.entity(entity).try_insert((stage, ShowRest(stage == RigStage::Edit)));
    }
}

/// Edits that take away all joints, lowest first, and the groups and inputs.
fn deleting(rig: &Rig) -> Vec<RigEdit> {
    let joints: Vec<Uid> = rig.walk().map(|joint| joint.data.uid).collect();
    let mut edits: Vec<RigEdit> = joints.into_iter().rev().map(RigEdit::RemoveJoint).collect();
    edits.extend(rig.groups().iter().map(|group| RigEdit::RemoveLocalGroup(group.uid)));
    if !rig.inputs().is_empty() {
        edits.push(RigEdit::SetInputs(Vec::new()));
    }
    edits
}

/// Follows deletions through the history.
fn follow_steps(
    mut edited: MessageReader<EditReport>,
    mut rigs: Query<(&mut Deletions, Option<&RigStage>)>,
    mut commands: Commands,
) {
    for EditReport { rig, name, committed, .. } in edited.read() {
        let (Ok((mut deletions, stage)), Some(committed)) = (rigs.get_mut(*rig), committed) else { continue };
        let step = committed.step();
        let was_deleted = deletions.current.is_some();
        if matches!(committed, Commit::Done(_)) && (*name == DELETE || *name == RESTORE) {
            let before = deletions.current.take();
            let after = (*name == DELETE).then(|| step.clone());
            deletions.current.clone_from(&after);
            deletions.steps.push(Crossing { step: step.clone(), before, after });
        } else if let Some(crossing) = deletions.steps.iter().find(|known| Arc::ptr_eq(&known.step, step)) {
            let is_undone = matches!(committed, Commit::Undone(_));
            let current = if is_undone { crossing.before.clone() } else { crossing.after.clone() };
            deletions.current = current;
        }
        match (was_deleted, deletions.current.is_some()) {
            (false, true) => {
                deletions.before = stage.copied();
                commands.entity(*rig).try_insert(RigStage::Deleted);
            }
            // Undone by hand; a request has said its stage already.
            (true, false) if stage == Some(&RigStage::Deleted) => {
                commands.entity(*rig).try_insert(deletions.before.unwrap_or(RigStage::Skeleton));
            }
            _ => {}
        }
    }
}

/// Follows what other requests do to builds: a rig that follows its edits is built.
fn follow_builds(rigs: Query<(Entity, &Processor, Option<&RigStage>), Changed<Processor>>, mut commands: Commands) {
    for (rig, processor, stage) in &rigs {
        let mut entity = commands.entity(rig);
        match (processor.follows(), stage) {
            (true, None) => {
                entity.try_insert(RigStage::Built);
            }
            (true, Some(RigStage::Skeleton | RigStage::Edit)) => {
                entity.try_insert((RigStage::Built, ShowRest(false)));
            }
            (false, None) => {
                entity.try_insert(RigStage::Skeleton);
            }
            _ => {}
        }
    }
}
