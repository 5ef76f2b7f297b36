//! Weights for vertices that have none: loose islands, specks, holes in the weights.
//!
//! Vertices at the same place count as one. A part of the mesh that has some weights is completed by a sparse solve
//! (Laplace's equation over the mesh's edges, known weights as its boundary). A part without any is tied to the
//! nearest weighted vertices first; a small one (a speck, a tooth, a button) takes one common weight from them, so that
//! it moves rigidly. What is far from everything weighted goes to the nearest bone.

mod graph;
mod nearest;
mod solve;
mod unit;

use glam::Vec3;

use super::bone::BoneSegment;
use crate::mesh::model::Weights;
pub(crate) use graph::Graph;
pub(crate) use nearest::Nearest;
pub(crate) use solve::{Links, Sparse, complete, prune};
pub(crate) use unit::Unit;

/// Islands whose box has a diagonal up to this share of the weighted points' box move rigidly.
const SMALL: f32 = 0.05;
/// Weighted points further than this share of their box's diagonal say nothing about an island.
const REACH: f32 = 0.1;
/// Number of weighted points that an island's vertex is tied to.
const TIES: usize = 4;

/// Numbers of vertices without influences, by the source of the weights that fill them.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct FillReport {
    /// Points that took weights from weighted points, through the sparse solve or as a small rigid island.
    pub by_solve: usize,
    /// Points that went to the nearest bone.
    pub by_nearest: usize,
}

/// Gives influences to every point that has none; points that have some keep them as they are.
///
/// `points`, `triangles` and `bones` are in one space; `weights` has an entry a point (missing ones count as empty) and
/// the joint indices of `bones`. Triangles with corners out of range are ignored. A point that is not finite goes to
/// the first bone. Only when there is neither a bone nor a weighted point do points stay empty. Filled points get no
/// more influences than the given ones have (at least 4, at most 8). Independent of threads; cost near linear, a sparse
/// factorisation of the unweighted part included.
pub fn fill_unweighted(
    points: &[Vec3],
    triangles: &[[u32; 3]],
    weights: &Weights,
    bones: &[BoneSegment],
) -> (Weights, FillReport) {
    let mut report = FillReport::default();
    let given = |p: usize| (p < weights.len()).then(|| weights.of(p));
    let empty = |p: usize| given(p).is_none_or(|mut w| w.next().is_none());
    if !(0..points.len()).any(empty) {
        return (weights.clone(), report);
    }
    let most = (0..weights.len()).map(|p| weights.of(p).len()).max().unwrap_or(0).clamp(4, 8);
    let unit = Unit::of((0..points.len()).filter(|&p| !empty(p)).map(|p| points[p]).chain(ends(bones)));
    let points = &unit.all(points);
    let bones =
        &bones.iter().map(|b| BoneSegment { head: unit.to(b.head), tail: unit.to(b.tail), ..*b }).collect::<Vec<_>>();
    let graph = Graph::new(points, triangles);
    // A place is known if a vertex there is; the first one speaks for it.
    let mut known: Vec<Option<Sparse>> = vec![None; graph.len()];
    for p in 0..points.len() {
        if let Some(node) = graph.node(p)
            && known[node].is_none()
            && !empty(p)
        {
            known[node] = given(p).map(Iterator::collect);
        }
    }
    let filled = fill_nodes(&graph, &known, bones, most);
    let mut result = Weights { starts: vec![0], ..Weights::default() };
    for p in 0..points.len() {
        if let (false, Some(given)) = (empty(p), given(p)) {
            result.push(given);
            continue;
        }
        // A vertex at the same place may have weights; then they count.
        let shared = graph.node(p).and_then(|node| known[node].as_ref()).map(|influences| (influences, true));
        let found = shared.or_else(|| graph.node(p).and_then(|node| filled[node].as_ref()).map(|f| (&f.0, f.1)));
        if let Some((influences, solved)) = found {
            report.by_solve += usize::from(solved);
            report.by_nearest += usize::from(!solved);
            result.push(influences.iter().copied());
        } else {
            report.by_nearest += usize::from(!bones.is_empty());
            result.push(bones.first().map(|b| (b.joint, 1.0)));
        }
    }
    (result, report)
}

