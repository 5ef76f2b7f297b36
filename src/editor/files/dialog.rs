//! Questions about files, one at a time, and their answers.

use std::path::PathBuf;

use bevy::prelude::*;

use super::{FollowUp, template::Fit};
use crate::files::journal::PendingJournal;

/// The current question, if any.
#[derive(Resource, Default)]
pub struct Dialog {
    question: Option<Question>,
    number: u64,
}

impl Dialog {
    /// The question.
    pub fn question(&self) -> Option<&Question> {
        self.question.as_ref()
    }

    /// Number of questions asked so far, which identifies the current one.
    pub(super) fn number(&self) -> u64 {
        self.number
    }

    /// Asks a question in place of the current one.
    pub fn ask(&mut self, question: Question) {
        self.question = Some(question);
        self.number += 1;
    }

    pub(super) fn take(&mut self) -> Option<Question> {
        self.question.take()
    }
}

/// A question.
#[derive(Debug, Clone)]
pub enum Question {
    /// Unsaved changes would be lost.
    Unsaved {
        /// The document's name.
        name: String,
        /// Action that would lose the changes.
        then: FollowUp,
    },
    /// Choice of a file to open.
    Open,
    /// Choice of a mesh to add to the open rig.
    Mesh,
    /// Choice of a file of motion, to put it onto the rig.
    Motion,
    /// Choice of a map of joints for motion that waits.
    JointMap,
    /// Choice of a path to write to.
    Path {
        /// Content to write.
        purpose: Purpose,
        /// Initial text of the field.
        suggestion: PathBuf,
        /// Action that follows.
        then: Option<FollowUp>,
    },
    /// A file of that name exists.
    Replace {
        /// Content to write.
        purpose: Purpose,
        /// The file.
        path: PathBuf,
        /// Action that follows.
        then: Option<FollowUp>,
    },
    /// A template has another size than the mesh.
    Fit(Fit),
    /// Work left by a crash.
    Recover(Vec<PendingJournal>),
}

/// Content to write.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Purpose {
    /// The project.
    Save,
    /// The character, its rig or its weights.
    Export,
    /// The map of joints of motion that waits.
    JointMap,
}

/// Answer to the current question.
#[derive(Message, Debug, Clone, PartialEq, Eq)]
pub struct DialogAnswer(pub Answer);

/// Answer to a question; an answer of another question counts as [`Answer::Cancel`].
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Answer {
    /// Saves, or replaces the existing file.
    Save,
    /// Proceeds without saving.
    Discard,
    /// Cancels without a change.
    Cancel,
    /// Takes this file.
    Path(PathBuf),
    /// Scales the template to the mesh.
    Fit,
    /// Keeps the template's own size.
    AsItIs,
    /// Recovers the work in this journal.
    Recover(PathBuf),
    /// Deletes the work in this journal.
    Forget(PathBuf),
}
