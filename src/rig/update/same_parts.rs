//! Part instances of two versions of a template: pairs that correspond to each other though their uids differ, and
//! instances that one version alone has.
//!
//! A uid that is left out follows from the file of the part and from the name, or else from the joints that the part goes onto.
//! So another file or other joints make another uid, and what was posed and changed of the part would be lost with it.

use std::collections::{BTreeMap, HashSet};

use super::{Change, ChangeKind, TemplateWithParts};
use crate::rig::{Uid, format::template::quoted, part::PartInstance};

/// Pairs of instances with different uids: the uid in `other`, and the uid of the corresponding instance in `own`. Instances
/// correspond by their names, by their joints, by their part and the place where it stands, by their part and side if they have
/// no names, or by their part, side and a prefix that is not empty, in this order, and each has one counterpart at most.
/// Instances whose uids are written in both files do not correspond.
pub fn same_parts(own: &[PartInstance], other: &[PartInstance]) -> BTreeMap<Uid, Uid> {
    let is_in = |list: &[PartInstance], uid: Uid| list.iter().any(|part| part.uid == uid);
    let mut gone: Vec<&PartInstance> = own.iter().filter(|part| !is_in(other, part.uid)).collect();
    let mut come: Vec<&PartInstance> = other.iter().filter(|part| !is_in(own, part.uid)).collect();
    let rules: [fn(&PartInstance, &PartInstance) -> bool; 5] =
        [have_one_name, have_one_place, stand_in_one_place, are_of_one_kind, have_one_prefix];
    let mut same = BTreeMap::new();
    for rule in rules {
        let are_one = |old: &PartInstance, new: &PartInstance| rule(old, new) && (is_derived(old) || is_derived(new));
        let mut pairs: Vec<(Uid, Uid)> = Vec::new();
        for new in &come {
            let olds: Vec<&PartInstance> = gone.iter().copied().filter(|old| are_one(old, new)).collect();
            let [old] = olds[..] else { continue };
            // Two that could be it are none.
            if come.iter().filter(|rival| are_one(old, rival)).count() == 1 {
                pairs.push((new.uid, old.uid));
            }
        }
        gone.retain(|old| pairs.iter().all(|(_, uid)| *uid != old.uid));
        come.retain(|new| pairs.iter().all(|(uid, _)| *uid != new.uid));
        same.extend(pairs);
    }
    same
}

fn have_one_name(old: &PartInstance, new: &PartInstance) -> bool {
    !old.name.is_empty() && old.name == new.name
}

fn have_one_place(old: &PartInstance, new: &PartInstance) -> bool {
    !old.onto.is_empty() && old.onto == new.onto && are_alike(old, new)
}

/// True for one part in one place, whatever it is called: another name is no other part.
fn stand_in_one_place(old: &PartInstance, new: &PartInstance) -> bool {
    let place = |of: &PartInstance| (of.adds, of.mirror, of.is_world, of.rest);
    let hangs_on_one = (&old.onto, &old.parent, &old.socket) == (&new.onto, &new.parent, &new.socket);
    old.part == new.part && hangs_on_one && place(old) == place(new)
}

fn are_of_one_kind(old: &PartInstance, new: &PartInstance) -> bool {
    old.part == new.part && are_alike(old, new)
}

/// True for one part whose joints have the same labels, whatever it is called and wherever it hangs.
fn have_one_prefix(old: &PartInstance, new: &PartInstance) -> bool {
    !old.prefix.is_empty() && (&old.part, &old.prefix, old.mirror) == (&new.part, &new.prefix, new.mirror)
}

/// True for two without names, with one prefix and on one side.
fn are_alike(old: &PartInstance, new: &PartInstance) -> bool {
    let are_nameless = old.name.is_empty() && new.name.is_empty();
    are_nameless && old.prefix == new.prefix && old.mirror == new.mirror
}

/// True if the uid of an instance is the one that it has where none is written.
fn is_derived(part: &PartInstance) -> bool {
    let named = [part.name.clone()];
    let title = if part.name.is_empty() { part.onto.as_slice() } else { named.as_slice() };
    part.uid == PartInstance::uid_from_joints(&part.part, title)
}

/// The change of an instance that has another name or other joints in the file, and with these another uid there; `None` for
/// one that is called the same. `uid` is the one that it keeps.
pub fn moved_part(uid: Uid, from: &PartInstance, to: &PartInstance) -> Option<Change> {
    let called = |part: &PartInstance| match part.name.is_empty() {
        true => format!("{} on {}", part.part, part.onto.join(", ")),
        false => part.name.clone(),
    };
    let (was, is) = (called(from), called(to));
    (was != is).then(|| Change {
        kind: ChangeKind::Renamed,
        uid,
        joint: None,
        tag: None,
        field: Some(format!("part {}", from.title())),
        from: Some(was),
        to: Some(is),
        conflict: false,
    })
}

/// Changes in which a part instance that one version alone has is a single change, in place of one change for each joint and
/// tag that the instance brings.
pub fn with_whole_parts(mut changes: Vec<Change>, [from, to]: [&TemplateWithParts; 2]) -> Vec<Change> {
    for (of, other, kind) in [(from, to, ChangeKind::Removed), (to, from, ChangeKind::Added)] {
        for (instance, fitted) in &of.fitted {
            if other.template.parts.iter().any(|part| part.uid == instance.uid) {
                continue;
            }
            let brought: HashSet<Uid> = instance.brought(fitted).into_iter().collect();
            let is_brought = |change: &Change| change.kind == kind && !change.conflict && brought.contains(&change.uid);
            let Some(place) = changes.iter().position(is_brought) else { continue };
            changes.retain(|change| !is_brought(change));
            let file = Some(quoted(&instance.part));
            let (from, to) = if kind == ChangeKind::Added { (None, file) } else { (file, None) };
            let field = Some(format!("part {}", instance.title()));
            let whole = Change { kind, uid: instance.uid, joint: None, tag: None, field, from, to, conflict: false };
            changes.insert(place, whole);
        }
    }
    changes
}
