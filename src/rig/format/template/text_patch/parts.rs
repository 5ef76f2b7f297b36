//! Changes of what parts bring, as local changes of the part instances in a template's text.

mod change;
mod instance;

use std::collections::{HashMap, HashSet};

use super::{Rewriter, labels::header_labels, order::reordered, patch::Patch, tag_text};
use crate::rig::{
    Rig, RigJoint, TagData, Uid,
    format::{
        layout::value_on_one_line,
        template::{quoted, shorthand::Declarations, write::feature_uids},
        tree::{NodeId, Tree},
    },
    part::{PartInstance, switch_name},
    reference::RigNameIndex,
};
use change::{FieldChange, JointDiff, TagDiff, Words, short_tag};
pub(crate) use instance::{with_instances, without_instances};

/// Rigs of a template with parts, from which its text is changed.
pub(crate) struct PartRigs<'a> {
    /// The template without what its parts bring.
    pub own: &'a Rig,
    /// The template with its parts, as the text says.
    pub before: &'a Rig,
    /// The template with its parts, but without the changes of the instances, other labels excepted.
    pub plain: &'a Rig,
    /// Every instance with its part, [fitted](PartInstance::fitted).
    pub parts: &'a [(PartInstance, Rig)],
}

/// The text of a template with parts, as changes of a text of the same rig: of what the template has itself, and of the
/// `changes` of its part instances. The result may say something else than `rig` where no change says what is different of a
/// part: read it to see. With `with_names`, references in the changes are names without uids; with `in_order`, what the
/// template has itself is put into the rig's order.
pub(crate) fn write_parts_over(
    rig: &Rig,
    rigs: &PartRigs,
    source: &str,
    with_names: bool,
    in_order: bool,
) -> Option<String> {
    let added = added_tags(rig, rigs);
    let of_parts: HashSet<Uid> = added.values().flatten().map(|(_, tag)| *tag).collect();
    let set_by_changes = joints_set_by_changes(rigs);
    let is_own = |uid: Uid| (rigs.own.is_taken(uid) || !rigs.before.is_taken(uid)) && !of_parts.contains(&uid);
    let stripped = |rig: &Rig| {
        let data = |joint: &RigJoint| {
            let mut data = joint.data.clone();
            data.tags.retain(|tag| is_own(tag.uid));
            if let Some(own) = rigs.own.joint(data.uid).filter(|_| set_by_changes.contains(&data.uid)) {
                (data.rest, data.label, data.locked) = (own.data.rest, own.data.label.clone(), own.data.locked);
            }
            (data.uid, (data, joint.parent))
        };
        let joints = rig.walk().filter(|joint| is_own(joint.data.uid)).map(data).collect();
        let mut out = rig.clone();
        out.groups.retain(|group| is_own(group.uid));
        out.inputs.retain(|input| is_own(input.uid));
        out.set_joints(joints, |parent| rig.children(parent).to_vec());
        out
    };
    let (own, own_before) = (stripped(rig), stripped(rigs.before));
    let declared = Declarations::find(source)?;
    let text = Rewriter { whole: [rigs.before, rig], ..Rewriter::new(&own, &own_before, &declared) }.text();
    let text = if in_order { reordered(&own, &text)? } else { text };
    let tree = Tree::parse(&text)?;
    let elements = tree.elements(tree.root(), "parts");
    if elements.len() != rigs.parts.len() {
        return None;
    }
    let mut writer = Overrides {
        rig,
        rigs,
        words: Words { names: RigNameIndex::new(rig), with_names },
        features: feature_uids(rig),
        patch: Patch::new(&tree),
        tree: &tree,
    };
    header_labels(&mut writer.patch, &tree, rigs.before, rig);
    let none = Vec::new();
    for (number, item) in elements.iter().enumerate() {
        writer.instance(item.value, number, added.get(&number).unwrap_or(&none));
    }
    Some(writer.patch.text())
}

/// Tags that are in no text yet and stand behind those of a part on their joint, or on a joint of a part: by the number of the
/// instance, with the joint of each.
fn added_tags(rig: &Rig, rigs: &PartRigs) -> HashMap<usize, Vec<(Uid, Uid)>> {
    let mut instance_of: HashMap<Uid, usize> = HashMap::new();
    for (number, (instance, part)) in rigs.parts.iter().enumerate() {
        for (place, joint) in part.walk().enumerate() {
            if place >= instance.onto.len() {
                instance_of.insert(instance.uid_of(joint.data.uid), number);
            }
            instance_of.extend(joint.data.tags.iter().map(|tag| (instance.uid_of(tag.uid), number)));
        }
        instance_of.extend(instance.changes.iter().flat_map(|change| &change.tags).map(|tag| (tag.uid, number)));
    }
    let mut added: HashMap<usize, Vec<(Uid, Uid)>> = HashMap::new();
    for joint in rig.walk() {
        let mut last = instance_of.get(&joint.data.uid).copied();
        for tag in &joint.data.tags {
            match (instance_of.get(&tag.uid), last) {
                (Some(number), _) => last = Some(*number),
                (None, Some(number)) if !rigs.before.is_taken(tag.uid) => {
                    added.entry(number).or_default().push((joint.data.uid, tag.uid));
                }
                _ => {}
            }
        }
    }
    added
}

