//! Equal weights on both sides of a symmetric head.
//!
//! Triangles of a mesh that was drawn symmetric are often cut along other diagonals on the two sides, and distances along
//! the surface differ by that.

use std::collections::HashMap;

use glam::{IVec3, Vec3};

use super::{FIRST, INFLUENCES, PRUNE};
use crate::{
    algo::face::{bones::FaceBone, landmarks::Landmarks},
    mesh::{influences::keep_strongest, model::Weights},
};

/// Largest distance between a point and the mirror image of its partner, as a share of the distance of the eyes.
const NEAR: f32 = 2e-4;
/// Largest distance between a bone and the mirror image of its partner, as a share of the distance of the eyes.
const APART: f32 = 0.01;
/// Largest number of a cell along each axis.
const FAR: f32 = 1e9;
/// Largest number of different places in a cell; others have no partner.
const CROWD: usize = 16;

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
        let cell = |point: Vec3| (point / near).round().clamp(Vec3::splat(-FAR), Vec3::splat(FAR)).as_ivec3();
        let mut cells: HashMap<IVec3, Vec<u32>> = HashMap::with_capacity(points.len());
        for (index, point) in points.iter().enumerate() {
            // Points at one place have equal weights: one of them stands for all.
            let cell = cells.entry(cell(*point)).or_default();
            if cell.len() < CROWD && !cell.iter().any(|other| points[*other as usize] == *point) {
                cell.push(index as u32);
            }
        }
        let partner = |point: &Vec3| {
            let image = point.with_x(2.0 * landmarks.middle - point.x);
            let distance = |other: &u32| points[*other as usize].distance_squared(image);
            let at = cell(image);
            let around = (0..27).map(|number| at + IVec3::new(number % 3 - 1, number / 3 % 3 - 1, number / 9 - 1));
            let found = around.filter_map(|cell| cells.get(&cell)).flatten().copied();
            let nearest = found.min_by(|a, b| distance(a).total_cmp(&distance(b)).then(a.cmp(b)));
            nearest.filter(|other| distance(other) <= near * near)
        };
        let partners: Vec<Option<u32>> = points.iter().map(partner).collect();
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

    /// Gives each point the mean of its own weights and its partner's mirrored ones, where all joints have an image.
    pub fn apply(&self, weights: &mut Weights) {
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
            keep_strongest(&mut list, INFLUENCES, PRUNE);
            both.push(list.iter().copied());
        }
        *weights = both;
    }
}
