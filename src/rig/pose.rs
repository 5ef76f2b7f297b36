//! Poses: offsets on top of the rest pose.
//!
//! Rest and pose never mix: a pose is a list of offsets from rest, one for each joint that is not at rest. Changing the
//! rest pose keeps the offsets, and changing a pose never touches the rest pose.

use std::collections::{BTreeMap, HashMap};

use bevy::{math::Affine3, prelude::*};
use serde::{Deserialize, Serialize};

use crate::rig::{RestTransform, Rig, Uid};

/// Offset of a pose from the rest transform of one joint, in the joint's own space at rest.
///
/// Rest transform and offset are multiplied as Bevy multiplies two [`Transform`]s: the translation is moved and turned
/// by rest, rotations follow one another, scales are multiplied axis by axis. So there is never any shear, and the way
/// back is exact.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct PoseOffset {
    /// Translation in the joint's space at rest.
    pub translation: Vec3,
    /// Rotation about the joint's own axes, a unit quaternion.
    pub rotation: Quat,
    /// Factors along the joint's own axes.
    pub scale: Vec3,
}

impl Default for PoseOffset {
    fn default() -> Self {
        Self::IDENTITY
    }
}

impl PoseOffset {
    /// The offset of a joint at rest.
    pub const IDENTITY: Self = Self { translation: Vec3::ZERO, rotation: Quat::IDENTITY, scale: Vec3::ONE };

    /// An offset with a rotation only.
    pub fn from_rotation(rotation: Quat) -> Self {
        Self { rotation, ..Self::IDENTITY }
    }

    /// The offset that takes a joint from `rest` to `posed`, both relative to its parent. An axis with a rest scale of
    /// zero keeps its rest values.
    pub fn between(rest: &RestTransform, posed: &Transform) -> Self {
        let back = rest.rotation.inverse();
        let divided = |value: f32, by: f32, otherwise: f32| if by == 0.0 { otherwise } else { value / by };
        let moved = back * (posed.translation - rest.translation);
        Self {
            translation: Vec3::new(
                divided(moved.x, rest.scale.x, 0.0),
                divided(moved.y, rest.scale.y, 0.0),
                divided(moved.z, rest.scale.z, 0.0),
            ),
            rotation: (back * posed.rotation).normalize(),
            scale: Vec3::new(
                divided(posed.scale.x, rest.scale.x, 1.0),
                divided(posed.scale.y, rest.scale.y, 1.0),
                divided(posed.scale.z, rest.scale.z, 1.0),
            ),
        }
    }

    /// Posed transform of a joint with that rest transform, relative to its parent.
    pub fn on(&self, rest: &RestTransform) -> Transform {
        if *self == Self::IDENTITY {
            return (*rest).into();
        }
        Transform {
            translation: rest.translation + rest.rotation * (rest.scale * self.translation),
            rotation: (rest.rotation * self.rotation).normalize(),
            scale: rest.scale * self.scale,
        }
    }

    /// Returns `true` if the joint is at rest, to `tolerance` (of lengths, factors and half the sine of the angle).
    pub fn is_rest(&self, tolerance: f32) -> bool {
        self.translation.abs().max_element() <= tolerance
            && self.rotation.xyz().abs().max_element() <= tolerance
            && (self.scale - Vec3::ONE).abs().max_element() <= tolerance
    }

    /// Returns `true` if every number is finite and the rotation has unit length.
    pub fn is_valid(&self) -> bool {
        let Self { translation, rotation, scale } = *self;
        RestTransform { translation, rotation, scale }.is_valid()
    }
}

/// Values of attributes, by node and name.
pub type AttributeValues = BTreeMap<Uid, BTreeMap<String, f32>>;

/// A pose stored under a name.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct StoredPose {
    /// Identity.
    pub uid: Uid,
    /// The name people see.
    pub name: String,
    /// Offsets of the joints and created nodes that are not at rest. Entries of deleted joints and of nodes that are
    /// not built at present stay: their part of the pose waits for them.
    pub offsets: BTreeMap<Uid, PoseOffset>,
    /// Attributes that were set.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub values: AttributeValues,
}

/// Poses.
impl Rig {
    /// The current pose's offset on top of the rest transform of a joint or the built base of a created node; `None` at
    /// rest.
    pub fn offset(&self, joint: Uid) -> Option<&PoseOffset> {
        self.pose.get(&joint)
    }

    /// The current pose: offsets of all joints and created nodes that are not at rest. Nodes that are not built at
    /// present keep their offsets.
    pub fn pose(&self) -> &BTreeMap<Uid, PoseOffset> {
        &self.pose
    }

    /// The value that an attribute of a joint or created node has been set to.
    pub fn attribute_value(&self, node: Uid, name: &str) -> Option<f32> {
        self.values.get(&node)?.get(name).copied()
    }

    /// Attributes that have been set. Nodes that are not built at present keep theirs.
    pub fn attribute_values(&self) -> &AttributeValues {
        &self.values
    }

    /// The stored poses in order.
    pub fn stored_poses(&self) -> &[StoredPose] {
        &self.poses
    }

    /// The stored pose with that uid.
    pub fn stored_pose(&self, uid: Uid) -> Option<&StoredPose> {
        self.poses.find(uid)
    }

    /// Transform of a joint in the current pose, relative to its parent. Identity for an unknown joint.
    pub fn posed_local(&self, joint: Uid) -> Transform {
        let Some(data) = self.joint(joint).map(|joint| &joint.data) else { return Transform::IDENTITY };
        self.pose.get(&joint).map_or_else(|| data.rest.into(), |offset| offset.on(&data.rest))
    }

    /// Transform of a joint from its own space to the rig's, in the current pose. Identity for an unknown joint.
    pub fn posed_global(&self, joint: Uid) -> Affine3 {
        let own = affine(&self.posed_local(joint));
        self.ancestors(joint).fold(own, |global, above| affine(&self.posed_local(above.data.uid)) * global)
    }

    /// Matrix from posed to rest positions for children of `joint`, both in the rig's space: a joint placed on the
    /// posed mesh below `joint` rests at the mapped position. Exactly the identity for `None` and if no joint above is
    /// posed.
    pub fn rest_from_pose(&self, joint: Option<Uid>) -> Affine3 {
        let Some(joint) = joint.filter(|_| !self.pose.is_empty()) else { return Affine3::IDENTITY };
        let is_posed = self.pose.contains_key(&joint)
            || self.ancestors(joint).any(|above| self.pose.contains_key(&above.data.uid));
        if is_posed { self.rest_global(joint) * self.posed_global(joint).inverse() } else { Affine3::IDENTITY }
    }

    /// Posed transforms of all joints to the rig's space, in the order of [`Rig::walk`].
    pub fn posed_globals(&self) -> Vec<(Uid, Affine3)> {
        let mut known: HashMap<Uid, Affine3> = HashMap::with_capacity(self.len());
        let mut list = Vec::with_capacity(self.len());
        for joint in self.walk() {
            let parent = joint.parent.and_then(|parent| known.get(&parent)).copied().unwrap_or(Affine3::IDENTITY);
            let global = parent * affine(&self.posed_local(joint.data.uid));
            known.insert(joint.data.uid, global);
            list.push((joint.data.uid, global));
        }
        list
    }
}

fn affine(transform: &Transform) -> Affine3 {
    Affine3::from_scale_rotation_translation(transform.scale, transform.rotation, transform.translation)
}
