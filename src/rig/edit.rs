//! Edits: the only way to change a rig, each with an exact inverse.
//!
//! [`Rig::apply`] either changes the rig and returns the edit that takes the change back, or changes nothing and
//! returns the reason. Larger changes (placing, mirroring, deleting a joint but keeping its children) are lists of
//! edits.

mod clips;
mod effect;
mod groups;
mod header;
mod inputs;
mod moves;
mod poses;
mod skin_weights;
mod skins;
mod tag_params;
mod tags;
mod weight_patch;

use std::{collections::HashSet, sync::Arc};

use serde::{Deserialize, Serialize};

use self::tag_params::checked;
pub use self::{
    header::HeaderFault,
    weight_patch::{PatchFault, WeightPatch, joint_numbers, weight_edit},
};
use crate::rig::{
    FaceCut, FacePlacement, GroupData, JointData, NodeKind, PoseOffset, RestTransform, Rig, RigInput, RigJoint,
    SelectionSet, StoredPose, TagData, Uid,
    animation::{ClipAbout, ClipFault, ClipLayer, Key, KeyFault, LayerAbout, RigClip, TrackTarget},
    document::{RigAbout, SkinData},
    part::DroppedPart,
};

/// A change of a rig.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum RigEdit {
    /// Adds a joint as the `index`-th child of `parent` (the `index`-th root for `None`; past the end: last).
    AddJoint {
        /// The joint.
        joint: Box<JointData>,
        /// Uid of its parent.
        parent: Option<Uid>,
        /// Index among the siblings.
        index: usize,
    },
    /// Removes a joint without children, and its part of the current pose.
    RemoveJoint(Uid),
    /// Sets the rest transform of a joint, relative to its parent.
    SetRest(Uid, RestTransform),
    /// Moves a joint with its hierarchy to another parent; its rest transform stays unchanged, relative to the parent.
    SetParent {
        /// The joint.
        joint: Uid,
        /// Uid of the new parent.
        parent: Option<Uid>,
        /// Index among the siblings there.
        index: usize,
    },
    /// Renames a joint; an empty label is none.
    SetLabel(Uid, Option<String>),
    /// Puts a joint into a local group.
    SetGroup(Uid, Option<Uid>),
    /// Sets the joint on the other side, one way; a pair needs both directions.
    SetMirror(Uid, Option<Uid>),
    /// Locks a joint's weights against automatic skinning and brushes, or unlocks them.
    SetLocked(Uid, bool),
    /// Adds a tag as the `index`-th of a joint.
    AddTag {
        /// The joint.
        joint: Uid,
        /// The tag.
        tag: Box<TagData>,
        /// Index of the tag.
        index: usize,
    },
    /// Removes a tag of a joint.
    RemoveTag(Uid, Uid),
    /// Replaces the tag of a joint that has the same uid.
    SetTag(Uid, Box<TagData>),
    /// Adds a local group.
    AddLocalGroup(GroupData, usize),
    /// Removes a local group without joints.
    RemoveLocalGroup(Uid),
    /// Replaces the local group that has the same uid.
    SetLocalGroup(GroupData),
    /// Changes name, version, author and the like.
    SetAbout(Box<RigAbout>),
    /// Binds a mesh with weights, replaces them, or unbinds the mesh.
    SetSkin(Uid, #[serde(with = "skin_weights")] Option<Arc<SkinData>>),
    /// Poses a joint or a created node by an offset on top of its rest transform or built base; `None` resets it. A
    /// node that is not built at the moment keeps its offset.
    SetOffset(Uid, Option<PoseOffset>),
    /// Sets an attribute of a joint or created node; `None` resets it to the default of its command. The node need not
    /// be built at the moment.
    SetAttributeValue(Uid, String, Option<f32>),
    /// Adds a stored pose as the `index`-th.
    AddStoredPose(Box<StoredPose>, usize),
    /// Removes a stored pose.
    RemoveStoredPose(Uid),
    /// Replaces the stored pose that has the same uid.
    SetStoredPose(Box<StoredPose>),
    /// Adds a clip as the `index`-th.
    AddClip(Box<RigClip>, usize),
    /// Removes a clip.
    RemoveClip(Uid),
    /// Sets name, frame rate, range, loop and markers of a clip.
    SetClipAbout(Uid, Box<ClipAbout>),
    /// Adds a layer to a clip as the `index`-th from the bottom.
    AddLayer {
        /// The clip.
        clip: Uid,
        /// The layer.
        layer: Box<ClipLayer>,
        /// Index of the layer.
        index: usize,
    },
    /// Removes a layer of a clip.
    RemoveLayer {
        /// The clip.
        clip: Uid,
        /// The layer.
        layer: Uid,
    },
    /// Sets name, mode, weight, mask and muting of a layer.
    SetLayer {
        /// The clip.
        clip: Uid,
        /// The layer.
        layer: Uid,
        /// The layer's header.
        about: Box<LayerAbout>,
    },
    /// Removes keys of a property of a node, then adds others. The node need not be there at the moment.
    SetKeys {
        /// The clip.
        clip: Uid,
        /// The layer.
        layer: Uid,
        /// The node and its property.
        target: TrackTarget,
        /// Times of the keys to remove, rising; there must be a key at each.
        removed: Vec<f32>,
        /// Keys to add, by rising time; none may be at the time of a key that stays.
        inserted: Vec<Key>,
    },
    /// Several edits as one: all are applied or none.
    Batch(Vec<RigEdit>),
    /// Makes a joint a null, or a null a joint.
    SetKind(Uid, NodeKind),
    /// Sets the record of a joint's placement as a facial bone.
    SetFace(Uid, Option<Box<FacePlacement>>),
    /// Replaces the declared inputs.
    SetInputs(Vec<RigInput>),
    /// Replaces the record of parts that were dropped onto joints; what they brought stays.
    SetDroppedParts(Vec<DroppedPart>),
    /// Replaces the selection sets.
    SetSelectionSets(Vec<SelectionSet>),
    /// Changes the influences of some points of a bound mesh; all others stay.
    SetWeights(Uid, Box<WeightPatch>),
    /// Sets the cut of a mesh's face; `None` sets the defaults.
    SetFaceCut(Uid, Option<FaceCut>),
    /// Moves a tag to a joint, its own or another, as the `index`-th of its tags; the tag stays the same one.
    MoveTag {
        /// The tag.
        tag: Uid,
        /// Joint that gets the tag.
        joint: Uid,
        /// Index of the tag there.
        index: usize,
    },
    /// Gives what is stored of each node (offset, attribute values, stored poses, keys) to the other one of its pair.
    ExchangeNodes(Vec<(Uid, Uid)>),
    /// Tells that a mesh comes to the rig. The rig names meshes and holds none, so whoever shows them follows.
    AddMesh(Uid),
    /// Tells that a mesh leaves the rig; its weights are [`RigEdit::SetSkin`]'s.
    RemoveMesh(Uid),
}

