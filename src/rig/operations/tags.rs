//! Operations on tags: add, order, change, copy and paste them, and turn features on and off.
//!
//! Live mirroring leaves tags alone; pasting them mirrored puts them on the other side.

mod clipboard;
mod insert;
mod part;
mod paste;
mod steady_names;

use std::{
    collections::{BTreeMap, HashSet},
    sync::Arc,
};

pub use clipboard::{CopiedIdentifiers, CopiedJoint, TagClipboard, TagScope};
pub use insert::Rewiring;
pub use part::PartOrder;
pub(in crate::rig) use part::drop_part;
pub use paste::{PasteContent, PasteTo};

use super::{Draft, OperationError};
use crate::rig::{
    EditError, Rig, RigEdit, TagData, TagKind, Uid,
    feature::{self, FeatureError, FeatureKey},
    part::{Part, PartError},
    reference::{BadReference, NameKind, bind_names, refresh_names},
};
use steady_names::SteadyNames;

/// A change of tags that a person requests. Tags are identified by their uids, wherever in the rig they are.
#[derive(Debug, Clone, PartialEq)]
pub enum TagOperation {
    /// Gives each joint a tag.
    Add {
        /// Joints that get the tag.
        joints: Vec<Uid>,
        /// Kind and data of the tag. Names without a uid in the parameters are bound.
        kind: TagKind,
        /// Index among the joint's tags; last if `None`.
        index: Option<usize>,
    },
    /// Gives a joint a command, to which references of another command go over.
    Insert {
        /// Joint that gets the tag.
        joint: Uid,
        /// Tag of the joint to insert before; `None` appends.
        before: Option<Uid>,
        /// Kind and data of the tag.
        kind: TagKind,
        /// References that go over to the tag.
        rewired: Option<Rewiring>,
    },
    /// Deletes tags. Commands of a deleted feature are in none then.
    Delete(Vec<Uid>),
    /// Enables tags or not.
    Enable(Vec<Uid>, bool),
    /// Moves tags, in the order given, to a joint (their own or another), before one of its tags or to the end.
    Move {
        /// Tags to move.
        tags: Vec<Uid>,
        /// Joint that gets the tags.
        joint: Uid,
        /// Tag to insert before; `None` appends.
        before: Option<Uid>,
    },
    /// Moves tags of several joints at once: (tag, joint that gets it, tag of that joint to insert before).
    MoveEach(Vec<(Uid, Uid, Option<Uid>)>),
    /// Gives a tag a comment.
    Comment(Uid, String),
    /// Gives commands other parameters. Names without a uid in their references are bound.
    Params(Vec<(Uid, String)>),
    /// Makes a feature tag another feature: kind, name, switch.
    Feature {
        /// Tag to change.
        tag: Uid,
        /// The kind.
        kind: String,
        /// The name; empty to organise only.
        name: String,
        /// The switch; empty for none.
        switch: String,
    },
    /// Makes the switches of feature tags those of a choice, of which exactly one is on: the first that is on stays on,
    /// or the first of all. An empty name makes them switches of their own.
    Choice(Vec<Uid>, String),
    /// Attaches commands to a feature tag anywhere in the rig, or detaches them.
    Attach(Vec<Uid>, Option<Uid>),
    /// Deletes the copied tags from their joints.
    Cut(Arc<TagClipboard>),
    /// Pastes the copied tags.
    Paste {
        /// The copied tags, from this rig or another.
        clipboard: Arc<TagClipboard>,
        /// Tags, values or both.
        what: PasteContent,
        /// Target joints.
        to: PasteTo,
    },
    /// Drops a part onto joints: the tags of the part's first joint go to the first, and so on, until either list ends. A part
    /// with a chain has as many joints in it as there are.
    Drop {
        /// The part.
        part: Arc<Part>,
        /// The joints, in the order of the part's, each below the one that its parent's tags go to.
        joints: Vec<Uid>,
        /// Counterparts in the rig of the part's joints and groups that have none in `joints`; other references are
        /// resolved by label or name.
        bindings: BTreeMap<Uid, Uid>,
    },
    /// Drops a part onto a chain of joints so that it stays a part: the rig's file gets a part instance.
    AddPart {
        /// File of the part, as a template names it.
        part: String,
        /// The part as it is [fitted](crate::rig::part::PartInstance::fitted) to these joints.
        fitted: Arc<Rig>,
        /// The joints, in order.
        joints: Vec<Uid>,
        /// True for a part of the other side of the character.
        mirror: bool,
    },
    /// Drops a part onto two chains of joints, one on each side, so that both stay parts.
    AddPair {
        /// File of the part, as a template names it.
        part: String,
        /// The two sides.
        sides: [PartSide; 2],
    },
    /// Turns a combined feature on or off.
    SetFeature(FeatureKey, bool),
    /// Turns one part of a combined feature on or off.
    SetSwitch(FeatureKey, String, bool),
    /// Turns one part of a combined feature on and its other parts off.
    ChooseSwitch(FeatureKey, String),
    /// Enables a local group or not.
    EnableGroup(Uid, bool),
}

