//! Joints and tags that come into a text: in the form and the layout that it has.

use std::{
    collections::{HashMap, HashSet},
    ops::Range,
};

use super::{
    super::{
        shorthand::{Declaration, Declarations, FIRST_FORMAT, TagForm},
        write::{feature_uids, joint_text, tag_text},
    },
    Rewriter,
    order::with_changes,
    parts::short_tag,
    patch::Patch,
};
use crate::rig::{
    Rig, RigJoint, TagData, Uid,
    format::{
        layout::value_laid_out,
        template::quoted,
        tree::{NodeId, Tree},
    },
    reference::without_uids,
};

/// Numbers of joints and groups with each name, and the features of a rig.
pub(super) struct NamesInUse {
    joints: HashMap<String, usize>,
    groups: HashMap<String, usize>,
    pub features: HashSet<Uid>,
}

impl NamesInUse {
    pub fn of(rig: &Rig) -> Self {
        let (mut joints, mut groups) = (HashMap::new(), HashMap::new());
        for label in rig.walk().filter_map(|joint| joint.data.label.clone()) {
            *joints.entry(label).or_default() += 1;
        }
        for group in rig.groups() {
            *groups.entry(group.name.clone()).or_default() += 1;
        }
        Self { joints, groups, features: feature_uids(rig) }
    }

    /// Returns `true` if one thing alone has that name: a group for the field `group`, else a joint.
    pub fn is_unique(&self, field: &str, name: &str) -> bool {
        let names = if field == "group" { &self.groups } else { &self.joints };
        names.get(name) == Some(&1)
    }
}

/// Returns `true` for a text whose tags have the short form, or would have it if there were any.
pub(super) fn is_short(declared: &Declarations) -> bool {
    let forms = || declared.tags.iter().flatten().filter_map(|tag| TagForm::of(&declared.tree, tag.node));
    let has_short = forms().any(|form| matches!(form, TagForm::Short(_)));
    let has_long = forms().any(|form| matches!(form, TagForm::Command));
    declared.format() >= FIRST_FORMAT && (has_short || !has_long)
}

impl<'d> Rewriter<'d, '_> {
    /// Returns `true` if a joint or a tag comes into the text that may have another layout than a formatted text. A joint beside
    /// others has its layout when it comes, and no uid too many in a text that has them all.
    pub(super) fn has_unsettled(&self) -> bool {
        let is_known = |uid: Uid| self.before.is_taken(uid);
        let stays = |one: &Declaration| self.rig.joint(one.uid).is_some();
        let has_layout = !self.with_names && self.declared.joints.iter().any(stays);
        self.rig.walk().any(|joint| match is_known(joint.data.uid) {
            true => joint.data.tags.iter().any(|tag| !is_known(tag.uid)),
            false => !has_layout,
        })
    }

    /// Text of a tag.
    pub(super) fn new_tag(&self, tag: &TagData) -> String {
        let features = &self.names.features;
        match self.is_short.then(|| short_tag(&self.index, tag, features)).flatten() {
            Some(text) => self.styled(&text),
            None => tag_text(self.rig, tag, features),
        }
    }

    /// Text of a joint. With names, it refers by label where that is the joint's alone.
    pub(super) fn new_joint(&self, joint: &RigJoint) -> String {
        let parent = self.parent_of(1, joint);
        let mut without_tags = RigJoint { parent, ..joint.clone() };
        let tags = if self.is_short { std::mem::take(&mut without_tags.data.tags) } else { Vec::new() };
        let mut text = joint_text(self.rig, &without_tags, &self.names.features);
        if let Some(open) = text.strip_suffix(')').filter(|_| !tags.is_empty()) {
            let tags: Vec<String> = tags.iter().map(|tag| self.new_tag(tag)).collect();
            text = format!("{open}tags: [{}])", tags.join(", "));
        }
        if !self.with_names {
            return text;
        }
        for (field, uid) in [("parent", parent), ("mirror", joint.data.mirror)] {
            if let Some((uid, label)) = uid.and_then(|uid| Some((uid, self.label_of(uid)?))) {
                text = text.replacen(&format!("{field}: \"{uid}\""), &format!("{field}: {}", quoted(label)), 1);
            }
        }
        let group = joint.data.group.and_then(|group| self.rig.group(group));
        if let Some(group) = group.filter(|group| self.names.is_unique("group", &group.name)) {
            text = text.replacen(&format!("group: \"{}\"", group.uid), &format!("group: {}", quoted(&group.name)), 1);
        }
        without_uids(&text, &self.index, |_| true).into_owned()
    }

    /// Parent of a joint of the text in the rig before (0) or now (1), with what parts bring.
    pub(super) fn parent_of(&self, which: usize, joint: &RigJoint) -> Option<Uid> {
        joint.parent.or_else(|| self.whole[which].joint(joint.data.uid)?.parent)
    }

    /// Writes the parent of a joint that hangs on what a part brings.
    pub(super) fn hang(&mut self, node: NodeId, old: Option<Uid>, new: Uid) {
        let is_own = |label: &String| self.names.joints.contains_key(label);
        let written = self.tree().string(node, "parent");
        let is_kept = written.is_some_and(|written| written.parse::<Uid>().is_ok() || !is_own(&written));
        if old == Some(new) && is_kept {
            return;
        }
        let label = self.label_of(new).filter(|_| self.with_names);
        let text = label.map_or_else(|| format!("\"{new}\""), quoted);
        self.patch.set(node, "parent", &text);
    }

    /// Label by which the text can refer to a joint, which no other joint has. A joint that a part brings has the label from
    /// before: changes of the part come into the text later.
    fn label_of(&self, uid: Uid) -> Option<&'d str> {
        if let Some(joint) = self.rig.joint(uid) {
            return joint.data.label.as_deref().filter(|label| self.names.is_unique("joint", label));
        }
        let before = self.whole[0];
        let label = before.joint(uid)?.data.label.as_deref()?;
        let bearers = before.walk().filter(|joint| joint.data.label.as_deref() == Some(label)).count();
        (bearers == 1 && !self.names.joints.contains_key(label)).then_some(label)
    }
}

