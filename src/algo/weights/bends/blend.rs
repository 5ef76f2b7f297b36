//! Blend of a bend: the share of it by which each place turns, from 0 above the joint to 1 below, changed until no triangle folds
//! and little volume is lost.
//!
//! A triangle folds where the turn rises too steeply along the limb for the distance from the joint, so each triangle limits
//! the turns of its corners. The limits are met one after the other, by the least change of the three turns, as in position
//! based dynamics (Müller et al. 2007); so the blend becomes as long as it must, and stays as it was elsewhere.

use std::collections::BTreeMap;

use glam::Vec3;

use super::{Flesh, Part, Pose, Row, mixed};

/// Least [openness](Part::openness) of a triangle.
const OPEN: f32 = 0.05;
/// Openness that a triangle is given which has less than the least.
const OPENED: f32 = 0.1;
/// Times that all triangles are looked at, and sweeps over those that fold in between.
const LOOKS: usize = 40;
const SWEEPS: usize = 8;
/// Share of a correction that is made at once, and the largest change of a turn.
const RELAXED: f32 = 0.7;
const STEP: f32 = 0.05;
/// Loss of volume, as a share of a section, above which the border of the flesh that moves is moved.
const LOSS: f32 = 0.11;
/// Steps of that, the largest change of a turn in one and in all, and rounds in which each step is smoothed.
const FILLS: usize = 12;
const FILL_STEP: f32 = 0.03;
const FILL: f32 = 0.15;
const SMOOTH: usize = 12;
/// Turns this near to 0 and 1 are none and whole ones.
const WHOLE: f32 = 0.01;
/// Edges within which a place finds the joints of a side that it has none of yet.
const NEAR: usize = 8;
/// Least share of a side that is kept.
const LEAST: f32 = 1e-5;

/// Turns of the places around one joint.
pub(super) struct Blend<'a> {
    flesh: &'a Flesh<'a>,
    part: Part,
    /// Shares of the lower side and of the half joint as they were.
    before: Vec<[f32; 2]>,
    /// Turns that changed, by the places of the part.
    changed: BTreeMap<u32, f32>,
}

/// Share of the bend by which a place turns that holds these shares of the lower side and of the half joint.
fn turn([lower, half]: [f32; 2]) -> f32 {
    lower + 0.5 * half
}

impl<'a> Blend<'a> {
    /// The blend that the weights make.
    pub fn new(flesh: &'a Flesh<'a>, part: &Part) -> Self {
        Self { flesh, part: part.clone(), before: part.shares.clone(), changed: BTreeMap::new() }
    }

    /// Shares of the lower side and of the half joint at a place with another turn: the half joint keeps what it has beyond
    /// its usual share of a turn.
    fn shares(&self, place: u32, to: f32) -> [f32; 2] {
        let was = self.before[place as usize];
        let usual = |turn: f32| match self.part.is_hinge {
            true => 2.0 * turn.min(1.0 - turn),
            false => 2.0 * turn * (1.0 - turn),
        };
        let half = (was[1] + usual(to) - usual(turn(was))).clamp(0.0, 2.0 * to.min(1.0 - to));
        [to - 0.5 * half, half]
    }

    /// True if the weights of a place stay.
    fn is_fixed(&self, place: u32) -> bool {
        self.flesh.fixed[self.part.places[place as usize] as usize]
    }

    fn set(&mut self, place: u32, to: f32) {
        self.part.shares[place as usize] = self.shares(place, to);
        self.changed.insert(place, to);
    }

    /// Rise of a number with the turn of a place; `of` gives the number.
    fn slope(&mut self, place: u32, step: f32, of: impl Fn(&Self) -> f32) -> f32 {
        let was = self.part.shares[place as usize];
        let (here, before) = (turn(was), of(self));
        let step = if here < 0.5 { step } else { -step };
        self.part.shares[place as usize] = self.shares(place, here + step);
        let after = of(self);
        self.part.shares[place as usize] = was;
        (after - before) / step
    }

    /// Changes turns until no triangle folds in a pose.
    pub fn unfold(&mut self, pose: &Pose) {
        for _ in 0..LOOKS {
            let is_closed =
                |corners: &[u32; 3]| self.part.openness(pose, corners).is_some_and(|openness| openness < OPEN);
            let folding: Vec<[u32; 3]> =
                self.part.triangles.iter().filter(|corners| is_closed(corners)).copied().collect();
            if folding.is_empty() {
                break;
            }
            for _ in 0..SWEEPS {
                folding.iter().for_each(|corners| self.open(pose, corners));
            }
        }
    }

    /// Changes the turns at the corners of a triangle that folds by as little as opens it.
    fn open(&mut self, pose: &Pose, corners: &[u32; 3]) {
        let Some(openness) = self.part.openness(pose, corners).filter(|openness| *openness < OPEN) else {
            return;
        };
        let slopes = corners.map(|place| match self.is_fixed(place) {
            true => 0.0,
            false => self.slope(place, 2e-3, |blend| blend.part.openness(pose, corners).unwrap_or(openness)),
        });
        let size: f32 = slopes.iter().map(|slope| slope * slope).sum();
        if !(size.is_finite() && size > 1e-6) {
            return;
        }
        let factor = RELAXED * (OPENED - openness) / size;
        for (place, slope) in corners.iter().zip(slopes).filter(|(_, slope)| *slope != 0.0) {
            let change = (factor * slope).clamp(-STEP, STEP);
            self.set(*place, (turn(self.part.shares[*place as usize]) + change).clamp(0.0, 1.0));
        }
    }

