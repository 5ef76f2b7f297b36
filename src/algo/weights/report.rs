//! Report of a binding: where weights come from, which pieces of the surface move as one, and which joints hold nothing.

use glam::Vec3;

use super::{WeightJoint, finish::Shaping, twist::Limbs};
use crate::mesh::model::Weights;

/// Origins of the weights, stiff pieces of the mesh and idle joints; the counts of points but `stiff` add up to `points`.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct WeightReport {
    /// Points bound by heat on the surface.
    pub by_surface: usize,
    /// Points bound by geodesic voxel binding.
    pub by_voxels: usize,
    /// Points bound by the sparse solve from their neighbours.
    pub by_fill: usize,
    /// Points bound by the nearest bone alone.
    pub by_nearest: usize,
    /// Points bound as rigid parts, or because only one joint deforms. Points held by locked joints count where the rest
    /// of them would.
    pub given: usize,
    /// All points.
    pub points: usize,
    /// Points of parts that move as one ([`WeightSettings::stiff_parts`](super::WeightSettings::stiff_parts)), also
    /// counted by where their weights come from.
    pub stiff: usize,
    /// Pieces that `stiff` counts, in the order of their first points.
    pub stiff_pieces: Vec<StiffPiece>,
    /// Joints that hold no skin, in order.
    pub idle_joints: Vec<IdleJoint>,
    /// Work to find which pieces of the mesh belong to which bones: bones and pieces that were compared, and rays. It grows with the
    /// number of bones and pieces that are near to each other.
    pub comparisons: u64,
}

/// Connected piece of the surface that moves as one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StiffPiece {
    /// First point of the piece.
    pub first: u32,
    /// Number of points.
    pub points: usize,
    /// Index of the joint that holds most of the piece.
    pub joint: usize,
    /// Share of that joint: 1 where it holds the piece alone.
    pub share: f32,
}

/// Joint that holds no point of the mesh, or, of slots, only points of parts that were given to it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct IdleJoint {
    /// Index of the joint.
    pub joint: usize,
    /// Reason why it holds nothing.
    pub reason: IdleReason,
}

/// Reason why a joint holds no skin.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum IdleReason {
    /// The joint hangs outside of the mesh.
    Outside {
        /// Distance to the surface in the unit of the points.
        distance: f32,
    },
    /// All of the surface belongs to other joints.
    NoSurface,
    /// The joint carries or steers things ([`WeightSettings::slots`](super::WeightSettings::slots)): the flesh around it belongs
    /// to other joints.
    Slot,
    /// The joint must not move points.
    NotDeforming,
    /// The joint is locked without weights.
    Locked,
}

/// Holder of each connected piece that moves as one: a joint and its share.
#[derive(Debug, Default)]
pub(crate) struct Stiffness {
    /// The piece of each place; empty if everything bends.
    pub of: Vec<u32>,
    /// The holder of each piece; `None` for pieces that bend.
    pub holders: Vec<Option<(u32, f32)>>,
}

impl Stiffness {
    /// Number and holder of a place's piece, if it moves as one.
    fn at(&self, place: u32) -> Option<(u32, (u32, f32))> {
        let piece = *self.of.get(place as usize)?;
        self.holders[piece as usize].map(|holder| (piece, holder))
    }

    /// Middle of each piece of a mesh whose points lie at the given places; `None` for pieces that bend.
    pub fn middles(&self, points: &[Vec3], place: &[u32]) -> Vec<Option<Vec3>> {
        let mut sums = vec![(Vec3::ZERO, 0.0); self.holders.len()];
        for (point, place) in points.iter().zip(place) {
            if let Some(&piece) = self.of.get(*place as usize) {
                let (sum, count) = &mut sums[piece as usize];
                (*sum, *count) = (*sum + *point, *count + 1.0);
            }
        }
        let middle = |((sum, count), holder): ((Vec3, f32), &Option<_>)| holder.map(|_| sum / count);
        sums.into_iter().zip(&self.holders).map(middle).collect()
    }

    /// The stiff pieces of a mesh whose points lie at the given places; points with given weights belong to none.
    pub fn pieces(&self, place: &[u32], shaping: &Shaping, limbs: &Limbs) -> Vec<StiffPiece> {
        let mut found: Vec<Option<StiffPiece>> = vec![None; self.holders.len()];
        for (point, &place) in place.iter().enumerate().filter(|(point, _)| !shaping.is_given(*point)) {
            let Some((piece, (joint, share))) = self.at(place) else { continue };
            let joint = limbs.place(joint);
            let first = point as u32;
            found[piece as usize].get_or_insert(StiffPiece { first, points: 0, joint, share }).points += 1;
        }
        found.into_iter().flatten().collect()
    }
}

/// The joints that hold nothing; of slots, what was given to them is no skin. `outside` is the distance of joints outside of the
/// mesh, by their indices.
pub(crate) fn idle_joints(
    joints: &[WeightJoint],
    weights: &Weights,
    is_locked: impl Fn(usize) -> bool,
    slots: &[bool],
    is_given: impl Fn(usize) -> bool,
    outside: impl Fn(usize) -> Option<f32>,
) -> Vec<IdleJoint> {
    let mut is_idle = vec![true; joints.len()];
    for point in 0..weights.len() {
        let is_given = is_given(point);
        for (joint, _) in weights.of(point) {
            is_idle[joint as usize] &= is_given && slots[joint as usize];
        }
    }
    let any_deforms = joints.iter().any(|joint| joint.deforms);
    let reason = |joint: usize| {
        if any_deforms && !joints[joint].deforms {
            return IdleReason::NotDeforming;
        }
        if is_locked(joint) {
            return IdleReason::Locked;
        }
        let within = if slots[joint] { IdleReason::Slot } else { IdleReason::NoSurface };
        outside(joint).map_or(within, |distance| IdleReason::Outside { distance })
    };
    let idle = (0..joints.len()).filter(|joint| is_idle[*joint]);
    idle.map(|joint| IdleJoint { joint, reason: reason(joint) }).collect()
}
