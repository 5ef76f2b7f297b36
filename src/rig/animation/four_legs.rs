//! Animals on four legs, by the shape of their skeletons: chains of spine, neck, head, tail and legs.

use std::collections::BTreeMap;

use bevy::math::{Mat3, Quat, Vec3};

use super::humanoid::{BodySide, SkeletonJoint, ancestors, is_above, path};

/// Chain of joints of an animal, from the body outwards.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum AnimalChain {
    /// Joints above the hips, up to the one that carries the front legs.
    Spine,
    /// Joints from there to the head.
    Neck,
    /// Head.
    Head,
    /// Tail.
    Tail,
    /// Leg in front, from the shoulder to the paw.
    Front(BodySide),
    /// Leg behind, from the hip to the paw.
    Hind(BodySide),
}

/// Skeleton of an animal on four legs.
#[derive(Debug, Clone, PartialEq)]
pub struct FourLegs {
    /// Joint that carries all.
    pub hips: usize,
    /// Joints by chains.
    pub chains: BTreeMap<AnimalChain, Vec<usize>>,
    /// Rotation from axes in which left is X, up is Y and forward is Z.
    pub axes: Quat,
    /// Height of each joint above the lowest one, as a share of that of the hips.
    heights: Vec<f32>,
}

/// Greatest height of the end of a leg, as a share of that of the skeleton.
const LOW: f32 = 0.3;
/// Distance from the middle, as a share of the size, beyond which a joint is on a side.
const ASIDE: f32 = 0.01;

impl FourLegs {
    /// Skeleton with Y or Z up that stands on two pairs of legs, one pair below the other in the hierarchy; `None` for other
    /// skeletons.
    pub fn find(joints: &[SkeletonJoint]) -> Option<Self> {
        [[Vec3::Y, Vec3::X], [Vec3::Y, Vec3::Z], [Vec3::Z, Vec3::X], [Vec3::Z, Vec3::Y]]
            .into_iter()
            .find_map(|[up, across]| Self::along(joints, up, across))
    }

    fn along(joints: &[SkeletonJoint], up: Vec3, across: Vec3) -> Option<Self> {
        let mut children = vec![0_usize; joints.len()];
        joints.iter().filter_map(|joint| joint.parent).for_each(|parent| children[parent] += 1);
        let ends: Vec<usize> = (0..joints.len()).filter(|at| children[*at] == 0).collect();
        let height = |joint: usize| joints[joint].position.dot(up);
        let aside = |joint: usize| joints[joint].position.dot(across);
        let heights = || (0..joints.len()).map(height);
        let (low, high) = (heights().fold(f32::MAX, f32::min), heights().fold(f32::MIN, f32::max));
        let widest = joints.iter().map(|joint| joint.position.abs().max_element()).fold(0.0, f32::max);
        let is_aside = |joint: usize| aside(joint).abs() > ASIDE * widest;
        // The lowest end of what hangs on each side of each joint in the middle.
        let mut hanging: BTreeMap<(usize, bool), usize> = BTreeMap::new();
        for end in ends.iter().copied().filter(|end| height(*end) - low < LOW * (high - low) && is_aside(*end)) {
            let middle = ancestors(joints, end).find(|at| !is_aside(*at));
            let Some(middle) = middle else { continue };
            let known = hanging.entry((middle, aside(end) > 0.0)).or_insert(end);
            if height(end) < height(*known) {
                *known = end;
            }
        }
        let pair = |middle: usize| Some([*hanging.get(&(middle, true))?, *hanging.get(&(middle, false))?]);
        let pairs: BTreeMap<usize, [usize; 2]> =
            hanging.keys().filter_map(|(middle, _)| Some((*middle, pair(*middle)?))).collect();
        let middles: Vec<usize> = pairs.keys().copied().collect();
        let [a, b] = middles[..] else { return None };
        let [hips, chest] = match (is_above(joints, a, b), is_above(joints, b, a)) {
            (true, _) => [a, b],
            (_, true) => [b, a],
            _ => return None,
        };
        let along = joints[chest].position - joints[hips].position;
        let forward = (along - up * along.dot(up)).try_normalize()?;
        let left = up.cross(forward);
        let mut chains = BTreeMap::from([(AnimalChain::Spine, path(joints, chest, Some(hips)))]);
        for (body, is_hind) in [(hips, true), (chest, false)] {
            for end in pairs[&body] {
                let side = if joints[end].position.dot(left) > 0.0 { BodySide::Left } else { BodySide::Right };
                let chain = if is_hind { AnimalChain::Hind(side) } else { AnimalChain::Front(side) };
                chains.insert(chain, path(joints, end, Some(body)));
            }
        }
        let reach = |joint: usize| joints[joint].position.dot(forward);
        // In the middle, what reaches farthest to the front is the head.
        let in_middle = |end: &usize| !is_aside(*end);
        let nose = ends.iter().copied().filter(|end| is_above(joints, chest, *end) && in_middle(end));
        if let Some(nose) = nose.max_by(|a, b| reach(*a).total_cmp(&reach(*b))) {
            let mut neck = path(joints, nose, Some(chest));
            let head = neck.iter().position(|joint| children[*joint] > 1).unwrap_or(neck.len() - 1);
            chains.insert(AnimalChain::Head, vec![neck[head]]);
            neck.truncate(head);
            if !neck.is_empty() {
                chains.insert(AnimalChain::Neck, neck);
            }
        }
        let is_behind = |end: &usize| {
            is_above(joints, hips, *end) && !is_above(joints, chest, *end) && *end != chest && in_middle(end)
        };
        let tail = ends.iter().copied().filter(is_behind).min_by(|a, b| reach(*a).total_cmp(&reach(*b)));
        if let Some(tail) = tail.filter(|tail| reach(*tail) < reach(hips)) {
            let stem: Vec<usize> = path(joints, tail, Some(hips));
            chains.insert(AnimalChain::Tail, stem.into_iter().filter(|at| !is_above(joints, *at, chest)).collect());
        }
        let tall = (height(hips) - low).max(f32::MIN_POSITIVE);
        let heights = heights().map(|height| (height - low) / tall).collect();
        let axes = Quat::from_mat3(&Mat3::from_cols(left, up, forward)).normalize();
        Some(Self { hips, chains, axes, heights })
    }

