//! Scanner for the places of fields and list elements in a RON text, independent of their meaning.
//!
//! The RON reader reports errors of a text but not the place of each value. One pass over the text finds every `name:
//! value` pair, so that an error about a value that is only invalid together with others names its line.

use std::ops::Range;

/// A `name: value` pair of a RON text.
pub(crate) struct Field<'a> {
    /// The name.
    pub name: &'a str,
    /// Number of open brackets around the field.
    pub depth: usize,
    /// Number of the innermost bracket around the field; fields of one struct have the same.
    pub bracket: usize,
    /// Index of the field whose value contains this one.
    pub parent: Option<usize>,
    /// Start of the name, in bytes.
    pub start: usize,
    /// Start of the value, in bytes.
    pub value: usize,
    /// End of the value in bytes, with the comma after it, if any; the end of the text if it is cut short.
    pub end: usize,
}

struct OpenBracket {
    bracket: usize,
    owner: Option<usize>,
    current: Option<usize>,
}

/// Fields of a text in the order of their names. Time is linear, and the depth of nesting is unlimited.
pub(crate) fn fields(text: &str) -> Vec<Field<'_>> {
    let mut fields: Vec<Field> = Vec::new();
    let mut outer: Vec<OpenBracket> = Vec::new();
    let mut here = OpenBracket { bracket: 0, owner: None, current: None };
    let mut brackets = 0;
    let mut before: Option<Token> = None;
    for token in tokens(text) {
        match token.text {
            "(" | "[" | "{" => {
                brackets += 1;
                let owner = here.current.or(here.owner);
                outer.push(std::mem::replace(&mut here, OpenBracket { bracket: brackets, owner, current: None }));
            }
            ")" | "]" | "}" => {
                if let Some(open) = outer.pop() {
                    let closed = std::mem::replace(&mut here, open);
                    end_at(&mut fields, closed.current, token.start);
                }
            }
            "," => end_at(&mut fields, here.current.take(), token.start + 1),
            ":" if here.current.is_none() => {
                if let Some(name) = before.as_ref().filter(|name| name.is_word()) {
                    here.current = Some(fields.len());
                    fields.push(Field {
                        name: name.text,
                        depth: outer.len(),
                        bracket: here.bracket,
                        parent: here.owner,
                        start: name.start,
                        value: token.start + 1,
                        end: text.len(),
                    });
                }
            }
            _ => {}
        }
        before = Some(token);
    }
    fields
}

fn end_at(fields: &mut [Field], field: Option<usize>, end: usize) {
    if let Some(field) = field.and_then(|field| fields.get_mut(field)) {
        field.end = end;
    }
}

/// Elements of lists around a place, the innermost first, each without white space, comments and comma around it.
pub(crate) fn elements_around(text: &str, offset: usize) -> Vec<Range<usize>> {
    let mut found = Vec::new();
    each_element(text, |element| found.extend(Some(element).filter(|element| element.contains(&offset))));
    found
}

/// All elements of lists, each without white space, comments and comma around it, in the order of their ends.
pub(crate) fn list_elements(text: &str) -> Vec<Range<usize>> {
    let mut found = Vec::new();
    each_element(text, |element| found.push(element));
    found
}

/// Calls `take` with each element of a list that ends.
fn each_element(text: &str, mut take: impl FnMut(Range<usize>)) {
    /// Open bracket: of a list, with the start of its element that goes on, if one does.
    struct Open {
        is_list: bool,
        element: Option<usize>,
    }
    let mut close = |start: Option<usize>, end: usize| start.into_iter().for_each(|start| take(start..end));
    let mut open: Vec<Open> = Vec::new();
    let mut end = 0;
    for token in tokens(text) {
        let is_closing = matches!(token.text, ")" | "]" | "}");
        if let Some(here) = open.last_mut().filter(|here| here.is_list && !is_closing && token.text != ",") {
            here.element.get_or_insert(token.start);
        }
        match token.text {
            "[" => open.push(Open { is_list: true, element: None }),
            "(" | "{" => open.push(Open { is_list: false, element: None }),
            _ if is_closing => close(open.pop().and_then(|open| open.element), end),
            "," => close(open.last_mut().and_then(|open| open.element.take()), end),
            _ => {}
        }
        end = token.start + token.text.len();
    }
}

