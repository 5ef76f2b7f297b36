//! Seeds spread over dense regions.

use super::space::{BLOCK, Place, Space};

/// Number of draws for a seed; the draw that lowers the error most is taken.
const DRAWS: usize = 12;

/// Pseudorandom numbers: SplitMix64 (Steele, Lea, Flood, "Fast splittable pseudorandom number generators", 2014).
pub(super) struct Random(u64);

impl Random {
    pub(super) fn new(seed: u64, start: u64) -> Self {
        let mut first = Self(seed ^ 0x6a09_e667_f3bc_c908);
        let base = first.next();
        Self(base ^ start.wrapping_mul(0xd1b5_4a32_d192_ed03))
    }

    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut bits = self.0;
        bits = (bits ^ bits >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        bits = (bits ^ bits >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
        bits ^ bits >> 31
    }

    /// A number from 0 (included) to 1 (excluded).
    fn part(&mut self) -> f64 {
        (self.next() >> 11) as f64 / (1_u64 << 53) as f64
    }
}

/// Distances of points from the seeds so far.
struct SeedDistances {
    /// The squared distance of each point to the nearest seed.
    square: Vec<f32>,
    /// Sum and largest of the squared distances in each block.
    blocks: Vec<(f64, f32)>,
}

/// Chooses the first centroids, fixed ones first; fails with the number of different places if they are too few.
pub(super) fn choose(space: &Space, groups: usize, mut random: Random) -> Result<Vec<Place>, usize> {
    let count = space.points.len();
    let blocks = space.boxes.iter().enumerate().map(|(block, _)| {
        let size = BLOCK.min(count - block * BLOCK);
        (size as f64 * f64::from(f32::MAX), f32::MAX)
    });
    let mut far = SeedDistances { square: vec![f32::MAX; count], blocks: blocks.collect() };
    let mut seeds = space.fixed.clone();
    for seed in &seeds {
        far.take(space, *seed);
    }
    if seeds.is_empty() {
        let first = space.points[(random.part() * count as f64) as usize];
        far.take(space, first);
        seeds.push(first);
    }
    while seeds.len() < groups {
        let total: f64 = far.blocks.iter().map(|block| block.0).sum();
        if total <= 0.0 {
            return finish(space, groups, seeds);
        }
        let mut best: Option<(Place, f64)> = None;
        for _ in 0..DRAWS {
            let seed = space.points[far.draw(random.part() * total)];
            let gain = far.gain(space, seed);
            if best.is_none_or(|(_, most)| gain > most) {
                best = Some((seed, gain));
            }
        }
        if let Some((seed, _)) = best {
            far.take(space, seed);
            seeds.push(seed);
        }
    }
    Ok(seeds)
}

/// Fills up with places that are not seeds yet, where all squared distances are (or are rounded to) zero.
fn finish(space: &Space, groups: usize, mut seeds: Vec<Place>) -> Result<Vec<Place>, usize> {
    let bits = |place: &Place| place.map(|value| (value + 0.0).to_bits());
    let mut places: Vec<[u32; 3]> = space.points.iter().map(bits).collect();
    places.sort_unstable();
    places.dedup();
    if places.len() < groups {
        return Err(places.len());
    }
    let mut taken: Vec<[u32; 3]> = seeds.iter().map(bits).collect();
    taken.sort_unstable();
    let free = places.iter().filter(|place| taken.binary_search(place).is_err());
    seeds.extend(free.take(groups - seeds.len()).map(|place| place.map(f32::from_bits)));
    Ok(seeds)
}

impl SeedDistances {
    /// The point at which the sum of squared distances reaches `sum`.
    fn draw(&self, mut sum: f64) -> usize {
        let mut last = 0;
        for (block, &(square, _)) in self.blocks.iter().enumerate() {
            if square <= 0.0 {
                continue;
            }
            last = block;
            if sum < square {
                break;
            }
            sum -= square;
        }
        let start = last * BLOCK;
        let mut chosen = start;
        for (at, &square) in self.square[start..].iter().take(BLOCK).enumerate() {
            if square > 0.0 {
                chosen = start + at;
                sum -= f64::from(square);
                if sum < 0.0 {
                    break;
                }
            }
        }
        chosen
    }

    /// Decrease of the sum of squared distances by a seed.
    fn gain(&self, space: &Space, seed: Place) -> f64 {
        let mut gain = 0.0;
        for (block, &(_, largest)) in self.blocks.iter().enumerate() {
            if outside(&space.boxes[block], seed) < largest {
                let range = block * BLOCK..(block * BLOCK + BLOCK).min(self.square.len());
                let lower: f32 = space.points[range.clone()]
                    .iter()
                    .zip(&self.square[range])
                    .map(|(point, &square)| (square - square_distance(*point, seed)).max(0.0))
                    .sum();
                gain += f64::from(lower);
            }
        }
        gain
    }

    fn take(&mut self, space: &Space, seed: Place) {
        for (block, entry) in self.blocks.iter_mut().enumerate() {
            if outside(&space.boxes[block], seed) < entry.1 {
                let range = block * BLOCK..(block * BLOCK + BLOCK).min(self.square.len());
                *entry = (0.0, 0.0);
                for (point, square) in space.points[range.clone()].iter().zip(&mut self.square[range]) {
                    *square = square.min(square_distance(*point, seed));
                    *entry = (entry.0 + f64::from(*square), entry.1.max(*square));
                }
            }
        }
    }
}

/// The squared distance of a place to a box.
fn outside((low, high): &(Place, Place), place: Place) -> f32 {
    let out = |axis: usize| (low[axis] - place[axis]).max(place[axis] - high[axis]).max(0.0);
    out(0) * out(0) + out(1) * out(1) + out(2) * out(2)
}

pub(super) fn square_distance(a: Place, b: Place) -> f32 {
    let (x, y, z) = (a[0] - b[0], a[1] - b[1], a[2] - b[2]);
    x * x + y * y + z * z
}
