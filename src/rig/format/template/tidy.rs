//! Layout of a template's text, and its uids written in or taken out.

use std::collections::HashSet;

use super::{
    over::{comparable, patch::Patch},
    read::read_text,
    shorthand::{Declaration, Declared, TagForm, feature_name},
};
use crate::rig::{
    Rig, SourceError, Uid,
    format::{
        layout::laid_out,
        template::quoted,
        tree::{NodeId, Tree},
    },
    reference::{bind_names, without_uids},
};

/// What becomes of uids when a template is formatted.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum UidStyle {
    /// As they are.
    #[default]
    Kept,
    /// Everything has its uid, and so has every reference.
    Written,
    /// A uid that follows from names is left out, beside names in references, too.
    Derived,
}

/// The text of a template in its layout: what fits in 100 columns stands on one line, else every field has its own.
/// Comments, blank lines and the order stay, and the rig is the same.
///
/// # Errors
/// What keeps the text from being read as a template, and comments for which there is no place in the layout.
pub fn format_template(source: &str, uids: UidStyle) -> Result<String, SourceError> {
    let before = read_text(source, 1)?;
    let text = match (uids, Declared::find(source)) {
        (UidStyle::Kept, _) | (_, None) => source.to_owned(),
        (style, Some(declared)) => Uids::new(&declared, &before.rig, style).text(),
    };
    let text = laid_out(&text)?;
    let before = comparable(before.rig);
    match read_text(&text, 1).is_ok_and(|after| comparable(after.rig) == before) {
        true => Ok(text),
        false => Err(SourceError::at(source, 0, "formatted, the template would say something else; it stays as it is")),
    }
}

struct Uids<'d, 'a> {
    declared: &'d Declared<'a>,
    rig: &'d Rig,
    style: UidStyle,
    /// Uids that the text will not have.
    derived: HashSet<Uid>,
    patch: Patch<'d, 'a>,
}

impl<'d, 'a> Uids<'d, 'a> {
    fn new(declared: &'d Declared<'a>, rig: &'d Rig, style: UidStyle) -> Self {
        let follows = |one: &&Declaration| !one.is_written || one.derived == Some(one.uid);
        let derived = declared.all().filter(follows).map(|one| one.uid).collect();
        Self { declared, rig, style, derived, patch: Patch::new(&declared.tree) }
    }

    fn text(mut self) -> String {
        // Format 1 has no shorthand.
        if self.style == UidStyle::Derived && self.declared.format() < super::FORMAT {
            self.patch.set(self.tree().root(), "format", &super::FORMAT.to_string());
        }
        let declared = self.declared;
        for one in std::iter::once(&declared.rig).chain(declared.all()) {
            self.uid(one);
        }
        for (joint, tags) in declared.joints.iter().zip(&declared.tags) {
            for field in ["parent", "mirror"] {
                self.refer(joint.node, field, &declared.joints);
            }
            self.refer(joint.node, "group", &declared.groups);
            for tag in tags {
                self.feature(tag.node, tags);
                self.parameters(tag.node);
            }
        }
        self.patch.text()
    }

    fn tree(&self) -> &'d Tree<'a> {
        &self.declared.tree
    }

    fn uid(&mut self, one: &Declaration) {
        match self.style {
            UidStyle::Written if !one.is_written => {
                self.patch.put_first(one.node, &format!("uid: \"{}\"", one.uid));
            }
            UidStyle::Derived if one.is_written && one.derived == Some(one.uid) => {
                self.patch.set_or_remove(one.node, "uid", None);
            }
            _ => {}
        }
    }

    fn refer(&mut self, node: NodeId, field: &str, among: &[Declaration]) {
        let Some(written) = self.tree().string(node, field) else { return };
        let called = |name: &str| among.iter().filter(|one| one.name.as_deref() == Some(name)).count();
        let one = match written.parse::<Uid>() {
            Ok(uid) => among.iter().find(|one| one.uid == uid),
            Err(_) => among.iter().find(|one| one.name.as_deref() == Some(&*written)),
        };
        let Some(one) = one else { return };
        let text = match (self.style, &one.name) {
            (UidStyle::Derived, Some(name)) if self.derived.contains(&one.uid) && called(name) == 1 => quoted(name),
            (UidStyle::Written, _) => format!("\"{}\"", one.uid),
            _ => return,
        };
        self.patch.set(node, field, &text);
    }

    fn feature(&mut self, node: NodeId, own: &[Declaration]) {
        let tree = self.tree();
        let Some(written) = tree.string(node, "feature") else { return };
        let all = || self.declared.tags.iter().flatten();
        let name_of = |one: &Declaration| feature_name(tree, one.node);
        let count = |name: &str, mut among: Box<dyn Iterator<Item = &Declaration> + '_>| {
            let first = among.find(|one| name_of(one).as_deref() == Some(name)).map(|one| one.uid);
            (first, among.filter(|one| name_of(one).as_deref() == Some(name)).count())
        };
        let found = |name: &str| match count(name, Box::new(own.iter())) {
            (Some(uid), 0) => Some(uid),
            _ => count(name, Box::new(all())).0.filter(|_| count(name, Box::new(all())).1 == 0),
        };
        let text = match (self.style, written.parse::<Uid>()) {
            (UidStyle::Written, Err(_)) => found(&written).map(|uid| format!("\"{uid}\"")),
            (UidStyle::Derived, Ok(uid)) if self.derived.contains(&uid) => {
                let name = all().find(|one| one.uid == uid).and_then(name_of);
                name.filter(|name| found(name) == Some(uid)).map(|name| quoted(&name))
            }
            _ => None,
        };
        if let Some(text) = text {
            self.patch.set(node, "feature", &text);
        }
    }

    /// References in the parameters of a command.
    fn parameters(&mut self, tag: NodeId) {
        let tree = self.tree();
        if !matches!(TagForm::of(tree, tag), Some(TagForm::Command | TagForm::Short(_))) {
            return;
        }
        let mut open = vec![tag];
        while let Some(node) = open.pop() {
            open.extend(tree.node(node).items.iter().map(|item| item.value));
            let written = tree.written(node);
            if tree.node(node).bracket.is_some() || !written.contains('@') {
                continue;
            }
            let text = match self.style {
                UidStyle::Written => bind_names(written, self.rig).0,
                UidStyle::Derived => without_uids(written, self.rig, |uid| self.derived.contains(&uid)),
                UidStyle::Kept => continue,
            };
            if text != written {
                self.patch.replace(node, &text);
            }
        }
    }
}
