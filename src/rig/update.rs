//! Update of a rig to another version of its template, and differences of two rigs.
//!
//! An update compares three rigs: the *base*, which is the version that was accepted last, the rig as it is *now*, and the
//! template as it is in the *file*. What the file changed is taken, what a person changed or added stays, and where both
//! changed the same field to different values there is a conflict, which is decided by a choice and never by itself. Things
//! are matched by the copy of the template that they came with, and by their uids there; what seems to have got another name,
//! because it stands at the same place with the same content, keeps its uid. Clips are a person's: every update leaves them as
//! they are, with the keys of nodes that are gone.

mod change;
mod choices;
mod copies;
mod edits;
mod fields;
mod order;
mod parts;
mod rename_detection;
mod same_parts;
mod shown_values;
mod tags;

use std::{
    collections::{BTreeMap, HashMap, HashSet},
    sync::Arc,
};

use super::{
    GroupData, Rig, RigInput, RigJoint, StoredPose, TagData, Uid, document::circles, template_copy::TemplateCopy,
};
use copies::{PlacedCopy, is_host};
use fields::{Field, about_fields, group_fields, input_fields, joint_fields, joint_title, pose_fields};
use order::{all, merged_order};
use shown_values::{NamesOfBoth, shown_values};
use tags::{TagsByUid, set_tags};

pub use change::{Change, ChangeKind};
pub use choices::{Choices, Take};
pub use edits::{clip_edits, edits_between, pose_edits};
pub use parts::{FieldChange, MergedParts, RefittedTemplate, TemplateWithParts, merge_parts};
pub use same_parts::{moved_part, same_parts, with_whole_parts};

/// An update.
#[derive(Debug, Clone, PartialEq)]
pub struct Update {
    /// The rig after the update: with everything but its template's content as it is now.
    pub rig: Rig,
    /// Changes, header first, then groups, joints in the order of the file, and poses.
    pub changes: Vec<Change>,
    /// Uids of joints, groups and tags in the rig by their uids in the file: after a change of names, the rig's uid stays.
    pub identities: HashMap<Uid, Uid>,
}

impl Update {
    /// Number of conflicts.
    pub fn conflicts(&self) -> usize {
        self.changes.iter().filter(|change| change.conflict).count()
    }
}

/// A version of a rig with the uids that its things got when they were [renamed](Update::identities) in earlier versions. Where
/// a uid has come back with an old name, it is the thing's own.
pub fn with_identities(file: &Rig, identities: &HashMap<Uid, Uid>) -> Rig {
    let is_there = |uid: &Uid| file.is_taken(*uid);
    let uids = identities.iter().filter(|(from, to)| is_there(from) && !is_there(to)).map(|(from, to)| (*from, *to));
    rename_detection::with_uids(file, uids.collect())
}

/// Differences of two rigs, from the first to the second.
pub fn diff(from: &Rig, to: &Rig) -> Vec<Change> {
    update(Some(from), from, to, Take::Theirs).changes
}

/// The update of a rig `now` to the content of `file`. Without a `base` whatever differs is a conflict, and what the file
/// does not have stays.
pub fn update(base: Option<&Rig>, now: &Rig, file: &Rig, take: Take) -> Update {
    update_with(base, now, file, &take.into())
}

/// [`update`] with a choice for each conflict. A rig into which the template was merged or injected, however often, gets the
/// content in each of its copies, and keeps its own header.
pub fn update_with(base: Option<&Rig>, now: &Rig, file: &Rig, choices: &Choices) -> Update {
    let versions: Vec<&Rig> = base.into_iter().chain([file]).collect();
    let is_host = is_host(now, &versions);
    let mut updated: Option<Update> = None;
    let copies = TemplateCopy::all_in(now, &versions);
    for &copy in &copies {
        let others = copy.others(&copies, &versions);
        let rig = updated.as_ref().map_or(now, |updated| &updated.rig);
        let next = if copy.is_plain() && !is_host {
            update_copy(base, rig, file, (choices, &others))
        } else {
            let placed = PlacedCopy { copy, rig, versions: &versions };
            let base = base.map(|base| placed.place(base));
            update_copy(base.as_ref(), rig, &placed.place(file), (choices, &others))
        };
        updated = Some(match updated.take() {
            Some(mut before) => {
                before.changes.extend(next.changes);
                before.identities.extend(next.identities);
                Update { rig: next.rig, ..before }
            }
            None => next,
        });
    }
    updated.unwrap_or_else(|| Update { rig: now.clone(), changes: Vec::new(), identities: HashMap::new() })
}

