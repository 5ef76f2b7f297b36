//! Constraints as data: what moves a node besides its parent and its pose.
//!
//! Several constraints on one node run in the order of their creation; each takes what the ones before it left. Where a
//! constraint reads another node, it reads where that node ends up in the same frame.

use std::sync::Arc;

use glam::{Quat, Vec3};
use serde::{Deserialize, Serialize};

use super::{Limits, Uid};
use crate::mesh::model::Trs;

/// A number that is fixed or follows an attribute in every frame.
#[derive(Debug, Clone, PartialEq)]
pub enum Scalar {
    /// Always the same.
    Value(f32),
    /// `factor` times the value of an attribute, plus `add`.
    Attribute {
        /// The node that has the attribute.
        node: Uid,
        /// The attribute's name.
        name: Arc<str>,
        /// What the value is multiplied with.
        factor: f32,
        /// What is added.
        add: f32,
    },
    /// 1 where an attribute is `value`, falling to 0 at a distance of 1: the weight of one choice of several.
    Choice {
        /// The node that has the attribute.
        node: Uid,
        /// The attribute's name.
        name: Arc<str>,
        /// The choice.
        value: f32,
    },
    /// A channel of a node's pose offset: what a person or an animation did to it.
    Channel {
        /// The node.
        node: Uid,
        /// Which number of its offset: translation in units, rotation in degrees, scale as a factor.
        channel: Channel,
    },
}

impl Scalar {
    /// An attribute as it is.
    pub fn attribute(node: Uid, name: impl Into<Arc<str>>) -> Self {
        Self::Attribute { node, name: name.into(), factor: 1.0, add: 0.0 }
    }

    /// One minus an attribute.
    pub fn inverse(node: Uid, name: impl Into<Arc<str>>) -> Self {
        Self::Attribute { node, name: name.into(), factor: -1.0, add: 1.0 }
    }

    /// The node it reads, if it reads one.
    pub fn node(&self) -> Option<Uid> {
        match self {
            Self::Value(_) => None,
            Self::Attribute { node, .. } | Self::Choice { node, .. } | Self::Channel { node, .. } => Some(*node),
        }
    }
}

impl Default for Scalar {
    fn default() -> Self {
        Self::Value(1.0)
    }
}

/// One number of a transform.
#[derive(bevy::reflect::Reflect, Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum Channel {
    /// Translation along X.
    TranslateX,
    /// Translation along Y.
    TranslateY,
    /// Translation along Z.
    TranslateZ,
    /// Rotation about X in degrees (angles about X, Y and Z in that order).
    RotateX,
    /// Rotation about Y in degrees.
    RotateY,
    /// Rotation about Z in degrees.
    RotateZ,
    /// Factor along X.
    ScaleX,
    /// Factor along Y.
    ScaleY,
    /// Factor along Z.
    ScaleZ,
}

impl Channel {
    /// True if the same number on the other side of a character is not the mirrored pose, but its negative is: joints of
    /// pairs have mirrored axes, X turned over.
    pub fn is_turned_over(self) -> bool {
        matches!(self, Self::TranslateX | Self::RotateY | Self::RotateZ)
    }
}

/// Something that a node follows.
#[derive(Debug, Clone, PartialEq)]
pub struct Target {
    /// The node that is followed.
    pub node: Uid,
    /// Its share; shares of all targets are divided by their sum. Below zero counts as zero.
    pub weight: Scalar,
    /// Where the driven node stands in the target's space: kept offset. Identity to lie on the target.
    pub offset: Trs,
}

/// Where the up axis of an aim points.
#[derive(Debug, Clone, PartialEq)]
pub enum AimUp {
    /// A direction in the rig's space.
    Direction(Vec3),
    /// Towards a node.
    Node(Uid),
    /// A direction in the space of a node.
    Axis(Uid, Vec3),
}

/// Lowest and highest angles of one joint of a chain, in degrees about X, Y and Z in that order, relative to its base.
pub type AngleLimits = [(Option<f32>, Option<f32>); 3];

/// How a chain of more than two bones reaches its goal.
#[derive(Debug, Clone, PartialEq)]
pub enum ChainSolver {
    /// Forward and backward reaching.
    Fabrik,
    /// Cyclic coordinate descent; limits in the order of the chain's joints (may be shorter).
    Ccd(Vec<AngleLimits>),
}

