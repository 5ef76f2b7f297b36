//! Half joints: joints that turn by half of another joint's bend and hold the skin between it and the joints above.
//!
//! Where the skin of a bend is shared between a bone and the next, a linear blend of two rotations shrinks it towards the
//! joint (by 1 - cos(angle / 2) where both hold half). With a joint halfway, what both hold in common, twice the smaller
//! share, goes to that joint: so a point is never blended over more than half of the angle, and in the middle of the bend
//! not at all.

use super::WeightJoint;

/// The half joints of a skeleton.
pub(crate) struct Halves(Vec<Half>);

struct Half {
    joint: u32,
    /// For each joint of the skeleton, the side of the bend that it is on.
    sides: Vec<Option<Side>>,
}

#[derive(Clone, Copy, PartialEq)]
enum Side {
    /// The joints above the bend, with their twist joints.
    Upper,
    /// The joint that bends, with its twist joints.
    Lower,
}

impl Halves {
    /// The half joints that take part.
    pub fn new(joints: &[WeightJoint], is_free: &[bool]) -> Self {
        let side = |bent: usize, joint: usize| {
            let owner = joints[joint].twist.map_or(joint, |twist| twist.joint);
            let above = std::iter::successors(joints[bent].parent, |joint| joints[*joint].parent);
            match owner == bent {
                _ if joints[joint].halves.is_some() => None,
                true => Some(Side::Lower),
                false => above.take(joints.len()).any(|above| above == owner).then_some(Side::Upper),
            }
        };
        let half = |(joint, data): (usize, &WeightJoint)| {
            let bent = data.halves.filter(|_| is_free[joint])?;
            let sides = (0..joints.len()).map(|joint| side(bent, joint)).collect();
            Some(Half { joint: joint as u32, sides })
        };
        Self(joints.iter().enumerate().filter_map(half).collect())
    }

    /// Gives half joints their shares of a point's weights; the sum stays.
    pub fn take(&self, row: &mut Vec<(u32, f32)>) {
        for half in &self.0 {
            let side = |joint: u32| half.sides[joint as usize];
            let sum = |of: Side| row.iter().filter(|(joint, _)| side(*joint) == Some(of)).map(|(_, w)| w).sum::<f32>();
            let (upper, lower) = (sum(Side::Upper), sum(Side::Lower));
            let common = upper.min(lower);
            if common <= 0.0 {
                continue;
            }
            for (joint, weight) in row.iter_mut() {
                match side(*joint) {
                    Some(Side::Upper) => *weight *= (upper - common) / upper,
                    Some(Side::Lower) => *weight *= (lower - common) / lower,
                    None => {}
                }
            }
            row.retain(|(_, weight)| *weight > 0.0);
            row.push((half.joint, 2.0 * common));
        }
    }
}
