//! Equal weights on both sides of a symmetric head.
//!
//! Triangles of a mesh that was drawn symmetric are often cut along other diagonals on the two sides, and distances along
//! the surface differ by that.

use std::collections::BTreeMap;

use glam::{IVec3, Vec3};
use rayon::prelude::*;

use super::{FIRST, PRUNE};
use crate::{
    algo::face::{bones::FaceBone, landmarks::Landmarks},
    mesh::{influences::keep_strongest_alike, model::Weights},
};

/// Largest distance between a point and the mirror image of its partner, as a share of the distance of the eyes.
const NEAR: f32 = 2e-4;
/// Largest distance between a bone and the mirror image of its partner, as a share of the distance of the eyes.
const APART: f32 = 0.01;
/// Width of a cell, as a multiple of the largest distance of partners: most points meet one cell only.
const CELL: f32 = 4.0;
/// Largest number of a cell along each axis.
const FAR: f32 = 1e9;
/// Largest number of different places in a cell; others have no partner.
const CROWD: usize = 64;

/// Points by the cells of a grid, for points near a place.
struct Cells<'a> {
    points: &'a [Vec3],
    width: f32,
    /// A number for the cell of each point, and the point, in order; one point for each place.
    sorted: Vec<(u64, u32)>,
}

impl<'a> Cells<'a> {
    fn new(points: &'a [Vec3], width: f32) -> Self {
        let mut sorted: Vec<(u64, u32)> = Vec::with_capacity(points.len());
        let mut cells = Self { points, width, sorted: Vec::new() };
        sorted.extend(points.iter().enumerate().map(|(index, point)| (number(cells.cell(*point)), index as u32)));
        sorted.par_sort_unstable_by(|a, b| {
            let [p, q] = [a, b].map(|entry| points[entry.1 as usize]);
            let place = p.x.total_cmp(&q.x).then(p.y.total_cmp(&q.y)).then(p.z.total_cmp(&q.z));
            a.0.cmp(&b.0).then(place).then(a.1.cmp(&b.1))
        });
        // Points at one place have equal weights: one of them stands for all.
        sorted.dedup_by(|next, kept| next.0 == kept.0 && points[next.1 as usize] == points[kept.1 as usize]);
        cells.sorted = sorted;
        cells
    }

    fn cell(&self, point: Vec3) -> IVec3 {
        (point / self.width).floor().clamp(Vec3::splat(-FAR), Vec3::splat(FAR)).as_ivec3()
    }

    /// The point nearest to a place, at most `reach` away; the first of equals.
    fn nearest(&self, place: Vec3, reach: f32) -> Option<u32> {
        let [low, high] = [-reach, reach].map(|by| self.cell(place + Vec3::splat(by)));
        let mut best: Option<(f32, u32)> = None;
        for x in low.x..=high.x {
            for y in low.y..=high.y {
                for z in low.z..=high.z {
                    let cell = number(IVec3::new(x, y, z));
                    let from = self.sorted.partition_point(|entry| entry.0 < cell);
                    let inside = self.sorted[from..].iter().take(CROWD).take_while(|entry| entry.0 == cell);
                    for &(_, point) in inside {
                        let distance = self.points[point as usize].distance_squared(place);
                        if distance <= reach * reach && best.is_none_or(|best| (distance, point) < best) {
                            best = Some((distance, point));
                        }
                    }
                }
            }
        }
        best.map(|(_, point)| point)
    }
}

/// A number for a cell. Two cells of one number only cost time: points are compared by their distance.
fn number(cell: IVec3) -> u64 {
    let [x, y, z] = cell.to_array().map(|value| u64::from(value as u32));
    (x << 42) ^ (y << 21) ^ z
}

/// Mirrored points and joints of a head.
pub(crate) struct Mirror {
    /// Mirrored point of each point, where there is one.
    points: Vec<Option<u32>>,
    /// Mirrored joint of each joint, where there is one: head, neck and bones in the middle are their own.
    joints: Vec<Option<u32>>,
}

