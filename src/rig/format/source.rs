//! RON texts, and errors with their place in the text.

use ron::{Options, extensions::Extensions};
use serde::{Serialize, de::DeserializeOwned};

use super::scan::{BracketFault, bracket_fault};
use crate::rig::nearest::nearest;

/// Error in a text file, with its place.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("line {line}, column {column}: {message}")]
pub struct SourceError {
    /// 1-based line.
    pub line: usize,
    /// 1-based column, in characters.
    pub column: usize,
    /// Byte offset, for reports that show the source.
    pub offset: usize,
    /// Description of the error and its remedy.
    pub message: String,
}

/// Lines and columns of a text, for errors at thousands of its places.
pub(crate) struct TextLines<'a> {
    text: &'a str,
    /// Marks in the text, in order: byte offset, 1-based line and column.
    marks: Vec<[usize; 3]>,
}

/// Bytes from one mark to the next, but for those of one character.
const MARKED: usize = 1024;

impl<'a> TextLines<'a> {
    /// Marks a text. Time is linear in its length.
    pub(crate) fn new(text: &'a str) -> Self {
        let (mut marks, mut place, mut next) = (vec![[0, 1, 1]], [1, 1], MARKED);
        for (at, character) in text.char_indices() {
            if at >= next {
                let [line, column] = place;
                marks.push([at, line, column]);
                next = at + MARKED;
            }
            place = place_after(place, character);
        }
        Self { text, marks }
    }

    /// Error as [`SourceError::at`] makes it, in the same time wherever it is.
    pub(crate) fn error(&self, offset: usize, message: impl Into<String>) -> SourceError {
        let offset = boundary(self.text, offset);
        let number = self.marks.partition_point(|[at, ..]| *at <= offset).saturating_sub(1);
        let [from, line, column] = self.marks[number];
        let [line, column] = self.text[from..offset].chars().fold([line, column], place_after);
        SourceError { line, column, offset, message: message.into() }
    }
}

/// Line and column behind a character at a line and column.
fn place_after([line, column]: [usize; 2], character: char) -> [usize; 2] {
    if character == '\n' { [line + 1, 1] } else { [line, column + 1] }
}

/// The last place between two characters that is not behind `offset`.
fn boundary(text: &str, offset: usize) -> usize {
    (0..=offset.min(text.len())).rev().find(|o| text.is_char_boundary(*o)).unwrap_or(0)
}

impl SourceError {
    /// An error at a byte offset of `text`.
    pub fn at(text: &str, offset: usize, message: impl Into<String>) -> Self {
        let offset = boundary(text, offset);
        let before = &text[..offset];
        let line_start = before.rfind('\n').map_or(0, |at| at + 1);
        Self {
            line: before.matches('\n').count() + 1,
            column: before[line_start..].chars().count() + 1,
            offset,
            message: message.into(),
        }
    }

    /// Fault of the brackets of a text; `None` where each is closed by one of its kind.
    pub(crate) fn of_brackets(text: &str) -> Option<Self> {
        let shown = |at: usize| text[at..].chars().next().unwrap_or_default();
        Some(match bracket_fault(text)? {
            BracketFault::Open(at) => {
                let message = "the file is cut short: nothing closes what begins here; take a backup, or close it";
                Self::at(text, at, message)
            }
            BracketFault::Crossed { at, wanted } => {
                let closing = shown(at);
                let message = format!(
                    "`{closing}` stands where `{wanted}` closes the last open bracket; write `{wanted}` before it, or \
                     remove one of the two brackets"
                );
                Self::at(text, at, message)
            }
            BracketFault::Surplus(at) => {
                Self::at(text, at, format!("`{}` closes nothing; remove it, or open it before", shown(at)))
            }
        })
    }

    /// An error of the RON reader, with its remedy.
    pub(crate) fn from_ron(text: &str, error: &ron::error::SpannedError) -> Self {
        if let Some(fault) = Self::of_brackets(text) {
            return fault;
        }
        let message = match &error.code {
            ron::Error::ExceededRecursionLimit => {
                "brackets are nested too deeply for a file of this kind; close some of them".to_owned()
            }
            ron::Error::NoSuchStructField { expected, found, .. } => unknown_name("field", found, expected),
            ron::Error::NoSuchEnumVariant { expected, found, .. } => unknown_name("value", found, expected),
            ron::Error::MissingStructField { field, .. } => format!("the field `{field}` is missing; add it"),
            ron::Error::DuplicateStructField { field, .. } => {
                format!("the field `{field}` is there twice; keep one of the two")
            }
            ron::Error::Eof => format!("{}; the file is cut short: take a backup", error.code),
            code => match remedy(code) {
                Some(remedy) => format!("{code}; {remedy}"),
                None => code.to_string(),
            },
        };
        Self::at(text, byte_offset(text, error.span.start), message)
    }
}