    /// Changes turns, where they are neither none nor whole, along the slope of the volume until a pose loses little of it.
    pub fn fill(&mut self, pose: &Pose, section: f32) {
        let volume = |[a, b, c]: [Vec3; 3]| a.dot(b.cross(c)) / 6.0;
        let flesh = self.flesh;
        let is_between = |place: &u32| {
            let turn = turn(self.before[*place as usize]);
            turn > WHOLE && turn < 1.0 - WHOLE && !self.is_fixed(*place)
        };
        let mut places: Vec<u32> = self.part.triangles.iter().flatten().copied().filter(is_between).collect();
        places.sort_unstable();
        places.dedup();
        // Neighbours of these places; those outside of the part stand behind its last place, where nothing changes.
        let count = self.part.places.len();
        let around = |place: &u32| {
            let around = flesh.neighbours[self.part.places[*place as usize] as usize].iter();
            around.map(|other| self.part.places.binary_search(other).unwrap_or(count)).collect::<Vec<usize>>()
        };
        let neighbours: Vec<Vec<usize>> = places.iter().map(around).collect();
        for _ in 0..FILLS {
            let lost = self.part.lost(pose) / section;
            if !(lost.is_finite() && lost > LOSS) {
                break;
            }
            let (mut slopes, mut areas) = (vec![0.0_f32; count], vec![0.0_f32; count]);
            for at in 0..self.part.triangles.len() {
                let corners = self.part.triangles[at];
                let ([a, b, c], ..) = self.part.corners(pose, &corners);
                let area = (b - a).cross(c - a).length() / 6.0;
                for place in corners {
                    areas[place as usize] += area;
                    let of = |blend: &Self| volume(blend.part.corners(pose, &corners).1);
                    slopes[place as usize] += self.slope(place, 5e-3, of);
                }
            }
            let mut changes = vec![0.0_f32; count + 1];
            for place in places.iter().map(|place| *place as usize).filter(|place| areas[*place] > 0.0) {
                let turn = turn(self.part.shares[place]);
                changes[place] = slopes[place] / areas[place] * turn * (1.0 - turn);
            }
            for _ in 0..SMOOTH {
                let smoothed = |(place, around): (&u32, &Vec<usize>)| {
                    let sum: f32 = around.iter().map(|other| changes[*other]).sum();
                    0.5 * (changes[*place as usize] + sum / around.len().max(1) as f32)
                };
                let smooth: Vec<f32> = places.iter().zip(&neighbours).map(smoothed).collect();
                places.iter().zip(smooth).for_each(|(place, change)| changes[*place as usize] = change);
            }
            let rate: f32 = places.iter().map(|place| slopes[*place as usize] * changes[*place as usize]).sum();
            let largest = places.iter().map(|place| changes[*place as usize].abs()).fold(0.0, f32::max);
            if !(rate.is_finite() && rate > 0.0 && largest > 0.0) {
                break;
            }
            let step = ((lost - LOSS) * section / rate).min(FILL_STEP / largest);
            for place in &places {
                let (now, was) = (turn(self.part.shares[*place as usize]), turn(self.before[*place as usize]));
                let to = (now + step * changes[*place as usize]).clamp(was - FILL, was + FILL);
                self.set(*place, to.clamp(0.0, 1.0));
            }
        }
    }

    /// Influences of the places whose turn changed: the joints of each side keep their proportions; a place that has none of
    /// a side takes those of the nearest places.
    pub fn rows(self) -> BTreeMap<u32, Row> {
        let row = |place: u32| {
            let [lower, half] = self.part.shares[place as usize];
            let mut row: Row = vec![(self.part.half, half)];
            self.share_out(place, true, lower, &mut row);
            self.share_out(place, false, 1.0 - lower - half, &mut row);
            row.retain(|(_, weight)| *weight > LEAST);
            row.sort_by_key(|(joint, _)| *joint);
            (self.part.places[place as usize], row)
        };
        self.changed.keys().map(|place| row(*place)).collect()
    }

    /// Adds a share of a side of the bend to the influences of a place.
    fn share_out(&self, place: u32, is_lower: bool, share: f32, row: &mut Row) {
        if share <= LEAST {
            return;
        }
        let half = self.part.half;
        let mut sources = vec![self.part.places[place as usize]];
        for _ in 0..NEAR {
            let mut found = mixed(sources.iter().map(|source| (&self.flesh.rows[*source as usize], 1.0)));
            found.retain(|(joint, _)| *joint != half && self.part.is_lower(self.flesh, *joint) == is_lower);
            let sum: f32 = found.iter().map(|(_, weight)| weight).sum();
            if sum > 0.0 {
                row.extend(found.iter().map(|(joint, weight)| (*joint, share * weight / sum)));
                return;
            }
            let around = |source: &u32| self.flesh.neighbours[*source as usize].iter().copied();
            let more: Vec<u32> = sources.iter().flat_map(around).collect();
            sources.extend(more);
            sources.sort_unstable();
            sources.dedup();
        }
    }
}