impl Mirror {
    /// The mirror image of a head in the plane of its landmarks; `None` if its landmarks are not symmetric.
    ///
    /// `points` and `bones` are in head space.
    pub fn new(points: &[Vec3], bones: &[FaceBone], landmarks: &Landmarks) -> Option<Self> {
        let near = NEAR * landmarks.eye_distance();
        if !(landmarks.symmetric && near > 0.0 && near.is_finite()) {
            return None;
        }
        let cells = Cells::new(points, CELL * near);
        let partner = |point: &Vec3| cells.nearest(point.with_x(2.0 * landmarks.middle - point.x), near);
        let partners: Vec<Option<u32>> = points.par_iter().map(partner).collect();
        let is_mutual = |(point, other): (&Vec3, Option<u32>)| {
            let back = partners[other? as usize]?;
            (points[back as usize] == *point).then_some(other?)
        };
        let mutual = points.iter().zip(partners.iter().copied()).map(is_mutual).collect();
        // Bones that a person has moved may have left their partner's mirror image.
        let apart = APART * landmarks.eye_distance();
        let is_image = |bone: &FaceBone, other: usize| {
            let image = bone.position.with_x(2.0 * landmarks.middle - bone.position.x);
            bones.get(other).is_some_and(|other| other.position.distance(image) < apart)
        };
        let image = |(index, bone): (usize, &FaceBone)| {
            let other = bone.pair.unwrap_or(index);
            is_image(bone, other).then_some(FIRST + other as u32)
        };
        let joints = (0..FIRST).map(Some).chain(bones.iter().enumerate().map(image)).collect();
        Some(Self { points: mutual, joints })
    }

    /// Gives each point the mean of its own weights and its partner's mirrored ones, `most` of them, where all joints have an
    /// image.
    pub fn apply(&self, weights: &mut Weights, most: usize) {
        let mut both = Weights::default();
        let mut list: Vec<(u32, f32)> = Vec::new();
        for (point, partner) in self.points.iter().enumerate().take(weights.len()) {
            let image = |joint: u32| self.joints.get(joint as usize).copied().flatten();
            let has_images = |point: usize| weights.of(point).all(|(joint, _)| image(joint).is_some());
            let partner = partner.map(|partner| partner as usize).filter(|partner| *partner < weights.len());
            let Some(partner) = partner.filter(|partner| has_images(point) && has_images(*partner)) else {
                both.push(weights.of(point));
                continue;
            };
            list.clear();
            let mirrored = weights.of(partner).map(|(joint, weight)| (image(joint).unwrap_or(joint), weight));
            for (joint, weight) in weights.of(point).chain(mirrored) {
                match list.iter_mut().find(|(known, _)| *known == joint) {
                    Some((_, sum)) => *sum += 0.5 * weight,
                    None => list.push((joint, 0.5 * weight)),
                }
            }
            keep_strongest_alike(&mut list, most, PRUNE);
            both.push(list.iter().copied());
        }
        *weights = both;
    }

    /// Gives all points of each stiff part the weights of its first point that has a partner: [`Self::apply`] changes those
    /// alone, and a part in the middle has some.
    ///
    /// `part_of` has the number of each point's part, `None` for a point of no stiff part.
    pub fn stiffen(&self, weights: &mut Weights, part_of: &[Option<u32>]) {
        let mut leaders: BTreeMap<u32, usize> = BTreeMap::new();
        for (point, (part, partner)) in part_of.iter().zip(&self.points).enumerate().take(weights.len()) {
            if let (Some(part), Some(_)) = (part, partner) {
                leaders.entry(*part).or_insert(point);
            }
        }
        if leaders.is_empty() {
            return;
        }
        let mut stiff = Weights::default();
        for point in 0..weights.len() {
            let leader = part_of.get(point).copied().flatten().and_then(|part| leaders.get(&part));
            stiff.push(weights.of(leader.copied().unwrap_or(point)));
        }
        *weights = stiff;
    }
}
