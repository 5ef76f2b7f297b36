//! The build list: which commands, in which order.

use std::{
    collections::{BTreeMap, HashSet},
    sync::Arc,
};

use crate::rig::{Rig, TagData, TagKind, Uid};

/// Which joints' commands are built.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub enum BuildRange {
    /// All of the rig.
    #[default]
    Rig,
    /// Only those of these joints.
    Joints(HashSet<Uid>),
    /// Those of these joints and of all below them.
    Hierarchy(HashSet<Uid>),
}

/// A command in the list.
#[derive(Debug, Clone, PartialEq)]
pub struct ListEntry {
    /// The tag.
    pub command: Uid,
    /// The joint that carries it.
    pub joint: Uid,
    /// The module.
    pub module: Arc<str>,
    /// False if the tag, its feature, or its joint's group is off: then it is skipped.
    pub active: bool,
}

/// Feature tags that are on or off, by uid.
pub(super) fn features(rig: &Rig) -> BTreeMap<Uid, bool> {
    let tags = rig.walk().flat_map(|joint| &joint.data.tags);
    tags.filter(|tag| matches!(tag.kind, TagKind::Feature { .. })).map(|tag| (tag.uid, tag.enabled)).collect()
}

/// True if a tag's own switch and its feature are on.
pub(super) fn is_on(tag: &TagData, features: &BTreeMap<Uid, bool>) -> bool {
    let feature = match &tag.kind {
        TagKind::Command { feature, .. } => *feature,
        TagKind::Feature { .. } => None,
    };
    tag.enabled && feature.is_none_or(|feature| features.get(&feature).copied().unwrap_or(true))
}

/// Groups that are off.
pub(super) fn groups_off(rig: &Rig) -> HashSet<Uid> {
    rig.groups().iter().filter(|group| !group.enabled).map(|group| group.uid).collect()
}

/// Joints in the range, in the document's order.
pub(super) fn joints_in(rig: &Rig, range: &BuildRange) -> Vec<Uid> {
    let mut inside = HashSet::new();
    let kept = |uid: &Uid, parent: Option<Uid>, inside: &mut HashSet<Uid>| match range {
        BuildRange::Rig => true,
        BuildRange::Joints(joints) => joints.contains(uid),
        BuildRange::Hierarchy(tops) => {
            let within = tops.contains(uid) || parent.is_some_and(|parent| inside.contains(&parent));
            if within {
                inside.insert(*uid);
            }
            within
        }
    };
    rig.walk().filter(|joint| kept(&joint.data.uid, joint.parent, &mut inside)).map(|joint| joint.data.uid).collect()
}
