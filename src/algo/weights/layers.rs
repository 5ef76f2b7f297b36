//! Layers around bones: the flesh, and hair, hoods and clothes around that. How far a bone runs and how thick its flesh is are
//! measured on the flesh alone, so that a body is bound as it is without what it wears.

use std::collections::BTreeMap;

use super::{WeightJoint, sight::Sight};

/// A layer around a last joint reaches at least this share of the farthest one's reach beyond it. A neck that ends in a head
/// of its own reaches less.
const REACH: f32 = 0.5;

/// The islands that the flesh of each joint may be, inner ones first.
pub(super) struct Layers {
    around: Vec<Vec<usize>>,
}

impl Layers {
    /// Layers of islands in which joints are at home; `homes` lists the joints of each island, rising.
    pub fn new(joints: &[WeightJoint], homes: &[Option<Vec<u32>>], sight: &Sight) -> Self {
        let has = |island: usize, joint: usize| {
            homes[island].as_ref().is_some_and(|joints| joints.binary_search(&(joint as u32)).is_ok())
        };
        let mut around: Vec<Vec<usize>> = vec![Vec::new(); joints.len()];
        // What is around several limbs, but not around the joint at which they meet, is held by them, as a sword by fingers.
        let mut is_held = vec![false; homes.len()];
        for (island, residents) in homes.iter().enumerate() {
            let mut limbs = 0;
            for joint in residents.iter().flatten().map(|joint| *joint as usize) {
                around[joint].push(island);
                limbs += usize::from(joints[joint].parent.is_none_or(|parent| !has(island, parent)));
            }
            is_held[island] = limbs > 1;
        }
        for (joint, islands) in around.iter_mut().enumerate().filter(|(_, islands)| islands.len() > 1) {
            // Flesh leads there from the joint above.
            if let Some(parent) = joints[joint].parent {
                retain_if_any(islands, |island| has(island, parent));
            }
            retain_if_any(islands, |island| !is_held[island]);
            if islands.len() > 1 {
                let head = joints[joint].head;
                let mut near: Vec<(f32, usize)> =
                    islands.iter().map(|island| (sight.distance(*island, head), *island)).collect();
                near.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
                *islands = near.into_iter().map(|(_, island)| island).collect();
            }
        }
        Self { around }
    }

    /// Island that is the flesh of a joint; `None` if none is around it.
    pub fn flesh(&self, joint: u32) -> Option<usize> {
        self.around[joint as usize].first().copied()
    }

    /// Island that is the flesh of a last joint, of which some points with their islands and distances from the joint are nearest
    /// to it; `None` if they are of no island around the joint.
    pub fn flesh_of_last(&self, joint: u32, points: impl Iterator<Item = (usize, f32)>) -> Option<usize> {
        let mut reaches = BTreeMap::<usize, f32>::new();
        for (island, distance) in points {
            let reach = reaches.entry(island).or_default();
            *reach = reach.max(distance);
        }
        let layers = || self.around[joint as usize].iter().filter_map(|island| Some((*island, *reaches.get(island)?)));
        let farthest = layers().map(|(_, reach)| reach).fold(0f32, f32::max);
        layers().find(|(_, reach)| *reach >= REACH * farthest).map(|(island, _)| island)
    }
}

/// Keeps the islands for which something holds, unless it holds for none.
fn retain_if_any(islands: &mut Vec<usize>, holds: impl Fn(usize) -> bool) {
    if islands.iter().any(|island| holds(*island)) {
        islands.retain(|island| holds(*island));
    }
}
