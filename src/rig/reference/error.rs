//! What can be wrong with the text of a reference.

use super::NameKind;
use crate::rig::{
    Uid,
    nearest::{did_you_mean, listed},
};

/// A text that is no reference, or one whose names nobody knows; where, and what to do.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("reference `{text}`, byte {at}: {problem}")]
pub struct ReferenceError {
    /// The whole text.
    pub text: String,
    /// Where in it, in bytes.
    pub at: usize,
    /// What is wrong.
    pub problem: ReferenceProblem,
}

/// What is wrong with the text of a reference.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum ReferenceProblem {
    /// It does not start with `@`.
    #[error("a reference starts with \"@\"; write @this, @joint NAME or another source")]
    NoSigil,
    /// Something else belongs here.
    #[error("{found} where {expected} belongs; {advice}")]
    Unexpected {
        /// What stands there.
        found: String,
        /// What should.
        expected: &'static str,
        /// What to do.
        advice: &'static str,
    },
    /// A word that is none of the allowed ones.
    #[error("\"{word}\" is no {what}{}", did_you_mean(word, known.iter().copied()))]
    UnknownWord {
        /// The word.
        word: String,
        /// What it should be.
        what: &'static str,
        /// The allowed words.
        known: &'static [&'static str],
    },
    /// A filter that was there already.
    #[error("\"{0}:\" is there already; keep one of the two")]
    Twice(String),
    /// A quotation mark without its partner.
    #[error("the name that begins here has no end; close it with {0}")]
    OpenQuote(char),
    /// An escape in quotes that is not known.
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
    /// A name without a uid where names cannot be looked up.
    #[error("the {kind} \"{name}\" has no uid beside it; bind names to a rig first, or write NAME#UID")]
    Unbound {
        /// What it names.
        kind: NameKind,
        /// The name.
        name: String,
    },
    /// A name that nothing has.
    #[error("there is no {kind} \"{name}\"{}", did_you_mean(name, nearest))]
    Unknown {
        /// What it should name.
        kind: NameKind,
        /// The name.
        name: String,
        /// Names that there are and that come near.
        nearest: Vec<String>,
    },
    /// A name that several have.
    #[error("{} {kind}s are called \"{name}\": write {name}#UID with one of {}", candidates.len(), uids(candidates))]
    Ambiguous {
        /// What it should name.
        kind: NameKind,
        /// The name.
        name: String,
        /// Who has it.
        candidates: Vec<Uid>,
    },
    /// One reference was asked for.
    #[error("one reference is needed here, not {0}; write a single one, without +")]
    NotOne(usize),
}

/// A number past the end of the nodes there are.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("pick:{number} asks for node {number} (counted from 0) of {count}; pick a lower number, or END")]
pub struct PickError {
    /// The number.
    pub number: u32,
    /// How many nodes there are.
    pub count: usize,
}

impl ReferenceError {
    pub(super) fn new(text: &str, at: usize, problem: ReferenceProblem) -> Self {
        Self { text: text.to_owned(), at, problem }
    }
}

fn uids(list: &[Uid]) -> String {
    listed(&list.iter().map(|uid| format!("#{uid}")).collect::<Vec<_>>(), "or")
}
