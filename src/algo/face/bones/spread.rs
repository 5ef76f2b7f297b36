//! Distribution of bones among the parts of the face, and their places by k-means.

use glam::Vec3;

use super::{FaceBonesError, FaceBonesSettings, map::FaceMap, sample::Patch};
use crate::algo::kmeans::{KMeansSettings, kmeans};

/// Samples for each bone of a part.
const SAMPLES: usize = 96;
/// The most rounds of one run.
const ROUNDS: usize = 100;

/// Rules of the clustering for a part of the face.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct PartRule {
    /// Share of the bones.
    pub share: f64,
    /// True for parts that stand on both sides of the face, such as cheeks; false for parts that cross the middle.
    pub lateral: bool,
    /// Largest number of bones.
    pub most: usize,
}

/// The parts by number: the rest, upper and lower lip, corners, brows, upper and lower lids.
pub(crate) const PARTS: [PartRule; 7] = [
    PartRule { share: 0.42, lateral: false, most: usize::MAX },
    PartRule { share: 0.12, lateral: false, most: usize::MAX },
    PartRule { share: 0.10, lateral: false, most: usize::MAX },
    PartRule { share: 0.17, lateral: true, most: 2 },
    PartRule { share: 0.19, lateral: true, most: usize::MAX },
    PartRule { share: 0.15, lateral: true, most: usize::MAX },
    PartRule { share: 0.09, lateral: true, most: usize::MAX },
];

/// A bone before it has a name.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Seat {
    pub place: Vec3,
    pub part: usize,
    /// Marks a seat on the middle plane.
    pub middle: bool,
    /// Number of the pair, if it has a mirror image.
    pub pair: Option<usize>,
    pub fixed: Option<usize>,
}

/// A fixed place and the part that it lies in.
#[derive(Debug, Clone, Copy)]
pub(crate) struct FixedPlace {
    pub place: Vec3,
    pub index: usize,
    pub part: usize,
    pub middle: bool,
}

/// Fixed places of a half before it is clustered, two in one slot where both sides are fixed.
#[derive(Debug, Clone, Copy)]
struct Slot {
    first: FixedPlace,
    second: Option<FixedPlace>,
}

/// Number of bones of each part: `bones` in all, at least `least` each, none for an empty part.
///
/// By the method of highest averages: the next bone, or pair of bones, goes to the part with the largest share per
/// bone.
pub(crate) fn quotas(bones: usize, least: &[usize], empty: &[bool], paired: bool) -> Vec<usize> {
    let mut quotas = least.to_vec();
    let mut left = bones.saturating_sub(quotas.iter().sum());
    while left > 0 {
        let mut best: Option<(f64, usize, usize)> = None;
        for (part, rule) in PARTS.iter().enumerate().filter(|(part, _)| !empty[*part]) {
            // If nothing else fits, a part in the middle takes any number; the rest has no limit.
            let cost = if rule.lateral && paired { 2 } else { 1 };
            let have = quotas[part];
            if cost > left || have + cost > rule.most {
                continue;
            }
            // The rest comes late: a few bones are more useful on lips, brows and lids.
            let offset = if part == 0 { 1.0 } else { 0.5 * cost as f64 };
            let score = rule.share / (have as f64 + offset);
            if best.is_none_or(|b| score > b.0) {
                best = Some((score, part, cost));
            }
        }
        let Some((_, part, cost)) = best else { break };
        quotas[part] += cost;
        left -= cost;
    }
    quotas
}

/// k-means of one part.
pub(crate) struct Spreader<'a> {
    pub map: &'a FaceMap,
    pub settings: &'a FaceBonesSettings,
    pub progress: &'a (dyn Fn(f32) -> bool + Sync),
    pub rounds: usize,
    pub pairs: usize,
}

