//! Writing the text form of references, with or without names.

use std::fmt::Write;

use super::{GroupScope, NameKind, Names, NodeRef, Pick, PickAt, RigScope, Source, Top, text::is_bare};
use crate::rig::Uid;

/// Words with a meaning of their own where a name may be.
const RESERVED: [&str; 3] = ["any", "own", "this"];

/// Writes a union of references.
pub(super) fn written(references: &[NodeRef], names: Option<&dyn Names>) -> String {
    if references.is_empty() {
        return "@none".to_owned();
    }
    let mut out = String::new();
    for (number, reference) in references.iter().enumerate() {
        if number > 0 {
            out.push_str(" + ");
        }
        write_one(&mut out, reference, names);
    }
    out
}

fn write_one(out: &mut String, reference: &NodeRef, names: Option<&dyn Names>) {
    let named = |out: &mut String, kind, uid: Uid| {
        if let Some(name) = names.and_then(|names| names.name_of(kind, uid)) {
            out.push_str(&name_text(&name));
        }
        // Writing to a `String` does not fail.
        let _ = write!(out, "#{uid}");
    };
    out.push('@');
    match &reference.source {
        Source::Any => out.push_str("any"),
        Source::This => out.push_str("this"),
        Source::Root => out.push_str("root"),
        Source::Joints => out.push_str("joints"),
        Source::Joint(uid) => {
            out.push_str("joint ");
            named(out, NameKind::Joint, *uid);
        }
        Source::Hierarchy(Top::This) => out.push_str("hierarchy this"),
        Source::Hierarchy(Top::Joint(uid)) => {
            out.push_str("hierarchy ");
            named(out, NameKind::Joint, *uid);
        }
        Source::Command(uid) => {
            out.push_str("command ");
            named(out, NameKind::Command, *uid);
        }
        Source::Input(uid) => {
            out.push_str("input ");
            named(out, NameKind::Input, *uid);
        }
        Source::Module(module) => {
            out.push_str("module ");
            out.push_str(&name_text(module));
        }
    }
    if let RigScope::Rig(uid) = reference.rig {
        out.push_str(" rig:");
        named(out, NameKind::Rig, uid);
    }
    match reference.group {
        GroupScope::Any => {}
        GroupScope::Own => out.push_str(" group:own"),
        GroupScope::Group(uid) => {
            out.push_str(" group:");
            named(out, NameKind::Group, uid);
        }
    }
    if let Some(uid) = reference.label {
        out.push_str(" label:");
        named(out, NameKind::Label, uid);
    }
    if !reference.types.is_any() {
        out.push_str(" type:");
        out.push_str(&reference.types.names().collect::<Vec<_>>().join(","));
    }
    if let Some(role) = &reference.role {
        out.push_str(" role:");
        out.push_str(&name_text(role));
    }
    if let Pick::List(places) = &reference.pick {
        let places: Vec<String> = places.iter().map(place_text).collect();
        out.push_str(" pick:");
        out.push_str(if places.is_empty() { "none" } else { "" });
        out.push_str(&places.join(","));
    }
}

fn place_text(place: &PickAt) -> String {
    match place {
        PickAt::Start => "START".to_owned(),
        PickAt::Middle => "MIDDLE".to_owned(),
        PickAt::End => "END".to_owned(),
        PickAt::Number(number) => number.to_string(),
    }
}

/// A name in its written form: bare if possible.
pub(super) fn name_text(name: &str) -> String {
    if !name.is_empty() && name.chars().all(is_bare) && !RESERVED.contains(&name) {
        return name.to_owned();
    }
    let mut out = String::with_capacity(name.len() + 2);
    out.push('\'');
    for c in name.chars() {
        match c {
            '\'' => out.push_str("\\'"),
            '\\' => out.push_str("\\\\"),
            '\n' => out.push_str("\\n"),
            '\r' => out.push_str("\\r"),
            '\t' => out.push_str("\\t"),
            c if c.is_control() => {
                let _ = write!(out, "\\u{{{:x}}}", c as u32);
            }
            c => out.push(c),
        }
    }
    out.push('\'');
    out
}
