//! Places of tags among the tags of their joints, where a joint has many: found without a search.
//!
//! Places are notes of where a tag was seen, and no edit keeps them up to date. A tag that is not there any more is looked for
//! near its note, and if it is not near, all tags of the joint are noted anew.

use std::{
    collections::HashMap,
    fmt,
    sync::{Mutex, PoisonError},
};

use crate::rig::{Rig, RigJoint, TagData, Uid};

/// Number of tags of a joint that are searched without notes.
const FEW: usize = 32;

/// Furthest distance from its note at which a tag is looked for.
const NEAR: usize = 32;

/// Notes of a rig. They follow from its tags and are no content: any two compare as equal, and a clone has none.
#[derive(Default)]
pub(super) struct TagPlaces(Mutex<TagNotes>);

#[derive(Default)]
struct TagNotes {
    places: HashMap<Uid, usize>,
    /// Distance from its note at which the last tag was found: tags that were taken out or put in before one shift many others.
    shift: isize,
}

impl Clone for TagPlaces {
    fn clone(&self) -> Self {
        Self::default()
    }
}

impl PartialEq for TagPlaces {
    fn eq(&self, _: &Self) -> bool {
        true
    }
}

impl fmt::Debug for TagPlaces {
    fn fmt(&self, formatter: &mut fmt::Formatter) -> fmt::Result {
        formatter.write_str("TagPlaces")
    }
}

impl TagPlaces {
    /// Place of a tag in a list; each tag that is looked at is counted.
    fn find(&self, tags: &[TagData], tag: Uid, count: &dyn Fn(usize)) -> Option<usize> {
        let is_there = |place: usize| tags.get(place).is_some_and(|known| known.uid == tag);
        if tags.len() <= FEW {
            count(tags.len());
            return tags.iter().position(|known| known.uid == tag);
        }
        let mut notes = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        // A tag without a note was most likely added at the end.
        let noted = notes.places.get(&tag).copied().unwrap_or(tags.len() - 1);
        let around = |centre: usize| {
            (0..=NEAR).flat_map(move |far| [centre.checked_sub(far), centre.checked_add(far)]).flatten()
        };
        let near = around(noted.saturating_add_signed(notes.shift)).chain(around(noted));
        let (mut looked, mut found) = (0, None);
        for place in std::iter::once(noted).chain(near) {
            looked += 1;
            if is_there(place) {
                found = Some(place);
                break;
            }
        }
        count(looked);
        if let Some(place) = found {
            if place != noted {
                notes.shift = isize::try_from(place).unwrap_or_default() - isize::try_from(noted).unwrap_or_default();
                notes.places.insert(tag, place);
            }
            return Some(place);
        }
        count(tags.len());
        notes.shift = 0;
        notes.places.extend(tags.iter().zip(0..).map(|(known, place)| (known.uid, place)));
        notes.places.get(&tag).copied().filter(|place| is_there(*place))
    }

    /// Notes that a tag was put at a place.
    pub(super) fn note(&mut self, tag: Uid, place: usize) {
        self.0.get_mut().unwrap_or_else(PoisonError::into_inner).places.insert(tag, place);
    }

    /// Forgets a tag.
    pub(super) fn forget(&mut self, tag: Uid) {
        self.0.get_mut().unwrap_or_else(PoisonError::into_inner).places.remove(&tag);
    }
}

impl Rig {
    /// The tag with that uid, and the joint that carries it.
    pub fn find_tag(&self, uid: Uid) -> Option<(&RigJoint, &TagData)> {
        let joint = self.joint(*self.tags.get(&uid)?)?;
        let place = self.tag_places.find(&joint.data.tags, uid, &|tags| self.checkpoints.count(tags))?;
        Some((joint, joint.data.tags.get(place)?))
    }

    /// Place of a tag among those of a joint; `None` if the joint does not carry it.
    pub fn tag_place(&self, joint: Uid, tag: Uid) -> Option<usize> {
        if self.tags.get(&tag) != Some(&joint) {
            return None;
        }
        self.tag_places.find(&self.joint(joint)?.data.tags, tag, &|tags| self.checkpoints.count(tags))
    }
}