/// The update of one copy, of which the base and the file have the uids. Nothing of the `others` is what has another name.
fn update_copy(base: Option<&Rig>, now: &Rig, file: &Rig, (choices, others): (&Choices, &HashSet<Uid>)) -> Update {
    let mut changes = Vec::new();
    // What was renamed by an earlier update has the name of the base here, and an older uid.
    let known = base.and_then(|base| rename_detection::renamed(now, base, others, &mut Vec::new()));
    let base = known.as_ref().map(|(known, _)| known).or(base);
    let renamed = rename_detection::renamed(base.unwrap_or(now), file, others, &mut changes);
    changes.retain(|change: &Change| change.from != change.to);
    let file = renamed.as_ref().map_or(file, |(renamed, _)| renamed);
    let told = changes.iter().map(|change| change.uid).collect();
    let mut merge = Merge {
        base,
        now,
        file,
        tags: [base, Some(now), Some(file)].map(TagsByUid::of),
        names: NamesOfBoth::new(now, file),
        choices,
        changes,
        rig: now.clone(),
        placed: HashSet::new(),
        renamed: told,
    };
    merge.header();
    merge.groups();
    merge.inputs();
    merge.joints();
    merge.poses();
    let Merge { rig, changes, .. } = merge;
    let identities = renamed.as_ref().map(|(_, uids)| uids.clone()).unwrap_or_default();
    Update { rig, changes, identities }
}

/// Outcome for a thing that two of three sides may have.
enum Fate<T> {
    Absent,
    Kept(T),
    Added(T),
    Removed,
}

struct Merge<'a> {
    base: Option<&'a Rig>,
    now: &'a Rig,
    file: &'a Rig,
    /// Tags of the base, of the rig and of the file.
    tags: [TagsByUid<'a>; 3],
    names: NamesOfBoth<'a>,
    choices: &'a Choices,
    changes: Vec<Change>,
    rig: Rig,
    /// Tags that have their joint.
    placed: HashSet<Uid>,
    /// Things that are told as renamed.
    renamed: HashSet<Uid>,
}

