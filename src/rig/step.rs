//! Steps: what one gesture did to a rig, whole, so that it can be taken back, done again, kept in a file and replayed.

use std::{borrow::Cow, fmt, sync::Arc, time::Duration};

use crate::rig::{EditError, Rig, RigEdit, Uid};

/// Edits that were applied together, and the selection around them.
#[derive(Clone, PartialEq)]
pub struct Step {
    /// What was done, in a few words.
    pub name: Cow<'static, str>,
    /// The edits, in the order they were applied.
    pub forward: Vec<RigEdit>,
    /// The edits that take them back, in the order to apply them.
    pub backward: Vec<RigEdit>,
    /// What was selected before.
    pub before: Vec<Uid>,
    /// What was selected afterwards.
    pub after: Vec<Uid>,
}

/// Short, because weights inside would fill pages.
impl fmt::Debug for Step {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Step({:?}, {} edits)", self.name, self.forward.len())
    }
}

/// A change that has been made to a rig and its history.
#[derive(Debug, Clone, PartialEq)]
pub enum Committed {
    /// Something new: what had been undone can no longer be done again.
    Done(Arc<Step>),
    /// The last step in effect was taken back.
    Undone(Arc<Step>),
    /// The last step taken back was done again.
    Redone(Arc<Step>),
}

impl Committed {
    /// The step that was done, undone or redone.
    pub fn step(&self) -> &Arc<Step> {
        match self {
            Self::Done(step) | Self::Undone(step) | Self::Redone(step) => step,
        }
    }

    /// The edits that were applied, in order, and what was selected afterwards.
    pub fn effect(&self) -> (&[RigEdit], &[Uid]) {
        match self {
            Self::Done(step) | Self::Redone(step) => (&step.forward, &step.after),
            Self::Undone(step) => (&step.backward, &step.before),
        }
    }
}

/// Takes what is committed to a safe place, in order. Every function returns at once but [`StepSink::flush`].
pub trait StepSink: Send + Sync {
    /// Takes one change.
    fn record(&self, committed: Committed);

    /// The reason why changes do not reach their place at the moment; `None` while all is well.
    fn trouble(&self) -> Option<Arc<str>>;

    /// Waits until everything recorded so far is safe, at most for `limit`; else says why it is not.
    fn flush(&self, limit: Duration) -> Result<(), String>;
}

/// The steps of a history.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Timeline {
    /// Steps in effect, oldest first.
    pub done: Vec<Arc<Step>>,
    /// Steps taken back; the last one is done again first.
    pub undone: Vec<Arc<Step>>,
}

impl Timeline {
    /// Follows a change. A step that is not known yet (it was done before the timeline began) takes its place in it.
    pub fn follow(&mut self, committed: &Committed) {
        match committed {
            Committed::Done(step) => {
                self.undone.clear();
                self.done.push(step.clone());
            }
            Committed::Undone(step) => {
                if self.undoes(step) {
                    self.done.pop();
                }
                self.undone.push(step.clone());
            }
            Committed::Redone(step) => {
                if self.redoes(step) {
                    self.undone.pop();
                }
                self.done.push(step.clone());
            }
        }
    }

    /// True if undoing would take back this very step.
    pub fn undoes(&self, step: &Arc<Step>) -> bool {
        self.done.last().is_some_and(|last| Arc::ptr_eq(last, step))
    }

    /// True if redoing would do this very step.
    pub fn redoes(&self, step: &Arc<Step>) -> bool {
        self.undone.last().is_some_and(|next| Arc::ptr_eq(next, step))
    }
}

/// A rig after a replay.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Replayed {
    /// The document.
    pub rig: Rig,
    /// What was selected after the last change; `None` if there was none.
    pub selection: Option<Vec<Uid>>,
    /// The history of the replayed changes.
    pub timeline: Timeline,
    /// How many changes are in the document.
    pub applied: usize,
    /// Why the change after those could not be made; it and all later ones are missing.
    pub refused: Option<EditError>,
}

/// Makes changes on `rig` again. The first `contained` of them are in it already and only become history.
///
/// A change that the rig refuses ends the replay; it is then left out as a whole.
pub fn replay(mut rig: Rig, changes: &[Committed], contained: usize) -> Replayed {
    let mut replayed = Replayed::default();
    for (number, committed) in changes.iter().enumerate() {
        let (edits, selection) = committed.effect();
        if number >= contained {
            // As one edit, so that a refusal leaves nothing half done.
            if let Err(error) = rig.apply(&RigEdit::Batch(edits.to_vec())) {
                replayed.refused = Some(error);
                break;
            }
        }
        replayed.timeline.follow(committed);
        replayed.selection = Some(selection.to_vec());
        replayed.applied += 1;
    }
    Replayed { rig, ..replayed }
}

/// The edits that make an empty rig with the same uid equal to `rig`.
pub fn edits_from_empty(rig: &Rig) -> Vec<RigEdit> {
    let last = u32::MAX as usize;
    let mut edits = vec![RigEdit::SetAbout(Box::new(rig.about().clone()))];
    edits.extend(rig.groups().iter().map(|group| RigEdit::AddLocalGroup(group.clone(), last)));
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
    edits
}
