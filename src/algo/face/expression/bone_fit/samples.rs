//! Samples of the skin that should follow the field.

use std::{collections::BTreeSet, ops::RangeInclusive};

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use crate::{
    algo::face::{
        bones::{FaceBone, FaceBoneKind},
        expression::openings::{OpeningLines, OpeningSide},
        landmarks::Landmarks,
    },
    mesh::model::Weights,
};

/// The most samples of the skin, besides landmarks.
const SAMPLES: usize = 1600;
/// Weight of a landmark, as a share of the whole skin's weight.
const LANDMARK: f64 = 0.002;
/// Weight of the distance of two landmarks, as a share of the whole skin's weight.
const PAIR: f64 = 0.01;
/// Landmarks whose distance matters more than their positions: lips, lids, corners of the mouth, inner brows.
const PAIRS: [[usize; 2]; 9] =
    [[61, 67], [62, 66], [63, 65], [37, 41], [38, 40], [43, 47], [44, 46], [54, 48], [22, 21]];
/// Number of the first [`PAIRS`] that are lips, whose first landmark must stay above the second.
const LIPS: usize = 3;

/// Inner landmarks of the lips from corner to corner.
const INNER_LIPS: [[usize; 2]; 5] = [[60, 60], [61, 67], [62, 66], [63, 65], [64, 64]];
/// Inner landmarks of the upper and of the lower lip from corner to corner.
const INNER_UPPER_LIP: [usize; 5] = [60, 61, 62, 63, 64];
const INNER_LOWER_LIP: [usize; 5] = [60, 67, 66, 65, 64];
/// Number of parts into which places along the rims of the lips divide them.
const LIP_PARTS: usize = 32;
/// Places of them at which the rims are kept apart: bones at the corners of the mouth move both lips.
const LIP_PLACES: RangeInclusive<usize> = 7..=25;
/// Places along the rims of lids, those of their landmarks, as shares of the way between the corners. Beside them the rims of a
/// shut eye are so steep that points at different places would hold it open.
const LID_PLACES: [f32; 2] = [1.0 / 3.0, 2.0 / 3.0];
/// Points around a place of the rim of a lip that face those around the place of the other rim, the further the fewer, and the
/// largest distance sideways of those that do, in eye distances.
const AROUND_LIPS: (usize, f32) = (6, 0.01);
/// Points of the other rim that face each point of a rim of a lip at most, and the largest distance of points that do, in eye
/// distances, sideways and along the other axes. Places along the rims alone miss points between them.
const OPPOSITE_LIPS: usize = 1;
const OPPOSITE_REACH: [f32; 2] = [0.009, 0.01];
/// Distance, in eye distances, up to which a point is on the rim of its lip.
const RIM: f32 = 0.05;
/// Points and distance of lids, whose landmarks are further from each other.
const AROUND_LIDS: (usize, f32) = (9, 0.02);
/// Landmarks of the upper and the lower lid from corner to corner, of the left and the right eye.
const LIDS: [[[usize; 4]; 2]; 2] = [[[42, 43, 44, 45], [42, 47, 46, 45]], [[36, 37, 38, 39], [36, 41, 40, 39]]];
/// Places along lips and lids at which the upper one stays above the lower one.
const STATIONS: usize = 15;
/// Places of the lips among them: bones at the corners of the mouth move both.
const LIP_STATIONS: RangeInclusive<usize> = 4..=12;

/// Points of lips or lids of which one must stay above the other.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct FacingPoints {
    pub above: u32,
    pub below: u32,
    /// The left (0) or the right eye (1), whose lids may be closed; `None` for lips.
    pub eye: Option<usize>,
}

/// Pairs of facing points of a face.
#[derive(Default)]
pub(super) struct FacingPairs {
    /// Pairs at even places along lips and lids, which a repair keeps at their distances.
    pub apart: Vec<FacingPoints>,
    /// Many pairs along the rims of lips and at the landmarks of lids, which may touch.
    pub rims: Vec<FacingPoints>,
}

/// A place at which the field is sampled.
#[derive(Clone)]
pub(super) struct Mark {
    /// The point, or for landmarks the landmark itself.
    pub place: Vec3,
    /// Lip and lid that the place is on.
    pub known: OpeningSide,
    /// Weight of the jaw bone there.
    pub jaw: f64,
}

