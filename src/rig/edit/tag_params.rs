//! Parameters of tags in edits: RON text of any shape, checked before a rig takes it.

use std::borrow::Cow;

use ron::{Options, value::RawValue};

use super::EditError;
use crate::rig::{TagData, TagKind};

/// Largest depth of brackets in a tag's parameters, so that the template around them can still be read.
const PARAMS_DEPTH: usize = 100;

/// Largest depth of brackets that is read without the general reader, which counts most brackets twice.
const PLAIN_DEPTH: usize = 24;

/// Most digits of a whole number that is read without the general reader.
const PLAIN_DIGITS: usize = 15;

/// The tag in its stored form: parameters without white space and comments around them.
///
/// # Errors
/// [`EditError::BadParams`] for parameters that are not RON.
pub(super) fn checked(tag: &TagData) -> Result<TagData, EditError> {
    let mut tag = tag.clone();
    if let TagKind::Command { params, .. } = &mut tag.kind {
        let stored = stored(params).map_err(|reason| EditError::BadParams(tag.uid, reason.to_string()))?;
        if stored.len() < params.len() {
            *params = stored.into_owned();
        }
    }
    Ok(tag)
}

/// Parameters without white space and comments around them.
///
/// # Errors
/// The reason why the text is no RON.
fn stored(params: &str) -> Result<Cow<'_, str>, ron::Error> {
    let trimmed = params.trim_matches(SPACES);
    // Tags of a template are checked in the files of its parts, and again where the parts are put into it.
    if is_plain(trimmed) {
        return Ok(Cow::Borrowed(trimmed));
    }
    // Extensions would let values through that trimming, which knows none, does not take.
    let options = Options::default().with_recursion_limit(PARAMS_DEPTH);
    let raw: Box<RawValue> = options.from_str(&format!("{params}\n")).map_err(|error| error.code)?;
    // Trimming parses once more, for the sake of comments.
    Ok(match params.is_ascii() && !params.contains('/') {
        true => Cow::Borrowed(trimmed),
        false => Cow::Owned(raw.trim().get_ron().to_owned()),
    })
}

/// White space around parameters.
const SPACES: [char; 6] = [' ', '\t', '\n', '\r', '\u{b}', '\u{c}'];

/// True for RON of the shapes that nearly all parameters have: structs, tuples and lists of names, strings without escapes and
/// decimal numbers, without comments. Everything for which this is true is RON; the general reader decides about the rest.
fn is_plain(text: &str) -> bool {
    let mut reader = PlainReader { text: text.as_bytes(), at: 0 };
    reader.has_value(PLAIN_DEPTH) && reader.at == text.len()
}

/// Reader of plain RON.
struct PlainReader<'t> {
    text: &'t [u8],
    /// Number of bytes that were read.
    at: usize,
}

impl<'t> PlainReader<'t> {
    fn peek(&self) -> Option<u8> {
        self.text.get(self.at).copied()
    }

    fn skip_space(&mut self) {
        while matches!(self.peek(), Some(b' ' | b'\t' | b'\n' | b'\r')) {
            self.at += 1;
        }
    }

    /// Reads a byte behind white space, if it is that one.
    fn has(&mut self, byte: u8) -> bool {
        self.skip_space();
        let is_next = self.peek() == Some(byte);
        self.at += usize::from(is_next);
        is_next
    }

    /// Reads a value with brackets up to a depth.
    fn has_value(&mut self, depth: usize) -> bool {
        self.skip_space();
        match self.peek() {
            Some(b'"') => self.has_string(),
            Some(b'[' | b'(') => self.has_brackets(depth),
            Some(b'-' | b'0'..=b'9') => self.has_number(),
            _ => self.has_named(depth),
        }
    }

    fn has_string(&mut self) -> bool {
        let inside = self.text.get(self.at + 1..).unwrap_or_default();
        match inside.iter().position(|byte| matches!(byte, b'"' | b'\\')) {
            Some(end) if inside[end] == b'"' => {
                self.at += end + 2;
                true
            }
            _ => false,
        }
    }

    /// Reads a number as `-12` or `0.5`.
    fn has_number(&mut self) -> bool {
        self.at += usize::from(self.peek() == Some(b'-'));
        let whole = self.digits();
        if self.peek() != Some(b'.') {
            return (1..=PLAIN_DIGITS).contains(&whole);
        }
        self.at += 1;
        whole > 0 && self.digits() > 0
    }

