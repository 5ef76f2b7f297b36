//! Which bones a point of the surface belongs to before the heat spreads: the nearest ones in sight.

use glam::Vec3;
use rayon::prelude::*;

use super::{
    bones::{Bones, closest_on},
    sight::Sight,
    tuning::Tuning,
};

/// At most this many joints share a point before the heat spreads.
pub(crate) const SHARES: usize = 4;

/// What holds one point: how strongly, and the joints that share it.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(crate) struct Claim {
    /// The heat coefficient `c / d²` (Baran and Popović 2007, section 4); zero if no bone is in sight.
    pub heat: f32,
    /// True if nothing lies between the point and the bone that claims it.
    pub seen: bool,
    /// Joint and share; shares sum to one, unused entries are zero.
    pub shares: [(u32, f32); SHARES],
}

/// Finds the claims of all points.
pub(crate) fn claims(points: &[Vec3], bones: &Bones, sight: &Sight, tuning: &Tuning) -> Vec<Claim> {
    points
        .par_chunks(256)
        .flat_map_iter(|chunk| {
            let mut near: Vec<(f32, u32)> = Vec::new();
            let (mut found, mut crossings) = (Vec::new(), Vec::new());
            chunk
                .iter()
                .map(|&point| {
                    near.clear();
                    near.extend(bones.segments.iter().enumerate().map(|(i, s)| (reach(closest_on(s, point).distance(point), bones.radii[i], tuning), i as u32)));
                    let tries = tuning.tries.min(near.len());
                    if tries < near.len() {
                        near.select_nth_unstable_by(tries, |a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
                    }
                    near.truncate(tries);
                    near.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
                    claim(point, &near, bones, sight, tuning, &mut found, &mut crossings)
                })
                .collect::<Vec<_>>()
        })
        .collect()
}

/// How far a bone of this radius has to reach for a point: the distance, and more beyond its own tube, where another
/// bone's flesh is likelier (the chin lies nearer to the neck than to the skull).
fn reach(distance: f32, radius: f32, tuning: &Tuning) -> f32 {
    distance * (1.0 + tuning.beyond * (distance / (radius * tuning.tube) - 1.0).max(0.0))
}

/// Metric, joint, distance, and whether the bone is in sight.
type Found = (f32, u32, f32, bool);

fn claim(point: Vec3, near: &[(f32, u32)], bones: &Bones, sight: &Sight, tuning: &Tuning, found: &mut Vec<Found>, crossings: &mut Vec<f32>) -> Claim {
    let mut result = Claim::default();
    found.clear();
    let mut limit = f32::INFINITY;
    for &(metric, index) in near {
        if metric > limit {
            break;
        }
        let segment = &bones.segments[index as usize];
        let target = closest_on(segment, point);
        let distance = point.distance(target).max(1e-6);
        let air = sight.air(point, target, tuning.sight_margin, bones.is_inside(index as usize, target), crossings);
        let factor = 1.0 + air * tuning.air;
        let metric = metric * factor;
        limit = limit.min(metric * (1.0 + tuning.share_band));
        found.push((metric, segment.joint, distance * factor, air == 0.0));
    }
    found.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    let Some(&(first, _, distance, seen)) = found.first() else { return result };
    result.heat = tuning.heat / (distance * distance);
    result.seen = seen;
    let mut used = 0;
    for &(metric, joint, ..) in found.iter() {
        if metric > limit || used == SHARES {
            break;
        }
        if result.shares[..used].iter().any(|s| s.0 == joint) {
            continue;
        }
        let share = if limit > first { (1.0 - (metric - first) / (limit - first)).clamp(0.0, 1.0).max(1e-3) } else { 1.0 };
        result.shares[used] = (joint, share);
        used += 1;
    }
    let sum: f32 = result.shares.iter().map(|s| s.1).sum();
    if sum > 0.0 {
        for share in &mut result.shares {
            share.1 /= sum;
        }
    }
    result
}
