//! Rings around bones: bracelets, belts and brims of hats. Near a joint both of its bones warm a ring, but it is stiff and
//! moves with the bone that runs through it.

use glam::{Vec2, Vec3};

use super::{bone::BoneSegment, bone_tree::closest_on};

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

/// Joint of the bone that some places are a ring around; of several, the one that is nearest to their middle. Where a bone
/// branches, as at the hips, others than the one that runs through the ring are as near.
pub(super) fn bearer(places: &[Vec3], bones: &[BoneSegment]) -> Option<u32> {
    if places.len() < FEWEST {
        return None;
    }
    let middle = places.iter().sum::<Vec3>() / places.len() as f32;
    let size = places.iter().map(|place| place.distance(middle)).fold(0f32, f32::max);
    let long = bones.iter().filter(|bone| bone.head != bone.tail);
    let near = long.map(|bone| (closest_on(bone, middle).distance(middle), bone)).filter(|(gap, _)| *gap < size);
    let mut near: Vec<(f32, &BoneSegment)> = near.collect();
    near.sort_by(|a, b| a.0.total_cmp(&b.0));
    near.into_iter().map(|(_, bone)| bone).find(|bone| are_around(places, middle, bone)).map(|bone| bone.joint)
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
