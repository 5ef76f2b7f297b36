//! Search for the nearest cluster of a cluster.

use wide::{CmpLe, f32x8};

use super::{
    boxes::Boxes,
    engine::Cluster,
    pair::{Points, ROUNDING},
};

/// Data that searches run on.
#[derive(Clone, Copy)]
pub(super) struct Scene<'a> {
    pub(super) clusters: &'a [Cluster],
    pub(super) boxes: &'a Boxes,
    pub(super) points: &'a Points,
    /// Largest error of a mean in single precision.
    pub(super) slack: f32,
}

/// A cluster that may be the nearest.
#[derive(Clone, Copy)]
struct Candidate {
    slot: u32,
    /// Squared distance of the means.
    square: f32,
    /// The mean distance, once it is computed.
    distance: f64,
}

/// Buffers reused by the searches of a thread.
#[derive(Default)]
pub(super) struct Room {
    stack: Vec<(u32, u32, f32)>,
    candidates: Vec<Candidate>,
}

/// Factor that widens each bound on a distance, more than its rounding error.
const WIDER: f32 = 1.0 + 4e-6;

impl Scene<'_> {
    /// The nearest cluster of the one in `slot` and its distance, or `None` if it is alone.
    ///
    /// With `SQUARE` the distance is the mean squared one.
    pub(super) fn nearest<const SQUARE: bool>(&self, slot: u32, room: &mut Room) -> Option<(u32, f64)> {
        let own = slot as usize;
        let lanes = self.boxes.leaf(own / 8);
        let lane = own % 8;
        let place = [lanes.x.as_array_ref()[lane], lanes.y.as_array_ref()[lane], lanes.z.as_array_ref()[lane]];
        let variance = lanes.variance.as_array_ref()[lane];
        let Room { stack, candidates } = room;
        candidates.clear();
        // The least upper bound on a squared distance, and the squared distance of means that no candidate exceeds.
        let mut upper = f32::INFINITY;
        let mut within = f32::MAX;
        let query = place.map(f32x8::splat);
        let mut visit = |leaf: usize| {
            let means = self.boxes.leaf(leaf);
            let (x, y, z) = (means.x - query[0], means.y - query[1], means.z - query[2]);
            let square = x * x + y * y + z * z;
            let mut above = square + means.variance + f32x8::splat(variance);
            if leaf == own / 8 {
                above.as_array_mut()[lane] = f32::INFINITY;
            }
            let least = above.to_array().into_iter().fold(f32::INFINITY, f32::min);
            if least < upper {
                upper = least;
                let wide = upper.sqrt() * WIDER + 2.0 * self.slack;
                within = (wide * wide).min(f32::MAX);
            }
            let mut mask = square.cmp_le(f32x8::splat(within)).move_mask() as u32;
            if leaf == own / 8 {
                mask &= !(1 << lane);
            }
            let square = square.to_array();
            while mask != 0 {
                let lane = mask.trailing_zeros() as usize;
                mask &= mask - 1;
                candidates.push(Candidate {
                    slot: (leaf * 8 + lane) as u32,
                    square: square[lane],
                    distance: f64::INFINITY,
                });
            }
            within
        };
        let within_first = visit(own / 8);
        self.boxes.near(place, within_first, stack, |leaf| if leaf == own / 8 { within_first } else { visit(leaf) });
        candidates.retain(|candidate| candidate.square <= within);
        self.choose::<SQUARE>(own, candidates)
    }

    fn choose<const SQUARE: bool>(&self, own: usize, candidates: &mut [Candidate]) -> Option<(u32, f64)> {
        if candidates.len() > 1 {
            candidates.sort_unstable_by(|a, b| a.square.total_cmp(&b.square).then(a.slot.cmp(&b.slot)));
        }
        let this = &self.clusters[own];
        let mut best = f64::INFINITY;
        // Sums have this relative uncertainty; squares are exact enough.
        let band = if SQUARE { 1.0 } else { 1.0 + 2.5 * ROUNDING };
        let mut reach = f32::INFINITY;
        for candidate in candidates.iter_mut() {
            if candidate.square > reach {
                break;
            }
            candidate.distance = if SQUARE {
                this.square_distance(&self.clusters[candidate.slot as usize])
            } else {
                self.mean_distance(own, candidate.slot as usize)
            };
            if candidate.distance < best {
                best = candidate.distance;
                let distance = if SQUARE { best.sqrt() } else { best };
                let wide = distance as f32 * WIDER + 2.0 * self.slack;
                reach = (wide * wide).min(f32::MAX);
            }
        }
        let near = |candidate: &&Candidate| candidate.distance <= best * band;
        let close = candidates.iter().filter(near).count();
        let mut chosen: Option<(u32, f64)> = None;
        for candidate in candidates.iter().filter(near) {
            let mut distance = candidate.distance;
            if !SQUARE && close > 1 {
                distance = self.exact_distance(own, candidate.slot as usize);
            }
            // Of tied pairs the one whose younger cluster is older wins.
            let better = chosen.is_none_or(|(slot, least)| {
                distance < least || (distance == least && self.age(own, candidate.slot) < self.age(own, slot))
            });
            if better {
                chosen = Some((candidate.slot, distance));
            }
        }
        chosen
    }

    fn age(&self, own: usize, slot: u32) -> (u32, u32) {
        let (a, b) = (self.clusters[own].node, self.clusters[slot as usize].node);
        (a.max(b), a.min(b))
    }

    /// The mean distance, with the same bits in either order.
    fn mean_distance(&self, a: usize, b: usize) -> f64 {
        let (a, b) = (&self.clusters[a.min(b)], &self.clusters[a.max(b)]);
        self.points.sum(a.span, b.span) / (f64::from(a.span.size) * f64::from(b.span.size))
    }

    fn exact_distance(&self, a: usize, b: usize) -> f64 {
        let (a, b) = (&self.clusters[a.min(b)], &self.clusters[a.max(b)]);
        self.points.exact_sum(a.span, b.span) / (f64::from(a.span.size) * f64::from(b.span.size))
    }
}
