//! Arms and legs, found from the joints alone, and how flesh is shared across their joints.
//!
//! Heat knows distances and nothing of bones and tendons: at a joint it puts the blend half way between two bones. In
//! bodies the ulna begins above the elbow's axis and takes the point of the elbow with it, the kneecap stays with the
//! thigh, the wrist turns with the forearm, and a collar bone moves little of the flesh around it, most of which belongs
//! to the arm or to the chest. The shares below were fitted to how bodies with painted weights bend by a right angle
//! (`benches/README.md`).

use glam::Vec3;

use super::{WeightJoint, odds, roots::parents_first};
use crate::mesh::model::Weights;

/// Lengths of bones that differ by more than this share are not a pair's.
const ALIKE: f32 = 0.2;
/// Joints that a limb has at most, and children of a girdle.
const MANY: usize = 32;
/// Joints that a limb has at least: two bones and what they end at.
const LIMB: usize = 3;
/// A foot tells which way is forward if it leads at least this share of its length away from the shin.
const FORWARD: f32 = 0.3;
/// The cosine of the largest angle between the trunk and the legs of a body that stands upright.
const UPRIGHT: f32 = 0.7;
/// Share of flesh between a joint and the joint above it: the logarithm of the odds of the lower one, `x`, becomes
/// `contrast * x + shift + tilt * side`, where `side` runs from -1 in front of the joint to 1 behind it.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Share {
    contrast: f32,
    shift: f32,
    tilt: f32,
}

const COLLAR: Share = Share { contrast: 1.0, shift: -2.0, tilt: 0.0 };
const SHOULDER: Share = Share { contrast: 0.45, shift: 0.25, tilt: 0.0 };
const ELBOW: Share = Share { contrast: 0.9, shift: 1.0, tilt: 0.0 };
const WRIST: Share = Share { contrast: 0.5, shift: -0.8, tilt: 0.0 };
const KNEE: Share = Share { contrast: 0.8, shift: -0.7, tilt: 0.9 };
const NECK: Share = Share { contrast: 1.0, shift: 0.7, tilt: 0.0 };

/// Joints of a body that share flesh in their own way.
#[derive(Debug, Default)]
pub(crate) struct Anatomy(Vec<Hinge>);

/// A joint, the joints on both sides of it, and how they share.
#[derive(Debug)]
struct Hinge {
    share: Share,
    at: Vec3,
    /// Unit vector along the bone below the joint.
    along: Vec3,
    /// Unit vector from the joint to its back, perpendicular to `along`; zero if nothing tells it.
    back: Vec3,
    /// Flag of each joint of the skeleton: whether it belongs to the joint (`true`) or to what is above it.
    sides: Vec<Option<bool>>,
}

/// A limb: joints from the one that is attached to the body to the hand or foot.
#[derive(Debug, Clone)]
struct Limb {
    path: Vec<usize>,
    /// Place in `path` where the two long bones begin.
    root: usize,
}

/// Joints that two limbs are attached to.
struct Girdle {
    joint: usize,
    limbs: [Limb; 2],
    /// Children of the joint that are no limbs.
    others: Vec<usize>,
}

impl Anatomy {
    /// Reads the body of checked joints; without a pair of legs, a pair of arms and a trunk that stands on the legs
    /// there is none.
    pub fn new(joints: &[WeightJoint]) -> Self {
        let tree = Tree::new(joints);
        let Some((legs, arms)) = girdles(&tree).filter(|(legs, arms)| tree.is_upright(legs, arms)) else {
            return Self::default();
        };
        let mut hinges = Vec::new();
        for limb in &legs.limbs {
            hinges.push(tree.hinge(KNEE, limb.path[limb.root + 1], limb.path[limb.root], tree.back_of_knee(limb)));
        }
        for limb in &arms.limbs {
            let [shoulder, elbow, wrist] = [0, 1, 2].map(|next| limb.path[limb.root + next]);
            if let Some(collar) = limb.root.checked_sub(1).map(|collar| limb.path[collar]) {
                let mut share = tree.hinge(COLLAR, collar, arms.joint, Vec3::ZERO);
                share.sides.iter_mut().enumerate().for_each(|(joint, side)| {
                    *side = side.filter(|lower| !lower || joint == collar);
                });
                hinges.push(share);
                hinges.push(tree.hinge(SHOULDER, shoulder, collar, Vec3::ZERO));
            }
            hinges.push(tree.hinge(ELBOW, elbow, shoulder, Vec3::ZERO));
            hinges.push(tree.hinge(WRIST, wrist, elbow, Vec3::ZERO));
        }
        if let [neck] = arms.others[..] {
            hinges.push(tree.hinge(NECK, neck, arms.joint, Vec3::ZERO));
        }
        Self(hinges)
    }

