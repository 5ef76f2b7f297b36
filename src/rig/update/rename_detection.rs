//! Renamed joints, tags, groups and inputs: in a file that leaves uids out, another name is another uid.

use std::collections::{HashMap, HashSet};

use super::{Change, ChangeKind, fields::tag_title};
use crate::rig::{
    Rig, RigJoint, TagData, TagKind, Uid,
    feature::commands_of,
    reference::{map_text_fields, references_in},
    remap::Remap,
};

/// Length of a uid as it is written.
const UID_DIGITS: usize = 16;

/// The file with the uids of `base` for joints, tags, groups and inputs that are at the same place with the same content under
/// another name; `None` if there are none. Each is told as a change. Nothing of `others` is one of them.
pub(super) fn renamed(
    base: &Rig,
    file: &Rig,
    others: &HashSet<Uid>,
    changes: &mut Vec<Change>,
) -> Option<(Rig, HashMap<Uid, Uid>)> {
    let mut same: HashMap<Uid, Uid> = HashMap::new();
    let mut taken: HashSet<Uid> = HashSet::new();
    for joint in file.walk() {
        let uid = joint.data.uid;
        let known = match base.joint(uid) {
            Some(own) => own,
            None => {
                let parent = joint.parent.map(|parent| same.get(&parent).copied().unwrap_or(parent));
                let candidates = base.children(parent).iter().filter_map(|uid| base.joint(*uid)).filter(|old| {
                    let uid = &old.data.uid;
                    file.joint(*uid).is_none() && !taken.contains(uid) && !others.contains(uid) && alike(old, joint)
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
        tags((known, joint), (base, file), others, &mut same, changes);
    }
    groups(base, file, others, &mut same, changes);
    inputs(base, file, others, &mut same, changes);
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

/// Pairs the tags that only one of the two has: those of a renamed joint by their order, others if they are the same but for the
/// name (module and parameters of commands, kind and commands of features), or else but for uids.
fn tags(
    (old, new): (&RigJoint, &RigJoint),
    (base, file): (&Rig, &Rig),
    others: &HashSet<Uid>,
    same: &mut HashMap<Uid, Uid>,
    changes: &mut Vec<Change>,
) {
    let is_gone = |tag: &&TagData| file.find_tag(tag.uid).is_none() && !others.contains(&tag.uid);
    let gone: Vec<&TagData> = old.data.tags.iter().filter(is_gone).collect();
    let come: Vec<&TagData> = new.data.tags.iter().filter(|tag| base.find_tag(tag.uid).is_none()).collect();
    let is_renamed_joint = old.data.uid != new.data.uid;
    let mut free: Vec<bool> = vec![true; gone.len()];
    // Commands first, by which features are told apart.
    let (commands, features): (Vec<&TagData>, Vec<&TagData>) =
        come.into_iter().partition(|tag| matches!(tag.kind, TagKind::Command { .. }));
    for tag in commands.into_iter().chain(features) {
        let is_same = |old: &TagData| match (&old.kind, &tag.kind) {
            (TagKind::Feature { .. }, TagKind::Feature { .. }) => is_same_feature((base, old), (file, tag), same),
            _ => is_same_but_name(old, tag),
        };
        let is_of_kind = |old: &TagData| {
            std::mem::discriminant(&old.kind) == std::mem::discriminant(&tag.kind) && module(old) == module(tag)
        };
        let places_of = |fits: &dyn Fn(&TagData) -> bool| -> Vec<usize> {
            (0..gone.len()).filter(|place| free[*place] && is_of_kind(gone[*place]) && fits(gone[*place])).collect()
        };
        let mut places = places_of(&|old: &TagData| is_renamed_joint || is_same(old));
        if !is_renamed_joint && places.len() != 1 {
            // What a part brings has other uids where its instance has another name, and so has what that refers to.
            places = places_of(&|old: &TagData| is_same_but_uids(old, tag));
        }
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

/// Returns `true` if two tags say the same under the same names, whatever the uids of themselves and of what they refer to.
fn is_same_but_uids(a: &TagData, b: &TagData) -> bool {
    let is_same = match (&a.kind, &b.kind) {
        (TagKind::Command { params: a, .. }, TagKind::Command { params: b, .. }) => without_uids(a) == without_uids(b),
        (a, b) => a == b,
    };
    a.enabled == b.enabled && is_same
}

/// Parameters without the uids that stand beside names.
fn without_uids(params: &str) -> String {
    let mut pieces = params.split('#');
    let mut out = pieces.next().unwrap_or_default().to_owned();
    for piece in pieces {
        let is_uid = piece.get(..UID_DIGITS).is_some_and(|digits| digits.parse::<Uid>().is_ok());
        out.push('#');
        out.push_str(if is_uid { &piece[UID_DIGITS..] } else { piece });
    }
    out
}

/// Returns `true` if two features of one kind turn the same commands on and off, or none, and differ in the name or the switch
/// alone.
fn is_same_feature((base, old): (&Rig, &TagData), (file, new): (&Rig, &TagData), same: &HashMap<Uid, Uid>) -> bool {
    let (
        TagKind::Feature { name: old_name, switch: old_switch, choice: old_choice, .. },
        TagKind::Feature { name, switch, choice, .. },
    ) = (&old.kind, &new.kind)
    else {
        return false;
    };
    let is_alike = old.enabled == new.enabled && old_choice == choice && (old_name == name || old_switch == switch);
    let of_old: HashSet<Uid> = commands_of(base, old.uid).map(|(_, command)| command.uid).collect();
    let mut of_new = commands_of(file, new.uid).map(|(_, command)| same.get(&command.uid).unwrap_or(&command.uid));
    let first = of_new.next();
    is_alike
        && if of_old.is_empty() {
            first.is_none()
        } else {
            first.into_iter().chain(of_new).any(|uid| of_old.contains(uid))
        }
}

/// Pairs the groups that only one of the two has, if the same joints are in them.
fn groups(base: &Rig, file: &Rig, others: &HashSet<Uid>, same: &mut HashMap<Uid, Uid>, changes: &mut Vec<Change>) {
    let members = |rig: &Rig, group: Uid| -> HashSet<Uid> {
        let joints = rig.walk().filter(|joint| joint.data.group == Some(group));
        joints.map(|joint| joint.data.uid).collect()
    };
    let mut gone: Vec<_> = base.groups().iter().filter(|old| file.group(old.uid).is_none()).collect();
    gone.retain(|old| !others.contains(&old.uid));
    for new in file.groups().iter().filter(|new| base.group(new.uid).is_none()) {
        let here: HashSet<Uid> =
            members(file, new.uid).into_iter().map(|joint| same.get(&joint).copied().unwrap_or(joint)).collect();
        let is_same = |place: &usize| {
            let there = members(base, gone[*place].uid);
            let is_color = here.is_empty() && there.is_empty() && gone[*place].color == new.color;
            is_color || !here.is_disjoint(&there)
        };
        let places: Vec<usize> = (0..gone.len()).filter(is_same).collect();
        let [place] = places[..] else { continue };
        let old = gone.remove(place);
        same.insert(new.uid, old.uid);
        changes.push(named_change(old.uid, "group", &old.name, &new.name));
    }
}

/// Pairs the inputs that only one of the two has, if they stand at the same place and the same commands refer to them.
fn inputs(base: &Rig, file: &Rig, others: &HashSet<Uid>, same: &mut HashMap<Uid, Uid>, changes: &mut Vec<Change>) {
    let mut gone: Vec<_> = base.inputs().iter().filter(|old| file.input(old.uid).is_none()).collect();
    gone.retain(|old| !others.contains(&old.uid));
    for new in file.inputs().iter().filter(|new| base.input(new.uid).is_none()) {
        let here: HashSet<Uid> =
            users(file, new.uid).into_iter().map(|tag| same.get(&tag).copied().unwrap_or(tag)).collect();
        let is_same = |place: &usize| {
            let there = users(base, gone[*place].uid);
            gone[*place].rest == new.rest && (here.is_empty() && there.is_empty() || !here.is_disjoint(&there))
        };
        let places: Vec<usize> = (0..gone.len()).filter(is_same).collect();
        let [place] = places[..] else { continue };
        let old = gone.remove(place);
        same.insert(new.uid, old.uid);
        changes.push(named_change(old.uid, "input", &old.name, &new.name));
    }
}

/// Commands that refer to something.
fn users(rig: &Rig, uid: Uid) -> HashSet<Uid> {
    let refers = |params: &str| {
        let mut references = references_in(params).filter_map(|found| found.references.ok()).flat_map(|list| list.0);
        references.any(|reference| reference.uids().any(|(_, other)| other == uid))
    };
    let tags = rig.walk().flat_map(|joint| &joint.data.tags);
    let users = tags.filter(|tag| matches!(&tag.kind, TagKind::Command { params, .. } if refers(params)));
    users.map(|tag| tag.uid).collect()
}

/// Another name of a group or an input.
fn named_change(uid: Uid, what: &str, from: &str, to: &str) -> Change {
    let [from, to] = [from, to].map(|name| Some(name.to_owned()));
    let field = from.as_ref().map(|name| format!("{what} {name}"));
    Change { joint: None, field, ..change(uid, &from, &to) }
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

/// A rig with other uids of joints, tags, groups and inputs, in references, too.
pub(super) fn with_uids(rig: &Rig, uids: HashMap<Uid, Uid>) -> Rig {
    let before: HashMap<Uid, Uid> = uids.iter().map(|(from, to)| (*to, *from)).collect();
    let remap = Remap { uids, ..Remap::default() };
    let get = |uid: Uid| remap.get(uid).unwrap_or(uid);
    let joints = rig.walk().map(|joint| (get(joint.data.uid), (remap.joint(&joint.data), joint.parent.map(get))));
    let mut out = rig.clone();
    out.groups.change_each(|group| group.uid = get(group.uid));
    out.inputs.change_each(|input| input.uid = get(input.uid));
    out.about.sockets.iter_mut().for_each(|socket| socket.joint = get(socket.joint));
    out.clips = rig.clips().iter().map(|clip| clip.with_nodes(get)).collect();
    out.clip_uids.clone_from(&rig.clip_uids);
    out.set_joints(joints.collect(), |parent| {
        let own = parent.map(|parent| before.get(&parent).copied().unwrap_or(parent));
        rig.children(own).iter().map(|child| get(*child)).collect()
    });
    out
}
