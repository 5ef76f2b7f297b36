//! Places of declarations in the text of a template, for its faults.

use std::{
    cell::{Cell, OnceCell},
    collections::{HashMap, HashSet},
    ops::Range,
};

use super::super::file::known_names;
use crate::rig::{
    SourceError, Uid,
    format::{
        scan::{self, Field},
        source::TextLines,
    },
};

/// Length of a uid as text.
const DIGITS: usize = 16;

/// Digits of a uid.
type UidText = [u8; DIGITS];

/// Finder of the places of declarations in a text. The first fault lists all of them, so that thousands of faults take a time in
/// proportion to the text.
pub(super) struct Places<'a> {
    pub(super) text: &'a str,
    has_parts: bool,
    /// Fields of the text, which take several times its memory: they are scanned again for the first fault.
    fields: OnceCell<Vec<Field<'a>>>,
    /// Elements of lists that are not read, because they are at fault, in their order and apart from one another.
    left_out: Vec<Range<usize>>,
    lines: OnceCell<TextLines<'a>>,
    declared: OnceCell<DeclaredUids>,
    uids_left_out: OnceCell<HashSet<UidText>>,
    /// Number of fields that were looked at.
    visits: Cell<usize>,
}

/// Declarations of a text, as indices of fields.
#[derive(Default)]
struct DeclaredUids {
    /// Fields that declare each uid, in the order of the text.
    by_uid: HashMap<UidText, Vec<usize>>,
    /// Fields of each struct that declares a uid.
    by_bracket: HashMap<usize, Vec<usize>>,
}

impl<'a> Places<'a> {
    /// Finder in a text with these fields, of which elements of lists are not read.
    pub(super) fn new(text: &'a str, fields: &[Field], left_out: &[Range<usize>]) -> Self {
        let mut sorted = left_out.to_vec();
        sorted.sort_unstable_by_key(|range| (range.start, range.end));
        let mut apart: Vec<Range<usize>> = Vec::with_capacity(sorted.len());
        for range in sorted {
            match apart.last_mut().filter(|last| range.start <= last.end) {
                Some(last) => last.end = last.end.max(range.end),
                None => apart.push(range),
            }
        }
        let is_of_part = |field: &Field| {
            let list = field.parent.map(|parent| &fields[parent]);
            field.depth == 3 && list.is_some_and(|list| list.depth == 1 && list.name == "parts")
        };
        Self {
            text,
            has_parts: fields.iter().any(is_of_part),
            fields: OnceCell::new(),
            left_out: apart,
            lines: OnceCell::new(),
            declared: OnceCell::new(),
            uids_left_out: OnceCell::new(),
            visits: Cell::new(0),
        }
    }

    /// True if something with that uid is declared in an element that is not read.
    pub(super) fn is_left_out(&self, uid: Uid) -> bool {
        if self.left_out.is_empty() {
            return false;
        }
        let listed = || {
            self.count(self.fields().len());
            let left_out = self.fields().iter().filter(|field| field.name == "uid" && self.is_inside_left_out(field));
            left_out
                .filter_map(|field| first_digits(self.value(field).trim_start_matches([' ', '"'])))
                .collect::<HashSet<_>>()
        };
        first_digits(&uid.to_string()).is_some_and(|digits| self.uids_left_out.get_or_init(listed).contains(&digits))
    }

    /// True if the template uses parts.
    pub(super) fn has_parts(&self) -> bool {
        self.has_parts
    }

    /// Fields of the text.
    pub(super) fn fields(&self) -> &[Field<'a>] {
        self.fields.get_or_init(|| scan::fields(self.text))
    }

    /// True for a field in an element that is not read.
    pub(super) fn is_inside_left_out(&self, field: &Field) -> bool {
        let behind = self.left_out.partition_point(|range| range.start <= field.start);
        behind.checked_sub(1).is_some_and(|number| self.left_out[number].contains(&field.start))
    }

    pub(super) fn used_twice(&self, uid: Uid) -> SourceError {
        self.error(uid, 1, "uid", format!("uid {uid} is used twice; give the second a uid of its own"))
    }

