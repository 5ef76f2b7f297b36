//! Folds: places where a chain of bones is bent at rest, as in fists and bent legs.
//!
//! On the inside of a fold the skin of both bones lies in one place, where distances do not tell whose it is; the side to which
//! the skin faces does. Only the two bones of a fold are compared so: what they hold together stays theirs.

use std::collections::BTreeMap;

use glam::Vec3;

use super::{bone::BoneSegment, sight::Sight};

/// One minus the cosine of the least bend that is a fold: 53 degrees.
const BENT: f32 = 0.4;
/// One minus the cosine of the bend from which on folds have their full strength: 66 degrees.
const FOLDED: f32 = 0.6;

/// Fold between a bone and another one, which may hold the skin on its inside.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Fold {
    /// Index of the other bone.
    pub other: u32,
    /// Strength: 0 for a chain that is bent by 53 degrees, 1 from 66 degrees on.
    pub strength: f32,
}

/// Folds at which each bone may lose skin to another.
///
/// A fold is where the only bone of a joint ends and exactly one bone begins. Bones that fan out from one joint, as in hips and
/// chests, run through flesh that is no tube around any of them. The direction of a last bone is a guess (`is_guess`), so such
/// a bone loses nothing.
pub(super) fn folds(bones: &[BoneSegment], is_guess: &[bool]) -> Vec<Vec<Fold>> {
    let key = |place: Vec3| place.to_array().map(|c| (c + 0.0).to_bits());
    let long: Vec<usize> = (0..bones.len()).filter(|&bone| bones[bone].head != bones[bone].tail).collect();
    let mut starts: BTreeMap<[u32; 3], Vec<usize>> = BTreeMap::new();
    let mut counts: BTreeMap<u32, usize> = BTreeMap::new();
    for &bone in &long {
        starts.entry(key(bones[bone].head)).or_default().push(bone);
        *counts.entry(bones[bone].joint).or_default() += 1;
    }
    let along = |bone: usize| (bones[bone].tail - bones[bone].head).normalize_or_zero();
    let mut folds = vec![Vec::new(); bones.len()];
    for bone in long.into_iter().filter(|&bone| counts[&bones[bone].joint] == 1) {
        let Some(&[next]) = starts.get(&key(bones[bone].tail)).map(Vec::as_slice) else { continue };
        let strength = ((1.0 - along(bone).dot(along(next)) - BENT) / (FOLDED - BENT)).min(1.0);
        if strength > 0.0 {
            folds[bone].push(Fold { other: next as u32, strength });
            if !is_guess[next] {
                folds[next].push(Fold { other: bone as u32, strength });
            }
        }
    }
    folds
}

/// Outward normals of the points of a welded surface: means over the triangles around each point by area, of length 1 where the
/// surface is flat and shorter where it turns. An island whose triangles enclose a negative volume is inside-out.
pub(super) fn normals(points: &[Vec3], triangles: &[[u32; 3]], sight: &Sight) -> Vec<Vec3> {
    let mut sums = vec![(Vec3::ZERO, 0.0f32); points.len()];
    let mut middles = vec![(Vec3::ZERO, 0.0f32); sight.islands()];
    for corners in triangles {
        let [a, b, c] = corners.map(|corner| points[corner as usize]);
        let normal = (b - a).cross(c - a);
        let area = normal.length();
        for &corner in corners {
            let sum = &mut sums[corner as usize];
            *sum = (sum.0 + normal, sum.1 + area);
        }
        let middle = &mut middles[sight.island(corners[0] as usize)];
        *middle = (middle.0 + (a + b + c) * (area / 3.0), middle.1 + area);
    }
    let mut volumes = vec![0.0f32; middles.len()];
    for corners in triangles {
        let island = sight.island(corners[0] as usize);
        let (sum, area) = middles[island];
        if area > 0.0 {
            let [a, b, c] = corners.map(|corner| points[corner as usize] - sum / area);
            volumes[island] += a.dot(b.cross(c));
        }
    }
    let normal = |(point, (sum, area)): (usize, (Vec3, f32))| {
        let side = if volumes[sight.island(point)] < 0.0 { -1.0 } else { 1.0 };
        if area > 0.0 { sum * (side / area) } else { Vec3::ZERO }
    };
    sums.into_iter().enumerate().map(normal).collect()
}
