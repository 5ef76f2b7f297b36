//! Copies of templates in other rigs: what merging and injecting bring, found again by its uids alone.
//!
//! A copy has the template's own uids where all of them were free. Every other one has uids that follow from the template, the
//! number of the copy and the template's uids. So an update finds each copy, and takes nothing else for one: that a thing has the
//! label of a template's, from which its uid follows, does not make it the template's.

use std::collections::HashSet;

use super::{Rig, Uid};

/// Numbers in a row without a copy, behind which none is looked for: copies may have been deleted.
const GAP: usize = 3;

/// A copy of a template in a rig: the uid that those of its things follow from; `None` for the one with the template's own.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::rig) struct TemplateCopy(Option<Uid>);

impl TemplateCopy {
    /// The copy with the template's own uids.
    const PLAIN: Self = Self(None);

    fn numbered(template: Uid, number: usize) -> Self {
        let (template, number) = (template.to_string(), number.to_string());
        Self(Some(Uid::derived(["copy of a template", template.as_str(), number.as_str()])))
    }

    /// Returns `true` for the copy with the template's own uids.
    pub fn is_plain(self) -> bool {
        self == Self::PLAIN
    }

    /// Uid in the rig of something with that uid in the template.
    pub fn uid_of(self, uid: Uid) -> Uid {
        let Some(copy) = self.0 else { return uid };
        let (copy, uid) = (copy.to_string(), uid.to_string());
        Uid::derived([copy.as_str(), uid.as_str()])
    }

    /// The copy for joints and tags that come into a rig: with their own uids if all of these are free.
    pub fn merged(rig: &Rig, template: &Rig) -> Self {
        let things: Vec<Uid> = things(template).collect();
        let is_free = !things.iter().any(|uid| rig.is_taken(*uid));
        // The template's tags may have come before, without its joints.
        let first = Self::numbered(template.uid(), 1);
        if is_free && !first.is_in(rig, &things) { Self::PLAIN } else { Self::next(rig, template, &things) }
    }

    /// The copy for tags that come onto joints of a rig.
    pub fn injected(rig: &Rig, template: &Rig) -> Self {
        Self::next(rig, template, &things(template).collect::<Vec<_>>())
    }

    /// The next copy with uids of its own. The plain one counts as the first if it is there.
    fn next(rig: &Rig, template: &Rig, things: &[Uid]) -> Self {
        let taken = things.iter().filter(|uid| rig.is_taken(**uid)).count();
        // Single things may have their uids by chance, because these follow from labels that others chose, too.
        let has_plain = rig.uid() == template.uid() || 2 * taken > things.len();
        let mut number = if has_plain { 2 } else { 1 };
        loop {
            let copy = Self::numbered(template.uid(), number);
            if !copy.is_in(rig, things) {
                return copy;
            }
            number += 1;
        }
    }

    /// The copies of a template in a rig; `versions` are versions of the template, the one that came into the rig first.
    pub fn all_in(rig: &Rig, versions: &[&Rig]) -> Vec<Self> {
        let Some(template) = versions.first().map(|version| version.uid()) else { return Vec::new() };
        let things: HashSet<Uid> = versions.iter().copied().flat_map(things).collect();
        let mut own = rig.joints.keys().chain(rig.tags.keys());
        // In a rig without anything else there is no other copy.
        if own.all(|uid| things.contains(uid)) {
            return vec![Self::PLAIN];
        }
        let things: Vec<Uid> = things.into_iter().collect();
        let mut copies = Vec::new();
        let (mut number, mut missing) = (1, 0);
        while missing < GAP {
            let copy = Self::numbered(template, number);
            if copy.is_in(rig, &things) {
                copies.push(copy);
                missing = 0;
            } else {
                missing += 1;
            }
            number += 1;
        }
        // Where the first copy has uids of its own, what has those of the template is something else.
        if rig.uid() == template || copies.first() != Some(&Self::numbered(template, 1)) {
            copies.insert(0, Self::PLAIN);
        }
        copies
    }

    /// Uids in a rig of the joints and tags of all other copies.
    pub fn others(self, all: &[Self], versions: &[&Rig]) -> HashSet<Uid> {
        let others = all.iter().filter(|other| **other != self);
        let of_copy =
            |copy: &Self| versions.iter().copied().flat_map(things).map(|uid| copy.uid_of(uid)).collect::<Vec<_>>();
        others.flat_map(of_copy).collect()
    }

    fn is_in(self, rig: &Rig, things: &[Uid]) -> bool {
        things.iter().any(|uid| rig.is_taken(self.uid_of(*uid)))
    }
}

/// Groups, joints and tags of a template.
fn things(template: &Rig) -> impl Iterator<Item = Uid> + '_ {
    let groups = template.groups().iter().map(|group| group.uid);
    groups.chain(template.joints.keys().copied()).chain(template.tags.keys().copied())
}