/// Part on the joints of one side.
#[derive(Debug, Clone, PartialEq)]
pub struct PartSide {
    /// The part as it is [fitted](crate::rig::part::PartInstance::fitted) to these joints.
    pub fitted: Arc<Rig>,
    /// The joints, in order.
    pub joints: Vec<Uid>,
    /// True for a part of the other side of the character.
    pub mirror: bool,
}

/// Error of an operation on tags. The rig is unchanged.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum TagError {
    /// No such tag.
    #[error("there is no tag {0} in the rig; it may have been deleted: choose another")]
    NoTag(Uid),
    /// A tag that is not a command.
    #[error("tag {0} is no command; choose a command tag")]
    NotCommand(Uid),
    /// A tag that is not a feature.
    #[error("tag {0} is no feature; choose a feature tag")]
    NotFeature(Uid),
    /// A reference that cannot be read.
    #[error("parameters of tag {0}, byte {at}: {1}", at = .1.range.start)]
    BadReference(Uid, BadReference),
    /// No feature or switch of that name.
    #[error(transparent)]
    Feature(#[from] FeatureError),
    /// An empty clipboard.
    #[error("nothing has been copied; copy tags first")]
    EmptyClipboard,
    /// A text that is no clipboard.
    #[error("the clipboard holds no tags: {0}; copy tags first")]
    NoClipboard(String),
    /// No joint to paste onto.
    #[error("no joint is selected to put tags on; select some")]
    NoTarget,
    /// No joint on the other side to paste onto.
    #[error("none of the copied joints has a joint on the other side; mirror the joints first")]
    NoMirror,
    /// Fewer joints than a part needs.
    #[error(
        "the part \"{part}\" needs {} joints, from the first on {}; it gets {given}: select or name the rest of the \
         chain, or add joints",
        joints.len(),
        joints.join(", ")
    )]
    PartNeeds {
        /// Name of the part.
        part: String,
        /// Labels of the joints that it needs, in their order.
        joints: Vec<String>,
        /// The number of joints that it was dropped onto.
        given: usize,
    },
    /// A joint that would be two joints of a part.
    #[error("\"{joint}\" is given twice for the part \"{part}\"; give each joint once")]
    JointTwice {
        /// Name of the part.
        part: String,
        /// Label of the joint.
        joint: String,
    },
    /// Joints that do not hang on each other as those of a part do.
    #[error("{0}")]
    PartOrder(Box<PartOrder>),
    /// A part whose chain cannot have so many joints.
    #[error("{0}")]
    Part(Box<PartError>),
    /// A name of the part that fits several objects in the rig.
    #[error(
        "\"{name}\" of the part could be {} {kind}s of the rig ({}); choose one of them",
        candidates.len(),
        candidates.iter().map(|uid| uid.to_string()).collect::<Vec<_>>().join(", ")
    )]
    Ambiguous {
        /// Kind of the object.
        kind: NameKind,
        /// Uid of the object in the part, to be bound.
        uid: Uid,
        /// Name of the object in the part.
        name: String,
        /// Uids of the candidates in the rig.
        candidates: Vec<Uid>,
    },
}

