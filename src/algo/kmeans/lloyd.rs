//! Lloyd's rounds: points to their nearest centroid, centroids to their points' mean.

use rayon::prelude::*;
use wide::{CmpLe, CmpLt, f32x8};

use super::{
    KMeansError, rearrange,
    seeds::square_distance,
    space::{BLOCK, Place, Space, Sum},
};

/// Result of a start.
pub(super) struct State {
    pub(super) centroids: Vec<Place>,
    /// Group of each point, in the order of the space's points.
    pub(super) labels: Vec<u32>,
    pub(super) square_error: f64,
    pub(super) rounds: usize,
}

/// Slack of bounds, in units: all places are within one, so this is far more than the rounding of roots, sums and
/// differences in single precision.
const SLACK: f32 = 4e-6;
/// State of a block before its first round.
const NEVER: f64 = f64::NEG_INFINITY;
/// Rounds after which centroids jump, by default.
pub(super) const JUMPS: &[usize] = &[5, 10, 16, 24];
pub(super) const NO_JUMPS: &[usize] = &[];
/// Length of strides that saves about half of the rounds.
pub(super) const LONG: f32 = 1.8;
/// Strides stay long while at least one point in this many changes its group.
const RESTLESS: usize = 2048;
/// Candidates hold until centroids have moved this share of the largest candidate distance.
const AHEAD: f32 = 0.05;
/// Number of blocks in a task.
const RUN: usize = 16;

/// Schedule of the rounds.
pub(super) struct Schedule {
    /// Largest number of rounds.
    pub(super) rounds: usize,
    /// Rounds after which centroids of little use jump to better places.
    pub(super) jumps: &'static [usize],
    /// Stride of centroids, relative to the way to their points' mean, while many points change their group. Up to a
    /// stride of two the error does not rise; once few points change, the stride is one.
    pub(super) stride: f32,
}

/// Eight centroids; lanes without one are at infinity.
struct Eight {
    x: f32x8,
    y: f32x8,
    z: f32x8,
}

struct Centroids {
    eights: Vec<Eight>,
    places: Vec<Place>,
}

/// Distances that centroids have moved since the bounds began: each one, in all and in the last round.
struct Travel {
    each: Vec<f32>,
    /// Distance of each centroid in the last round.
    last: Vec<f32>,
    furthest: f32,
    /// Sum over the rounds of the largest distance in each.
    most: f64,
}

/// The points of a block: their groups and bounds.
struct Bounds<'a> {
    labels: &'a mut [u32],
    /// Upper bound of the distance to the own centroid, less the distance that it had moved.
    own: &'a mut [f32],
    /// Lower bound of the distance to any other centroid, plus the sum of the largest distances moved.
    others: &'a mut [f32],
    /// Bounds of the whole block.
    block: &'a mut Block,
}

/// Bounds of a block.
#[derive(Clone)]
struct Block {
    /// Sum over the rounds of the largest distance that a candidate moved.
    most: f64,
    /// Value of `most` up to which no point of the block changes its group.
    holds: f64,
    /// The centroids that can be nearest or second nearest to any point of the block, in order.
    candidates: Vec<u32>,
    /// Sum of the largest distances of any centroid up to which `candidates` is complete.
    complete: f64,
}

/// Move of a point from one group to another; [`NOWHERE`] before the first round.
type Change = (u32, u32, u32);
const NOWHERE: u32 = u32::MAX;

