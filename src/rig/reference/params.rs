//! References in the parameters of any tag, whether its module is installed or not.
//!
//! Parameters are RON text, and a reference in them is a string literal whose text begins with `@`. So references can
//! be found, changed and renamed without knowledge of the other parameters.

use std::{borrow::Cow, collections::HashMap, ops::Range};

use super::{
    NameKind, NameScope, Names, NodeRef, NodeRefs, ReferenceError, ReferenceProblem, Source,
    text::{NamedUid, read_with},
    write::{name_text, written},
};
use crate::rig::{
    Uid,
    format::scan::{Token, fields, tokens},
    nearest::did_you_mean,
    template::quoted,
};

/// A reference found in parameters.
#[derive(Debug, Clone, PartialEq)]
pub struct FoundReference {
    /// Byte range of the string literal, quotation marks included.
    pub range: Range<usize>,
    /// The text, without quotation marks and escapes.
    pub text: String,
    /// The parsed references; an error if the text is no reference, or has a name without a uid.
    pub references: Result<NodeRefs, ReferenceError>,
}

/// A reference in parameters that cannot be parsed.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{error}")]
pub struct BadReference {
    /// Byte range of the string literal in the parameters.
    pub range: Range<usize>,
    /// The error in it.
    pub error: ReferenceError,
}

/// The references in a tag's parameters, in order: string literals whose text begins with `@`. Comments, characters and
/// byte strings are skipped.
pub fn references_in(params: &str) -> impl Iterator<Item = FoundReference> {
    literals(params).map(|Literal { range, text, .. }| {
        let references = text.parse();
        FoundReference { range, text, references }
    })
}

/// The parameters with every reference changed by `change`. Unchanged references keep their text, to the byte, and so
/// does everything around the references. Names stay beside their uids; other uids have none until [`refresh_names`].
/// Text that cannot be read as a reference is left alone.
pub fn map_references(params: &str, mut change: impl FnMut(&mut NodeRef)) -> String {
    let rewritten = rewritten(params, literals(params), |text| {
        let mut places = Vec::new();
        let before = read_with(text, None, &mut places).ok()?;
        let mut after = before.clone();
        after.iter_mut().for_each(&mut change);
        (after != before).then(|| written(&after, Some(&KeptNames::new(text, &places))))
    });
    rewritten.into_owned()
}

/// The parameters with every union of references changed by `change`, see [`map_references`].
pub fn map_unions(params: &str, mut change: impl FnMut(&mut NodeRefs)) -> String {
    let rewritten = rewritten(params, literals(params), |text| {
        let mut places = Vec::new();
        let before = NodeRefs(read_with(text, None, &mut places).ok()?);
        let mut after = before.clone();
        change(&mut after);
        (after != before).then(|| written(&after.0, Some(&KeptNames::new(text, &places))))
    });
    rewritten.into_owned()
}

/// The parameters with the current name beside every uid. The name beside a uid that does not exist any more stays, as
/// a hint for people. Names without uids stay unchanged; see [`bind_names`].
pub fn refresh_names<'a>(params: &'a str, names: &dyn Names) -> Cow<'a, str> {
    rewritten(params, literals(params), |text| {
        let mut places = Vec::new();
        // With a look-up at hand, a name without a uid does not keep the others from being refreshed.
        read_with(text, Some(names), &mut places).ok()?;
        places.retain(|place| place.has_uid);
        renamed(text, &places, names)
    })
}

/// The parameters with the uid beside every name, and the references that could not be bound: names of no object or of
/// several, and texts that are no references. Those stay unchanged.
pub fn bind_names<'a>(params: &'a str, names: &dyn Names) -> (Cow<'a, str>, Vec<BadReference>) {
    let bad = literals(params).filter_map(|Literal { range, text, .. }| {
        let error = read_with(&text, Some(names), &mut Vec::new()).err()?;
        // A text with another purpose may begin with the same sign.
        let other = matches!(&error.problem, ReferenceProblem::UnknownWord { what: "source", .. });
        (!other).then_some(BadReference { range, error })
    });
    let bad = bad.collect();
    let bound = rewritten(params, literals(params), |text| {
        let mut places = Vec::new();
        read_with(text, Some(names), &mut places).ok()?;
        renamed(text, &places, names)
    });
    (bound, bad)
}