/// A point of the skin that should follow the field.
#[derive(Clone)]
pub(super) struct Sample {
    /// Number of the point; landmarks and pairs of them come after the points.
    pub number: usize,
    pub mark: Mark,
    /// The other end of a pair whose difference counts.
    pub minus: Option<Mark>,
    pub counts: f64,
    /// Numbers of skin bones among the skin bones, and their weights.
    pub influences: Vec<(u32, f64)>,
}

impl Sample {
    /// Displacement that a field asks of the sample.
    pub fn target(&self, displacement: impl Fn(&Mark) -> DVec3) -> DVec3 {
        let own = displacement(&self.mark);
        self.minus.as_ref().map_or(own, |minus| own - displacement(minus))
    }

    /// True if every field asks the same of both samples.
    pub fn asks_like(&self, other: &Self) -> bool {
        let same = |a: &Mark, b: &Mark| a.place == b.place && a.known == b.known;
        let minus = match (&self.minus, &other.minus) {
            (Some(a), Some(b)) => same(a, b),
            (None, None) => true,
            _ => false,
        };
        self.number == other.number && minus && same(&self.mark, &other.mark)
    }
}

/// A face whose skin is sampled.
struct Skin<'a> {
    points: &'a [Vec3],
    weights: &'a Weights,
    bones: &'a [FaceBone],
    /// Number of each bone among the skin bones.
    unknown_of: Vec<u32>,
    /// Marks the jaw and bones below the mouth's line.
    is_lower: Vec<bool>,
}

/// The influences of a point; none past the end of `weights`.
pub(super) fn influences(weights: &Weights, point: usize) -> impl Iterator<Item = (u32, f32)> + '_ {
    let range = match (weights.starts.get(point), weights.starts.get(point + 1)) {
        (Some(&start), Some(&end)) => start as usize..end as usize,
        _ => 0..0,
    };
    let joints = weights.joints.get(range.clone()).unwrap_or_default();
    joints.iter().copied().zip(weights.values.get(range).unwrap_or_default().iter().copied())
}

/// Samples on the whole skin and at the landmarks, and the points of lips and lids that face each other.
pub(super) fn gather(
    points: &[Vec3],
    mask: &[bool],
    weights: &Weights,
    bones: &[FaceBone],
    landmarks: &Landmarks,
    opening_lines: &OpeningLines,
) -> (Vec<Sample>, FacingPairs) {
    let mut unknown_of = vec![u32::MAX; bones.len()];
    let skin_bones = (0..bones.len()).filter(|&bone| bones[bone].kind == FaceBoneKind::Skin);
    for (unknown, bone) in skin_bones.enumerate() {
        unknown_of[bone] = unknown as u32;
    }
    let is_lower =
        bones.iter().map(|bone| bone.kind == FaceBoneKind::Jaw || !opening_lines.above_mouth(bone.position)).collect();
    let skin = Skin { points, weights, bones, unknown_of, is_lower };
    let lower_share: Vec<f32> = (0..points.len()).map(|index| skin.lower_share(index)).collect();
    let mut samples = skin.everywhere(mask, landmarks, opening_lines, &lower_share);
    let candidates: Vec<usize> =
        (0..points.len()).filter(|&index| mask.is_empty() || mask.get(index).copied().unwrap_or(false)).collect();
    let nearest = |(mark, place): (usize, &Vec3)| {
        let known = OpeningSide::of_landmark(mark);
        let fits = |index: usize| match known.upper_lip {
            None => true,
            Some(upper) => (lower_share[index] < 0.5) == upper,
        };
        // The first of equals, as few comparisons as there are points.
        let mut best: Option<(f32, usize)> = None;
        for &index in &candidates {
            let distance = points[index].distance_squared(*place);
            if best.is_none_or(|(least, _)| distance < least) && fits(index) {
                best = Some((distance, index));
            }
        }
        best.map(|(_, index)| index)
    };
    let all_nearest: Vec<Option<usize>> = landmarks.points.par_iter().enumerate().map(nearest).collect();
    let mut at_marks = Vec::new();
    for (mark, (&place, nearest)) in landmarks.points.iter().zip(all_nearest).enumerate() {
        let known = OpeningSide::of_landmark(mark);
        let sample = nearest.and_then(|index| skin.sample(index, place));
        if let Some(mut sample) = sample.clone() {
            sample.number = points.len() + mark;
            sample.mark.known = known;
            sample.counts = LANDMARK;
            samples.push(sample);
        }
        at_marks.push(nearest.zip(sample));
    }
    let mut apart = Vec::new();
    for (number, [a, b]) in PAIRS.into_iter().enumerate() {
        let (Some(Some((point, one))), Some(Some((other_point, other)))) = (at_marks.get(a), at_marks.get(b)) else {
            continue;
        };
        let minus = Mark { known: OpeningSide::of_landmark(b), ..other.mark.clone() };
        let number_of_pair = points.len() + landmarks.points.len() + number;
        let mut pair = Sample { number: number_of_pair, counts: PAIR, minus: Some(minus), ..one.clone() };
        pair.mark.known = OpeningSide::of_landmark(a);
        for &(unknown, weight) in &other.influences {
            match pair.influences.iter_mut().find(|(known, _)| *known == unknown) {
                Some((_, known)) => *known -= weight,
                None => pair.influences.push((unknown, -weight)),
            }
        }
        samples.push(pair);
        if number < LIPS && point != other_point {
            apart.push(FacingPoints { above: *point as u32, below: *other_point as u32, eye: None });
        }
    }
    apart.extend(facing_lips(points, &candidates, &lower_share, landmarks));
    apart.extend([0, 1].into_iter().flat_map(|eye| facing_lids(points, &candidates, landmarks, eye)));
    let rims = rims(points, &candidates, &lower_share, landmarks);
    (samples, FacingPairs { apart, rims })
}

