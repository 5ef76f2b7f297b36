//! Results of background jobs: each is committed to the document that it was computed for, or dropped.
//!
//! A job (weights, a face, a fit, a template, motion) starts from a document that people go on editing. Committing its result
//! is a step of the history, and a step that is committed after an undo cuts off what could be done again. So every job
//! asks its landing first: a result waits while a step can be redone that was undone since the job was asked for, and
//! while a drag is under way. Steps that were undone before a person asked for the job go with its result, as with any
//! other edit; a job that nobody asked for (a mesh whose file was saved, shares of late joints) waits for them, too. Redone
//! or followed by another edit, the result lands; and it is dropped, with a message, once the joints that it was computed
//! from are others for good. Weights are dropped, too, where those of the mesh were painted meanwhile.

use std::sync::Arc;

use bevy::prelude::*;

use super::history::RigHistory;
use crate::rig::{NodeKind, Rig, SkinData, Uid, step::Step};

/// Message that the result of a background job waits, because committing it now would discard steps that can be redone.
#[derive(Message, Debug, Clone, PartialEq, Eq)]
pub struct ResultHeld {
    /// The mesh that the job is for.
    pub mesh: Entity,
    /// The reason and the way out.
    pub reason: HeldResult,
}

/// Result of a background job that waits; its text is the reason and the way out, a sentence without its full stop.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum HeldResult {
    /// Weights of a mesh.
    #[error(
        "the weights are ready, but binding them now would lose the steps that were undone; redo them, or go on \
         editing, and the weights follow if they still fit"
    )]
    Weights,
    /// A face.
    #[error(
        "the face is ready, but placing it now would lose the steps that were undone; redo them, or go on editing, and \
         the face follows if it still fits"
    )]
    Face,
    /// A fitted template.
    #[error(
        "the skeleton is fitted, but placing it now would lose the steps that were undone; redo them, or go on editing, \
         and it follows if it still fits"
    )]
    Fit,
    /// Another version of a mesh.
    #[error(
        "the mesh has changed on the disk, but taking it now would lose the steps that were undone; redo them, or go on \
         editing, and it follows"
    )]
    Mesh,
    /// A template that was read for the rig.
    #[error(
        "the template is read, but using it now would lose the steps that were undone; redo them, or go on editing, and \
         it follows; asking for another drops it"
    )]
    Template,
    /// Clips that were read from a file.
    #[error(
        "the motion is read, but importing it now would lose the steps that were undone; redo them, or go on editing, and \
         it follows; another import drops it"
    )]
    Motion,
}

impl HeldResult {
    /// The reason as a sentence.
    pub fn sentence(self) -> String {
        let reason = self.to_string();
        let mut letters = reason.chars();
        let first = letters.next().map(char::to_uppercase).into_iter().flatten();
        format!("{}{}.", first.collect::<String>(), letters.as_str())
    }
}

/// Hash of everything in a document that a job on one mesh depends on: the joints with their rest poses and, if any
/// joint is locked, the mesh's present weights.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct JobBasis(u64);

impl JobBasis {
    /// Basis of a job that starts from the document as it is now.
    pub(super) fn of(rig: &Rig, mesh: Uid) -> Self {
        // FNV-1a over words; only compared within one process.
        let mut hash = 0xcbf2_9ce4_8422_2325_u64;
        let mut put = |word: u64| hash = (hash ^ word).wrapping_mul(0x0000_0100_0000_01b3);
        let mut any_locked = false;
        for joint in rig.walk() {
            let rest = &joint.data.rest;
            put(joint.data.uid.0);
            put(joint.parent.map_or(0, |parent| parent.0));
            put(u64::from(joint.data.kind == NodeKind::Joint) | u64::from(joint.data.locked) << 1);
            rest.translation.to_array().iter().for_each(|number| put(u64::from(number.to_bits())));
            rest.rotation.to_array().iter().for_each(|number| put(u64::from(number.to_bits())));
            rest.scale.to_array().iter().for_each(|number| put(u64::from(number.to_bits())));
            any_locked |= joint.data.locked;
        }
        if let Some(skin) = rig.skin(mesh).filter(|_| any_locked) {
            skin.joints.iter().for_each(|joint| put(joint.0));
            skin.weights.values.iter().for_each(|weight| put(u64::from(weight.to_bits())));
            skin.weights.joints.iter().for_each(|joint| put(u64::from(*joint)));
        }
        Self(hash)
    }
}