/// Fault of the brackets of a text, with its places as byte offsets.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum BracketFault {
    /// Start of the last bracket or string that is open at the end of a text, which is cut short.
    Open(usize),
    /// A closing bracket of another kind than the bracket that it closes.
    Crossed {
        /// Place of the closing bracket.
        at: usize,
        /// The bracket that should stand there.
        wanted: char,
    },
    /// A closing bracket where no bracket is open.
    Surplus(usize),
}

/// First fault of the brackets of a text; `None` where each is closed by one of its kind.
pub(crate) fn bracket_fault(text: &str) -> Option<BracketFault> {
    let mut open: Vec<Token> = Vec::new();
    for token in tokens(text) {
        let is_string = token.text.starts_with('"');
        if is_string && token.start + token.text.len() == text.len() && !(token.text.len() > 1 && text.ends_with('"')) {
            return Some(BracketFault::Open(token.start));
        }
        match token.text {
            "(" | "[" | "{" => open.push(token),
            closing @ (")" | "]" | "}") => {
                let wanted = match open.pop().map(|opening| opening.text) {
                    None => return Some(BracketFault::Surplus(token.start)),
                    Some("(") => ')',
                    Some("[") => ']',
                    Some(_) => '}',
                };
                if !closing.starts_with(wanted) {
                    return Some(BracketFault::Crossed { at: token.start, wanted });
                }
            }
            _ => {}
        }
    }
    open.last().map(|token| BracketFault::Open(token.start))
}

/// Starts of the elements of the outermost list, in bytes.
pub(crate) fn elements(text: &str) -> Vec<usize> {
    let mut starts = Vec::new();
    let (mut depth, mut expected) = (0_usize, false);
    for token in tokens(text) {
        match token.text {
            ")" | "]" | "}" => depth = depth.saturating_sub(1),
            "," if depth == 1 => expected = true,
            opening => {
                if expected && depth == 1 {
                    starts.push(token.start);
                    expected = false;
                }
                if matches!(opening, "(" | "[" | "{") {
                    depth += 1;
                    expected |= depth == 1;
                }
            }
        }
    }
    starts
}

/// The place in `to` that corresponds to one in `from`, a text with other insides of the same strings: the same place of
/// the same token.
pub(crate) fn same_place(from: &str, to: &str, offset: usize) -> usize {
    let before = tokens(from).take_while(|token| token.start <= offset).count();
    let Some(number) = before.checked_sub(1) else { return offset.min(to.len()) };
    let (Some(token), Some(same)) = (tokens(from).nth(number), tokens(to).nth(number)) else { return to.len() };
    let within = offset - token.start;
    // Behind the token it is behind the other one, too.
    let behind = within.saturating_sub(token.text.len());
    (same.start + if behind > 0 { same.text.len() + behind } else { within.min(same.text.len()) }).min(to.len())
}

pub(in crate::rig) struct Token<'a> {
    pub text: &'a str,
    pub start: usize,
}

impl Token<'_> {
    fn is_word(&self) -> bool {
        self.text.starts_with(|c: char| c.is_alphabetic() || c == '_')
    }
}