/// Points of the upper and the lower lip that face each other, at even places between the corners of the mouth.
fn facing_lips(points: &[Vec3], candidates: &[usize], lower_share: &[f32], landmarks: &Landmarks) -> Vec<FacingPoints> {
    let line = INNER_LIPS.map(|[above, below]| landmarks.points[above].midpoint(landmarks.points[below]));
    let lips = near_line(points, candidates, &line, landmarks);
    let facing = |place: Vec3| {
        let on_lip = |is_lower: bool| lips.iter().copied().filter(move |&lip| (lower_share[lip] >= 0.5) == is_lower);
        let [above, below] = [nearest(points, on_lip(false), place)?, nearest(points, on_lip(true), place)?];
        Some(FacingPoints { above, below, eye: None })
    };
    LIP_STATIONS.filter_map(|station| facing(along(&line, station))).collect()
}

/// Points of the upper and the lower lid of the left (0) or the right eye (1) that face each other, at even places between the
/// corners of the eye.
fn facing_lids(points: &[Vec3], candidates: &[usize], landmarks: &Landmarks, eye: usize) -> Vec<FacingPoints> {
    let [upper, lower] = LIDS[eye].map(|lid| lid.map(|mark| landmarks.points[mark]));
    let lids = near_line(points, candidates, &[upper, lower].concat(), landmarks);
    let facing = |station: usize| {
        let [upper, lower] = [along(&upper, station), along(&lower, station)];
        let middle = upper.midpoint(lower);
        let on_lid = |is_lower: bool| lids.iter().copied().filter(move |&lid| (points[lid].y < middle.y) == is_lower);
        let [above, below] = [nearest(points, on_lid(false), upper)?, nearest(points, on_lid(true), lower)?];
        Some(FacingPoints { above, below, eye: Some(eye) })
    };
    (1..=STATIONS).filter_map(facing).collect()
}

/// Pairs of points along the rims of lips and lids, of which one is above the other.
fn rims(points: &[Vec3], candidates: &[usize], lower_share: &[f32], landmarks: &Landmarks) -> Vec<FacingPoints> {
    let places = |marks: &[usize]| -> Vec<Vec3> { marks.iter().map(|mark| landmarks.points[*mark]).collect() };
    let lip_places: Vec<f32> = LIP_PLACES.map(|place| place as f32 / LIP_PARTS as f32).collect();
    let mut rims: BTreeSet<(Option<usize>, u32, u32)> = BTreeSet::new();
    let openings = [(None, INNER_UPPER_LIP.as_slice(), INNER_LOWER_LIP.as_slice())];
    let lids = LIDS.iter().enumerate().map(|(eye, [upper, lower])| (Some(eye), upper.as_slice(), lower.as_slice()));
    for (eye, upper, lower) in openings.into_iter().chain(lids) {
        let [upper, lower] = [places(upper), places(lower)];
        let near = near_line(points, candidates, &[upper.as_slice(), &lower].concat(), landmarks);
        let is_lower = |point: usize| match eye {
            None => lower_share[point] >= 0.5,
            Some(_) => points[point].y < height_between(&upper, &lower, points[point].x),
        };
        let (below, above): (Vec<usize>, Vec<usize>) = near.into_iter().partition(|point| is_lower(*point));
        let places = match eye {
            None => lip_places.as_slice(),
            Some(_) => &LID_PLACES,
        };
        let (count, reach) = if eye.is_none() { AROUND_LIPS } else { AROUND_LIDS };
        let reach = reach * landmarks.eye_distance();
        for share in places {
            let [above, below] = [(&above, &upper), (&below, &lower)]
                .map(|(of, line)| around(points, of, part_way(line, *share), count));
            for (rank, above) in above.iter().enumerate() {
                let below = below.iter().take(count - rank);
                let facing = below.filter(|below| (points[*above].x - points[**below].x).abs() <= reach);
                rims.extend(facing.map(|below| (eye, *above as u32, *below as u32)));
            }
        }
        if eye.is_none() {
            let [above, below] =
                [(&above, &upper), (&below, &lower)].map(|(of, line)| on_rim(points, of, line, landmarks));
            let facing = opposite(points, &above, &below, landmarks);
            rims.extend(facing.into_iter().map(|[above, below]| (eye, above as u32, below as u32)));
            let facing = opposite(points, &below, &above, landmarks);
            rims.extend(facing.into_iter().map(|[below, above]| (eye, above as u32, below as u32)));
        }
    }
    rims.into_iter().map(|(eye, above, below)| FacingPoints { above, below, eye }).collect()
}