/// The parameters with the uid beside every name, as [`bind_names`] gives it, while names that mean that object stay as they
/// are written.
pub fn with_uids<'a>(params: &'a str, names: &dyn Names) -> Cow<'a, str> {
    let means_it = |place: &NamedUid, text: &str| {
        let name = unquoted(&text[place.name.clone()]);
        !place.has_uid
            || name.is_some_and(|name| names.find(NameScope::default(), place.kind, &name).contains(&place.uid))
    };
    rewritten(params, literals(params), |text| {
        let mut places = Vec::new();
        read_with(text, Some(names), &mut places).ok()?;
        renamed_unless(text, &places, names, means_it)
    })
}

/// The parameters with the uid beside every name that exactly one object has. Other names stay alone, and so do texts that
/// are no references.
pub fn bind_known_names<'a>(params: &'a str, names: &dyn Names) -> Cow<'a, str> {
    rewritten(params, literals(params), |text| {
        let mut places = Vec::new();
        read_with(text, Some(&PartialNames(names)), &mut places).ok()?;
        places.retain(|place| place.has_uid || place.uid != NO_OBJECT);
        renamed(text, &places, names)
    })
}

/// Uid in place of the one of a name that no object has, or several.
const NO_OBJECT: Uid = Uid(0);

/// Names in which every name is found.
struct PartialNames<'a>(&'a dyn Names);

impl Names for PartialNames<'_> {
    fn name_of(&self, kind: NameKind, uid: Uid) -> Option<Cow<'_, str>> {
        self.0.name_of(kind, uid)
    }

    fn find(&self, scope: NameScope, kind: NameKind, name: &str) -> Vec<Uid> {
        match self.0.find(scope, kind, name)[..] {
            [uid] => vec![uid],
            _ => vec![NO_OBJECT],
        }
    }

    fn all(&self, scope: NameScope, kind: NameKind) -> Vec<Cow<'_, str>> {
        self.0.all(scope, kind)
    }
}

/// The parameters with names alone in place of the uids that `leave_out` chooses, in every reference that [`bind_names`]
/// gives the same uids again. A name that stands beside its uid stays if it can.
pub fn without_uids<'a>(params: &'a str, names: &dyn Names, leave_out: impl Fn(Uid) -> bool) -> Cow<'a, str> {
    rewritten(params, literals(params), |text| {
        let mut places = Vec::new();
        let before = read_with(text, Some(names), &mut places).ok()?;
        places.retain(|place| place.has_uid && leave_out(place.uid));
        places.sort_unstable_by_key(|place| place.name.start);
        let mut out = String::with_capacity(text.len());
        let mut at = 0;
        for place in places {
            let beside = text[place.name.end..].trim_start();
            let hash = text.len() - beside.len();
            let end = hash + 1 + place.uid.to_string().len();
            let written = text.get(hash + 1..end).and_then(|digits| digits.parse().ok());
            let is_its = |name: &String| names.find(NameScope::default(), place.kind, name) == [place.uid];
            let beside_it = unquoted(&text[place.name.clone()]);
            if let Some(name) = beside_it.into_iter().chain(names.names_of(place.kind, place.uid)).find(is_its)
                && written == Some(place.uid)
            {
                out.push_str(&text[at..place.name.start]);
                out.push_str(&name_text(&name));
                at = end;
            }
        }
        out.push_str(&text[at..]);
        (read_with(&out, Some(names), &mut Vec::new()).ok()? == before).then_some(out)
    })
}

