//! Making the rig of a journal again, across the gaps of a damaged one too.
//!
//! A whole journal is replayed as it is. After a gap, each change is made if the rig still takes it; a step is taken as a
//! whole or not at all, and whatever takes back or repeats a step that could not be made is left out with it. From the gap
//! on, the edits that take a step back are those that really do, so that every undo leads to a state that was there.

use std::{borrow::Cow, collections::HashMap, sync::Arc};

use super::{Basis, Content, Origin, Recovered};
use crate::rig::{
    EditError, Rig, RigEdit, Uid,
    step::{Committed, Replayed, Step, UndoStacks, replay},
};

/// A change that is sound but could not be made again.
#[derive(Debug, Clone, PartialEq)]
pub struct Skipped {
    /// Its index in [`Recovered::changes`].
    pub change: usize,
    /// The name of its step.
    pub name: Cow<'static, str>,
    /// Reason.
    pub why: SkipReason,
}

/// Reason why a change was left out.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum SkipReason {
    /// The rig refuses one of its edits, because what they need is lost.
    #[error(transparent)]
    Refused(#[from] EditError),
    /// The weights that it would put back are lost.
    #[error("the weights that it puts back are lost")]
    Weights,
}

/// A journal made into a rig again, and what [`Journal::resume`](super::Journal::resume) needs to go on with it.
#[derive(Debug, Clone, PartialEq)]
pub struct Restored {
    /// The rig, what was selected, and its history.
    pub replayed: Replayed,
    /// Changes that were left out, all after a gap.
    pub skipped: Vec<Skipped>,
    /// Content of the next journal.
    pub(super) content: Content,
    /// Number of those changes that the project holds.
    pub(super) contained: Contained,
}

/// Number of changes of a restored journal that its project holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Contained {
    /// As many as the marks of the journal say.
    Marked,
    /// This many.
    Counted(usize),
    /// None: the journal does not stand on a saved project.
    Nothing,
}

impl Recovered {
    /// Makes the rig as it was: on the journal's own rig (an empty one if it has none) for [`Basis::Journal`], else on
    /// `project`, the rig that the project file holds now.
    pub fn restore(&self, basis: Basis, project: Option<Rig>) -> Restored {
        let (rig, contained) = match basis {
            Basis::Journal => (self.base().cloned().unwrap_or_default(), 0),
            Basis::Project { contained } => (project.unwrap_or_default(), contained.min(self.changes().len())),
            Basis::Changed => (project.unwrap_or_default(), 0),
        };
        let mut content = self.content.clone();
        if content.origin == Origin::Unknown {
            content.origin = Origin::Empty;
        }
        let exact = self.gaps.iter().filter(|gap| gap.loses()).map(|gap| gap.changes).min().unwrap_or(usize::MAX);
        if exact >= self.changes().len() {
            let replayed = replay(rig, self.changes(), contained);
            content.changes.truncate(replayed.applied);
            return Restored { replayed, skipped: Vec::new(), content, contained: Contained::Marked };
        }
        if basis == Basis::Journal {
            content.base = Some(Arc::new(rig.clone()));
        }
        // Positions are counted anew.
        content.marks.clear();
        let mut salvage = Salvage::new(self, rig);
        let (former, later) = self.changes().split_at(contained);
        // What the project holds is history only as far as it is sure.
        for committed in former.iter().filter(|_| contained <= exact) {
            salvage.follow(committed);
        }
        let former = salvage.made.len();
        for (number, committed) in later.iter().enumerate() {
            salvage.make(contained + number, committed, contained + number < exact);
        }
        content.changes = salvage.made;
        let joints = |uids: Vec<Uid>| uids.into_iter().filter(|uid| salvage.rig.joint(*uid).is_some()).collect();
        let replayed = Replayed {
            selection: salvage.selection.map(joints),
            stacks: salvage.stacks,
            applied: content.changes.len(),
            refused: None,
            rig: salvage.rig,
        };
        let contained =
            if matches!(basis, Basis::Project { .. }) { Contained::Counted(former) } else { Contained::Nothing };
        Restored { replayed, skipped: salvage.skipped, content, contained }
    }

