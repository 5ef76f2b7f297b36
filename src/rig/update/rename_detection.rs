//! Renamed joints, tags, groups and inputs: in a file that leaves uids out, another name is another uid.
//!
//! What is gone is known by all that its counterpart has in common with it, so that time grows with the number of things that
//! are renamed, not with that of their pairs.

use std::{
    collections::{BTreeSet, HashMap, HashSet},
    sync::Arc,
};

use super::{Change, ChangeKind, fields::tag_title};
use crate::rig::{
    GroupData, JointData, NodeKind, RestTransform, Rig, RigInput, RigJoint, TagData, TagKind, Uid,
    reference::{map_text_fields, references_in},
    remap::Remap,
};

/// Length of a uid as it is written.
const UID_DIGITS: usize = 16;

/// Two versions of a rig.
struct Versions<'a> {
    base: &'a Rig,
    file: &'a Rig,
    /// Uids that are no counterpart of anything.
    others: &'a HashSet<Uid>,
    /// Commands of each feature tag of the base and of the file.
    commands: [HashMap<Uid, Vec<Uid>>; 2],
}

/// The file with the uids of `base` for joints, tags, groups and inputs that are at the same place with the same content under
/// another name; `None` if there are none. Each is told as a change. Nothing of `others` is one of them.
pub(super) fn renamed(
    base: &Rig,
    file: &Rig,
    others: &HashSet<Uid>,
    changes: &mut Vec<Change>,
) -> Option<(Rig, HashMap<Uid, Uid>)> {
    let versions = Versions { base, file, others, commands: [base, file].map(commands_by_feature) };
    let mut same: HashMap<Uid, Uid> = HashMap::new();
    let mut unpaired: HashMap<Option<Uid>, HashMap<JointLikeness, Vec<Uid>>> = HashMap::new();
    for joint in file.walk() {
        let uid = joint.data.uid;
        let known = match base.joint(uid) {
            Some(own) => own,
            None => {
                let parent = joint.parent.map(|parent| same.get(&parent).copied().unwrap_or(parent));
                let below = unpaired.entry(parent).or_insert_with(|| versions.gone_below(parent));
                let likeness = joint_likeness(&joint.data);
                // Two that could be it are none.
                let Some(&[old]) = below.get(&likeness).map(Vec::as_slice) else { continue };
                below.remove(&likeness);
                let Some(old) = base.joint(old) else { continue };
                changes.push(change(old.data.uid, &old.data.label, &joint.data.label));
                same.insert(uid, old.data.uid);
                old
            }
        };
        tags((known, joint), &versions, &mut same, changes);
    }
    groups(&versions, &mut same, changes);
    inputs(&versions, &mut same, changes);
    (!same.is_empty()).then(|| (with_uids(file, same.clone()), same))
}

/// Place, kind and modules of a joint, whatever its name.
type JointLikeness = ([u32; 10], bool, Vec<String>);

fn joint_likeness(joint: &JointData) -> JointLikeness {
    let modules = joint.tags.iter().map(|tag| module(tag).to_owned()).collect();
    (place_bits(&joint.rest), joint.kind == NodeKind::Null, modules)
}

/// Bits of a transform; those of equal transforms are equal.
fn place_bits(rest: &RestTransform) -> [u32; 10] {
    let ([a, b, c], [d, e, f, g]) = (rest.translation.to_array(), rest.rotation.to_array());
    let [h, i, j] = rest.scale.to_array();
    [a, b, c, d, e, f, g, h, i, j].map(bits)
}

/// Bits of a number. Both zeros are the same one.
fn bits(number: f32) -> u32 {
    (number + 0.0).to_bits()
}

impl Versions<'_> {
    /// Joints below a joint of the base, or roots of it, that are not in the file.
    fn gone_below(&self, parent: Option<Uid>) -> HashMap<JointLikeness, Vec<Uid>> {
        let mut gone: HashMap<JointLikeness, Vec<Uid>> = HashMap::new();
        for old in self.base.children(parent).iter().filter_map(|uid| self.base.joint(*uid)) {
            let uid = old.data.uid;
            if self.file.joint(uid).is_none() && !self.others.contains(&uid) {
                gone.entry(joint_likeness(&old.data)).or_default().push(uid);
            }
        }
        gone
    }
}