/// Joints of the template itself whose place, label or lock a change of an instance sets.
fn joints_set_by_changes(rigs: &PartRigs) -> HashSet<Uid> {
    let mut set = HashSet::new();
    for (instance, part) in rigs.parts {
        for change in &instance.changes {
            let is_set = change.translation.is_some()
                || change.rotation.is_some()
                || change.scale.is_some()
                || change.label.is_some()
                || change.locked.is_some();
            let place = change.joint.as_ref().and_then(|label| instance.find_joint(part, label).ok());
            let onto = place.filter(|_| is_set).and_then(|place| instance.onto.get(place));
            set.extend(onto.and_then(|label| rigs.own.find_label(label)));
        }
    }
    set
}

/// A thing of a part that an instance changes.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
enum Target {
    Joint(Uid),
    Tag(Uid),
}

/// Changes of an instance that come into its text and go out of it.
#[derive(Default)]
struct Entries {
    /// The instance's element.
    node: NodeId,
    /// Changes that come, each on one line.
    fresh: Vec<String>,
    /// Numbers of the changes that go.
    gone: Vec<usize>,
}

/// A change of the list of features that are off.
enum FeatureListChange {
    /// The number of the one that is on again.
    On(usize),
    /// The name of one that is off now.
    Off(String),
}

struct Overrides<'d, 'a> {
    rig: &'d Rig,
    rigs: &'d PartRigs<'d>,
    words: Words<'d>,
    features: HashSet<Uid>,
    tree: &'d Tree<'a>,
    patch: Patch<'d, 'a>,
}

impl Overrides<'_, '_> {
    /// Writes what is different of an instance, whose element in the text is `node`.
    fn instance(&mut self, node: NodeId, number: usize, added: &[(Uid, Uid)]) {
        let (instance, part) = &self.rigs.parts[number];
        self.labels(node, instance);
        let entries = self.entries(node, instance, part);
        let mut changes = Entries { node, ..Entries::default() };
        let (mut off, mut on) = (Vec::new(), Vec::new());
        for (place, joint) in part.walk().enumerate() {
            let source = joint.data.uid;
            let here = match instance.onto.get(place) {
                Some(label) => self.rigs.before.find_label(label),
                None => Some(instance.uid_of(source)),
            };
            let Some(here) = here else { continue };
            let entry = entries.get(&Target::Joint(source)).copied();
            let new: Vec<&TagData> = added
                .iter()
                .filter(|(on, _)| *on == here)
                .filter_map(|(_, tag)| self.rig.find_tag(*tag).map(|(_, tag)| tag))
                .collect();
            // A joint of the template itself stands where that says, unless a change says otherwise.
            let is_set = place >= instance.onto.len() || entry.is_some();
            self.joint(
                JointPlace {
                    here,
                    label: joint.data.label.as_deref(),
                    is_set,
                    name: instance.name_of_joint(part, place),
                },
                entry,
                &new,
                &mut changes,
            );
            for tag in &joint.data.tags {
                let entry = entries.get(&Target::Tag(tag.uid)).copied();
                let switched = entry.is_none().then(|| self.switch(instance, part, tag)).flatten();
                match switched {
                    Some(FeatureListChange::On(place)) => on.push(place),
                    Some(FeatureListChange::Off(name)) => off.push(quoted(&name)),
                    None => self.tag((instance, part), tag.uid, entry, &mut changes),
                }
            }
        }
        self.patch.exchange(node, "off", &on, &off);
        self.patch.exchange(node, "changes", &changes.gone, &changes.fresh);
    }

