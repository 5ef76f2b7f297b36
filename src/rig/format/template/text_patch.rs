//! Saving over a text: only what changed is written, so that comments, blank lines, the order and the style of what a
//! person wrote stay, and one changed value is one changed line.

mod insertions;
mod labels;
mod lists;
mod order;
mod parts;
pub(super) mod patch;
mod plain_rig;
mod shared_joints;

use std::{collections::HashMap, sync::Arc};

use bevy::math::{Quat, Vec3};

use super::{
    FORMAT,
    file_marks::FileMarks,
    read::read_text,
    shorthand::{Declaration, Declarations, TAG_FIELDS, TagForm},
    write::{face_text, feature_list, feature_summaries, needed_format, needs_text},
    write_template,
};
use crate::rig::{
    JointData, NodeKind, RestTransform, Rig, RigJoint, TagData, TagKind, Uid,
    format::{
        template::{quaternion, quoted, rotation_text},
        tree::{Item, NodeId, Tree},
    },
    reference::{RigNameIndex, bind_names, given_name, refresh_names, without_uids},
};
use insertions::{NamesInUse, is_short, settled};
use labels::header_labels;
use order::reordered;
pub(crate) use parts::{
    PartRigs, differing_parts, with_instance_fields, with_instances, with_instances_of, without_instances,
    write_changes_over, write_own_over,
};
use patch::Patch;
use plain_rig::says_plain_rig;
use shared_joints::share_equal_joints;

/// The text of a rig's template, as changes of a text of the same rig. `None` if `source` is no template of this rig, or
/// cannot be changed so that it says the same: [`write_template`] then writes it anew, without its comments.
pub fn write_template_over(rig: &Rig, source: &str) -> Option<String> {
    let (marks, source) = FileMarks::of(source);
    written_over(rig, &source).map(|text| marks.put_on(text))
}

fn written_over(rig: &Rig, source: &str) -> Option<String> {
    let mut before = read_text(source, 1).ok()?.rig;
    if before.uid() != rig.uid() {
        return None;
    }
    share_equal_joints(&mut before, rig);
    let declared = Declarations::find(source)?;
    let mut rewriter = Rewriter::new(rig, &before, &declared);
    header_labels(&mut rewriter.patch, &declared.tree, &before, rig);
    let text = rewriter.text();
    // What was changed makes room for what is read to compare it.
    drop((declared, before));
    said(rig, text)
}

/// The text of a rig's template as people write it: tags of the short form, names where they are enough, and no uid that follows
/// from names. `None` for a rig that such a text cannot say.
pub(crate) fn write_short_template(rig: &Rig) -> Option<String> {
    let (uid, name) = (rig.uid(), quoted(&rig.about().name));
    let source = format!("(\n    format: {FORMAT},\n    uid: \"{uid}\",\n    name: {name},\n)\n");
    let before = read_text(&source, 1).ok()?.rig;
    let declared = Declarations::find(&source)?;
    let mut rewriter = Rewriter { with_names: true, is_short: true, ..Rewriter::new(rig, &before, &declared) };
    header_labels(&mut rewriter.patch, &declared.tree, &before, rig);
    said(rig, rewriter.text())
}

/// The text, or the text in the rig's order, if that says what the rig is.
fn said(rig: &Rig, text: String) -> Option<String> {
    if says_plain_rig(rig, &text) {
        return Some(text);
    }
    let mut wanted = comparable(read_text(&write_template(rig), 1).ok()?.rig);
    share_equal_joints(&mut wanted, rig);
    let is_right = |text: &str| read_text(text, 1).is_ok_and(|read| comparable(read.rig) == wanted);
    if is_right(&text) {
        return Some(text);
    }
    let text = reordered(rig, &text)?;
    is_right(&text).then_some(text)
}

/// True if the templates of two rigs say the same. What is not in `own`, which is what a template has besides its parts, may
/// stand anywhere among groups, inputs and brothers: where the template is read, its own comes first.
pub(crate) fn says_the_same(a: &Rig, b: &Rig, own: &Rig) -> bool {
    said_with_parts(a, own).is_some_and(|said_a| said_with_parts(b, own) == Some(said_a))
}