    /// The [rig, selection and history](Restored::replayed) of [`Self::restore`] alone.
    pub fn replay(&self, basis: Basis, project: Option<Rig>) -> Replayed {
        self.restore(basis, project).replayed
    }
}

/// State of a step that the journal names.
enum State {
    /// In effect, as this step.
    Done(Arc<Step>),
    /// Taken back, as this step.
    Undone(Arc<Step>),
    /// Not made, or not taken back: whatever repeats or takes it back is left out.
    Skipped,
}

/// A rig while it is made again.
struct Salvage<'a> {
    recovered: &'a Recovered,
    rig: Rig,
    selection: Option<Vec<Uid>>,
    stacks: UndoStacks,
    /// By the address of the journal's step.
    states: HashMap<*const Step, State>,
    made: Vec<Committed>,
    skipped: Vec<Skipped>,
}

impl<'a> Salvage<'a> {
    fn new(recovered: &'a Recovered, rig: Rig) -> Self {
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

    /// A change that the rig holds already.
    fn follow(&mut self, committed: &Committed) {
        let (_, selection) = committed.effect();
        self.selection = Some(selection.to_vec());
        self.stacks.follow(committed);
        self.made.push(committed.clone());
        let step = committed.step().clone();
        let state = if matches!(committed, Committed::Undone(_)) { State::Undone(step) } else { State::Done(step) };
        self.states.insert(Arc::as_ptr(committed.step()), state);
    }

    /// Makes a change, or lists it as skipped.
    fn make(&mut self, number: usize, committed: &Committed, is_exact: bool) {
        let step = committed.step();
        let key = Arc::as_ptr(step);
        let is_undo = matches!(committed, Committed::Undone(_));
        let as_made = match (self.states.get(&key), committed) {
            (Some(State::Skipped), _) => return,
            (Some(State::Done(made)), Committed::Undone(_)) => Some(made.clone()),
            (Some(State::Undone(made)), Committed::Redone(_)) => Some(made.clone()),
            _ => None,
        };
        let source = as_made.as_ref().unwrap_or(step);
        let edits = if is_undo { &source.backward } else { &source.forward };
        let is_lost = edits.is_empty() && self.recovered.one_way.iter().any(|one| Arc::ptr_eq(one, source));
        // As one edit, so that a refusal leaves nothing half done.
        let applied = match is_lost {
            true => Err(SkipReason::Weights),
            false => self.rig.apply(&RigEdit::Batch(edits.clone())).map_err(SkipReason::Refused),
        };
        let inverse = match applied {
            Ok(inverse) => inverse,
            Err(why) => {
                self.skipped.push(Skipped { change: number, name: step.name.clone(), why });
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

    /// Entry of the history, and the state of the step. Where an undo or redo is not that of the last step any more,
    /// it becomes a step of its own, so that each step stands on those before it.
    fn entry(&self, committed: &Committed, made: Arc<Step>, inverse: RigEdit) -> (Committed, State) {
        let UndoStacks { done, undone } = &self.stacks;
        let is_known = self.states.contains_key(&Arc::as_ptr(committed.step()));
        let alone = |verb: &str, step: &Step, forward: &[RigEdit], before: &[Uid], after: &[Uid]| {
            let (name, forward) = (Cow::Owned(format!("{verb} {}", step.name)), forward.to_vec());
            let (before, after) = (before.to_vec(), after.to_vec());
            Committed::Done(Arc::new(Step { name, forward, backward: vec![inverse.clone()], before, after }))
        };
        match committed {
            Committed::Done(_) => (Committed::Done(made.clone()), State::Done(made)),
            Committed::Undone(_) if self.stacks.undoes(&made) || (!is_known && done.is_empty()) => {
                (Committed::Undone(made.clone()), State::Undone(made))
            }
            Committed::Redone(_) if self.stacks.redoes(&made) || (!is_known && undone.is_empty()) => {
                (Committed::Redone(made.clone()), State::Done(made))
            }
            Committed::Undone(_) => {
                (alone("Undo", &made, &made.backward, &made.after, &made.before), State::Undone(made))
            }
            Committed::Redone(_) => (alone("Redo", &made, &made.forward, &made.before, &made.after), State::Done(made)),
        }
    }
}
