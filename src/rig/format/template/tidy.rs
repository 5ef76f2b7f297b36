//! Layout of a template's text, and its uids written in or taken out.

use std::{
    collections::{HashMap, HashSet},
    fmt::{self, Write},
    hash::{DefaultHasher, Hasher},
};

use super::{
    Template,
    read::{bind_references, derived_tag_uids, read_text},
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
    part::{PartChange, PartInstance},
    reference::{NameKind, RigNameIndex, with_uids, without_uids},
};

/// Treatment of uids when a template is formatted.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum UidStyle {
    /// Uids as they are.
    #[default]
    Kept,
    /// Uids of everything but what parts bring, also of tags that changes of parts add, and beside the names in references.
    Written,
    /// A uid that follows from names is left out, beside names in references, too, unless the template has parts: what these
    /// bring may have the same names, see [`format_with_parts`].
    Derived,
}

/// The text of a template in its layout: what fits in 100 columns stands on one line, else every field has its own.
/// Comments, blank lines and the order stay, and the rig is the same.
///
/// # Errors
/// What keeps the text from being read as a template, and comments for which there is no place in the layout.
pub fn format_template(source: &str, uids: UidStyle) -> Result<String, SourceError> {
    format_with_parts(source, uids, None)
}

/// The text of a template in its layout, as [`format_template`] gives it. `whole` is the template with its parts: with it,
/// [`UidStyle::Derived`] leaves out uids beside names that nothing else has there, either.
///
/// # Errors
/// See [`format_template`].
pub fn format_with_parts(source: &str, uids: UidStyle, whole: Option<&Rig>) -> Result<String, SourceError> {
    let Template { rig, parts, .. } = read_text(source, 1)?;
    let named = match uids {
        UidStyle::Derived if !parts.is_empty() => whole,
        _ => Some(&rig),
    };
    let written = match uids {
        UidStyle::Kept => None,
        style => Declarations::find(source).map(|declared| Uids::new(&declared, named, &parts, style).text()),
    };
    // Names that parts bring are bound once those are there. Of large templates, one rig or one tree is held at a time.
    let said = |mut rig: Rig| {
        bind_references(&mut rig, &mut Vec::new());
        fingerprint(comparable(rig))
    };
    let before = said(rig);
    // A comment without a place is told with its place in the source.
    let text =
        laid_out(written.as_deref().unwrap_or(source)).map_err(|error| laid_out(source).err().unwrap_or(error))?;
    match read_text(&text, 1).is_ok_and(|after| said(after.rig) == before) {
        true => Ok(text),
        false => Err(SourceError::at(source, 0, "formatted, the template would say something else; it stays as it is")),
    }
}

/// Hash of all that a rig holds. Joints come in the order of the hierarchy, whatever the order in their map.
fn fingerprint(mut rig: Rig) -> u64 {
    let mut hash = HashedText(DefaultHasher::new());
    // Hashes take all text.
    for joint in rig.walk() {
        let _ = write!(hash, "{:?} {:?}", joint.parent, joint.data);
    }
    // Tags are those of the joints.
    rig.joints.clear();
    rig.tags.clear();
    let _ = write!(hash, "{rig:?}");
    hash.0.finish()
}

/// Text that is hashed as it is written.
struct HashedText(DefaultHasher);

impl Write for HashedText {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        self.0.write(text.as_bytes());
        Ok(())
    }
}

struct Uids<'d, 'a> {
    declared: &'d Declarations<'a>,
    /// Names of all that references may mean; `None` if that is not known.
    names: Option<RigNameIndex<'d>>,
    parts: &'d [PartInstance],
    style: UidStyle,
    called: NameIndex<'d>,
    by_uid: HashMap<Uid, &'d Declaration>,
    /// Uids that the text will not have.
    derived: HashSet<Uid>,
    patch: Patch<'d, 'a>,
}

impl<'d, 'a> Uids<'d, 'a> {
    fn new(declared: &'d Declarations<'a>, named: Option<&'d Rig>, parts: &'d [PartInstance], style: UidStyle) -> Self {
        let follows = |one: &&Declaration| !one.is_written || one.derived == Some(one.uid);
        let derived = declared.all().filter(follows).map(|one| one.uid).collect();
        let (called, patch) = (NameIndex::new(declared), Patch::new(&declared.tree));
        let by_uid = declared.all().map(|one| (one.uid, one)).collect();
        Self { declared, called, by_uid, names: named.map(RigNameIndex::new), parts, style, derived, patch }
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
        self.instances();
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

    /// Uids of part instances.
    fn instances(&mut self) {
        let tree = self.tree();
        for (item, part) in tree.elements(tree.root(), "parts").iter().zip(self.parts) {
            let is_derived = part.uid == PartInstance::derived_uid(&part.part, &part.name, &part.onto);
            match (self.style, tree.field(item.value, "uid").is_some()) {
                (UidStyle::Written, false) => self.patch.put_first(item.value, &format!("uid: \"{}\"", part.uid)),
                (UidStyle::Derived, true) if is_derived => self.patch.set_or_remove(item.value, "uid", None),
                _ => {}
            }
            for (change, known) in tree.elements(item.value, "changes").iter().zip(&part.changes) {
                self.added_tags(part, change.value, known);
            }
        }
    }

    /// Uids of the tags that a change of a part instance adds to a joint.
    fn added_tags(&mut self, part: &PartInstance, change: NodeId, known: &PartChange) {
        let tree = self.tree();
        let (Some(joint), Some(list)) = (&known.joint, tree.field(change, "tags")) else { return };
        let derived = derived_tag_uids(part, joint, tree.written(list.value));
        let tags = tree.elements(change, "tags").iter().zip(&known.tags).zip(derived);
        for ((item, tag), derived) in tags {
            match (self.style, tree.field(item.value, "uid").is_some()) {
                (UidStyle::Written, false) => self.patch.put_first(item.value, &format!("uid: \"{}\"", tag.uid)),
                (UidStyle::Derived, true) if derived == Some(tag.uid) => {
                    self.patch.set_or_remove(item.value, "uid", None);
                }
                _ => {}
            }
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
        // A name alone may be that of something that a part brings, too.
        let Some(names) = &self.names else { return };
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
                UidStyle::Written => with_uids(written, names),
                UidStyle::Derived => without_uids(written, names, |uid| self.derived.contains(&uid)),
                UidStyle::Kept => continue,
            };
            if text != written {
                self.patch.replace(node, &text);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fingerprints_tell_rigs_apart_and_not_their_layouts() {
        let of = |text: &str| fingerprint(read_text(text, 1).unwrap().rig);
        let joint = |number: usize, more: &str| {
            let parent = number.checked_sub(1).map_or(String::new(), |above| format!("parent: \"j{}\", ", above / 3));
            format!("(label: \"j{number}\", {parent}translation: (0, 0.1, 0){more})")
        };
        let text = |more: &str| {
            let joints: Vec<String> =
                (0..40).map(|number| joint(number, if number == 30 { more } else { "" })).collect();
            format!("(format: 2, name: \"n\", joints: [{}])", joints.join(", "))
        };
        let plain = of(&text(""));
        assert_eq!(plain, of(&laid_out(&text("")).unwrap()));
        for more in [", rotation: (0, 0, 1, 0)", ", locked: true", ", tags: [null]"] {
            assert_ne!(plain, of(&text(more)), "{more}");
        }
    }
}
