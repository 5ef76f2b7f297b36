//! Cutting and pasting.

use super::{
    super::{Draft, OperationError, named_group},
    TagClipboard, TagError, add,
    clipboard::CopiedJoint,
    delete, found, refresh, set,
};
use crate::rig::{
    EditError, RigEdit, TagData, TagKind, Uid,
    label::mirrored_label,
    remap::{Remap, mirror_names, other_side, pair_tags},
};

/// Part of the copied tags that is pasted.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum PasteContent {
    /// Tags without their values: commands with the defaults of their modules. Identifier tags are all value.
    Tags,
    /// Values into the existing tags: of the same module or kind, in order.
    Values,
    /// Tags with their values.
    #[default]
    Both,
}

/// Target of copied tags.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum PasteTo {
    /// The listed joints: tags of one joint go onto each of them, tags of several in order, until either list ends.
    Joints(Vec<Uid>),
    /// The joints on the other side of the source joints. References are mirrored, and so are names and labels; modules
    /// mirror values with a side, see [`TagClipboard::map_params`].
    Mirror,
}

type Pair<'a> = (&'a CopiedJoint, Uid);

pub(super) fn cut(draft: &mut Draft, clipboard: &TagClipboard) -> Result<(), OperationError> {
    for joint in &clipboard.joints {
        let tags: Vec<Uid> = joint.tags.iter().map(|tag| tag.uid).collect();
        delete(draft, &tags)?;
        if let Some(identifiers) = &joint.identifiers {
            if identifiers.label.is_some() {
                draft.apply(RigEdit::SetLabel(joint.uid, None))?;
            }
            if identifiers.group.is_some() {
                draft.apply(RigEdit::SetGroup(joint.uid, None))?;
            }
        }
    }
    Ok(())
}

pub(super) fn paste(
    draft: &mut Draft,
    clipboard: &TagClipboard,
    what: PasteContent,
    to: &PasteTo,
) -> Result<(), OperationError> {
    if clipboard.is_empty() {
        return Err(TagError::EmptyClipboard.into());
    }
    let mirrored = *to == PasteTo::Mirror;
    let pairs = match to {
        PasteTo::Mirror => mirrored_pairs(draft, clipboard)?,
        PasteTo::Joints(joints) => pairs_in_order(draft, clipboard, joints)?,
    };
    let base = if mirrored { Remap { uids: other_side(draft.rig()), ..Remap::default() } } else { Remap::default() };
    if what != PasteContent::Tags {
        pairs.iter().try_for_each(|pair| paste_identifiers(draft, pair, mirrored))?;
    }
    // Tags of one joint that go to several have independent copies on each.
    let sets: Vec<&[Pair]> = match clipboard.joints.len() {
        1 => pairs.chunks(1).collect(),
        _ => vec![&pairs],
    };
    for set in sets {
        let mut remap = base.clone();
        joints_and_groups(draft, set, &mut remap);
        match what {
            PasteContent::Values => paste_values(draft, set, remap, mirrored)?,
            PasteContent::Tags => paste_tags(draft, set, remap, mirrored, |tag| {
                if let TagKind::Command { params, .. } = &mut tag.kind {
                    *params = "()".to_owned();
                }
            })?,
            PasteContent::Both => {
                // Tags that were cut are the same ones again where they come back.
                if !mirrored && clipboard.rig == draft.rig().uid() {
                    let cut = set.iter().flat_map(|(joint, _)| &joint.tags).map(|tag| tag.uid);
                    remap.uids.extend(cut.filter(|tag| !draft.rig().is_taken(*tag)).map(|tag| (tag, tag)));
                }
                paste_tags(draft, set, remap, mirrored, |_| {})?;
            }
        }
    }
    Ok(())
}

fn pairs_in_order<'a>(
    draft: &mut Draft,
    clipboard: &'a TagClipboard,
    joints: &[Uid],
) -> Result<Vec<Pair<'a>>, OperationError> {
    let mut targets: Vec<Uid> = Vec::with_capacity(joints.len());
    for &joint in joints {
        draft.rig().joint(joint).ok_or(EditError::NoJoint(joint))?;
        if !targets.contains(&joint) {
            targets.push(joint);
        }
    }
    if targets.is_empty() {
        return Err(TagError::NoTarget.into());
    }
    if let [one] = clipboard.joints.as_slice() {
        return Ok(targets.into_iter().map(|target| (one, target)).collect());
    }
    let (copied, count) = (clipboard.joints.len(), targets.len());
    if copied > count {
        let are = if copied - count == 1 { "copied joint is" } else { "copied joints are" };
        draft.note(format!("{} {are} left over: the selection has only {count}", copied - count));
    } else if count > copied {
        let are = if count - copied == 1 { "selected joint is" } else { "selected joints are" };
        draft.note(format!("{} {are} left over: the copy has only {copied}", count - copied));
    }
    Ok(clipboard.joints.iter().zip(targets).collect())
}

fn mirrored_pairs<'a>(draft: &mut Draft, clipboard: &'a TagClipboard) -> Result<Vec<Pair<'a>>, OperationError> {
    let other = |joint: &CopiedJoint| {
        let now = draft.rig().joint(joint.uid).and_then(|joint| joint.data.mirror);
        now.or(joint.mirror).filter(|mirror| draft.rig().joint(*mirror).is_some())
    };
    let pairs: Vec<Pair> =
        clipboard.joints.iter().filter_map(|joint| other(joint).map(|mirror| (joint, mirror))).collect();
    if pairs.is_empty() {
        return Err(TagError::NoMirror.into());
    }
    let without = clipboard.joints.len() - pairs.len();
    if without > 0 {
        let have = if without == 1 { "copied joint has" } else { "copied joints have" };
        draft.note(format!("{without} {have} no joint on the other side: tags of it were not pasted"));
    }
    Ok(pairs)
}