/// Points on the rim of a lip, as far from the corners of the mouth as places of rims are.
fn on_rim(points: &[Vec3], of: &[usize], line: &[Vec3], landmarks: &Landmarks) -> Vec<usize> {
    let [from, to] =
        [LIP_PLACES.start(), LIP_PLACES.end()].map(|place| part_way(line, *place as f32 / LIP_PARTS as f32).x);
    let near = RIM * landmarks.eye_distance();
    let is_on = |point: &usize| {
        let Vec3 { x, y, .. } = points[*point];
        (from.min(to)..=from.max(to)).contains(&x) && (height(line, x) - y).abs() < near
    };
    of.iter().copied().filter(is_on).collect()
}

/// Points of one rim, each with the nearest points of the other rim.
fn opposite(points: &[Vec3], of: &[usize], other: &[usize], landmarks: &Landmarks) -> Vec<[usize; 2]> {
    let [sideways, along] = OPPOSITE_REACH.map(|reach| reach * landmarks.eye_distance());
    let reach = Vec3::new(sideways, along, along);
    let nearest = |point: usize| {
        let near = other.iter().copied().filter(|other| (points[point] - points[*other]).abs().cmple(reach).all());
        around(points, &near.collect::<Vec<usize>>(), points[point], OPPOSITE_LIPS)
            .into_iter()
            .map(move |other| [point, other])
    };
    of.iter().copied().flat_map(nearest).collect()
}

/// Height halfway between two lines from corner to corner.
fn height_between(upper: &[Vec3], lower: &[Vec3], x: f32) -> f32 {
    0.5 * (height(upper, x) + height(lower, x))
}

/// Height of a line at a place; that of the nearest end beyond its ends.
fn height(line: &[Vec3], x: f32) -> f32 {
    let mut height = None;
    for ends in line.windows(2) {
        let [a, b] = [ends[0], ends[1]];
        if (a.x <= x) != (b.x <= x) {
            height = Some(a.y + (b.y - a.y) * ((x - a.x) / (b.x - a.x)));
        }
    }
    let end = line.iter().min_by(|a, b| (a.x - x).abs().total_cmp(&(b.x - x).abs()));
    height.or(end.map(|end| end.y)).unwrap_or_default()
}

/// The `count` points that are nearest to a place.
fn around(points: &[Vec3], of: &[usize], place: Vec3, count: usize) -> Vec<usize> {
    let mut near = of.to_vec();
    near.sort_by(|a, b| points[*a].distance_squared(place).total_cmp(&points[*b].distance_squared(place)));
    near.truncate(count);
    near
}

/// Points near the corners of a line.
fn near_line(points: &[Vec3], candidates: &[usize], line: &[Vec3], landmarks: &Landmarks) -> Vec<usize> {
    let near = 0.2 * landmarks.eye_distance();
    let is_near = |point: &usize| line.iter().any(|corner| corner.distance(points[*point]) < near);
    candidates.iter().copied().filter(is_near).collect()
}

/// The point that is nearest to a place, the first of equals.
fn nearest(points: &[Vec3], of: impl Iterator<Item = usize>, place: Vec3) -> Option<u32> {
    let away = |point: &usize| points[*point].distance_squared(place);
    of.min_by(|a, b| away(a).total_cmp(&away(b))).map(|point| point as u32)
}

