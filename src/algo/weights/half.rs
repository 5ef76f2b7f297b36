//! Half joints: joints that turn by half of another joint's bend and hold the skin between it and the joints above.
//!
//! Where the skin of a bend is shared between a bone and the next, a linear blend of two rotations shrinks it towards the
//! joint (by 1 - cos(angle / 2) where both hold half). With a joint halfway, what both hold in common, twice the smaller
//! share, goes to that joint: so a point is never blended over more than half of the angle, and in the middle of the bend
//! not at all.

use super::{WeightJoint, odds};

/// Width of the blend across a hinge: the factor of the logarithm of the odds. Skin on the inside of a right
/// angle folds unless the blend is at least as long as a quarter of a circle around the joint; without a half joint so
/// long a blend would thin the limb.
const HINGE: f32 = 0.5;
/// Width of the blend of hips and shoulders, in the same factor, around which the body is too wide for a longer blend.
const SOCKET: f32 = 1.0;
/// A joint is a hinge if the bone above it is at least this share of the bone below it, a socket otherwise.
const HINGED: f32 = 0.8;

/// The half joints of a skeleton.
#[derive(Default)]
pub(crate) struct Halves(Vec<Half>);

struct Half {
    joint: u32,
    contrast: f32,
    is_hinge: bool,
    /// Side of the bend on which each joint of the skeleton is.
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
            let is_hinge = is_hinge(joints, bent);
            let contrast = if is_hinge { HINGE } else { SOCKET };
            Some(Half { joint: joint as u32, contrast, is_hinge, sides })
        };
        Self(joints.iter().enumerate().filter_map(half).collect())
    }

    /// Gives half joints their shares of a point's weights; the sum stays.
    pub fn take(&self, row: &mut Vec<(u32, f32)>) {
        for half in &self.0 {
            let side = |joint: u32| half.sides[joint as usize];
            let sum = |of: Side| row.iter().filter(|(joint, _)| side(*joint) == Some(of)).map(|(_, w)| w).sum::<f32>();
            let (upper, lower) = (sum(Side::Upper), sum(Side::Lower));
            let both = upper + lower;
            if upper <= 0.0 || lower <= 0.0 {
                continue;
            }
            let share = odds::shifted(lower / both, half.contrast, 0.0);
            let taken = both * half.taken(share);
            for (joint, weight) in row.iter_mut() {
                match side(*joint) {
                    Some(Side::Upper) => *weight *= (both * (1.0 - share) - 0.5 * taken) / upper,
                    Some(Side::Lower) => *weight *= (both * share - 0.5 * taken) / lower,
                    None => {}
                }
            }
            row.retain(|(_, weight)| *weight > 0.0);
            row.push((half.joint, taken));
        }
    }
}

impl Half {
    /// Share of the half joint where the lower side holds `share` of both.
    fn taken(&self, share: f32) -> f32 {
        let lesser = share.min(1.0 - share);
        // Around a socket the peak of twice the lesser share would stand out as a corner: the parabola has none.
        if self.is_hinge { 2.0 * lesser } else { 2.0 * share * (1.0 - share) }
    }
}

/// True if a joint lies between two bones of about the same length.
fn is_hinge(joints: &[WeightJoint], joint: usize) -> bool {
    let is_core = |joint: usize| joints[joint].twist.is_none() && joints[joint].halves.is_none();
    let parent = |joint: usize| {
        std::iter::successors(joints[joint].parent, |above| joints[*above].parent)
            .take(joints.len())
            .find(|above| is_core(*above))
    };
    let length = |a: usize, b: usize| joints[a].head.distance(joints[b].head);
    let Some(above) = parent(joint) else { return false };
    let children = (0..joints.len()).filter(|child| is_core(*child) && parent(*child) == Some(joint));
    let below = children.map(|child| length(child, joint)).fold(0.0, f32::max);
    length(above, joint) >= HINGED * below
}