    /// Writes other labels of the joints that a part goes onto and hangs on.
    fn labels(&mut self, node: NodeId, instance: &PartInstance) {
        let renamed = |label: &str| {
            let joint = self.rig.joint(self.rigs.before.find_label(label)?)?;
            joint.data.label.clone().filter(|now| now != label)
        };
        if let Some(now) = instance.parent.as_deref().and_then(renamed) {
            self.patch.set(node, "parent", &quoted(&now));
        }
        let onto: Vec<Option<String>> = instance.onto.iter().map(|label| renamed(label)).collect();
        // The uid of a part without a name follows from the labels.
        let follows = instance.name.is_empty() && self.tree.field(node, "uid").is_none();
        if follows && onto.iter().any(Option::is_some) {
            self.patch.put_first(node, &format!("uid: \"{}\"", instance.uid));
        }
        for (item, now) in self.tree.elements(node, "onto").iter().zip(onto) {
            if let Some(now) = now {
                self.patch.replace(item.value, &quoted(&now));
            }
        }
    }

    /// Number of the change in the text of each thing.
    fn entries(&self, node: NodeId, instance: &PartInstance, part: &Rig) -> HashMap<Target, usize> {
        let count = self.tree.elements(node, "changes").len();
        let mut entries = HashMap::new();
        for (number, change) in instance.changes.iter().enumerate().take(count) {
            let joint = change.joint.as_ref().and_then(|label| instance.find_joint(part, label).ok());
            let joint = joint.and_then(|place| part.walk().nth(place)).map(|joint| Target::Joint(joint.data.uid));
            let tag = change.tag.as_ref().and_then(|name| instance.find_tag(part, name).ok()).map(Target::Tag);
            if let Some(target) = joint.or(tag) {
                // Of several, the last one wins when the part is put in.
                entries.insert(target, number);
            }
        }
        entries
    }

    /// Change of the list `off` that turns a feature on or off; `None` if that does not say what is different.
    fn switch(&self, instance: &PartInstance, part: &Rig, tag: &TagData) -> Option<FeatureListChange> {
        let name = switch_name(tag)?;
        let here = instance.uid_of(tag.uid);
        let ((_, was), (_, is)) = (self.rigs.before.find_tag(here)?, self.rig.find_tag(here)?);
        let tags = || part.walk().flat_map(|joint| &joint.data.tags);
        let is_only = tags().filter(|other| switch_name(other).as_ref() == Some(&name)).count() == 1;
        let place = instance.off.iter().position(|off| *off == name);
        if was.enabled == is.enabled || !is_only || was.comment != is.comment || was.kind != is.kind {
            return None;
        }
        match (is.enabled, place) {
            (true, Some(place)) if tag.enabled => Some(FeatureListChange::On(place)),
            (false, None) => Some(FeatureListChange::Off(name)),
            _ => None,
        }
    }

    fn joint(&mut self, joint: JointPlace, entry: Option<usize>, new: &[&TagData], changes: &mut Entries) {
        let of = |rig: &'_ Rig| rig.joint(joint.here).map(|joint| joint.data.clone());
        let (Some(before), Some(now), Some(plain)) = (of(self.rigs.before), of(self.rig), of(self.rigs.plain)) else {
            return;
        };
        let mut fields = Vec::new();
        if joint.is_set {
            let own = self.rigs.own.joint(joint.here);
            let own_label = own.map_or(joint.label, |joint| joint.data.label.as_deref());
            fields = JointDiff { before: &before, now: &now, plain: &plain, label: own_label }.fields();
        }
        let texts: Vec<String> = new.iter().map(|tag| self.tag_text(tag)).collect();
        let Some(number) = entry else {
            let mut said = written(fields);
            if !texts.is_empty() {
                said.push(format!("tags: [{}]", texts.join(", ")));
            }
            if let Some(name) = joint.name.filter(|_| !said.is_empty()) {
                changes.fresh.push(format!("(joint: {}, {})", quoted(name), said.join(", ")));
            }
            return;
        };
        let element = self.tree.elements(changes.node, "changes")[number].value;
        let mut left = self.set_fields(element, fields);
        // Tags that the change has given.
        let known = self.rigs.parts.iter().flat_map(|(instance, _)| &instance.changes).flat_map(|change| &change.tags);
        let elements = self.tree.elements(element, "tags");
        let given: Vec<Uid> =
            known.filter(|tag| before.tags.iter().any(|other| other.uid == tag.uid)).map(|tag| tag.uid).collect();
        let mut removed = Vec::new();
        if given.len() == elements.len() {
            for (place, uid) in given.iter().enumerate() {
                let find = |tags: &[TagData]| tags.iter().find(|tag| tag.uid == *uid).cloned();
                match (find(&before.tags), find(&now.tags)) {
                    (Some(_), None) => removed.push(place),
                    (Some(was), Some(is)) if self.words.differ(&was, &is) => {
                        let text = self.tag_text(&is);
                        self.patch.replace(elements[place].value, &text);
                    }
                    _ => {}
                }
            }
        }
        if !removed.is_empty() && removed.len() == elements.len() && texts.is_empty() {
            left.retain(|field| *field != "tags");
        }
        self.patch.exchange(element, "tags", &removed, &texts);
        if left.is_empty() && texts.is_empty() {
            changes.gone.push(number);
        }
    }