/// What a driven number goes to.
#[derive(Debug, Clone, PartialEq)]
pub enum Output {
    /// A number of a node's transform, added to its base (factors are multiplied).
    Channel(Uid, Channel),
    /// An attribute of a node.
    Attribute(Uid, Arc<str>),
    /// The weight of a morph target, by name, on every mesh of the rig that has it.
    Morph(Arc<str>),
}

/// How a driven key runs between its keys.
#[derive(bevy::reflect::Reflect, Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub enum KeyEase {
    /// The value of the key before.
    Step,
    /// A straight line.
    Linear,
    /// Smooth, without overshoot.
    #[default]
    Smooth,
}

/// What moves one or several nodes.
#[derive(Debug, Clone, PartialEq)]
pub enum Constraint {
    /// Follows weighted targets in the channels that are on: parent, point, orient and scale constraints, blends of two
    /// transforms, switches of spaces.
    Transform {
        /// The node.
        driven: Uid,
        /// What it follows, in order.
        targets: Vec<Target>,
        /// Which axes of the translation follow (the driven node's parent's axes).
        translate: [bool; 3],
        /// Which angles follow (about X, Y and Z in that order, in the driven node's parent's space).
        rotate: [bool; 3],
        /// Which factors follow.
        scale: [bool; 3],
        /// 0 leaves the node as it is, 1 follows.
        weight: Scalar,
        /// True to follow with the pose offset of the driven node on top, so that it can still be moved by hand.
        keep_pose: bool,
    },
    /// Stands to its parent as one node stands to another: a joint of a limb that follows its control, and can still be
    /// driven together with the joints above it, on whose place the other two do not depend.
    Relative {
        /// The node.
        driven: Uid,
        /// The node that it follows.
        source: Uid,
        /// The node that stands for the driven node's parent.
        space: Uid,
        /// The position follows.
        translate: bool,
        /// The rotation follows.
        rotate: bool,
        /// 0 leaves the node as it is, 1 follows.
        weight: Scalar,
    },
    /// Turns a node so that one of its axes points at weighted targets.
    Aim {
        /// The node.
        driven: Uid,
        /// What it looks at; offsets are not used.
        targets: Vec<Target>,
        /// The axis that points, in the node's space.
        aim: Vec3,
        /// The axis that is kept up, in the node's space.
        up: Vec3,
        /// Where up is.
        world_up: AimUp,
        /// Turned by this after aiming.
        offset: Quat,
        /// 0 leaves the node as it is, 1 aims.
        weight: Scalar,
    },
    /// Two bones that reach for a goal.
    TwoBone {
        /// First joint (shoulder, hip).
        root: Uid,
        /// Second joint (elbow, knee): a child of the first.
        mid: Uid,
        /// End (wrist, ankle): a child of the second.
        end: Uid,
        /// Where the end goes.
        goal: Uid,
        /// The side to which the second joint bends; without one it bends as it stands.
        pole: Option<Uid>,
        /// Direction in which a straight chain bends, in the space of the first joint.
        prefer: Vec3,
        /// 0 leaves the chain as it is, 1 reaches.
        weight: Scalar,
        /// Share of the length over which the chain eases into being straight, 0 to 1.
        soft: Scalar,
        /// 0 keeps lengths, 1 stretches to the goal.
        stretch: Scalar,
        /// Longest stretch as a factor.
        max_stretch: f32,
        /// Turn about the line from root to goal, in degrees.
        twist: Scalar,
        /// The end's rotation in the goal's space; `None` if the end keeps its own rotation.
        orient_end: Option<Quat>,
    },
    /// A chain of any length that reaches for a goal.
    Chain {
        /// Joints from the root to the end, each a child of the one before.
        joints: Vec<Uid>,
        /// Where the end goes.
        goal: Uid,
        /// The side to which a straight chain bends.
        pole: Option<Uid>,
        /// The method.
        solver: ChainSolver,
        /// Rounds, at most.
        iterations: u32,
        /// Distance from the goal that is near enough, as a share of the chain's length.
        tolerance: f32,
        /// 0 leaves the chain as it is, 1 reaches.
        weight: Scalar,
        /// The end's rotation in the goal's space; `None` if the end keeps its own rotation.
        orient_end: Option<Quat>,
    },
    /// A chain along a smooth curve through nodes.
    Spline {
        /// Joints from the first to the last, each a child of the one before.
        joints: Vec<Uid>,
        /// Nodes that the curve runs by, from start to end: two or more. The first and the last also give the twist.
        points: Vec<Uid>,
        /// 0 keeps lengths, 1 spreads the joints over the whole curve.
        stretch: Scalar,
        /// Twist along the chain in degrees, besides that of the first and last nodes.
        twist: Scalar,
        /// 0 leaves the chain as it is, 1 follows.
        weight: Scalar,
    },
    /// Shares of the twist of one node about an axis for others.
    Twist {
        /// The node whose twist is taken.
        source: Uid,
        /// The node against which the twist is measured; the parent of the source if `None`.
        reference: Option<Uid>,
        /// The axis along the bone, in the source's space.
        axis: Vec3,
        /// Nodes that turn about the same axis of theirs, with their share of the twist.
        driven: Vec<(Uid, Scalar)>,
    },
    /// Scales nodes by how far two others are apart.
    Stretch {
        /// From here,
        start: Uid,
        /// to here.
        end: Uid,
        /// The distance at which nothing is stretched, in the rig's units.
        rest: f32,
        /// The axis that stretches, in the driven nodes' space.
        axis: Vec3,
        /// 0 keeps the other two axes, 1 keeps the volume.
        volume: Scalar,
        /// The lowest and highest factor.
        range: (f32, f32),
        /// What is stretched.
        driven: Vec<Uid>,
        /// 0 is no stretch.
        weight: Scalar,
    },
    /// Keeps the transform of a node, relative to its base, between ends.
    Limit {
        /// The node.
        driven: Uid,
        /// The ends.
        limits: Limits,
    },
    /// A node that lags behind, swings and settles.
    Spring {
        /// The node.
        driven: Uid,
        /// Swings a second.
        frequency: Scalar,
        /// 0 swings for ever, 1 settles without swinging.
        damping: Scalar,
        /// 0 leaves the node as it is.
        weight: Scalar,
        /// Lag of the position.
        translate: bool,
        /// Lag of the direction in which the node's children lie.
        rotate: bool,
    },
    /// A number that follows another along keys.
    DrivenKey {
        /// The number that drives.
        driver: Scalar,
        /// Keys: (driver, value), driver increasing; flat before the first and after the last.
        keys: Vec<(f32, f32)>,
        /// The run between keys.
        ease: KeyEase,
        /// What is driven.
        output: Output,
    },
    /// A number that is calculated.
    Expression {
        /// Arithmetic over the names of the inputs.
        text: String,
        /// Names and what they stand for.
        inputs: Vec<(String, Scalar)>,
        /// What is driven.
        output: Output,
    },
    /// The pivots of a foot that rolls over heel, ball and toe.
    Foot {
        /// Nodes that turn about their own X axis: heel, toe tip and ball, each carrying the next.
        heel: Uid,
        /// The tip of the toes.
        toe: Uid,
        /// The ball.
        ball: Uid,
        /// Turns about Z to the inner and outer side; `None` if the foot does not bank.
        inner: Option<Uid>,
        /// The outer side.
        outer: Option<Uid>,
        /// Roll in degrees: below zero onto the heel, above zero onto the ball and then the toe.
        roll: Scalar,
        /// The angle in degrees at which the roll moves on from the ball to the toe.
        break_angle: Scalar,
        /// Bank in degrees.
        bank: Scalar,
        /// Lift of the toes in degrees, if a node carries them.
        toes: Option<(Uid, Scalar)>,
        /// Turn on the ball about Y in degrees.
        swivel: Scalar,
    },
}