impl Spreader<'_> {
    /// Seats of a part with separate sides: `count` in all.
    pub fn plain(
        &mut self,
        part: usize,
        patch: &[&Patch],
        count: usize,
        fixed: &[FixedPlace],
        seats: &mut Vec<Seat>,
    ) -> Result<(), FaceBonesError> {
        let mut points = Vec::new();
        for patch in patch {
            points.extend(patch.sample(count.max(1) * SAMPLES));
        }
        let places: Vec<Vec3> = fixed.iter().map(|f| f.place).collect();
        for (i, place) in self.run(&points, &places, count, part)?.into_iter().enumerate() {
            let own = fixed.get(i);
            seats.push(Seat {
                place: own.map_or(place, |f| f.place),
                part,
                middle: own.is_some_and(|f| f.middle),
                pair: None,
                fixed: own.map(|f| f.index),
            });
        }
        Ok(())
    }

    /// Seats of a part in pairs, and on the middle plane where the part crosses it: `count` in all.
    ///
    /// The samples of both sides are folded onto one. In a part that crosses the plane, a strip along the plane is
    /// clustered on it, as wide as its bones are high, and the rest beside the strip in pairs.
    pub fn mirrored(
        &mut self,
        part: usize,
        patches: &[Patch; 2],
        count: usize,
        fixed: &[FixedPlace],
        seats: &mut Vec<Seat>,
    ) -> Result<(), FaceBonesError> {
        let on_plane: Vec<FixedPlace> = fixed.iter().copied().filter(|f| f.middle).collect();
        let slots = self.slots(fixed);
        let mut folded: Vec<Vec3> = Vec::new();
        for patch in patches {
            folded.extend(patch.sample(count.max(1) * SAMPLES / 2 + SAMPLES / 2));
        }
        for p in &mut folded {
            p.x = (p.x - self.map.middle).abs();
        }
        let middles = if PARTS[part].lateral {
            0
        } else {
            let area: f64 = patches.iter().map(|p| p.corners.iter().map(area).sum::<f64>()).sum();
            let most = count.saturating_sub(2 * slots.len());
            middle_count(&mut folded, count, on_plane.len(), most, area)
        };
        let sides = (count - middles.min(count)) / 2;
        let strip = if sides == 0 { folded.len() } else { folded.len() * middles / count.max(1) };
        if middles > 0 {
            let mut points = folded[..strip].to_vec();
            points.iter_mut().for_each(|p| p.x = 0.0);
            let places: Vec<Vec3> = on_plane.iter().map(|f| f.place.with_x(0.0)).collect();
            for (i, place) in self.run(&points, &places, middles, part)?.into_iter().enumerate() {
                let own = on_plane.get(i);
                let place = own.map_or(place.with_x(self.map.middle), |f| f.place);
                seats.push(Seat { place, part, middle: true, pair: None, fixed: own.map(|f| f.index) });
            }
        }
        if sides > 0 {
            let points = &folded[strip.min(folded.len())..];
            let places: Vec<Vec3> = slots.iter().map(|s| self.fold(s.first.place)).collect();
            let found = self.run(points, &places, sides, part)?;
            for (i, &place) in found.iter().enumerate() {
                let pair = Some(self.pairs);
                self.pairs += 1;
                match slots.get(i) {
                    None => {
                        let other = Vec3::new(self.map.middle - place.x, place.y, place.z);
                        let place = Vec3::new(self.map.middle + place.x, place.y, place.z);
                        seats.push(Seat { place, part, middle: false, pair, fixed: None });
                        seats.push(Seat { place: other, part, middle: false, pair, fixed: None });
                    }
                    Some(slot) => {
                        let (one, index) = (slot.first.place, Some(slot.first.index));
                        seats.push(Seat { place: one, part, middle: false, pair, fixed: index });
                        let (place, fixed) = match slot.second {
                            Some(second) => (second.place, Some(second.index)),
                            None => {
                                let place = settle(points, &found, i);
                                let side = if one.x < self.map.middle { 1.0 } else { -1.0 };
                                (place.with_x(self.map.middle + side * place.x), None)
                            }
                        };
                        seats.push(Seat { place, part, middle: false, pair, fixed });
                    }
                }
            }
        }
        Ok(())
    }

    /// Fixed places beside the plane; two that mirror each other share a slot.
    fn slots(&self, fixed: &[FixedPlace]) -> Vec<Slot> {
        let mut slots: Vec<Slot> = Vec::new();
        for &f in fixed.iter().filter(|f| !f.middle) {
            let left = f.place.x >= self.map.middle;
            let near = |s: &Slot| self.fold(s.first.place).distance(self.fold(f.place));
            let partner = slots
                .iter_mut()
                .filter(|s| s.second.is_none() && (s.first.place.x >= self.map.middle) != left)
                .min_by(|a, b| near(a).total_cmp(&near(b)))
                .filter(|s| near(s) < 0.1 * self.map.scale);
            match partner {
                Some(slot) => slot.second = Some(f),
                None => slots.push(Slot { first: f, second: None }),
            }
        }
        slots
    }

    /// Least number of seats for the fixed places of a part, with their partners.
    pub fn needed(&self, fixed: &[FixedPlace]) -> usize {
        fixed.iter().filter(|f| f.middle).count() + 2 * self.slots(fixed).len()
    }

    fn fold(&self, p: Vec3) -> Vec3 {
        p.with_x((p.x - self.map.middle).abs())
    }

    fn run(
        &mut self,
        points: &[Vec3],
        fixed: &[Vec3],
        groups: usize,
        part: usize,
    ) -> Result<Vec<Vec3>, FaceBonesError> {
        if groups <= fixed.len() {
            return Ok(fixed[..groups].to_vec());
        }
        let settings = KMeansSettings {
            groups,
            starts: self.settings.starts.max(1),
            seed: self.settings.seed.wrapping_add(part as u64),
            max_rounds: ROUNDS,
        };
        let found = kmeans(points, fixed, &settings, self.progress)?;
        self.rounds = self.rounds.max(found.rounds);
        Ok(found.centroids)
    }
}

