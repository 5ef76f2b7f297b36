//! Nodes that move by themselves: springs, their colliders, and constraints.

use glam::Vec3;
use serde::{Deserialize, Serialize};

use super::SPEC_VERSION;

/// Extension `VRMC_springBone`: chains of nodes that lag behind and swing.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct SpringBones {
    /// Version of the extension.
    pub spec_version: String,
    /// Bodies that springs do not enter.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub colliders: Vec<SpringCollider>,
    /// Groups of colliders, to which springs refer.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub collider_groups: Vec<SpringColliderGroup>,
    /// The springs.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub springs: Vec<SpringChain>,
}

impl Default for SpringBones {
    fn default() -> Self {
        Self {
            spec_version: SPEC_VERSION.to_owned(),
            colliders: Vec::new(),
            collider_groups: Vec::new(),
            springs: Vec::new(),
        }
    }
}

/// Body that springs do not enter.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct SpringCollider {
    /// Node that carries the body.
    pub node: usize,
    /// Shape, in the node's space.
    pub shape: ColliderShape,
}

/// Shape of a collider.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
pub enum ColliderShape {
    /// A ball.
    Sphere {
        /// Middle.
        #[serde(default)]
        offset: Vec3,
        /// Radius.
        #[serde(default)]
        radius: f32,
    },
    /// All places near a segment.
    Capsule {
        /// Start of the segment.
        #[serde(default)]
        offset: Vec3,
        /// Radius.
        #[serde(default)]
        radius: f32,
        /// End of the segment.
        #[serde(default)]
        tail: Vec3,
    },
}

/// Group of colliders.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SpringColliderGroup {
    /// Name.
    #[serde(default)]
    pub name: String,
    /// Places of the colliders in [`SpringBones::colliders`].
    pub colliders: Vec<usize>,
}

/// Chain of joints that swing, each an ancestor of the next; the last one only ends the bone before it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct SpringChain {
    /// Name.
    #[serde(default)]
    pub name: String,
    /// The joints.
    pub joints: Vec<SpringJoint>,
    /// Places of the groups of colliders that the chain does not enter.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub collider_groups: Vec<usize>,
    /// Node whose movements the chain does not feel; `None` for a chain that feels all.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub center: Option<usize>,
}

/// Joint of a spring.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct SpringJoint {
    /// The node.
    pub node: usize,
    /// Radius of the end of the joint's bone, for colliders.
    #[serde(default)]
    pub hit_radius: f32,
    /// Strength with which the bone returns to its rest.
    #[serde(default = "one")]
    pub stiffness: f32,
    /// Strength of gravity.
    #[serde(default)]
    pub gravity_power: f32,
    /// Direction of gravity.
    #[serde(default = "down")]
    pub gravity_dir: Vec3,
    /// Share of the movement that is lost from one sixtieth of a second to the next, 0 to 1.
    #[serde(default = "half")]
    pub drag_force: f32,
}

impl SpringJoint {
    /// Joint that only ends the bone before it.
    pub fn end(node: usize) -> Self {
        Self { node, hit_radius: 0.0, stiffness: 0.0, gravity_power: 0.0, gravity_dir: Vec3::NEG_Y, drag_force: 0.0 }
    }
}

/// Extension `VRMC_node_constraint` of a node: its rotation follows that of another one.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct NodeConstraint {
    /// Version of the extension.
    pub spec_version: String,
    /// Kind and source.
    pub constraint: ConstraintKind,
}

/// Kind of a constraint, with the node that is followed.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
pub enum ConstraintKind {
    /// The part of the source's rotation about an axis.
    Roll {
        /// The node that is followed.
        source: usize,
        /// The axis, of the node that follows.
        #[serde(rename = "rollAxis")]
        roll_axis: RollAxis,
        /// Share of the rotation, 0 to 1.
        #[serde(default = "one")]
        weight: f32,
    },
    /// The source's rotation, in its own axes.
    Rotation {
        /// The node that is followed.
        source: usize,
        /// Share of the rotation, 0 to 1.
        #[serde(default = "one")]
        weight: f32,
    },
}

/// Axis of a roll.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum RollAxis {
    /// X axis.
    X,
    /// Y axis.
    Y,
    /// Z axis.
    Z,
}

// Values that a file may leave out.

fn one() -> f32 {
    1.0
}

fn half() -> f32 {
    0.5
}

fn down() -> Vec3 {
    Vec3::NEG_Y
}
