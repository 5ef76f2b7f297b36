//! Format numbers: a file of a newer format opens without the fields that this version does not have, and each of those
//! is reported.

use std::borrow::Cow;

use super::{scan::Field, source::SourceError};

/// Names that are allowed for a field at its place; `None` where any name is allowed.
pub(super) type AllowedNames = fn(&[Field], &Field) -> Option<&'static [&'static str]>;

/// Kind of file with a format number.
pub(super) struct Format {
    /// Name of the kind of file, for messages.
    pub what: &'static str,
    /// Format number that is written.
    pub number: u32,
    /// Allowed names of fields.
    pub known: AllowedNames,
}

impl Format {
    /// Text that this version can read. In a file of a newer format, unknown fields are replaced by blanks, so that all
    /// places stay, and each is reported in `notes`; `first_line` is the number of the text's first line.
    pub fn readable<'a>(
        &self,
        text: &'a str,
        fields: &[Field],
        first_line: usize,
        notes: &mut Vec<String>,
    ) -> Result<Cow<'a, str>, SourceError> {
        let format = fields.iter().find(|field| field.depth == 1 && field.name == "format");
        let number = format.and_then(|field| {
            let rest = text[field.value..field.end].trim_start();
            let digits = rest.find(|c: char| !c.is_ascii_digit()).unwrap_or(rest.len());
            rest[..digits].parse::<u32>().ok()
        });
        let newer = match (number, format) {
            (Some(0), Some(field)) => {
                return Err(SourceError::at(text, field.start, "format 0 was never released; the first is format: 1"));
            }
            (Some(newer), _) if newer > self.number => newer,
            _ => return Ok(Cow::Borrowed(text)),
        };
        notes.push(format!(
            "the {} has format {newer}, newer than {}: update Rigsmith, or save under another name to keep what it does not know",
            self.what, self.number
        ));
        let unknown = self.unknown(fields);
        let (mut line, mut counted) = (first_line, 0);
        for field in &unknown {
            line += text[counted..field.start].matches('\n').count();
            counted = field.start;
            notes.push(format!("line {line}: the field `{}` is of a newer format and is not kept", field.name));
        }
        Ok(Cow::Owned(blanked(text, &unknown)))
    }

    /// Fields whose names are not allowed at their place.
    pub fn unknown<'f, 'a>(&self, fields: &'f [Field<'a>]) -> Vec<&'f Field<'a>> {
        let is_unknown = |field: &&Field| (self.known)(fields, field).is_some_and(|known| !known.contains(&field.name));
        fields.iter().filter(is_unknown).collect()
    }
}

/// White space of RON with as many bytes as a character; a line feed stays.
fn blank(c: char) -> &'static str {
    match (c, c.len_utf8()) {
        ('\n', _) => "\n",
        (_, 1) => " ",
        (_, 2) => "\u{85}",
        (_, 3) => "\u{200e}",
        _ => "\u{85}\u{85}",
    }
}

/// Text with blanks in place of the given fields, so that lines, columns and offsets in bytes stay.
pub(super) fn blanked(text: &str, without: &[&Field]) -> String {
    let mut out = String::with_capacity(text.len());
    let mut at = 0;
    for field in without.iter().filter(|field| field.start < field.end) {
        let from = field.start.max(at);
        out.push_str(&text[at..from]);
        out.extend(text[from..field.end.max(from)].chars().map(blank));
        at = field.end.max(from);
    }
    out.push_str(&text[at..]);
    out
}