fn area(c: &[Vec3; 3]) -> f64 {
    0.5 * f64::from((c[1] - c[0]).cross(c[2] - c[0]).length())
}

/// Number of the `count` bones on the middle plane; sorts `folded` by its distance from the plane.
///
/// The number makes the strip along the plane as wide as each of its bones is high, and leaves an even number beside
/// it.
fn middle_count(folded: &mut [Vec3], count: usize, least: usize, most: usize, area: f64) -> usize {
    folded.sort_by(|a, b| a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y)).then(a.z.total_cmp(&b.z)));
    let parity = count % 2;
    let mut best = (f64::INFINITY, least.max(parity));
    let mut middles = parity;
    while middles <= most {
        if middles >= least {
            let reach = (folded.len() * middles / count.max(1)).saturating_sub(1);
            let width = 2.0 * f64::from(folded.get(reach).map_or(0.0, |p| p.x));
            let own = area * middles as f64 / count as f64;
            // width = side of a square bone, where side = sqrt(own / middles)
            let ratio = width * width * middles as f64 / own.max(1e-30);
            let misfit = if middles == 0 { 2.0 } else { ratio.max(1.0 / ratio.max(1e-30)) };
            if misfit < best.0 {
                best = (misfit, middles);
            }
        }
        middles += 2;
    }
    best.1
}

/// Final place of the centroid `own` when all others stay.
fn settle(points: &[Vec3], centroids: &[Vec3], own: usize) -> Vec3 {
    let mut centroids = centroids.to_vec();
    for _ in 0..8 {
        let (mut sum, mut count) = (Vec3::ZERO, 0);
        for &p in points {
            let best = (0..centroids.len())
                .min_by(|&a, &b| p.distance_squared(centroids[a]).total_cmp(&p.distance_squared(centroids[b])));
            if best == Some(own) {
                sum += p;
                count += 1;
            }
        }
        if count > 0 {
            centroids[own] = sum / count as f32;
        }
    }
    centroids[own]
}