/// References as written in the parameters, with the names there, for quotation in errors. Without names if they are
/// not in the parameters.
pub fn written_as(params: &str, references: &NodeRefs) -> String {
    let mut found = references_in(params).filter(|found| found.references.as_ref() == Ok(references));
    found.next().map_or_else(|| references.to_string(), |found| found.text)
}

/// End of an error's sentence about uids that do not exist any more: the names beside them in the parameters, and the
/// nearest existing ones. Empty if there is nothing to add.
pub fn nearest_to_gone(params: &str, references: &NodeRefs, names: &dyn Names) -> String {
    let text = written_as(params, references);
    let mut places = Vec::new();
    let read = read_with(&text, None, &mut places);
    let mut said = String::new();
    for place in places.iter().filter(|place| read.is_ok() && !place.name.is_empty()) {
        let Some(name) = unquoted(&text[place.name.clone()]) else { continue };
        if names.name_of(place.kind, place.uid).is_none() {
            let hint = did_you_mean(&name, names.all(NameScope::default(), place.kind));
            said.push_str(&format!("; the {} \"{name}\" is gone{hint}", place.kind));
        }
    }
    said
}

/// The parameters with every uid changed that is a string literal of its own (`group: "0123456789abcdef"`), not part of
/// a reference. Uids for which `change` returns `None` stay.
pub(in crate::rig) fn map_uids(params: &str, mut change: impl FnMut(Uid) -> Option<Uid>) -> String {
    let uid = |text: &str| text.parse::<Uid>().ok();
    let rewritten = rewritten(params, strings(params), |text| Some(change(uid(text)?)?.to_string()));
    rewritten.into_owned()
}

/// The parameters with changed texts of the fields with one of these names, at most two brackets deep, whose value is a
/// string literal.
pub(in crate::rig) fn map_text_fields(
    params: &str,
    names: &[&str],
    change: impl FnMut(&str) -> Option<String>,
) -> String {
    let literals: Vec<Literal> = text_fields(params, names).collect();
    rewritten(params, literals.into_iter(), change).into_owned()
}

/// Names that a command gives its nodes: texts of the fields `name` of its parameters, at most two brackets deep.
pub fn given_names(params: &str) -> impl Iterator<Item = String> {
    let params = if params.contains("name") { params } else { "" };
    text_fields(params, &["name"]).map(|literal| literal.text)
}

/// The first name that a command gives which is not empty.
pub(in crate::rig) fn given_name(params: &str) -> Option<String> {
    given_names(params).find(|name| !name.is_empty())
}

/// The text of the first field with that name, at most two brackets deep, whose value is a string literal.
pub(super) fn text_field(params: &str, name: &str) -> Option<String> {
    text_fields(params, &[name]).next().map(|literal| literal.text)
}

fn text_fields(params: &str, names: &[&str]) -> impl Iterator<Item = Literal> {
    let fields = fields(params).into_iter().filter(|field| field.depth <= 2 && names.contains(&field.name));
    fields.filter_map(|field| {
        let value = params.get(field.value..field.end)?;
        let token = tokens(value).find(|token| !matches!(token.text, "Some" | "(" | "r"))?;
        decoded(params, &Token { text: token.text, start: field.value + token.start })
    })
}

struct Literal {
    range: Range<usize>,
    text: String,
    raw: bool,
}

/// String literals whose text begins with `@`.
fn literals(params: &str) -> impl Iterator<Item = Literal> {
    // Most parameters contain none, and need not be split into tokens.
    let params = if params.contains('@') || params.contains("\\u") || params.contains("\\x") { params } else { "" };
    strings(params).filter(|literal| literal.text.starts_with('@'))
}

fn strings(params: &str) -> impl Iterator<Item = Literal> {
    tokens(params).filter_map(|token| decoded(params, &token))
}

