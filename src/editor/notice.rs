//! Notices for people: toasts, the log and the status line.

use std::borrow::Cow;

use bevy::prelude::*;

/// Importance of a notice.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Severity {
    /// Information about an event.
    Info,
    /// Success of a requested action.
    Done,
    /// Warning about an unwanted result.
    Warning,
    /// Failure of an action; the text says what to do.
    Error,
}

/// A notice: shown as a toast and kept in the log.
#[derive(Message, Debug, Clone, PartialEq, Eq)]
pub struct Notice {
    /// Importance.
    pub severity: Severity,
    /// Text of the notice, one or two sentences.
    pub text: String,
    /// Keeps the notice out of the toasts if `true`.
    pub quiet: bool,
    /// Panel that shows what the notice is about; the log without one.
    pub panel: Option<&'static str>,
    /// True for a text that begins with the name of a file, mesh, joint or module, which is written as it is.
    pub is_named: bool,
}

impl Notice {
    /// A notice about an event.
    pub fn info(text: impl Into<String>) -> Self {
        Self { severity: Severity::Info, text: text.into(), quiet: false, panel: None, is_named: false }
    }

    /// A notice about a success.
    pub fn done(text: impl Into<String>) -> Self {
        Self { severity: Severity::Done, text: text.into(), quiet: false, panel: None, is_named: false }
    }

    /// A warning.
    pub fn warning(text: impl Into<String>) -> Self {
        Self { severity: Severity::Warning, text: text.into(), quiet: false, panel: None, is_named: false }
    }

    /// A notice about a failure.
    pub fn error(text: impl Into<String>) -> Self {
        Self { severity: Severity::Error, text: text.into(), quiet: false, panel: None, is_named: false }
    }

    /// Names the panel that a click on the notice's toast brings forward.
    pub fn at(self, panel: &'static str) -> Self {
        Self { panel: Some(panel), ..self }
    }

    /// Restricts the notice to the log.
    pub fn quiet(self) -> Self {
        Self { quiet: true, ..self }
    }

    /// Leaves the first letter as it is: the text begins with a name.
    pub fn named(self) -> Self {
        Self { is_named: true, ..self }
    }

    /// The text as people read it: it begins with a capital, unless it begins with a name.
    pub fn sentence(&self) -> Cow<'_, str> {
        if self.is_named { Cow::Borrowed(&self.text) } else { capitalised(&self.text) }
    }
}

/// A text with a capital at its start. A first word that is a path, the name of a file or an identifier stays as it is: it has
/// marks or digits in it.
pub fn capitalised(text: &str) -> Cow<'_, str> {
    let word = text.split_whitespace().next().unwrap_or_default();
    let word = word.trim_end_matches([':', ',', ';', '.', '!', '?']);
    let is_word = word.chars().all(|letter| letter.is_alphabetic() || matches!(letter, '-' | '\''));
    let mut letters = text.chars();
    match letters.next() {
        Some(first) if is_word && first.is_lowercase() => {
            Cow::Owned(format!("{}{}", first.to_uppercase(), letters.as_str()))
        }
        _ => Cow::Borrowed(text),
    }
}

/// A notice about the success of an edit that is asked for in the same frame: told once the edit is made, and not at all
/// if it is refused or has nothing to do.
#[derive(Message, Debug, Clone, PartialEq, Eq)]
pub struct EditNotice {
    /// The rig.
    pub rig: Entity,
    /// Title of the step that the edit makes.
    pub step: Cow<'static, str>,
    /// The notice.
    pub notice: Notice,
}

/// The status line. Tools update it when it changes, so that it describes a click before it is made.
#[derive(Resource, Debug, Clone, PartialEq, Eq, Default)]
pub struct StatusLine {
    /// Effect of a click or drag.
    pub hint: String,
    /// Reason why the mode's action is not possible, if so.
    pub obstacle: Option<String>,
    /// Description of the current movement, only while it lasts.
    pub banner: Option<String>,
}

impl StatusLine {
    /// Sets the hint and clears the obstacle. Keeps the banner.
    pub fn say(&mut self, hint: impl Into<String>) {
        self.hint = hint.into();
        self.obstacle = None;
    }

    /// Sets the obstacle. Keeps the banner.
    pub fn cannot(&mut self, why: impl Into<String>) {
        self.obstacle = Some(why.into());
    }
}
