//! Parts that people drop onto joints of a rig, and that are parts in its file, too.

use std::collections::HashSet;

use serde::{Deserialize, Serialize};

use super::PartInstance;
use crate::rig::{EditError, Rig, RigEdit, Uid, label::mirrored_label};

/// A part that was dropped onto joints of a rig. The next save of the rig writes it as a [`PartInstance`].
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DroppedPart {
    /// Identity of the instance. The uids of the joints and tags that the part brings follow from it.
    pub uid: Uid,
    /// File of the part, as a template names it.
    pub part: String,
    /// Joints that the part goes onto, in the order of its joints.
    pub joints: Vec<Uid>,
    /// True for the other side of the character.
    #[serde(default)]
    pub mirror: bool,
}

impl DroppedPart {
    /// The instance as a file has it; `None` if a joint is gone, or its label is not its alone.
    pub fn instance(&self, rig: &Rig) -> Option<PartInstance> {
        let label = |joint: &Uid| {
            let label = rig.joint(*joint)?.data.label.clone()?;
            (rig.label_count(&label) == 1).then_some(label)
        };
        Some(self.instance_onto(self.joints.iter().map(label).collect::<Option<_>>()?))
    }

    /// The instance with labels for the joints that it goes onto.
    pub(crate) fn instance_onto(&self, onto: Vec<String>) -> PartInstance {
        PartInstance { uid: self.uid, part: self.part.clone(), onto, mirror: self.mirror, ..PartInstance::default() }
    }
}

impl PartInstance {
    /// Uid that follows from the part and the joints that it goes onto, for an instance without a name.
    pub(in crate::rig) fn uid_from_joints(part: &str, onto: &[String]) -> Uid {
        Self::derived_uid(part, "", onto)
    }

    /// Uid of an instance that has none of its own: it follows from the part and the name, or else from the joints that the part
    /// goes onto.
    pub(in crate::rig) fn derived_uid(part: &str, name: &str, onto: &[String]) -> Uid {
        let onto = onto.join(" ");
        Uid::derived(["part instance", part, if name.is_empty() { onto.as_str() } else { name }])
    }

    /// Uids of the tags that the fitted part brings, and of the joints that it adds.
    pub(crate) fn brought(&self, fitted: &Rig) -> Vec<Uid> {
        let of_joint = fitted.walk().enumerate().flat_map(|(place, joint)| {
            let added = (place >= self.onto.len() && (self.onto.is_empty() || self.adds)).then_some(joint.data.uid);
            added.into_iter().chain(joint.data.tags.iter().map(|tag| tag.uid)).collect::<Vec<_>>()
        });
        of_joint.map(|uid| self.uid_of(uid)).collect()
    }
}

/// The rig without what dropped parts have brought, each with its part as it is fitted, and without the tags that stand behind
/// theirs on a joint, but for those that `file` has: these are changes of the parts. Without `has_partners` partners that
/// follow from labels are left out, too, but for those that `file` has: a file with parts need not say them.
///
/// # Errors
/// [`EditError`] of an edit that is refused.
pub(crate) fn without_dropped(
    rig: &Rig,
    parts: &[(PartInstance, Rig)],
    file: Option<&Rig>,
    has_partners: bool,
) -> Result<Rig, EditError> {
    let brought: HashSet<Uid> = parts
        .iter()
        .flat_map(|(instance, part)| {
            let groups = part.groups().iter().map(|group| instance.uid_of(group.uid));
            instance.brought(part).into_iter().chain(groups).collect::<Vec<_>>()
        })
        .collect();
    let mut out = rig.clone();
    for joint in rig.walk() {
        let (uid, tags) = (joint.data.uid, &joint.data.tags);
        let first = tags.iter().position(|tag| brought.contains(&tag.uid)).unwrap_or(tags.len());
        for tag in &tags[first..] {
            let is_in_file = file.is_some_and(|file| file.find_tag(tag.uid).is_some());
            if brought.contains(&tag.uid) || !is_in_file {
                out.apply(&RigEdit::RemoveTag(uid, tag.uid))?;
            }
        }
        if joint.data.group.is_some_and(|group| brought.contains(&group)) {
            out.apply(&RigEdit::SetGroup(uid, None))?;
        }
    }
    let is_in_file = |joint: Uid| file.and_then(|file| file.joint(joint)?.data.mirror).is_some();
    for joint in rig.walk().filter(|joint| !has_partners && !is_in_file(joint.data.uid)) {
        let label = |uid: Uid| rig.joint(uid).and_then(|joint| joint.data.label.as_deref());
        let opposite = joint.data.label.as_deref().and_then(mirrored_label);
        if opposite.is_some() && joint.data.mirror.and_then(label) == opposite.as_deref() {
            out.apply(&RigEdit::SetMirror(joint.data.uid, None))?;
        }
    }
    for group in rig.groups().iter().filter(|group| brought.contains(&group.uid)) {
        out.apply(&RigEdit::RemoveLocalGroup(group.uid))?;
    }
    out.apply(&RigEdit::SetDroppedParts(Vec::new()))?;
    Ok(out)
}
