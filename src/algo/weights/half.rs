//! Half joints: joints that turn by half of another joint's bend and hold the skin between it and the joints above.
//!
//! Where the skin of a bend is shared between a bone and the next, a linear blend of two rotations shrinks it towards the
//! joint (by 1 - cos(angle / 2) where both hold half). With a joint halfway, what both hold in common, twice the smaller
//! share, goes to that joint: so a point is never blended over more than half of the angle, and in the middle of the bend
//! not at all.

use std::collections::BTreeMap;

use super::{
    WeightJoint,
    hierarchy::{Cores, Hierarchy},
    odds,
};

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
pub(crate) struct Halves {
    halves: Vec<Half>,
    /// Places in `halves` of the half joints of each joint that bends, rising.
    of_joint: BTreeMap<usize, Vec<usize>>,
    /// Joint whose flesh each joint shares: that of a twist joint's bone, or itself. `None` for half joints.
    owners: Vec<Option<usize>>,
    hierarchy: Option<Hierarchy>,
}

struct Half {
    joint: u32,
    /// Index of the joint that bends.
    bent: usize,
    contrast: f32,
    is_hinge: bool,
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
        let cores = Cores::new(joints);
        let mut halves = Vec::new();
        let mut of_joint: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
        for (joint, data) in joints.iter().enumerate() {
            let Some(bent) = data.halves.filter(|_| is_free[joint]) else { continue };
            let is_hinge = is_hinge(joints, &cores, bent);
            let contrast = if is_hinge { HINGE } else { SOCKET };
            of_joint.entry(bent).or_default().push(halves.len());
            halves.push(Half { joint: joint as u32, bent, contrast, is_hinge });
        }
        let owner = |(joint, data): (usize, &WeightJoint)| match data.halves {
            Some(_) => None,
            None => Some(data.twist.map_or(joint, |twist| twist.joint)),
        };
        let owners = joints.iter().enumerate().map(owner).collect();
        let hierarchy = (!halves.is_empty()).then(|| Hierarchy::new(joints));
        Self { halves, of_joint, owners, hierarchy }
    }

    /// Side of the bend of `bent` on which a joint is.
    fn side(&self, bent: usize, joint: u32) -> Option<Side> {
        let owner = self.owners[joint as usize]?;
        if owner == bent {
            return Some(Side::Lower);
        }
        self.hierarchy.as_ref()?.has(owner, bent).then_some(Side::Upper)
    }

    /// Gives half joints their shares of a point's weights; the sum stays.
    pub fn take(&self, row: &mut Vec<(u32, f32)>) {
        if self.halves.is_empty() {
            return;
        }
        // A half joint takes nothing where no joint below its bend holds the point.
        let mut places: Vec<usize> = Vec::new();
        for (joint, _) in row.iter() {
            let halves = self.owners[*joint as usize].and_then(|owner| self.of_joint.get(&owner));
            places.extend(halves.into_iter().flatten());
        }
        places.sort_unstable();
        places.dedup();
        for half in places.into_iter().map(|place| &self.halves[place]) {
            let side = |joint: u32| self.side(half.bent, joint);
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
fn is_hinge(joints: &[WeightJoint], cores: &Cores, joint: usize) -> bool {
    cores.above[joint]
        .is_some_and(|above| joints[above].head.distance(joints[joint].head) >= HINGED * cores.longest[joint])
}