/// Maps copied joints to their targets, and their groups if that is unambiguous.
fn joints_and_groups(draft: &Draft, pairs: &[Pair], remap: &mut Remap) {
    for (joint, target) in pairs {
        remap.uids.insert(joint.uid, *target);
        let Some(target) = draft.rig().joint(*target) else { continue };
        if target.data.label.is_none() {
            remap.unlabelled.insert(target.data.uid);
        }
        let Some(group) = joint.group else { continue };
        let same = |(other, _): &&Pair| other.group == Some(group);
        let mut groups = pairs.iter().filter(same).map(|(_, target)| draft.rig().joint(*target)?.data.group);
        if let Some(Some(first)) = groups.next()
            && groups.all(|other| other == Some(first))
        {
            remap.uids.insert(group, first);
        }
    }
}

/// Adds copies of tags, each changed by `change`. A tag that `remap` maps to itself keeps its uid.
fn paste_tags(
    draft: &mut Draft,
    pairs: &[Pair],
    mut remap: Remap,
    mirrored: bool,
    change: impl Fn(&mut TagData),
) -> Result<(), OperationError> {
    for tag in pairs.iter().flat_map(|(joint, _)| &joint.tags) {
        if remap.get(tag.uid) != Some(tag.uid) {
            let uid = draft.next_uid();
            remap.uids.insert(tag.uid, uid);
        }
    }
    let mut pasted = Vec::new();
    for (joint, target) in pairs {
        for tag in &joint.tags {
            let mut copy = remap.tag(draft.rig(), tag);
            if mirrored {
                mirror_names(&mut copy);
            }
            change(&mut copy);
            pasted.push(copy.uid);
            add(draft, *target, copy, usize::MAX)?;
        }
    }
    refresh_all(draft, &pasted)
}

/// Refreshes names in references once all copies exist.
pub(super) fn refresh_all(draft: &mut Draft, tags: &[Uid]) -> Result<(), OperationError> {
    for &uid in tags {
        let (joint, mut tag) = found(draft, uid)?;
        refresh(draft.rig(), &mut tag);
        set(draft, joint, tag)?;
    }
    Ok(())
}

fn paste_values(draft: &mut Draft, pairs: &[Pair], mut remap: Remap, mirrored: bool) -> Result<(), OperationError> {
    let mut left = 0;
    for (joint, target) in pairs {
        let there = draft.rig().joint(*target).map(|target| target.data.tags.clone()).unwrap_or_default();
        for tag in &joint.tags {
            remap.uids.remove(&tag.uid);
        }
        pair_tags(&mut remap.uids, &joint.tags, &there);
        left += joint.tags.iter().filter(|tag| !remap.uids.contains_key(&tag.uid)).count();
    }
    if left > 0 {
        let tags = if left == 1 { "copied tag" } else { "copied tags" };
        draft.note(format!("{left} {tags} found no tag of the same module or kind to give values to"));
    }
    for tag in pairs.iter().flat_map(|(joint, _)| &joint.tags) {
        let Some(uid) = remap.get(tag.uid) else { continue };
        let mut copy = remap.tag(draft.rig(), tag);
        if mirrored {
            mirror_names(&mut copy);
        }
        refresh(draft.rig(), &mut copy);
        let (joint, now) = found(draft, uid)?;
        set(draft, joint, TagData { kind: with_values(now.kind, copy.kind), ..now })?;
    }
    Ok(())
}

/// The tag with the values of another; membership in a feature is not a value.
fn with_values(now: TagKind, from: TagKind) -> TagKind {
    match (now, from) {
        (TagKind::Command { module, feature, .. }, TagKind::Command { params, .. }) => {
            TagKind::Command { module, params, feature }
        }
        (TagKind::Feature { kind, .. }, TagKind::Feature { name, switch, choice, .. }) => {
            TagKind::Feature { kind, name, switch, choice }
        }
        (now, _) => now,
    }
}

fn paste_identifiers(draft: &mut Draft, (joint, target): &Pair, mirrored: bool) -> Result<(), OperationError> {
    let Some(identifiers) = &joint.identifiers else { return Ok(()) };
    let side = |name: &String| mirrored.then(|| mirrored_label(name)).flatten().unwrap_or_else(|| name.clone());
    let now = draft.rig().joint(*target).map(|joint| (joint.data.label.clone(), joint.data.group)).unwrap_or_default();
    let label = identifiers.label.as_ref().map(side);
    if now.0 != label {
        draft.apply(RigEdit::SetLabel(*target, label))?;
    }
    let group = match &identifiers.group {
        Some(group) if side(&group.name) == group.name && draft.rig().group(group.uid).is_some() => Some(group.uid),
        Some(group) => {
            let name = side(&group.name);
            let is_there = draft.rig().groups().iter().any(|group| group.name == name);
            named_group(draft, &name, (!is_there && !mirrored).then_some(group.color))?
        }
        None => None,
    };
    if now.1 != group {
        draft.apply(RigEdit::SetGroup(*target, group))?;
    }
    Ok(())
}