/// A text with what came into it as if it had been formatted: without uids that follow from names, if it leaves such uids out,
/// and with the layout of joints that have got tags and had their layout before.
pub(super) fn settled(mut text: String, before: &Declarations, leaves_out: bool) -> String {
    let known: HashSet<Uid> = before.all().map(|one| one.uid).collect();
    if let Some(shorter) = leaves_out.then(|| without_derived(&text, &known)).flatten() {
        text = shorter;
    }
    laid_out_joints(&text, before, &known).unwrap_or(text)
}

/// The text without the uids of what came that follow from names; `None` if there are none, or the text would declare something
/// else.
fn without_derived(text: &str, known: &HashSet<Uid>) -> Option<String> {
    let declared = Declarations::find(text)?;
    let follows = |one: &&Declaration| one.is_written && one.derived == Some(one.uid) && !known.contains(&one.uid);
    let found: Vec<NodeId> = declared.all().filter(follows).map(|one| one.node).collect();
    if found.is_empty() {
        return None;
    }
    let mut patch = Patch::new(&declared.tree);
    found.into_iter().for_each(|node| patch.set_or_remove(node, "uid", None));
    let out = patch.text();
    let said = |declared: &Declarations| {
        let uids: Vec<Uid> = declared.all().map(|one| one.uid).collect();
        (declared.faults.len(), uids)
    };
    let before = said(&declared);
    // One tree makes room for the other: they are the most of a text's memory.
    drop(declared);
    let is_same = said(&Declarations::find(&out)?) == before;
    is_same.then_some(out)
}

/// The text with joints in their layout that have something that came, unless they had another layout before.
fn laid_out_joints(text: &str, before: &Declarations, known: &HashSet<Uid>) -> Option<String> {
    // No joint begins the line on which the rig does.
    if !text.contains('\n') {
        return None;
    }
    let declared = Declarations::find(text)?;
    let was: HashMap<Uid, &Declaration> = before.joints.iter().map(|joint| (joint.uid, joint)).collect();
    let mut changes: Vec<(Range<usize>, String)> = Vec::new();
    for (joint, tags) in declared.joints.iter().zip(&declared.tags) {
        let has_fresh = std::iter::once(joint).chain(tags).any(|one| !known.contains(&one.uid));
        let had_layout = |old: &&Declaration| {
            in_layout(&before.tree, old.node).is_some_and(|text| text == before.tree.written(old.node))
        };
        if has_fresh
            && was.get(&joint.uid).is_none_or(had_layout)
            && let Some(text) = in_layout(&declared.tree, joint.node)
            && text != declared.tree.written(joint.node)
        {
            changes.push((declared.tree.node(joint.node).range.clone(), text));
        }
    }
    // The tree, which is larger than the text, is gone before the text with the changes comes.
    drop(declared);
    Some(with_changes(text, changes))
}

/// A value in its layout; `None` for one that does not begin its line behind blanks.
fn in_layout(tree: &Tree, node: NodeId) -> Option<String> {
    let start = tree.node(node).range.start;
    let indent = spaces_before(tree.text[..start].bytes().rev())?;
    Some(value_laid_out(tree.written(node), indent, indent))
}

/// Number of spaces before a place, where nothing else is before it on its line. Takes the bytes before the place, the last
/// one first, and none beyond the first that is no space: a text on one line would be read once for each of its values.
fn spaces_before(bytes: impl IntoIterator<Item = u8>) -> Option<usize> {
    let mut spaces = 0;
    for byte in bytes {
        match byte {
            b' ' => spaces += 1,
            b'\n' => break,
            _ => return None,
        }
    }
    Some(spaces)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn spaces_are_found_without_a_look_at_the_line() {
        let text = format!("{}\n    x", "(a: 1), ".repeat(1000));
        let looked_at = |at: usize| {
            let mut bytes = 0;
            let spaces = spaces_before(text[..at].bytes().rev().inspect(|_| bytes += 1));
            (spaces, bytes)
        };
        assert_eq!(looked_at(0), (Some(0), 0));
        // Behind a comma and a space.
        assert_eq!(looked_at(4000), (None, 2));
        assert_eq!(looked_at(text.len() - 1), (Some(4), 5));
    }
}
