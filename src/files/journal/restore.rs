//! Restoring the rig of a journal, across the gaps of a damaged one too.
//!
//! A whole journal is replayed as it is. After a gap, each change is made if the rig still accepts it. A step is
//! applied as a whole or not at all, and an undo or redo of a step that was left out is left out, too. From the gap on,
//! the edits that undo a step are computed from the restored rig, so that every undo leads to a state that existed.

use std::{borrow::Cow, collections::HashMap, sync::Arc};

use super::{Basis, Content, Origin, RecoveredJournal, fold::StartRig};
use crate::rig::{
    EditError, Rig, RigEdit, Uid,
    step::{Commit, Replay, Step, UndoStacks, replay},
};

/// A sound change that could not be applied.
#[derive(Debug, Clone, PartialEq)]
pub struct SkippedChange {
    /// Index of the change in [`RecoveredJournal::changes`].
    pub change: usize,
    /// Name of the change's step.
    pub name: Cow<'static, str>,
    /// Reason for leaving the change out.
    pub why: SkipReason,
}

/// Reason for leaving a change out.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum SkipReason {
    /// The rig refuses an edit of the step, because its requirements are lost.
    #[error(transparent)]
    Refused(#[from] EditError),
    /// The weights that the step would restore are lost.
    #[error("the weights that it puts back are lost")]
    Weights,
}

/// Rig restored from a journal, with the data that [`Journal::resume`](super::Journal::resume) needs to continue the
/// journal.
#[derive(Debug, Clone, PartialEq)]
pub struct RestoredRig {
    /// Rig, selection and history.
    pub replayed: Replay,
    /// Changes that were left out, all after a gap.
    pub skipped: Vec<SkippedChange>,
    /// Content of the next journal.
    pub(super) content: Content,
    /// Number of the changes in `content` that the project holds.
    pub(super) contained: SavedSteps,
    /// Rig on which the changes in `content` were made.
    pub(super) start: StartRig,
}

/// Number of changes of a restored journal that its project holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum SavedSteps {
    /// The number that the marks of the journal give.
    Marked,
    /// The given number.
    Counted(usize),
    /// Zero: the journal does not start from a saved project.
    Nothing,
}

impl RecoveredJournal {
    /// Restores the rig: on the journal's own rig (an empty one if it has none) for [`Basis::Journal`], else on
    /// `project`, the rig that the project file holds now.
    pub fn restore(&self, basis: Basis, project: Option<Rig>) -> RestoredRig {
        let (rig, contained) = match basis {
            Basis::Journal => (self.base().cloned().unwrap_or_default(), 0),
            Basis::Project { contained } => (project.unwrap_or_default(), contained.min(self.changes().len())),
            Basis::Changed => (project.unwrap_or_default(), 0),
        };
        let mut content = self.content.clone();
        if content.origin == Origin::Unknown {
            content.origin = Origin::Empty;
        }
        let mut start = StartRig { rig: Arc::new(rig.clone()), contained };
        let exact = self.gaps.iter().filter(|gap| gap.loses()).map(|gap| gap.changes).min().unwrap_or(usize::MAX);
        if exact >= self.changes().len() {
            let replayed = replay(rig, self.changes(), contained);
            content.changes.truncate(replayed.applied);
            return RestoredRig { replayed, skipped: Vec::new(), content, contained: SavedSteps::Marked, start };
        }
        if basis == Basis::Journal {
            content.base = Some(start.rig.clone());
        }
        // Positions are counted again from the start.
        content.marks.clear();
        let mut salvage = Restoration::new(self, rig);
        let (former, later) = self.changes().split_at(contained);
        // The history includes the project's changes only if all of them are certain.
        for committed in former.iter().filter(|_| contained <= exact) {
            salvage.follow(committed);
        }
        let former = salvage.made.len();
        start.contained = former;
        for (number, committed) in later.iter().enumerate() {
            salvage.make(contained + number, committed, contained + number < exact);
        }
        content.changes = salvage.made;
        let joints = |uids: Vec<Uid>| uids.into_iter().filter(|uid| salvage.rig.joint(*uid).is_some()).collect();
        let replayed = Replay {
            selection: salvage.selection.map(joints),
            stacks: salvage.stacks,
            applied: content.changes.len(),
            refused: None,
            rig: salvage.rig,
        };
        let contained =
            if matches!(basis, Basis::Project { .. }) { SavedSteps::Counted(former) } else { SavedSteps::Nothing };
        RestoredRig { replayed, skipped: salvage.skipped, content, contained, start }
    }

    /// The [rig, selection and history](RestoredRig::replayed) of [`Self::restore`] alone.
    pub fn replay(&self, basis: Basis, project: Option<Rig>) -> Replay {
        self.restore(basis, project).replayed
    }
}

