//! Header of a template: what people left out of it follows from the rest of the file.

use std::collections::{BTreeMap, HashSet};

use super::{
    FeatureSummary, TemplateHeader,
    shorthand::{Declarations, TagForm},
    write::{feature_summaries, features_of, needs_summary},
};
use crate::rig::{
    Rig, Uid,
    part::{PartInstance, PartTargets},
};

/// The header with the uid that follows from the name, and, where the file is complete and says none, the number of
/// joints and the named features. What parts bring is in other files: see [`TemplateHeader::complete_from`].
pub(super) fn complete(mut header: TemplateHeader, text: &str) -> TemplateHeader {
    if header.uid == Uid::default() {
        header.uid = uid_of_name(&header.name);
    }
    if header.joint_count > 0 {
        return header;
    }
    let Some(declared) = Declarations::find(text) else { return header };
    let tree = &declared.tree;
    let parts = tree.field(tree.root(), "parts").map(|parts| tree.node(parts.value).items);
    if parts.is_some_and(|parts| !parts.is_empty()) {
        return header;
    }
    header.joint_count = declared.joints.len();
    if header.features.is_empty() {
        header.features = features(&declared);
    }
    header
}

/// Uid of a rig whose file says none.
fn uid_of_name(name: &str) -> Uid {
    Uid::derived(["rig", name])
}

impl TemplateHeader {
    /// Returns `true` for a uid that follows from the name, as where the file says none.
    pub fn has_uid_of_name(&self) -> bool {
        self.uid == uid_of_name(&self.name)
    }

    /// Sets what follows from joints and tags: the number of joints, the named features, and what a part needs.
    pub fn complete_from(&mut self, rig: &Rig) {
        self.joint_count = rig.len();
        self.features = feature_summaries(rig);
        self.needs = needs_summary(rig);
    }
}

impl TemplateHeader {
    /// Sets the number of joints and the named features of a template with parts, each as it is [fitted](PartInstance::fitted).
    pub fn complete_from_parts(&mut self, own: &Rig, parts: &[(PartInstance, Rig)]) {
        self.joint_count = own.len();
        let mut features: BTreeMap<(String, String), Vec<String>> = BTreeMap::new();
        let mut add = |found: Vec<FeatureSummary>| {
            for FeatureSummary { kind, name, switches } in found {
                features.entry((kind, name)).or_default().extend(switches);
            }
        };
        add(feature_summaries(own));
        for (instance, part) in parts {
            // Joints of a part beyond those that it goes onto stay out, with their tags, unless it adds them.
            let there = instance.onto.len();
            let joints = if there == 0 || instance.adds { part.len() } else { there.min(part.len()) };
            self.joint_count += joints.saturating_sub(there);
            let removed = instance.changes.iter().filter(|change| change.removed);
            let targets = PartTargets::new(instance, part);
            let removed: HashSet<Uid> =
                removed.filter_map(|change| targets.find_tag(change.tag.as_deref()?).ok()).collect();
            let of_part = part.walk().take(joints).flat_map(|joint| &joint.data.tags);
            let added = instance.changes.iter().flat_map(|change| &change.tags);
            add(features_of(of_part.filter(|tag| !removed.contains(&tag.uid)).chain(added)));
        }
        let summary = |((kind, name), mut switches): ((String, String), Vec<String>)| {
            switches.sort_unstable();
            switches.dedup();
            FeatureSummary { kind, name, switches }
        };
        self.features = features.into_iter().map(summary).collect();
    }
}

/// Named features with their switches, sorted.
fn features(declared: &Declarations) -> Vec<FeatureSummary> {
    let tree = &declared.tree;
    let mut found: BTreeMap<(String, String), Vec<String>> = BTreeMap::new();
    for tag in declared.tags.iter().flatten() {
        if !matches!(TagForm::of(tree, tag.node), Some(TagForm::Feature)) {
            continue;
        }
        let text = |field: &str| tree.string(tag.node, field).unwrap_or_default();
        let (kind, name, switch) = (text("kind"), text("name"), text("switch"));
        if !name.is_empty() {
            let switches = found.entry((kind, name)).or_default();
            if !switch.is_empty() && !switches.contains(&switch) {
                switches.push(switch);
            }
        }
    }
    let summary = |((kind, name), mut switches): (_, Vec<String>)| {
        switches.sort_unstable();
        FeatureSummary { kind, name, switches }
    };
    found.into_iter().map(summary).collect()
}
