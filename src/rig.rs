//! Rigs as plain data and rules. No systems, no rendering, no files.
//!
//! [`Rig`] is the whole document; [`RigEdit`] is the only way it changes, each edit with its exact inverse.

pub mod animation;
pub mod bake;
mod built_rig;
pub mod character;
mod constraint;
pub mod deform;
mod document;
pub mod edit;
pub mod extract;
mod face_cut;
pub mod feature;
pub mod format;
mod group;
mod group_members;
mod input;
mod joint;
pub mod label;
mod label_index;
mod moved_nodes;
pub mod nearest;
pub mod operations;
pub mod part;
mod pose;
pub mod proportion;
pub mod reference;
mod remap;
mod rest_checkpoints;
mod revision;
mod selection_set;
pub mod shapes;
pub mod skeleton_preset;
pub mod step;
mod tag;
mod tag_places;
mod template_copy;
mod touched_joints;
mod uid;
mod uid_list;
pub mod update;
pub mod version;
pub mod vrm;

pub(crate) use built_rig::created_uid;
pub use built_rig::{
    Attribute, AttributeKind, BuiltConstraint, BuiltInput, BuiltNode, BuiltRig, Channels, ControlData, LayerData,
    LayerDisplay, Limits, Matching, NodeType, Origin, SwitchData, VISIBLE,
};
pub use constraint::{
    AimUp, AngleLimits, ChainSolver, Channel, Collider, Constraint, Dependency, KeyEase, Output, Scalar, Target,
};
pub use document::{Rig, RigAbout, SkinData};
pub use edit::{EditError, PatchFault, RigEdit, WeightPatch, joint_numbers, weight_edit};
pub use face_cut::FaceCut;
pub use format::source::SourceError;
pub use format::{project, skin, template, text};
pub(crate) use format::{
    scan::{Field, elements, fields, same_place},
    source::{parse_ron, ron_options, ron_text, utf8},
    tree::{list_items, with_field},
};
pub use group::{GROUP_COLORS, GroupData};
pub use input::RigInput;
pub use joint::{FaceBonePart, FacePlacement, JointData, NodeKind, RestTransform, RigJoint, degrees};
pub use moved_nodes::{MovedNodes, MovedTags};
pub use pose::{AttributeValues, PoseOffset, StoredPose};
pub use reference::{NodeRef, NodeRefs};
pub use revision::Revision;
pub use selection_set::SelectionSet;
pub use tag::{TagData, TagKind};
pub(crate) use uid::mix;
pub use uid::{Uid, UidError, UidSource};
