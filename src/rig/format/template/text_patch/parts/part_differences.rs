//! Parts of a template about which a text does not say what is in a rig.

use std::collections::{BTreeMap, BTreeSet, HashSet};

use super::{super::said_with_parts, own_joints::things_of};
use crate::rig::{JointData, Rig, TagData, Uid, part::PartInstance};

/// Numbers of the part instances that bring something which is otherwise in a rig than in another one, or not there, and of those
/// that hang on their sockets. `own` is what the template has besides its parts.
pub(crate) fn differing_parts(said: &Rig, rig: &Rig, own: &Rig, parts: &[(PartInstance, Rig)]) -> Vec<usize> {
    let (Some(said), Some(rig)) = (said_with_parts(said, own), said_with_parts(rig, own)) else { return Vec::new() };
    let mut of: BTreeMap<Uid, BTreeSet<usize>> = BTreeMap::new();
    for (number, (instance, part)) in parts.iter().enumerate() {
        for uid in things_of(instance, part) {
            of.entry(uid).or_default().insert(number);
        }
    }
    let mut found: BTreeSet<usize> = BTreeSet::new();
    for (uid, numbers) in &of {
        let differs = joint(&said, *uid) != joint(&rig, *uid)
            || tag(&said, *uid) != tag(&rig, *uid)
            || said.group(*uid) != rig.group(*uid)
            || said.input(*uid) != rig.input(*uid);
        if differs {
            found.extend(numbers);
        }
    }
    if found.is_empty() {
        // Tags in another order.
        for joint in rig.walk().filter(|joint| tags(&said, joint.data.uid) != tags(&rig, joint.data.uid)) {
            found.extend(joint.data.tags.iter().filter_map(|tag| of.get(&tag.uid)).flatten());
        }
    }
    let titles: HashSet<&str> = found.iter().map(|number| parts[*number].0.title()).collect();
    let hangs_on_one = |instance: &PartInstance| {
        let of_part = instance.socket.as_deref().and_then(|socket| socket.rsplit_once('.'));
        of_part.is_some_and(|(title, _)| titles.contains(title))
    };
    let hanging = (0..parts.len()).filter(|number| hangs_on_one(&parts[*number].0));
    let hanging: Vec<usize> = hanging.collect();
    found.into_iter().chain(hanging).collect()
}

/// A joint without its tags and children, with its parent.
fn joint(rig: &Rig, uid: Uid) -> Option<(JointData, Option<Uid>)> {
    let joint = rig.joint(uid)?;
    Some((JointData { tags: Vec::new(), ..joint.data.clone() }, joint.parent))
}

/// A tag with its joint.
fn tag(rig: &Rig, uid: Uid) -> Option<(Uid, &TagData)> {
    rig.find_tag(uid).map(|(joint, tag)| (joint.data.uid, tag))
}

/// Uids of the tags of a joint in their order.
fn tags(rig: &Rig, joint: Uid) -> Vec<Uid> {
    rig.joint(joint).into_iter().flat_map(|joint| &joint.data.tags).map(|tag| tag.uid).collect()
}