    /// An error at the field `name` of the `nth` declaration with that uid (or of the first).
    pub(super) fn error(&self, uid: Uid, nth: usize, name: &str, message: String) -> SourceError {
        let declared = self.declared.get_or_init(|| self.declarations());
        let things = first_digits(&uid.to_string()).and_then(|digits| declared.by_uid.get(&digits));
        let thing = things.and_then(|things| things.get(nth).or(things.first())).map(|thing| &self.fields()[*thing]);
        let of_struct = thing.and_then(|thing| declared.by_bracket.get(&thing.bracket));
        let mut fields = of_struct.into_iter().flatten().map(|field| &self.fields()[*field]);
        let field = fields.find(|field| {
            self.count(1);
            field.name == name
        });
        self.error_at(field.or(thing).map_or(0, |field| field.start), message)
    }

    /// An error at a place of the text.
    pub(super) fn error_at(&self, offset: usize, message: impl Into<String>) -> SourceError {
        self.lines.get_or_init(|| TextLines::new(self.text)).error(offset, message)
    }

    fn declarations(&self) -> DeclaredUids {
        self.count(2 * self.fields().len());
        let mut declared = DeclaredUids::default();
        for (number, field) in self.fields().iter().enumerate() {
            if field.depth <= 1 || field.name != "uid" || known_names(self.fields(), field).is_none() {
                continue;
            }
            let Some(mut digits) = first_digits(self.value(field).trim_start().trim_start_matches('"')) else {
                continue;
            };
            digits.make_ascii_lowercase();
            declared.by_uid.entry(digits).or_default().push(number);
            declared.by_bracket.entry(field.bracket).or_default();
        }
        for (number, field) in self.fields().iter().enumerate() {
            if let Some(fields) = declared.by_bracket.get_mut(&field.bracket) {
                fields.push(number);
            }
        }
        declared
    }

    fn value(&self, field: &Field) -> &'a str {
        self.text.get(field.value..field.end).unwrap_or_default()
    }

    fn count(&self, fields: usize) {
        self.visits.set(self.visits.get() + fields);
    }
}

/// The beginning of a text that may be a uid; `None` for a text that is shorter than one.
fn first_digits(text: &str) -> Option<UidText> {
    text.as_bytes().first_chunk().copied()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn faults_of_all_declarations_look_at_each_field_a_few_times() {
        let uid = |number: usize| Uid(0x1000 + number as u64);
        for count in [100, 1000] {
            let joints: Vec<String> = (0..count)
                .map(|number| format!("(uid: \"{}\", label: \"j\", scale: (0, 0, 0))", uid(number)))
                .collect();
            let text = format!("(format: 2,\n joints: [{}])", joints.join(",\n"));
            let fields = scan::fields(&text);
            let places = Places::new(&text, &fields, &[]);
            for number in 0..count {
                let error = places.error(uid(number), 0, "scale", "x".to_owned());
                assert_eq!(error.line, number + 2);
                assert!(text[error.offset..].starts_with("scale"), "{error:?}");
            }
            assert!(places.visits.get() <= 6 * fields.len(), "{} of {}", places.visits.get(), fields.len());
        }
    }

    #[test]
    fn elements_that_are_not_read_are_found_by_their_uids() {
        let text = "(joints: [(uid: \"00000000000000aa\"), (uid: \"00000000000000bb\"), (uid: \"00000000000000AA\")])";
        let fields = scan::fields(text);
        let element = |at: &str| {
            let start = text.find(at).unwrap();
            start - 7..start + 18
        };
        let left_out = [element("00000000000000bb"), element("00000000000000bb")];
        let places = Places::new(text, &fields, &left_out);
        assert!(places.is_left_out(Uid(0xbb)) && !places.is_left_out(Uid(0xaa)));
        // The case of digits is no matter, and the second declaration is told where there is one.
        let second = places.error(Uid(0xaa), 1, "uid", "x".to_owned());
        assert_eq!(second.offset, text.rfind("uid").unwrap());
        assert_eq!(places.error(Uid(0xbb), 1, "label", "x".to_owned()).offset, element("00000000000000bb").start + 1);
        assert_eq!(places.error(Uid(0xcc), 0, "uid", "x".to_owned()).offset, 0);
    }
}
