//! A built rig as plain data: the result of a document's commands, for the runtime, exporters and other readers.

use std::{collections::HashMap, sync::Arc};

use serde::{Deserialize, Serialize};

use super::{Constraint, Uid, mix};
use crate::mesh::model::Trs;

/// Nodes, constraints and switches of a built rig. Transforms are in the rig's space or relative to a parent.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct BuiltRig {
    /// Joints of the document and nodes that commands created: parents before children.
    pub nodes: Vec<BuiltNode>,
    /// Constraints that drive the nodes, in the order of creation: constraints on one node run in this order.
    pub constraints: Vec<BuiltConstraint>,
    /// Switches with matching: a matched change of a switch leaves the nodes of a limb or space in their places.
    pub switches: Vec<Arc<SwitchData>>,
    /// Declared inputs, outside of the rig.
    pub inputs: Vec<BuiltInput>,
}

/// A declared input of a built rig.
#[derive(Debug, Clone, PartialEq)]
pub struct BuiltInput {
    /// Uid by which constraints refer to it.
    pub uid: Uid,
    /// Name by which apps find it.
    pub name: Arc<str>,
    /// Transform in the rig's space until it is set.
    pub rest: Trs,
}

/// Switch between two ways of moving the same nodes, with the data that keeps the nodes in place when it is set: see
/// `solve::matching`.
#[derive(Debug, Clone, PartialEq)]
pub struct SwitchData {
    /// Uid of the command tag that made the switch.
    pub command: Uid,
    /// Uid of the node that carries the attribute.
    pub control: Uid,
    /// Name of the attribute that is switched.
    pub attribute: Arc<str>,
    /// Nodes to match.
    pub matching: Matching,
}

/// Nodes that stay in place when a switch is set.
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
        /// Transform of the end in the goal's space.
        goal_offset: Trs,
        /// The pole, if there is one.
        pole: Option<Uid>,
        /// Controls above the limb that the switch would move, such as that of a shoulder which turns with the goal.
        held: Vec<Uid>,
    },
    /// A control between several spaces, which stays in place.
    Space {
        /// The control that must not move.
        control: Uid,
    },
}

/// A node of a built rig.
#[derive(Debug, Clone)]
pub struct BuiltNode {
    /// Uid of the node: a joint's own, or one that follows from the command, the role and the subject.
    pub uid: Uid,
    /// The name in files and lists; need not be unique.
    pub name: Arc<str>,
    /// Kind of the node.
    pub kind: NodeType,
    /// Index of the parent in [`BuiltRig::nodes`], smaller than the node's own; `None` below the rig itself.
    pub parent: Option<usize>,
    /// Transform relative to the parent without any pose: the built base.
    pub base: Trs,
    /// Label by which references find the node.
    pub label: Option<Arc<str>>,
    /// The local group.
    pub group: Option<Uid>,
    /// Command that made the node; `None` for joints of the document.
    pub origin: Option<Arc<Origin>>,
    /// Appearance and free channels; `None` if people do not move the node.
    pub control: Option<Arc<ControlData>>,
    /// Layer in which the node is shown.
    pub layer: Option<Arc<LayerData>>,
    /// Attributes of the node, in order.
    pub attributes: Arc<[Attribute]>,
}

/// Command that made a node, with the node's purpose.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub struct Origin {
    /// The command tag.
    pub command: Uid,
    /// The module of the command.
    pub module: Arc<str>,
    /// Purpose of the node, named by the module.
    pub role: Arc<str>,
    /// Uid of the node for which this node was made.
    pub subject: Uid,
    /// Number of the node among those with the same command, role and subject.
    pub number: u32,
}

impl Origin {
    /// Uid of the node: the same for the same command, role, subject and number.
    pub fn uid(&self) -> Uid {
        created_uid(self.command, &self.role, self.subject, self.number)
    }
}

/// The identity of a created node: the same for the same command, role, subject and number.
pub(crate) fn created_uid(command: Uid, role: &str, subject: Uid, number: u32) -> Uid {
    let mut hash = mix(command.0 ^ 0x5249_4753_4d49_5448);
    for byte in role.bytes() {
        hash = mix(hash ^ u64::from(byte));
    }
    hash = mix(hash ^ subject.0);
    hash = mix(hash ^ u64::from(number));
    Uid(hash.max(1))
}

/// A constraint with its identity.
#[derive(Debug, Clone)]
pub struct BuiltConstraint {
    /// Uid of the constraint.
    pub uid: Uid,
    /// Uid of the command tag that made the constraint.
    pub command: Uid,
    /// Kind and parameters.
    pub constraint: Arc<Constraint>,
}

/// Kind of a node of a built rig.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Default, Serialize, Deserialize)]
pub enum NodeType {
    /// A joint, which moves the mesh.
    #[default]
    Joint,
    /// A node that carries others and is not moved by hand.
    Null,
    /// A control, moved by people and by animation.
    Control,
}

/// Name of the attribute of visibility: a node whose value is below one half is neither drawn nor picked.
pub const VISIBLE: &str = "visible";

