//! Joints and tags that a template with parts has itself, in its text.

use std::{
    borrow::Cow,
    collections::{BTreeSet, HashMap, HashSet},
    sync::Arc,
};

use super::{
    super::{Rewriter, labels::header_labels, order::reordered, patch::Patch},
    PartRigs, without_instances,
};
use crate::rig::{
    JointData, Rig, RigEdit, RigJoint, Uid,
    format::{
        template::{quoted, shorthand::Declarations},
        tree::{NodeId, Tree},
    },
    part::{PartInstance, PartTargets},
    reference::RigNameIndex,
};

/// The text of a template with parts, as changes of a text of the same rig: of what the template has itself. The part instances
/// with the numbers in `written_out` leave the text, and what they bring is the template's own. Labels that changes of other
/// instances give are those from before. With `in_order`, what the template has itself is put into the rig's order.
pub(crate) fn write_own_over(
    rig: &Rig,
    rigs: &PartRigs,
    source: &str,
    written_out: &BTreeSet<usize>,
    in_order: bool,
) -> Option<String> {
    let gone: Vec<usize> = written_out.iter().copied().collect();
    let rest = match gone.is_empty() {
        true => Cow::Borrowed(source),
        false => Cow::Owned(without_instances(source, rig, &gone)?),
    };
    let things = OwnThings::of(rig, rigs, written_out);
    let staged = things.with_labels_of_parts(rig)?;
    let (own, before) = (things.now(&staged), things.before());
    let declared = Declarations::find(&rest)?;
    let rewriter = Rewriter {
        whole: [rigs.before, &staged],
        index: RigNameIndex::new(rig),
        ..Rewriter::new(&own, &before, &declared)
    };
    let text = rewriter.text();
    let text = if in_order { reordered(&own, &text)? } else { text };
    let tree = Tree::parse(&text)?;
    let elements = tree.elements(tree.root(), "parts");
    let kept = rigs.parts.iter().enumerate().filter(|(number, _)| !written_out.contains(number));
    let kept: Vec<&PartInstance> = kept.map(|(_, (instance, _))| instance).collect();
    if elements.len() != kept.len() {
        return None;
    }
    let mut patch = Patch::new(&tree);
    header_labels(&mut patch, &tree, rigs.before, &staged);
    for (item, instance) in elements.iter().zip(kept) {
        instance_labels(&mut patch, &tree, item.value, instance, [rigs.before, &staged]);
    }
    Some(patch.text())
}

/// Things that a template has itself, while some of its parts are written out.
struct OwnThings<'r> {
    rigs: &'r PartRigs<'r>,
    /// Uids of what comes of the parts that are written out.
    written_out: HashSet<Uid>,
    /// Tags that changes of instances will add.
    of_changes: HashSet<Uid>,
    /// Joints of the template itself whose place, label or lock a change sets: of any instance, and of one that stays.
    set_by_any: HashSet<Uid>,
    set_by_kept: HashSet<Uid>,
}

impl<'r> OwnThings<'r> {
    fn of(rig: &Rig, rigs: &'r PartRigs<'r>, written_out: &BTreeSet<usize>) -> Self {
        let parts = rigs.parts.iter().enumerate();
        Self {
            rigs,
            written_out: parts
                .filter(|(number, _)| written_out.contains(number))
                .flat_map(|(_, (instance, part))| things_of(instance, part))
                .collect(),
            of_changes: added_tags(rig, rigs, written_out).into_values().flatten().map(|(_, tag)| tag).collect(),
            set_by_any: joints_set_by_changes(rigs, &BTreeSet::new()),
            set_by_kept: joints_set_by_changes(rigs, written_out),
        }
    }

    /// True for what the template has itself now.
    fn is_own(&self, uid: Uid) -> bool {
        let is_own = self.rigs.own.is_taken(uid) || !self.rigs.before.is_taken(uid) || self.written_out.contains(&uid);
        is_own && !self.of_changes.contains(&uid)
    }

    /// The rig with the labels that joints of parts, and joints whose labels changes set, had before.
    fn with_labels_of_parts(&self, rig: &Rig) -> Option<Rig> {
        let mut staged = rig.clone();
        for joint in self.rigs.before.walk() {
            let JointData { uid, label, .. } = &joint.data;
            let is_set = !self.is_own(*uid) || self.set_by_kept.contains(uid);
            if is_set && rig.joint(*uid).is_some_and(|now| now.data.label != *label) {
                staged.apply(&RigEdit::SetLabel(*uid, label.clone())).ok()?;
            }
        }
        Some(staged)
    }

    /// Joints and tags that the template has itself now.
    fn now(&self, rig: &Rig) -> Rig {
        self.stripped(rig, &self.set_by_kept, &|uid| self.is_own(uid))
    }

