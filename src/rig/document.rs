//! The rig as one document: joints in a hierarchy, groups, tags and weights.

use std::{
    collections::{BTreeMap, BTreeSet, HashMap, HashSet},
    sync::Arc,
};

use bevy::{math::Affine3, prelude::*};

use crate::{
    mesh::model::Weights,
    rig::{
        AttributeValues, FaceCut, GroupData, PoseOffset, RestTransform, Revision, RigInput, RigJoint, SelectionSet,
        StoredPose, Uid,
        animation::RigClip,
        group_members::GroupMembers,
        label_index::LabelIndex,
        part::{DroppedPart, HeaderSocket, PartOption},
        rest_checkpoints::RestCheckpoints,
        tag_places::TagPlaces,
        touched_joints::TouchedJoints,
        uid_list::UidList,
    },
};

/// A rig (= global group). All data can be read; only [`Rig::apply`](crate::rig::edit) changes them.
///
/// Reflection names it and shows its text, and leaves its content to edits.
#[derive(Component, Reflect, Debug, Clone, PartialEq, Default)]
#[reflect(opaque)]
#[reflect(Component, Clone, PartialEq, Default)]
pub struct Rig {
    pub(super) uid: Uid,
    pub(super) about: RigAbout,
    pub(super) groups: UidList<GroupData>,
    pub(super) inputs: UidList<RigInput>,
    /// Copies of a rig share the joints that neither of them changes: reach for a joint with [`Arc::make_mut`].
    pub(super) joints: HashMap<Uid, Arc<RigJoint>>,
    pub(super) roots: Vec<Uid>,
    /// The joint of every tag, so that neither adding nor finding one needs a search.
    pub(super) tags: HashMap<Uid, Uid>,
    pub(super) skins: BTreeMap<Uid, Arc<SkinData>>,
    /// The current pose: offsets of joints and created nodes that are not at rest.
    pub(super) pose: BTreeMap<Uid, PoseOffset>,
    /// Attributes that have been set, by node and name; a node without any has no entry.
    pub(super) values: AttributeValues,
    pub(super) poses: UidList<StoredPose>,
    pub(super) clips: Vec<RigClip>,
    /// Uids of all clips and layers, so that a clip is added without a search among the others.
    pub(super) clip_uids: HashSet<Uid>,
    /// Parts that were dropped onto joints, and that the rig's file may not have yet.
    pub(super) dropped: Vec<DroppedPart>,
    pub(super) sets: Vec<SelectionSet>,
    /// Density and grouping of faces, by mesh.
    pub(super) face_cuts: BTreeMap<Uid, FaceCut>,
    /// Renewed by each edit of anything but pose, values, stored poses, clips, selection sets and cuts of faces.
    pub(super) revision: Revision,
    pub(super) checkpoints: RestCheckpoints,
    pub(super) label_index: LabelIndex,
    pub(super) group_members: GroupMembers,
    pub(super) tag_places: TagPlaces,
    pub(super) touched: TouchedJoints,
}

/// Header of a template, for people.
#[derive(Debug, Clone, PartialEq, Default, serde::Serialize, serde::Deserialize)]
pub struct RigAbout {
    /// The rig's name.
    pub name: String,
    /// Version of the template's content, chosen by its author.
    pub version: String,
    /// Kind of the rig, for example `character`, `part`, `prop`.
    pub kind: String,
    /// Author of the rig.
    pub author: String,
    /// Description in a few sentences.
    pub description: String,
    /// File name of a picture beside the template.
    pub preview: Option<String>,
    /// Places for parts of other templates, without the sockets of the rig's own parts.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub sockets: Vec<HeaderSocket>,
    /// Values that uses of the rig as a part may set.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub options: Vec<PartOption>,
}

/// Weights of one mesh over joints of the rig.
#[derive(Debug, Clone, PartialEq, Default, serde::Serialize, serde::Deserialize)]
pub struct SkinData {
    /// The joint for each joint index of the weights.
    pub joints: Vec<Uid>,
    /// Influences of every point of the mesh.
    pub weights: Weights,
    /// Space of the weights: `true` if they were computed for the mesh at rest; `false` if they came with the mesh file
    /// and belong to its points in the file's bind pose.
    pub at_rest: bool,
    /// Node that each joint of the weights was made for, where a command created the joint: it holds the share of a
    /// joint that is not built at the moment.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub subjects: BTreeMap<Uid, Uid>,
}

impl Rig {
    /// An empty rig.
    pub fn new(uid: Uid, name: impl Into<String>) -> Self {
        Self { uid, about: RigAbout { name: name.into(), ..default() }, ..default() }
    }

    /// Identity.
    pub fn uid(&self) -> Uid {
        self.uid
    }

    /// Mark of everything but pose, attribute values, stored poses, clips and selection sets.
    pub fn revision(&self) -> &Revision {
        &self.revision
    }