/// A rig as its template says it, where what is in `own` comes first, in its order, then what parts bring, by its uids.
fn said_with_parts(rig: &Rig, own: &Rig) -> Option<Rig> {
    let place = |uid: Uid| (!own.is_taken(uid)).then_some(uid);
    let mut read = comparable(read_text(&write_template(rig), 1).ok()?.rig);
    read.groups.sort_by_key(|group| place(group.uid));
    read.inputs.sort_by_key(|input| place(input.uid));
    let brothers = read.joints.values_mut().map(|joint| &mut Arc::make_mut(joint).children);
    for list in brothers.chain([&mut read.roots]) {
        list.sort_by_key(|joint| place(*joint));
    }
    Some(read)
}

/// A rig whose header does not depend on the order of sockets and options, and whose parameters do not depend on blanks,
/// comments and the order of fields.
pub(super) fn comparable(mut rig: Rig) -> Rig {
    rig.about.sockets.sort_by(|a, b| a.name.cmp(&b.name));
    rig.about.options.sort_by(|a, b| a.name.cmp(&b.name));
    for joint in rig.joints.values_mut().filter(|joint| !joint.data.tags.is_empty()) {
        for tag in &mut Arc::make_mut(joint).data.tags {
            if let TagKind::Command { params, .. } = &mut tag.kind {
                *params = canonical(params);
            }
        }
    }
    rig
}

/// Parameters on one line, fields in the order of their names.
fn canonical(params: &str) -> String {
    fn write(out: &mut String, tree: &Tree, id: NodeId) {
        let node = tree.node(id);
        let Some(open) = node.bracket else { return out.push_str(tree.written(id)) };
        out.push_str(node.name);
        out.push(open);
        let mut items: Vec<&Item> = node.items.iter().collect();
        if open == '(' {
            items.sort_by_key(|item| item.key);
        }
        for item in items {
            if let Some(key) = item.key {
                out.push_str(key);
                out.push(':');
            }
            write(out, tree, item.value);
            out.push(',');
        }
        out.push(')');
    }
    let Some(tree) = Tree::parse(params) else { return params.to_owned() };
    let mut out = String::with_capacity(params.len());
    write(&mut out, &tree, tree.root());
    out
}

/// The brother before each joint that has one: nobody is looked for among thousands of brothers.
fn elder_brothers(rig: &Rig) -> HashMap<Uid, Uid> {
    let families = std::iter::once(rig.roots()).chain(rig.walk().map(|joint| joint.children.as_slice()));
    families.flat_map(|brothers| brothers.windows(2)).map(|pair| (pair[1], pair[0])).collect()
}

struct Rewriter<'d, 'a> {
    rig: &'d Rig,
    before: &'d Rig,
    /// The rig with what parts bring, which the header counts, before and now.
    whole: [&'d Rig; 2],
    declared: &'d Declarations<'a>,
    /// True in a text that leaves uids out: it gets names.
    with_names: bool,
    /// True in a text with tags of the short form.
    is_short: bool,
    names: NamesInUse,
    index: RigNameIndex<'d>,
    patch: Patch<'d, 'a>,
}

impl<'d, 'a> Rewriter<'d, 'a> {
    fn new(rig: &'d Rig, before: &'d Rig, declared: &'d Declarations<'a>) -> Self {
        let with_names = declared.all().any(|one| !one.is_written);
        Self {
            rig,
            before,
            whole: [before, rig],
            declared,
            with_names,
            is_short: is_short(declared),
            names: NamesInUse::of(rig),
            index: RigNameIndex::new(rig),
            patch: Patch::new(&declared.tree),
        }
    }

    fn tree(&self) -> &'d Tree<'a> {
        &self.declared.tree
    }

    /// The changed text. Order of what is there already stays.
    fn text(mut self) -> String {
        self.header();
        self.groups();
        self.inputs();
        self.joints();
        self.poses();
        let (has_unsettled, declared, with_names) = (self.has_unsettled(), self.declared, self.with_names);
        let text = self.patch.text();
        // What names were looked up in makes room for what is read to lay joints out.
        drop((self.names, self.index));
        if has_unsettled { settled(text, declared, with_names) } else { text }
    }

