//! Avatars in VRM 1.0: the content of its extensions as plain data.
//!
//! The types have the form that the extensions `VRMC_vrm`, `VRMC_springBone` and `VRMC_node_constraint` have in a file. In
//! memory their indices are those of a [`Model`](super::model::Model): places in its nodes, or in its objects for morph
//! targets. In a file they are glTF nodes. Sections cited in the code are those of the VRM specification (VRM Consortium,
//! version 1.0).

mod meta;
mod springs;

use std::collections::BTreeMap;

use glam::Vec3;
use serde::{Deserialize, Serialize};

pub use self::{
    meta::{AvatarPermission, CommercialUsage, CreditNotation, ModificationPermission, VrmMeta},
    springs::{
        ColliderShape, ConstraintKind, NodeConstraint, RollAxis, SpringBones, SpringChain, SpringCollider,
        SpringColliderGroup, SpringJoint,
    },
};

/// Version of all three extensions.
pub const SPEC_VERSION: &str = "1.0";

/// Address of the licence document that version 1.0 allows.
pub const LICENSE_URL: &str = "https://vrm.dev/licenses/1.0/";

/// Bones that every avatar has.
pub const REQUIRED_BONES: [&str; 15] = [
    "hips",
    "spine",
    "head",
    "leftUpperLeg",
    "leftLowerLeg",
    "leftFoot",
    "rightUpperLeg",
    "rightLowerLeg",
    "rightFoot",
    "leftUpperArm",
    "leftLowerArm",
    "leftHand",
    "rightUpperArm",
    "rightLowerArm",
    "rightHand",
];

/// Expressions that have a meaning for every program.
pub const PRESET_EXPRESSIONS: [&str; 18] = [
    "happy",
    "angry",
    "sad",
    "relaxed",
    "surprised",
    "aa",
    "ih",
    "ou",
    "ee",
    "oh",
    "blink",
    "blinkLeft",
    "blinkRight",
    "lookUp",
    "lookDown",
    "lookLeft",
    "lookRight",
    "neutral",
];

/// Avatar: all that VRM adds to a model.
#[derive(Debug, Clone, PartialEq)]
pub struct Avatar {
    /// The figure.
    pub vrm: Vrm,
    /// Springs of hair, cloth and the like; the extension is left out without any.
    pub springs: SpringBones,
    /// Constraints by the node that each turns.
    pub constraints: BTreeMap<usize, NodeConstraint>,
}

/// Extension `VRMC_vrm`: the figure.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct Vrm {
    /// Version of the extension.
    pub spec_version: String,
    /// Name, authors and licence.
    pub meta: VrmMeta,
    /// Bones of the human.
    pub humanoid: Humanoid,
    /// Expressions of the face.
    #[serde(default, skip_serializing_if = "Expressions::is_empty")]
    pub expressions: Expressions,
    /// Movement of the eyes; `None` if they do not move.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub look_at: Option<LookAt>,
}

/// Bones of a human.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct Humanoid {
    /// Bones by their names in VRM, such as `leftUpperArm`.
    pub human_bones: BTreeMap<String, HumanBoneNode>,
}

/// Node that is a bone.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct HumanBoneNode {
    /// The node.
    pub node: usize,
}

/// Expressions of a face, by name.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct Expressions {
    /// Expressions of [`PRESET_EXPRESSIONS`].
    pub preset: BTreeMap<String, AvatarExpression>,
    /// Expressions with names of the author's own.
    pub custom: BTreeMap<String, AvatarExpression>,
}

impl Expressions {
    /// Returns `true` without expressions.
    pub fn is_empty(&self) -> bool {
        self.preset.is_empty() && self.custom.is_empty()
    }
}

/// Expression of an avatar's face: morph targets with weights.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(rename_all = "camelCase", default)]
pub struct AvatarExpression {
    /// Morph targets that make the expression.
    pub morph_target_binds: Vec<MorphTargetBind>,
    /// True if there is nothing between 0 and 1.
    pub is_binary: bool,
    /// Effect on blinking.
    pub override_blink: ExpressionOverride,
    /// Effect on the gaze.
    pub override_look_at: ExpressionOverride,
    /// Effect on the mouth's movements of speech.
    pub override_mouth: ExpressionOverride,
}

/// Morph target of an expression.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct MorphTargetBind {
    /// Object of the model, or node of the file, with the morph target.
    pub node: usize,
    /// Number of the morph target.
    pub index: usize,
    /// Weight at the expression's full strength, 0 to 1.
    pub weight: f32,
}

/// Effect of an expression on movements that a program makes by itself.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
pub enum ExpressionOverride {
    /// No effect.
    #[default]
    None,
    /// Movements stop.
    Block,
    /// Movements are weaker, the stronger the expression is.
    Blend,
}

/// Movement of an avatar's eyes.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(rename_all = "camelCase", default)]
pub struct LookAt {
    /// Middle of the eyes in the space of the head's node.
    pub offset_from_head_bone: Vec3,
    /// Means of movement.
    #[serde(rename = "type")]
    pub kind: LookAtKind,
    /// Range towards the nose.
    pub range_map_horizontal_inner: RangeMap,
    /// Range away from the nose; both ways for expressions.
    pub range_map_horizontal_outer: RangeMap,
    /// Range downwards.
    pub range_map_vertical_down: RangeMap,
    /// Range upwards.
    pub range_map_vertical_up: RangeMap,
}

/// Means by which eyes move.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
pub enum LookAtKind {
    /// Bones of the eyes turn.
    #[default]
    Bone,
    /// Expressions `lookUp`, `lookDown`, `lookLeft` and `lookRight`.
    Expression,
}

/// Range of a movement of the eyes: proportional up to its end, and constant beyond.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(rename_all = "camelCase", default)]
pub struct RangeMap {
    /// Angle between gaze and head in degrees at which the movement is full.
    pub input_max_value: f32,
    /// Full movement: degrees for bones, a weight for expressions.
    pub output_scale: f32,
}

impl Avatar {
    /// The avatar with other indices: those of a file in place of those of a model. Binds of objects that have none are left
    /// out; `None` if any other node has none.
    pub fn renumbered(
        &self,
        node: &dyn Fn(usize) -> Option<usize>,
        object: &dyn Fn(usize) -> Option<usize>,
    ) -> Option<Self> {
        let mut avatar = self.clone();
        for bone in avatar.vrm.humanoid.human_bones.values_mut() {
            bone.node = node(bone.node)?;
        }
        let Expressions { preset, custom } = &mut avatar.vrm.expressions;
        for expression in preset.values_mut().chain(custom.values_mut()) {
            let bind = |bind: &MorphTargetBind| Some(MorphTargetBind { node: object(bind.node)?, ..*bind });
            expression.morph_target_binds = expression.morph_target_binds.iter().filter_map(bind).collect();
        }
        for collider in &mut avatar.springs.colliders {
            collider.node = node(collider.node)?;
        }
        for chain in &mut avatar.springs.springs {
            if let Some(center) = &mut chain.center {
                *center = node(*center)?;
            }
            for joint in &mut chain.joints {
                joint.node = node(joint.node)?;
            }
        }
        avatar.constraints.clear();
        for (at, constraint) in &self.constraints {
            let mut constraint = constraint.clone();
            match &mut constraint.constraint {
                ConstraintKind::Roll { source, .. } | ConstraintKind::Rotation { source, .. } => {
                    *source = node(*source)?;
                }
            }
            avatar.constraints.insert(node(*at)?, constraint);
        }
        Some(avatar)
    }
}
