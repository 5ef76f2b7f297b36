//! Steps: the changes of one gesture, which can be undone, redone, stored in a file and replayed.

use std::{borrow::Cow, error::Error, fmt, sync::Arc, time::Duration};

use crate::rig::{EditError, Rig, RigEdit, Uid};

/// Edits that were applied together, and the selection around them.
#[derive(Clone, PartialEq)]
pub struct Step {
    /// Description of the step, in a few words.
    pub name: Cow<'static, str>,
    /// The edits, in the order they were applied.
    pub forward: Vec<RigEdit>,
    /// Edits that undo the step, in the order in which to apply them.
    pub backward: Vec<RigEdit>,
    /// Selection before the step.
    pub before: Vec<Uid>,
    /// Selection after the step.
    pub after: Vec<Uid>,
}

impl Step {
    /// Bytes of weights that the step binds meshes with. Those that it takes away are those of an earlier step, as a rule.
    pub fn weight_bytes(&self) -> usize {
        self.forward.iter().map(RigEdit::weight_bytes).sum()
    }
}

/// The debug form is short, because weights would fill pages.
impl fmt::Debug for Step {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Step({:?}, {} edits)", self.name, self.forward.len())
    }
}

/// A change that has been made to a rig, with its place in the history.
#[derive(Debug, Clone, PartialEq)]
pub enum Commit {
    /// A new step: undone steps can no longer be redone.
    Done(Arc<Step>),
    /// The last step in effect was undone.
    Undone(Arc<Step>),
    /// The last undone step was redone.
    Redone(Arc<Step>),
}

impl Commit {
    /// The step that was done, undone or redone.
    pub fn step(&self) -> &Arc<Step> {
        match self {
            Self::Done(step) | Self::Undone(step) | Self::Redone(step) => step,
        }
    }

    /// The applied edits, in order, and the selection after them.
    pub fn effect(&self) -> (&[RigEdit], &[Uid]) {
        match self {
            Self::Done(step) | Self::Redone(step) => (&step.forward, &step.after),
            Self::Undone(step) => (&step.backward, &step.before),
        }
    }
}

/// Sink of committed changes, which stores them safely and in order. Every function but [`StepSink::flush`] returns at
/// once.
pub trait StepSink: Send + Sync {
    /// Takes one change.
    fn record(&self, committed: Commit);

    /// The reason why changes cannot be stored at the moment, the same one for as long as it lasts; `None` while they
    /// can.
    fn trouble(&self) -> Option<SinkError>;

    /// Waits until all recorded changes are stored, at most for `limit`; returns the reason if they are not.
    fn flush(&self, limit: Duration) -> Result<(), SinkError>;
}

/// Reason why a sink does not store changes: an error of the sink's own type. Two are equal if they are the same
/// occurrence.
#[derive(Debug, Clone, thiserror::Error)]
#[error("{0}")]
pub struct SinkError(Arc<dyn Error + Send + Sync>);

impl SinkError {
    /// Wraps an error of a sink.
    pub fn new(error: Arc<impl Error + Send + Sync + 'static>) -> Self {
        Self(error)
    }

    /// The error of the sink, to be downcast to the sink's own type.
    pub fn get(&self) -> &(dyn Error + Send + Sync + 'static) {
        self.0.as_ref()
    }
}

impl PartialEq for SinkError {
    fn eq(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.0, &other.0)
    }
}

impl Eq for SinkError {}

/// The steps of a history.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct UndoStacks {
    /// Steps in effect, oldest first.
    pub done: Vec<Arc<Step>>,
    /// Undone steps; the last one is redone first.
    pub undone: Vec<Arc<Step>>,
}