/// A place on a line, `station` of [`STATIONS`] between its ends.
fn along(line: &[Vec3], station: usize) -> Vec3 {
    part_way(line, station as f32 / (STATIONS + 1) as f32)
}

/// A place on a line, a share of the way between its ends.
fn part_way(line: &[Vec3], share: f32) -> Vec3 {
    let at = share * (line.len() - 1) as f32;
    let from = (at as usize).min(line.len() - 2);
    line[from].lerp(line[from + 1], at - from as f32)
}

impl Skin<'_> {
    fn bone(&self, joint: u32) -> Option<usize> {
        (joint as usize).checked_sub(2).filter(|&bone| bone < self.bones.len())
    }

    /// Share of a point's weights that belongs to the jaw and to bones below the mouth's line.
    fn lower_share(&self, index: usize) -> f32 {
        let (mut lower, mut all) = (0.0, 0.0);
        for (joint, weight) in influences(self.weights, index) {
            let Some(bone) = self.bone(joint) else { continue };
            all += weight;
            if self.is_lower[bone] {
                lower += weight;
            }
        }
        lower / all.max(1e-6)
    }

    /// Samples on the whole skin.
    fn everywhere(
        &self,
        mask: &[bool],
        landmarks: &Landmarks,
        opening_lines: &OpeningLines,
        lower_share: &[f32],
    ) -> Vec<Sample> {
        let mut samples = Vec::new();
        let thinned = self.thinned(mask, landmarks);
        for (index, &point) in self.points.iter().enumerate().filter(|(index, _)| thinned[*index]) {
            let Some(mut sample) = self.sample(index, point) else { continue };
            // Where lips touch, only the skin's own weights tell the upper from the lower one.
            if opening_lines.is_near_mouth_line(point) {
                match lower_share[index] {
                    share if share > 0.8 => sample.mark.known.upper_lip = Some(false),
                    share if share < 0.2 => sample.mark.known.upper_lip = Some(true),
                    _ => continue,
                }
            }
            samples.push(sample);
        }
        let each = 1.0 / samples.len().max(1) as f64;
        for sample in &mut samples {
            sample.counts = each;
        }
        samples
    }

    /// Marks the points of the mask that become samples: all, or on a dense mesh about [`SAMPLES`] of them. A point and
    /// its mirror image are both taken or both left out.
    fn thinned(&self, mask: &[bool], landmarks: &Landmarks) -> Vec<bool> {
        let inside = |index: usize| mask.is_empty() || mask.get(index).copied().unwrap_or(false);
        let count = (0..self.points.len()).filter(|&index| inside(index)).count();
        if count <= SAMPLES {
            return (0..self.points.len()).map(inside).collect();
        }
        let fine = 1000.0 / landmarks.eye_distance().max(f32::MIN_POSITIVE);
        let limit = (SAMPLES as f64 / count as f64 * f64::from(u32::MAX)) as u64;
        let taken = |point: &Vec3| {
            let place = [(point.x - landmarks.middle).abs(), point.y, point.z];
            let mut mixed = 0x9e37_79b9_7f4a_7c15_u64;
            for value in place {
                mixed = (mixed ^ ((value * fine).round() as i64 as u64)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
                mixed ^= mixed >> 29;
            }
            (mixed >> 32) < limit
        };
        self.points.iter().enumerate().map(|(index, point)| inside(index) && taken(point)).collect()
    }

    /// A sample of a point, if bones move it at all.
    fn sample(&self, index: usize, place: Vec3) -> Option<Sample> {
        let mark = Mark { place, known: OpeningSide::default(), jaw: 0.0 };
        let mut sample = Sample { number: index, mark, minus: None, counts: 0.0, influences: Vec::new() };
        let mut all = 0.0;
        for (joint, weight) in influences(self.weights, index) {
            let Some(bone) = self.bone(joint).filter(|_| weight.is_finite()) else { continue };
            all += weight;
            match self.bones[bone].kind {
                FaceBoneKind::Skin => sample.influences.push((self.unknown_of[bone], f64::from(weight))),
                FaceBoneKind::Jaw => sample.mark.jaw += f64::from(weight),
                FaceBoneKind::Eye | FaceBoneKind::Tongue => {}
            }
        }
        (all > 0.02 && place.is_finite() && !sample.influences.is_empty()).then_some(sample)
    }
}
