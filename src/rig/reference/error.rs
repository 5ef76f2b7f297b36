//! Errors in the text of a reference.

use super::NameKind;
use crate::rig::{
    Uid,
    nearest::{did_you_mean, listed_first},
};

/// Error in the text of a reference: malformed, or with a name that is unknown or ambiguous; with the place and a hint.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("reference `{text}`, byte {at}: {problem}")]
pub struct ReferenceError {
    /// The whole text.
    pub text: String,
    /// Byte offset of the error.
    pub at: usize,
    /// Kind of the error.
    pub problem: ReferenceProblem,
}

/// Kind of an error in the text of a reference.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum ReferenceProblem {
    /// The text does not start with `@`.
    #[error("a reference starts with \"@\"; write @this, @joint NAME or another source")]
    NoSigil,
    /// An unexpected piece of text.
    #[error("{found} where {expected} belongs; {advice}")]
    Unexpected {
        /// Text found.
        found: String,
        /// Text expected.
        expected: &'static str,
        /// Hint.
        advice: &'static str,
    },
    /// A word that is not allowed.
    #[error("\"{word}\" is no {what}{}", did_you_mean(word, known.iter().copied()))]
    UnknownWord {
        /// The word.
        word: String,
        /// Kind of word expected.
        what: &'static str,
        /// The allowed words.
        known: &'static [&'static str],
    },
    /// A filter that appears twice.
    #[error("\"{0}:\" is there already; keep one of the two")]
    Twice(String),
    /// A quotation mark without a closing one.
    #[error("the name that begins here has no end; close it with {0}")]
    OpenQuote(char),
    /// An unknown escape in quotes.
    #[error(
        "\"\\{0}\" is no escape; write \\\\ for a backslash, \\n for a line break, \\u{{...}} for a character's number"
    )]
    BadEscape(String),
    /// A `#` without a uid.
    #[error("\"#{0}\" is no uid; write # and 16 hexadecimal digits")]
    BadUid(String),
    /// A number that is too large.
    #[error("{0} is too large a number of a node; they count from 0")]
    BadNumber(String),
    /// A name without a uid where names are not looked up any more: those of a rig have uids once they are bound to it.
    #[error("the rig has no {kind} \"{name}\", or several; correct the name, or write NAME#UID")]
    Unbound {
        /// Kind of the named object.
        kind: NameKind,
        /// The name.
        name: String,
    },
    /// A name that does not exist.
    #[error("there is no {kind} \"{name}\"{}", did_you_mean(name, nearest))]
    Unknown {
        /// Kind of the named object.
        kind: NameKind,
        /// The name.
        name: String,
        /// Similar names that exist.
        nearest: Vec<String>,
    },
    /// A name that several objects have.
    #[error("{count} {kind}s are called \"{name}\"; write {name}#UID with one of {}", uids(candidates, *count))]
    Ambiguous {
        /// Kind of the named object.
        kind: NameKind,
        /// The name.
        name: String,
        /// Number of the objects with the name.
        count: usize,
        /// Uids of the objects with the name, without those that an error would not list.
        candidates: Vec<Uid>,
    },
    /// Several references in place of one.
    #[error("one reference is needed here, not {0}; write a single one, without +")]
    NotOne(usize),
}

/// A number past the end of a list of nodes.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("pick:{number} asks for node {number} (counted from 0) of {count}; pick a lower number, or END")]
pub struct PickError {
    /// The number.
    pub number: u32,
    /// Number of nodes.
    pub count: usize,
}

impl ReferenceError {
    pub(super) fn new(text: &str, at: usize, problem: ReferenceProblem) -> Self {
        Self { text: text.to_owned(), at, problem }
    }
}

fn uids(list: &[Uid], count: usize) -> String {
    listed_first(list.iter().map(|uid| format!("#{uid}")), count, "or")
}