impl TagOperation {
    /// A few words for the history panel.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Add { .. } => "Add tag",
            Self::Insert { .. } => "Insert tag",
            Self::Delete(..) => "Delete tags",
            Self::Enable(_, true) => "Enable tags",
            Self::Enable(_, false) => "Disable tags",
            Self::Move { .. } | Self::MoveEach(..) => "Move tags",
            Self::Comment(..) => "Comment tag",
            Self::Params(..) | Self::Feature { .. } | Self::Choice(..) => "Change tag",
            Self::Attach(_, Some(_)) => "Attach to feature",
            Self::Attach(_, None) => "Detach from feature",
            Self::Cut(..) => "Cut tags",
            Self::Paste { to: PasteTo::Mirror, .. } => "Paste tags mirrored",
            Self::Paste { .. } => "Paste tags",
            Self::Drop { .. } => "Drop part",
            Self::AddPart { .. } => "Add part",
            Self::AddPair { .. } => "Add part on both sides",
            Self::SetFeature(_, true) | Self::SetSwitch(_, _, true) => "Turn feature on",
            Self::SetFeature(_, false) | Self::SetSwitch(_, _, false) => "Turn feature off",
            Self::ChooseSwitch(..) => "Choose switch",
            Self::EnableGroup(_, true) => "Enable group",
            Self::EnableGroup(_, false) => "Disable group",
        }
    }
}

impl From<FeatureError> for OperationError {
    fn from(error: FeatureError) -> Self {
        TagError::from(error).into()
    }
}

