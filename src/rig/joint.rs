//! Joints: the nodes of a skeleton.

use std::borrow::Cow;

use bevy::{math::Affine3, prelude::*};
use serde::{Deserialize, Serialize};

use crate::{
    mesh::model::Trs,
    rig::{TagData, Uid},
};

/// Rest transform of a joint or created node, relative to its parent (or to the rig for a root).
///
/// Joints of the document have different values in the editor and in a game. Where the rig is a document, as in the
/// editor, the value is the document's: before any command, below the parent in the document. On a game's instance it
/// is the built one: behind all commands (`orient_joints` turns, `insert_joints` hangs elsewhere), below the built
/// parent, as [`BuiltNode::base`](crate::rig::BuiltNode::base) says. Created nodes have the built one in both.
#[derive(Component, Reflect, Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[reflect(Component)]
pub struct RestTransform {
    /// Translation in the parent's space.
    pub translation: Vec3,
    /// Rotation, a unit quaternion.
    pub rotation: Quat,
    /// Scale along the joint's own axes.
    pub scale: Vec3,
}

impl Default for RestTransform {
    fn default() -> Self {
        Self { translation: Vec3::ZERO, rotation: Quat::IDENTITY, scale: Vec3::ONE }
    }
}

impl RestTransform {
    /// A rest transform with a translation only.
    pub fn from_translation(translation: Vec3) -> Self {
        Self { translation, ..default() }
    }

    /// The transform as an affine matrix.
    pub fn affine(&self) -> Affine3 {
        Affine3::from_scale_rotation_translation(self.scale, self.rotation, self.translation)
    }

    /// The nearest translation, rotation and scale to a matrix (shear is lost). A scale that differs from one by
    /// rounding only becomes one, so that repeated moves do not make joints grow.
    pub fn from_affine(affine: &Affine3) -> Self {
        let (scale, rotation, translation) = affine.to_scale_rotation_translation();
        let snapped = |factor: f32| if (factor - 1.0).abs() < 1e-5 { 1.0 } else { factor };
        let scale = Vec3::new(snapped(scale.x), snapped(scale.y), snapped(scale.z));
        Self { translation, rotation: rotation.normalize(), scale }
    }

    /// Returns `true` if every number is finite and the rotation has unit length.
    pub fn is_valid(&self) -> bool {
        self.translation.is_finite()
            && self.scale.is_finite()
            && self.rotation.is_finite()
            && (self.rotation.length_squared() - 1.0).abs() < 1e-3
    }
}

impl From<RestTransform> for Transform {
    fn from(rest: RestTransform) -> Self {
        Self { translation: rest.translation, rotation: rest.rotation, scale: rest.scale }
    }
}

impl From<Transform> for RestTransform {
    fn from(transform: Transform) -> Self {
        Self { translation: transform.translation, rotation: transform.rotation, scale: transform.scale }
    }
}

impl From<RestTransform> for Trs {
    fn from(rest: RestTransform) -> Self {
        Self { translation: rest.translation, rotation: rest.rotation, scale: rest.scale }
    }
}

impl From<Trs> for RestTransform {
    fn from(trs: Trs) -> Self {
        Self { translation: trs.translation, rotation: trs.rotation, scale: trs.scale }
    }
}

/// Angles about X, Y and Z in degrees, one after the other in that order (X is applied last), as a rotation.
pub fn degrees(angles: Vec3) -> Quat {
    let [x, y, z] = angles.to_array().map(f32::to_radians);
    let half = |angle: f32| (bevy::math::ops::sin(angle * 0.5), bevy::math::ops::cos(angle * 0.5));
    let about = |axis: Vec3, angle: f32| {
        let (sin, cos) = half(angle);
        Quat::from_xyzw(axis.x * sin, axis.y * sin, axis.z * sin, cos)
    };
    (about(Vec3::X, x) * about(Vec3::Y, y) * about(Vec3::Z, z)).normalize()
}

/// Kind of a node of the skeleton.
#[derive(Reflect, Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub enum NodeKind {
    /// A joint, which moves the mesh.
    #[default]
    Joint,
    /// A node that only carries others and never gets weights (an imported armature node, for example).
    Null,
}

/// Kind of a facial bone.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum FaceBonePart {
    /// A bone of the skin.
    Skin,
    /// The bone of the jaw.
    Jaw,
    /// The bone of an eye.
    Eye,
    /// The bone of the tongue, below that of the jaw.
    Tongue,
}

/// Record of the placement of a facial bone. Whatever differs from it was changed by a person later.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FacePlacement {
    /// Kind of the bone.
    pub part: FaceBonePart,
    /// Label that the bone got.
    pub label: String,
    /// Position at which the bone was placed, in the rig's space.
    pub position: Vec3,
}

/// Data of a joint, without its place in the hierarchy.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct JointData {
    /// Identity.
    pub uid: Uid,
    /// The name people see; any characters, not necessarily unique.
    pub label: Option<String>,
    /// The local group the joint belongs to.
    pub group: Option<Uid>,
    /// Joint or null.
    pub kind: NodeKind,
    /// Rest pose.
    pub rest: RestTransform,
    /// The joint on the other side. Pairs are identified by uid, never by name; both refer to each other.
    pub mirror: Option<Uid>,
    /// Lock: automatic skinning and brushes leave the weights of a locked joint unchanged.
    pub locked: bool,
    /// Tags in order.
    pub tags: Vec<TagData>,
    /// Record of the placement as a facial bone; `None` for all other joints.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub face: Option<FacePlacement>,
}

impl JointData {
    /// Name for people: the label, or the first digits of the uid.
    pub fn name(&self) -> Cow<'_, str> {
        match &self.label {
            Some(label) => Cow::Borrowed(label),
            None => Cow::Owned(format!("joint {:04x}", self.uid.0 >> 48)),
        }
    }
}

/// A joint in a [`crate::rig::Rig`]: its data and its place.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct RigJoint {
    /// Data of the joint.
    pub data: JointData,
    /// The parent joint; `None` for a root.
    pub parent: Option<Uid>,
    /// Children in authored order.
    pub children: Vec<Uid>,
}
