//! Edits that make one rig of another.

use std::collections::{BTreeSet, HashMap, HashSet};

use crate::rig::{
    EditError, Rig, RigEdit, RigJoint, Uid,
    animation::{Key, RigClip, Track, TrackTarget},
};

/// The edits after which the current pose and the attribute values of `from` are those of `to`.
pub fn pose_edits(from: &Rig, to: &Rig) -> Vec<RigEdit> {
    let nodes: BTreeSet<Uid> = from.pose().keys().chain(to.pose().keys()).copied().collect();
    let is_other = |node: &Uid| from.offset(*node) != to.offset(*node);
    let offsets = nodes.into_iter().filter(is_other).map(|node| RigEdit::SetOffset(node, to.offset(node).copied()));
    let mut edits: Vec<RigEdit> = offsets.collect();
    let [was, is] = [from, to].map(Rig::attribute_values);
    for node in was.keys().chain(is.keys().filter(|node| !was.contains_key(*node))) {
        let [was, is] = [was, is].map(|values| values.get(node));
        let names: BTreeSet<&String> = was.into_iter().chain(is).flat_map(|values| values.keys()).collect();
        for name in names {
            let [was, is] = [was, is].map(|values| values.and_then(|values| values.get(name)).copied());
            if was != is {
                edits.push(RigEdit::SetAttributeValue(*node, name.clone(), is));
            }
        }
    }
    edits
}

/// The edits after which the clips of `from` are those of `to`; keys that both have are not touched.
///
/// # Errors
/// [`EditError`] of an edit that is refused: one of the two has values that no rig can have.
pub fn clip_edits(from: &Rig, to: &Rig) -> Result<Vec<RigEdit>, EditError> {
    let mut steps = Steps { rig: from.clone(), edits: Vec::new() };
    let layers = |clip: &RigClip| clip.layers.iter().map(|layer| layer.uid).collect::<Vec<_>>();
    for clip in from.clips() {
        // Clips with other layers are exchanged as a whole.
        if to.clip(clip.uid).is_none_or(|other| layers(other) != layers(clip)) {
            steps.apply(RigEdit::RemoveClip(clip.uid))?;
        }
    }
    for (index, clip) in to.clips().iter().enumerate() {
        let known = steps.rig.clips().iter().position(|own| own.uid == clip.uid);
        if known.is_some_and(|place| place != index) {
            steps.apply(RigEdit::RemoveClip(clip.uid))?;
        }
        match steps.rig.clip(clip.uid).cloned() {
            Some(own) => steps.clip(&own, clip)?,
            None => steps.apply(RigEdit::AddClip(Box::new(clip.clone()), index))?,
        }
    }
    Ok(steps.edits)
}

/// The edit after which a track has the keys of another one; `None` if it has.
fn key_edit(clip: Uid, layer: Uid, target: &TrackTarget, now: Option<&Track>, then: Option<&Track>) -> Option<RigEdit> {
    let [now, then] = [now, then].map(|track| track.map_or(&[] as &[Key], |track| &track.keys));
    let has = |keys: &[Key], key: &Key| {
        keys.binary_search_by(|known| known.time.total_cmp(&key.time)).is_ok_and(|place| keys[place] == *key)
    };
    let removed: Vec<f32> = now.iter().filter(|key| !has(then, key)).map(|key| key.time).collect();
    let inserted: Vec<Key> = then.iter().filter(|key| !has(now, key)).copied().collect();
    let is_other = !removed.is_empty() || !inserted.is_empty();
    is_other.then(|| RigEdit::SetKeys { clip, layer, target: target.clone(), removed, inserted })
}

