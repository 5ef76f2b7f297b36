//! Tags in an update: their content, and the joints that they are on.

use std::{collections::HashMap, sync::Arc};

use super::{
    Change, ChangeKind, ChangeSubject, Fate, Merge,
    choices::Take,
    fields::{joint_title, tag_fields, tag_title},
    shown_values::shown_values,
};
use crate::rig::{Rig, RigJoint, TagData, Uid};

/// Tags of a rig with their joints. A joint may have thousands, of which [`Rig::find_tag`] looks at one after the other.
pub(super) struct TagsByUid<'a>(HashMap<Uid, (Uid, &'a TagData)>);

impl<'a> TagsByUid<'a> {
    /// Tags of a rig; none without one.
    pub(super) fn of(rig: Option<&'a Rig>) -> Self {
        let joints = rig.into_iter().flat_map(Rig::walk);
        let tags = joints.flat_map(|joint| joint.data.tags.iter().map(move |tag| (tag.uid, (joint.data.uid, tag))));
        Self(tags.collect())
    }
}

impl Merge<'_> {
    /// Tag of a joint that stays; `None` if it is gone, or on another joint. A tag that both sides have is one tag, whichever
    /// joints it is on.
    pub(super) fn tag(&mut self, joint: Uid, title: &str, uid: Uid) -> Option<TagData> {
        let (base, now, file) = (self.base, self.now, self.file);
        let place = TagPlace::of(uid, base, now, file, &|| self.choices.of(uid, Some("joint")));
        if place.is_some_and(|place| place.joint != joint) {
            return None;
        }
        let [was, is, theirs] = self.tags.each_ref().map(|tags| {
            let found = tags.0.get(&uid).filter(|(on, _)| place.is_some() || *on == joint);
            found.map(|(_, tag)| (*tag).clone())
        });
        let name = is.as_ref().or(theirs.as_ref()).or(was.as_ref()).map(tag_title)?;
        let named = ChangeSubject { uid, joint: Some(title), tag: Some(&name), prefix: "" };
        if let Some(place) = place.filter(|place| place.is_told) {
            let titles = [place.now, place.file].map(|joint| Some(joint_title(now, file, joint)));
            let [from, to] = shown_values("joint", titles, &self.names);
            let field = Some("joint".to_owned());
            let conflict = place.is_conflict;
            self.changes.push(Change { kind: ChangeKind::Moved, field, from, to, conflict, ..named.change() });
        }
        let fate = match is {
            // Most tags of most updates: their parameters need not be read.
            Some(tag) if theirs.as_ref() == Some(&tag) => Fate::Kept(tag),
            _ => {
                let fields = tag_fields(&[&was, &is, &theirs].map(Option::as_ref), now, file);
                self.fate(&fields, (was.as_ref(), is.as_ref(), theirs.as_ref()), &named)
            }
        };
        match fate {
            Fate::Kept(tag) | Fate::Added(tag) => self.placed.insert(uid).then_some(tag),
            Fate::Absent | Fate::Removed => None,
        }
    }
}

/// Gives a joint its tags. One that has them stays shared with its rig.
pub(super) fn set_tags(joint: &mut Arc<RigJoint>, tags: Vec<TagData>) {
    if joint.data.tags != tags {
        Arc::make_mut(joint).data.tags = tags;
    }
}

/// Joints of a tag that both sides have, and the one that it is on after the update.
#[derive(Debug, Clone, Copy)]
struct TagPlace {
    now: Uid,
    file: Uid,
    /// Joint after the update.
    joint: Uid,
    /// True where the file has put the tag onto another joint.
    is_told: bool,
    /// True where both sides have.
    is_conflict: bool,
}

impl TagPlace {
    /// Place of a tag; `None` if one side does not have it. `choice` decides where both sides moved it.
    fn of(uid: Uid, base: Option<&Rig>, now: &Rig, file: &Rig, choice: &dyn Fn() -> Take) -> Option<Self> {
        let bearer = |rig: &Rig| rig.tags.get(&uid).copied();
        let (mine, theirs) = (bearer(now)?, bearer(file)?);
        let was = base.and_then(bearer);
        let place = Self { now: mine, file: theirs, joint: mine, is_told: false, is_conflict: false };
        // A joint that a person deleted gets no tags.
        let is_deleted = now.joint(theirs).is_none() && base.is_some_and(|base| base.joint(theirs).is_some());
        if mine == theirs || was == Some(theirs) || is_deleted {
            return Some(place);
        }
        let is_conflict = was != Some(mine);
        let joint = if !is_conflict || choice() == Take::Theirs { theirs } else { mine };
        Some(Self { joint, is_told: true, is_conflict, ..place })
    }
}