/// Error of applying an edit. The rig is unchanged.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum EditError {
    /// A socket or option that no template can have.
    #[error(transparent)]
    Header(#[from] HeaderFault),
    /// A joint that does not exist.
    #[error("there is no joint {0} in the rig; it may have been deleted: select another")]
    NoJoint(Uid),
    /// A group that does not exist.
    #[error("there is no local group {0} in the rig; create it first")]
    NoGroup(Uid),
    /// A tag that does not exist on the joint.
    #[error("joint {0} has no tag {1}; it may have been deleted")]
    NoTag(Uid, Uid),
    /// A stored pose that does not exist.
    #[error("there is no stored pose {0} in the rig; it may have been deleted: choose another")]
    NoPose(Uid),
    /// A clip that does not exist.
    #[error("there is no clip {0} in the rig; it may have been deleted: choose another")]
    NoClip(Uid),
    /// A layer that does not exist in its clip.
    #[error("clip {0} has no layer {1}; it may have been deleted: choose another")]
    NoLayer(Uid, Uid),
    /// A clip with values that no clip can have.
    #[error("clip {0} would get {1}")]
    BadClip(Uid, ClipFault),
    /// Keys that a track cannot have.
    #[error("keys of {} of {}: {fault}", target.property, target.node)]
    BadKeys {
        /// The node and its property.
        target: TrackTarget,
        /// Defect of the keys.
        fault: KeyFault,
    },
    /// A uid that is taken.
    #[error("uid {0} is already used in the rig; give the added thing another uid")]
    UidInUse(Uid),
    /// A joint that has children.
    #[error("joint {0} has children; delete or reparent them first")]
    HasChildren(Uid),
    /// A group that has joints.
    #[error("local group {0} still has joints; take them out first")]
    GroupInUse(Uid),
    /// A parent below the joint.
    #[error("joint {joint} cannot hang below {parent}, which hangs below it; choose a parent outside its hierarchy")]
    Cycle {
        /// The joint to reparent.
        joint: Uid,
        /// The requested parent.
        parent: Uid,
    },
    /// A transform with a number that is not finite or a rotation that is not of unit length.
    #[error("joint {0} would get a transform that is not finite or not a rotation; check the numbers")]
    BadTransform(Uid),
    /// An attribute's value that is not finite.
    #[error("attribute \"{1}\" of {0} would get a value that is not finite; use another")]
    BadValue(Uid, String),
    /// Weights over joints that do not exist.
    #[error("the weights name {0} joints that the rig does not have; skin the mesh again")]
    BadSkin(usize),
    /// Weights that are inconsistent.
    #[error("the weights are not finite or their lists do not fit together; skin the mesh again")]
    BadWeights,
    /// A change of weights of a mesh that has none.
    #[error("mesh {0} has no weights to change; skin it first")]
    NoSkin(Uid),
    /// A change of weights that does not fit the weights of the mesh.
    #[error("the weights of mesh {0} would get {1}")]
    BadPatch(Uid, PatchFault),
    /// A colour that is not finite.
    #[error("the colour of local group {0} is not finite; use numbers from 0 to 1")]
    BadColor(Uid),
    /// The name of an input that is empty, or another's.
    #[error("input {0} cannot be called \"{1}\": it needs a name that no other input has")]
    BadInputName(Uid, String),
    /// An input at a place that is none.
    #[error("input \"{0}\" would get a transform that is not finite or not a rotation; check the numbers")]
    BadInput(String),
    /// Parameters of a tag that are not RON.
    #[error("the parameters of tag {0} are not RON text: {1}; correct them, or write () for none")]
    BadParams(Uid, String),
}

