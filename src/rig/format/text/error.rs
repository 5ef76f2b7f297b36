//! Errors in a `.rig` file, with their lines.

use std::fmt;

use thiserror::Error;

/// Number of characters of a field that a message shows.
const SHOWN: usize = 40;
/// Number of joints of a cycle that a message lists.
const LISTED: usize = 8;

/// The fields of a `joint` line.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum JointField {
    /// The joint's own number.
    Index,
    /// The parent's number.
    Parent,
    /// First coordinate.
    X,
    /// Second coordinate.
    Y,
    /// Third coordinate.
    Z,
}

impl fmt::Display for JointField {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Index => "INDEX",
            Self::Parent => "PARENT",
            Self::X => "X",
            Self::Y => "Y",
            Self::Z => "Z",
        })
    }
}

/// Reason why a `.rig` text cannot be read, or a skeleton cannot be written as one. Lines count from 1.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum RigTextError {
    /// The text has only blank lines and comments.
    #[error("the file is empty; a rig begins with the line `rig 1`")]
    Empty,
    /// Bytes that are not UTF-8.
    #[error("line {line}: not UTF-8 text; save the file with UTF-8 encoding")]
    NotUtf8 {
        /// The line.
        line: usize,
    },
    /// The byte order mark of UTF-16.
    #[error("line 1: the file is UTF-16 text; save it with UTF-8 encoding")]
    Utf16,
    /// Content before the header.
    #[error("line {line}: found `{found}` where the header was expected; begin the file with the line `rig 1`")]
    NoHeader {
        /// The line.
        line: usize,
        /// Text at that place.
        found: String,
    },
    /// A second header.
    #[error("line {line}: a second `rig` header; keep one rig in a file")]
    SecondHeader {
        /// The line.
        line: usize,
    },
    /// A version that is no number, or never existed.
    #[error("line {line}: `{found}` is not a version of the format; write `rig 1`")]
    BadVersion {
        /// The line.
        line: usize,
        /// Text at that place.
        found: String,
    },
    /// A version that is newer than this program.
    #[error("line {line}: the file has format version {found}, and this program reads up to {supported}; update it, or save the rig as version {supported}", supported = super::VERSION)]
    NewerVersion {
        /// The line.
        line: usize,
        /// Version in the file.
        found: u64,
    },
    /// More than a version in the header.
    #[error("line {line}: unexpected `{found}` after the version; put it on a line of its own")]
    ExtraInHeader {
        /// The line.
        line: usize,
        /// Text at that place.
        found: String,
    },
    /// A line that is neither a header nor a joint.
    #[error(
        "line {line}: unknown keyword `{found}`; a line is `joint INDEX PARENT X Y Z [LABEL]`, or a comment beginning with `#`"
    )]
    UnknownKeyword {
        /// The line.
        line: usize,
        /// Text at that place.
        found: String,
    },
    /// A joint line that ends too early.
    #[error("line {line}: {field} is missing; a line is `joint INDEX PARENT X Y Z [LABEL]`")]
    MissingField {
        /// The line.
        line: usize,
        /// The first field that is missing.
        field: JointField,
    },
    /// A joint line with more than a label at its end.
    #[error("line {line}: unexpected `{found}` after LABEL; a label has no white space (write `_` instead)")]
    ExtraField {
        /// The line.
        line: usize,
        /// Text at that place.
        found: String,
    },
    /// A number that must be whole.
    #[error("line {line}: {field} is `{found}`; it must be a whole number from 0 on{}", match field { JointField::Parent => ", or -1 for a root", _ => "" })]
    NotWhole {
        /// The line.
        line: usize,
        /// The field.
        field: JointField,
        /// Text at that place.
        found: String,
    },
    /// A coordinate that is no number.
    #[error("line {line}: {field} is `{found}`, which is not a number")]
    NotNumber {
        /// The line.
        line: usize,
        /// The field.
        field: JointField,
        /// Text at that place.
        found: String,
    },
    /// A coordinate that is infinite, not a number, or too large for 32 bits.
    #[error("line {line}: {field} is `{found}`; it must be finite (up to 3.4e38)")]
    NotFinite {
        /// The line.
        line: usize,
        /// The field.
        field: JointField,
        /// Text at that place.
        found: String,
    },
    /// A label with control characters.
    #[error("line {line}: LABEL `{found}` holds control characters; remove them")]
    ControlCharacter {
        /// The line.
        line: usize,
        /// The label, with the control characters replaced.
        found: String,
    },
    /// Two joints with one number.
    #[error("line {line}: INDEX {index} is taken by line {first}; give every joint its own")]
    Duplicate {
        /// The line of the second joint.
        line: usize,
        /// The number.
        index: u64,
        /// The line of the first joint.
        first: usize,
    },
    /// A parent that is not in the file.
    #[error(
        "line {line}: PARENT of joint {index} is {parent}, and there is no joint {parent}; name an existing one, or -1 for a root"
    )]
    NoSuchParent {
        /// The line.
        line: usize,
        /// The joint.
        index: u64,
        /// Number of the parent in the joint's line.
        parent: u64,
    },
    /// Joints that are their own ancestors.
    #[error("line {line}: joints are their own ancestors ({joints}); make one of them a root with PARENT -1")]
    Cycle {
        /// The first line of the cycle.
        line: usize,
        /// The joints by number, each followed by its parent.
        joints: String,
    },
    /// A joint that is further from the joint above it than a number can hold.
    #[error("joint {joint}{} is further from its parent than a number can hold; write smaller coordinates", in_quotes(label.as_deref()))]
    FarFromParent {
        /// The joint, by its position in the list.
        joint: usize,
        /// Label of the joint.
        label: Option<String>,
    },
    /// A skeleton to be written has a parent that does not exist.
    #[error("joint {joint} has the parent {parent}, and there is no such joint; the rig was not written")]
    WriteParent {
        /// The joint, by its position in the list.
        joint: usize,
        /// Index of the parent that the joint has.
        parent: usize,
    },
    /// A skeleton to be written has joints that are their own ancestors.
    #[error("joints are their own ancestors ({joints}); the rig was not written")]
    WriteCycle {
        /// The joints, each followed by its parent.
        joints: String,
    },
    /// A skeleton to be written has a joint at no finite position.
    #[error("joint {joint} has no finite position; move it; the rig was not written")]
    WriteNotFinite {
        /// The joint, by its position in the list.
        joint: usize,
    },
}

