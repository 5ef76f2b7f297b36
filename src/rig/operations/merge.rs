//! Merging of one rig into another.

use std::{
    borrow::Cow,
    collections::{HashMap, HashSet},
};

use super::{Draft, OperationError};
use crate::rig::{EditError, GroupData, Rig, RigEdit, RigInput, Uid, remap::Remap, template_copy::TemplateCopy};

/// Puts the joints of another rig, with groups, tags and clips, into the draft's. The roots hang on `parent`, in the place that they
/// have in their own rig. Uids stay where all of them are free; else they are those of a [copy](TemplateCopy). Labels and names stay
/// where they are free; others get the other rig's name in front, with a number where that makes none of them free. Each joint of an
/// owned rig makes room for its copy.
pub(super) fn merge(draft: &mut Draft, mut other: Cow<'_, Rig>, parent: Option<Uid>) -> Result<(), OperationError> {
    if let Some(parent) = parent.filter(|parent| draft.rig().joint(*parent).is_none()) {
        return Err(EditError::NoJoint(parent).into());
    }
    let copy = TemplateCopy::merged(draft.rig(), &other);
    // What has the uids of the other rig is mapped nowhere.
    let mut uids = if copy.is_plain() { HashMap::new() } else { moved_uids(&other, copy) };
    let moved = uids.len();
    let mut inputs = draft.rig().inputs().to_vec();
    let mut known: HashMap<String, Uid> = inputs.iter().map(|own| (own.name.clone(), own.uid)).collect();
    for input in other.inputs() {
        // The two mean the same thing outside of them.
        if let Some(own) = known.get(&input.name) {
            uids.insert(input.uid, *own);
            continue;
        }
        let uid = copy.uid_of(input.uid);
        let uid = if draft.rig().is_taken(uid) { draft.next_uid() } else { uid };
        uids.insert(input.uid, uid);
        known.insert(input.name.clone(), uid);
        inputs.push(RigInput { uid, ..input.clone() });
    }
    if inputs != draft.rig().inputs() {
        draft.apply(RigEdit::SetInputs(inputs))?;
    }
    let remap = Remap { uids, ..Remap::default() };
    let prefix = prefix(draft.rig(), &other);
    let mut names: HashSet<String> = draft.rig().groups().iter().map(|group| group.name.clone()).collect();
    for group in other.groups() {
        let named = names.contains(&group.name);
        let name = if named { format!("{prefix}_{}", group.name) } else { group.name.clone() };
        names.insert(name.clone());
        let uid = remap.get(group.uid).unwrap_or(group.uid);
        let place = draft.rig().groups().len();
        draft.apply(RigEdit::AddLocalGroup(GroupData { uid, name, ..group.clone() }, place))?;
    }
    let labels: HashSet<String> = draft.rig().walk().filter_map(|joint| joint.data.label.clone()).collect();
    let mut renamed = 0;
    let mut selected = Vec::new();
    let order: Vec<Uid> = other.walk().map(|joint| joint.data.uid).collect();
    for uid in order {
        let found = match &mut other {
            Cow::Borrowed(rig) => rig.joint(uid).map(|joint| (remap.joint(&joint.data), joint.parent)),
            Cow::Owned(rig) => rig.joints.remove(&uid).map(|joint| (remap.joint(&joint.data), joint.parent)),
        };
        let Some((mut data, above)) = found else { continue };
        let is_root = above.is_none();
        if let Some(label) = data.label.as_mut().filter(|label| labels.contains(*label)) {
            *label = format!("{prefix}_{label}");
            renamed += 1;
        }
        let above = match above {
            Some(above) => Some(remap.get(above).unwrap_or(above)),
            None => {
                data.rest = draft.rig().local_rest(parent, &data.rest.affine());
                parent
            }
        };
        if is_root {
            selected.push(data.uid);
        }
        draft.apply(RigEdit::AddJoint { joint: Box::new(data), parent: above, index: usize::MAX })?;
    }
    if moved > 0 {
        let name = &other.about().name;
        draft.note(format!(
            "{moved} things of {name} got new uids, because the rig has theirs, or some of them, already"
        ));
    }
    if renamed > 0 {
        let name = &other.about().name;
        draft.note(format!(
            "{renamed} joints of {name} are called {prefix}_..., because the rig has their labels already"
        ));
    }
    let mut names: HashSet<String> = draft.rig().clips().iter().map(|clip| clip.name.clone()).collect();
    for clip in other.clips() {
        let mut clip = clip.with_nodes(|node| remap.get(node).unwrap_or(node));
        for uid in std::iter::once(&mut clip.uid).chain(clip.layers.iter_mut().map(|layer| &mut layer.uid)) {
            if draft.rig().is_taken(*uid) {
                *uid = draft.next_uid();
            }
        }
        if names.contains(&clip.name) {
            clip.name = format!("{prefix}_{}", clip.name);
        }
        names.insert(clip.name.clone());
        draft.apply(RigEdit::AddClip(Box::new(clip), usize::MAX))?;
    }
    if !other.stored_poses().is_empty() {
        draft.note(format!("the stored poses of {} are left out", other.about().name));
    }
    draft.select(selected);
    Ok(())
}

