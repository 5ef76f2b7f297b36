//! Parameters of operations that read poses, and of those that put a node onto a curve or a triangle.

use glam::Vec3;

use super::{N, Span, X};
use crate::{
    mesh::model::Trs,
    solve::{
        aim::Aim,
        pose_reader::{Cone, PoseReader},
    },
};

/// A body that a spring does not enter.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in super::super) struct ColliderReg {
    pub start: X,
    /// End of the body; that of a sphere is its start.
    pub end: X,
    pub radius: f32,
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub(in super::super) struct ConeOp {
    pub source: X,
    pub reference: X,
    /// Axis that looks, in the source's space.
    pub axis: Vec3,
    /// Middle of the cone, in the reference's space.
    pub towards: Vec3,
    pub cone: Cone,
    pub out: N,
}

#[derive(Debug, Clone, PartialEq)]
pub(in super::super) struct ReaderOp {
    pub source: X,
    pub reference: X,
    pub reader: PoseReader,
    /// The number of each pose.
    pub outs: Box<[N]>,
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub(in super::super) struct TravelOp {
    pub source: X,
    pub reference: X,
    pub axis: Vec3,
    /// Place along the axis as built.
    pub rest: f32,
    pub factor: f32,
    pub out: N,
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub(in super::super) struct PathOp {
    pub input: X,
    pub parent: X,
    pub points: Span,
    pub share: N,
    pub aim: Option<Aim>,
    pub up: Vec3,
    pub weight: N,
    pub out: X,
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub(in super::super) struct RivetOp {
    pub input: X,
    pub parent: X,
    pub corners: [X; 3],
    pub shares: [f32; 3],
    pub offset: Trs,
    pub weight: N,
    pub out: X,
}