/// The edits after which `from` has the content of `to`: header, groups, inputs, joints, tags and stored poses, each list in
/// its order there. Weights, the current pose, attribute values, clips, selection sets, cuts of faces and the record of
/// dropped parts stay; what is stored of joints that go, goes with them. What is the same in both is not touched, except
/// that the joints of a group that moves are out of it meanwhile. A uid of things of two kinds, such as a joint in `from` and a
/// group in `to`, is a removal and an addition.
///
/// # Errors
/// [`EditError`] of an edit that is refused: one of the two has values that no rig can have.
pub fn edits_between(from: &Rig, to: &Rig) -> Result<Vec<RigEdit>, EditError> {
    let mut steps = Steps { rig: from.clone(), edits: Vec::new() };
    if from.about() != to.about() {
        steps.apply(RigEdit::SetAbout(Box::new(to.about().clone())))?;
    }
    steps.other_kinds(to)?;
    steps.groups(to)?;
    if steps.rig.inputs() != to.inputs() {
        steps.apply(RigEdit::SetInputs(to.inputs().to_vec()))?;
    }
    steps.leaving_tags(to)?;
    steps.joints(to)?;
    steps.tags(to)?;
    steps.leaving(to)?;
    steps.poses(to)?;
    Ok(steps.edits)
}

/// Edits so far, and the rig after them.
struct Steps {
    rig: Rig,
    edits: Vec<RigEdit>,
}

impl Steps {
    fn apply(&mut self, edit: RigEdit) -> Result<(), EditError> {
        self.rig.apply(&edit)?;
        self.edits.push(edit);
        Ok(())
    }

    /// Headers and keys of a clip with the same layers.
    fn clip(&mut self, own: &RigClip, clip: &RigClip) -> Result<(), EditError> {
        if own.about() != clip.about() {
            self.apply(RigEdit::SetClipAbout(clip.uid, Box::new(clip.about())))?;
        }
        for (now, then) in own.layers.iter().zip(&clip.layers) {
            let (clip, layer) = (clip.uid, then.uid);
            if now.about() != then.about() {
                self.apply(RigEdit::SetLayer { clip, layer, about: Box::new(then.about()) })?;
            }
            let targets: BTreeSet<&TrackTarget> = now.tracks.keys().chain(then.tracks.keys()).collect();
            for target in targets {
                let tracks = [now, then].map(|layer| layer.tracks.get(target).map(|track| &**track));
                if let Some(edit) = key_edit(clip, layer, target, tracks[0], tracks[1]) {
                    self.apply(edit)?;
                }
            }
        }
        Ok(())
    }

    /// Takes away what has the uid of a thing of another kind in `to`. Joints below such a joint are roots meanwhile.
    fn other_kinds(&mut self, to: &Rig) -> Result<(), EditError> {
        let is_other = |uid: Uid, is_same_kind: bool| !is_same_kind && to.is_taken(uid);
        let all = self.rig.walk().flat_map(|joint| joint.data.tags.iter().map(|tag| (joint.data.uid, tag.uid)));
        let tags: Vec<(Uid, Uid)> = all.filter(|(_, tag)| is_other(*tag, to.tags.contains_key(tag))).collect();
        tags.into_iter().try_for_each(|(joint, tag)| self.apply(RigEdit::RemoveTag(joint, tag)))?;
        let all = self.rig.walk().map(|joint| joint.data.uid);
        let joints: Vec<Uid> = all.filter(|joint| is_other(*joint, to.joint(*joint).is_some())).collect();
        for uid in joints.into_iter().rev() {
            for joint in self.rig.children(Some(uid)).to_vec().into_iter().rev() {
                self.apply(RigEdit::SetParent { joint, parent: None, index: usize::MAX })?;
            }
            self.apply(RigEdit::RemoveJoint(uid))?;
        }
        let all = self.rig.groups().iter().map(|group| group.uid);
        let groups: HashSet<Uid> = all.filter(|group| is_other(*group, to.group(*group).is_some())).collect();
        if !groups.is_empty() {
            let is_in_one = |joint: &&RigJoint| joint.data.group.is_some_and(|group| groups.contains(&group));
            let members: Vec<Uid> = self.rig.walk().filter(is_in_one).map(|joint| joint.data.uid).collect();
            members.into_iter().try_for_each(|joint| self.apply(RigEdit::SetGroup(joint, None)))?;
            let listed: Vec<Uid> = self.rig.groups().iter().map(|group| group.uid).collect();
            for uid in listed.into_iter().rev().filter(|uid| groups.contains(uid)) {
                self.apply(RigEdit::RemoveLocalGroup(uid))?;
            }
        }
        let all = self.rig.stored_poses().iter().map(|pose| pose.uid);
        let poses: Vec<Uid> = all.filter(|pose| is_other(*pose, to.stored_pose(*pose).is_some())).collect();
        poses.into_iter().try_for_each(|pose| self.apply(RigEdit::RemoveStoredPose(pose)))?;
        let mut inputs = self.rig.inputs().to_vec();
        inputs.retain(|input| !is_other(input.uid, to.input(input.uid).is_some()));
        if inputs.len() < self.rig.inputs().len() { self.apply(RigEdit::SetInputs(inputs)) } else { Ok(()) }
    }