    fn tag(
        &mut self,
        (instance, part): (&PartInstance, &Rig),
        source: Uid,
        entry: Option<usize>,
        changes: &mut Entries,
    ) {
        let here = instance.uid_of(source);
        let of = |rig: &'_ Rig| rig.find_tag(here).map(|(_, tag)| tag.clone());
        let (before, now) = (of(self.rigs.before), of(self.rig));
        let Some(plain) = of(self.rigs.plain) else { return };
        if before.is_none() && now.is_none() {
            return;
        }
        let (fields, params) = match (&before, &now) {
            (Some(_), None) => (vec![("removed", Some("true".to_owned()))], Vec::new()),
            (before, Some(now)) => {
                let diff =
                    TagDiff { before: before.as_ref().unwrap_or(&plain), now, plain: &plain, words: &self.words };
                let mut fields = diff.fields();
                if before.is_none() {
                    fields.push(("removed", None));
                }
                (fields, diff.params())
            }
            (None, None) => return,
        };
        let Some(number) = entry else {
            let mut said = written(fields);
            let set: Vec<String> =
                params.iter().filter_map(|(key, value)| Some(format!("{key}: {}", value.as_ref()?))).collect();
            if !set.is_empty() {
                said.push(format!("params: ({})", set.join(", ")));
            }
            if !said.is_empty() {
                let name = quoted(&instance.name_of_tag(part, source));
                changes.fresh.push(format!("(tag: {name}, {})", said.join(", ")));
            }
            return;
        };
        let element = self.tree.elements(changes.node, "changes")[number].value;
        let mut left = self.set_fields(element, fields);
        if self.params(element, &params) {
            left.push("params");
        } else {
            left.retain(|field| *field != "params");
        }
        if left.is_empty() {
            changes.gone.push(number);
        }
    }

    /// Changes the parameters that a change of the text sets. Returns `true` if it sets some then.
    fn params(&mut self, element: NodeId, params: &[(String, Option<String>)]) -> bool {
        let field = self.tree.field(element, "params").map(|field| field.value);
        let set: Vec<String> =
            params.iter().filter_map(|(key, value)| Some(format!("{key}: {}", value.as_ref()?))).collect();
        let Some(field) = field else {
            if !set.is_empty() {
                self.patch.set(element, "params", &format!("({})", set.join(", ")));
            }
            return !set.is_empty();
        };
        let keys: Vec<&str> = self.tree.node(field).items.iter().filter_map(|item| item.key).collect();
        let is_reset = |key: &&&str| params.iter().any(|(other, value)| other == **key && value.is_none());
        if set.is_empty() && !keys.is_empty() && keys.iter().filter(is_reset).count() == keys.len() {
            self.patch.set_or_remove(element, "params", None);
            return false;
        }
        for (key, value) in params {
            self.patch.set_or_remove(field, key, value.as_deref());
        }
        true
    }

    /// Sets fields of a change in the text, or takes them out. Returns those that it has then.
    fn set_fields(&mut self, element: NodeId, fields: Vec<FieldChange>) -> Vec<&'static str> {
        let mut left = self.fields_of(element);
        for (field, value) in fields {
            left.retain(|other| *other != field);
            left.extend(value.is_some().then_some(field));
            self.patch.set_or_remove(element, field, value.as_deref());
        }
        left
    }

    /// Fields of a change that say something different from the part.
    fn fields_of(&self, element: NodeId) -> Vec<&'static str> {
        let known = super::super::file::PART_CHANGE_FIELDS.into_iter().skip(2);
        known.filter(|field| self.tree.field(element, field).is_some()).collect()
    }

    fn tag_text(&self, tag: &TagData) -> String {
        let long = || value_on_one_line(&tag_text(self.rig, tag, &self.features));
        self.words.styled(&short_tag(self.rig, tag, &self.features).unwrap_or_else(long))
    }
}

/// Fields of a change that comes, as they are written.
fn written(fields: Vec<FieldChange>) -> Vec<String> {
    fields.into_iter().filter_map(|(field, value)| Some(format!("{field}: {}", value?))).collect()
}

/// A joint of a part, and what it is in the template.
struct JointPlace<'p> {
    /// Uid in the template.
    here: Uid,
    /// Label in the part.
    label: Option<&'p str>,
    /// Name by which a change means it; `None` for one that has none.
    name: Option<&'p str>,
    /// True if changes say the place of the joint.
    is_set: bool,
}