impl RigTextError {
    /// Line of the error, counted from 1; `None` if the error has no line.
    pub fn line(&self) -> Option<usize> {
        match *self {
            Self::Empty
            | Self::FarFromParent { .. }
            | Self::WriteParent { .. }
            | Self::WriteCycle { .. }
            | Self::WriteNotFinite { .. } => None,
            Self::Utf16 => Some(1),
            Self::NotUtf8 { line }
            | Self::NoHeader { line, .. }
            | Self::SecondHeader { line }
            | Self::BadVersion { line, .. }
            | Self::NewerVersion { line, .. }
            | Self::ExtraInHeader { line, .. }
            | Self::UnknownKeyword { line, .. }
            | Self::MissingField { line, .. }
            | Self::ExtraField { line, .. }
            | Self::NotWhole { line, .. }
            | Self::NotNumber { line, .. }
            | Self::NotFinite { line, .. }
            | Self::ControlCharacter { line, .. }
            | Self::Duplicate { line, .. }
            | Self::NoSuchParent { line, .. }
            | Self::Cycle { line, .. } => Some(line),
        }
    }
}

/// A label behind the number of its joint, for messages.
fn in_quotes(label: Option<&str>) -> String {
    label.map_or_else(String::new, |label| format!(" \"{}\"", quoted(label)))
}

/// A field for messages: short, and without characters that would move a terminal's cursor.
pub(super) fn quoted(field: &str) -> String {
    let mut text: String = field.chars().take(SHOWN).map(|c| if c.is_control() { '\u{FFFD}' } else { c }).collect();
    if field.chars().nth(SHOWN).is_some() {
        text.push_str("...");
    }
    text
}

/// A cycle for messages: `3 -> 5 -> 3`.
pub(super) fn chain<T: fmt::Display>(joints: &[T]) -> String {
    let mut text: String = joints.iter().take(LISTED).map(|joint| format!("{joint} -> ")).collect();
    match joints.first() {
        Some(_) if joints.len() > LISTED => text.push_str("..."),
        Some(first) => text.push_str(&first.to_string()),
        None => {}
    }
    text
}