    fn groups(&mut self, to: &Rig) -> Result<(), EditError> {
        self.empty_moving_groups(to)?;
        // Groups that leave are still between the others: one that comes or moves goes behind the one that it follows.
        let mut next = 0;
        for group in to.groups() {
            match self.rig.groups.place(group.uid) {
                None => self.apply(RigEdit::AddLocalGroup(group.clone(), next))?,
                Some(place) => {
                    if place < next {
                        self.move_group(group.uid, next - 1)?;
                    }
                    if self.rig.group(group.uid) != Some(group) {
                        self.apply(RigEdit::SetLocalGroup(group.clone()))?;
                    }
                }
            }
            next = self.rig.groups.place(group.uid).map_or(next, |place| place + 1);
        }
        Ok(())
    }

    /// Takes the joints out of the groups that stand behind others in `to` than now: only a group without joints can be
    /// moved. The joints come back with their other fields.
    fn empty_moving_groups(&mut self, to: &Rig) -> Result<(), EditError> {
        let (mut last, mut moving) = (0, HashSet::new());
        for group in to.groups() {
            match self.rig.groups.place(group.uid) {
                Some(place) if place < last => {
                    moving.insert(group.uid);
                }
                Some(place) => last = place,
                None => {}
            }
        }
        let in_moving = |joint: &&RigJoint| joint.data.group.is_some_and(|group| moving.contains(&group));
        let joints: Vec<Uid> = self.rig.walk().filter(in_moving).map(|joint| joint.data.uid).collect();
        joints.into_iter().try_for_each(|joint| self.apply(RigEdit::SetGroup(joint, None)))
    }

    /// Moves a group without joints to a place among the others.
    fn move_group(&mut self, uid: Uid, place: usize) -> Result<(), EditError> {
        let group = self.rig.group(uid).cloned().ok_or(EditError::NoGroup(uid))?;
        self.apply(RigEdit::RemoveLocalGroup(uid))?;
        self.apply(RigEdit::AddLocalGroup(group, place))
    }

    /// Takes away the tags that are gone.
    fn leaving_tags(&mut self, to: &Rig) -> Result<(), EditError> {
        let all = self.rig.walk().flat_map(|joint| joint.data.tags.iter().map(|tag| (joint.data.uid, tag.uid)));
        let leaving: Vec<_> = all.filter(|(_, tag)| !to.tags.contains_key(tag)).collect();
        leaving.into_iter().try_for_each(|(joint, tag)| self.apply(RigEdit::RemoveTag(joint, tag)))
    }

    /// Puts every joint in its place, parents first, and gives it its fields.
    fn joints(&mut self, to: &Rig) -> Result<(), EditError> {
        let mut places: HashMap<Uid, usize> = HashMap::new();
        for joint in to.walk() {
            for (place, child) in joint.children.iter().enumerate() {
                places.insert(*child, place);
            }
        }
        places.extend(to.roots().iter().copied().zip(0..));
        for joint in to.walk() {
            let (uid, parent) = (joint.data.uid, joint.parent);
            let index = places.get(&uid).copied().unwrap_or(usize::MAX);
            let Some(own) = self.rig.joint(uid) else {
                // Tags that come from other joints move there.
                let mut joint = Box::new(joint.data.clone());
                joint.tags.retain(|tag| !self.rig.tags.contains_key(&tag.uid));
                self.apply(RigEdit::AddJoint { joint, parent, index })?;
                continue;
            };
            let is_there = own.parent == parent && self.rig.children(parent).get(index) == Some(&uid);
            let own = own.clone();
            if !is_there {
                self.apply(RigEdit::SetParent { joint: uid, parent, index })?;
            }
            self.fields(&own, joint)?;
        }
        Ok(())
    }

