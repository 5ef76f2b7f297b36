//! Part instances of two versions of a template: pairs that correspond to each other though their uids differ, and
//! instances that one version alone has.
//!
//! A uid that is left out follows from the file of the part and from the name, or else from the joints that the part goes onto.
//! So another file or other joints make another uid, and what was posed and changed of the part would be lost with it.

use std::collections::{BTreeMap, HashMap, HashSet};

use super::{Change, ChangeKind, TemplateWithParts};
use crate::rig::{RestTransform, Uid, format::template::quoted, part::PartInstance};

/// Pairs of instances with different uids: the uid in `other`, and the uid of the corresponding instance in `own`. Instances
/// correspond by their names, by their joints, by their part and the place where it stands, by their part and side if they have
/// no names, or by their part, side and a prefix that is not empty, in this order, and each has one counterpart at most.
/// Instances whose uids are written in both files do not correspond.
pub fn same_parts(own: &[PartInstance], other: &[PartInstance]) -> BTreeMap<Uid, Uid> {
    let uids = |list: &[PartInstance]| list.iter().map(|part| part.uid).collect::<HashSet<Uid>>();
    let (old_uids, new_uids) = (uids(own), uids(other));
    let mut gone: Vec<&PartInstance> = own.iter().filter(|part| !new_uids.contains(&part.uid)).collect();
    let mut come: Vec<&PartInstance> = other.iter().filter(|part| !old_uids.contains(&part.uid)).collect();
    let keys: [fn(&PartInstance) -> Option<String>; 5] = [name_key, place_key, standing_key, kind_key, prefix_key];
    let mut same = BTreeMap::new();
    for key in keys {
        let mut groups: HashMap<String, AlikeParts> = HashMap::new();
        for (side, parts) in [&gone, &come].into_iter().enumerate() {
            for part in parts {
                if let Some(key) = key(part) {
                    groups.entry(key).or_default().add(side, part);
                }
            }
        }
        let pairs: BTreeMap<Uid, Uid> = groups.values().flat_map(AlikeParts::pairs).collect();
        let paired: HashSet<Uid> = pairs.values().copied().collect();
        gone.retain(|part| !paired.contains(&part.uid));
        come.retain(|part| !pairs.contains_key(&part.uid));
        same.extend(pairs);
    }
    same
}

/// Instances of two versions that a rule takes for the same: in each version those whose uids are written, and the others.
#[derive(Default)]
struct AlikeParts {
    written: [Vec<Uid>; 2],
    derived: [Vec<Uid>; 2],
}

impl AlikeParts {
    fn add(&mut self, side: usize, part: &PartInstance) {
        let list = if is_derived(part) { &mut self.derived } else { &mut self.written };
        list[side].push(part.uid);
    }

    /// The new and the old uid of the instances that correspond. Two that could be it are none, and uids that are written in both
    /// versions are of two.
    fn pairs(&self) -> Option<(Uid, Uid)> {
        let [old_written, new_written] = &self.written;
        let [old_derived, new_derived] = &self.derived;
        match (&old_written[..], &old_derived[..], &new_written[..], &new_derived[..]) {
            ([], [old], [], [new]) | ([old], [], _, [new]) | (_, [old], [new], []) => Some((*new, *old)),
            _ => None,
        }
    }
}

fn name_key(part: &PartInstance) -> Option<String> {
    (!part.name.is_empty()).then(|| part.name.clone())
}

fn place_key(part: &PartInstance) -> Option<String> {
    let is_placed = part.name.is_empty() && !part.onto.is_empty();
    is_placed.then(|| format!("{:?}", (&part.onto, &part.prefix, part.mirror)))
}

/// Key of one part in one place, whatever it is called: another name is no other part.
fn standing_key(part: &PartInstance) -> Option<String> {
    let PartInstance { onto, parent, socket, adds, mirror, is_world, rest, .. } = part;
    // Both zeros are the same place.
    let RestTransform { translation, rotation, scale } = rest;
    let numbers = translation.to_array().into_iter().chain(rotation.to_array()).chain(scale.to_array());
    let rest: Vec<f32> = numbers.map(|number| number + 0.0).collect();
    Some(format!("{:?}", (&part.part, onto, parent, socket, adds, mirror, is_world, rest)))
}

fn kind_key(part: &PartInstance) -> Option<String> {
    part.name.is_empty().then(|| format!("{:?}", (&part.part, &part.prefix, part.mirror)))
}

/// Key of one part whose joints have the same labels, whatever it is called and wherever it hangs.
fn prefix_key(part: &PartInstance) -> Option<String> {
    (!part.prefix.is_empty()).then(|| format!("{:?}", (&part.part, &part.prefix, part.mirror)))
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
        let known: HashSet<Uid> = other.template.parts.iter().map(|part| part.uid).collect();
        let mut bearers: HashMap<Uid, &PartInstance> = HashMap::new();
        for (instance, fitted) in of.fitted.iter().filter(|(instance, _)| !known.contains(&instance.uid)) {
            for uid in instance.brought(fitted) {
                bearers.entry(uid).or_insert(instance);
            }
        }
        let mut told = HashSet::new();
        let whole = |change: Change| {
            let is_brought = change.kind == kind && !change.conflict;
            let Some(instance) = bearers.get(&change.uid).filter(|_| is_brought) else { return Some(change) };
            if !told.insert(instance.uid) {
                return None;
            }
            let file = Some(quoted(&instance.part));
            let (from, to) = if kind == ChangeKind::Added { (None, file) } else { (file, None) };
            let field = Some(format!("part {}", instance.title()));
            Some(Change { kind, uid: instance.uid, joint: None, tag: None, field, from, to, conflict: false })
        };
        changes = changes.into_iter().filter_map(whole).collect();
    }
    changes
}
