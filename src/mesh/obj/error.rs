//! Errors of OBJ files, with hints for their authors.

use super::MAX_ELEMENTS;

/// Error of reading an OBJ file.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ObjError {
    /// A line is malformed. Lines count from 1; the first bad line of the file is named, except that an index beyond
    /// the end of its list is only known to be bad after the whole file was read.
    #[error("line {line}: {problem}")]
    Line {
        /// The line, from 1. For a statement continued with `\`, its first line.
        line: u64,
        /// Problem on that line.
        problem: LineProblem,
    },
    /// The reader failed.
    #[error("reading the OBJ data failed: {0}; check the disk or the connection and try again")]
    Io(#[from] std::io::Error),
    /// A list grew past the range of 32-bit indices.
    #[error("the file holds more than {MAX_ELEMENTS} {what}; split it into several files")]
    TooMany {
        /// Name of the list.
        what: &'static str,
    },
    /// The file has neither a vertex nor a face.
    #[error("no vertices and no faces found; check that this is a Wavefront OBJ file and that it is complete")]
    NoGeometry,
    /// Arrays that were changed since they were read do not fit together any more.
    #[error(
        "the arrays do not fit together: a list has the wrong length or an index is out of range; read the file again"
    )]
    Inconsistent,
}

impl ObjError {
    /// Line of the fault, counted from 1; `None` for a fault of the whole file.
    pub fn line(&self) -> Option<u64> {
        match self {
            Self::Line { line, .. } => Some(*line),
            Self::Io(_) | Self::TooMany { .. } | Self::NoGeometry | Self::Inconsistent => None,
        }
    }
}

/// Problem on a line.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum LineProblem {
    /// A coordinate is not a number.
    #[error("`{text}` is not a number; write coordinates like 0.25 or -1e-3")]
    NotANumber {
        /// The text found, shortened.
        text: String,
    },
    /// A coordinate is NaN, infinite, or too large for a 32-bit float.
    #[error("`{text}` is not a finite 32-bit number; export the mesh again without NaN or infinite coordinates")]
    NotFinite {
        /// The text found, shortened.
        text: String,
    },
    /// A vertex, texture coordinate or normal has too few numbers.
    #[error("`{keyword}` has {found} of the {wanted} numbers it needs")]
    FewNumbers {
        /// `v`, `vt` or `vn`.
        keyword: &'static str,
        /// Number of values needed.
        wanted: usize,
        /// Number of values found.
        found: usize,
    },
    /// A face has fewer than three corners.
    #[error("a face has {corners} corners; it needs at least three (an edge is written with `l`)")]
    FewCorners {
        /// Number of corners of the face.
        corners: usize,
    },
    /// A face corner is not of the form `v`, `v/vt`, `v//vn` or `v/vt/vn`.
    #[error("`{text}` is not a face corner; write v, v/vt, v//vn or v/vt/vn with whole numbers")]
    BadCorner {
        /// The text found, shortened.
        text: String,
    },
    /// An index is 0; they count from 1, or from -1 backwards.
    #[error("a face names {list} 0; indices count from 1, or from -1 backwards")]
    ZeroIndex {
        /// `vertex`, `texture coordinate` or `normal`.
        list: &'static str,
    },
    /// An index points outside its list.
    #[error("a face names {list} {index}, but there are {count}; the file may be cut off")]
    OutOfRange {
        /// `vertex`, `texture coordinate` or `normal`.
        list: &'static str,
        /// The index.
        index: u64,
        /// Number of elements in the file.
        count: u64,
    },
    /// An index is beyond all that a file can hold.
    #[error("a face names {list} {text}, but a file holds at most {MAX_ELEMENTS}; the file may be damaged")]
    HugeIndex {
        /// `vertex`, `texture coordinate` or `normal`.
        list: &'static str,
        /// The index as the file has it, shortened.
        text: String,
    },
    /// A negative index counts back to before the first element.
    #[error("a face counts back to {missing} before the first {list}; the lines may be out of order")]
    BeforeFirst {
        /// `vertex`, `texture coordinate` or `normal`.
        list: &'static str,
        /// Distance before the first element.
        missing: u64,
    },
    /// The text is UTF-16.
    #[error("the file is UTF-16 text; save it as UTF-8 or ASCII")]
    Utf16,
    /// A line is longer than any real one.
    #[error("the line is longer than {limit} bytes; check that this is a Wavefront OBJ file")]
    TooLong {
        /// The longest line accepted, in bytes.
        limit: usize,
    },
}

/// A problem and the line it is on, counted from 0 within its block.
#[derive(Debug)]
pub(super) struct BlockError {
    pub line: u32,
    pub problem: LineProblem,
}

/// Names of the lists that corners index, for messages.
pub(super) const LISTS: [&str; 3] = ["vertex", "texture coordinate", "normal"];

/// Text for a message: printable and at most one line long.
pub(super) fn excerpt(bytes: &[u8]) -> String {
    const LONGEST: usize = 40;
    let text = String::from_utf8_lossy(&bytes[..bytes.len().min(LONGEST)]);
    let mut text: String = text.chars().map(|c| if c.is_control() { '?' } else { c }).collect();
    if bytes.len() > LONGEST {
        text.push('…');
    }
    text
}