    /// Name, version, author and the like.
    pub fn about(&self) -> &RigAbout {
        &self.about
    }

    /// Local groups in order.
    pub fn groups(&self) -> &[GroupData] {
        &self.groups
    }

    /// The local group with that uid.
    pub fn group(&self, uid: Uid) -> Option<&GroupData> {
        self.groups.find(uid)
    }

    /// The first local group with that name.
    pub fn group_named(&self, name: &str) -> Option<&GroupData> {
        self.groups.named(name, |listed| self.checkpoints.count(listed))
    }

    /// Local groups of a set that the rig has, in its order.
    pub fn groups_in_order(&self, groups: &BTreeSet<Uid>) -> Vec<&GroupData> {
        let mut places: Vec<usize> = groups.iter().filter_map(|group| self.groups.place(*group)).collect();
        places.sort_unstable();
        places.into_iter().filter_map(|place| self.groups.get(place)).collect()
    }

    /// Declared inputs in order.
    pub fn inputs(&self) -> &[RigInput] {
        &self.inputs
    }

    /// The declared input with that uid.
    pub fn input(&self, uid: Uid) -> Option<&RigInput> {
        self.inputs.find(uid)
    }

    /// Parts that were dropped onto joints, in their order. Those whose tags are gone have no effect, and those that the rig's
    /// file has are in it.
    pub fn dropped_parts(&self) -> &[DroppedPart] {
        &self.dropped
    }

    /// Root joints in authored order.
    pub fn roots(&self) -> &[Uid] {
        &self.roots
    }

    /// The joint with that uid.
    pub fn joint(&self, uid: Uid) -> Option<&RigJoint> {
        self.joints.get(&uid).map(|joint| &**joint)
    }

    /// True if a joint carries a tag.
    pub fn has_tags(&self) -> bool {
        !self.tags.is_empty()
    }

    /// Disables tags of a scratch copy, in time linear in the tags of their joints. It is no edit: a document that people
    /// see is changed by [`RigEdit`](super::RigEdit)s alone.
    pub(crate) fn disable_tags(&mut self, tags: &HashSet<Uid>) {
        self.revision = Revision::default();
        let joints: HashSet<Uid> = tags.iter().filter_map(|tag| self.tags.get(tag).copied()).collect();
        for joint in joints {
            let Some(joint) = self.joints.get_mut(&joint) else { continue };
            let found = Arc::make_mut(joint).data.tags.iter_mut().filter(|tag| tags.contains(&tag.uid));
            found.for_each(|tag| tag.enabled = false);
        }
    }

    /// Returns `true` if a joint, group, tag, stored pose, clip, layer or input has that uid.
    pub fn is_taken(&self, uid: Uid) -> bool {
        self.joints.contains_key(&uid)
            || self.tags.contains_key(&uid)
            || self.groups.has(uid)
            || self.inputs.has(uid)
            || self.poses.has(uid)
            || self.clip_uids.contains(&uid)
    }

    /// The number of joints.
    pub fn len(&self) -> usize {
        self.joints.len()
    }

    /// Returns `true` without joints.
    pub fn is_empty(&self) -> bool {
        self.joints.is_empty()
    }

    /// Children of a joint, or the roots for `None`; empty for an unknown joint.
    pub fn children(&self, parent: Option<Uid>) -> &[Uid] {
        match parent {
            None => &self.roots,
            Some(uid) => self.joint(uid).map_or(&[], |joint| &joint.children),
        }
    }

    /// Joints of the rig, parents before children, siblings in authored order.
    pub fn walk(&self) -> impl Iterator<Item = &RigJoint> {
        self.walk_from(self.roots.iter().rev().copied().collect())
    }

    /// A joint and everything below it, parents first; nothing for an unknown joint.
    pub fn hierarchy(&self, top: Uid) -> impl Iterator<Item = &RigJoint> {
        self.walk_from(vec![top])
    }

    fn walk_from(&self, mut stack: Vec<Uid>) -> impl Iterator<Item = &RigJoint> {
        std::iter::from_fn(move || {
            loop {
                let joint = self.joint(stack.pop()?);
                if let Some(joint) = joint {
                    stack.extend(joint.children.iter().rev());
                    return Some(joint);
                }
            }
        })
    }

    /// Joints from the parent of `uid` up to its root.
    pub fn ancestors(&self, uid: Uid) -> impl Iterator<Item = &RigJoint> {
        let mut next = self.joint(uid).and_then(|joint| joint.parent);
        std::iter::from_fn(move || {
            let joint = self.joint(next?)?;
            next = joint.parent;
            Some(joint)
        })
    }

    /// The first joint with that label in the order of [`Rig::walk`].
    pub fn find_label(&self, label: &str) -> Option<Uid> {
        self.walk().find(|joint| joint.data.label.as_deref() == Some(label)).map(|joint| joint.data.uid)
    }

