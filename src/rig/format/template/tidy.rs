//! Layout of a template's text, and its uids written in or taken out.

use std::collections::{HashMap, HashSet};

use super::{
    read::{bind_references, read_text},
    shorthand::{Declaration, Declarations, NameError, NameIndex, TAG_FIELDS, TagForm, feature_name},
    text_patch::{comparable, patch::Patch},
};
use crate::rig::{
    Rig, SourceError, Uid,
    format::{
        layout::laid_out,
        template::quoted,
        tree::{Item, NodeId, Tree},
    },
    reference::{NameKind, RigNameIndex, bind_names, without_uids},
};

/// Treatment of uids when a template is formatted.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum UidStyle {
    /// Uids as they are.
    #[default]
    Kept,
    /// Uids of everything, and of every reference.
    Written,
    /// A uid that follows from names is left out, beside names in references, too, unless the template has parts.
    Derived,
}

/// The text of a template in its layout: what fits in 100 columns stands on one line, else every field has its own.
/// Comments, blank lines and the order stay, and the rig is the same.
///
/// # Errors
/// What keeps the text from being read as a template, and comments for which there is no place in the layout.
pub fn format_template(source: &str, uids: UidStyle) -> Result<String, SourceError> {
    let before = read_text(source, 1)?;
    let text = match (uids, Declarations::find(source)) {
        (UidStyle::Kept, _) | (_, None) => source.to_owned(),
        (style, Some(declared)) => Uids::new(&declared, &before.rig, style, !before.parts.is_empty()).text(),
    };
    let text = laid_out(&text)?;
    // Names that parts bring are bound once those are there.
    let said = |mut rig: Rig| {
        bind_references(&mut rig, &mut Vec::new());
        comparable(rig)
    };
    let before = said(before.rig);
    match read_text(&text, 1).is_ok_and(|after| said(after.rig) == before) {
        true => Ok(text),
        false => Err(SourceError::at(source, 0, "formatted, the template would say something else; it stays as it is")),
    }
}

struct Uids<'d, 'a> {
    declared: &'d Declarations<'a>,
    names: RigNameIndex<'d>,
    style: UidStyle,
    has_parts: bool,
    called: NameIndex<'d, 'a>,
    by_uid: HashMap<Uid, &'d Declaration>,
    /// Uids that the text will not have.
    derived: HashSet<Uid>,
    patch: Patch<'d, 'a>,
}

impl<'d, 'a> Uids<'d, 'a> {
    fn new(declared: &'d Declarations<'a>, rig: &'d Rig, style: UidStyle, has_parts: bool) -> Self {
        let follows = |one: &&Declaration| !one.is_written || one.derived == Some(one.uid);
        let derived = declared.all().filter(follows).map(|one| one.uid).collect();
        let (called, patch) = (NameIndex::new(declared), Patch::new(&declared.tree));
        let by_uid = declared.all().map(|one| (one.uid, one)).collect();
        Self { declared, called, by_uid, names: RigNameIndex::new(rig), style, has_parts, derived, patch }
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
                self.refer(joint.node, field, NameKind::Joint);
            }
            self.refer(joint.node, "group", NameKind::Group);
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

    fn refer(&mut self, node: NodeId, field: &str, kind: NameKind) {
        let Some(written) = self.tree().string(node, field) else { return };
        let uid = written.parse::<Uid>().or_else(|_| self.called.find(&written, kind));
        let Some(one) = uid.ok().and_then(|uid| self.by_uid.get(&uid)) else { return };
        let text = match (self.style, &one.name) {
            (UidStyle::Derived, Some(name)) if self.is_only(one.uid, self.called.find(name, kind)) => quoted(name),
            (UidStyle::Written, _) => format!("\"{}\"", one.uid),
            _ => return,
        };
        self.patch.set(node, field, &text);
    }

    fn feature(&mut self, node: NodeId, own: &[Declaration]) {
        let tree = self.tree();
        let Some(written) = tree.string(node, "feature") else { return };
        let text = match (self.style, written.parse::<Uid>()) {
            (UidStyle::Written, Err(_)) => self.called.feature(&written, own).ok().map(|uid| format!("\"{uid}\"")),
            (UidStyle::Derived, Ok(uid)) => {
                let name = self.by_uid.get(&uid).and_then(|one| feature_name(tree, one.node));
                name.filter(|name| self.is_only(uid, self.called.feature(name, own))).map(|name| quoted(&name))
            }
            _ => None,
        };
        if let Some(text) = text {
            self.patch.set(node, "feature", &text);
        }
    }

    /// True if a name means that thing, whose uid the text will not have.
    fn is_only(&self, uid: Uid, named: Result<Uid, NameError>) -> bool {
        named == Ok(uid) && self.derived.contains(&uid)
    }

    /// References in the parameters of a command.
    fn parameters(&mut self, tag: NodeId) {
        let tree = self.tree();
        let mut open: Vec<NodeId> = match TagForm::of(tree, tag) {
            Some(TagForm::Command) => tree.field(tag, "params").map(|params| params.value).into_iter().collect(),
            Some(TagForm::Short(_)) => {
                let is_parameter = |item: &&Item| item.key.is_none_or(|key| !TAG_FIELDS.contains(&key));
                tree.node(tag).items.iter().filter(is_parameter).map(|item| item.value).collect()
            }
            _ => return,
        };
        while let Some(node) = open.pop() {
            open.extend(tree.node(node).items.iter().map(|item| item.value));
            let written = tree.written(node);
            if tree.node(node).bracket.is_some() || !written.contains('@') {
                continue;
            }
            let text = match self.style {
                UidStyle::Written => bind_names(written, &self.names).0,
                // A name alone may be that of something that a part brings, too.
                UidStyle::Derived if self.has_parts => continue,
                UidStyle::Derived => without_uids(written, &self.names, |uid| self.derived.contains(&uid)),
                UidStyle::Kept => continue,
            };
            if text != written {
                self.patch.replace(node, &text);
            }
        }
    }
}
