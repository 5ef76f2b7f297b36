//! Errors of the operating system as values.

use std::io;

/// Error of the operating system: its kind and its text, because an [`io::Error`] can neither be cloned nor compared.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{text}")]
pub struct DiskError {
    /// Kind of the error.
    pub kind: io::ErrorKind,
    /// Text of the error.
    pub text: String,
}

impl From<io::Error> for DiskError {
    fn from(error: io::Error) -> Self {
        Self { kind: error.kind(), text: error.to_string() }
    }
}