impl Merge<'_> {
    fn header(&mut self) {
        let uid = self.now.uid();
        let base = self.base.map(Rig::about);
        let named = ChangeSubject { uid, joint: None, tag: None, prefix: "" };
        self.rig.about = self.fields(&about_fields(), base, self.now.about(), self.file.about(), &named);
    }

    /// True if the file has a thing of another kind with that uid, which names one thing alone.
    fn is_other_kind(&self, uid: Uid, is_same_kind: bool) -> bool {
        !is_same_kind && self.file.is_taken(uid) && !self.file.clip_uids.contains(&uid)
    }

    fn groups(&mut self) {
        let (base, now, file) = (self.base, self.now, self.file);
        let lists = [base, Some(now), Some(file)].map(|rig| uids(rig.into_iter().flat_map(Rig::groups), |g| g.uid));
        let mut kept: BTreeMap<Uid, GroupData> = BTreeMap::new();
        for uid in all(&lists) {
            let prefix = now.group(uid).or(file.group(uid)).map_or_else(String::new, |g| format!("group {} ", g.name));
            let named = ChangeSubject { uid, joint: None, tag: None, prefix: &prefix };
            let sides = (base.and_then(|base| base.group(uid)), now.group(uid), file.group(uid));
            if let Fate::Kept(group) | Fate::Added(group) = self.fate(&group_fields(), sides, &named) {
                kept.insert(uid, group);
            }
        }
        // A group stays as long as a joint is in it.
        let used: HashSet<Uid> = now.walk().filter_map(|joint| joint.data.group).collect();
        for group in now.groups().iter().filter(|group| used.contains(&group.uid)) {
            kept.entry(group.uid).or_insert_with(|| group.clone());
        }
        kept.retain(|uid, _| !self.is_other_kind(*uid, file.group(*uid).is_some()));
        let order = merged_order(base.is_some().then_some(&lists[0]), &lists[1], &lists[2]);
        self.rig.groups = order.into_iter().filter_map(|uid| kept.remove(&uid)).collect();
    }

    fn inputs(&mut self) {
        let (base, now, file) = (self.base, self.now, self.file);
        let lists = [base, Some(now), Some(file)].map(|rig| uids(rig.into_iter().flat_map(Rig::inputs), |i| i.uid));
        let mut kept: BTreeMap<Uid, RigInput> = BTreeMap::new();
        for uid in all(&lists) {
            let input = now.input(uid).or(file.input(uid));
            let prefix = input.map_or_else(String::new, |input| format!("input {} ", input.name));
            let named = ChangeSubject { uid, joint: None, tag: None, prefix: &prefix };
            let sides = (base.and_then(|base| base.input(uid)), now.input(uid), file.input(uid));
            if let Fate::Kept(input) | Fate::Added(input) = self.fate(&input_fields(), sides, &named) {
                kept.insert(uid, input);
            }
        }
        let order = merged_order(base.is_some().then_some(&lists[0]), &lists[1], &lists[2]);
        kept.retain(|uid, _| !self.is_other_kind(*uid, file.input(*uid).is_some()));
        // Of two with one name the first one stays: only one entity can be given for it.
        let mut names = HashSet::new();
        let inputs = order.into_iter().filter_map(|uid| kept.remove(&uid));
        self.rig.inputs = inputs.filter(|input| names.insert(input.name.clone())).collect();
    }

    fn poses(&mut self) {
        let (base, now, file) = (self.base, self.now, self.file);
        let lists =
            [base, Some(now), Some(file)].map(|rig| uids(rig.into_iter().flat_map(Rig::stored_poses), |pose| pose.uid));
        let mut kept: BTreeMap<Uid, StoredPose> = BTreeMap::new();
        for uid in all(&lists) {
            let pose = now.stored_pose(uid).or(file.stored_pose(uid));
            let prefix = pose.map_or_else(String::new, |pose| format!("pose {} ", pose.name));
            let named = ChangeSubject { uid, joint: None, tag: None, prefix: &prefix };
            let sides = (base.and_then(|base| base.stored_pose(uid)), now.stored_pose(uid), file.stored_pose(uid));
            if let Fate::Kept(pose) | Fate::Added(pose) = self.fate(&pose_fields(), sides, &named) {
                kept.insert(uid, pose);
            }
        }
        kept.retain(|uid, _| !self.is_other_kind(*uid, file.stored_pose(*uid).is_some()));
        let order = merged_order(base.is_some().then_some(&lists[0]), &lists[1], &lists[2]);
        self.rig.poses = order.into_iter().filter_map(|uid| kept.remove(&uid)).collect();
    }

    fn joints(&mut self) {
        let (base, now, file) = (self.base, self.now, self.file);
        let walked = |rig: Option<&Rig>| uids(rig.into_iter().flat_map(Rig::walk), |joint| joint.data.uid);
        let lists = [walked(base), walked(Some(now)), walked(Some(file))];
        let groups: HashSet<Uid> = self.rig.groups.iter().map(|group| group.uid).collect();
        let mut joints: BTreeMap<Uid, Arc<RigJoint>> = BTreeMap::new();
        let mut removed = Vec::new();
        for uid in all(&lists) {
            let label = [now, file].into_iter().find_map(|rig| rig.joint(uid)?.data.label.clone());
            let title = label.unwrap_or_else(|| uid.to_string());
            let named = ChangeSubject { uid, joint: Some(&title), tag: None, prefix: "" };
            let was = base.and_then(|base| base.joints.get(&uid));
            let sides = (was, now.joints.get(&uid), file.joints.get(&uid));
            match self.fate(&joint_fields(now, file), sides, &named) {
                Fate::Absent => {}
                Fate::Removed => removed.push(uid),
                Fate::Added(mut joint) => {
                    // Tags that are on another joint now come from there, with what was changed of them.
                    let mut tags = Vec::with_capacity(joint.data.tags.len());
                    for tag in &joint.data.tags {
                        if now.tags.contains_key(&tag.uid) {
                            tags.extend(self.tag(uid, &title, tag.uid));
                        } else if self.placed.insert(tag.uid) {
                            tags.push(tag.clone());
                        }
                    }
                    set_tags(&mut joint, tags);
                    joints.insert(uid, joint);
                }
                Fate::Kept(mut joint) => {
                    set_tags(&mut joint, self.tags(uid, &title));
                    joints.insert(uid, joint);
                }
            }
        }
        // Whoever is removed stays as long as something of somebody else hangs on it.
        let mut needed: HashSet<Uid> = HashSet::new();
        for joint in joints.values() {
            let mut above = joint.parent;
            while let Some(uid) = above.filter(|uid| !joints.contains_key(uid) && needed.insert(*uid)) {
                above = now.joint(uid).and_then(|joint| joint.parent);
            }
        }
        let mut stays = HashSet::new();
        for uid in removed.into_iter().filter(|uid| needed.contains(uid)) {
            if let Some(mut joint) = now.joints.get(&uid).cloned() {
                let tags = joint.data.tags.iter().filter(|tag| self.placed.insert(tag.uid)).cloned().collect();
                set_tags(&mut joint, tags);
                joints.insert(uid, joint);
                stays.insert(uid);
            }
        }
        let is_removal = |change: &Change| change.kind == ChangeKind::Removed && !change.conflict;
        self.changes.retain(|change| !(is_removal(change) && stays.contains(&change.uid)));
        for joint in joints.values_mut() {
            if joint.data.group.is_some_and(|group| !groups.contains(&group)) {
                Arc::make_mut(joint).data.group = None;
            }
            if joint.parent == Some(joint.data.uid) {
                Arc::make_mut(joint).parent = None;
            }
        }
        joints.retain(|uid, _| !self.is_other_kind(*uid, file.joint(*uid).is_some()));
        let is_kept = |tag: &TagData| !self.is_other_kind(tag.uid, file.tags.contains_key(&tag.uid));
        for joint in joints.values_mut().filter(|joint| !joint.data.tags.iter().all(is_kept)) {
            Arc::make_mut(joint).data.tags.retain(is_kept);
        }
        self.untangle(&mut joints);
        self.rig.set_joints(joints, |parent| {
            let children = |rig: &Rig| rig.children(parent).to_vec();
            merged_order(base.map(children).as_ref(), &children(now), &children(file))
        });
        // What created nodes have stays: they may come back.
        for joint in now.walk().filter(|joint| !self.rig.joints.contains_key(&joint.data.uid)) {
            self.rig.pose.remove(&joint.data.uid);
        }
    }

    /// Parents that each side may have, and both together may not, because a joint would hang below itself: a conflict of
    /// every joint of the circle.
    fn untangle(&mut self, joints: &mut BTreeMap<Uid, Arc<RigJoint>>) {
        let (now, file) = (self.now, self.file);
        let of = |rig: &Rig, uid: Uid| rig.joint(uid).map(|joint| joint.parent);
        // One side's parents are no circle; those that people choose joint by joint may be.
        let mut is_chosen = true;
        loop {
            let parents = joints.iter().map(|(uid, joint)| (*uid, joint.parent)).collect();
            let circles: Vec<Uid> = circles(&parents).into_iter().flatten().collect();
            let mut is_changed = false;
            for uid in circles {
                let (Some(mine), Some(theirs), Some(joint)) = (of(now, uid), of(file, uid), joints.get_mut(&uid))
                else {
                    continue;
                };
                if mine == theirs {
                    continue;
                }
                self.parent_conflict(uid, mine, theirs);
                let take = if is_chosen { self.choices.of(uid, Some("parent")) } else { self.choices.take };
                let taken = if take == Take::Theirs { theirs } else { mine };
                if joint.parent != taken {
                    Arc::make_mut(joint).parent = taken;
                    is_changed = true;
                }
            }
            if !is_changed && !std::mem::take(&mut is_chosen) {
                return;
            }
        }
    }

    fn parent_conflict(&mut self, uid: Uid, mine: Option<Uid>, theirs: Option<Uid>) {
        let is_of_parent = |change: &&mut Change| change.uid == uid && change.field.as_deref() == Some("parent");
        if let Some(told) = self.changes.iter_mut().find(is_of_parent) {
            told.conflict = true;
            return;
        }
        let titles = [mine, theirs].map(|parent| parent.map(|uid| joint_title(self.now, self.file, uid)));
        let [from, to] = shown_values("parent", titles, &self.names);
        let label = self.now.joint(uid).and_then(|joint| joint.data.label.clone());
        let title = label.unwrap_or_else(|| uid.to_string());
        let named = ChangeSubject { uid, joint: Some(&title), tag: None, prefix: "" };
        let field = Some("parent".to_owned());
        self.changes.push(Change { field, from, to, conflict: true, ..named.change() });
    }

    /// Tags of a joint that stays.
    fn tags(&mut self, joint: Uid, title: &str) -> Vec<TagData> {
        let (base, now, file) = (self.base, self.now, self.file);
        let on = |rig: Option<&Rig>| -> Vec<Uid> {
            rig.and_then(|rig| rig.joint(joint)).map_or(Vec::new(), |joint| uids(&joint.data.tags, |tag| tag.uid))
        };
        let lists = [on(base), on(Some(now)), on(Some(file))];
        let mut kept: BTreeMap<Uid, TagData> = BTreeMap::new();
        for uid in all(&lists) {
            kept.extend(self.tag(joint, title, uid).map(|tag| (uid, tag)));
        }
        let order = merged_order(base.is_some().then_some(&lists[0]), &lists[1], &lists[2]);
        order.into_iter().filter_map(|uid| kept.remove(&uid)).collect()
    }

    /// Presence of a thing after the update, and its content.
    fn fate<T: Clone>(
        &mut self,
        fields: &[Field<T>],
        (base, now, file): (Option<&T>, Option<&T>, Option<&T>),
        named: &ChangeSubject,
    ) -> Fate<T> {
        let is_same = |field: &Field<T>, a: &T, b: &T| (field.text)(a) == (field.text)(b) || (field.is_close)(a, b);
        let same = |a: &T, b: &T| fields.iter().all(|field| is_same(field, a, b));
        match (now, file) {
            (None, None) => Fate::Absent,
            (Some(now), Some(file)) => Fate::Kept(self.fields(fields, base, now, file, named)),
            (None, Some(file)) => match base {
                None => {
                    self.whole(ChangeKind::Added, named, false);
                    Fate::Added(file.clone())
                }
                // Deleted by the person: it comes back only by choice, if the file changed it since.
                Some(base) if same(base, file) => Fate::Absent,
                Some(_) => {
                    self.whole(ChangeKind::Added, named, true);
                    if self.takes_theirs(named) { Fate::Added(file.clone()) } else { Fate::Absent }
                }
            },
            (Some(now), None) => match base {
                // Added by the person, or nobody knows.
                None => Fate::Kept(now.clone()),
                Some(base) if same(base, now) => {
                    self.whole(ChangeKind::Removed, named, false);
                    Fate::Removed
                }
                Some(_) => {
                    self.whole(ChangeKind::Removed, named, true);
                    if self.takes_theirs(named) { Fate::Removed } else { Fate::Kept(now.clone()) }
                }
            },
        }
    }

    fn fields<T: Clone>(
        &mut self,
        fields: &[Field<T>],
        base: Option<&T>,
        now: &T,
        file: &T,
        named: &ChangeSubject,
    ) -> T {
        let mut merged = now.clone();
        let is_renamed = self.renamed.contains(&named.uid);
        for field in fields.iter().filter(|field| field.is_own) {
            let (mine, theirs) = ((field.text)(now), (field.text)(file));
            let was = base.map(&field.text);
            if mine == theirs || was.as_ref() == Some(&theirs) {
                continue;
            }
            let is_close_to_base = |side: &T| base.is_some_and(|base| (field.is_close)(base, side));
            // Rounding is no change to tell of. It is taken along, so that the rig is bit by bit what the file says.
            if (field.is_close)(now, file) || is_close_to_base(file) {
                if was == Some(mine) {
                    (field.take)(&mut merged, file);
                }
                continue;
            }
            let conflict = was.as_ref() != Some(&mine) && !is_close_to_base(now);
            let name = format!("{}{}", named.prefix, field.name);
            let take = self.choices.of(named.uid, Some(&name));
            let [from, to] = shown_values(&field.name, [mine, theirs], &self.names);
            let told = Change { kind: ChangeKind::Changed, field: Some(name), from, to, conflict, ..named.change() };
            if conflict || !is_renamed || !matches!(field.name.as_str(), "label" | "name" | "switch") {
                self.changes.push(told);
            }
            if !conflict || take == Take::Theirs {
                (field.take)(&mut merged, file);
            }
        }
        merged
    }

    fn takes_theirs(&self, named: &ChangeSubject) -> bool {
        self.choices.of(named.uid, named.whole()) == Take::Theirs
    }

    fn whole(&mut self, kind: ChangeKind, named: &ChangeSubject, conflict: bool) {
        let field = named.whole().map(str::to_owned);
        self.changes.push(Change { kind, field, conflict, ..named.change() });
    }
}

/// Subject of the notes about changes.
struct ChangeSubject<'a> {
    uid: Uid,
    joint: Option<&'a str>,
    tag: Option<&'a str>,
    prefix: &'a str,
}

impl ChangeSubject<'_> {
    /// Field of a change of the whole thing.
    fn whole(&self) -> Option<&str> {
        Some(self.prefix.trim()).filter(|field| !field.is_empty())
    }

    fn change(&self) -> Change {
        Change {
            kind: ChangeKind::Changed,
            uid: self.uid,
            joint: self.joint.map(str::to_owned),
            tag: self.tag.map(str::to_owned),
            field: None,
            from: None,
            to: None,
            conflict: false,
        }
    }
}

fn uids<'a, T: 'a>(list: impl IntoIterator<Item = &'a T>, uid: impl Fn(&T) -> Uid) -> Vec<Uid> {
    list.into_iter().map(uid).collect()
}
