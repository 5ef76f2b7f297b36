//! Which bones a point of the surface belongs to before the heat spreads.

use glam::Vec3;
use rayon::prelude::*;

use super::{bone_tree::closest_on, bones::Bones, laplacian::Graph, sight::Sight};

/// At most this many joints share a point before the heat spreads.
pub(crate) const SHARES: usize = 4;
/// The heat coefficient at unit distance. Baran and Popović use 1 for soft cartoon flesh; hand-made weights of human
/// bodies are tighter.
const HEAT: f32 = 12.0;
/// Bones whose reach is up to this much longer than the shortest share the point.
const BAND: f32 = 0.1;
/// A patch that its joint sees less of than this is not its own.
const SEEN: f32 = 0.25;
/// Points handled at a time by one thread.
const CHUNK: usize = 256;

/// What holds one point: how strongly, and the joints that share it.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(crate) struct Claim {
    /// The heat coefficient `c / d²` (Baran and Popović 2007, section 4); zero if no bone claims the point.
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
/// loses a patch of which it sees little, as a finger loses the thigh beside it, and that patch takes its warmth from
/// the skin around.
pub(crate) fn claims(points: &[Vec3], bones: &Bones, graph: &Graph, sight: &Sight) -> Vec<Claim> {
    let mut claims: Vec<Claim> = points
        .par_chunks(CHUNK)
        .flat_map_iter(|chunk| {
            let mut near = Vec::new();
            chunk.iter().map(move |&point| claim(point, bones, sight, &mut near))
        })
        .collect();
    for leak in leaks(&claims, graph) {
        claims[leak as usize].heat = 0.0;
    }
    claims
}

/// Points of patches that their joint sees little of. A patch is a connected set of points with one joint.
fn leaks(claims: &[Claim], graph: &Graph) -> Vec<u32> {
    let mut met = vec![false; claims.len()];
    let mut leaks = Vec::new();
    let mut patch = Vec::new();
    for start in 0..claims.len() {
        if met[start] || claims[start].heat == 0.0 {
            continue;
        }
        let joint = claims[start].shares[0].0;
        let (mut area, mut seen) = (0f32, 0f32);
        met[start] = true;
        patch.clear();
        patch.push(start as u32);
        let mut next = 0;
        while let Some(&v) = patch.get(next) {
            next += 1;
            let v = v as usize;
            area += graph.areas[v];
            if claims[v].seen {
                seen += graph.areas[v];
            }
            for (n, _) in graph.of(v) {
                if !met[n] && claims[n].heat > 0.0 && claims[n].shares[0].0 == joint {
                    met[n] = true;
                    patch.push(n as u32);
                }
            }
        }
        if seen < SEEN * area {
            leaks.extend_from_slice(&patch);
        }
    }
    leaks
}

/// How far a bone of this girth has to reach for a point: the distance, and more beyond its own girth, where another
/// bone's flesh is likelier. The chin lies nearer to the neck than to the skull, and the chest to the collarbones.
fn reach(distance: f32, girth: f32) -> f32 {
    distance * (distance / girth).max(1.0)
}

/// The claim on one point; `near` is scratch space.
fn claim(point: Vec3, bones: &Bones, sight: &Sight, near: &mut Vec<(f32, u32)>) -> Claim {
    let mut result = Claim::default();
    let cost = |bone: u32| {
        reach(closest_on(&bones.segments[bone as usize], point).distance(point), bones.girths[bone as usize])
    };
    bones.tree.nearest(point, BAND, cost, near);
    let Some(&(best, first)) = near.first() else { return result };
    let target = closest_on(&bones.segments[first as usize], point);
    // Points on a bone are held firmly, not infinitely so; surfaces have unit size here.
    let distance = point.distance(target).max(1e-5);
    result.heat = HEAT / (distance * distance);
    result.seen = sight.clear(point, target);
    let limit = best * (1.0 + BAND);
    let mut used = 0;
    for &(reach, bone) in near.iter() {
        let joint = bones.segments[bone as usize].joint;
        if used == SHARES {
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
