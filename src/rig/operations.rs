//! Operations: changes of a rig that people make, as lists of edits.
//!
//! An [`Operation`] is one request of a person: place a joint, move three, delete one and keep its children. It runs in
//! a [`Draft`], which applies edits one after another through [`Rig::apply`] and takes them all back if one is refused.
//! With symmetry on, an operation also changes the joints on the other side; pairs are identified by uid.

mod clips;
mod draft;
mod frame;
mod groups;
mod hierarchy;
mod leftovers;
mod merge;
mod naming;
mod orient;
mod place;
mod pose;
mod symmetry;
mod tags;
mod title;
mod transform;
mod whole_pose;

use std::{borrow::Cow, collections::HashSet, sync::Arc};

use bevy::math::{Affine3, Quat, Vec3};

pub use clips::{ClipOperation, KeyClipboard, KeyEase, KeyOperation, KeyTimes, KeyTolerance};
pub use draft::{Draft, Outcome};
pub use groups::merged_groups;
pub use orient::Axis;
pub use place::settle;
pub use symmetry::MirrorPlane;
pub(in crate::rig) use tags::drop_part;
pub use tags::{
    CopiedIdentifiers, CopiedJoint, PartOrder, PartSide, PasteContent, PasteTo, Rewiring, TagClipboard, TagError,
    TagOperation, TagScope,
};
pub use whole_pose::WholePose;

use crate::rig::{
    BuiltRig, EditError, GROUP_COLORS, GroupData, PoseOffset, RestTransform, Rig, RigEdit, Uid, UidSource,
};