/// Runs rounds until no point changes its group, or up to the largest number of rounds.
pub(super) fn run<const BOUNDS: bool>(
    space: &Space,
    seeds: Vec<Place>,
    schedule: &Schedule,
    report: &dyn Fn(usize) -> Result<(), KMeansError>,
) -> Result<State, KMeansError> {
    let count = space.points.len();
    let mut centroids = Centroids::new(seeds);
    let groups = centroids.places.len();
    let mut labels = vec![NOWHERE; count];
    let mut own = vec![0.0; count];
    let mut others = vec![0.0; count];
    let mut known = vec![Block { most: 0.0, holds: NEVER, candidates: Vec::new(), complete: NEVER }; space.boxes.len()];
    let mut sums = vec![Sum::default(); groups];
    let mut travel = Travel::new(groups);
    let mut rounds = 0;
    loop {
        let blocks = space
            .points
            .par_chunks(BLOCK)
            .zip(labels.par_chunks_mut(BLOCK))
            .zip(own.par_chunks_mut(BLOCK))
            .zip(others.par_chunks_mut(BLOCK))
            .zip(known.par_iter_mut())
            .enumerate()
            .with_min_len(RUN);
        let changes: Vec<Change> = blocks
            .fold(
                Default::default,
                |(mut changes, mut room): (Vec<Change>, Vec<Eight>),
                 (at, ((((points, labels), own), others), block))| {
                    let mut bounds = Bounds { labels, own, others, block };
                    if !BOUNDS || bounds.block.follow(&space.boxes[at], &centroids, &travel) {
                        bounds.settle::<BOUNDS>(at * BLOCK, points, &centroids, &travel, &mut changes, &mut room);
                    }
                    (changes, room)
                },
            )
            .map(|(changes, _)| changes)
            .reduce(Vec::new, |mut all, more| {
                all.extend(more);
                all
            });
        for &(at, from, to) in &changes {
            let place = space.points[at as usize];
            if from != NOWHERE {
                sums[from as usize].add(place, -1);
            }
            sums[to as usize].add(place, 1);
        }
        if changes.is_empty() || rounds >= schedule.rounds {
            break;
        }
        rounds += 1;
        report(rounds)?;
        let fixed = space.fixed.len();
        let swap = schedule.jumps.contains(&rounds) && rearrange::worth(groups - fixed, count);
        let mut moved: Vec<Place> = centroids.places.clone();
        let mut empty = Vec::new();
        let is_restless = rounds > 1 && changes.len() * RESTLESS > count;
        let stride = if is_restless { schedule.stride } else { 1.0 };
        for (group, sum) in sums.iter().enumerate().skip(fixed) {
            if sum.count > 0 {
                let (mean, from) = (sum.mean(), moved[group]);
                moved[group] = if stride == 1.0 {
                    mean
                } else {
                    [0, 1, 2].map(|axis| from[axis] + stride * (mean[axis] - from[axis]))
                };
            } else {
                empty.push(group);
            }
        }
        if !empty.is_empty() {
            refill(space, &centroids, &labels, &sums, &empty, &mut moved);
        }
        if swap {
            rearrange::rearrange(space, &labels, &mut moved, rearrange::CLEARLY, usize::MAX);
        }
        travel.go(&centroids.places, &moved);
        // The sums of distances lose digits as they grow, which the slack would no longer cover: bounds begin anew.
        // After a jump of a centroid no bound holds.
        if swap || travel.most > 4.0 {
            travel = Travel::new(groups);
            others.fill(f32::NEG_INFINITY);
            for block in &mut known {
                (block.most, block.holds, block.complete) = (0.0, NEVER, NEVER);
            }
        }
        centroids = Centroids::new(moved);
    }
    let blocks: Vec<f64> = space
        .points
        .par_chunks(BLOCK)
        .zip(labels.par_chunks(BLOCK))
        .map(|(points, labels)| {
            let square = |(point, label): (&Place, &u32)| exact_square(*point, centroids.places[*label as usize]);
            points.iter().zip(labels).map(square).sum()
        })
        .collect();
    Ok(State { centroids: centroids.places, labels, square_error: blocks.iter().sum(), rounds })
}

/// Puts each group without points at the point that is furthest from its centroid (the first of equal ones).
fn refill(space: &Space, centroids: &Centroids, labels: &[u32], sums: &[Sum], empty: &[usize], moved: &mut [Place]) {
    let mut far: Vec<(f32, u32)> = space
        .points
        .iter()
        .zip(labels)
        .enumerate()
        .filter(|(_, (_, label))| sums[**label as usize].count > 1)
        .map(|(at, (point, label))| (square_distance(*point, centroids.places[*label as usize]), at as u32))
        .collect();
    far.sort_unstable_by(|a, b| b.0.total_cmp(&a.0).then(space.index[a.1 as usize].cmp(&space.index[b.1 as usize])));
    let mut taken: Vec<Place> = Vec::new();
    let mut far = far.into_iter().map(|(_, at)| space.points[at as usize]);
    for &group in empty {
        if let Some(place) = far.find(|place| !taken.contains(place)) {
            moved[group] = place;
            taken.push(place);
        }
    }
}