/// State of a document that weights of one mesh are computed for: what they follow from, and the weights that they replace.
#[derive(Debug, Clone)]
pub(super) struct BindStart {
    basis: JobBasis,
    skin: Option<Arc<SkinData>>,
}

impl BindStart {
    /// State of the document as it is now.
    pub(super) fn of(rig: &Rig, mesh: Uid) -> Self {
        Self { basis: JobBasis::of(rig, mesh), skin: rig.skin(mesh).cloned() }
    }

    /// True if the document is in that state. Weights that undo and redo brought back are the same.
    pub(super) fn holds(&self, rig: &Rig, mesh: Uid) -> bool {
        let is_same = match (&self.skin, rig.skin(mesh)) {
            (Some(then), Some(now)) => Arc::ptr_eq(then, now) || then == now,
            (then, now) => then.is_none() && now.is_none(),
        };
        is_same && JobBasis::of(rig, mesh) == self.basis
    }
}

/// Place of a history: its last step and the undone ones. Those are known by the furthest of them, which only another edit
/// takes away: as many undone steps may be others.
#[derive(Debug, Clone)]
struct HistoryPlace {
    last: Option<Arc<Step>>,
    furthest: Option<Arc<Step>>,
}

impl HistoryPlace {
    fn of(history: &RigHistory) -> Self {
        Self { last: history.last().cloned(), furthest: history.undone_steps().next().cloned() }
    }

    fn is_of(&self, history: &RigHistory) -> bool {
        let is_same = |then: &Option<Arc<Step>>, now: Option<&Arc<Step>>| match (then, now) {
            (Some(then), Some(now)) => Arc::ptr_eq(then, now),
            (then, now) => then.is_none() && now.is_none(),
        };
        is_same(&self.last, history.last()) && is_same(&self.furthest, history.undone_steps().next())
    }
}

/// Landing of a job's result: when it may be committed.
#[derive(Debug, Clone)]
pub(crate) struct Landing {
    from: HistoryPlace,
    /// True if a person asked for the job.
    is_asked: bool,
    /// True if it was told that the result waits.
    is_told: bool,
}

/// The decision about a finished job.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum JobOutcome {
    /// The result is committed.
    Commit,
    /// The result waits: steps can be redone, or a drag is under way.
    Hold {
        /// True if it has to be told that steps can be redone.
        is_news: bool,
    },
    /// The base of the result has changed, and no undone step can restore it.
    Drop,
}

impl Landing {
    /// Landing of a job that is asked for now.
    pub fn asked(history: &RigHistory) -> Self {
        Self { from: HistoryPlace::of(history), is_asked: true, is_told: false }
    }

    /// Landing of a job that starts by itself.
    pub fn unasked(history: &RigHistory) -> Self {
        Self { is_asked: false, ..Self::asked(history) }
    }

    /// True if no step was made, undone or redone since the start, or all of that was taken back.
    #[cfg(feature = "editor")]
    pub fn is_as_at_start(&self, history: &RigHistory) -> bool {
        self.from.is_of(history)
    }

    /// True if a step would discard steps that were undone since the start.
    pub fn would_discard(&self, history: &RigHistory) -> bool {
        history.can_redo() && !(self.is_asked && self.from.is_of(history))
    }

    /// Decides about the result; `is_as_before` tells whether the document is still as the job found it.
    pub fn decide(&mut self, history: &RigHistory, is_as_before: impl FnOnce() -> bool) -> JobOutcome {
        let would_discard = self.would_discard(history);
        let was_told = std::mem::replace(&mut self.is_told, would_discard);
        if would_discard || history.is_previewing() {
            JobOutcome::Hold { is_news: would_discard && !was_told }
        } else if is_as_before() {
            JobOutcome::Commit
        } else {
            JobOutcome::Drop
        }
    }
}