    /// Shares the flesh of each place anew.
    pub fn share(&self, places: &[Vec3], weights: Weights) -> Weights {
        if self.0.is_empty() {
            return weights;
        }
        let mut shared = Weights { starts: Vec::with_capacity(places.len() + 1), ..Weights::default() };
        shared.starts.push(0);
        let mut row: Vec<(u32, f32)> = Vec::new();
        for (place, point) in places.iter().enumerate() {
            row.clear();
            row.extend(weights.of(place));
            self.0.iter().for_each(|hinge| hinge.share(*point, &mut row));
            shared.push(row.iter().copied());
        }
        shared
    }
}

impl Hinge {
    fn share(&self, point: Vec3, row: &mut [(u32, f32)]) {
        let side = |joint: u32| self.sides[joint as usize];
        let sum =
            |lower: bool| row.iter().filter(|(joint, _)| side(*joint) == Some(lower)).map(|(_, w)| w).sum::<f32>();
        let (lower, upper) = (sum(true), sum(false));
        if lower <= 0.0 || upper <= 0.0 {
            return;
        }
        let old = lower / (lower + upper);
        let from = point - self.at;
        let behind = (from - self.along * from.dot(self.along)).normalize_or_zero().dot(self.back);
        let Share { contrast, shift, tilt } = self.share;
        let new = odds::shifted(old, contrast, shift + tilt * behind);
        for (joint, weight) in row.iter_mut() {
            match side(*joint) {
                Some(true) => *weight *= new / old,
                Some(false) => *weight *= (1.0 - new) / (1.0 - old),
                None => {}
            }
        }
    }
}

/// Joints with their children.
struct Tree<'a> {
    joints: &'a [WeightJoint],
    children: Vec<Vec<usize>>,
    /// Number of joints below each joint, itself included.
    sizes: Vec<usize>,
    /// Joints with each parent before its children.
    order: Vec<usize>,
}

impl<'a> Tree<'a> {
    fn new(joints: &'a [WeightJoint]) -> Self {
        let (order, children) = parents_first(joints);
        let mut sizes = vec![1; joints.len()];
        for &joint in order.iter().rev() {
            sizes[joint] += children[joint].iter().map(|&child| sizes[child]).sum::<usize>();
        }
        Self { joints, children, sizes, order }
    }

    fn length(&self, from: usize, to: usize) -> f32 {
        self.joints[from].head.distance(self.joints[to].head)
    }

    /// The way down from a joint to a hand, a foot or a last joint: over the larger child, as long as there are at most
    /// two.
    fn path(&self, from: usize) -> Vec<usize> {
        let mut path = vec![from];
        let mut at = from;
        while let Some(&child) = self.children[at].iter().max_by_key(|&&child| self.sizes[child])
            && self.children[at].len() <= 2
            && path.len() < MANY
        {
            path.push(child);
            at = child;
        }
        path
    }

    /// The limb that begins at a joint: its two long bones are the consecutive ones of which the shorter is longest.
    fn limb(&self, from: usize) -> Option<Limb> {
        let path = self.path(from);
        let bones: Vec<f32> = path.windows(2).map(|ends| self.length(ends[0], ends[1])).collect();
        let shorter = |at: &usize| bones[*at].min(bones[*at + 1]);
        let root = (0..bones.len().checked_sub(LIMB - 2)?).max_by(|a, b| shorter(a).total_cmp(&shorter(b)))?;
        Some(Limb { path, root })
    }

    /// True if two limbs have bones of the same lengths.
    fn are_alike(&self, a: &Limb, b: &Limb) -> bool {
        let bones =
            |limb: &Limb| -> Vec<f32> { limb.path.windows(2).map(|ends| self.length(ends[0], ends[1])).collect() };
        let (a, b) = (bones(a), bones(b));
        a.len() == b.len() && a.iter().zip(&b).all(|(a, b)| (a - b).abs() <= ALIKE * a.max(*b))
    }