/// Strings, characters, words and single punctuation marks of a text; comments are skipped.
pub(in crate::rig) fn tokens(text: &str) -> impl Iterator<Item = Token<'_>> {
    let bytes = text.as_bytes();
    let mut at = 0;
    std::iter::from_fn(move || {
        loop {
            let mut start = at;
            let first = *bytes.get(at)?;
            if (first >= 0x80 || first.is_ascii_whitespace() || first == 0x0B)
                && let Some(blank) = text[at..].chars().next().filter(|c| is_blank(*c))
            {
                at += blank.len_utf8();
                continue;
            }
            match first {
                b'/' if bytes.get(at + 1) == Some(&b'/') => {
                    at = text[at..].find('\n').map_or(text.len(), |n| at + n);
                    continue;
                }
                b'/' if bytes.get(at + 1) == Some(&b'*') => {
                    at = comment_end(bytes, at + 2);
                    continue;
                }
                b'"' => at = quote_end(bytes, at + 1, b'"'),
                b'\'' => at = character_end(text, at + 1),
                c if is_word(c) => {
                    at = word_end(text, at);
                    if matches!(&text[start..at], "r" | "br")
                        && let Some(end) = raw_end(bytes, at)
                    {
                        (start, at) = (at, end);
                    }
                }
                _ => at += 1,
            }
            return Some(Token { text: &text[start..at], start });
        }
    })
}

/// End of a word that begins at `at`: at a mark, or at white space.
fn word_end(text: &str, at: usize) -> usize {
    let bytes = text.as_bytes();
    let ascii = bytes[at..].iter().take_while(|byte| byte.is_ascii() && is_word(**byte)).count();
    let end = at + ascii;
    match bytes.get(end) {
        Some(byte) if !byte.is_ascii() => {
            let rest = text[end..].find(|c: char| c.is_ascii() && !is_word(c as u8) || is_blank(c));
            rest.map_or(text.len(), |length| end + length)
        }
        _ => end,
    }
}

/// True for characters that RON treats as white space.
fn is_blank(c: char) -> bool {
    matches!(c, ' ' | '\t'..='\r' | '\u{85}' | '\u{200E}' | '\u{200F}' | '\u{2028}' | '\u{2029}')
}

fn is_word(c: u8) -> bool {
    c.is_ascii_alphanumeric() || c == b'_' || c >= 0x80
}

/// End of a comment; comments of RON nest.
fn comment_end(bytes: &[u8], mut at: usize) -> usize {
    let mut depth = 1;
    while at < bytes.len() && depth > 0 {
        match (bytes[at], bytes.get(at + 1)) {
            (b'*', Some(b'/')) => (depth, at) = (depth - 1, at + 2),
            (b'/', Some(b'*')) => (depth, at) = (depth + 1, at + 2),
            _ => at += 1,
        }
    }
    while at < bytes.len() && bytes[at] & 0xC0 == 0x80 {
        at += 1;
    }
    at
}

/// The end of a string whose first character is at `at`.
fn quote_end(bytes: &[u8], mut at: usize, quote: u8) -> usize {
    while let Some(&byte) = bytes.get(at) {
        match byte {
            b'\\' => at += 2,
            byte if byte == quote => return at + 1,
            _ => at += 1,
        }
    }
    bytes.len()
}

/// The end of a character literal, or of the mark alone if it begins none.
fn character_end(text: &str, at: usize) -> usize {
    let bytes = text.as_bytes();
    if bytes.get(at) == Some(&b'\\') {
        return quote_end(bytes, at, b'\'');
    }
    let end = at + text[at..].chars().next().map_or(0, char::len_utf8);
    if end > at && bytes.get(end) == Some(&b'\'') { end + 1 } else { at }
}

/// The end of a raw string whose marks start at `at`.
fn raw_end(bytes: &[u8], at: usize) -> Option<usize> {
    let hashes = bytes[at..].iter().take_while(|byte| **byte == b'#').count();
    if bytes.get(at + hashes) != Some(&b'"') {
        return None;
    }
    let mut end = at + hashes + 1;
    while end < bytes.len() {
        let closing = bytes[end] == b'"';
        end += 1;
        if closing && bytes[end..].iter().take(hashes).filter(|byte| **byte == b'#').count() == hashes {
            return Some(end + hashes);
        }
    }
    Some(bytes.len())
}
