//! A built rig as plain data: what commands have made of a document, in the form that the runtime, exporters and
//! readers of the result take.

use std::{collections::HashMap, sync::Arc};

use serde::{Deserialize, Serialize};

use super::{Constraint, Uid};
use crate::mesh::model::Trs;

/// The nodes and constraints of a built rig. Everything is in the rig's space or relative to a parent in it.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct BuiltRig {
    /// Joints of the document and nodes that commands created: parents before children.
    pub nodes: Vec<BuiltNode>,
    /// What drives them, in the order of creation: constraints on one node run in this order.
    pub constraints: Vec<BuiltConstraint>,
    /// Switches that can be thrown without a jump.
    pub switches: Vec<Arc<SwitchData>>,
}

/// A switch between two ways of moving the same nodes, with what is needed to throw it without a jump: see
/// `solve::matching`.
#[derive(Debug, Clone, PartialEq)]
pub struct SwitchData {
    /// The command tag that made it.
    pub command: Uid,
    /// The node that carries the attribute.
    pub control: Uid,
    /// The attribute that is switched.
    pub attribute: Arc<str>,
    /// What is matched.
    pub matching: Matching,
}

/// What stays in place while a switch is thrown.
#[derive(Debug, Clone, PartialEq)]
pub enum Matching {
    /// A limb between forward (0) and inverse (1) kinematics.
    IkFk {
        /// Joints of the limb from the root to the end.
        joints: Vec<Uid>,
        /// The forward control of each joint, in the same order.
        fk: Vec<Uid>,
        /// The goal of the inverse kinematics.
        goal: Uid,
        /// Where the end stands in the goal's space.
        goal_offset: Trs,
        /// The pole, if there is one.
        pole: Option<Uid>,
    },
    /// A control between several spaces: it stays where it is.
    Space {
        /// The control that must not move.
        control: Uid,
    },
}

/// One node of a built rig.
#[derive(Debug, Clone, PartialEq)]
pub struct BuiltNode {
    /// Identity: a joint's own uid, or one that follows from the command, the role and the subject.
    pub uid: Uid,
    /// The name in files and lists; need not be unique.
    pub name: Arc<str>,
    /// What it is.
    pub kind: NodeType,
    /// Index of the parent in [`BuiltRig::nodes`], smaller than the node's own; `None` below the rig itself.
    pub parent: Option<usize>,
    /// Where it stands relative to its parent before any pose: the built base.
    pub base: Trs,
    /// The label that references find it by.
    pub label: Option<Arc<str>>,
    /// The local group.
    pub group: Option<Uid>,
    /// Who made it; `None` for joints of the document.
    pub origin: Option<Arc<Origin>>,
    /// How it is drawn and moved, if people move it.
    pub control: Option<Arc<ControlData>>,
    /// The layer it is shown in.
    pub layer: Option<Arc<LayerData>>,
    /// Named values, in order.
    pub attributes: Arc<[Attribute]>,
}

/// Which command made a node, and what for.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub struct Origin {
    /// The command tag.
    pub command: Uid,
    /// The module of the command.
    pub module: Arc<str>,
    /// What the module says the node is for.
    pub role: Arc<str>,
    /// The node that it was made for.
    pub subject: Uid,
    /// Which of several for the same purpose.
    pub number: u32,
}

/// A constraint and the identity that its command gave it.
#[derive(Debug, Clone, PartialEq)]
pub struct BuiltConstraint {
    /// Identity.
    pub uid: Uid,
    /// The command tag that made it.
    pub command: Uid,
    /// What it does.
    pub constraint: Arc<Constraint>,
}

/// What a node of a built rig is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Default, Serialize, Deserialize)]
pub enum NodeType {
    /// Moves the mesh.
    #[default]
    Joint,
    /// Carries other nodes; nobody moves it by hand.
    Null,
    /// Moved by people and by animation.
    Control,
}

/// How a control looks and what of it can be moved.
#[derive(Debug, Clone, PartialEq)]
pub struct ControlData {
    /// The shape's name in the library of wire shapes.
    pub shape: String,
    /// sRGB colour, 0 to 1 each.
    pub color: [f32; 3],
    /// The shape's size in the rig's units: half of its width.
    pub size: f32,
    /// Where the shape is drawn, relative to the control.
    pub offset: Trs,
    /// Which channels people move and keys are set on.
    pub channels: Channels,
    /// How far each channel goes; see [`Limits`].
    pub limits: Limits,
}