/// Weights of every node, and whether they came from weighted nodes. `None` only if there is nothing to take.
fn fill_nodes(
    graph: &Graph,
    known: &[Option<Sparse>],
    bones: &[BoneSegment],
    most: usize,
) -> Vec<Option<(Sparse, bool)>> {
    let sources: Vec<u32> = (0..graph.len() as u32).filter(|&n| known[n as usize].is_some()).collect();
    let places: Vec<Vec3> = sources.iter().map(|&n| graph.place(n as usize)).collect();
    let size = diagonal(places.iter().copied());
    let nearest = Nearest::new(&places);
    let mut filled: Vec<Option<(Sparse, bool)>> = vec![None; graph.len()];
    let mut links = Links::default();
    for island in graph.islands() {
        if island.iter().any(|&n| known[n as usize].is_some()) {
            continue;
        }
        let extent = diagonal(island.iter().map(|&n| graph.place(n as usize)));
        let ties = |n: u32| {
            let place = graph.place(n as usize);
            nearest.nearest(place, TIES, REACH * size).map(|(at, far)| (sources[at as usize], far)).collect::<Vec<_>>()
        };
        let small = extent <= SMALL * size || island.len() == 1;
        if small {
            // The same weight for all: the mean of what lies around.
            let mut sum = Sparse::new();
            for &n in sample(&island) {
                for (source, far) in ties(n) {
                    let share = 1.0 / far.max(1e-4 * size).max(f32::MIN_POSITIVE);
                    for &(joint, weight) in known[source as usize].iter().flatten() {
                        solve::add(&mut sum, joint, weight * share);
                    }
                }
            }
            let solved = !sum.is_empty();
            let common = if solved {
                prune(sum, most)
            } else {
                let middle = island.iter().map(|&n| graph.place(n as usize) / island.len() as f32).sum();
                by_bones(middle, bones, 1)
            };
            if !common.is_empty() {
                for &n in &island {
                    filled[n as usize] = Some((common.clone(), solved));
                }
            }
            continue;
        }
        let mut tied = false;
        for &n in &island {
            for (source, far) in ties(n) {
                tied = true;
                links.add(n, source, far);
            }
        }
        if !tied {
            for &n in &island {
                let influences = by_bones(graph.place(n as usize), bones, most);
                filled[n as usize] = (!influences.is_empty()).then_some((influences, false));
            }
        }
    }
    let settled: Vec<bool> = filled.iter().map(Option::is_some).collect();
    let solved = complete(graph, known, &settled, &links, most);
    for (node, influences) in solved.into_iter().enumerate() {
        if let (None, Some(influences)) = (&filled[node], influences) {
            filled[node] = Some((influences, true));
        }
    }
    filled
}

/// Ends of all bones.
fn ends(bones: &[BoneSegment]) -> impl Iterator<Item = Vec3> + '_ {
    bones.iter().flat_map(|b| [b.head, b.tail])
}

/// Sample of an island: a few dozen of its nodes at most, evenly spread.
fn sample(island: &[u32]) -> impl Iterator<Item = &u32> {
    island.iter().step_by(island.len().div_ceil(32).max(1))
}

/// The diagonal of the box around some points, 0 for none.
fn diagonal(points: impl Iterator<Item = Vec3>) -> f32 {
    let start = (Vec3::INFINITY, Vec3::NEG_INFINITY);
    let (low, high) = points.fold(start, |(low, high), p| (low.min(p), high.max(p)));
    if low.x > high.x { 0.0 } else { (high - low).length().min(f32::MAX / 16.0) }
}

/// Influences of a point by its distance to the bones, falling off with the fourth power.
fn by_bones(point: Vec3, bones: &[BoneSegment], most: usize) -> Sparse {
    let mut near = Sparse::new();
    for bone in bones {
        let (along, to) = (bone.tail - bone.head, point - bone.head);
        let length = along.length_squared();
        let t = if length > 0.0 { (to.dot(along) / length).clamp(0.0, 1.0) } else { 0.0 };
        let far = (to - along * t).length();
        if !far.is_finite() {
            continue;
        }
        // Kept short and sorted by distance, a joint once.
        if let Some(at) = near.iter().position(|n| n.0 == bone.joint) {
            if near[at].1 <= far {
                continue;
            }
            near.remove(at);
        }
        let at = near.partition_point(|n| n.1 <= far);
        if at < most {
            near.insert(at, (bone.joint, far));
            near.truncate(most);
        }
    }
    let Some(least) = near.first().map(|n| n.1) else {
        return bones.first().map(|b| (b.joint, 1.0)).into_iter().collect();
    };
    let near = near.into_iter().map(|(joint, far)| {
        let ratio = if far > 0.0 { least / far } else { 1.0 };
        (joint, ratio * ratio * ratio * ratio)
    });
    prune(near.collect(), most)
}
