//! Reading the text form of references.

use std::ops::Range;

use super::{
    GroupScope, NameKind, Names, NodeRef, NodeTypes, Pick, PickAt, ReferenceError, ReferenceProblem, RigScope, Source,
    Top, names::NameScope,
};
use crate::rig::{Uid, nearest::MOST_LISTED};

const SOURCES: [&str; 10] =
    ["any", "this", "root", "joints", "joint", "hierarchy", "command", "module", "input", "none"];
const FILTERS: [&str; 6] = ["rig", "group", "label", "type", "role", "pick"];
const TYPES: [&str; NodeTypes::NAMES.len()] = {
    let mut names = [""; NodeTypes::NAMES.len()];
    let mut i = 0;
    while i < names.len() {
        names[i] = NodeTypes::NAMES[i].0;
        i += 1;
    }
    names
};
const PLACES: [&str; 5] = ["all", "none", "START", "MIDDLE", "END"];

/// A uid with the name beside it, as written in a text.
pub(super) struct NamedUid {
    pub kind: NameKind,
    pub uid: Uid,
    /// Byte range of the name; empty, before the `#`, without one.
    pub name: Range<usize>,
    /// Presence of a uid; `false` if the name stands alone and was looked up.
    pub has_uid: bool,
}

/// Reads a union of references. Without `names` every name needs its uid.
pub(super) fn read(text: &str, names: Option<&dyn Names>) -> Result<Vec<NodeRef>, ReferenceError> {
    read_with(text, names, &mut Vec::new())
}

/// Reads a union of references as [`read`] does, and lists the uids with the places of their names.
pub(super) fn read_with(
    text: &str,
    names: Option<&dyn Names>,
    written: &mut Vec<NamedUid>,
) -> Result<Vec<NodeRef>, ReferenceError> {
    let mut reader = Reader { text, at: 0, names, written };
    reader.union()
}

/// Returns `true` for a character that a name may have without quotation marks.
pub(super) fn is_bare(c: char) -> bool {
    c.is_alphanumeric() || matches!(c, '_' | '-' | '.' | '/')
}

struct Reader<'a, 'o> {
    text: &'a str,
    at: usize,
    names: Option<&'o dyn Names>,
    written: &'o mut Vec<NamedUid>,
}

/// A name with or without a uid, not looked up yet.
struct NamedReference {
    name: Option<String>,
    uid: Option<Uid>,
    place: Range<usize>,
}

type Read<T> = Result<T, ReferenceError>;