fn exact_square(a: Place, b: Place) -> f64 {
    let apart = |axis: usize| f64::from(a[axis]) - f64::from(b[axis]);
    apart(0) * apart(0) + apart(1) * apart(1) + apart(2) * apart(2)
}

impl Bounds<'_> {
    /// Finds the nearest centroid of each point whose bounds do not decide it.
    fn settle<const BOUNDS: bool>(
        &mut self,
        start: usize,
        points: &[Place],
        centroids: &Centroids,
        travel: &Travel,
        changes: &mut Vec<Change>,
        near: &mut Vec<Eight>,
    ) {
        let most = self.block.most as f32;
        let mut room = f32::INFINITY;
        near.clear();
        for (at, point) in points.iter().enumerate() {
            let label = self.labels[at];
            if BOUNDS && label != NOWHERE {
                let least = self.others[at] - most - SLACK;
                let way = travel.each[label as usize];
                let margin = least - (self.own[at] + way);
                if margin > 0.0 {
                    room = room.min(margin);
                    continue;
                }
                let distance = square_distance(*point, centroids.places[label as usize]).sqrt();
                if distance + SLACK < least {
                    self.own[at] = distance + SLACK - way;
                    room = room.min(least - (distance + SLACK));
                    continue;
                }
            }
            let (nearest, square, second) = if BOUNDS {
                if near.is_empty() {
                    self.block.gather(centroids, near);
                }
                let (at, square, second) = nearest(near, *point);
                (self.block.candidates.get(at as usize).copied().unwrap_or(at), square, second)
            } else {
                nearest(&centroids.eights, *point)
            };
            let (distance, other) = (square.sqrt() + SLACK, second.sqrt());
            self.own[at] = distance - travel.each[nearest as usize];
            self.others[at] = other + most;
            room = room.min(other - SLACK - distance);
            if nearest != label {
                changes.push(((start + at) as u32, label, nearest));
                self.labels[at] = nearest;
            }
        }
        // Both bounds approach each other by no more than the largest distance moved.
        self.block.holds = self.block.most + f64::from((room - SLACK).max(0.0)) * 0.5;
    }
}

impl Travel {
    fn new(groups: usize) -> Self {
        Self { each: vec![0.0; groups], last: vec![0.0; groups], furthest: 0.0, most: 0.0 }
    }

    fn go(&mut self, from: &[Place], to: &[Place]) {
        self.furthest = 0.0;
        for (group, (from, to)) in from.iter().zip(to).enumerate() {
            let way = square_distance(*from, *to).sqrt() * (1.0 + 1e-6);
            self.each[group] += way;
            self.last[group] = way;
            self.furthest = self.furthest.max(way);
        }
        self.most += f64::from(self.furthest);
    }
}

impl Centroids {
    fn new(places: Vec<Place>) -> Self {
        Self { eights: places.chunks(8).map(|chunk| Eight::new(chunk.iter())).collect(), places }
    }
}