/// The only element of a list; `None` if there are more, or none.
fn only<T>(mut list: impl Iterator<Item = T>) -> Option<T> {
    let first = list.next()?;
    list.next().is_none().then_some(first)
}

fn module(tag: &TagData) -> &str {
    match &tag.kind {
        TagKind::Command { module, .. } => module,
        TagKind::Feature { kind, .. } => kind,
    }
}

fn is_command(tag: &TagData) -> bool {
    matches!(tag.kind, TagKind::Command { .. })
}

/// Content that two tags have in common which may be one.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
enum Likeness<'a> {
    /// Commands (`true`) of a module, or features of a kind.
    Kind(bool, &'a str),
    /// Commands with the same parameters but for the names that they give.
    ButName(&'a str, bool, String),
    /// Tags that say the same under the same names, whatever the uids of themselves and of what they refer to.
    ButUids(bool, &'a str, bool, String),
}

impl<'a> Likeness<'a> {
    fn kind(tag: &'a TagData) -> Self {
        Self::Kind(is_command(tag), module(tag))
    }

    fn but_name(tag: &'a TagData) -> Option<Self> {
        let TagKind::Command { module, params, .. } = &tag.kind else { return None };
        let plain = map_text_fields(params, &["name", "label"], |_| Some(String::new()));
        Some(Self::ButName(module, tag.enabled, plain))
    }

    fn but_uids(tag: &'a TagData) -> Self {
        let text = match &tag.kind {
            TagKind::Command { params, .. } => without_uids(params),
            TagKind::Feature { name, switch, choice, .. } => format!("{:?}", (name, switch, choice)),
        };
        Self::ButUids(is_command(tag), module(tag), tag.enabled, text)
    }

    fn all(tag: &'a TagData) -> impl Iterator<Item = Self> {
        [Some(Self::kind(tag)), Self::but_name(tag), Some(Self::but_uids(tag))].into_iter().flatten()
    }
}

/// Tags of a joint that are not in the file, by their likenesses, as long as they have no counterpart.
struct RemovedTags<'a> {
    tags: Vec<&'a TagData>,
    places: HashMap<Likeness<'a>, BTreeSet<usize>>,
}

impl<'a> RemovedTags<'a> {
    fn new(tags: Vec<&'a TagData>) -> Self {
        let mut places: HashMap<Likeness<'a>, BTreeSet<usize>> = HashMap::new();
        for (place, tag) in tags.iter().copied().enumerate() {
            for likeness in Likeness::all(tag) {
                places.entry(likeness).or_default().insert(place);
            }
        }
        Self { tags, places }
    }

    /// Places of the tags with a likeness, in order.
    fn alike(&self, likeness: Likeness<'a>) -> impl Iterator<Item = usize> {
        self.places.get(&likeness).into_iter().flatten().copied()
    }

    /// Takes a tag that has its counterpart.
    fn take(&mut self, place: usize) -> &'a TagData {
        let tag = self.tags[place];
        for likeness in Likeness::all(tag) {
            if let Some(places) = self.places.get_mut(&likeness) {
                places.remove(&place);
            }
        }
        tag
    }
}