    /// Pairs of joints of two animals that turn alike, but for the hips: in legs those whose bones have their middles at the same
    /// height, in other chains those at the same share of the length.
    pub fn pairs(&self, joints: &[SkeletonJoint], other: &Self, others: &[SkeletonJoint]) -> Vec<(usize, usize)> {
        let mut pairs = Vec::new();
        for (chain, to) in &other.chains {
            let Some(from) = self.chains.get(chain) else { continue };
            let is_leg = matches!(chain, AnimalChain::Front(_) | AnimalChain::Hind(_));
            let places = |animal: &Self, joints: &[SkeletonJoint], chain: &[usize]| -> Vec<f32> {
                if is_leg { animal.middles(chain) } else { shares(joints, chain) }
            };
            let (own, wanted) = (places(self, joints, from), places(other, others, to));
            for (joint, wanted) in to.iter().zip(wanted) {
                let off = |at: &usize| (own[*at] - wanted).abs();
                if let Some(nearest) = (0..from.len()).min_by(|a, b| off(a).total_cmp(&off(b))) {
                    pairs.push((from[nearest], *joint));
                }
            }
        }
        pairs
    }

    /// Heights of the middles of the bones of a chain; the last joint has its own.
    fn middles(&self, chain: &[usize]) -> Vec<f32> {
        let height = |place: usize| self.heights[chain[place.min(chain.len() - 1)]];
        (0..chain.len()).map(|place| 0.5 * (height(place) + height(place + 1))).collect()
    }
}

/// Places of the joints of a chain, from 0 at the first to 1 at the last.
fn shares(joints: &[SkeletonJoint], chain: &[usize]) -> Vec<f32> {
    let mut done = 0.0;
    let mut places = vec![0.0; chain.len()];
    for (at, pair) in chain.windows(2).enumerate() {
        done += joints[pair[0]].position.distance(joints[pair[1]].position);
        places[at + 1] = done;
    }
    places.iter_mut().for_each(|place| *place /= done.max(f32::MIN_POSITIVE));
    places
}