    fn header(&mut self) {
        let (root, rig) = (self.tree().root(), self.rig);
        if self.declared.format() < needed_format(rig) {
            self.patch.set(root, "format", &needed_format(rig).to_string());
        }
        let (old, new) = (self.before.about(), rig.about());
        self.keep_uid(root, &self.declared.rig, ["rig", &new.name]);
        let fields = [
            ("name", &old.name, &new.name),
            ("version", &old.version, &new.version),
            ("kind", &old.kind, &new.kind),
            ("author", &old.author, &new.author),
            ("description", &old.description, &new.description),
        ];
        for (field, old, new) in fields {
            self.set_text(root, field, old, new);
        }
        if old.preview != new.preview {
            self.patch.set_or_remove(root, "preview", new.preview.as_deref().map(quoted).as_deref());
        }
        let (tree, [before, rig]) = (self.tree(), self.whole);
        if let Some(count) = tree.field(root, "joint_count")
            && tree.written(count.value) != rig.len().to_string()
        {
            self.patch.set(root, "joint_count", &rig.len().to_string());
        }
        if tree.field(root, "features").is_some() && feature_summaries(rig) != feature_summaries(before) {
            self.patch.set(root, "features", &feature_list(rig));
        }
        if tree.field(root, "needs").is_some()
            && let Some(needs) = needs_text(rig)
            && needs_text(before).as_ref() != Some(&needs)
        {
            self.patch.set(root, "needs", &needs);
        }
    }

    /// Writes a uid that does not follow from the name any more.
    fn keep_uid(&mut self, node: NodeId, declared: &Declaration, names: [&str; 2]) {
        if !declared.is_written && declared.uid != Uid::derived(names) && declared.derived == Some(declared.uid) {
            self.patch.put_first(node, &format!("uid: \"{}\"", declared.uid));
        }
    }

    fn set_text(&mut self, node: NodeId, field: &str, old: &str, new: &str) {
        if old != new {
            self.patch.set_or_remove(node, field, (!new.is_empty()).then(|| quoted(new)).as_deref());
        }
    }

    fn joints(&mut self) {
        let (rig, before, declared, tree) = (self.rig, self.before, self.declared, self.tree());
        let both = |one: &Declaration| Some((before.joint(one.uid)?, rig.joint(one.uid)?));
        for (declared, tags) in declared.joints.iter().zip(&declared.tags) {
            let Some((old, new)) = both(declared) else { continue };
            self.joint(declared, old, new);
            for tag in tags {
                let found = |rig: &Rig, joint: &RigJoint| rig.tag_place(joint.data.uid, tag.uid);
                let old = found(before, old).and_then(|place| old.data.tags.get(place));
                let new = found(rig, new).and_then(|place| new.data.tags.get(place));
                if let (Some(old), Some(new)) = (old, new) {
                    self.tag(tag, old, new);
                }
            }
        }
        let mut patch = std::mem::replace(&mut self.patch, Patch::new(tree));
        for (declared, tags) in declared.joints.iter().zip(&declared.tags) {
            let Some((_, new)) = both(declared) else { continue };
            let wanted: Vec<Uid> = new.data.tags.iter().map(|tag| tag.uid).collect();
            let text = |uid: Uid| rig.find_tag(uid).map(|(_, tag)| self.new_tag(tag)).unwrap_or_default();
            patch.list(declared.node, "tags", tags, &wanted, None, text);
        }
        let wanted: Vec<Uid> = rig.walk().map(|joint| joint.data.uid).collect();
        let text = |uid: Uid| rig.joint(uid).map(|joint| self.new_joint(joint)).unwrap_or_default();
        // A joint comes behind its elder brother, or else behind its parent.
        let elders = elder_brothers(rig);
        let behind = |uid: Uid| elders.get(&uid).copied().or_else(|| rig.joint(uid)?.parent);
        patch.list(tree.root(), "joints", &declared.joints, &wanted, Some(&behind), text);
        self.patch = patch;
    }