/// Pairs the tags that only one of the two has: those of a renamed joint by their order, others if they are the same but for the
/// name (module and parameters of commands, kind and commands of features), or else but for uids.
fn tags<'a>(
    (old, new): (&'a RigJoint, &'a RigJoint),
    versions: &Versions<'a>,
    same: &mut HashMap<Uid, Uid>,
    changes: &mut Vec<Change>,
) {
    let Versions { base, file, others, commands: [of_base, of_file] } = versions;
    let is_gone = |tag: &&TagData| !file.tags.contains_key(&tag.uid) && !others.contains(&tag.uid);
    let come: Vec<&TagData> = new.data.tags.iter().filter(|tag| !base.tags.contains_key(&tag.uid)).collect();
    if come.is_empty() {
        return;
    }
    let mut gone = RemovedTags::new(old.data.tags.iter().filter(is_gone).collect());
    let is_renamed_joint = old.data.uid != new.data.uid;
    // Commands first, by which features are told apart.
    let (first, features): (Vec<&TagData>, Vec<&TagData>) = come.into_iter().partition(|tag| is_command(tag));
    for tag in first.into_iter().chain(features) {
        let place = if is_renamed_joint {
            gone.alike(Likeness::kind(tag)).next()
        } else {
            let found = match Likeness::but_name(tag) {
                Some(likeness) => only(gone.alike(likeness)),
                None => only(gone.alike(Likeness::kind(tag)).filter(|place| {
                    let old = gone.tags[*place];
                    let [of_old, of_new] = [(of_base, old), (of_file, tag)]
                        .map(|(of, tag)| of.get(&tag.uid).map(Vec::as_slice).unwrap_or_default());
                    is_same_feature((old, of_old), (tag, of_new), same)
                })),
            };
            // What a part brings has other uids where its instance has another name, and so has what that refers to.
            found.or_else(|| only(gone.alike(Likeness::but_uids(tag))))
        };
        let Some(place) = place else { continue };
        let was = gone.take(place);
        same.insert(tag.uid, was.uid);
        if !is_renamed_joint {
            let (from, to) = (Some(tag_title(was)), Some(tag_title(tag)));
            let mut told = change(was.uid, &from, &to);
            told.joint = Some(new.data.label.clone().unwrap_or_else(|| new.data.uid.to_string()));
            told.tag = from;
            changes.push(told);
        }
    }
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

/// Commands of each feature tag of a rig.
fn commands_by_feature(rig: &Rig) -> HashMap<Uid, Vec<Uid>> {
    let mut commands: HashMap<Uid, Vec<Uid>> = HashMap::new();
    for tag in rig.walk().flat_map(|joint| &joint.data.tags) {
        if let TagKind::Command { feature: Some(feature), .. } = tag.kind {
            commands.entry(feature).or_default().push(tag.uid);
        }
    }
    commands
}

/// Returns `true` if two features of one kind turn the same commands on and off, or none, and differ in the name or the switch
/// alone. Each comes with its commands.
fn is_same_feature(
    (old, of_old): (&TagData, &[Uid]),
    (new, of_new): (&TagData, &[Uid]),
    same: &HashMap<Uid, Uid>,
) -> bool {
    let (
        TagKind::Feature { name: old_name, switch: old_switch, choice: old_choice, .. },
        TagKind::Feature { name, switch, choice, .. },
    ) = (&old.kind, &new.kind)
    else {
        return false;
    };
    let is_alike = old.enabled == new.enabled && old_choice == choice && (old_name == name || old_switch == switch);
    if !is_alike || of_old.is_empty() {
        return is_alike && of_new.is_empty();
    }
    let of_old: HashSet<Uid> = of_old.iter().copied().collect();
    of_new.iter().any(|command| of_old.contains(same.get(command).unwrap_or(command)))
}

/// Pairs the groups that only one of the two has, if the same joints are in them.
fn groups(versions: &Versions, same: &mut HashMap<Uid, Uid>, changes: &mut Vec<Change>) {
    let Versions { base, file, others, .. } = versions;
    let is_gone = |old: &&GroupData| file.group(old.uid).is_none() && !others.contains(&old.uid);
    let mut gone: HashMap<Uid, &GroupData> = base.groups().iter().filter(is_gone).map(|old| (old.uid, old)).collect();
    let used: HashSet<Uid> = base.walk().filter_map(|joint| joint.data.group).collect();
    let color = |group: &GroupData| group.color.map(bits);
    let mut unused: HashMap<[u32; 3], BTreeSet<Uid>> = HashMap::new();
    for old in gone.values().filter(|old| !used.contains(&old.uid)) {
        unused.entry(color(old)).or_default().insert(old.uid);
    }
    let mut members: HashMap<Uid, Vec<Uid>> = HashMap::new();
    for joint in file.walk() {
        if let Some(group) = joint.data.group {
            let uid = joint.data.uid;
            members.entry(group).or_default().push(same.get(&uid).copied().unwrap_or(uid));
        }
    }
    for new in file.groups().iter().filter(|new| base.group(new.uid).is_none()) {
        let found = match members.get(&new.uid) {
            None => unused.get(&color(new)).and_then(|places| only(places.iter().copied())),
            Some(here) => {
                let there = here.iter().filter_map(|joint| base.joint(*joint)?.data.group);
                only(there.filter(|group| gone.contains_key(group)).collect::<BTreeSet<Uid>>().into_iter())
            }
        };
        let Some(old) = found.and_then(|uid| gone.remove(&uid)) else { continue };
        if let Some(places) = unused.get_mut(&color(old)) {
            places.remove(&old.uid);
        }
        same.insert(new.uid, old.uid);
        changes.push(named_change(old.uid, "group", &old.name, &new.name));
    }
}

/// Pairs the inputs that only one of the two has, if they stand at the same place and the same commands refer to them.
fn inputs(versions: &Versions, same: &mut HashMap<Uid, Uid>, changes: &mut Vec<Change>) {
    let Versions { base, file, others, .. } = versions;
    let is_gone = |old: &&RigInput| file.input(old.uid).is_none() && !others.contains(&old.uid);
    let mut gone: HashMap<Uid, &RigInput> = base.inputs().iter().filter(is_gone).map(|old| (old.uid, old)).collect();
    if gone.is_empty() {
        return;
    }
    let [of_base, of_file] = [*base, *file].map(users_by_input);
    let mut unused: HashMap<[u32; 10], BTreeSet<Uid>> = HashMap::new();
    // Inputs that each command refers to.
    let mut used: HashMap<Uid, Vec<Uid>> = HashMap::new();
    for old in gone.values() {
        match of_base.get(&old.uid) {
            None => {
                unused.entry(place_bits(&old.rest)).or_default().insert(old.uid);
            }
            Some(users) => users.iter().for_each(|user| used.entry(*user).or_default().push(old.uid)),
        }
    }
    for new in file.inputs().iter().filter(|new| base.input(new.uid).is_none()) {
        let found = match of_file.get(&new.uid) {
            None => unused.get(&place_bits(&new.rest)).and_then(|places| only(places.iter().copied())),
            Some(here) => {
                let here = here.iter().map(|user| same.get(user).unwrap_or(user));
                let there = here.filter_map(|user| used.get(user)).flatten().copied();
                let fits = |uid: &Uid| gone.get(uid).is_some_and(|old| old.rest == new.rest);
                only(there.filter(fits).collect::<BTreeSet<Uid>>().into_iter())
            }
        };
        let Some(old) = found.and_then(|uid| gone.remove(&uid)) else { continue };
        if let Some(places) = unused.get_mut(&place_bits(&old.rest)) {
            places.remove(&old.uid);
        }
        same.insert(new.uid, old.uid);
        changes.push(named_change(old.uid, "input", &old.name, &new.name));
    }
}

/// Commands that refer to each input of a rig.
fn users_by_input(rig: &Rig) -> HashMap<Uid, BTreeSet<Uid>> {
    let mut users: HashMap<Uid, BTreeSet<Uid>> = HashMap::new();
    for tag in rig.walk().flat_map(|joint| &joint.data.tags) {
        let TagKind::Command { params, .. } = &tag.kind else { continue };
        let references = references_in(params).filter_map(|found| found.references.ok()).flat_map(|list| list.0);
        for (_, uid) in references.flat_map(|reference| reference.uids().collect::<Vec<_>>()) {
            if rig.input(uid).is_some() {
                users.entry(uid).or_default().insert(tag.uid);
            }
        }
    }
    users
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
    let joints = rig.walk().map(|joint| {
        let (data, parent) = (remap.joint(&joint.data), joint.parent.map(get));
        (get(joint.data.uid), Arc::new(RigJoint { data, parent, children: Vec::new() }))
    });
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