/// Which of the nine transform channels are free: translation, rotation and scale, each along X, Y and Z.
#[derive(bevy::reflect::Reflect, Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Channels {
    /// Translation.
    pub translate: [bool; 3],
    /// Rotation.
    pub rotate: [bool; 3],
    /// Scale.
    pub scale: [bool; 3],
}

impl Default for Channels {
    fn default() -> Self {
        Self { translate: [true; 3], rotate: [true; 3], scale: [true; 3] }
    }
}

/// Lowest and highest values of a pose offset's channels; `None` where there is no end.
///
/// Translation in units of the node's parent, rotation in degrees as angles about X, Y and Z in that order, scale as
/// factors.
#[derive(bevy::reflect::Reflect, Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Limits {
    /// Translation along X, Y and Z.
    pub translate: [(Option<f32>, Option<f32>); 3],
    /// Rotation about X, Y and Z in degrees.
    pub rotate: [(Option<f32>, Option<f32>); 3],
    /// Scale along X, Y and Z.
    pub scale: [(Option<f32>, Option<f32>); 3],
}

impl Limits {
    /// The same ends on the other side of the character: translation along X and turns about Y and Z the other way
    /// round.
    pub fn mirrored(mut self) -> Self {
        let over = |ends: &mut (Option<f32>, Option<f32>)| {
            *ends = (ends.1.map(|end| -end), ends.0.map(|end| -end));
        };
        over(&mut self.translate[0]);
        over(&mut self.rotate[1]);
        over(&mut self.rotate[2]);
        self
    }
}

/// A named set of nodes that are shown together.
#[derive(Debug, Clone, PartialEq)]
pub struct LayerData {
    /// The layer's name.
    pub name: String,
    /// Hidden if false.
    pub visible: bool,
    /// How its nodes are shown.
    pub display: LayerDisplay,
    /// sRGB colour that replaces the nodes' own.
    pub color: Option<[f32; 3]>,
}

/// How the nodes of a layer are shown.
#[derive(bevy::reflect::Reflect, Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum LayerDisplay {
    /// As they are.
    #[default]
    Normal,
    /// Grey lines that cannot be picked.
    Template,
    /// As they are, but not to be picked.
    Reference,
}

/// A named value on a node, for people and animation to set and for constraints to read.
#[derive(Debug, Clone, PartialEq)]
pub struct Attribute {
    /// The name, unique on its node.
    pub name: Arc<str>,
    /// Numbers or choices.
    pub kind: AttributeKind,
    /// The value until somebody sets another; for choices, the number of the choice.
    pub default: f32,
}

impl Attribute {
    /// The nearest value that the attribute can have.
    pub fn clamp(&self, value: f32) -> f32 {
        self.kind.clamp(value, self.default)
    }
}

/// What values an attribute has.
#[derive(Debug, Clone, PartialEq)]
pub enum AttributeKind {
    /// A number between two ends, each of which may be open.
    Number {
        /// The lowest value.
        min: Option<f32>,
        /// The highest value.
        max: Option<f32>,
    },
    /// One of several names; the value is its number, and values between two blend.
    Choice(Vec<String>),
}

impl AttributeKind {
    /// The nearest value of that kind; `otherwise` for what is not finite.
    pub fn clamp(&self, value: f32, otherwise: f32) -> f32 {
        let value = if value.is_finite() { value } else { otherwise };
        match self {
            Self::Number { min, max } => {
                let value = min.map_or(value, |min| value.max(min));
                max.map_or(value, |max| value.min(max))
            }
            Self::Choice(names) => value.clamp(0.0, names.len().saturating_sub(1) as f32),
        }
    }
}

impl BuiltRig {
    /// Index of every node by uid.
    pub fn index(&self) -> HashMap<Uid, usize> {
        self.nodes.iter().enumerate().map(|(at, node)| (node.uid, at)).collect()
    }

    /// The node with that uid.
    pub fn node(&self, uid: Uid) -> Option<&BuiltNode> {
        self.nodes.iter().find(|node| node.uid == uid)
    }

    /// The first node with that label.
    pub fn find_label(&self, label: &str) -> Option<&BuiltNode> {
        self.nodes.iter().find(|node| node.label.as_deref() == Some(label))
    }

    /// The node that a command made for a purpose.
    pub fn find_role(&self, command: Uid, role: &str) -> impl Iterator<Item = &BuiltNode> {
        self.nodes.iter().filter(move |node| {
            node.origin.as_ref().is_some_and(|origin| origin.command == command && *origin.role == *role)
        })
    }
}
