//! Errors in a BVH file, with their lines.

use thiserror::Error;

/// Reason why a BVH file cannot be read. Lines count from 1.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum BvhError {
    /// Start that is not the header.
    #[error("line {line}: found `{found}` where `HIERARCHY` was expected; a BVH file begins with that word")]
    NoHierarchy {
        /// The line.
        line: usize,
        /// Text at that place.
        found: String,
    },
    /// Text of UTF-16.
    #[error("line 1: the file is UTF-16 text; save it as ASCII or UTF-8")]
    Utf16,
    /// Word that has no place there.
    #[error("line {line}: found `{found}` where {wanted} was expected; export the file again")]
    Unexpected {
        /// The line.
        line: usize,
        /// Text at that place.
        found: String,
        /// Content that belongs there, in words.
        wanted: &'static str,
    },
    /// End of the file within the hierarchy or the header of the motion.
    #[error("line {line}: the file ends where {wanted} was expected; it is cut off: export it again")]
    CutOff {
        /// The last line.
        line: usize,
        /// Content that belongs there, in words.
        wanted: &'static str,
    },
    /// Text that is no finite number within the range of a motion.
    #[error("line {line}: `{found}` is no number between -1e9 and 1e9; correct it or export the file again")]
    BadNumber {
        /// The line.
        line: usize,
        /// Text at that place.
        found: String,
    },
    /// Channel with an unknown name.
    #[error(
        "line {line}: `{found}` is no channel; there are Xposition, Yposition, Zposition, Xrotation, Yrotation and Zrotation"
    )]
    BadChannel {
        /// The line.
        line: usize,
        /// Text at that place.
        found: String,
    },
    /// Count of channels that no joint has.
    #[error("line {line}: `{found}` is no count of channels; a joint has 0 to {most}", most = super::MAX_CHANNELS)]
    BadChannelCount {
        /// The line.
        line: usize,
        /// Text at that place.
        found: String,
    },
    /// More joints than are read.
    #[error("line {line}: more than {most} joints; split the file", most = super::MAX_JOINTS)]
    TooManyJoints {
        /// The line.
        line: usize,
    },
    /// Joint without an offset.
    #[error("line {line}: the joint \"{joint}\" ends without an OFFSET; add `OFFSET x y z`")]
    NoOffset {
        /// Line of the joint's end.
        line: usize,
        /// Name of the joint.
        joint: String,
    },
    /// File without joints.
    #[error("line {line}: the hierarchy has no joint; a BVH file has a ROOT")]
    NoJoints {
        /// The line.
        line: usize,
    },
    /// Time between frames that is not above zero.
    #[error("line {line}: the frame time `{found}` is no number of seconds above zero; write for example 0.0333333")]
    BadFrameTime {
        /// The line.
        line: usize,
        /// Text at that place.
        found: String,
    },
    /// Frame with another count of values than there are channels.
    #[error(
        "line {line}: the frame has {found} values, and the joints have {wanted} channels; correct it or export the file again"
    )]
    BadFrame {
        /// The line.
        line: usize,
        /// Count of values.
        found: usize,
        /// Count of channels.
        wanted: usize,
    },
}

impl BvhError {
    /// Line of the error.
    pub fn line(&self) -> usize {
        match self {
            Self::Utf16 => 1,
            Self::NoHierarchy { line, .. }
            | Self::Unexpected { line, .. }
            | Self::CutOff { line, .. }
            | Self::BadNumber { line, .. }
            | Self::BadChannel { line, .. }
            | Self::BadChannelCount { line, .. }
            | Self::TooManyJoints { line }
            | Self::NoOffset { line, .. }
            | Self::NoJoints { line }
            | Self::BadFrameTime { line, .. }
            | Self::BadFrame { line, .. } => *line,
        }
    }
}

/// Beginning of a piece of text, for messages.
pub(super) fn quoted(bytes: &[u8]) -> String {
    let text = String::from_utf8_lossy(bytes.get(..160).unwrap_or(bytes));
    text.chars().take(40).map(|c| if c.is_control() { '\u{FFFD}' } else { c }).collect()
}
