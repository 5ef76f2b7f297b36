//! Commands that are inserted between two others.

use super::{SteadyNames, TagError, add, bound, found, refresh, set};
use crate::rig::{
    EditError, NodeRef, TagData, TagKind, Uid, fields,
    operations::{Draft, OperationError},
    reference::{Source, map_references},
};

/// References of a parameter that go over to an inserted command.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Rewiring {
    /// Command with the references.
    pub tag: Uid,
    /// Name of the parameter.
    pub parameter: String,
    /// Command that the references mean so far.
    pub source: Uid,
}

pub(super) fn insert(
    draft: &mut Draft,
    joint: Uid,
    before: Option<Uid>,
    kind: &TagKind,
    rewired: Option<&Rewiring>,
) -> Result<(), OperationError> {
    let tags = &draft.rig().joint(joint).ok_or(EditError::NoJoint(joint))?.data.tags;
    let index = match before {
        Some(before) => tags.iter().position(|tag| tag.uid == before).ok_or(EditError::NoTag(joint, before))?,
        None => tags.len(),
    };
    let uid = draft.next_uid();
    let tag = TagData { uid, enabled: true, comment: String::new(), kind: kind.clone() };
    let mut tag = bound(draft, &SteadyNames::default(), tag)?;
    refresh(draft.rig(), &mut tag);
    add(draft, joint, tag, index)?;
    let Some(rewired) = rewired else { return Ok(()) };
    let (bearer, mut tag) = found(draft, rewired.tag)?;
    let TagKind::Command { params, .. } = &mut tag.kind else {
        return Err(TagError::NotCommand(rewired.tag).into());
    };
    let place = fields(params)
        .into_iter()
        .find(|field| field.depth == 1 && field.name == rewired.parameter)
        .map(|field| field.value..field.end);
    if let Some(place) = place {
        // Roles and places in a list are those of the other command's nodes.
        let text = map_references(&params[place.clone()], |reference| {
            if reference.source == Source::Command(rewired.source) {
                *reference = NodeRef::command(uid);
            }
        });
        params.replace_range(place, &text);
    }
    refresh(draft.rig(), &mut tag);
    set(draft, bearer, tag)
}
