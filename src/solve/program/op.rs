//! The operations of a program: small, flat, over numbered registers.
//!
//! Every register is written by one operation only (static single assignment): a node that several constraints drive
//! has a register for each state in between. So an operation is a pure function of the registers it reads, and running
//! only those whose inputs changed gives the same bits as running all.

mod comparison;
mod operands;
mod readers;

pub(super) use operands::Operand;
pub(super) use readers::{ColliderReg, ConeOp, PathOp, ReaderOp, RivetOp, TravelOp};

use std::sync::Arc;

use glam::{Quat, Vec3};

use crate::{
    mesh::model::Trs,
    rig::{Channel, Uid},
    solve::{
        aim::Aim,
        curve::Curve,
        expression::Expression,
        limit::{Bounds, JointLimit},
    },
};

/// Register of a transform. [`X::RIG`] is the rig's own space.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(super) struct X(pub u32);

impl X {
    /// The identity.
    pub const RIG: Self = Self(0);
}

/// Register of a number.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(super) struct N(pub u32);

/// Slot of a pose offset; [`Pose::NONE`] for a node that cannot be posed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Pose(pub u32);

impl Pose {
    /// No pose: the node keeps its built transform.
    pub const NONE: Self = Self(u32::MAX);
}

/// A piece of one of the lists of [`Tables`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) struct Span {
    pub start: u32,
    pub len: u32,
}

impl Span {
    /// The span as a range.
    pub fn range(self) -> std::ops::Range<usize> {
        self.start as usize..(self.start + self.len) as usize
    }
}

/// One operation of a program. Larger ones are indices of entries in [`Tables`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Op {
    /// Rig transform of a node without constraints: its base (of the table; 0 is the identity) with its pose.
    Node {
        pose: Pose,
        base: u32,
        parent: X,
        out: X,
    },
    /// Local transform of a driven node before its first constraint: base, driven channels, pose.
    Local {
        pose: Pose,
        base: u32,
        drives: Span,
        out: X,
    },
    /// Driven channels on top of earlier constraints.
    Drive {
        input: X,
        drives: Span,
        out: X,
    },
    /// Rig transform of a driven node.
    Global {
        parent: X,
        local: X,
        out: X,
    },
    /// Turns about one of the node's own axes (of the table) by degrees.
    Turn {
        input: X,
        axis: u32,
        angle: N,
        out: X,
    },
    /// Scales along one of the node's own axes and across it.
    Scale {
        input: X,
        axis: u32,
        along: N,
        across: N,
        out: X,
    },
    /// `factor * input + add`.
    Linear {
        input: N,
        factor: f32,
        add: f32,
        out: N,
    },
    /// `max(0, 1 - |input - value|)`.
    Choice {
        input: N,
        value: f32,
        out: N,
    },
    /// A number of a pose offset.
    Channel {
        pose: Pose,
        channel: Channel,
        out: N,
    },
    /// `a * b`.
    Product {
        a: N,
        b: N,
        out: N,
    },
    /// Clamps a number between two ends; `fallback` for one that is not finite.
    Clamp {
        input: N,
        ends: u32,
        out: N,
    },
    /// Sum of a list of numbers.
    Sum {
        list: Span,
        out: N,
    },
    Key(u32),
    Expression(u32),
    Foot(u32),
    Twist(u32),
    Stretch(u32),
    Transform(u32),
    Aim(u32),
    TwoBone(u32),
    Chain(u32),
    Spline(u32),
    Limit(u32),
    Spring(u32),
    Cone(u32),
    Reader(u32),
    Travel(u32),
    Path(u32),
    Rivet(u32),
}

/// Parameters of operations.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct Tables {
    pub bases: Vec<Trs>,
    pub axes: Vec<Vec3>,
    pub drives: Vec<(Channel, N)>,
    pub numbers: Vec<N>,
    pub ends: Vec<[f32; 3]>,
    pub targets: Vec<TargetReg>,
    pub links: Vec<Link>,
    pub points: Vec<X>,
    pub keys: Vec<KeyOp>,
    pub expressions: Vec<ExpressionOp>,
    pub feet: Vec<FootOp>,
    pub twists: Vec<TwistOp>,
    pub stretches: Vec<StretchOp>,
    pub transforms: Vec<TransformOp>,
    pub aims: Vec<AimOp>,
    pub two_bones: Vec<TwoBoneOp>,
    pub chains: Vec<ChainOp>,
    pub splines: Vec<SplineOp>,
    pub limits: Vec<LimitOp>,
    pub springs: Vec<SpringOp>,
    pub colliders: Vec<ColliderReg>,
    pub cones: Vec<ConeOp>,
    pub readers: Vec<ReaderOp>,
    pub travels: Vec<TravelOp>,
    pub paths: Vec<PathOp>,
    pub rivets: Vec<RivetOp>,
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct TargetReg {
    pub node: X,
    pub weight: N,
    /// Offset from the target; `None` to coincide with the target.
    pub offset: Option<Trs>,
}