/// Advice for a value of a wrong kind; `None` for other errors.
fn remedy(error: &ron::Error) -> Option<&'static str> {
    Some(match error {
        ron::Error::IntegerOutOfBounds => "write a whole number that fits here; counts have no sign",
        ron::Error::ExpectedInteger => "write a whole number, such as 2",
        ron::Error::ExpectedFloat => "write a number, such as 0.5",
        ron::Error::ExpectedBoolean => "write true or false",
        ron::Error::ExpectedString => "write a text in quotation marks",
        ron::Error::ExpectedArray => "write a list in square brackets",
        ron::Error::ExpectedStructLike => "write fields or numbers in round brackets",
        _ => return None,
    })
}

/// Largest number of names that are listed where none is near.
const MOST_LISTED: usize = 24;

/// Sentence about a name where only those of `known` may stand: with the nearest of these, or with all of a few.
pub(crate) fn unknown_name(what: &str, name: &str, known: &[&str]) -> String {
    let quoted = |name: &String| format!("`{name}`");
    let near = nearest(name, known, 3);
    let remedy = match (near.is_empty(), known.len()) {
        (false, _) => format!("did you mean {}?", near.iter().map(quoted).collect::<Vec<_>>().join(" or ")),
        (true, 1..=MOST_LISTED) => format!("remove it or correct its name: known are `{}`", known.join("`, `")),
        (true, _) => "remove it or correct its name".to_owned(),
    };
    format!("there is no {what} `{name}` here; {remedy}")
}

/// Place in a text that goes on from error to error: many errors in the order of the text take one pass over it.
pub(crate) struct TextPlace<'a> {
    text: &'a str,
    offset: usize,
    line: usize,
    column: usize,
}

impl<'a> TextPlace<'a> {
    /// The start of a text.
    pub fn start(text: &'a str) -> Self {
        Self { text, offset: 0, line: 1, column: 1 }
    }

    /// An error at a byte offset, as [`SourceError::at`].
    pub fn error(&mut self, offset: usize, message: impl Into<String>) -> SourceError {
        let offset = (0..=offset.min(self.text.len())).rev().find(|at| self.text.is_char_boundary(*at)).unwrap_or(0);
        if offset < self.offset {
            *self = Self::start(self.text);
        }
        let passed = &self.text[self.offset..offset];
        match passed.rfind('\n') {
            Some(end) => {
                self.line += passed.matches('\n').count();
                self.column = passed[end + 1..].chars().count() + 1;
            }
            None => self.column += passed.chars().count(),
        }
        self.offset = offset;
        SourceError { line: self.line, column: self.column, offset, message: message.into() }
    }
}

/// Options for reading all RON files of Rigsmith: `Some(...)` need not be written.
pub(crate) fn ron_options() -> Options {
    Options::default().with_default_extension(Extensions::IMPLICIT_SOME)
}

/// The text of a file that must be UTF-8, not empty and not longer than `limit` bytes; `what` names the kind of file in
/// errors.
pub(crate) fn utf8<'a>(bytes: &'a [u8], limit: usize, what: &str) -> Result<&'a str, SourceError> {
    if bytes.len() > limit {
        let message = format!(
            "the file has {} MiB, more than the {} MiB that are read: is it a {what} at all?",
            bytes.len() >> 20,
            limit >> 20
        );
        return Err(SourceError::at("", 0, message));
    }
    let bytes = bytes.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(bytes);
    let text = std::str::from_utf8(bytes).map_err(|error| {
        let before = std::str::from_utf8(&bytes[..error.valid_up_to()]).unwrap_or_default();
        SourceError::at(before, before.len(), format!("the {what} is not UTF-8 text; save it as UTF-8"))
    })?;
    if text.trim().is_empty() {
        return Err(SourceError::at(text, 0, format!("the {what} is empty; save it again or take a backup")));
    }
    Ok(text)
}

/// RON text of a value on one line. Values without maps of unusual keys, such as parameters, always have one.
pub(crate) fn ron_text<T: Serialize + ?Sized>(value: &T) -> String {
    ron_options().to_string(value).unwrap_or_default()
}

/// Reads a value from RON text.
pub(crate) fn parse_ron<T: DeserializeOwned>(text: &str) -> Result<T, SourceError> {
    ron_options().from_str(text).map_err(|error| SourceError::from_ron(text, &error))
}

/// Byte offset of a line and column that the RON reader reports.
fn byte_offset(text: &str, place: ron::error::Position) -> usize {
    let line_start: usize = text.split_inclusive('\n').take(place.line.saturating_sub(1)).map(str::len).sum();
    let line = text[line_start.min(text.len())..].chars();
    line_start + line.take(place.col.saturating_sub(1)).map(char::len_utf8).sum::<usize>()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_at_many_places_are_those_at_single_ones() {
        let text = "\u{e4}, b\n".repeat(300) + &"long ".repeat(1000) + "\n\r\nend";
        let lines = TextLines::new(&text);
        // No place is far behind a mark, whatever the length of its line.
        assert!(lines.marks.len() > 5);
        assert!(lines.marks.windows(2).all(|pair| pair[1][0] - pair[0][0] < MARKED + 4));
        for offset in (0..text.len() + 3).step_by(5).chain(text.len() - 3..text.len() + 3) {
            assert_eq!(lines.error(offset, "x"), SourceError::at(&text, offset, "x"), "{offset}");
        }
    }
}