/// A change of a rig that a person requests. Positions and transforms are in the rig's space.
#[derive(Debug, Clone, PartialEq)]
pub enum Operation {
    /// Adds a joint at a position as a child of `parent`, or as a root, names it, and selects it.
    Place {
        /// Position of the joint.
        position: Vec3,
        /// Parent of the joint.
        parent: Option<Uid>,
    },
    /// Adds a chain of joints, the first as a child of `parent`, and selects the last. They are named by chain, side and
    /// place (`arm_l_2`); Y points along the bone, X is the axis about which the chain bends.
    Chain {
        /// Positions of the joints, in order.
        positions: Vec<Vec3>,
        /// Parent of the first joint.
        parent: Option<Uid>,
    },
    /// Inserts a joint into the bone that ends at `child`, and selects it.
    Insert {
        /// The joint at the bone's end.
        child: Uid,
        /// Position of the joint.
        position: Vec3,
    },
    /// Deletes joints; their hierarchies are deleted too, or move up to their parents.
    Delete {
        /// Joints to delete.
        joints: Vec<Uid>,
        /// Keeps the joints below if `true`.
        keep_children: bool,
    },
    /// Puts each joint at a position.
    Move {
        /// Joints and their positions.
        to: Vec<(Uid, Vec3)>,
        /// Moves the joints below along if `true`; else they stay in place.
        with_children: bool,
    },
    /// Rotates joints about a pivot.
    Rotate {
        /// Joints to rotate.
        joints: Vec<Uid>,
        /// Rotation, in the rig's axes.
        rotation: Quat,
        /// Pivot; `None` rotates each joint about itself.
        pivot: Option<Vec3>,
        /// Moves the joints below along if `true`; else they stay in place.
        with_children: bool,
    },
    /// Scales joints about a pivot: their distances from it and, if the joint is its own pivot, their rest scale.
    Scale {
        /// Joints to scale.
        joints: Vec<Uid>,
        /// Factors along the axes, none zero.
        scale: Vec3,
        /// The axes, as a rotation of the rig's.
        axes: Quat,
        /// Pivot; `None` scales each joint about itself.
        pivot: Option<Vec3>,
        /// Moves the joints below along if `true`; else they stay in place.
        with_children: bool,
    },
    /// Sets rest transforms of joints, each relative to its parent.
    Rest {
        /// Joints and their rest transforms.
        to: Vec<(Uid, RestTransform)>,
        /// Moves the joints below along if `true`; else they stay in place.
        with_children: bool,
    },
    /// Reparents joints (or makes them roots) without moving them.
    Reparent {
        /// Joints to reparent.
        joints: Vec<Uid>,
        /// New parent.
        parent: Option<Uid>,
    },
    /// Renames joints; an empty name removes the label.
    Labels(Vec<(Uid, String)>),
    /// Orients joints so that one of their axes points along their bone; no other joint moves.
    Orient {
        /// Joints to orient.
        joints: Vec<Uid>,
        /// The axis that points along the bone.
        along: Axis,
    },
    /// Makes or updates the other side of joints and of their hierarchies.
    Mirror {
        /// Joints to mirror.
        joints: Vec<Uid>,
    },
    /// Puts joints into the local group with that name, which is created with the colour if there is none.
    Group {
        /// Joints to group.
        joints: Vec<Uid>,
        /// The group's name; empty takes the joints out of their groups.
        name: String,
        /// Colour for a group that has to be created, or to be recoloured.
        color: Option<[f32; 3]>,
    },
    /// Locks the weights of joints against automatic skinning and brushes, or unlocks them.
    Lock(Vec<Uid>, bool),
    /// Poses joints by offsets on top of their rest transforms. Partners get the mirror image.
    Pose(Vec<(Uid, PoseOffset)>),
    /// Sets offsets and attributes of nodes as they are given, without mirroring; an attribute without a value gets its
    /// default.
    SetPose {
        /// A few words for the history panel.
        name: &'static str,
        /// Nodes with their offsets.
        offsets: Vec<(Uid, PoseOffset)>,
        /// Nodes with names and values of their attributes.
        values: Vec<(Uid, String, Option<f32>)>,
    },
    /// Resets joints and their partners to rest; all joints if none is listed.
    ResetPose(Vec<Uid>),
    /// Stores the current pose under a name; a stored pose of that name is replaced.
    StorePose(String),
    /// Stores a pose that is given under a name; a stored pose of that name is replaced.
    StoreShown(String, Box<WholePose>),
    /// Makes a stored pose the current one; joints without an entry in it are reset to rest.
    ApplyPose(Uid),
    /// Renames a stored pose.
    RenamePose(Uid, String),
    /// Deletes a stored pose; the current pose stays.
    DeletePose(Uid),
    /// Changes clips.
    Clips(ClipOperation),
    /// Runs an operation, and sets keys of a clip for what it changed in the pose, all as one step.
    Keyed {
        /// The operation.
        operation: Box<Operation>,
        /// The clip.
        clip: Uid,
        /// The layer; `None` for the topmost one.
        layer: Option<Uid>,
        /// Second of the keys.
        time: f32,
    },
    /// Runs an operation on a rig as it is built: joints that it deletes take along pose and attribute values of nodes that
    /// commands made for them, all as one step. Other operations leave those in the document.
    Built {
        /// The operation.
        operation: Box<Operation>,
        /// The built rig before the operation.
        built: Arc<BuiltRig>,
    },
    /// Runs an operation that moves commands to other joints, and gives what is stored of the nodes that they made to those
    /// that they make there, all as one step. What is stored of those already stays.
    Carried {
        /// The operation.
        operation: Box<Operation>,
        /// Nodes before and after the operation.
        nodes: Vec<(Uid, Uid)>,
    },
    /// Changes tags.
    Tags(TagOperation),
    /// Puts another rig's joints, groups and tags into this one.
    Merge {
        /// The other rig.
        other: Arc<Rig>,
        /// Parent of its roots, which keep their places; they stay roots without one.
        parent: Option<Uid>,
    },
    /// Applies edits.
    Edits(Vec<RigEdit>),
    /// Applies edits under a given name.
    Named {
        /// A few words for the history panel.
        name: &'static str,
        /// The edits, in order.
        edits: Vec<RigEdit>,
    },
}

