//! Constraints as data: movements of nodes that come neither from their parents nor from their poses.
//!
//! Several constraints on one node run in the order of their creation; each starts from the result of those before it.
//! A constraint reads the final transforms of other nodes in the same frame.

mod dependencies;

use std::sync::Arc;

use glam::{Quat, Vec3};
use serde::{Deserialize, Serialize};

pub use self::dependencies::Dependency;
use super::{Limits, Uid};
use crate::mesh::model::Trs;

/// Number that is constant or follows an attribute or a channel in every frame.
#[derive(Debug, Clone, PartialEq)]
pub enum Scalar {
    /// A constant number.
    Value(f32),
    /// `factor` times the value of an attribute, plus `add`.
    Attribute {
        /// The node that has the attribute.
        node: Uid,
        /// The attribute's name.
        name: Arc<str>,
        /// Factor of the attribute's value.
        factor: f32,
        /// Number added to the product.
        add: f32,
    },
    /// Weight of one choice of several: 1 if the attribute is `value`, falling to 0 at a distance of 1.
    Choice {
        /// The node that has the attribute.
        node: Uid,
        /// The attribute's name.
        name: Arc<str>,
        /// The choice.
        value: f32,
    },
    /// A channel of a node's pose offset, which a person or an animation sets.
    Channel {
        /// The node.
        node: Uid,
        /// Channel of the offset: translation in units, rotation in degrees, scale as a factor.
        channel: Channel,
    },
}

impl Scalar {
    /// The value of an attribute.
    pub fn attribute(node: Uid, name: impl Into<Arc<str>>) -> Self {
        Self::Attribute { node, name: name.into(), factor: 1.0, add: 0.0 }
    }

    /// The opposite of the value of an attribute.
    pub fn opposite(node: Uid, name: impl Into<Arc<str>>) -> Self {
        Self::Attribute { node, name: name.into(), factor: -1.0, add: 0.0 }
    }

    /// Number that is one minus the value of an attribute.
    pub fn inverse(node: Uid, name: impl Into<Arc<str>>) -> Self {
        Self::Attribute { node, name: name.into(), factor: -1.0, add: 1.0 }
    }

    /// Node that the number depends on, if any.
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

/// Channel of a transform.
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
    /// Returns `true` for a channel whose value has to be negated on the other side of a character: joints of pairs
    /// have mirrored axes, with X turned over.
    pub fn is_turned_over(self) -> bool {
        matches!(self, Self::TranslateX | Self::RotateY | Self::RotateZ)
    }
}

/// Target node that another node follows.
#[derive(Debug, Clone, PartialEq)]
pub struct Target {
    /// Uid of the target.
    pub node: Uid,
    /// Weight of the target; weights of all targets are divided by their sum. A negative weight counts as zero.
    pub weight: Scalar,
    /// Offset of the driven node in the target's space; the identity to coincide with the target.
    pub offset: Trs,
}

/// Direction of the up axis of an aim.
#[derive(Debug, Clone, PartialEq)]
pub enum AimUp {
    /// A direction in the rig's space.
    Direction(Vec3),
    /// The direction towards a node.
    Node(Uid),
    /// A direction in the space of a node.
    Axis(Uid, Vec3),
}

/// Lowest and highest angles of one joint of a chain, in degrees about X, Y and Z in that order, relative to its base.
pub type AngleLimits = [(Option<f32>, Option<f32>); 3];

/// Solver of a chain of more than two bones.
#[derive(Debug, Clone, PartialEq)]
pub enum ChainSolver {
    /// Forward and backward reaching (FABRIK).
    Fabrik,
    /// Cyclic coordinate descent; limits in the order of the chain's joints (may be shorter).
    Ccd(Vec<AngleLimits>),
}

/// A sphere about a node, or a capsule between two.
#[derive(Debug, Clone, PartialEq)]
pub struct Collider {
    /// The node in the middle of the sphere, or at the start of the capsule.
    pub node: Uid,
    /// The node at the end of the capsule.
    pub end: Option<Uid>,
    /// Radius in the rig's units.
    pub radius: f32,
}

/// Destination of a driven number.
#[derive(Debug, Clone, PartialEq)]
pub enum Output {
    /// A number of a node's transform, added to its base (factors are multiplied).
    Channel(Uid, Channel),
    /// An attribute of a node.
    Attribute(Uid, Arc<str>),
    /// The weight of a morph target, by name, on every mesh of the rig that has it.
    Morph(Arc<str>),
}

/// Interpolation between the keys of a driven key.
#[derive(bevy::reflect::Reflect, Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub enum KeyEase {
    /// Value of the key before.
    Step,
    /// Linear interpolation.
    Linear,
    /// Smooth interpolation without overshoot.
    #[default]
    Smooth,
}

