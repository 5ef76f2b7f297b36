//! Nodes of a posed rig, as entities and as the program computes them, and their form in JSON.

use bevy::prelude::*;
use serde::{Serialize, Serializer};
use serde_json::Value;

use crate::rig::{BuiltNode, NodeType, Uid};

/// A node with its entity's transform and the program's transform, both in the rig's space.
#[derive(Debug, Clone, PartialEq)]
pub struct PosedNode {
    /// The node.
    pub node: BuiltNode,
    /// Uid of the node's parent; `None` below the rig.
    pub parent: Option<Uid>,
    /// Transform of the entity, in the rig's space.
    pub entity: Transform,
    /// Transform that the program computes, in the rig's space.
    pub program: Transform,
}

impl PosedNode {
    /// The node as a JSON object: `name`, `label`, `uid`, `kind`, `parent`, `position`, `rotation`, `scale`,
    /// `program_position`, `program_rotation`, `deform`.
    pub fn json(&self) -> Value {
        serde_json::to_value(self).unwrap_or(Value::Null)
    }
}

/// Form of a [`PosedNode`] in JSON. Numbers are doubles, as all of a JSON value are.
#[derive(Serialize)]
struct PosedNodeFields<'n> {
    name: &'n str,
    label: Option<&'n str>,
    uid: String,
    kind: &'static str,
    parent: Option<String>,
    position: [f64; 3],
    rotation: [f64; 4],
    scale: [f64; 3],
    program_position: [f64; 3],
    program_rotation: [f64; 4],
    deform: bool,
}

impl Serialize for PosedNode {
    /// The fields that [`PosedNode::json`] lists.
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let Self { node, parent, entity, program } = self;
        let kind = match node.kind {
            NodeType::Joint => "joint",
            NodeType::Null => "null",
            NodeType::Control => "control",
        };
        let fields = PosedNodeFields {
            name: &node.name,
            label: node.label.as_deref(),
            uid: node.uid.to_string(),
            kind,
            parent: parent.map(|parent| parent.to_string()),
            position: entity.translation.to_array().map(f64::from),
            rotation: entity.rotation.to_array().map(f64::from),
            scale: entity.scale.to_array().map(f64::from),
            program_position: program.translation.to_array().map(f64::from),
            program_rotation: program.rotation.to_array().map(f64::from),
            deform: node.kind == NodeType::Joint,
        };
        fields.serialize(serializer)
    }
}
