//! Results of background jobs: each is committed to the document that it was computed for, or dropped.
//!
//! A job (weights, a face) starts from a document that people go on editing. Committing its result is a step of the
//! history, and a step that is committed after an undo cuts off what could be done again. So a result waits while
//! something can be redone, and while a drag is under way; and it is dropped, with a message, once the joints that it
//! was computed from are others for good. Weights are dropped, too, where those of the mesh were painted meanwhile.

use std::sync::Arc;

use bevy::prelude::*;

use super::history::RigHistory;
use crate::rig::{NodeKind, Rig, SkinData, Uid};

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

/// The decision about a finished job.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum JobOutcome {
    /// The result is committed.
    Commit,
    /// The result waits: steps can be redone, or a drag is under way.
    Hold,
    /// The base of the result has changed, and no undone step can restore it.
    Drop,
}

/// Decides about the result of a job; `is_as_before` tells whether the document is still as the job found it.
pub(super) fn landing(history: &RigHistory, is_as_before: impl FnOnce() -> bool) -> JobOutcome {
    if history.is_previewing() || history.can_redo() {
        JobOutcome::Hold
    } else if is_as_before() {
        JobOutcome::Commit
    } else {
        JobOutcome::Drop
    }
}
