//! Changes of what parts bring, as local changes of the part instances in a template's text.

mod change;
mod fields;
mod instance;
mod own_joints;
mod part_differences;

use std::collections::{BTreeSet, HashMap, HashSet};

use super::{labels::header_labels, patch::Patch};
use crate::rig::{
    Rig, TagData, Uid,
    format::{
        layout::value_on_one_line,
        template::{
            quoted,
            shorthand::{Declaration, Declarations},
            write::{feature_uids, tag_text},
        },
        tree::{NodeId, Tree},
    },
    part::{PartInstance, PartTargets, switch_name},
    reference::RigNameIndex,
};
pub(super) use change::short_tag;
use change::{FieldChange, JointDiff, TagDiff, Words};
pub(crate) use fields::{with_instance_fields, with_instances_of};
pub(crate) use instance::{with_instances, without_instances};
pub(crate) use own_joints::write_own_over;
use own_joints::{added_tags, instance_labels};
pub(crate) use part_differences::differing_parts;

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

/// The text of a template with parts, as changes of the `changes` of its part instances in a text that says already what the
/// template has itself. The result may say something else than `rig` where no change says what is different of a part: read it
/// to see. With `with_names`, references in the changes are names without uids.
pub(crate) fn write_changes_over(rig: &Rig, rigs: &PartRigs, source: &str, with_names: bool) -> Option<String> {
    let added = added_tags(rig, rigs, &BTreeSet::new());
    let declared = Declarations::find(source)?;
    let tree = &declared.tree;
    let elements = tree.elements(tree.root(), "parts");
    if elements.len() != rigs.parts.len() {
        return None;
    }
    let mut writer = Overrides {
        rig,
        rigs,
        words: Words { names: RigNameIndex::new(rig), with_names },
        features: feature_uids(rig),
        patch: Patch::new(tree),
        tree,
    };
    header_labels(&mut writer.patch, tree, rigs.before, rig);
    for joint in &declared.joints {
        writer.parent(joint);
    }
    let none = Vec::new();
    for (number, item) in elements.iter().enumerate() {
        writer.instance(item.value, number, added.get(&number).unwrap_or(&none));
    }
    Some(writer.patch.text())
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
        instance_labels(&mut self.patch, self.tree, node, instance, [self.rigs.before, self.rig]);
        let entries = self.entries(node, instance, part);
        let mut changes = Entries { node, ..Entries::default() };
        let (mut off, mut on) = (Vec::new(), Vec::new());
        for (place, joint) in part.walk().enumerate() {
            let source = joint.data.uid;
            let here = match instance.onto.get(place) {
                Some(label) => self.rigs.before.labelled(label),
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

    /// Writes another label of the joint of a part on which a joint of the template itself hangs.
    fn parent(&mut self, joint: &Declaration) {
        let Some(parent) = self.rig.joint(joint.uid).and_then(|joint| joint.parent) else { return };
        let written = self.tree.string(joint.node, "parent").filter(|written| written.parse::<Uid>().is_err());
        let Some(written) = written.filter(|_| self.rigs.own.joint(parent).is_none()) else { return };
        let label = self.rig.joint(parent).and_then(|parent| parent.data.label.as_deref());
        if label != Some(written.as_str()) {
            let bearers = self.rig.walk().filter(|other| other.data.label.as_deref() == label).count();
            let text = label.filter(|_| bearers == 1).map_or_else(|| format!("\"{parent}\""), quoted);
            self.patch.set(joint.node, "parent", &text);
        }
    }

    /// Number of the change in the text of each thing.
    fn entries(&self, node: NodeId, instance: &PartInstance, part: &Rig) -> HashMap<Target, usize> {
        let count = self.tree.elements(node, "changes").len();
        let mut entries = HashMap::new();
        let targets = PartTargets::new(instance, part);
        let joints: Vec<Uid> = part.walk().map(|joint| joint.data.uid).collect();
        for (number, change) in instance.changes.iter().enumerate().take(count) {
            let joint = change.joint.as_ref().and_then(|label| targets.find_joint(label).ok());
            let joint = joint.and_then(|place| joints.get(place)).map(|joint| Target::Joint(*joint));
            let tag = change.tag.as_ref().and_then(|name| targets.find_tag(name).ok()).map(Target::Tag);
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