    /// Joints and tags that the template had itself before.
    fn before(&self) -> Rig {
        self.stripped(self.rigs.before, &self.set_by_any, &|uid| self.rigs.own.is_taken(uid))
    }

    /// A rig without what is not the template's own. Joints of the template below those of parts are roots.
    fn stripped(&self, rig: &Rig, set_by_changes: &HashSet<Uid>, is_own: &dyn Fn(Uid) -> bool) -> Rig {
        let data = |joint: &RigJoint| {
            let mut data = joint.data.clone();
            data.tags.retain(|tag| is_own(tag.uid));
            if let Some(own) = self.rigs.own.joint(data.uid).filter(|_| set_by_changes.contains(&data.uid)) {
                (data.rest, data.label, data.locked) = (own.data.rest, own.data.label.clone(), own.data.locked);
            }
            (data.uid, Arc::new(RigJoint { data, parent: joint.parent, children: Vec::new() }))
        };
        let joints = rig.walk().filter(|joint| is_own(joint.data.uid)).map(data).collect();
        let mut out = rig.clone();
        out.groups.retain(|group| is_own(group.uid));
        out.inputs.retain(|input| is_own(input.uid));
        out.set_joints(joints, |parent| match parent {
            Some(_) => rig.children(parent).to_vec(),
            None => rig.walk().map(|joint| joint.data.uid).collect(),
        });
        out
    }
}

/// Uids of all that comes of a part, and of what its changes add.
pub(super) fn things_of(instance: &PartInstance, part: &Rig) -> Vec<Uid> {
    let groups = part.groups().iter().map(|group| group.uid);
    let inputs = part.inputs().iter().map(|input| input.uid);
    let here = groups.chain(inputs).map(|uid| instance.uid_of(uid));
    let added = instance.changes.iter().flat_map(|change| &change.tags).map(|tag| tag.uid);
    instance.brought(part).into_iter().chain(here).chain(added).collect()
}

/// Tags that are in no text yet and stand behind those of a part on their joint, or on a joint of a part: by the number of the
/// instance, with the joint of each. Parts that are written out are none.
pub(super) fn added_tags(rig: &Rig, rigs: &PartRigs, written_out: &BTreeSet<usize>) -> HashMap<usize, Vec<(Uid, Uid)>> {
    let mut instance_of: HashMap<Uid, usize> = HashMap::new();
    let parts = rigs.parts.iter().enumerate().filter(|(number, _)| !written_out.contains(number));
    for (number, (instance, part)) in parts {
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

/// Joints of the template itself whose place, label or lock a change of an instance sets, but for those that are written out.
fn joints_set_by_changes(rigs: &PartRigs, written_out: &BTreeSet<usize>) -> HashSet<Uid> {
    let mut set = HashSet::new();
    let parts = rigs.parts.iter().enumerate().filter(|(number, _)| !written_out.contains(number));
    let labelled = rigs.own.joints_by_label();
    for (_, (instance, part)) in parts {
        let targets = PartTargets::new(instance, part);
        for change in &instance.changes {
            let is_set = change.translation.is_some()
                || change.rotation.is_some()
                || change.scale.is_some()
                || change.label.is_some()
                || change.locked.is_some();
            let place = change.joint.as_ref().and_then(|label| targets.find_joint(label).ok());
            let onto = place.filter(|_| is_set).and_then(|place| instance.onto.get(place));
            set.extend(onto.and_then(|label| labelled.get(label.as_str()).copied()));
        }
    }
    set
}

/// Writes other labels of the joints that a part goes onto and hangs on: those of the second rig in place of those of the first.
pub(super) fn instance_labels(
    patch: &mut Patch,
    tree: &Tree,
    node: NodeId,
    instance: &PartInstance,
    [before, now]: [&Rig; 2],
) {
    let renamed = |label: &str| {
        let joint = now.joint(before.labelled(label)?)?;
        joint.data.label.clone().filter(|now| now != label)
    };
    if let Some(now) = instance.parent.as_deref().and_then(renamed) {
        patch.set(node, "parent", &quoted(&now));
    }
    let onto: Vec<Option<String>> = instance.onto.iter().map(|label| renamed(label)).collect();
    // The uid of a part without a name follows from the labels.
    let follows = instance.name.is_empty() && tree.field(node, "uid").is_none();
    if follows && onto.iter().any(Option::is_some) {
        patch.put_first(node, &format!("uid: \"{}\"", instance.uid));
    }
    for (item, now) in tree.elements(node, "onto").iter().zip(onto) {
        if let Some(now) = now {
            patch.replace(item.value, &quoted(&now));
        }
    }
}