/// State of a step of the journal.
enum State {
    /// The step is in effect, in the given form.
    Done(Arc<Step>),
    /// The step is undone, in the given form.
    Undone(Arc<Step>),
    /// The step was not applied, or could not be undone; later undos and redos of it are left out.
    Skipped,
}

/// Rig during restoration.
struct Restoration<'a> {
    recovered: &'a RecoveredJournal,
    rig: Rig,
    selection: Option<Vec<Uid>>,
    stacks: UndoStacks,
    /// States of steps, by the address of the journal's step.
    states: HashMap<*const Step, State>,
    made: Vec<Commit>,
    skipped: Vec<SkippedChange>,
}

impl<'a> Restoration<'a> {
    fn new(recovered: &'a RecoveredJournal, rig: Rig) -> Self {
        Self {
            recovered,
            rig,
            selection: None,
            stacks: UndoStacks::default(),
            states: HashMap::new(),
            made: Vec::new(),
            skipped: Vec::new(),
        }
    }

    /// Follows a change that the rig already holds.
    fn follow(&mut self, committed: &Commit) {
        let (_, selection) = committed.effect();
        self.selection = Some(selection.to_vec());
        self.stacks.follow(committed);
        self.made.push(committed.clone());
        let step = committed.step().clone();
        let state = if matches!(committed, Commit::Undone(_)) { State::Undone(step) } else { State::Done(step) };
        self.states.insert(Arc::as_ptr(committed.step()), state);
    }

    /// Applies a change, or lists it as skipped.
    fn make(&mut self, number: usize, committed: &Commit, is_exact: bool) {
        let step = committed.step();
        let key = Arc::as_ptr(step);
        let is_undo = matches!(committed, Commit::Undone(_));
        let as_made = match (self.states.get(&key), committed) {
            (Some(State::Skipped), _) => return,
            (Some(State::Done(made)), Commit::Undone(_)) => Some(made.clone()),
            (Some(State::Undone(made)), Commit::Redone(_)) => Some(made.clone()),
            _ => None,
        };
        let source = as_made.as_ref().unwrap_or(step);
        let edits = if is_undo { &source.backward } else { &source.forward };
        let is_lost = edits.is_empty() && self.recovered.one_way.iter().any(|one| Arc::ptr_eq(one, source));
        // A single edit, so that a refusal applies no part of it.
        let applied = match is_lost {
            true => Err(SkipReason::Weights),
            false => self.rig.apply(&RigEdit::Batch(edits.clone())).map_err(SkipReason::Refused),
        };
        let inverse = match applied {
            Ok(inverse) => inverse,
            Err(why) => {
                self.skipped.push(SkippedChange { change: number, name: step.name.clone(), why });
                self.states.insert(key, State::Skipped);
                return;
            }
        };
        let made = match as_made {
            Some(made) => made,
            None if is_exact => step.clone(),
            None if is_undo => Arc::new(Step { forward: vec![inverse.clone()], ..Step::clone(step) }),
            None => Arc::new(Step { backward: vec![inverse.clone()], ..Step::clone(step) }),
        };
        let (next, state) = self.entry(committed, made, inverse);
        self.states.insert(key, state);
        let (_, selection) = next.effect();
        self.selection = Some(selection.to_vec());
        self.stacks.follow(&next);
        self.made.push(next);
    }

    /// Entry of the history for a change, and the state of its step. An undo or redo of a step that is no longer the
    /// last one becomes a step of its own, so that each step builds on the ones before it.
    fn entry(&self, committed: &Commit, made: Arc<Step>, inverse: RigEdit) -> (Commit, State) {
        let UndoStacks { done, undone } = &self.stacks;
        let is_known = self.states.contains_key(&Arc::as_ptr(committed.step()));
        let alone = |verb: &str, step: &Step, forward: &[RigEdit], before: &[Uid], after: &[Uid]| {
            let (name, forward) = (Cow::Owned(format!("{verb} {}", step.name)), forward.to_vec());
            let (before, after) = (before.to_vec(), after.to_vec());
            Commit::Done(Arc::new(Step { name, forward, backward: vec![inverse.clone()], before, after }))
        };
        match committed {
            Commit::Done(_) => (Commit::Done(made.clone()), State::Done(made)),
            Commit::Undone(_) if self.stacks.undoes(&made) || (!is_known && done.is_empty()) => {
                (Commit::Undone(made.clone()), State::Undone(made))
            }
            Commit::Redone(_) if self.stacks.redoes(&made) || (!is_known && undone.is_empty()) => {
                (Commit::Redone(made.clone()), State::Done(made))
            }
            Commit::Undone(_) => (alone("Undo", &made, &made.backward, &made.after, &made.before), State::Undone(made)),
            Commit::Redone(_) => (alone("Redo", &made, &made.forward, &made.before, &made.after), State::Done(made)),
        }
    }
}
