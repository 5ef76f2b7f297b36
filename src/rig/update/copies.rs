//! Versions of a template as they stand in a rig that has copies of it.

use std::{
    collections::{BTreeMap, HashMap, HashSet},
    sync::Arc,
};

use crate::rig::{
    GroupData, JointData, Rig, RigInput, RigJoint, TagKind, Uid,
    reference::{RigNameIndex, refresh_names},
    remap::Remap,
    template_copy::TemplateCopy,
};

/// Returns `true` for a rig of its own, into which the template came: its header, and where its joints hang, are not the
/// template's.
pub(super) fn is_host(rig: &Rig, versions: &[&Rig]) -> bool {
    let is_foreign = |joint: &Uid| versions.iter().all(|version| version.joint(*joint).is_none());
    versions.iter().all(|version| version.uid() != rig.uid()) && rig.roots().first().is_some_and(is_foreign)
}

/// A copy of a template in a rig, and the versions of the template.
pub(super) struct PlacedCopy<'a> {
    pub copy: TemplateCopy,
    pub rig: &'a Rig,
    pub versions: &'a [&'a Rig],
}

impl PlacedCopy<'_> {
    /// Version of the template with the uids, names and places that its joints and tags have in this copy, below the joints
    /// of the host. Everything else is as in the host's rig, so that a comparison finds changes of the copy alone.
    pub fn place(&self, version: &Rig) -> Rig {
        let mut out = Rig::new(self.rig.uid(), "");
        out.about = self.rig.about().clone();
        let remap = self.remap(version);
        let mut placed = PlacedJoints::default();
        if self.brings_joints() {
            let names = self.names();
            self.merged(version, &remap, &names, &mut placed);
            let here = |group: &GroupData| {
                let uid = self.copy.uid_of(group.uid);
                let own = self.rig.group(uid).map(|own| own.name.as_str());
                GroupData { uid, name: names.here(&group.name, own, &names.groups), ..group.clone() }
            };
            out.groups = version.groups().iter().map(here).collect();
        } else {
            self.injected(version, &remap, &mut placed);
        }
        let uid = |input: &RigInput| remap.get(input.uid).unwrap_or(input.uid);
        out.inputs = version.inputs().iter().map(|input| RigInput { uid: uid(input), ..input.clone() }).collect();
        let PlacedJoints { joints, children } = placed;
        out.set_joints(joints, |parent| children.get(&parent).cloned().unwrap_or_default());
        out
    }

    /// Returns `true` for a copy with joints of its own, `false` for one of tags alone.
    fn brings_joints(&self) -> bool {
        let mut joints = self.versions.iter().flat_map(|version| version.walk());
        joints.any(|joint| self.rig.joint(self.copy.uid_of(joint.data.uid)).is_some())
    }

    fn remap(&self, version: &Rig) -> Remap {
        let mut uids: HashMap<Uid, Uid> = HashMap::new();
        let groups = version.groups().iter().map(|group| group.uid);
        for uid in groups.chain(version.joints.keys().copied()).chain(version.tags.keys().copied()) {
            uids.insert(uid, self.copy.uid_of(uid));
        }
        for input in version.inputs() {
            // Inputs of one name are one.
            let own = self.rig.inputs().iter().find(|own| own.name == input.name);
            uids.insert(input.uid, own.map_or_else(|| self.copy.uid_of(input.uid), |own| own.uid));
        }
        Remap { uids, ..Remap::default() }
    }

    fn names(&self) -> NamesHere<'_> {
        let labels = self.rig.walk().filter_map(|joint| joint.data.label.as_deref()).collect();
        let groups = self.rig.groups().iter().map(|group| group.name.as_str()).collect();
        let joints = self.versions.iter().flat_map(|version| version.walk().map(move |joint| (*version, joint)));
        let mut known = joints.filter_map(|(version, joint)| {
            let here = self.rig.joint(self.copy.uid_of(joint.data.uid))?.data.label.as_deref()?;
            let prefix = here.strip_suffix(joint.data.label.as_deref()?)?;
            let of_name = prefix.strip_prefix(version.about().name.as_str())?;
            let is_numbered = of_name.chars().all(|c| c == '_' || c.is_ascii_digit());
            (is_numbered && of_name.ends_with('_')).then(|| prefix.to_owned())
        });
        let name = || self.versions.first().map_or_else(String::new, |version| format!("{}_", version.about().name));
        let prefix = known.next().unwrap_or_else(name);
        NamesHere { prefix, labels, groups }
    }

    /// Places the joints of a copy that has come with them.
    fn merged(&self, version: &Rig, remap: &Remap, names: &NamesHere, placed: &mut PlacedJoints) {
        let index = RigNameIndex::new(self.rig);
        let here = |uid: Uid| self.copy.uid_of(uid);
        let known = self.versions.iter().flat_map(|version| version.walk());
        let own: HashSet<Uid> = known.map(|joint| here(joint.data.uid)).collect();
        let mut roots = self.versions.iter().flat_map(|version| version.roots());
        let usual = roots.find_map(|root| self.rig.joint(here(*root))).and_then(|root| root.parent);
        for joint in version.walk() {
            let mut data = remap.joint(&joint.data);
            let called = self.rig.joint(data.uid).and_then(|joint| joint.data.label.as_deref());
            data.label = data.label.take().map(|label| names.here(&label, called, &names.labels));
            for tag in &mut data.tags {
                if let TagKind::Command { params, .. } = &mut tag.kind {
                    *params = refresh_names(params, &index).into_owned();
                }
            }
            let parent = match joint.parent {
                Some(parent) => Some(here(parent)),
                None => {
                    let parent = self.rig.joint(data.uid).map_or(usual, |root| root.parent);
                    if parent.is_none_or(|parent| !own.contains(&parent)) {
                        data.rest = self.rig.local_rest(parent, &data.rest.affine());
                        placed.add_above(self.rig, parent);
                    }
                    parent
                }
            };
            placed.add(data, parent);
        }
    }

    /// Places the tags of a copy of tags on the joints that carry them.
    fn injected(&self, version: &Rig, remap: &Remap, placed: &mut PlacedJoints) {
        let mut remap = remap.clone();
        let mut bearers = Vec::new();
        for joint in version.walk() {
            let joints = self.versions.iter().filter_map(|version| version.joint(joint.data.uid));
            let mut tags = joints.flat_map(|joint| &joint.data.tags);
            let bearer = tags.find_map(|tag| self.rig.find_tag(self.copy.uid_of(tag.uid))).map(|(bearer, _)| bearer);
            if let Some(bearer) = bearer {
                remap.uids.insert(joint.data.uid, bearer.data.uid);
                bearers.push((joint, bearer));
            }
        }
        let index = RigNameIndex::new(self.rig);
        for (joint, bearer) in bearers {
            let mut tags = remap.joint(&joint.data).tags;
            for tag in &mut tags {
                if let TagKind::Command { params, .. } = &mut tag.kind {
                    *params = refresh_names(params, &index).into_owned();
                }
            }
            placed.add_above(self.rig, bearer.parent);
            placed.add(JointData { tags, ..bearer.data.clone() }, bearer.parent);
        }
    }
}