/// Something that a constraint depends on or changes.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Dependency {
    /// Where a node ends up.
    Node(Uid),
    /// The value of an attribute.
    Attribute(Uid, Arc<str>),
}

impl Constraint {
    /// What it reads, besides the nodes that it drives and their parents; with repetitions.
    pub fn reads(&self) -> Vec<Dependency> {
        let mut reads = Vec::new();
        let scalar = |reads: &mut Vec<Dependency>, scalar: &Scalar| match scalar {
            Scalar::Attribute { node, name, .. } | Scalar::Choice { node, name, .. } => {
                reads.push(Dependency::Attribute(*node, name.clone()));
            }
            // A pose offset is an input: nothing in the rig changes it.
            Scalar::Value(_) | Scalar::Channel { .. } => {}
        };
        match self {
            Self::Transform { targets, weight, .. } | Self::Aim { targets, weight, .. } => {
                for target in targets {
                    reads.push(Dependency::Node(target.node));
                    scalar(&mut reads, &target.weight);
                }
                scalar(&mut reads, weight);
                if let Self::Aim { world_up: AimUp::Node(node) | AimUp::Axis(node, _), .. } = self {
                    reads.push(Dependency::Node(*node));
                }
            }
            Self::Relative { source, space, weight, .. } => {
                reads.extend([*source, *space].map(Dependency::Node));
                scalar(&mut reads, weight);
            }
            Self::TwoBone { goal, pole, weight, soft, stretch, twist, .. } => {
                reads.extend([Some(*goal), *pole].into_iter().flatten().map(Dependency::Node));
                [weight, soft, stretch, twist].into_iter().for_each(|number| scalar(&mut reads, number));
            }
            Self::Chain { goal, pole, weight, .. } => {
                reads.extend([Some(*goal), *pole].into_iter().flatten().map(Dependency::Node));
                scalar(&mut reads, weight);
            }
            Self::Spline { points, stretch, twist, weight, .. } => {
                reads.extend(points.iter().copied().map(Dependency::Node));
                [stretch, twist, weight].into_iter().for_each(|number| scalar(&mut reads, number));
            }
            Self::Twist { source, reference, driven, .. } => {
                reads.extend([Some(*source), *reference].into_iter().flatten().map(Dependency::Node));
                driven.iter().for_each(|(_, share)| scalar(&mut reads, share));
            }
            Self::Stretch { start, end, volume, weight, .. } => {
                reads.extend([*start, *end].map(Dependency::Node));
                [volume, weight].into_iter().for_each(|number| scalar(&mut reads, number));
            }
            Self::Limit { .. } => {}
            Self::Spring { frequency, damping, weight, .. } => {
                [frequency, damping, weight].into_iter().for_each(|number| scalar(&mut reads, number));
            }
            Self::DrivenKey { driver, .. } => scalar(&mut reads, driver),
            Self::Expression { inputs, .. } => inputs.iter().for_each(|(_, number)| scalar(&mut reads, number)),
            Self::Foot { roll, break_angle, bank, toes, swivel, .. } => {
                [roll, break_angle, bank, swivel].into_iter().for_each(|number| scalar(&mut reads, number));
                toes.iter().for_each(|(_, number)| scalar(&mut reads, number));
            }
        }
        reads
    }

