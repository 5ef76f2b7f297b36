//! What the editor tells people: toasts, the log and the status line.

use bevy::prelude::*;

/// How much a notice matters.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Severity {
    /// Something happened.
    Info,
    /// Something was done as asked.
    Done,
    /// Something is not quite as wished.
    Warning,
    /// Something could not be done; the text says what to do.
    Error,
}

/// Something that happened: shown as a toast and kept in the log.
#[derive(Message, Debug, Clone, PartialEq, Eq)]
pub struct Notice {
    /// How much it matters.
    pub severity: Severity,
    /// One or two sentences.
    pub text: String,
    /// True to keep it out of the toasts.
    pub quiet: bool,
}

impl Notice {
    /// Something happened.
    pub fn info(text: impl Into<String>) -> Self {
        Self { severity: Severity::Info, text: text.into(), quiet: false }
    }

    /// Something was done as asked.
    pub fn done(text: impl Into<String>) -> Self {
        Self { severity: Severity::Done, text: text.into(), quiet: false }
    }

    /// Something is not quite as wished.
    pub fn warning(text: impl Into<String>) -> Self {
        Self { severity: Severity::Warning, text: text.into(), quiet: false }
    }

    /// Something could not be done.
    pub fn error(text: impl Into<String>) -> Self {
        Self { severity: Severity::Error, text: text.into(), quiet: false }
    }

    /// For the log only.
    pub fn quiet(self) -> Self {
        Self { quiet: true, ..self }
    }
}

/// The status line. Tools write it when it changes; what it says is true before the click.
#[derive(Resource, Debug, Clone, PartialEq, Eq, Default)]
pub struct StatusLine {
    /// What a click or drag would do now.
    pub hint: String,
    /// Why it cannot do what the mode is for, if so.
    pub obstacle: Option<String>,
    /// What moves, only while it moves.
    pub banner: Option<String>,
}

impl StatusLine {
    /// Says what a click would do, and nothing against it. Leaves the banner.
    pub fn say(&mut self, hint: impl Into<String>) {
        self.hint = hint.into();
        self.obstacle = None;
    }

    /// Says why a click would do nothing. Leaves the banner.
    pub fn cannot(&mut self, why: impl Into<String>) {
        self.obstacle = Some(why.into());
    }
}