/// The nearest centroid (the first of equally near ones), its squared distance, and that of the second nearest.
fn nearest(eights: &[Eight], point: Place) -> (u32, f32, f32) {
    let [x, y, z] = point.map(f32x8::splat);
    let mut least = f32x8::splat(f32::INFINITY);
    let mut second = least;
    // Indices are exact in single precision up to 2^24 groups of eight.
    let mut which = f32x8::ZERO;
    for (at, eight) in eights.iter().enumerate() {
        let (dx, dy, dz) = (eight.x - x, eight.y - y, eight.z - z);
        let square = dx * dx + dy * dy + dz * dz;
        let closer = square.cmp_lt(least);
        second = second.fast_min(square.fast_max(least));
        least = least.fast_min(square);
        which = closer.blend(f32x8::splat(at as f32), which);
    }
    let (least, which, second) = (least.to_array(), which.to_array(), second.to_array());
    let mut best = (f32::INFINITY, u32::MAX);
    let mut next = f32::INFINITY;
    for lane in 0..8 {
        let group = (which[lane] as u32) * 8 + lane as u32;
        next = next.min(second[lane]);
        if least[lane] < best.0 || (least[lane] == best.0 && group < best.1) {
            next = next.min(best.0);
            best = (least[lane], group);
        } else {
            next = next.min(least[lane]);
        }
    }
    (best.1, best.0, next)
}

impl Block {
    /// Updates the block after the last round; returns whether a point may have changed its group.
    fn follow(&mut self, around: &(Place, Place), centroids: &Centroids, travel: &Travel) -> bool {
        let step = if travel.most < self.complete {
            self.candidates.iter().fold(0.0_f32, |most, &group| most.max(travel.last[group as usize]))
        } else {
            // Enough for some rounds like the last one.
            let ahead = self.choose(around, travel.furthest * 4.0, centroids);
            self.complete = travel.most + f64::from(ahead);
            travel.furthest
        };
        self.most += f64::from(step);
        self.most >= self.holds
    }

    fn gather(&self, centroids: &Centroids, near: &mut Vec<Eight>) {
        near.extend(
            self.candidates
                .chunks(8)
                .map(|chunk| Eight::new(chunk.iter().map(|&group| &centroids.places[group as usize]))),
        );
    }

    /// Chooses the candidates of a box: no point of the box is further from its two nearest centroids than the second
    /// least of the furthest distances to the box. They hold until centroids have moved by `ahead`, or further if that
    /// costs few candidates; returns this distance.
    fn choose(&mut self, (low, high): &(Place, Place), ahead: f32, centroids: &Centroids) -> f32 {
        let (low, high) = (low.map(f32x8::splat), high.map(f32x8::splat));
        let mut least = f32x8::splat(f32::INFINITY);
        let mut second = least;
        for eight in &centroids.eights {
            let mut far = f32x8::ZERO;
            for (axis, value) in [eight.x, eight.y, eight.z].into_iter().enumerate() {
                let out = (value - low[axis]).fast_max(high[axis] - value);
                far += out * out;
            }
            second = second.fast_min(far.fast_max(least));
            least = least.fast_min(far);
        }
        let mut all = [0.0; 16];
        all[..8].copy_from_slice(&least.to_array());
        all[8..].copy_from_slice(&second.to_array());
        all.sort_unstable_by(f32::total_cmp);
        let near = all[1].sqrt();
        let ahead = ahead.max(near * AHEAD);
        let reach = near + 2.0 * ahead + 2.0 * SLACK;
        let reach = f32x8::splat(reach * reach);
        self.candidates.clear();
        for (at, eight) in centroids.eights.iter().enumerate() {
            let mut near = f32x8::ZERO;
            for (axis, value) in [eight.x, eight.y, eight.z].into_iter().enumerate() {
                let out = (low[axis] - value).fast_max(value - high[axis]).fast_max(f32x8::ZERO);
                near += out * out;
            }
            let mut mask = near.cmp_le(reach).move_mask() as u32;
            while mask != 0 {
                let group = at as u32 * 8 + mask.trailing_zeros();
                mask &= mask - 1;
                if (group as usize) < centroids.places.len() {
                    self.candidates.push(group);
                }
            }
        }
        ahead
    }
}

impl Eight {
    fn new<'a>(places: impl Iterator<Item = &'a Place>) -> Self {
        let mut lanes = [[f32::INFINITY; 8]; 3];
        for (lane, place) in places.take(8).enumerate() {
            for (lanes, value) in lanes.iter_mut().zip(place) {
                lanes[lane] = *value;
            }
        }
        let [x, y, z] = lanes.map(f32x8::new);
        Self { x, y, z }
    }
}