impl UndoStacks {
    /// Follows a change. An unknown step (one done before the stacks began) is inserted.
    pub fn follow(&mut self, committed: &Commit) {
        match committed {
            Commit::Done(step) => {
                self.undone.clear();
                self.done.push(step.clone());
            }
            Commit::Undone(step) => {
                if self.undoes(step) {
                    self.done.pop();
                }
                self.undone.push(step.clone());
            }
            Commit::Redone(step) => {
                if self.redoes(step) {
                    self.undone.pop();
                }
                self.done.push(step.clone());
            }
        }
    }

    /// Returns `true` if undoing would undo this very step.
    pub fn undoes(&self, step: &Arc<Step>) -> bool {
        self.done.last().is_some_and(|last| Arc::ptr_eq(last, step))
    }

    /// Returns `true` if redoing would redo this very step.
    pub fn redoes(&self, step: &Arc<Step>) -> bool {
        self.undone.last().is_some_and(|next| Arc::ptr_eq(next, step))
    }
}

/// A rig after a replay.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Replay {
    /// The document.
    pub rig: Rig,
    /// Selection after the last change; `None` without changes.
    pub selection: Option<Vec<Uid>>,
    /// The history of the replayed changes.
    pub stacks: UndoStacks,
    /// Number of changes in the document.
    pub applied: usize,
    /// Error of the first change that could not be applied; this change and all later ones are missing from the
    /// document.
    pub refused: Option<EditError>,
}

/// Applies changes to `rig` again. The first `contained` of them are already in it and only become history.
///
/// A change that the rig refuses ends the replay and is left out as a whole.
pub fn replay(mut rig: Rig, changes: &[Commit], contained: usize) -> Replay {
    let mut replayed = Replay::default();
    for (number, committed) in changes.iter().enumerate() {
        let (edits, selection) = committed.effect();
        if number >= contained {
            // A single edit, so that a refusal applies no part of it.
            if let Err(error) = rig.apply(&RigEdit::Batch(edits.to_vec())) {
                replayed.refused = Some(error);
                break;
            }
        }
        replayed.stacks.follow(committed);
        replayed.selection = Some(selection.to_vec());
        replayed.applied += 1;
    }
    Replay { rig, ..replayed }
}

/// The edits that make an empty rig with the same uid equal to `rig`.
pub fn edits_from_empty(rig: &Rig) -> Vec<RigEdit> {
    let last = u32::MAX as usize;
    let mut edits = vec![RigEdit::SetAbout(Box::new(rig.about().clone()))];
    edits.extend(rig.groups().iter().map(|group| RigEdit::AddLocalGroup(group.clone(), last)));
    if !rig.inputs().is_empty() {
        edits.push(RigEdit::SetInputs(rig.inputs().to_vec()));
    }
    if !rig.dropped_parts().is_empty() {
        edits.push(RigEdit::SetDroppedParts(rig.dropped_parts().to_vec()));
    }
    edits.extend(rig.walk().map(|joint| RigEdit::AddJoint {
        joint: Box::new(joint.data.clone()),
        parent: joint.parent,
        index: last,
    }));
    edits.extend(rig.skins().map(|(mesh, skin)| RigEdit::SetSkin(mesh, Some(skin.clone()))));
    edits.extend(rig.pose().iter().map(|(joint, offset)| RigEdit::SetOffset(*joint, Some(*offset))));
    for (node, values) in rig.attribute_values() {
        let set = |(name, value): (&String, &f32)| RigEdit::SetAttributeValue(*node, name.clone(), Some(*value));
        edits.extend(values.iter().map(set));
    }
    edits.extend(rig.stored_poses().iter().map(|pose| RigEdit::AddStoredPose(Box::new(pose.clone()), last)));
    edits.extend(rig.clips().iter().map(|clip| RigEdit::AddClip(Box::new(clip.clone()), last)));
    if !rig.selection_sets().is_empty() {
        edits.push(RigEdit::SetSelectionSets(rig.selection_sets().to_vec()));
    }
    edits.extend(rig.face_cuts().iter().map(|(mesh, cut)| RigEdit::SetFaceCut(*mesh, Some(*cut))));
    edits
}
