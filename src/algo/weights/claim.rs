//! Which bones a point of the surface belongs to before the heat spreads: the nearest ones in sight.

use glam::Vec3;
use rayon::prelude::*;

use super::{
    bones::{Bones, closest_on},
    laplacian::Graph,
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

/// Finds the claims of all points of a welded surface with the given neighbours.
///
/// Each point is claimed by the bone with the shortest [`reach`]; bones almost as near share it. A line of sight alone
/// misjudges faces, where nostrils and the mouth lie between skin and skull, so sight is asked of whole patches: a bone
/// loses a patch of which it sees less than half, as a hand loses the thigh beside it.
pub(crate) fn claims(points: &[Vec3], bones: &Bones, graph: &Graph, sight: &Sight, tuning: &Tuning) -> Vec<Claim> {
    let mut claims = vec![Claim::default(); points.len()];
    let mut banned = vec![[NONE; ROUNDS]; points.len()];
    let mut open: Vec<u32> = (0..points.len() as u32).collect();
    for round in 0..=tuning.rounds {
        let found: Vec<Claim> = open
            .par_chunks(CHUNK)
            .flat_map_iter(|chunk| {
                let mut near = Vec::new();
                chunk
                    .iter()
                    .map(|&v| claim(points[v as usize], &banned[v as usize], bones, sight, tuning, &mut near))
                    .collect::<Vec<_>>()
            })
            .collect();
        for (&v, claim) in open.iter().zip(found) {
            claims[v as usize] = claim;
        }
        let leaks = leaks(&claims, graph, tuning.leak);
        if round == tuning.rounds || leaks.is_empty() {
            // What still leaks takes its warmth from its neighbours.
            for v in leaks {
                claims[v as usize].heat = 0.0;
            }
            break;
        }
        for &v in &leaks {
            banned[v as usize][round] = claims[v as usize].shares[0].0;
        }
        open = leaks;
    }
    claims
}

/// How often a patch may change hands.
const ROUNDS: usize = 3;
/// Points handled at a time by one thread.
const CHUNK: usize = 256;
const NONE: u32 = u32::MAX;

/// Points of patches that their joint sees less than half of. A patch is a connected set of points with one joint.
fn leaks(claims: &[Claim], graph: &Graph, share: f32) -> Vec<u32> {
    let mut patch = vec![NONE; claims.len()];
    let mut leaks = Vec::new();
    let mut members = Vec::new();
    for start in 0..claims.len() {
        if patch[start] != NONE || claims[start].heat == 0.0 {
            continue;
        }
        let joint = claims[start].shares[0].0;
        let (mut area, mut seen) = (0f32, 0f32);
        members.clear();
        members.push(start as u32);
        patch[start] = start as u32;
        let mut next = 0;
        while let Some(&v) = members.get(next) {
            next += 1;
            let v = v as usize;
            area += graph.areas[v];
            if claims[v].seen {
                seen += graph.areas[v];
            }
            for (n, _) in graph.of(v) {
                if patch[n] == NONE && claims[n].heat > 0.0 && claims[n].shares[0].0 == joint {
                    patch[n] = start as u32;
                    members.push(n as u32);
                }
            }
        }
        if seen < share * area {
            leaks.extend_from_slice(&members);
        }
    }
    leaks.sort_unstable();
    leaks
}

/// How far a bone of this radius has to reach for a point: the distance, and more beyond its own tube, where another
/// bone's flesh is likelier (the chin lies nearer to the neck than to the skull).
fn reach(distance: f32, radius: f32, tuning: &Tuning) -> f32 {
    distance * (1.0 + tuning.beyond * (distance / (radius * tuning.tube) - 1.0).max(0.0))
}

/// The claim on one point; `near` is scratch space.
fn claim(point: Vec3, banned: &[u32], bones: &Bones, sight: &Sight, tuning: &Tuning, near: &mut Vec<(f32, u32)>) -> Claim {
    let mut result = Claim::default();
    near.clear();
    let mut best = f32::INFINITY;
    for (index, segment) in bones.segments.iter().enumerate() {
        let reach = reach(closest_on(segment, point).distance(point), bones.radii[index], tuning);
        if reach <= best * (1.0 + tuning.share_band) && !banned.contains(&segment.joint) {
            best = best.min(reach);
            near.push((reach, index as u32));
        }
    }
    near.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    let Some(&(_, first)) = near.first() else { return result };
    let target = closest_on(&bones.segments[first as usize], point);
    let distance = point.distance(target).max(1e-6);
    result.heat = tuning.heat / (distance * distance);
    result.seen = sight.clear(point, target, tuning.sight_margin);
    let limit = best * (1.0 + tuning.share_band);
    let mut used = 0;
    for &(reach, index) in near.iter() {
        let joint = bones.segments[index as usize].joint;
        if reach > limit || used == SHARES {
            break;
        }
        if result.shares[..used].iter().any(|s| s.0 == joint) {
            continue;
        }
        let share = if limit > best { ((limit - reach) / (limit - best)).max(1e-3) } else { 1.0 };
        result.shares[used] = (joint, share);
        used += 1;
    }
    let sum: f32 = result.shares.iter().map(|s| s.1).sum();
    for share in &mut result.shares {
        share.1 /= sum;
    }
    result
}