impl Rig {
    /// Applies an edit and returns its exact inverse, order of siblings included.
    pub fn apply(&mut self, edit: &RigEdit) -> Result<RigEdit, EditError> {
        if !edit.is_of_motion() {
            self.begin_edit(edit);
        }
        Ok(match edit {
            RigEdit::AddJoint { joint, parent, index } => self.add_joint(joint, *parent, *index)?,
            RigEdit::RemoveJoint(uid) => self.remove_joint(*uid)?,
            RigEdit::SetRest(uid, rest) => {
                if !rest.is_valid() {
                    return Err(EditError::BadTransform(*uid));
                }
                let before = std::mem::replace(&mut self.joint_mut(*uid)?.data.rest, *rest);
                self.forget_checkpoints(*uid);
                RigEdit::SetRest(*uid, before)
            }
            RigEdit::SetParent { joint, parent, index } => self.set_parent(*joint, *parent, *index)?,
            RigEdit::SetLabel(uid, label) => {
                // An empty label is none, as on entities.
                let label = label.clone().filter(|label| !label.is_empty());
                let before = std::mem::replace(&mut self.joint_mut(*uid)?.data.label, label.clone());
                self.label_index.change(*uid, before.as_deref(), label.as_deref());
                RigEdit::SetLabel(*uid, before)
            }
            RigEdit::SetGroup(uid, group) => self.set_group(*uid, *group)?,
            RigEdit::SetMirror(uid, mirror) => {
                let joint = self.joint_mut(*uid)?;
                RigEdit::SetMirror(*uid, std::mem::replace(&mut joint.data.mirror, *mirror))
            }
            RigEdit::SetLocked(uid, locked) => {
                let joint = self.joint_mut(*uid)?;
                RigEdit::SetLocked(*uid, std::mem::replace(&mut joint.data.locked, *locked))
            }
            RigEdit::AddTag { joint, tag, index } => self.add_tag(*joint, tag, *index)?,
            RigEdit::RemoveTag(joint, tag) => self.remove_tag(*joint, *tag)?,
            RigEdit::SetTag(joint, tag) => self.set_tag(*joint, tag)?,
            RigEdit::AddLocalGroup(group, index) => self.add_local_group(group, *index)?,
            RigEdit::RemoveLocalGroup(uid) => self.remove_local_group(*uid)?,
            RigEdit::SetLocalGroup(group) => self.set_local_group(group)?,
            RigEdit::SetAbout(about) => self.set_about(about)?,
            RigEdit::SetSkin(mesh, skin) => self.set_skin(*mesh, skin.as_ref())?,
            RigEdit::SetOffset(joint, offset) => self.set_offset(*joint, *offset)?,
            RigEdit::SetAttributeValue(node, name, value) => self.set_attribute_value(*node, name, *value)?,
            RigEdit::AddStoredPose(pose, index) => self.add_stored_pose(pose, *index)?,
            RigEdit::RemoveStoredPose(uid) => self.remove_stored_pose(*uid)?,
            RigEdit::SetStoredPose(pose) => self.set_stored_pose(pose)?,
            RigEdit::AddClip(clip, index) => self.add_clip(clip, *index)?,
            RigEdit::RemoveClip(uid) => self.remove_clip(*uid)?,
            RigEdit::SetClipAbout(uid, about) => self.set_clip_about(*uid, about)?,
            RigEdit::AddLayer { clip, layer, index } => self.add_layer(*clip, layer, *index)?,
            RigEdit::RemoveLayer { clip, layer } => self.remove_layer(*clip, *layer)?,
            RigEdit::SetLayer { clip, layer, about } => self.set_layer(*clip, *layer, about)?,
            RigEdit::SetKeys { clip, layer, target, removed, inserted } => {
                self.set_keys(*clip, *layer, target, removed, inserted)?
            }
            RigEdit::Batch(edits) => self.apply_batch(edits)?,
            RigEdit::SetKind(uid, kind) => {
                let joint = self.joint_mut(*uid)?;
                RigEdit::SetKind(*uid, std::mem::replace(&mut joint.data.kind, *kind))
            }
            RigEdit::SetFace(uid, face) => {
                let joint = self.joint_mut(*uid)?;
                let old = std::mem::replace(&mut joint.data.face, face.as_deref().cloned());
                RigEdit::SetFace(*uid, old.map(Box::new))
            }
            RigEdit::SetInputs(inputs) => self.set_inputs(inputs)?,
            RigEdit::SetSelectionSets(sets) => self.set_selection_sets(sets),
            RigEdit::SetFaceCut(mesh, cut) => self.set_face_cut(*mesh, *cut),
            RigEdit::SetWeights(mesh, patch) => self.set_weights(*mesh, patch)?,
            RigEdit::MoveTag { tag, joint, index } => self.move_tag(*tag, *joint, *index)?,
            RigEdit::ExchangeNodes(pairs) => self.exchange_nodes(pairs),
            RigEdit::AddMesh(mesh) => RigEdit::RemoveMesh(*mesh),
            RigEdit::RemoveMesh(mesh) => RigEdit::AddMesh(*mesh),
            RigEdit::SetDroppedParts(parts) => {
                RigEdit::SetDroppedParts(std::mem::replace(&mut self.dropped, parts.clone()))
            }
        })
    }

