//! Rings around bones: bracelets, belts and brims of hats. Near a joint both of its bones warm a ring, but it is stiff and
//! moves with the bone that runs through it.

use glam::{DMat3, Vec2, Vec3};

use super::{
    bone::BoneSegment,
    bone_tree::{BoneTree, closest_on},
};

/// Points that a ring has at least.
const FEWEST: usize = 12;
/// The nearest point of a ring is at least this share of the farthest one's distance away from the bone.
const HOLLOW: f32 = 0.5;
/// A ring reaches at most this share of its radius along the bone, to either side of the plane in which it lies.
const FLAT: f32 = 0.6;
/// Tangent of the angle up to which the plane of a ring leans from the bone that runs through it: 60 degrees.
const LEAN: f32 = 1.732;
/// Length of the mean of the directions from the bone to a ring's points: 0 all around it, 1 on one side.
const ROUND: f32 = 0.35;
/// Approximate number of places that are looked at first.
const SAMPLES: usize = 16;

/// Bones that may run through rings.
pub(super) struct RingBones<'a> {
    bones: &'a [BoneSegment],
    tree: BoneTree,
}

impl<'a> RingBones<'a> {
    pub fn new(bones: &'a [BoneSegment]) -> Self {
        Self { bones, tree: BoneTree::new(bones) }
    }

    /// Joint of the bone that some places are a ring around; of several, the one that is nearest to their middle. Where a bone
    /// branches, as at the hips, others than the one that runs through the ring are as near.
    pub fn bearer(&self, places: &[Vec3]) -> Option<u32> {
        if places.len() < FEWEST {
            return None;
        }
        let middle = places.iter().sum::<Vec3>() / places.len() as f32;
        let size = places.iter().map(|place| place.distance(middle)).fold(0f32, f32::max);
        let mut near: Vec<(f32, u32)> = Vec::new();
        self.tree.any_within(middle, size, |index| {
            let bone = &self.bones[index as usize];
            let gap = closest_on(bone, middle).distance(middle);
            if bone.head != bone.tail && gap < size {
                near.push((gap, index));
            }
            false
        });
        near.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        near.dedup();
        let bones = near.into_iter().map(|(_, index)| &self.bones[index as usize]);
        let outline = Outline::new(places, middle, size);
        let mut bones = bones.filter(|bone| outline.may_be_around(bone));
        bones.find(|bone| are_around(places, middle, bone)).map(|bone| bone.joint)
    }
}

/// Sums over places, taken once to find most of the bones that they are no ring around from a few of them.
struct Outline<'a> {
    places: &'a [Vec3],
    middle: Vec3,
    /// Largest distance from the middle.
    size: f32,
    /// Sum of the products of coordinates beside the middle.
    moments: DMat3,
}

impl<'a> Outline<'a> {
    fn new(places: &'a [Vec3], middle: Vec3, size: f32) -> Self {
        let products = |place: &Vec3| {
            let way = (*place - middle).as_dvec3();
            DMat3::from_cols(way * way.x, way * way.y, way * way.z)
        };
        let is_large = places.len() > 4 * SAMPLES;
        let moments = if is_large { places.iter().map(products).sum() } else { DMat3::ZERO };
        Self { places, middle, size, moments }
    }

    /// False if the places are no ring around a bone, which a few of them tell beyond all rounding.
    fn may_be_around(&self, bone: &BoneSegment) -> bool {
        /// Share by which a limit is missed at least.
        const SURE: f32 = 1.1;
        if self.moments == DMat3::ZERO {
            return true;
        }
        let (at, along) = (closest_on(bone, self.middle), (bone.tail - bone.head).normalize_or_zero());
        let (x, y) = along.any_orthonormal_pair();
        let moment = |a: Vec3, b: Vec3| a.as_dvec3().dot(self.moments * b.as_dvec3());
        let (xx, xy, yy) = (moment(x, x), moment(x, y), moment(y, y));
        let (xz, yz, area) = (moment(x, along), moment(y, along), xx * yy - xy * xy);
        // On a line, or nearly so, rounding decides.
        let is_wide = area > 1e-3 * xx * yy;
        if !is_wide {
            return true;
        }
        let [a, b] = [(xz * yy - yz * xy) / area, (yz * xx - xz * xy) / area].map(|slope| slope as f32);
        if Vec2::new(a, b).length() > SURE * LEAN {
            return false;
        }
        let normal = (along - x * a - y * b).normalize_or_zero();
        let beyond = (self.middle - at).dot(normal) / along.dot(normal);
        let hole = at + along * beyond;
        let (mut nearest, mut farthest, mut height) = (f32::INFINITY, 0f32, beyond.abs());
        for &place in self.places.iter().step_by(self.places.len().div_ceil(SAMPLES)) {
            let way = place - hole;
            let across = way.reject_from_normalized(normal).length();
            (nearest, farthest) = (nearest.min(across), farthest.max(across));
            height = height.max(way.dot(normal).abs());
        }
        let reach = self.size + hole.distance(self.middle);
        SURE * nearest >= HOLLOW * farthest && height <= SURE * FLAT * reach
    }
}

/// True if some places with the given middle are a ring around a bone: flat, and hollow where the bone goes through its plane.
fn are_around(places: &[Vec3], middle: Vec3, bone: &BoneSegment) -> bool {
    let (at, along) = (closest_on(bone, middle), (bone.tail - bone.head).normalize_or_zero());
    // The plane by least squares: how much it rises along the bone in two directions across the bone.
    let (x, y) = along.any_orthonormal_pair();
    let (mut xx, mut xy, mut yy, mut xz, mut yz) = (0.0, 0.0, 0.0, 0.0, 0.0);
    for &place in places {
        let way = place - middle;
        let (a, b, rise) = (way.dot(x), way.dot(y), way.dot(along));
        (xx, xy, yy, xz, yz) = (xx + a * a, xy + a * b, yy + b * b, xz + a * rise, yz + b * rise);
    }
    let slope = Vec2::new(xz * yy - yz * xy, yz * xx - xz * xy) / (xx * yy - xy * xy);
    // Not for places on one line, which have no plane: comparisons with what is no number are false.
    let leans_little = slope.length() <= LEAN;
    if !leans_little {
        return false;
    }
    let normal = (along - x * slope.x - y * slope.y).normalize_or_zero();
    let beyond = (middle - at).dot(normal) / along.dot(normal);
    let hole = at + along * beyond;
    let (mut nearest, mut farthest, mut height, mut sum) = (f32::INFINITY, 0f32, beyond.abs(), Vec3::ZERO);
    for &place in places {
        let way = place - hole;
        let across = way.reject_from_normalized(normal);
        nearest = nearest.min(across.length());
        farthest = farthest.max(across.length());
        height = height.max(way.dot(normal).abs());
        sum += across.normalize_or_zero();
    }
    nearest >= HOLLOW * farthest
        && height <= FLAT * farthest
        && sum.length() <= ROUND * places.len() as f32
        && farthest > 0.0
}
