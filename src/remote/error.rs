//! Reasons for refusing requests and calls.

use std::path::PathBuf;

use crate::{
    files::{AllowedError, LoadError, ReadError, StoreError},
    instance::TemplateError,
    plugins::document::ChangeError,
};

/// Reason for not listening.
#[derive(Debug, thiserror::Error)]
pub enum RemoteError {
    /// The port cannot be used.
    #[error("port {port} cannot be used for remote control: {source}; choose another, or 0 for a free one")]
    Port {
        /// The port.
        port: u16,
        /// Error of the operating system.
        source: std::io::Error,
    },
    /// The token is too easy to guess.
    #[error(
        "a token for remote control has at least {} visible ASCII characters; choose a longer one, or none for a random one",
        super::MIN_TOKEN
    )]
    Token,
    /// A folder for templates does not exist.
    #[error("a folder for remote control is missing: {0}")]
    Folder(#[from] AllowedError),
}

/// Reason for refusing a request before its body is looked at.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub(super) enum HttpRefusal {
    #[error("calls are sent with POST")]
    NotPost,
    #[error("this is no HTTP/1.1 request: {0}")]
    Malformed(&'static str),
    #[error("the head of the request is longer than {} KiB", super::http::MAX_HEAD >> 10)]
    HeadTooLarge,
    #[error("the request is for another host; call 127.0.0.1 or localhost, with the port")]
    Host,
    #[error("pages of other origins may not call")]
    Origin,
    #[error("the token is missing or wrong; send `Authorization: Bearer TOKEN`")]
    Token,
    #[error("the length of the body is missing; send `Content-Length`")]
    NoLength,
    #[error("the body is longer than {} MiB; split the call", super::http::MAX_BODY >> 20)]
    TooLarge,
    #[error("the request ends before its end")]
    Truncated,
    #[error("the request took too long to arrive")]
    Slow,
}

impl HttpRefusal {
    /// Status line of the answer, after the version.
    pub fn status(self) -> &'static str {
        match self {
            Self::NotPost => "405 Method Not Allowed",
            Self::Malformed(_) | Self::Truncated => "400 Bad Request",
            Self::HeadTooLarge => "431 Request Header Fields Too Large",
            Self::Host | Self::Origin => "403 Forbidden",
            Self::Token => "401 Unauthorized",
            Self::NoLength => "411 Length Required",
            Self::TooLarge => "413 Content Too Large",
            Self::Slow => "408 Request Timeout",
        }
    }
}

/// Reason for refusing a call; a sentence for people without its full stop.
#[derive(Debug, thiserror::Error)]
pub(super) enum CallError {
    #[error("the body is no JSON: {0}")]
    NotJson(serde_json::Error),
    #[error("this is no call: {0}; send {{\"jsonrpc\": \"2.0\", \"id\": 1, \"method\": \"rig.list\"}}")]
    NotACall(&'static str),
    #[error("there is no method \"{name}\"{hint}")]
    UnknownMethod { name: String, hint: String },
    #[error("the parameters of {method} do not fit: {source}; `rpc.discover` lists them")]
    Params { method: &'static str, source: serde_json::Error },
    #[error("{0}")]
    NotTogether(&'static str),
    #[error("there is no rig {0}; `rig.list` names them")]
    NoRig(String),
    #[error("{count} rigs are called \"{name}\"; take the number that `rig.list` gives")]
    Ambiguous { name: String, count: usize },
    #[error("rig {0} is an instance without a document, which only its template changes; use `rig.template.load`")]
    NoDocument(String),
    #[error("the change was refused: {0}")]
    Refused(ChangeError),
    #[error(transparent)]
    Path(#[from] AllowedError),
    #[error("no file of rig {0} is known; give a `path`")]
    NoFile(String),
    #[error("`{}` is no file name of a template; it ends in .rig.ron", .0.display())]
    NoTemplateName(PathBuf),
    #[error("rig {0} does not follow a template; `rig.template.load` opens one that does")]
    NoTemplate(String),
    #[error(transparent)]
    Read(#[from] ReadError),
    #[error(transparent)]
    Load(#[from] LoadError),
    #[error(transparent)]
    Template(#[from] TemplateError),
    #[error(transparent)]
    Store(#[from] StoreError),
    #[error("the app did not answer in time; nothing more is done about the call")]
    Timeout,
    #[error("the app has ended")]
    Ended,
}

impl CallError {
    /// Code of the error, as JSON-RPC and the Bevy Remote Protocol number them.
    pub fn code(&self) -> i64 {
        match self {
            Self::NotJson(_) => -32700,
            Self::NotACall(_) => -32600,
            Self::UnknownMethod { .. } => -32601,
            Self::Params { .. } | Self::NotTogether(_) => -32602,
            Self::NoRig(_) | Self::Ambiguous { .. } => -23402,
            Self::NoDocument(_) | Self::NoTemplate(_) | Self::NoFile(_) => -32001,
            Self::Path(_) | Self::NoTemplateName(_) => -32002,
            Self::Refused(_) | Self::Read(_) | Self::Load(_) | Self::Template(_) | Self::Store(_) => -32003,
            Self::Timeout | Self::Ended => -32004,
        }
    }
}
