//! Rings around bones: bracelets, belts and brims of hats. Near a joint both of its bones warm a ring, but it is stiff and
//! moves with the bone that runs through it.

use glam::Vec3;

use super::{bone::BoneSegment, bone_tree::closest_on};

/// Points that a ring has at least.
const FEWEST: usize = 12;
/// The nearest point of a ring is at least this share of the farthest one's distance away from the bone.
const HOLLOW: f32 = 0.5;
/// A ring reaches at most this share of its radius along the bone, to either side.
const FLAT: f32 = 0.6;
/// Length of the mean of the directions from the bone to a ring's points: 0 all around it, 1 on one side.
const ROUND: f32 = 0.35;

/// The joint whose bone runs through each island that is a ring, of `count` islands; `of` is the island of each place.
pub(super) fn bearers(of: &[u32], count: usize, places: &[Vec3], bones: &[BoneSegment]) -> Vec<Option<u32>> {
    let mut members: Vec<Vec<Vec3>> = vec![Vec::new(); count];
    for (&island, &place) in of.iter().zip(places) {
        members[island as usize].push(place);
    }
    members.iter().map(|places| bearer(places, bones)).collect()
}

/// The joint of the bone that is nearest to the middle of some places, if they are a ring around it.
fn bearer(places: &[Vec3], bones: &[BoneSegment]) -> Option<u32> {
    if places.len() < FEWEST {
        return None;
    }
    let count = places.len() as f32;
    let middle = places.iter().sum::<Vec3>() / count;
    let gap = |bone: &BoneSegment| closest_on(bone, middle).distance_squared(middle);
    let long = bones.iter().filter(|bone| bone.head != bone.tail);
    let bone = long.min_by(|a, b| gap(a).total_cmp(&gap(b)))?;
    let (at, along) = (closest_on(bone, middle), (bone.tail - bone.head).normalize_or_zero());
    let (mut nearest, mut farthest, mut height, mut sum) = (f32::INFINITY, 0f32, 0f32, Vec3::ZERO);
    for &place in places {
        let rise = (place - at).dot(along);
        let across = place - at - along * rise;
        nearest = nearest.min(across.length());
        farthest = farthest.max(across.length());
        height = height.max(rise.abs());
        sum += across.normalize_or_zero();
    }
    let is_ring =
        nearest >= HOLLOW * farthest && height <= FLAT * farthest && sum.length() <= ROUND * count && farthest > 0.0;
    is_ring.then_some(bone.joint)
}
