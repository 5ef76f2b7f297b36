//! Renamed joints and tags: in a file that leaves uids out, another name is another uid.

use std::collections::{HashMap, HashSet};

use super::{Change, ChangeKind, fields::tag_title};
use crate::rig::{Rig, RigJoint, TagData, TagKind, Uid, reference::map_text_fields, remap::Remap};

/// The file with the uids of `base` for joints and tags that are at the same place with the same content under another name;
/// `None` if there are none. Each is told as a change.
pub(super) fn renamed(base: &Rig, file: &Rig, changes: &mut Vec<Change>) -> Option<(Rig, HashMap<Uid, Uid>)> {
    let mut same: HashMap<Uid, Uid> = HashMap::new();
    let mut taken: HashSet<Uid> = HashSet::new();
    for joint in file.walk() {
        let uid = joint.data.uid;
        let known = match base.joint(uid) {
            Some(own) => own,
            None => {
                let parent = joint.parent.map(|parent| same.get(&parent).copied().unwrap_or(parent));
                let candidates = base.children(parent).iter().filter_map(|uid| base.joint(*uid)).filter(|old| {
                    file.joint(old.data.uid).is_none() && !taken.contains(&old.data.uid) && alike(old, joint)
                });
                let found: Vec<&RigJoint> = candidates.collect();
                // Two that could be it are none.
                let [old] = found[..] else { continue };
                changes.push(change(old.data.uid, &old.data.label, &joint.data.label));
                same.insert(uid, old.data.uid);
                taken.insert(old.data.uid);
                old
            }
        };
        tags(known, joint, base, file, &mut same, changes);
    }
    (!same.is_empty()).then(|| (with_uids(file, same.clone()), same))
}

/// Returns `true` if two joints have the same place and tags, whatever their names.
fn alike(old: &RigJoint, new: &RigJoint) -> bool {
    let (old, new) = (&old.data, &new.data);
    let modules = |tags: &[TagData]| tags.iter().map(module).map(str::to_owned).collect::<Vec<_>>();
    old.rest == new.rest && old.kind == new.kind && modules(&old.tags) == modules(&new.tags)
}

fn module(tag: &TagData) -> &str {
    match &tag.kind {
        TagKind::Command { module, .. } => module,
        TagKind::Feature { kind, .. } => kind,
    }
}

/// Pairs the tags that only one of the two has: those of a renamed joint by their order, others if module and parameters are
/// the same but for the name.
fn tags(
    old: &RigJoint,
    new: &RigJoint,
    base: &Rig,
    file: &Rig,
    same: &mut HashMap<Uid, Uid>,
    changes: &mut Vec<Change>,
) {
    let gone: Vec<&TagData> = old.data.tags.iter().filter(|tag| file.find_tag(tag.uid).is_none()).collect();
    let come: Vec<&TagData> = new.data.tags.iter().filter(|tag| base.find_tag(tag.uid).is_none()).collect();
    let is_renamed_joint = old.data.uid != new.data.uid;
    let mut free: Vec<bool> = vec![true; gone.len()];
    for tag in come {
        let fits = |old: &TagData| module(old) == module(tag) && (is_renamed_joint || is_same_but_name(old, tag));
        let places: Vec<usize> = (0..gone.len()).filter(|place| free[*place] && fits(gone[*place])).collect();
        let place = match places[..] {
            [place] => place,
            [place, ..] if is_renamed_joint => place,
            _ => continue,
        };
        free[place] = false;
        same.insert(tag.uid, gone[place].uid);
        if !is_renamed_joint {
            let (from, to) = (Some(tag_title(gone[place])), Some(tag_title(tag)));
            let mut told = change(gone[place].uid, &from, &to);
            told.joint = Some(new.data.label.clone().unwrap_or_else(|| new.data.uid.to_string()));
            told.tag = from;
            changes.push(told);
        }
    }
}

/// Returns `true` if two commands have the same parameters but for the names that they give.
fn is_same_but_name(a: &TagData, b: &TagData) -> bool {
    let plain = |tag: &TagData| match &tag.kind {
        TagKind::Command { params, .. } => Some(map_text_fields(params, &["name", "label"], |_| Some(String::new()))),
        TagKind::Feature { .. } => None,
    };
    a.enabled == b.enabled && plain(a).is_some() && plain(a) == plain(b)
}

fn change(uid: Uid, from: &Option<String>, to: &Option<String>) -> Change {
    Change {
        kind: ChangeKind::Renamed,
        uid,
        joint: from.clone(),
        tag: None,
        field: Some("label".to_owned()),
        from: from.clone(),
        to: to.clone(),
        conflict: false,
    }
}

/// A rig with other uids of joints and tags, in references, too.
pub(super) fn with_uids(rig: &Rig, uids: HashMap<Uid, Uid>) -> Rig {
    let before: HashMap<Uid, Uid> = uids.iter().map(|(from, to)| (*to, *from)).collect();
    let remap = Remap { uids, ..Remap::default() };
    let get = |uid: Uid| remap.get(uid).unwrap_or(uid);
    let joints = rig.walk().map(|joint| (get(joint.data.uid), (remap.joint(&joint.data), joint.parent.map(get))));
    let mut out = rig.clone();
    out.about.sockets.iter_mut().for_each(|socket| socket.joint = get(socket.joint));
    out.clips = rig.clips().iter().map(|clip| clip.with_nodes(get)).collect();
    out.set_joints(joints.collect(), |parent| {
        let own = parent.map(|parent| before.get(&parent).copied().unwrap_or(parent));
        rig.children(own).iter().map(|child| get(*child)).collect()
    });
    out
}