    fn joint(&mut self, declared: &Declaration, old: &RigJoint, new: &RigJoint) {
        let node = declared.node;
        let (was, is): (&JointData, &JointData) = (&old.data, &new.data);
        self.keep_uid(node, declared, ["joint", is.label.as_deref().unwrap_or_default()]);
        if was.label != is.label {
            self.patch.set_or_remove(node, "label", is.label.as_deref().map(quoted).as_deref());
        }
        let label = |rig: &Rig, uid: Uid| rig.joint(uid).and_then(|joint| joint.data.label.clone());
        let group = |rig: &Rig, uid: Uid| rig.group(uid).map(|group| group.name.clone());
        let is_there = |uid: &Uid| self.rig.joint(*uid).is_some();
        let (mirror, in_group) = (is.mirror.filter(is_there), is.group);
        let (was_below, is_below) = (self.parent_of(0, old), self.parent_of(1, new));
        match is_below.filter(|_| new.parent.is_none()) {
            Some(parent) => self.hang(node, was_below, parent),
            None if was_below.is_some() || is_below.is_some() => {
                self.refer(node, "parent", was_below, is_below, &label);
            }
            // A parent that no part has brought yet.
            None => {}
        }
        self.refer(node, "mirror", was.mirror, mirror, &label);
        self.refer(node, "group", was.group, in_group, &group);
        if was.kind != is.kind {
            self.patch.set_or_remove(node, "kind", (is.kind == NodeKind::Null).then_some("Null"));
        }
        if was.locked != is.locked {
            self.patch.set_or_remove(node, "locked", is.locked.then_some("true"));
        }
        self.rest(node, &was.rest, &is.rest);
        if was.face != is.face {
            self.patch.set_or_remove(node, "face", is.face.as_ref().map(face_text).as_deref());
        }
    }

    fn rest(&mut self, node: NodeId, old: &RestTransform, new: &RestTransform) {
        self.patch.set_numbers(node, "translation", &old.translation.to_array(), &new.translation.to_array());
        if old.rotation != new.rotation {
            self.rotation(node, old.rotation, new.rotation);
        }
        match new.scale == Vec3::ONE && old.scale != Vec3::ONE {
            true => self.patch.set_or_remove(node, "scale", None),
            false => self.patch.set_numbers(node, "scale", &old.scale.to_array(), &new.scale.to_array()),
        }
    }

    /// Writes a rotation in whole thousandths of a degree if that is how it is written and exact, else as a quaternion.
    fn rotation(&mut self, node: NodeId, old: Quat, new: Quat) {
        let tree = self.tree();
        let written = tree.field(node, "rotation").map(|field| tree.node(field.value).items.len());
        if new == Quat::IDENTITY {
            return self.patch.set_or_remove(node, "rotation", None);
        }
        if written == Some(4) {
            return self.patch.set_numbers(node, "rotation", &old.to_array(), &new.to_array());
        }
        let text = if written == Some(3) { rotation_text(new) } else { quaternion(new) };
        self.patch.set(node, "rotation", &text);
    }

    /// Writes whom a field refers to, if that has changed, or if the name in the text is another's now.
    fn refer(
        &mut self,
        node: NodeId,
        field: &str,
        old: Option<Uid>,
        new: Option<Uid>,
        name: &dyn Fn(&Rig, Uid) -> Option<String>,
    ) {
        let tree = self.tree();
        let written = tree.string(node, field).filter(|written| written.parse::<Uid>().is_err());
        let current = new.and_then(|uid| name(self.rig, uid));
        let is_kept = old == new && (written.is_none() || written == current);
        let is_unique = current.as_ref().is_some_and(|current| self.names.is_unique(field, current));
        if is_kept && (written.is_none() || is_unique) {
            return;
        }
        let text = new.map(|uid| match current.filter(|_| is_unique && self.with_names) {
            Some(name) => quoted(&name),
            None => format!("\"{uid}\""),
        });
        self.patch.set_or_remove(node, field, text.as_deref());
    }