/// Error of an operation. The rig is unchanged.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum OperationError {
    /// A refused edit.
    #[error(transparent)]
    Edit(#[from] EditError),
    /// An error of a change of tags.
    #[error(transparent)]
    Tag(#[from] TagError),
    /// A number that is not valid.
    #[error("{0}")]
    BadNumber(&'static str),
    /// A bone that does not exist.
    #[error("joint {0} is a root: there is no bone above it to insert into")]
    NoBone(Uid),
    /// A pose without a name.
    #[error("a stored pose needs a name; type one")]
    NoName,
    /// A clip without a name.
    #[error("a clip needs a name; type one")]
    NoClipName,
    /// A clip name that is taken.
    #[error("there is a clip \"{0}\" already; choose another name, or delete that clip first")]
    ClipName(String),
    /// A pose name that is taken.
    #[error("there is a stored pose \"{0}\" already; choose another name, or delete that pose first")]
    PoseName(String),
}

impl Operation {
    /// A few words for the history panel.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Place { .. } => "Place joint",
            Self::Chain { .. } => "Draw chain",
            Self::Insert { .. } => "Insert joint",
            Self::Delete { .. } => "Delete joints",
            Self::Move { .. } => "Move joints",
            Self::Rotate { .. } => "Rotate joints",
            Self::Scale { .. } => "Scale joints",
            Self::Rest { .. } => "Set rest pose",
            Self::Reparent { .. } => "Reparent joints",
            Self::Labels(..) => "Rename joints",
            Self::Orient { .. } => "Orient joints",
            Self::Mirror { .. } => "Mirror joints",
            Self::Group { .. } => "Assign group",
            Self::Lock(..) => "Lock joints",
            Self::Pose(..) => "Pose joints",
            Self::ResetPose(..) => "Reset pose",
            Self::StorePose(..) | Self::StoreShown(..) => "Store pose",
            Self::ApplyPose(..) => "Apply pose",
            Self::RenamePose(..) => "Rename pose",
            Self::DeletePose(..) => "Delete pose",
            Self::Clips(operation) => operation.name(),
            Self::Keyed { operation, .. } | Self::Built { operation, .. } | Self::Carried { operation, .. } => {
                operation.name()
            }
            Self::Tags(operation) => operation.name(),
            Self::Merge { .. } => "Merge rig",
            Self::Edits(edits) => match edits[..] {
                // Binding may give half joints their place, too.
                [.., RigEdit::SetSkin(_, Some(_))] => "Skin mesh",
                _ => "Edit rig",
            },
            Self::SetPose { name, .. } | Self::Named { name, .. } => name,
        }
    }

    /// Runs the operation on a rig: applies all of it, or nothing and returns an error. `symmetry` is the plane of live
    /// mirroring.
    pub fn run(
        &self,
        rig: &mut Rig,
        uids: &mut UidSource,
        symmetry: Option<MirrorPlane>,
    ) -> Result<Outcome, OperationError> {
        let mut draft = Draft::new(rig, uids, symmetry);
        match self.run_in(&mut draft) {
            Ok(()) => Ok(draft.finish()),
            Err(error) => {
                draft.take_back();
                Err(error)
            }
        }
    }

    /// The rig as [`run`](Self::run) changes it without live mirroring, and the notes. No edits are kept, which take more memory
    /// than what they add; a rig that refuses the operation is dropped.
    #[cfg(feature = "cli")]
    pub(crate) fn run_on(&self, mut rig: Rig, uids: &mut UidSource) -> Result<(Rig, Vec<String>), OperationError> {
        let mut draft = Draft::without_record(&mut rig, uids);
        self.run_in(&mut draft)?;
        let notes = draft.finish().notes;
        Ok((rig, notes))
    }

    /// The rig with what [`Merge`](Self::Merge) puts into it, as by [`run_on`](Self::run_on). The other rig gives up its joints one
    /// by one.
    #[cfg(feature = "cli")]
    pub(crate) fn merge_owned(
        mut rig: Rig,
        other: Rig,
        parent: Option<Uid>,
        uids: &mut UidSource,
    ) -> Result<(Rig, Vec<String>), OperationError> {
        let mut draft = Draft::without_record(&mut rig, uids);
        merge::merge(&mut draft, Cow::Owned(other), parent)?;
        let notes = draft.finish().notes;
        Ok((rig, notes))
    }

    fn run_in(&self, draft: &mut Draft) -> Result<(), OperationError> {
        match self {
            Self::Place { position, parent } => place::chain(draft, std::slice::from_ref(position), *parent),
            Self::Chain { positions, parent } => place::chain(draft, positions, *parent),
            Self::Insert { child, position } => place::insert(draft, *child, *position),
            Self::Delete { joints, keep_children } => hierarchy::delete(draft, joints, *keep_children),
            Self::Reparent { joints, parent } => hierarchy::reparent(draft, joints, *parent),
            Self::Move { to, with_children } => transform::place_at(draft, to, *with_children),
            Self::Rotate { joints, rotation, pivot, with_children } => {
                if !rotation.is_finite() || (rotation.length_squared() - 1.0).abs() > 1e-3 {
                    return Err(OperationError::BadNumber("the rotation is no unit quaternion; normalise it first"));
                }
                transform::about(draft, joints, Affine3::from_quat(*rotation), *pivot, *with_children)
            }
            Self::Scale { joints, scale, axes, pivot, with_children } => {
                if !axes.is_finite() || (axes.length_squared() - 1.0).abs() > 1e-3 {
                    return Err(OperationError::BadNumber("the axes are no unit quaternion; normalise it first"));
                }
                if !scale.is_finite() || scale.min_element() <= 0.0 && scale.max_element() >= 0.0 {
                    return Err(OperationError::BadNumber(
                        "a scale of zero or of mixed signs cannot be undone by hand",
                    ));
                }
                let (there, back) = (Affine3::from_quat(*axes), Affine3::from_quat(axes.inverse()));
                let change = match *axes == Quat::IDENTITY {
                    true => Affine3::from_scale(*scale),
                    false => there * Affine3::from_scale(*scale) * back,
                };
                transform::about(draft, joints, change, *pivot, *with_children)
            }
            Self::Rest { to, with_children } => transform::rest(draft, to, *with_children),
            Self::Labels(labels) => labels.iter().try_for_each(|(joint, label)| label_joint(draft, *joint, label)),
            Self::Orient { joints, along } => orient::orient(draft, joints, *along),
            Self::Mirror { joints } => symmetry::mirror(draft, joints),
            Self::Group { joints, name, color } => group(draft, joints, name, *color),
            Self::Lock(joints, locked) => {
                for joint in draft.with_partners(joints) {
                    draft.apply(RigEdit::SetLocked(joint, *locked))?;
                }
                Ok(())
            }
            Self::Pose(offsets) => pose::pose(draft, offsets),
            Self::SetPose { offsets, values, .. } => pose::set_all(draft, offsets, values),
            Self::ResetPose(joints) => pose::reset(draft, joints),
            Self::StorePose(name) => {
                let shown = WholePose::of(draft.rig());
                pose::store(draft, name, &shown)
            }
            Self::StoreShown(name, shown) => pose::store(draft, name, shown),
            Self::ApplyPose(pose) => pose::apply(draft, *pose),
            Self::RenamePose(pose, name) => pose::rename(draft, *pose, name),
            Self::DeletePose(pose) => Ok(draft.apply(RigEdit::RemoveStoredPose(*pose))?),
            Self::Clips(operation) => clips::run(draft, operation),
            Self::Keyed { operation, clip, layer, time } => clips::keyed(draft, operation, (*clip, *layer, *time)),
            Self::Built { operation, built } => leftovers::run_built(draft, operation, built),
            Self::Carried { operation, nodes } => {
                operation.run_in(draft)?;
                carry_nodes(draft, nodes)
            }
            Self::Tags(operation) => tags::run(draft, operation),
            Self::Merge { other, parent } => merge::merge(draft, Cow::Borrowed(other), *parent),
            Self::Edits(edits) | Self::Named { edits, .. } => {
                edits.iter().try_for_each(|edit| Ok(draft.apply(edit.clone())?))
            }
        }
    }
}