/// Names of a copy in its rig.
struct NamesHere<'a> {
    /// Text before names that are taken.
    prefix: String,
    labels: HashSet<&'a str>,
    groups: HashSet<&'a str>,
}

impl NamesHere<'_> {
    /// Name in the rig of a thing that is called `own` there: with the prefix if something else has the name.
    fn here(&self, name: &str, own: Option<&str>, taken: &HashSet<&str>) -> String {
        if own != Some(name) && taken.contains(name) { format!("{}{name}", self.prefix) } else { name.to_owned() }
    }
}

/// Joints of a placed version.
#[derive(Default)]
struct PlacedJoints {
    joints: BTreeMap<Uid, Arc<RigJoint>>,
    children: HashMap<Option<Uid>, Vec<Uid>>,
}

impl PlacedJoints {
    /// Adds a joint of the version. It takes the place of one that is there as what another one hangs on.
    fn add(&mut self, data: JointData, parent: Option<Uid>) {
        let uid = data.uid;
        if self.joints.insert(uid, Arc::new(RigJoint { data, parent, children: Vec::new() })).is_none() {
            self.children.entry(parent).or_default().push(uid);
        }
    }

    /// Adds a joint of the rig and those above it, as they are there.
    fn add_above(&mut self, rig: &Rig, joint: Option<Uid>) {
        let mut next = joint;
        while let Some(above) =
            next.and_then(|uid| rig.joint(uid)).filter(|above| !self.joints.contains_key(&above.data.uid))
        {
            self.add(above.data.clone(), above.parent);
            next = above.parent;
        }
    }
}
