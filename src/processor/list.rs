//! The build list: which commands, in which order.

use std::{collections::HashSet, sync::Arc};

use bevy::platform::collections::HashMap;

use super::exclusion::Exclusion;
use crate::rig::{JointData, Rig, TagData, TagKind, Uid};

/// Joints whose commands are built.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub enum BuildRange {
    /// All commands of the rig.
    #[default]
    Rig,
    /// Commands of these joints.
    Joints(HashSet<Uid>),
    /// Commands of these joints and of all joints below them.
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

/// Groups, features and tags that the document switches off.
pub(super) struct Switches {
    /// Feature tags that are off, with their names.
    features: HashMap<Uid, Arc<str>>,
    /// Local groups that are off, with their names.
    pub groups: HashMap<Uid, Arc<str>>,
}

impl Switches {
    pub fn of(rig: &Rig) -> Self {
        let tags = rig.walk().flat_map(|joint| &joint.data.tags).filter(|tag| !tag.enabled);
        let features = tags.filter_map(|tag| Some((tag.uid, feature_name(tag)?)));
        let groups = rig.groups().iter().filter(|group| !group.enabled);
        Self {
            features: features.collect(),
            groups: groups.map(|group| (group.uid, group.name.as_str().into())).collect(),
        }
    }

    /// The group of a joint, if it is off.
    pub fn joint(&self, joint: &JointData) -> Option<Exclusion> {
        let group = self.groups.get(&joint.group?)?.clone();
        Some(Exclusion::Joint { joint: joint_name(joint).into(), group })
    }

    /// Exclusion of a command of a joint: by the joint's group, its feature or its own switch.
    pub fn command(&self, joint: &JointData, tag: &TagData) -> Option<Exclusion> {
        let TagKind::Command { module, feature, .. } = &tag.kind else { return None };
        let command = || Arc::from(format!("{module}/{}", joint_name(joint)));
        let feature = feature.and_then(|feature| self.features.get(&feature));
        match (self.joint(joint), feature) {
            (Some(off), _) => Some(off),
            (None, _) if !tag.enabled => Some(Exclusion::Tag(command())),
            (None, Some(feature)) => Some(Exclusion::Feature { command: command(), feature: feature.clone() }),
            (None, None) => None,
        }
    }
}

/// Exclusion of a command of a joint, without a look at other joints.
pub(super) fn command_exclusion(rig: &Rig, joint: &JointData, tag: &TagData) -> Option<Exclusion> {
    let TagKind::Command { feature, .. } = &tag.kind else { return None };
    let feature = feature.and_then(|feature| rig.find_tag(feature)).filter(|(_, feature)| !feature.enabled);
    let group = joint.group.and_then(|group| rig.group(group)).filter(|group| !group.enabled);
    let switches = Switches {
        features: feature.and_then(|(_, feature)| Some((feature.uid, feature_name(feature)?))).into_iter().collect(),
        groups: group.map(|group| (group.uid, group.name.as_str().into())).into_iter().collect(),
    };
    switches.command(joint, tag)
}

fn joint_name(joint: &JointData) -> String {
    joint.label.clone().unwrap_or_else(|| joint.uid.to_string())
}

/// Name of a feature tag in messages; `None` for a command.
fn feature_name(tag: &TagData) -> Option<Arc<str>> {
    match &tag.kind {
        TagKind::Feature { name, switch, .. } if switch.is_empty() && !name.is_empty() => Some(name.as_str().into()),
        TagKind::Feature { name, switch, .. } if !switch.is_empty() => Some(format!("{name}:{switch}").into()),
        TagKind::Feature { .. } => Some(tag.uid.to_string().into()),
        TagKind::Command { .. } => None,
    }
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