/// Appearance of a control and its free channels.
#[derive(bevy::reflect::Reflect, Debug, Clone, PartialEq)]
pub struct ControlData {
    /// Name of the shape in the library of wire shapes.
    pub shape: String,
    /// sRGB colour, 0 to 1 each.
    pub color: [f32; 3],
    /// Size of the shape in the rig's units: half of its width.
    pub size: f32,
    /// Transform of the shape relative to the control.
    pub offset: Trs,
    /// True if the shape may be drawn larger than its size, so that it does not touch the flesh of a mesh; false for one that has
    /// its size unless most of it would lie in the flesh.
    pub fits: bool,
    /// Channels that people move and set keys on.
    pub channels: Channels,
    /// Range of each channel; see [`Limits`].
    pub limits: Limits,
}

/// Free channels of the nine transform channels: translation, rotation and scale, each along X, Y and Z.
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

/// Lowest and highest values of a pose offset's channels; `None` for an open end.
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
    /// The limits with lengths multiplied by a factor.
    pub fn resized(mut self, factor: f32) -> Self {
        for (low, high) in &mut self.translate {
            (*low, *high) = (low.map(|end| end * factor), high.map(|end| end * factor));
        }
        self
    }

    /// The limits on the other side of the character: translation along X and rotations about Y and Z with swapped,
    /// negated ends.
    pub fn mirrored(mut self) -> Self {
        let over = |ends: &mut (Option<f32>, Option<f32>)| {
            *ends = (ends.1.map(|end| 0.0 - end), ends.0.map(|end| 0.0 - end));
        };
        over(&mut self.translate[0]);
        over(&mut self.rotate[1]);
        over(&mut self.rotate[2]);
        self
    }
}

/// A named set of nodes that are shown together.
#[derive(bevy::reflect::Reflect, Debug, Clone, PartialEq)]
pub struct LayerData {
    /// The layer's name.
    pub name: String,
    /// Visibility of the layer.
    pub visible: bool,
    /// Display of the layer's nodes.
    pub display: LayerDisplay,
    /// sRGB colour that replaces the nodes' own.
    pub color: Option<[f32; 3]>,
}

/// Display of the nodes of a layer.
#[derive(bevy::reflect::Reflect, Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum LayerDisplay {
    /// Normal lines.
    #[default]
    Normal,
    /// Grey lines that cannot be picked.
    Template,
    /// Normal lines that cannot be picked.
    Reference,
}

/// A named value on a node, set by people and animation and read by constraints.
#[derive(Debug, Clone, PartialEq)]
pub struct Attribute {
    /// The name, unique on its node.
    pub name: Arc<str>,
    /// Kind of the values: a number or a choice.
    pub kind: AttributeKind,
    /// The value until another is set; for choices, the number of the choice.
    pub default: f32,
}

impl Attribute {
    /// The nearest allowed value.
    pub fn clamp(&self, value: f32) -> f32 {
        self.kind.clamp(value, self.default)
    }
}

/// Kind of an attribute's values.
#[derive(Debug, Clone, PartialEq)]
pub enum AttributeKind {
    /// A number between two ends, each of which may be open.
    Number {
        /// The lowest value.
        min: Option<f32>,
        /// The highest value.
        max: Option<f32>,
    },
    /// A choice of several names; the value is the number of the name, and values between two blend.
    Choice(Vec<String>),
}

impl AttributeKind {
    /// The nearest allowed value; `otherwise` replaces a value that is not finite.
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

/// Equality of shared data; data that is the same in memory needs no comparison.
fn is_same<T: PartialEq + ?Sized>(a: &Arc<T>, b: &Arc<T>) -> bool {
    Arc::ptr_eq(a, b) || a == b
}

fn is_same_option<T: PartialEq + ?Sized>(a: &Option<Arc<T>>, b: &Option<Arc<T>>) -> bool {
    match (a, b) {
        (Some(a), Some(b)) => is_same(a, b),
        (None, None) => true,
        _ => false,
    }
}

impl PartialEq for BuiltNode {
    fn eq(&self, other: &Self) -> bool {
        let Self { uid, name, kind, parent, base, label, group, origin, control, layer, attributes } = self;
        (uid, kind, parent, base, group) == (&other.uid, &other.kind, &other.parent, &other.base, &other.group)
            && is_same(name, &other.name)
            && is_same_option(label, &other.label)
            && is_same_option(origin, &other.origin)
            && is_same_option(control, &other.control)
            && is_same_option(layer, &other.layer)
            && is_same(attributes, &other.attributes)
    }
}

impl PartialEq for BuiltConstraint {
    fn eq(&self, other: &Self) -> bool {
        let Self { uid, command, constraint } = self;
        (uid, command) == (&other.uid, &other.command) && is_same(constraint, &other.constraint)
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

    /// The nodes that a command made for a purpose.
    pub fn find_role(&self, command: Uid, role: &str) -> impl Iterator<Item = &BuiltNode> {
        self.nodes.iter().filter(move |node| {
            node.origin.as_ref().is_some_and(|origin| origin.command == command && *origin.role == *role)
        })
    }
}