impl<'a> Reader<'a, '_> {
    fn union(&mut self) -> Read<Vec<NodeRef>> {
        if !self.take('@') {
            return Err(self.error(self.at, ReferenceProblem::NoSigil));
        }
        let mut list = Vec::new();
        if self.ahead("none") {
            self.word();
        } else {
            list.push(self.one()?);
            while self.take('+') {
                self.take('@');
                list.push(self.one()?);
            }
        }
        self.blanks();
        if self.at < self.text.len() {
            return Err(self.unexpected("a filter, \"+\" or the end", "write KEY:VALUE, or + and another reference"));
        }
        Ok(list)
    }

    fn one(&mut self) -> Read<NodeRef> {
        self.blanks();
        let start = self.at;
        let word = self.word().to_owned();
        let mut joint = None;
        let mut reference = NodeRef::default();
        match word.to_ascii_lowercase().as_str() {
            "any" => reference.source = Source::Any,
            "this" => reference.source = Source::This,
            "root" => reference.source = Source::Root,
            "joints" => reference.source = Source::Joints,
            "joint" => joint = Some((word, NameKind::Joint, self.named("a joint's label")?)),
            "command" => joint = Some((word, NameKind::Command, self.named("a command's module")?)),
            "input" => joint = Some((word, NameKind::Input, self.named("an input's name")?)),
            "hierarchy" if self.ahead("this") => {
                self.word();
                reference.source = Source::Hierarchy(Top::This);
            }
            "hierarchy" if !self.names_ahead() => reference.source = Source::Hierarchy(Top::This),
            "hierarchy" => joint = Some((word, NameKind::Joint, self.named("\"this\" or a joint's label")?)),
            "module" => reference.source = Source::Module(self.name("a module's name")?),
            "" => return Err(self.unexpected("a source", "write this, joint NAME, joints or another one")),
            _ => {
                let problem = ReferenceProblem::UnknownWord { word, what: "source", known: &SOURCES };
                return Err(self.error(start, problem));
            }
        }
        let filters = self.filters(&mut reference)?;
        // Names are looked up after the rig of the reference is known.
        if let Some(rig) = filters.rig {
            reference.rig = RigScope::Rig(self.look_up(NameScope::default(), NameKind::Rig, rig)?);
        }
        let scope = NameScope { rig: reference.rig, group: GroupScope::Any };
        if let Some(group) = filters.group {
            reference.group = GroupScope::Group(self.look_up(scope, NameKind::Group, group)?);
        }
        let scope = NameScope { group: reference.group, ..scope };
        if let Some(label) = filters.label {
            reference.label = Some(self.look_up(scope, NameKind::Label, label)?);
        }
        if let Some((word, kind, named)) = joint {
            let uid = self.look_up(scope, kind, named)?;
            reference.source = match word.to_ascii_lowercase().as_str() {
                "joint" => Source::Joint(uid),
                "command" => Source::Command(uid),
                "input" => Source::Input(uid),
                _ => Source::Hierarchy(Top::Joint(uid)),
            };
        }
        Ok(reference)
    }

    fn filters(&mut self, reference: &mut NodeRef) -> Read<NamedFilters> {
        let mut seen: Vec<String> = Vec::new();
        let mut named = NamedFilters::default();
        loop {
            self.blanks();
            let start = self.at;
            let key = self.word().to_ascii_lowercase();
            if key.is_empty() {
                return Ok(named);
            }
            if !FILTERS.contains(&key.as_str()) {
                let problem = ReferenceProblem::UnknownWord { word: key, what: "filter", known: &FILTERS };
                return Err(self.error(start, problem));
            }
            if !self.take(':') {
                return Err(self.unexpected("\":\"", "write a filter as KEY:VALUE"));
            }
            match key.as_str() {
                "rig" if self.ahead("own") => drop(self.word()),
                "rig" => named.rig = Some(self.named("\"own\" or a rig's name")?),
                "group" if self.ahead("any") => drop(self.word()),
                "group" if self.ahead("own") => {
                    self.word();
                    reference.group = GroupScope::Own;
                }
                "group" => named.group = Some(self.named("\"any\", \"own\" or a group's name")?),
                "label" => named.label = Some(self.named("a label")?),
                "role" => reference.role = Some(self.name("a role")?),
                "type" => reference.types = self.types()?,
                _ => reference.pick = self.pick()?,
            }
            if seen.contains(&key) {
                return Err(self.error(start, ReferenceProblem::Twice(key)));
            }
            seen.push(key);
        }
    }

    fn types(&mut self) -> Read<NodeTypes> {
        let mut types = NodeTypes::ANY;
        loop {
            self.blanks();
            let start = self.at;
            let word = self.word().to_owned();
            let known = NodeTypes::NAMES.into_iter().find(|(name, _)| word.eq_ignore_ascii_case(name));
            match known {
                Some((_, kind)) => types = types | kind,
                None if word.is_empty() => return Err(self.unexpected("a type", "write joint, control or another one")),
                None => {
                    let problem = ReferenceProblem::UnknownWord { word, what: "type of node", known: &TYPES };
                    return Err(self.error(start, problem));
                }
            }
            if !self.take(',') {
                return Ok(types);
            }
        }
    }

    fn pick(&mut self) -> Read<Pick> {
        for (word, pick) in [("all", Pick::All), ("none", Pick::List(Vec::new()))] {
            if self.ahead(word) {
                self.word();
                return Ok(pick);
            }
        }
        let mut places = Vec::new();
        loop {
            self.blanks();
            let start = self.at;
            let word = self.word().to_owned();
            places.push(match word.to_ascii_uppercase().as_str() {
                "START" => PickAt::Start,
                "MIDDLE" => PickAt::Middle,
                "END" => PickAt::End,
                "" => return Err(self.unexpected("START, MIDDLE, END or a number", "write one of them")),
                digits if digits.bytes().all(|digit| digit.is_ascii_digit()) => match digits.parse() {
                    Ok(number) => PickAt::Number(number),
                    Err(_) => return Err(self.error(start, ReferenceProblem::BadNumber(word))),
                },
                _ => {
                    let problem = ReferenceProblem::UnknownWord { word, what: "place or number", known: &PLACES };
                    return Err(self.error(start, problem));
                }
            });
            if !self.take(',') {
                return Ok(Pick::List(places));
            }
        }
    }

    fn look_up(&mut self, scope: NameScope, kind: NameKind, named: NamedReference) -> Read<Uid> {
        let NamedReference { name, uid, place } = named;
        let start = place.start;
        if let Some(uid) = uid {
            self.written.push(NamedUid { kind, uid, name: place, has_uid: true });
            return Ok(uid);
        }
        let name = name.unwrap_or_default();
        let Some(names) = self.names else {
            return Err(self.error(start, ReferenceProblem::Unbound { kind, name }));
        };
        let mut candidates = names.find(scope, kind, &name);
        if let (Some(uid), true) = (candidates.pop(), candidates.is_empty()) {
            self.written.push(NamedUid { kind, uid, name: place, has_uid: false });
            return Ok(uid);
        }
        candidates = names.find(scope, kind, &name);
        Err(self.error(
            start,
            match candidates.is_empty() {
                false => {
                    let count = candidates.len();
                    candidates.truncate(MOST_LISTED);
                    candidates.shrink_to_fit();
                    ReferenceProblem::Ambiguous { kind, name, count, candidates }
                }
                true => {
                    let all = names.all(scope, kind);
                    let mut nearest = crate::rig::nearest::nearest(&name, &all, 3);
                    if nearest.is_empty() && all.len() <= 12 {
                        nearest = all.into_iter().map(|name| name.into_owned()).collect();
                    }
                    ReferenceProblem::Unknown { kind, name, nearest }
                }
            },
        ))
    }

    /// A name, a uid, or both.
    fn named(&mut self, expected: &'static str) -> Read<NamedReference> {
        self.blanks();
        let start = self.at;
        let name = if self.peek() == Some('#') { None } else { Some(self.name(expected)?) };
        let place = start..self.at;
        self.blanks();
        let hash = self.at;
        if !self.take('#') {
            return Ok(NamedReference { name, uid: None, place });
        }
        let digits = self.word();
        match digits.parse() {
            Ok(uid) => Ok(NamedReference { name, uid: Some(uid), place }),
            Err(_) => Err(self.error(hash, ReferenceProblem::BadUid(digits.to_owned()))),
        }
    }

    fn name(&mut self, expected: &'static str) -> Read<String> {
        self.blanks();
        if let Some(quote @ ('"' | '\'')) = self.peek() {
            return self.quoted(quote);
        }
        let start = self.at;
        let word = self.word();
        let end = self.at;
        self.blanks();
        // A word before a colon is the next filter.
        let is_name = !word.is_empty() && self.peek() != Some(':');
        self.at = if is_name { end } else { start };
        match is_name {
            true => Ok(word.to_owned()),
            false => Err(self.unexpected(expected, "write a word, or text in quotes")),
        }
    }

    fn quoted(&mut self, quote: char) -> Read<String> {
        let start = self.at;
        self.at += 1;
        let mut out = String::new();
        let mut rest = self.text[self.at..].char_indices();
        while let Some((place, c)) = rest.next() {
            if c == quote {
                self.at += place + 1;
                return Ok(out);
            }
            if c != '\\' {
                out.push(c);
                continue;
            }
            let escape = rest.next().map(|(_, c)| c);
            out.push(match escape {
                Some('n') => '\n',
                Some('r') => '\r',
                Some('t') => '\t',
                Some('0') => '\0',
                Some(c @ ('\\' | '\'' | '"')) => c,
                Some('u') => {
                    let number: String = rest.by_ref().map(|(_, c)| c).take_while(|c| *c != '}').take(8).collect();
                    let digits = number.strip_prefix('{').and_then(|digits| u32::from_str_radix(digits, 16).ok());
                    match digits.and_then(char::from_u32) {
                        Some(c) => c,
                        None => {
                            let at = self.at + place;
                            return Err(self.error(at, ReferenceProblem::BadEscape(format!("u{number}"))));
                        }
                    }
                }
                Some(c) => {
                    let at = self.at + place;
                    return Err(self.error(at, ReferenceProblem::BadEscape(c.to_string())));
                }
                None => break,
            });
        }
        self.at = start;
        Err(self.error(start, ReferenceProblem::OpenQuote(quote)))
    }

    /// The bare word at the current position, perhaps empty.
    fn word(&mut self) -> &'a str {
        self.blanks();
        let rest: &'a str = &self.text[self.at..];
        let length = rest.find(|c| !is_bare(c)).unwrap_or(rest.len());
        self.at += length;
        &rest[..length]
    }

    /// Returns `true` if this word comes next, not followed by a uid.
    fn ahead(&mut self, word: &str) -> bool {
        self.blanks();
        let start = self.at;
        let is_it = self.word().eq_ignore_ascii_case(word);
        self.blanks();
        let alone = self.peek() != Some('#');
        self.at = start;
        is_it && alone
    }

    /// Returns `true` if a name or a uid comes next.
    fn names_ahead(&mut self) -> bool {
        self.blanks();
        let start = self.at;
        let is_word = !self.word().is_empty();
        self.blanks();
        let is_key = self.peek() == Some(':');
        self.at = start;
        is_word && !is_key || matches!(self.peek(), Some('#' | '\'' | '"'))
    }

    fn peek(&self) -> Option<char> {
        self.text[self.at..].chars().next()
    }

    fn take(&mut self, mark: char) -> bool {
        self.blanks();
        let is_it = self.peek() == Some(mark);
        if is_it {
            self.at += mark.len_utf8();
        }
        is_it
    }

    fn blanks(&mut self) {
        let rest = &self.text[self.at..];
        self.at += rest.len() - rest.trim_start().len();
    }

    fn unexpected(&self, expected: &'static str, advice: &'static str) -> ReferenceError {
        let found = match self.peek() {
            Some(_) => {
                let rest = self.text[self.at..].split_whitespace().next().unwrap_or_default();
                format!("`{}`", rest.chars().take(24).collect::<String>())
            }
            None => "the end".to_owned(),
        };
        self.error(self.at, ReferenceProblem::Unexpected { found, expected, advice })
    }

    fn error(&self, at: usize, problem: ReferenceProblem) -> ReferenceError {
        ReferenceError::new(self.text, at, problem)
    }
}

#[derive(Default)]
struct NamedFilters {
    rig: Option<NamedReference>,
    group: Option<NamedReference>,
    label: Option<NamedReference>,
}
