//! What the editor asks about files, one question at a time, and the answers.

use std::path::PathBuf;

use bevy::prelude::*;

use super::{Then, template::Fit};
use crate::files::journal::PendingJournal;

/// The question that is asked now, if any.
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

    /// Counts the questions, to tell one from the next.
    pub(super) fn number(&self) -> u64 {
        self.number
    }

    /// Asks, instead of what was asked before.
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
        /// What would lose them.
        then: Then,
    },
    /// Which file to open.
    Open,
    /// Where to write.
    Path {
        /// What is written.
        purpose: Purpose,
        /// What stands in the field at first.
        suggestion: PathBuf,
        /// What goes on afterwards.
        then: Option<Then>,
    },
    /// There is a file of that name.
    Replace {
        /// What is written.
        purpose: Purpose,
        /// The file.
        path: PathBuf,
        /// What goes on afterwards.
        then: Option<Then>,
    },
    /// A template is of another size than the mesh.
    Fit(Fit),
    /// Work that a crash left.
    Recover(Vec<PendingJournal>),
}

/// What is written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Purpose {
    /// The project.
    Save,
    /// The character, its rig or its weights.
    Export,
}

/// Answers the question that is asked now.
#[derive(Message, Debug, Clone, PartialEq, Eq)]
pub struct DialogAnswer(pub Answer);

/// An answer; one that does not fit the question is as good as [`Answer::Cancel`].
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Answer {
    /// Saves, or replaces the file that is there.
    Save,
    /// Goes on without saving.
    Discard,
    /// Leaves everything as it is.
    Cancel,
    /// This file.
    Path(PathBuf),
    /// Scales the template to the mesh.
    Fit,
    /// Takes the template in its own size.
    AsItIs,
    /// Recovers the work in this journal.
    Recover(PathBuf),
    /// Throws the work in this journal away.
    Forget(PathBuf),
}