    fn apply_batch(&mut self, edits: &[RigEdit]) -> Result<RigEdit, EditError> {
        let mut inverses = Vec::with_capacity(edits.len());
        for edit in edits {
            match self.apply(edit) {
                Ok(inverse) => inverses.push(inverse),
                Err(error) => {
                    // The edits so far are undone; inverses of applied edits cannot be refused.
                    for inverse in inverses.iter().rev() {
                        let undone = self.apply(inverse);
                        debug_assert!(undone.is_ok(), "an inverse was refused: {undone:?}");
                    }
                    return Err(error);
                }
            }
        }
        inverses.reverse();
        Ok(RigEdit::Batch(inverses))
    }

    fn joint_mut(&mut self, uid: Uid) -> Result<&mut RigJoint, EditError> {
        self.joints.get_mut(&uid).map(Arc::make_mut).ok_or(EditError::NoJoint(uid))
    }

    fn check_free(&self, uid: Uid) -> Result<(), EditError> {
        if self.is_taken(uid) { Err(EditError::UidInUse(uid)) } else { Ok(()) }
    }

    fn check_group(&self, group: Option<Uid>) -> Result<(), EditError> {
        match group {
            Some(uid) if self.group(uid).is_none() => Err(EditError::NoGroup(uid)),
            _ => Ok(()),
        }
    }