    /// Reads digits; returns how many.
    fn digits(&mut self) -> usize {
        let start = self.at;
        while matches!(self.peek(), Some(b'0'..=b'9')) {
            self.at += 1;
        }
        self.at - start
    }

    /// Reads a name: `true`, a variant, or one with a struct or a tuple behind it.
    fn has_named(&mut self, depth: usize) -> bool {
        let name = self.name();
        if name.is_empty() {
            return false;
        }
        let is_option = name == b"Some";
        self.skip_space();
        if self.peek() != Some(b'(') {
            // Nothing is left out of `Some`.
            return !is_option;
        }
        if is_option {
            self.at += 1;
            let Some(depth) = depth.checked_sub(1) else { return false };
            let is_whole = self.has_value(depth);
            self.has(b',');
            return is_whole && self.has(b')');
        }
        let is_value =
            matches!(name, b"true" | b"false" | b"None") || name.starts_with(b"inf") || name.starts_with(b"NaN");
        !is_value && self.has_brackets(depth)
    }

    /// Reads a name of ASCII letters, digits and underscores; nothing where there is none.
    fn name(&mut self) -> &'t [u8] {
        let (text, start) = (self.text, self.at);
        if !matches!(self.peek(), Some(b'0'..=b'9')) {
            while matches!(self.peek(), Some(b'_' | b'a'..=b'z' | b'A'..=b'Z' | b'0'..=b'9')) {
                self.at += 1;
            }
        }
        &text[start..self.at]
    }

    /// Reads a list, a tuple, or a struct without its name.
    fn has_brackets(&mut self, depth: usize) -> bool {
        let Some(depth) = depth.checked_sub(1) else { return false };
        let is_list = self.peek() == Some(b'[');
        self.at += 1;
        let end = if is_list { b']' } else { b')' };
        let start = self.at;
        let has_fields = !is_list && self.has_key();
        self.at = start;
        loop {
            if self.has(end) {
                return true;
            }
            if (has_fields && !self.has_key()) || !self.has_value(depth) {
                return false;
            }
            if !self.has(b',') {
                return self.has(end);
            }
        }
    }

    /// Reads the name of a field and its colon.
    fn has_key(&mut self) -> bool {
        self.skip_space();
        !self.name().is_empty() && self.has(b':')
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parameters_as_people_write_them_are_plain() {
        for text in [
            "()",
            "(a: 1, list: [1.5, -2, 0.25,], name: \"@joint arm_l + @this\")",
            "(weight: \"ik\", min: Some(-1.0), ease: Linear, on: true, none: None)",
            "(keys: [(-1.0, -12.0), (1.0, 12.0)], form: Slider(min: 0, max: 1), unit: ())",
            "(\n    a: Name(1, 2),\n    b: \"ä / ö // no comment\",\n)",
            "( a : Some ( 1 , ) )",
        ] {
            assert!(is_plain(text), "{text}");
            assert_eq!(
                Options::default().from_str::<Box<RawValue>>(text).map(|raw| raw.get_ron().to_owned()).unwrap(),
                text
            );
        }
    }

    #[test]
    fn what_else_is_ron_is_left_to_the_general_reader() {
        let deep = |count: usize| "[".repeat(count) + &"]".repeat(count);
        for text in [
            "",
            "(",
            "(a: )",
            "(a: 1 b: 2)",
            "(,)",
            "(1, a: 2)",
            "(a: 1, 2)",
            "(a: \"\\\"\")",
            "(a: 1e5)",
            "(a: .5)",
            "(a: 1.)",
            "(a: +1)",
            "(a: 0x1f)",
            "(a: 1..2)",
            "(a: r\"x\")",
            "(a: 'c')",
            "{\"a\": 1}",
            "(a: 1) // end",
            "(/* */)",
            "() ()",
            "Some",
            "Some()",
            "Some(1, 2)",
            "Some(a: 1)",
            "true(1)",
            "inf(1)",
            "None()",
            "(é: 1)",
            "(a-b: 1)",
            "(-)",
            "(a: 1234567890123456)",
        ] {
            assert!(!is_plain(text), "{text}");
        }
        assert!(is_plain(&deep(PLAIN_DEPTH)) && !is_plain(&deep(PLAIN_DEPTH + 1)));
        assert!(
            Options::default().with_recursion_limit(PARAMS_DEPTH).from_str::<Box<RawValue>>(&deep(PLAIN_DEPTH)).is_ok()
        );
    }
}