/// Gives what is stored of nodes to others of which nothing is stored.
fn carry_nodes(draft: &mut Draft, nodes: &[(Uid, Uid)]) -> Result<(), OperationError> {
    let rig = draft.rig();
    let pairs: Vec<(Uid, Uid)> =
        nodes.iter().copied().filter(|(was, is)| rig.has_stored(*was) && !rig.has_stored(*is)).collect();
    if pairs.is_empty() { Ok(()) } else { Ok(draft.apply(RigEdit::ExchangeNodes(pairs))?) }
}

fn label_joint(draft: &mut Draft, joint: Uid, label: &str) -> Result<(), OperationError> {
    let label = Some(label.to_owned()).filter(|label| !label.is_empty());
    draft.apply(RigEdit::SetLabel(joint, label.clone()))?;
    if let Some(partner) = draft.partner(joint) {
        let other = label.map(|label| crate::rig::label::mirrored_label(&label).unwrap_or(label));
        draft.apply(RigEdit::SetLabel(partner, other))?;
    }
    Ok(())
}

fn group(draft: &mut Draft, joints: &[Uid], name: &str, color: Option<[f32; 3]>) -> Result<(), OperationError> {
    let group = named_group(draft, name, color)?;
    let other_name = crate::rig::label::mirrored_label(name).unwrap_or_else(|| name.to_owned());
    let listed: HashSet<Uid> = joints.iter().copied().collect();
    for &joint in joints {
        draft.apply(RigEdit::SetGroup(joint, group))?;
        if let Some(partner) = draft.partner(joint).filter(|partner| !listed.contains(partner)) {
            let other = named_group(draft, &other_name, color)?;
            draft.apply(RigEdit::SetGroup(partner, other))?;
        }
    }
    Ok(())
}

fn named_group(draft: &mut Draft, name: &str, color: Option<[f32; 3]>) -> Result<Option<Uid>, OperationError> {
    if name.is_empty() {
        return Ok(None);
    }
    let known = draft.rig().group_named(name).cloned();
    let group = match (known, color) {
        (Some(group), Some(color)) if group.color != color => {
            draft.apply(RigEdit::SetLocalGroup(GroupData { color, ..group.clone() }))?;
            group
        }
        (Some(group), _) => group,
        (None, color) => {
            let number = draft.rig().groups().len();
            let color = color.unwrap_or(GROUP_COLORS[number % GROUP_COLORS.len()]);
            let group = GroupData { uid: draft.next_uid(), name: name.to_owned(), color, enabled: true };
            draft.apply(RigEdit::AddLocalGroup(group.clone(), number))?;
            group
        }
    };
    Ok(Some(group.uid))
}