pub(super) fn run(draft: &mut Draft, operation: &TagOperation) -> Result<(), OperationError> {
    match operation {
        TagOperation::Add { joints, kind, index } => {
            let names = SteadyNames::default();
            for &joint in joints {
                let tag = TagData { uid: draft.next_uid(), enabled: true, comment: String::new(), kind: kind.clone() };
                let tag = bound(draft, &names, tag)?;
                add(draft, joint, tag, index.unwrap_or(usize::MAX))?;
            }
            Ok(())
        }
        TagOperation::Insert { joint, before, kind, rewired } => {
            insert::insert(draft, *joint, *before, kind, rewired.as_ref())
        }
        TagOperation::Delete(tags) => delete(draft, tags),
        TagOperation::Enable(tags, enabled) => {
            tags.iter().try_for_each(|tag| change(draft, *tag, |tag| tag.enabled = *enabled))
        }
        TagOperation::Move { tags, joint, before } => relocate(draft, tags, *joint, *before),
        TagOperation::MoveEach(moves) => {
            moves.iter().try_for_each(|(tag, joint, before)| relocate(draft, &[*tag], *joint, *before))
        }
        TagOperation::Comment(tag, comment) => change(draft, *tag, |tag| tag.comment.clone_from(comment)),
        TagOperation::Params(tags) => {
            let names = SteadyNames::default();
            tags.iter().try_for_each(|(uid, text)| {
                let (joint, mut tag) = found(draft, *uid)?;
                let TagKind::Command { params, .. } = &mut tag.kind else {
                    return Err(TagError::NotCommand(*uid).into());
                };
                params.clone_from(text);
                let tag = bound(draft, &names, tag)?;
                set(draft, joint, tag)
            })
        }
        TagOperation::Feature { tag, kind, name, switch } => {
            feature_tag(draft, *tag)?;
            change(draft, *tag, |tag| {
                if let TagKind::Feature { kind: old_kind, name: old_name, switch: old_switch, .. } = &mut tag.kind {
                    old_kind.clone_from(kind);
                    old_name.clone_from(name);
                    old_switch.clone_from(switch);
                }
            })
        }
        TagOperation::Choice(tags, name) => {
            tags.iter().try_for_each(|tag| feature_tag(draft, *tag).map(drop))?;
            tags.iter().try_for_each(|tag| {
                change(draft, *tag, |tag| {
                    if let TagKind::Feature { choice, .. } = &mut tag.kind {
                        choice.clone_from(name);
                    }
                })
            })?;
            let edits = feature::settled_choices(draft.rig(), tags);
            apply(draft, edits)
        }
        TagOperation::Attach(tags, feature) => attach(draft, tags, *feature),
        TagOperation::Cut(clipboard) => paste::cut(draft, clipboard),
        TagOperation::Paste { clipboard, what, to } => paste::paste(draft, clipboard, *what, to),
        TagOperation::Drop { part, joints, bindings } => part::drop_sized(draft, part, joints, bindings),
        TagOperation::AddPart { part, fitted, joints, mirror } => {
            part::note_own_commands(draft, part, joints.iter());
            part::drop_instance(draft, part, fitted, joints, *mirror)
        }
        TagOperation::AddPair { part, sides } => {
            part::note_own_commands(draft, part, sides.iter().flat_map(|side| &side.joints));
            sides.iter().try_for_each(|side| part::drop_instance(draft, part, &side.fitted, &side.joints, side.mirror))
        }
        TagOperation::SetFeature(key, on) => apply(draft, feature::set_feature(draft.rig(), key, *on)?),
        TagOperation::SetSwitch(key, switch, on) => apply(draft, feature::set_switch(draft.rig(), key, switch, *on)?),
        TagOperation::ChooseSwitch(key, switch) => apply(draft, feature::choose_switch(draft.rig(), key, switch)?),
        TagOperation::EnableGroup(group, enabled) => {
            let mut group = draft.rig().group(*group).ok_or(EditError::NoGroup(*group))?.clone();
            let changes = group.enabled != *enabled;
            group.enabled = *enabled;
            if changes { apply(draft, vec![RigEdit::SetLocalGroup(group)]) } else { Ok(()) }
        }
    }
}

fn apply(draft: &mut Draft, edits: Vec<RigEdit>) -> Result<(), OperationError> {
    edits.into_iter().try_for_each(|edit| Ok(draft.apply(edit)?))
}

fn found(draft: &Draft, tag: Uid) -> Result<(Uid, TagData), TagError> {
    let (joint, found) = draft.rig().find_tag(tag).ok_or(TagError::NoTag(tag))?;
    Ok((joint.data.uid, found.clone()))
}

fn feature_tag(draft: &Draft, tag: Uid) -> Result<(), TagError> {
    match found(draft, tag)?.1.kind {
        TagKind::Feature { .. } => Ok(()),
        TagKind::Command { .. } => Err(TagError::NotFeature(tag)),
    }
}

fn add(draft: &mut Draft, joint: Uid, tag: TagData, index: usize) -> Result<(), OperationError> {
    Ok(draft.apply(RigEdit::AddTag { joint, tag: Box::new(tag), index })?)
}

/// Replaces a tag; an unchanged tag needs no edit.
fn set(draft: &mut Draft, joint: Uid, tag: TagData) -> Result<(), OperationError> {
    if draft.rig().find_tag(tag.uid).is_some_and(|(_, now)| *now == tag) {
        return Ok(());
    }
    Ok(draft.apply(RigEdit::SetTag(joint, Box::new(tag)))?)
}

fn change(draft: &mut Draft, tag: Uid, change: impl FnOnce(&mut TagData)) -> Result<(), OperationError> {
    let (joint, mut tag) = found(draft, tag)?;
    change(&mut tag);
    set(draft, joint, tag)
}

