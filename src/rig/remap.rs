//! Mapping of uids in copied joints and tags to the uids at their target.

use std::collections::{HashMap, HashSet};

use crate::rig::{
    JointData, Rig, TagData, TagKind, Uid,
    label::mirrored_label,
    reference::{NameKind, map_references, map_text_fields, map_uids},
};

/// Map of uids of joints, tags and groups. Others stay.
#[derive(Debug, Clone, Default)]
pub(in crate::rig) struct Remap {
    pub uids: HashMap<Uid, Uid>,
    /// Joints without a label, which no label reference can name.
    pub unlabelled: HashSet<Uid>,
}

impl Remap {
    pub fn get(&self, uid: Uid) -> Option<Uid> {
        self.uids.get(&uid).copied()
    }

    /// The parameters with mapped references and mapped uids that stand alone.
    pub fn params(&self, params: &str) -> String {
        let referred = map_references(params, |reference| {
            for (kind, uid) in reference.uids_mut() {
                let next = self.get(*uid);
                if let Some(next) = next.filter(|next| kind != NameKind::Label || !self.unlabelled.contains(next)) {
                    *uid = next;
                }
            }
        });
        map_uids(&referred, |uid| self.get(uid))
    }

    /// A copy of a joint under its next uid, with all its tags. What is mapped nowhere stays as it is.
    pub fn joint(&self, joint: &JointData) -> JointData {
        let get = |uid: Uid| self.get(uid).unwrap_or(uid);
        let mut joint = joint.clone();
        joint.uid = get(joint.uid);
        joint.mirror = joint.mirror.map(get);
        joint.group = joint.group.map(get);
        for tag in &mut joint.tags {
            tag.uid = get(tag.uid);
            if let TagKind::Command { params, feature, .. } = &mut tag.kind {
                *params = self.params(params);
                *feature = feature.map(get);
            }
        }
        joint
    }

    /// A copy of a tag under its next uid. A feature that is not in `rig` and not among the copies is left out.
    pub fn tag(&self, rig: &Rig, tag: &TagData) -> TagData {
        let mut tag = tag.clone();
        tag.uid = self.get(tag.uid).unwrap_or(tag.uid);
        if let TagKind::Command { params, feature, .. } = &mut tag.kind {
            *params = self.params(params);
            *feature = feature.and_then(|feature| {
                let is_known = |feature: &Uid| rig.find_tag(*feature).is_some();
                self.get(feature).or(Some(feature).filter(is_known))
            });
        }
        tag
    }
}

/// Counterparts on the other side of a rig: joints, their tags (the tag of the same module or kind with the same
/// number), and the local groups of joints.
pub(in crate::rig) fn other_side(rig: &Rig) -> HashMap<Uid, Uid> {
    let mut other = HashMap::new();
    let mut groups: HashMap<Uid, Option<Uid>> = HashMap::new();
    for joint in rig.walk() {
        let Some(mirror) = joint.data.mirror.and_then(|mirror| rig.joint(mirror)) else { continue };
        other.insert(joint.data.uid, mirror.data.uid);
        pair_tags(&mut other, &joint.data.tags, &mirror.data.tags);
        if let (Some(group), Some(partner)) = (joint.data.group, mirror.data.group) {
            let known = groups.entry(group).or_insert(Some(partner));
            // A group whose joints' partners are in several groups has no other side.
            if *known != Some(partner) {
                *known = None;
            }
        }
    }
    // Of several groups with one name the first counts.
    let named: HashMap<&str, Uid> = rig.groups().iter().rev().map(|group| (group.name.as_str(), group.uid)).collect();
    for group in rig.groups() {
        let by_name = || named.get(mirrored_label(&group.name)?.as_str()).copied();
        if let Some(partner) = groups.get(&group.uid).copied().flatten().or_else(by_name) {
            other.insert(group.uid, partner);
        }
    }
    other
}

/// Pairs each tag with the one at the same place among those of its module or kind.
pub(in crate::rig) fn pair_tags(pairs: &mut HashMap<Uid, Uid>, from: &[TagData], to: &[TagData]) {
    let mut used: HashSet<Uid> = HashSet::new();
    for tag in from {
        if let Some(like) = to.iter().find(|other| is_like(tag, other) && !used.contains(&other.uid)) {
            used.insert(like.uid);
            pairs.insert(tag.uid, like.uid);
        }
    }
}

fn is_like(a: &TagData, b: &TagData) -> bool {
    match (&a.kind, &b.kind) {
        (TagKind::Command { module: a, .. }, TagKind::Command { module: b, .. }) => a == b,
        (TagKind::Feature { kind: a, .. }, TagKind::Feature { kind: b, .. }) => a == b,
        _ => false,
    }
}

/// Mirrors the names that a tag gives (node names, labels, a feature's name).
pub(in crate::rig) fn mirror_names(tag: &mut TagData) {
    match &mut tag.kind {
        TagKind::Command { params, .. } => *params = map_text_fields(params, &["name", "label"], mirrored_label),
        TagKind::Feature { name, .. } => {
            if let Some(other) = mirrored_label(name) {
                *name = other;
            }
        }
    }
}