/// The text of a string literal; `None` for any other token.
fn decoded(params: &str, token: &Token) -> Option<Literal> {
    let before = &params.as_bytes()[..token.start];
    let raw = before.last() == Some(&b'r') && token.text.starts_with(['"', '#']);
    if before.last() == Some(&b'b') || raw && before.iter().rev().nth(1) == Some(&b'b') {
        return None;
    }
    if !raw && !token.text.starts_with('"') {
        return None;
    }
    let range = token.start - usize::from(raw)..token.start + token.text.len();
    let inside = token.text.strip_prefix('"').and_then(|text| text.strip_suffix('"'));
    let text = match inside.filter(|text| !raw && !text.contains(['\\', '"'])) {
        Some(plain) => plain.to_owned(),
        None => ron::from_str(&params[range.clone()]).ok()?,
    };
    Some(Literal { range, text, raw })
}

/// The parameters with the texts of literals replaced by the results of `replace`, if any.
fn rewritten(
    params: &str,
    literals: impl Iterator<Item = Literal>,
    mut replace: impl FnMut(&str) -> Option<String>,
) -> Cow<'_, str> {
    let mut out = String::new();
    let mut at = 0;
    for Literal { range, text, raw } in literals {
        let Some(next) = replace(&text).filter(|next| *next != text) else { continue };
        out.push_str(&params[at..range.start]);
        if raw && !next.contains('"') {
            let old = &params[range.clone()];
            let (open, close) = (old.find('"').unwrap_or_default() + 1, old.rfind('"').unwrap_or_default());
            out.push_str(&old[..open]);
            out.push_str(&next);
            out.push_str(&old[close..]);
        } else {
            out.push_str(&quoted(&next));
        }
        at = range.end;
    }
    if at == 0 {
        return Cow::Borrowed(params);
    }
    out.push_str(&params[at..]);
    Cow::Owned(out)
}

/// The text with current names at these places, and a uid beside each.
fn renamed(text: &str, places: &[NamedUid], names: &dyn Names) -> Option<String> {
    renamed_unless(text, places, names, |_, _| false)
}

/// The text with current names at these places, but for those whose name stays, and a uid beside each.
fn renamed_unless(
    text: &str,
    places: &[NamedUid],
    names: &dyn Names,
    stays: impl Fn(&NamedUid, &str) -> bool,
) -> Option<String> {
    let mut places: Vec<&NamedUid> = places.iter().collect();
    places.sort_unstable_by_key(|place| place.name.start);
    let mut out = String::with_capacity(text.len());
    let mut at = 0;
    for place in places {
        out.push_str(&text[at..place.name.start]);
        match names.name_of(place.kind, place.uid).filter(|_| !stays(place, text)) {
            Some(name) => out.push_str(&name_text(&name)),
            None => out.push_str(&text[place.name.clone()]),
        }
        if !place.has_uid {
            out.push_str(&format!("#{}", place.uid));
        }
        at = place.name.end;
    }
    out.push_str(&text[at..]);
    Some(out)
}

/// The names beside uids in a text.
struct KeptNames(HashMap<(NameKind, Uid), String>);

impl KeptNames {
    fn new(text: &str, places: &[NamedUid]) -> Self {
        let named = places.iter().filter(|place| !place.name.is_empty());
        Self(named.filter_map(|place| Some(((place.kind, place.uid), unquoted(&text[place.name.clone()])?))).collect())
    }
}

/// A name as written, without quotation marks and escapes.
fn unquoted(name: &str) -> Option<String> {
    match read_with(&format!("@module {name}"), None, &mut Vec::new()).ok()?.pop()?.source {
        Source::Module(name) => Some(name),
        _ => None,
    }
}

impl Names for KeptNames {
    fn name_of(&self, kind: NameKind, uid: Uid) -> Option<Cow<'_, str>> {
        self.0.get(&(kind, uid)).map(|name| Cow::Borrowed(name.as_str()))
    }

    fn find(&self, _scope: NameScope, _kind: NameKind, _name: &str) -> Vec<Uid> {
        Vec::new()
    }

    fn all(&self, _scope: NameScope, _kind: NameKind) -> Vec<Cow<'_, str>> {
        Vec::new()
    }
}
