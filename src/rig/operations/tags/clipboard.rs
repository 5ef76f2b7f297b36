//! Tags on the clipboard: plain data with a text form, so that it can go through the system's clipboard.

use std::collections::HashSet;

use ron::ser::PrettyConfig;
use serde::{Deserialize, Serialize};

use super::TagError;
use crate::rig::{EditError, GroupData, Rig, TagData, TagKind, Uid, parse_ron};

/// Joints that an operation applies to.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum TagScope {
    /// The listed joints, in this order.
    Joints(Vec<Uid>),
    /// The listed joints and their hierarchies, in the order of the document.
    Hierarchy(Vec<Uid>),
    /// The joints in a local group.
    Group(Uid),
    /// All joints of the rig.
    Rig,
}

/// Copied tags.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TagClipboard {
    /// The rig they were copied from.
    pub rig: Uid,
    /// The joints that carried the tags, in order; a joint without tags keeps its place in the list.
    pub joints: Vec<CopiedJoint>,
}

/// A joint whose tags were copied.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CopiedJoint {
    /// Uid of the joint.
    pub uid: Uid,
    /// The joint on the other side.
    #[serde(default)]
    pub mirror: Option<Uid>,
    /// Local group of the joint: references to it become references to the group of the target.
    #[serde(default)]
    pub group: Option<Uid>,
    /// Identifier tags of the joint, if they were copied, too.
    #[serde(default)]
    pub identifiers: Option<CopiedIdentifiers>,
    /// Tags of the joint.
    #[serde(default)]
    pub tags: Vec<TagData>,
}

/// The identifier tags of a joint.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CopiedIdentifiers {
    /// The node label.
    #[serde(default)]
    pub label: Option<String>,
    /// The local group.
    #[serde(default)]
    pub group: Option<GroupData>,
}

impl TagScope {
    /// The joints, each once.
    ///
    /// # Errors
    /// For a joint or group that is not in the rig.
    pub fn joints(&self, rig: &Rig) -> Result<Vec<Uid>, EditError> {
        let mut seen = HashSet::new();
        let known = |joint: &Uid| rig.joint(*joint).map(|_| *joint).ok_or(EditError::NoJoint(*joint));
        Ok(match self {
            Self::Joints(joints) => {
                let joints = joints.iter().map(known).collect::<Result<Vec<_>, _>>()?;
                joints.into_iter().filter(|joint| seen.insert(*joint)).collect()
            }
            Self::Hierarchy(tops) => {
                tops.iter().try_for_each(|top| known(top).map(drop))?;
                let tops: HashSet<Uid> = tops.iter().copied().collect();
                let mut inside = |uid: Uid, parent: Option<Uid>| {
                    (tops.contains(&uid) || parent.is_some_and(|parent| seen.contains(&parent))) && seen.insert(uid)
                };
                rig.walk().filter(|joint| inside(joint.data.uid, joint.parent)).map(|joint| joint.data.uid).collect()
            }
            Self::Group(group) => {
                rig.group(*group).ok_or(EditError::NoGroup(*group))?;
                rig.walk().filter(|joint| joint.data.group == Some(*group)).map(|joint| joint.data.uid).collect()
            }
            Self::Rig => rig.walk().map(|joint| joint.data.uid).collect(),
        })
    }
}

impl TagClipboard {
    /// Copies the tags of joints that `wanted` agrees to, and their identifier tags if asked for.
    ///
    /// # Errors
    /// For a joint or group that is not in the rig.
    pub fn copy(
        rig: &Rig,
        scope: &TagScope,
        identifiers: bool,
        mut wanted: impl FnMut(&TagData) -> bool,
    ) -> Result<Self, EditError> {
        let joints = scope.joints(rig)?.into_iter().filter_map(|uid| rig.joint(uid));
        let joints = joints.map(|joint| CopiedJoint {
            uid: joint.data.uid,
            mirror: joint.data.mirror,
            group: joint.data.group,
            identifiers: identifiers.then(|| CopiedIdentifiers {
                label: joint.data.label.clone(),
                group: joint.data.group.and_then(|group| rig.group(group)).cloned(),
            }),
            tags: joint.data.tags.iter().filter(|tag| wanted(tag)).cloned().collect(),
        });
        Ok(Self { rig: rig.uid(), joints: joints.collect() })
    }

    /// Copies these tags, without the joints between them.
    ///
    /// # Errors
    /// For a tag that is not in the rig.
    pub fn copy_tags(rig: &Rig, tags: &[Uid]) -> Result<Self, TagError> {
        if let Some(missing) = tags.iter().find(|tag| rig.find_tag(**tag).is_none()) {
            return Err(TagError::NoTag(*missing));
        }
        let mut all = Self::copy(rig, &TagScope::Rig, false, |tag| tags.contains(&tag.uid)).unwrap_or_default();
        all.joints.retain(|joint| !joint.tags.is_empty());
        Ok(all)
    }

    /// Returns `true` if there is nothing to paste.
    pub fn is_empty(&self) -> bool {
        self.joints.iter().all(|joint| joint.tags.is_empty() && joint.identifiers.is_none())
    }

    /// The clipboard with other parameters: `change` gets the module and the parameters of each command and returns
    /// other ones, or nothing to leave them. This is how modules mirror values before a mirrored paste.
    #[must_use]
    pub fn map_params(mut self, mut change: impl FnMut(&str, &str) -> Option<String>) -> Self {
        for tag in self.joints.iter_mut().flat_map(|joint| &mut joint.tags) {
            if let TagKind::Command { module, params, .. } = &mut tag.kind
                && let Some(changed) = change(module, params)
            {
                *params = changed;
            }
        }
        self
    }

    /// The text form, RON.
    pub fn to_text(&self) -> String {
        // A clipboard holds nothing that RON cannot write.
        ron::ser::to_string_pretty(self, PrettyConfig::default().struct_names(true)).unwrap_or_default()
    }

    /// Reads the text form.
    ///
    /// # Errors
    /// [`TagError::NoClipboard`] for a text that is something else.
    pub fn from_text(text: &str) -> Result<Self, TagError> {
        let what = "TagClipboard";
        if !text.trim_start().starts_with(what) {
            return Err(TagError::NoClipboard(format!("its text does not begin with {what}")));
        }
        parse_ron(text).map_err(|error| TagError::NoClipboard(error.to_string()))
    }
}