    fn fields(&mut self, own: &RigJoint, joint: &RigJoint) -> Result<(), EditError> {
        let (uid, own, data) = (joint.data.uid, &own.data, &joint.data);
        if own.label != data.label {
            self.apply(RigEdit::SetLabel(uid, data.label.clone()))?;
        }
        if own.group != data.group {
            self.apply(RigEdit::SetGroup(uid, data.group))?;
        }
        if own.mirror != data.mirror {
            self.apply(RigEdit::SetMirror(uid, data.mirror))?;
        }
        if own.locked != data.locked {
            self.apply(RigEdit::SetLocked(uid, data.locked))?;
        }
        if own.rest != data.rest {
            self.apply(RigEdit::SetRest(uid, data.rest))?;
        }
        if own.kind != data.kind {
            self.apply(RigEdit::SetKind(uid, data.kind))?;
        }
        if own.face != data.face {
            self.apply(RigEdit::SetFace(uid, data.face.clone().map(Box::new)))?;
        }
        Ok(())
    }

    fn tags(&mut self, to: &Rig) -> Result<(), EditError> {
        for joint in to.walk() {
            let uid = joint.data.uid;
            for (index, tag) in joint.data.tags.iter().enumerate() {
                let Some((bearer, own)) = self.rig.find_tag(tag.uid) else {
                    self.apply(RigEdit::AddTag { joint: uid, tag: Box::new(tag.clone()), index })?;
                    continue;
                };
                let is_there =
                    bearer.data.uid == uid && bearer.data.tags.get(index).is_some_and(|at| at.uid == tag.uid);
                let is_same = own == tag;
                if !is_there {
                    self.apply(RigEdit::MoveTag { tag: tag.uid, joint: uid, index })?;
                }
                if !is_same {
                    self.apply(RigEdit::SetTag(uid, Box::new(tag.clone())))?;
                }
            }
        }
        Ok(())
    }

    /// Takes away joints, lowest first, and then groups.
    fn leaving(&mut self, to: &Rig) -> Result<(), EditError> {
        let mut joints: Vec<Uid> = self.rig.walk().map(|joint| joint.data.uid).collect();
        joints.retain(|uid| to.joint(*uid).is_none());
        joints.iter().rev().try_for_each(|uid| self.apply(RigEdit::RemoveJoint(*uid)))?;
        let groups: Vec<Uid> = self.rig.groups().iter().map(|group| group.uid).collect();
        let leaving = groups.into_iter().filter(|uid| to.group(*uid).is_none());
        leaving.collect::<Vec<_>>().into_iter().try_for_each(|uid| self.apply(RigEdit::RemoveLocalGroup(uid)))
    }

    fn poses(&mut self, to: &Rig) -> Result<(), EditError> {
        let own: Vec<Uid> = self.rig.stored_poses().iter().map(|pose| pose.uid).collect();
        for uid in own.into_iter().filter(|uid| to.stored_pose(*uid).is_none()) {
            self.apply(RigEdit::RemoveStoredPose(uid))?;
        }
        for (index, pose) in to.stored_poses().iter().enumerate() {
            let place = self.rig.poses.place(pose.uid);
            let is_same = self.rig.stored_pose(pose.uid) == Some(pose);
            match place {
                Some(place) if place == index && is_same => {}
                Some(place) if place == index => self.apply(RigEdit::SetStoredPose(Box::new(pose.clone())))?,
                Some(_) => {
                    self.apply(RigEdit::RemoveStoredPose(pose.uid))?;
                    self.apply(RigEdit::AddStoredPose(Box::new(pose.clone()), index))?;
                }
                None => self.apply(RigEdit::AddStoredPose(Box::new(pose.clone()), index))?,
            }
        }
        Ok(())
    }
}