    fn tag(&mut self, declared: &Declaration, old: &TagData, new: &TagData) {
        let (tree, node) = (self.tree(), declared.node);
        let form = TagForm::of(tree, node);
        if old.enabled != new.enabled {
            self.patch.set_or_remove(node, "enabled", (!new.enabled).then_some("false"));
        }
        self.set_text(node, "comment", &old.comment, &new.comment);
        match (&old.kind, &new.kind) {
            (
                TagKind::Command { module: was, feature: was_in, params: old },
                TagKind::Command { module, params, feature },
            ) if was == module => {
                let is_there = |uid: &Uid| self.rig.find_tag(*uid).is_some();
                let feature = feature.filter(is_there);
                if *was_in != feature {
                    self.patch.set_or_remove(node, "feature", feature.map(|uid| format!("\"{uid}\"")).as_deref());
                }
                self.parameters(declared, matches!(form, Some(TagForm::Short(_))), params);
                // The uid follows from the name that the command gives.
                if !declared.is_written && given_name(old) != given_name(params) {
                    self.patch.put_first(node, &format!("uid: \"{}\"", declared.uid));
                }
            }
            (
                TagKind::Feature { kind: was_kind, name: was_name, switch: was_switch, choice: was_choice },
                TagKind::Feature { kind, name, switch, choice },
            ) => {
                if !declared.is_written && (was_kind, was_name, was_switch) != (kind, name, switch) {
                    self.patch.put_first(node, &format!("uid: \"{}\"", declared.uid));
                }
                self.set_text(node, "kind", was_kind, kind);
                self.set_text(node, "name", was_name, name);
                self.set_text(node, "switch", was_switch, switch);
                self.set_text(node, "choice", was_choice, choice);
            }
            _ => {
                let text = self.new_tag(new);
                self.patch.replace(node, &text);
            }
        }
    }

    fn parameters(&mut self, declared: &Declaration, is_short: bool, params: &str) {
        let (tree, node) = (self.tree(), declared.node);
        let current = refresh_names(params, &self.index);
        let Some(now) = Tree::parse(&current) else { return };
        let field = tree.field(node, "params");
        match (is_short, field) {
            (true, _) if tree.node(node).bracket.is_none() => {
                if !now.node(now.root()).items.is_empty() {
                    let module = tree.written(node);
                    self.patch.replace(node, &format!("{module}{}", self.styled(&current)));
                }
            }
            (true, _) => self.fields(node, &now, now.root(), &TAG_FIELDS),
            (false, Some(field)) => self.value(field.value, &now, now.root()),
            (false, None) if !now.node(now.root()).items.is_empty() => {
                self.patch.set(node, "params", &self.styled(&current));
            }
            (false, None) => {}
        }
    }

    /// Changes a value into another one, field by field where both are structs.
    fn value(&mut self, node: NodeId, now: &Tree, value: NodeId) {
        let tree = self.tree();
        let is_struct = |tree: &Tree, id: NodeId| {
            let node = tree.node(id);
            node.bracket == Some('(') && !node.items.is_empty() && node.items.iter().all(|item| item.key.is_some())
        };
        let (bound, _) = bind_names(tree.written(node), &self.index);
        if canonical(&refresh_names(&bound, &self.index)) == canonical(now.written(value)) {
            return;
        }
        if is_struct(tree, node) && is_struct(now, value) && tree.node(node).name == now.node(value).name {
            self.fields(node, now, value, &[]);
        } else {
            let text = self.styled(now.written(value));
            self.patch.replace(node, &text);
        }
    }

    fn fields(&mut self, node: NodeId, now: &Tree, value: NodeId, others: &[&str]) {
        let tree = self.tree();
        for item in tree.node(node).items {
            let Some(key) = item.key.filter(|key| !others.contains(key)) else { continue };
            // Which of two of a name is meant, nobody knows.
            if tree.node(node).items.iter().filter(|other| other.key == Some(key)).count() > 1 {
                continue;
            }
            match now.field(value, key) {
                Some(other) => self.value(item.value, now, other.value),
                None => self.patch.set_or_remove(node, key, None),
            }
        }
        for item in now.node(value).items {
            if let Some(key) = item.key.filter(|key| tree.field(node, key).is_none()) {
                let text = self.styled(now.written(item.value));
                self.patch.set(node, key, &text);
            }
        }
    }

    /// A value as it is written into this text: references without uids where the text has names.
    fn styled(&self, text: &str) -> String {
        if self.with_names { without_uids(text, &self.index, |_| true).into_owned() } else { text.to_owned() }
    }
}