    /// The pair of limbs that is attached to a joint: of its children exactly two are alike.
    fn girdle(&self, joint: usize) -> Option<Girdle> {
        if !(2..=MANY).contains(&self.children[joint].len()) {
            return None;
        }
        let limbs: Vec<Limb> = self.children[joint].iter().filter_map(|&child| self.limb(child)).collect();
        let mut pairs = Vec::new();
        for (number, limb) in limbs.iter().enumerate() {
            pairs.extend(
                limbs[number + 1..].iter().filter(|other| self.are_alike(limb, other)).map(|other| [limb, other]),
            );
        }
        let [pair] = pairs[..] else { return None };
        let is_other = |child: &usize| pair.iter().all(|limb| limb.path[0] != *child);
        let others = self.children[joint].iter().copied().filter(is_other).collect();
        Some(Girdle { joint, limbs: pair.map(Limb::clone), others })
    }

    /// Flag of each joint: whether it is one of some joints or below one.
    fn below(&self, above: &[usize]) -> Vec<bool> {
        let mut below = vec![false; self.joints.len()];
        for &joint in &self.order {
            below[joint] = above.contains(&joint) || self.joints[joint].parent.is_some_and(|parent| below[parent]);
        }
        below
    }

    /// True if the trunk leads away from where the legs lead: forelegs share their flesh otherwise than arms do.
    fn is_upright(&self, legs: &Girdle, arms: &Girdle) -> bool {
        let head = |joint: usize| self.joints[joint].head;
        let hips = legs.limbs.iter().map(|limb| head(limb.path[limb.root])).sum::<Vec3>() / 2.0;
        let feet = legs.limbs.iter().map(|limb| head(limb.path[limb.root + 2])).sum::<Vec3>() / 2.0;
        (head(arms.joint) - hips).normalize_or_zero().dot((hips - feet).normalize_or_zero()) > UPRIGHT
    }

    /// The joint `lower` with all below it, sharing with `upper`.
    fn hinge(&self, share: Share, lower: usize, upper: usize, back: Vec3) -> Hinge {
        let below = self.below(&[lower]);
        let side = |joint: usize| (below[joint] || joint == upper).then_some(below[joint]);
        let next = self.children[lower].iter().max_by_key(|&&child| self.sizes[child]);
        let along = next.map_or(Vec3::ZERO, |&next| self.joints[next].head - self.joints[lower].head);
        Hinge {
            share,
            at: self.joints[lower].head,
            along: along.normalize_or_zero(),
            back,
            sides: (0..self.joints.len()).map(side).collect(),
        }
    }

    /// The direction to the back of a knee, from where the foot points or, without a foot, from the bend at rest.
    fn back_of_knee(&self, limb: &Limb) -> Vec3 {
        let head = |next: usize| limb.path.get(limb.root + next).map(|&joint| self.joints[joint].head);
        let [Some(hip), Some(knee), Some(ankle)] = [0, 1, 2].map(head) else { return Vec3::ZERO };
        let shin = (ankle - knee).normalize_or_zero();
        let across = |way: Vec3| way - shin * way.dot(shin);
        let foot = head(3).map(|toe| toe - ankle).filter(|foot| across(*foot).length() > FORWARD * foot.length());
        let bend = across(knee - hip.midpoint(ankle));
        let forward = foot.map_or(bend, across);
        let sure = foot.is_some() || bend.length() > 0.02 * hip.distance(ankle);
        if sure { -forward.normalize_or_zero() } else { Vec3::ZERO }
    }
}

/// The girdles that legs and arms are attached to. Arms are attached where a neck goes on, or else farther from the
/// root.
fn girdles(tree: &Tree) -> Option<(Girdle, Girdle)> {
    let mut found: Vec<Girdle> = Vec::new();
    let mut is_limb = vec![false; tree.joints.len()];
    for &joint in &tree.order {
        is_limb[joint] |= tree.joints[joint].parent.is_some_and(|parent| is_limb[parent]);
        if let Some(girdle) = tree.girdle(joint).filter(|_| !is_limb[joint]) {
            girdle.limbs.iter().for_each(|limb| is_limb[limb.path[0]] = true);
            found.push(girdle);
        }
    }
    let [upper, lower]: [Girdle; 2] = found.try_into().ok()?;
    if !tree.below(&[upper.joint])[lower.joint] {
        return None;
    }
    let goes_on = |girdle: &Girdle| girdle.others.iter().any(|&other| !tree.below(&[other])[lower.joint]);
    Some(if goes_on(&upper) && !goes_on(&lower) { (lower, upper) } else { (upper, lower) })
}
