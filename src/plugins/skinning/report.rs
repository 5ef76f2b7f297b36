//! Report of a bound mesh for people: its rigid parts by name, and the joints that hold nothing.

use super::{MeshPart, MeshParts, SkinningInput};
use crate::{
    algo::weights::{IdleReason, WeightReport},
    plugins::surface::RigMesh,
    rig::Uid,
};

/// Report of the computation of weights for a mesh.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct SkinningReport {
    /// Counts of the computation; the joints in it are numbers in [`SkinData::joints`](crate::rig::SkinData::joints).
    pub weights: WeightReport,
    /// Parts that move as one, in the order of parts.
    pub rigid_parts: Vec<RigidPart>,
    /// Parts that bend because a person chose it, with their names.
    pub bending_parts: Vec<(MeshPart, String)>,
    /// Joints that hold no skin of the mesh.
    pub idle_joints: Vec<IdleJoint>,
}

/// Part of a mesh that moves as one.
#[derive(Debug, Clone, PartialEq)]
pub struct RigidPart {
    /// The part.
    pub part: MeshPart,
    /// Name of the part.
    pub name: String,
    /// Number of points.
    pub points: usize,
    /// Joint that holds the part, or most of it.
    pub joint: Uid,
    /// Share of that joint: 1 where it holds the part alone.
    pub share: f32,
}

/// Joint that holds no skin of a mesh: nothing, or only objects that hang on it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct IdleJoint {
    /// The joint.
    pub joint: Uid,
    /// Reason why it holds no skin.
    pub reason: IdleReason,
}

impl SkinningInput {
    /// The report with names of parts and joints.
    pub(super) fn report(&self, mesh: &RigMesh, weights: WeightReport) -> SkinningReport {
        let idle =
            weights.idle_joints.iter().map(|idle| IdleJoint { joint: self.uids[idle.joint], reason: idle.reason });
        let idle_joints = idle.collect();
        let is_plain = weights.stiff_pieces.is_empty() && self.given.is_empty() && self.bending_parts.is_empty();
        if is_plain {
            return SkinningReport { weights, idle_joints, ..SkinningReport::default() };
        }
        let parts = MeshParts::new(mesh);
        let given = self.given.iter().map(|(part, points, joint)| (*part, *points, *joint, 1.0));
        let stiff = weights
            .stiff_pieces
            .iter()
            .filter_map(|piece| Some((parts.at(piece.first as usize)?, piece.points, piece.joint, piece.share)));
        let named = |(part, points, joint, share): (MeshPart, usize, usize, f32)| RigidPart {
            part,
            name: parts.name(part),
            points,
            joint: self.uids[joint],
            share,
        };
        let mut rigid_parts: Vec<RigidPart> = given.chain(stiff).map(named).collect();
        rigid_parts.sort_by_key(|rigid| rigid.part);
        let bending_parts = self.bending_parts.iter().map(|part| (*part, parts.name(*part))).collect();
        SkinningReport { weights, rigid_parts, bending_parts, idle_joints }
    }
}
