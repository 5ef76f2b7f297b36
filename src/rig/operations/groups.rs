//! Local groups that become one.

use crate::rig::{
    Rig, RigEdit, TagData, TagKind, Uid,
    reference::{GroupScope, map_references, map_uids, refresh_names},
};

/// Edits that put the joints of a local group into another one, let references mean that one, too, and remove the first.
/// Empty where one of the two is not there, or both are the same.
pub fn merged_groups(rig: &Rig, group: Uid, into: Uid) -> Vec<RigEdit> {
    if group == into || rig.group(group).is_none() || rig.group(into).is_none() {
        return Vec::new();
    }
    let mut edits = Vec::new();
    for joint in rig.walk() {
        let uid = joint.data.uid;
        if joint.data.group == Some(group) {
            edits.push(RigEdit::SetGroup(uid, Some(into)));
        }
        let changed = joint.data.tags.iter().filter_map(|tag| with_group(rig, tag, group, into));
        edits.extend(changed.map(|tag| RigEdit::SetTag(uid, Box::new(tag))));
    }
    edits.push(RigEdit::RemoveLocalGroup(group));
    edits
}

/// The tag with references to another group; `None` if it has none to the first.
fn with_group(rig: &Rig, tag: &TagData, group: Uid, into: Uid) -> Option<TagData> {
    let TagKind::Command { module, params, feature } = &tag.kind else { return None };
    let referred = map_references(params, |reference| {
        if reference.group == GroupScope::Group(group) {
            reference.group = GroupScope::Group(into);
        }
    });
    let changed = map_uids(&referred, |uid| (uid == group).then_some(into));
    if changed == *params {
        return None;
    }
    let params = refresh_names(&changed, rig).into_owned();
    Some(TagData { kind: TagKind::Command { module: module.clone(), params, feature: *feature }, ..tag.clone() })
}