    /// The joint that [`Rig::find_label`] finds for each label: for many look-ups while the rig stays as it is.
    pub fn joints_by_label(&self) -> HashMap<&str, Uid> {
        let mut joints = HashMap::with_capacity(self.joints.len());
        for joint in self.walk() {
            if let Some(label) = joint.data.label.as_deref() {
                joints.entry(label).or_insert(joint.data.uid);
            }
        }
        joints
    }

    /// Position of a joint in the rig's space, at rest.
    pub fn position(&self, uid: Uid) -> Vec3 {
        self.rest_global(uid).translation
    }

    /// Rest transforms of all joints to the rig's space, in the order of [`Rig::walk`].
    pub fn rest_globals(&self) -> Vec<(Uid, Affine3)> {
        let mut known: HashMap<Uid, Affine3> = HashMap::with_capacity(self.joints.len());
        let mut list = Vec::with_capacity(self.joints.len());
        for joint in self.walk() {
            let parent = joint.parent.and_then(|parent| known.get(&parent)).copied().unwrap_or(Affine3::IDENTITY);
            let global = parent * joint.data.rest.affine();
            known.insert(joint.data.uid, global);
            list.push((joint.data.uid, global));
        }
        list
    }

    /// The rest transform that puts a joint at `global` (rig space) below `parent`. A parent that is flat in one
    /// direction has no inverse; then the transform is taken unchanged.
    pub fn local_rest(&self, parent: Option<Uid>, global: &Affine3) -> RestTransform {
        let parent = parent.map_or(Affine3::IDENTITY, |parent| self.rest_global(parent));
        if parent == Affine3::IDENTITY {
            return RestTransform::from_affine(global);
        }
        let local = parent.inverse() * *global;
        RestTransform::from_affine(if local.is_finite() { &local } else { global })
    }

    /// Replaces all joints: by uid those with their data and their parents, whatever their children. `order` gives the order
    /// of children of a joint, or of the roots; those that it does not name come last. A joint without its parent is a root,
    /// and of joints that stand below each other the first by uid becomes one. Joints whose place stays as it is in another
    /// rig stay shared with that.
    pub(super) fn set_joints(&mut self, joints: BTreeMap<Uid, Arc<RigJoint>>, order: impl Fn(Option<Uid>) -> Vec<Uid>) {
        let mut parents: BTreeMap<Uid, Option<Uid>> = joints
            .iter()
            .map(|(uid, joint)| (*uid, joint.parent.filter(|parent| joints.contains_key(parent))))
            .collect();
        for circle in circles(&parents) {
            parents.insert(circle[0], None);
        }
        let mut children: HashMap<Option<Uid>, Vec<Uid>> = HashMap::new();
        for (uid, parent) in &parents {
            children.entry(*parent).or_default().push(*uid);
        }
        for (parent, list) in &mut children {
            let places: HashMap<Uid, usize> = order(*parent).into_iter().zip(0..).collect();
            list.sort_by_key(|uid| places.get(uid).copied().unwrap_or(usize::MAX));
        }
        self.revision = Revision::default();
        self.checkpoints.clear();
        self.label_index.clear();
        self.group_members.clear();
        self.tags.clear();
        self.joints.clear();
        self.roots = children.remove(&None).unwrap_or_default();
        for (uid, mut joint) in joints {
            self.tags.extend(joint.data.tags.iter().map(|tag| (tag.uid, uid)));
            let below = children.remove(&Some(uid)).unwrap_or_default();
            let parent = parents.get(&uid).copied().flatten();
            if joint.parent != parent || joint.children != below {
                let own = Arc::make_mut(&mut joint);
                (own.parent, own.children) = (parent, below);
            }
            self.joints.insert(uid, joint);
        }
    }

    /// The weights of a bound mesh.
    pub fn skin(&self, mesh: Uid) -> Option<&Arc<SkinData>> {
        self.skins.get(&mesh)
    }

    /// Weights of all bound meshes, by the mesh's uid.
    pub fn skins(&self) -> impl Iterator<Item = (Uid, &Arc<SkinData>)> {
        self.skins.iter().map(|(mesh, skin)| (*mesh, skin))
    }
}

/// Circles of joints that hang below themselves, each as its joints from the first one found upwards.
pub(super) fn circles(parents: &BTreeMap<Uid, Option<Uid>>) -> Vec<Vec<Uid>> {
    let mut reached: HashSet<Uid> = HashSet::new();
    let mut circles = Vec::new();
    for start in parents.keys() {
        let mut path = Vec::new();
        let mut at = Some(*start);
        while let Some(uid) = at.filter(|uid| reached.insert(*uid)) {
            path.push(uid);
            at = parents.get(&uid).copied().flatten();
        }
        // Whoever ends on the way that it came has gone in a circle.
        if let Some(place) = at.and_then(|end| path.iter().position(|uid| *uid == end)) {
            circles.push(path.split_off(place));
        }
    }
    circles
}