/// The tag with uids beside all names in its references.
fn bound(draft: &Draft, names: &SteadyNames, mut tag: TagData) -> Result<TagData, TagError> {
    if let TagKind::Command { params, .. } = &mut tag.kind {
        let (text, bad) = bind_names(params, &names.of(draft.rig()));
        let text = text.into_owned();
        if let Some(bad) = bad.into_iter().next() {
            return Err(TagError::BadReference(tag.uid, bad));
        }
        *params = text;
    }
    Ok(tag)
}

/// Writes the current name beside every uid in a tag's references.
fn refresh(rig: &Rig, tag: &mut TagData) {
    if let TagKind::Command { params, .. } = &mut tag.kind {
        *params = refresh_names(params, rig).into_owned();
    }
}

fn delete(draft: &mut Draft, tags: &[Uid]) -> Result<(), OperationError> {
    let mut features = HashSet::new();
    for &uid in tags {
        let (_, tag) = draft.rig().find_tag(uid).ok_or(TagError::NoTag(uid))?;
        if matches!(tag.kind, TagKind::Feature { .. }) {
            features.insert(uid);
        }
    }
    if !features.is_empty() {
        let all = draft.rig().walk().flat_map(|joint| &joint.data.tags);
        let is_in_one = |tag: &&TagData| match tag.kind {
            TagKind::Command { feature: Some(feature), .. } => features.contains(&feature),
            _ => false,
        };
        let commands: Vec<Uid> = all.filter(is_in_one).map(|tag| tag.uid).collect();
        attach(draft, &commands, None)?;
    }
    // The last ones first, which leaves the places of the others.
    for &uid in tags.iter().rev() {
        let (joint, _) = draft.rig().find_tag(uid).ok_or(TagError::NoTag(uid))?;
        let joint = joint.data.uid;
        draft.apply(RigEdit::RemoveTag(joint, uid))?;
    }
    Ok(())
}

fn attach(draft: &mut Draft, tags: &[Uid], to: Option<Uid>) -> Result<(), OperationError> {
    to.map_or(Ok(()), |feature| feature_tag(draft, feature))?;
    for &uid in tags {
        let (joint, mut tag) = found(draft, uid)?;
        let TagKind::Command { feature, .. } = &mut tag.kind else { return Err(TagError::NotCommand(uid).into()) };
        *feature = to;
        set(draft, joint, tag)?;
    }
    Ok(())
}

fn relocate(draft: &mut Draft, tags: &[Uid], joint: Uid, before: Option<Uid>) -> Result<(), OperationError> {
    let mut moved: Vec<Uid> = Vec::with_capacity(tags.len());
    let mut is_moved: HashSet<Uid> = HashSet::with_capacity(tags.len());
    for &tag in tags {
        found(draft, tag)?;
        if is_moved.insert(tag) {
            moved.push(tag);
        }
    }
    let bearer = draft.rig().joint(joint).ok_or(EditError::NoJoint(joint))?;
    let old: Vec<Uid> = bearer.data.tags.iter().map(|tag| tag.uid).collect();
    let start = match before {
        Some(before) => old.iter().position(|tag| *tag == before).ok_or(EditError::NoTag(joint, before))?,
        None => old.len(),
    };
    // The next tag that does not move itself.
    let next = old[start..].iter().find(|tag| !is_moved.contains(tag)).copied();
    let mut wanted: Vec<Uid> = old.iter().filter(|tag| !is_moved.contains(tag)).copied().collect();
    let place = next.and_then(|next| wanted.iter().position(|tag| *tag == next)).unwrap_or(wanted.len());
    wanted.splice(place..place, moved.iter().copied());
    if wanted == old {
        return Ok(());
    }
    for &tag in &moved {
        // The place before the next tag, once the moved one has left its own place.
        let before = next.and_then(|next| draft.rig().tag_place(joint, next));
        let own = draft.rig().tag_place(joint, tag);
        let index = before.map_or(usize::MAX, |before| before - usize::from(own.is_some_and(|own| own < before)));
        draft.apply(RigEdit::MoveTag { tag, joint, index })?;
    }
    Ok(())
}