    fn siblings_mut(&mut self, parent: Option<Uid>) -> Result<&mut Vec<Uid>, EditError> {
        match parent {
            None => Ok(&mut self.roots),
            Some(uid) => Ok(&mut self.joint_mut(uid)?.children),
        }
    }

    /// Removes a joint from its parent's list; returns its former parent and index.
    fn detach(&mut self, uid: Uid) -> Result<(Option<Uid>, usize), EditError> {
        let parent = self.joints.get(&uid).ok_or(EditError::NoJoint(uid))?.parent;
        let siblings = self.siblings_mut(parent)?;
        // Undo takes the last ones away first.
        let index = siblings.iter().rposition(|s| *s == uid).ok_or(EditError::NoJoint(uid))?;
        siblings.remove(index);
        Ok((parent, index))
    }

    fn add_joint(&mut self, data: &JointData, parent: Option<Uid>, index: usize) -> Result<RigEdit, EditError> {
        self.check_free(data.uid)?;
        let mut own = HashSet::from([data.uid]);
        for tag in &data.tags {
            self.check_free(tag.uid)?;
            if !own.insert(tag.uid) {
                return Err(EditError::UidInUse(tag.uid));
            }
        }
        let tags = data.tags.iter().map(checked).collect::<Result<_, _>>()?;
        if !data.rest.is_valid() {
            return Err(EditError::BadTransform(data.uid));
        }
        self.check_group(data.group)?;
        let siblings = self.siblings_mut(parent)?;
        siblings.insert(index.min(siblings.len()), data.uid);
        self.tags.extend(data.tags.iter().map(|tag| (tag.uid, data.uid)));
        let label = data.label.clone().filter(|label| !label.is_empty());
        self.label_index.change(data.uid, None, label.as_deref());
        self.group_members.change(None, data.group);
        let data = JointData { tags, label, ..data.clone() };
        let uid = data.uid;
        self.joints.insert(uid, Arc::new(RigJoint { data, parent, children: Vec::new() }));
        // `RemoveJoint` also removes the joint's offset from the pose; the inverse restores an offset that the uid
        // already had.
        Ok(match self.pose.get(&uid) {
            Some(offset) => RigEdit::Batch(vec![RigEdit::RemoveJoint(uid), RigEdit::SetOffset(uid, Some(*offset))]),
            None => RigEdit::RemoveJoint(uid),
        })
    }

    fn remove_joint(&mut self, uid: Uid) -> Result<RigEdit, EditError> {
        if !self.joints.get(&uid).ok_or(EditError::NoJoint(uid))?.children.is_empty() {
            return Err(EditError::HasChildren(uid));
        }
        self.forget_checkpoints(uid);
        let (parent, index) = self.detach(uid)?;
        let joint = Arc::unwrap_or_clone(self.joints.remove(&uid).ok_or(EditError::NoJoint(uid))?);
        for tag in &joint.data.tags {
            self.tags.remove(&tag.uid);
            self.tag_places.forget(tag.uid);
        }
        self.label_index.change(uid, joint.data.label.as_deref(), None);
        self.group_members.change(joint.data.group, None);
        let back = RigEdit::AddJoint { joint: Box::new(joint.data), parent, index };
        Ok(match self.pose.remove(&uid) {
            Some(offset) => RigEdit::Batch(vec![back, RigEdit::SetOffset(uid, Some(offset))]),
            None => back,
        })
    }

    fn set_parent(&mut self, uid: Uid, parent: Option<Uid>, index: usize) -> Result<RigEdit, EditError> {
        if let Some(above) = parent {
            if !self.joints.contains_key(&above) {
                return Err(EditError::NoJoint(above));
            }
            if above == uid || self.ancestors(above).any(|ancestor| ancestor.data.uid == uid) {
                return Err(EditError::Cycle { joint: uid, parent: above });
            }
        }
        self.forget_checkpoints(uid);
        let (old_parent, old_index) = self.detach(uid)?;
        let siblings = self.siblings_mut(parent)?;
        siblings.insert(index.min(siblings.len()), uid);
        self.joint_mut(uid)?.parent = parent;
        self.label_index.reorder();
        Ok(RigEdit::SetParent { joint: uid, parent: old_parent, index: old_index })
    }
}