    /// The nodes and attributes that it changes.
    pub fn drives(&self) -> Vec<Dependency> {
        let nodes = |nodes: &[Uid]| nodes.iter().copied().map(Dependency::Node).collect();
        match self {
            Self::Transform { driven, .. }
            | Self::Relative { driven, .. }
            | Self::Aim { driven, .. }
            | Self::Limit { driven, .. }
            | Self::Spring { driven, .. } => nodes(&[*driven]),
            Self::TwoBone { root, mid, end, .. } => nodes(&[*root, *mid, *end]),
            Self::Chain { joints, .. } | Self::Spline { joints, .. } => nodes(joints),
            Self::Twist { driven, .. } => driven.iter().map(|(node, _)| Dependency::Node(*node)).collect(),
            Self::Stretch { driven, .. } => nodes(driven),
            Self::DrivenKey { output, .. } | Self::Expression { output, .. } => match output {
                Output::Channel(node, _) => nodes(&[*node]),
                Output::Attribute(node, name) => vec![Dependency::Attribute(*node, name.clone())],
                Output::Morph(_) => Vec::new(),
            },
            Self::Foot { heel, toe, ball, inner, outer, toes, .. } => {
                let lifted = toes.as_ref().map(|(node, _)| *node);
                let all = [Some(*heel), Some(*toe), Some(*ball), *inner, *outer, lifted];
                all.into_iter().flatten().map(Dependency::Node).collect()
            }
        }
    }
}
