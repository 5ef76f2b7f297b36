//! Claims of bones on points of the surface, before the heat spreads.

use glam::Vec3;
use rayon::prelude::*;

use super::{bone_tree::closest_on, bones::Bones, folds::normals, laplacian::Graph, sight::Sight};

/// Largest number of joints that share a point before the heat spreads.
pub(crate) const SHARES: usize = 4;
/// The heat coefficient at unit distance. Baran and Popović use 1 for soft cartoon flesh; hand-made weights of human
/// bodies are tighter.
const HEAT: f32 = 12.0;
/// Bones whose reach is up to this much longer than the shortest share the point.
const BAND: f32 = 0.1;
/// A patch that its joint sees less of than this is not its own.
const SEEN: f32 = 0.25;
/// The least such share of a patch on a piece that its joint lies inside of: a tight shoe crosses itself between toes and hides most
/// of itself there.
const SEEN_AT_HOME: f32 = 0.1;
/// Share by which the reach that a bone needs grows where the skin lies along the way to the bone rather than across it, when the
/// two bones of a strong fold are compared; and twice as much where the skin faces towards the bone, as the palm of a fist faces
/// the fingers.
const FOLD: f32 = 1.25;
/// Points handled at a time by one thread.
const CHUNK: usize = 256;

/// Claim on one point: its strength, and the joints that share it.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(crate) struct Claim {
    /// The heat coefficient `c / d²` (Baran and Popović 2007, section 4); zero if no bone claims the point.
    pub heat: f32,
    /// True if nothing lies between the point and the bone that claims it.
    pub seen: bool,
    /// True if that bone lies on the outer side of the skin, across the air.
    pub away: bool,
    /// Joint and share; shares sum to one, unused entries are zero.
    pub shares: [(u32, f32); SHARES],
}

/// Finds the claims of all points of a welded surface with the given neighbours.
///
/// Each point is claimed by the bone with the shortest [`reach`]; bones almost as near share it. A line of sight alone
/// misjudges faces, where nostrils and the mouth lie between skin and skull, so sight is asked of whole patches: a bone
/// loses a patch of which it sees little, as a finger loses the thigh beside it, and that patch takes its warmth from
/// the skin around.
pub(crate) fn claims(
    points: &[Vec3],
    triangles: &[[u32; 3]],
    bones: &Bones,
    graph: &Graph,
    sight: &Sight,
) -> Vec<Claim> {
    let normals = normals(points, triangles, sight);
    let mut claims: Vec<Claim> = points
        .par_chunks(CHUNK)
        .enumerate()
        .flat_map_iter(|(number, chunk)| {
            let mut near = Vec::new();
            let first = number * CHUNK;
            let skin = (first..).zip(chunk.iter().zip(&normals[first..]));
            skin.map(move |(index, (&point, &normal))| {
                let skin = Skin { point, island: sight.island(index), normal };
                claim(index, skin, bones, sight, &mut near)
            })
        })
        .collect();
    for leak in leaks(&claims, bones, graph, sight) {
        claims[leak as usize].heat = 0.0;
    }
    claims
}

/// Points that their joint does not hold: of patches of which it sees little, and of patches across the air from its
/// bone that border on other joints, as the flank beside an arm that hangs down. Nostrils and the mouth lie across the
/// air from the skull, too, but all around them is the head's.
fn leaks(claims: &[Claim], bones: &Bones, graph: &Graph, sight: &Sight) -> Vec<u32> {
    let joint = |v: usize| claims[v].shares[0].0;
    let mut leaks = Vec::new();
    let held = |v: usize| claims[v].heat > 0.0;
    for patch in patches(claims.len(), graph, held, |a, b| joint(a) == joint(b)) {
        let sum = |seen: bool| {
            patch.iter().filter(|v| !seen || claims[**v as usize].seen).map(|v| graph.areas[*v as usize]).sum::<f32>()
        };
        let first = patch[0] as usize;
        let is_at_home = bones.is_resident(joint(first), sight.island(first));
        let least = if is_at_home { SEEN_AT_HOME } else { SEEN };
        if sum(true) < least * sum(false) {
            leaks.extend(patch);
        }
    }
    let away = |v: usize| held(v) && claims[v].away;
    for patch in patches(claims.len(), graph, away, |a, b| joint(a) == joint(b)) {
        let border = patch.iter().flat_map(|v| graph.of(*v as usize)).map(|(v, _)| v).filter(|v| held(*v) && !away(*v));
        let (own, other): (Vec<usize>, Vec<usize>) = border.partition(|v| joint(*v) == joint(patch[0] as usize));
        if own.len() < other.len() {
            leaks.extend(patch);
        }
    }
    leaks
}