/// Uids in a copy of a rig, by those of its groups, joints and tags.
fn moved_uids(rig: &Rig, copy: TemplateCopy) -> HashMap<Uid, Uid> {
    let groups = rig.groups().iter().map(|group| group.uid);
    let joints = rig.walk().flat_map(|joint| {
        std::iter::once(joint.data.uid).chain(joint.data.tags.iter().map(|tag| tag.uid)).collect::<Vec<_>>()
    });
    groups.chain(joints).map(|uid| (uid, copy.uid_of(uid))).collect()
}

/// Text that stands before the other rig's labels and names that the rig has already: the other rig's name, with a number where
/// one of them would not be free with the name alone.
fn prefix(rig: &Rig, other: &Rig) -> String {
    let kinds = [(labels(rig), labels(other)), (groups(rig), groups(other)), (clips(rig), clips(other))];
    let is_free = |prefix: &String| {
        kinds.iter().all(|(own, others)| {
            others
                .intersection(own)
                .map(|name| format!("{prefix}_{name}"))
                .all(|name| !own.contains(name.as_str()) && !others.contains(name.as_str()))
        })
    };
    let name = match other.about().name.as_str() {
        "" => "rig",
        name => name,
    };
    let numbered = (2..).map(|number| format!("{name}_{number}"));
    std::iter::once(name.to_owned()).chain(numbered).find(is_free).unwrap_or_default()
}

fn labels(rig: &Rig) -> HashSet<&str> {
    rig.walk().filter_map(|joint| joint.data.label.as_deref()).collect()
}

fn groups(rig: &Rig) -> HashSet<&str> {
    rig.groups().iter().map(|group| group.name.as_str()).collect()
}

fn clips(rig: &Rig) -> HashSet<&str> {
    rig.clips().iter().map(|clip| clip.name.as_str()).collect()
}

#[cfg(test)]
#[cfg(feature = "cli")]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::rig::{JointData, UidSource, operations::Operation};

    fn rig(number: u64, labels: [&str; 2]) -> Rig {
        let mut rig = Rig::new(Uid(number), "n");
        for (label, parent) in labels.into_iter().zip([None, Some(Uid(number + 1))]) {
            let uid = Uid(number + 1 + u64::from(parent.is_some()));
            let joint = Box::new(JointData { uid, label: Some(label.to_owned()), ..JointData::default() });
            rig.apply(&RigEdit::AddJoint { joint, parent, index: 0 }).unwrap();
        }
        rig
    }

    #[test]
    fn owned_rigs_are_merged_as_borrowed_ones() {
        let first = rig(10, ["a", "b"]);
        // With uids and labels of their own, with labels of the first, and with its uids.
        for other in [rig(20, ["c", "d"]), rig(30, ["b", "e"]), rig(10, ["a", "f"])] {
            let mut borrowed = first.clone();
            let merge = Operation::Merge { other: Arc::new(other.clone()), parent: Some(Uid(12)) };
            let outcome = merge.run(&mut borrowed, &mut UidSource::seeded(7), None).unwrap();
            let (owned, notes) =
                Operation::merge_owned(first.clone(), other, Some(Uid(12)), &mut UidSource::seeded(7)).unwrap();
            assert_eq!(owned, borrowed);
            assert_eq!(notes, outcome.notes);
            assert_eq!(owned.len(), 4);
        }
    }
}