/// A joint of a chain: its local transform before and after.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Link {
    pub input: X,
    pub out: X,
    /// The built base, of the table.
    pub base: u32,
}

#[derive(Debug, Clone, PartialEq)]
pub(super) struct KeyOp {
    pub driver: N,
    pub curve: Curve,
    pub out: N,
}

#[derive(Debug, Clone, PartialEq)]
pub(super) struct ExpressionOp {
    pub expression: Arc<Expression>,
    pub inputs: Span,
    pub out: N,
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct FootOp {
    pub roll: N,
    pub break_angle: N,
    pub bank: N,
    /// Degrees of heel, ball, toe, inner and outer.
    pub outs: [N; 5],
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct TwistOp {
    pub source: X,
    pub reference: X,
    /// Rotation that makes a rotation relative to the reference one relative to the built base.
    pub rest: Quat,
    pub axis: Vec3,
    /// Result in degrees.
    pub out: N,
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct StretchOp {
    pub start: X,
    pub end: X,
    pub rest: f32,
    pub range: (f32, f32),
    pub volume: N,
    pub weight: N,
    pub along: N,
    pub across: N,
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct TransformOp {
    pub input: X,
    pub parent: X,
    /// Pose on top of the result; none where it is not kept.
    pub pose: Pose,
    pub targets: Span,
    pub weight: N,
    pub translate: [bool; 3],
    pub rotate: [bool; 3],
    pub scale: [bool; 3],
    /// Writes the rig transform instead of the local one if `true`; translations and rotations are then followed whole,
    /// and so are scales, or not at all.
    pub is_global: bool,
    pub out: X,
}

/// Up direction of an aim.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum UpReg {
    Direction(Vec3),
    Point(X),
    Axis(X, Vec3),
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct AimOp {
    pub input: X,
    pub parent: X,
    pub targets: Span,
    pub aim: Aim,
    pub up: UpReg,
    pub offset: Quat,
    pub weight: N,
    pub out: X,
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct TwoBoneOp {
    pub parent: X,
    pub links: [Link; 3],
    pub goal: X,
    pub pole: Option<X>,
    pub prefer: Vec3,
    pub weight: N,
    pub soft: N,
    pub stretch: N,
    pub max_stretch: f32,
    pub twist: N,
    pub pin: N,
    pub orient_end: Option<Quat>,
}

#[derive(Debug, Clone, PartialEq)]
pub(super) struct ChainOp {
    pub parent: X,
    pub links: Span,
    pub goal: X,
    pub pole: Option<X>,
    /// Limits of all joints but the last, for cyclic coordinate descent; `None` for FABRIK.
    pub limits: Option<Box<[JointLimit]>>,
    pub iterations: u32,
    pub tolerance: f32,
    pub weight: N,
    pub orient_end: Option<Quat>,
}

#[derive(Debug, Clone, PartialEq)]
pub(super) struct SplineOp {
    pub parent: X,
    pub links: Span,
    pub points: Span,
    /// First and last point's rotations at rest, from which twist is measured.
    pub ends: [Quat; 2],
    /// Direction of the first bone as it was built, in the rig's space.
    pub along: Vec3,
    /// Direction across the first bone, in the space of the first point.
    pub up: Vec3,
    /// Rotations from the frames along the curve to the joints, as built.
    pub corrections: Box<[Quat]>,
    pub stretch: N,
    pub twist: N,
    pub weight: N,
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct LimitOp {
    pub input: X,
    pub base: u32,
    pub translate: Bounds,
    /// Bounds of Euler angles in radians.
    pub rotate: Bounds,
    pub scale: Bounds,
    pub out: X,
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct SpringOp {
    /// The constraint that it stands for.
    pub constraint: Uid,
    pub input: X,
    pub parent: X,
    pub frequency: N,
    pub damping: N,
    pub weight: N,
    pub motion: N,
    pub colliders: Span,
    pub translate: bool,
    /// Position of the node's children in its own space, if the spring swings.
    pub tip: Option<Vec3>,
    /// Index of the spring's state.
    pub state: u32,
    pub out: X,
}