/// The connected sets of points that are in question and alike.
fn patches(
    count: usize,
    graph: &Graph,
    is_in: impl Fn(usize) -> bool,
    alike: impl Fn(usize, usize) -> bool,
) -> Vec<Vec<u32>> {
    let mut met = vec![false; count];
    let mut patches = Vec::new();
    for start in 0..count {
        if met[start] || !is_in(start) {
            continue;
        }
        met[start] = true;
        let mut patch = vec![start as u32];
        let mut next = 0;
        while let Some(&v) = patch.get(next) {
            next += 1;
            for (n, _) in graph.of(v as usize) {
                if !met[n] && is_in(n) && alike(v as usize, n) {
                    met[n] = true;
                    patch.push(n as u32);
                }
            }
        }
        patches.push(patch);
    }
    patches
}

/// Reach that a bone of this girth needs for a point: the distance, and more beyond its own girth, where another
/// bone's flesh is likelier. The chin lies nearer to the neck than to the skull, and the chest to the collarbones.
fn reach(distance: f32, girth: f32) -> f32 {
    distance * (distance / girth).max(1.0)
}

/// Point of the skin.
#[derive(Debug, Clone, Copy)]
struct Skin {
    point: Vec3,
    /// The island that it is of.
    island: usize,
    /// Outward normal, shorter where the skin turns.
    normal: Vec3,
}

impl Skin {
    /// Reach that a bone needs for this point, and cosine of the angle between the normal and the way from the bone.
    fn reach(self, bones: &Bones, bone: u32) -> (f32, f32) {
        let way = self.point - closest_on(&bones.segments[bone as usize], self.point);
        (reach(way.length(), bones.girth(bone, self.island)), self.normal.dot(way.normalize_or_zero()))
    }

    /// The reach by which the bones of a fold of a given strength are compared.
    fn folded_reach(self, bones: &Bones, bone: u32, strength: f32) -> f32 {
        let (reach, cosine) = self.reach(bones, bone);
        reach * (1.0 + FOLD * strength * (self.normal.length() - cosine).max(0.0))
    }

    /// Shares the claims of folded bones, cheapest first, with the bones beyond the fold: the better one of the two takes the
    /// place of the one that is nearer, and the other one follows by as much as it is worse.
    fn share_folds(self, bones: &Bones, may_hold: impl Fn(u32) -> bool, near: &mut Vec<(f32, u32)>) {
        if near.iter().all(|(_, bone)| bones.folds[*bone as usize].is_empty()) {
            return;
        }
        let mut shared: Vec<(f32, u32)> = Vec::with_capacity(2 * near.len());
        for &(cost, bone) in near.iter() {
            let folds = bones.folds[bone as usize].iter().filter(|fold| may_hold(fold.other));
            let pairs = folds.map(|fold| {
                let reach = |bone: u32| self.folded_reach(bones, bone, fold.strength);
                (reach(bone), reach(fold.other), fold.other)
            });
            // Of two folds, that with the better other bone.
            match pairs.min_by(|a, b| (a.1 * b.0).total_cmp(&(b.1 * a.0))) {
                Some((own, others, other)) => {
                    let least = own.min(others).max(f32::MIN_POSITIVE);
                    shared.extend([(cost * (own / least), bone), (cost * (others / least), other)]);
                }
                None => shared.push((cost, bone)),
            }
        }
        shared.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        let limit = shared.first().map_or(0.0, |(least, _)| least * (1.0 + BAND));
        near.clear();
        for (cost, bone) in shared {
            if cost <= limit && near.iter().all(|(_, other)| *other != bone) {
                near.push((cost, bone));
            }
        }
    }
}

/// The claim on the point of an index; `near` is scratch space.
fn claim(index: usize, skin: Skin, bones: &Bones, sight: &Sight, near: &mut Vec<(f32, u32)>) -> Claim {
    let mut result = Claim::default();
    let Skin { point, island, .. } = skin;
    let may_hold = |bone: u32| bones.may_hold(bone, island);
    let cost = |bone: u32| if may_hold(bone) { skin.reach(bones, bone).0 } else { f32::INFINITY };
    let least = |distance: f32| reach(distance, bones.largest_girth);
    bones.holders.cheapest((point, BAND), bones.joints_of(island), cost, least, near);
    skin.share_folds(bones, may_hold, near);
    let Some(&(best, first)) = near.first() else { return result };
    let target = closest_on(&bones.segments[first as usize], point);
    // Points on a bone are held firmly, not infinitely so; surfaces have unit size here.
    let distance = point.distance(target).max(1e-5);
    result.heat = HEAT / (distance * distance);
    result.seen = sight.clear(index, point, target);
    result.away = !result.seen && sight.faces_away(index, point, target);
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