/// A constraint: a movement of one or several nodes.
#[derive(Debug, Clone, PartialEq)]
pub enum Constraint {
    /// Follows weighted targets in the enabled channels: parent, point, orient and scale constraints, blends of two
    /// transforms, switches of spaces.
    Transform {
        /// The driven node.
        driven: Uid,
        /// Targets, in order.
        targets: Vec<Target>,
        /// Axes of the translation that follow (axes of the driven node's parent).
        translate: [bool; 3],
        /// Angles that follow (about X, Y and Z in that order, in the space of the driven node's parent).
        rotate: [bool; 3],
        /// Factors that follow.
        scale: [bool; 3],
        /// Weight: 0 leaves the node unchanged, 1 follows.
        weight: Scalar,
        /// Adds the pose offset of the driven node on top if `true`, so that it can still be moved by hand.
        keep_pose: bool,
    },
    /// Copies the transform of one node relative to another: a joint of a limb that follows its control, and can still
    /// be driven together with the joints above it. The other two nodes do not depend on those joints.
    Relative {
        /// The driven node.
        driven: Uid,
        /// The node that is copied.
        source: Uid,
        /// The node that takes the role of the driven node's parent.
        space: Uid,
        /// Position follows if `true`.
        translate: bool,
        /// Rotation follows if `true`.
        rotate: bool,
        /// Weight: 0 leaves the node unchanged, 1 follows.
        weight: Scalar,
    },
    /// Turns a node so that one of its axes points at weighted targets.
    Aim {
        /// The driven node.
        driven: Uid,
        /// Targets of the axis; their offsets are not used.
        targets: Vec<Target>,
        /// The axis that points, in the node's space.
        aim: Vec3,
        /// The axis that is turned up, in the node's space.
        up: Vec3,
        /// Up direction.
        world_up: AimUp,
        /// Rotation after aiming.
        offset: Quat,
        /// Weight: 0 leaves the node unchanged, 1 aims.
        weight: Scalar,
    },
    /// Two-bone inverse kinematics towards a goal.
    TwoBone {
        /// First joint (shoulder, hip).
        root: Uid,
        /// Second joint (elbow, knee): a child of the first.
        mid: Uid,
        /// End (wrist, ankle): a child of the second.
        end: Uid,
        /// Goal of the end.
        goal: Uid,
        /// The side to which the second joint bends; `None` keeps the current bend.
        pole: Option<Uid>,
        /// Direction in which a straight limb bends, in the space of the first joint.
        prefer: Vec3,
        /// Weight: 0 leaves the chain unchanged, 1 reaches.
        weight: Scalar,
        /// Share of the length over which the limb slows down before full stretch, 0 to 1.
        soft: Scalar,
        /// Stretch: 0 keeps lengths, 1 stretches to the goal.
        stretch: Scalar,
        /// Longest stretch as a factor.
        max_stretch: f32,
        /// Turn about the line from root to goal, in degrees.
        twist: Scalar,
        /// Share by which the second joint goes to the pole: 0 not, 1 wholly, with bones as long as that needs.
        pin: Scalar,
        /// The end's rotation in the goal's space; `None` if the end keeps its own rotation.
        orient_end: Option<Quat>,
    },
    /// Inverse kinematics of a chain of any length towards a goal.
    Chain {
        /// Joints from the root to the end, each a child of the one before.
        joints: Vec<Uid>,
        /// Goal of the end.
        goal: Uid,
        /// The side to which a straight chain bends.
        pole: Option<Uid>,
        /// Solver.
        solver: ChainSolver,
        /// Largest number of rounds.
        iterations: u32,
        /// Distance from the goal at which the solver stops, as a share of the chain's length.
        tolerance: f32,
        /// Weight: 0 leaves the chain unchanged, 1 reaches.
        weight: Scalar,
        /// The end's rotation in the goal's space; `None` if the end keeps its own rotation.
        orient_end: Option<Quat>,
    },
    /// A chain along a smooth curve through nodes.
    Spline {
        /// Joints from the first to the last, each a child of the one before.
        joints: Vec<Uid>,
        /// Nodes of the curve's control points, from start to end: two or more. The first and the last also give the
        /// twist.
        points: Vec<Uid>,
        /// Stretch: 0 keeps lengths, 1 spreads the joints over the whole curve.
        stretch: Scalar,
        /// Twist along the chain in degrees, besides that of the first and last nodes.
        twist: Scalar,
        /// Weight: 0 leaves the chain unchanged, 1 follows.
        weight: Scalar,
    },
    /// Distributes the twist of one node about an axis over other nodes.
    Twist {
        /// The node whose twist is measured.
        source: Uid,
        /// The node against which the twist is measured; the parent of the source if `None`.
        reference: Option<Uid>,
        /// The axis along the bone, in the source's space.
        axis: Vec3,
        /// Nodes that turn about the same axis of their own space, with their share of the twist.
        driven: Vec<(Uid, Scalar)>,
    },
    /// Scales nodes by the distance between two others.
    Stretch {
        /// First end of the distance.
        start: Uid,
        /// Second end of the distance.
        end: Uid,
        /// The distance at which nothing is stretched, in the rig's units.
        rest: f32,
        /// The axis that stretches, in the driven nodes' space.
        axis: Vec3,
        /// Volume preservation: 0 keeps the other two axes, 1 keeps the volume.
        volume: Scalar,
        /// The lowest and highest factor.
        range: (f32, f32),
        /// Nodes that are scaled.
        driven: Vec<Uid>,
        /// Weight: 0 is no stretch.
        weight: Scalar,
    },
    /// Limits the transform of a node, relative to its base.
    Limit {
        /// The limited node.
        driven: Uid,
        /// Lowest and highest values.
        limits: Limits,
    },
    /// A spring: the node lags behind, swings and settles.
    Spring {
        /// The node with the spring.
        driven: Uid,
        /// Frequency in swings per second.
        frequency: Scalar,
        /// Damping: 0 swings for ever, 1 settles without swinging.
        damping: Scalar,
        /// Weight: 0 leaves the node unchanged.
        weight: Scalar,
        /// Lag of the position if `true`.
        translate: bool,
        /// Lag of the direction towards the node's children if `true`.
        rotate: bool,
        /// Share of the motion of the rig in the world that the spring feels, 0 to 1.
        motion: Scalar,
        /// Bodies that the node's children do not enter.
        colliders: Vec<Collider>,
    },
    /// A number driven by another along keys.
    DrivenKey {
        /// The driving number.
        driver: Scalar,
        /// Keys: (driver, value), driver increasing; flat before the first and after the last.
        keys: Vec<(f32, f32)>,
        /// Interpolation between keys.
        ease: KeyEase,
        /// Destination of the number.
        output: Output,
    },
    /// Calculates a number from others.
    Expression {
        /// Arithmetic over the names of the inputs.
        text: String,
        /// Names with their values.
        inputs: Vec<(String, Scalar)>,
        /// Destination of the number.
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
    /// A number that says how near a direction of a node is to another: 1 within a cone, 0 beyond a wider one.
    Cone {
        /// The node whose direction counts.
        source: Uid,
        /// The direction, in the source's space.
        axis: Vec3,
        /// The node in whose space the cone stands; the parent of the source if `None`.
        reference: Option<Uid>,
        /// The middle of the cone, in the reference's space.
        towards: Vec3,
        /// Half the opening of the cone in degrees within which the number is 1.
        inner: f32,
        /// Half the opening of the cone in degrees outside of which the number is 0.
        outer: f32,
        /// Destination of the number.
        output: Output,
    },
    /// Numbers that say how near the rotation of a node is to each of some poses: at a pose its number is 1 and the
    /// others are 0 (interpolation by radial basis functions).
    PoseReader {
        /// The node whose rotation counts.
        source: Uid,
        /// The node against which the rotation is measured; the parent of the source if `None`.
        reference: Option<Uid>,
        /// Rotations of the source in the reference's space, with the destinations of their numbers. No two are alike.
        poses: Vec<(Quat, Output)>,
        /// Angle in degrees over which the influence of a pose fades.
        radius: f32,
    },
    /// A number that says how far a node has gone along a direction since it was built.
    Travel {
        /// The node that goes.
        source: Uid,
        /// The node in whose space the way is measured; the rig if `None`.
        reference: Option<Uid>,
        /// The direction, in the reference's space, of length 1.
        axis: Vec3,
        /// Factor of the way, such as degrees a unit.
        factor: f32,
        /// Destination of the number.
        output: Output,
    },
    /// A node on a smooth curve through nodes.
    Path {
        /// The driven node.
        driven: Uid,
        /// Nodes of the curve's control points, from start to end: two or more.
        points: Vec<Uid>,
        /// Place on the curve as a share of its length: 0 is the start, 1 the end.
        share: Scalar,
        /// The axis that points along the curve and the axis that is turned up, in the node's space; `None` keeps the
        /// node's rotation.
        aim: Option<[Vec3; 2]>,
        /// Up direction in the rig's space.
        up: Vec3,
        /// Weight: 0 leaves the node unchanged, 1 follows.
        weight: Scalar,
    },
    /// A node that rides on a triangle of nodes.
    Rivet {
        /// The driven node.
        driven: Uid,
        /// Corners of the triangle.
        corners: [Uid; 3],
        /// Shares of the corners in the foot of the node on the triangle's plane; their sum is 1.
        shares: [f32; 3],
        /// The node in the frame of the triangle at its foot, whose unit of length is the rig's.
        offset: Trs,
        /// Weight: 0 leaves the node unchanged, 1 follows.
        weight: Scalar,
    },
}

impl Constraint {
    /// The kind in words.
    pub fn kind(&self) -> &'static str {
        match self {
            Self::Transform { .. } => "transform",
            Self::Relative { .. } => "relative",
            Self::Aim { .. } => "aim",
            Self::TwoBone { .. } => "two-bone",
            Self::Chain { .. } => "chain",
            Self::Spline { .. } => "spline",
            Self::Twist { .. } => "twist",
            Self::Stretch { .. } => "stretch",
            Self::Limit { .. } => "limit",
            Self::Spring { .. } => "spring",
            Self::DrivenKey { .. } => "driven key",
            Self::Expression { .. } => "expression",
            Self::Foot { .. } => "foot",
            Self::Cone { .. } => "cone reader",
            Self::PoseReader { .. } => "pose reader",
            Self::Travel { .. } => "travel",
            Self::Path { .. } => "path",
            Self::Rivet { .. } => "rivet",
        }
    }
}
