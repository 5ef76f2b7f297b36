//! The way from a mesh and joints to weights: which method binds what, and what happens where it fails.

use glam::Vec3;

use super::{
    Method, Tuning, WeightError, WeightJoint, WeightSettings,
    bone::BoneSegment,
    bones::{self, Bones},
    claim::{self, Claim},
    coarse::{self, Coarse},
    fill::fill_unweighted,
    finish::shape,
    heat,
    laplacian::Graph,
    ldl::LANES,
    sight::Sight,
    voxel_bind::{VoxelError, VoxelSettings, geodesic_voxel_weights},
};
use crate::mesh::{adjacency, model::Weights};

/// Where a place's weights come from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Source {
    Surface,
    Voxels,
    Fill,
    Nearest,
}

/// Weights of all places.
pub(crate) struct Bound {
    /// The place of each point: points at one position share one.
    pub place: Vec<u32>,
    /// Weights of each place.
    pub weights: Weights,
    /// Where they come from.
    pub sources: Vec<Source>,
}

/// The most influences kept before the caller's limit applies.
const KEPT: usize = 12;
/// Heat is trusted on an island if at least this share of its area sees the bone that claims it.
const SEEN: f32 = 0.15;

/// Binds checked input to the joints in `free`.
pub(crate) fn bind(
    points: &[Vec3],
    triangles: &[[u32; 3]],
    joints: &[WeightJoint],
    free: &[u32],
    settings: &WeightSettings,
    tuning: &Tuning,
    progress: &(dyn Fn(f32) -> bool + Sync),
) -> Result<Bound, WeightError> {
    let step = |share: f32| if progress(share) { Ok(()) } else { Err(WeightError::Cancelled) };
    let (place, count) = adjacency::weld(points);
    let (places, joints) = unit_frame(points, &place, count, joints, free);
    let triangles: Vec<[u32; 3]> = triangles
        .iter()
        .map(|t| t.map(|p| place[p as usize]))
        .filter(|[a, b, c]| a != b && b != c && c != a)
        .collect();
    let graph = Graph::new(&places, &triangles);
    step(0.1)?;
    if count <= coarse::LIMIT {
        let (weights, sources, _) = bind_places(&places, &triangles, &graph, &joints, settings, tuning, progress)?;
        return Ok(Bound { place, weights, sources });
    }
    let coarse = Coarse::new(&places, &triangles, &graph);
    let coarse_graph = Graph::new(&coarse.points, &coarse.triangles);
    let (weights, sources, claims) = bind_places(&coarse.points, &coarse.triangles, &coarse_graph, &joints, settings, tuning, progress)?;
    let weights = coarse.spread(&weights, &claims, &graph, settings.blend());
    let sources = coarse.cluster.iter().map(|&c| sources[c as usize]).collect();
    Ok(Bound { place, weights, sources })
}

/// Binds a surface without duplicate points, of unit size. Returns the claims too; without heat where other methods bound.
fn bind_places(
    places: &[Vec3],
    triangles: &[[u32; 3]],
    graph: &Graph,
    joints: &[WeightJoint],
    settings: &WeightSettings,
    tuning: &Tuning,
    progress: &(dyn Fn(f32) -> bool + Sync),
) -> Result<(Weights, Vec<Source>, Vec<Claim>), WeightError> {
    let step = |share: f32| if progress(share) { Ok(()) } else { Err(WeightError::Cancelled) };
    let sight = Sight::new(places, triangles);
    step(0.2)?;
    let bones = bones::build(joints, places, &graph.areas, &sight, tuning);
    step(0.25)?;
    let mut weights = empty(places.len());
    let mut claims = vec![Claim::default(); places.len()];
    let mut sources = vec![Source::Nearest; places.len()];
    let mut left = places.len();
    if settings.method != Method::Voxel {
        claims = claim::claims(places, &bones, graph, &sight, tuning);
        step(0.5)?;
        let trusted = trusted(triangles, graph, &claims, settings.method);
        if let Some(found) = by_heat(graph, &claims, &trusted, settings) {
            left = note(&found, &weights, &mut sources, Source::Surface);
            weights = found;
        }
        for (v, claim) in claims.iter_mut().enumerate() {
            if weights.of(v).len() == 0 {
                claim.heat = 0.0;
            }
        }
        step(0.7)?;
    }
    if left > 0 && settings.method != Method::Heat {
        let found = by_voxels(places, triangles, &bones, settings, &|share| progress(0.7 + 0.2 * share))?;
        let merged = merge(&weights, &found);
        left = note(&merged, &weights, &mut sources, Source::Voxels);
        weights = merged;
    }
    step(0.9)?;
    if left > 0 {
        weights = fill(places, triangles, &weights, &bones.segments, &mut sources);
    }
    Ok((weights, sources, claims))
}

/// Moves everything to the origin and to unit size, so that no tolerance depends on the unit. Joints that are not free do
/// not deform there.
fn unit_frame(points: &[Vec3], place: &[u32], count: usize, joints: &[WeightJoint], free: &[u32]) -> (Vec<Vec3>, Vec<WeightJoint>) {
    let low = points.iter().fold(Vec3::INFINITY, |m, &p| m.min(p * 0.5));
    let high = points.iter().fold(Vec3::NEG_INFINITY, |m, &p| m.max(p * 0.5));
    let center = if points.is_empty() { Vec3::ZERO } else { low + high };
    let half = if points.is_empty() { 0.0 } else { (high - low).max_element() };
    let scale = if half > 0.0 && (1.0 / half).is_finite() { 1.0 / half } else { 1.0 };
    // A joint far off must not overflow.
    let fit = |p: Vec3| ((p - center) * scale).clamp(Vec3::splat(-1e6), Vec3::splat(1e6));
    let mut places = vec![Vec3::ZERO; count];
    for (&point, &place) in points.iter().zip(place) {
        places[place as usize] = fit(point);
    }
    let mut deforms = vec![false; joints.len()];
    for &joint in free {
        deforms[joint as usize] = true;
    }
    let joints = joints
        .iter()
        .zip(deforms)
        .map(|(j, deforms)| WeightJoint { head: fit(j.head), parent: j.parent, tail: j.tail.map(fit), deforms })
        .collect();
    (places, joints)
}

/// For each place whether its island can be bound by heat.
fn trusted(triangles: &[[u32; 3]], graph: &Graph, claims: &[Claim], method: Method) -> Vec<bool> {
    let count = claims.len();
    let (island, islands) = adjacency::islands(triangles, count);
    let mut area = vec![0f64; islands];
    let mut seen = vec![0f64; islands];
    for v in 0..count {
        let i = island[v] as usize;
        area[i] += f64::from(graph.areas[v]);
        if claims[v].seen {
            seen[i] += f64::from(graph.areas[v]);
        }
    }
    let share = if method == Method::Heat { 0.0 } else { f64::from(SEEN) };
    island.iter().map(|&i| area[i as usize] > 0.0 && seen[i as usize] >= share * area[i as usize]).collect()
}

/// Weights of the trusted places by heat; the others stay empty. `None` if there are none or the solve failed.
fn by_heat(graph: &Graph, claims: &[Claim], trusted: &[bool], settings: &WeightSettings) -> Option<Weights> {
    if !trusted.iter().any(|&t| t) {
        return None;
    }
    let dense = heat::solve(graph, claims, settings.blend())?;
    let mut weights = Weights { starts: vec![0], ..Weights::default() };
    let mut row = Vec::new();
    for (v, &trusted) in trusted.iter().enumerate() {
        row.clear();
        if trusted {
            for (slot, &joint) in dense.joints.iter().enumerate() {
                let value = dense.blocks[slot / LANES][v][slot % LANES] as f32;
                if value > 1e-4 {
                    row.push((joint, value));
                }
            }
            shape(&mut row, KEPT, 0.0);
        }
        weights.push(row.iter().copied());
    }
    Some(weights)
}

/// Weights of all places by voxels; none if the mesh has no volume to speak of.
fn by_voxels(
    places: &[Vec3],
    triangles: &[[u32; 3]],
    bones: &Bones,
    settings: &WeightSettings,
    progress: &(dyn Fn(f32) -> bool + Sync),
) -> Result<Weights, WeightError> {
    let voxel_settings = VoxelSettings { resolution: settings.voxel_resolution, ..VoxelSettings::default() };
    match geodesic_voxel_weights(places, triangles, &bones.segments, &voxel_settings, progress) {
        Ok(weights) => Ok(weights),
        Err(VoxelError::Cancelled) => Err(WeightError::Cancelled),
        Err(_) => Ok(empty(places.len())),
    }
}

/// Fills what is empty.
fn fill(places: &[Vec3], triangles: &[[u32; 3]], weights: &Weights, bones: &[BoneSegment], sources: &mut [Source]) -> Weights {
    let (filled, _) = fill_unweighted(places, triangles, weights, bones);
    for (v, source) in sources.iter_mut().enumerate() {
        if weights.of(v).len() == 0 {
            *source = Source::Fill;
        }
    }
    filled
}

fn empty(count: usize) -> Weights {
    Weights { starts: vec![0; count + 1], ..Weights::default() }
}

/// `first`, with the rows of `second` where it is empty.
fn merge(first: &Weights, second: &Weights) -> Weights {
    let mut merged = Weights { starts: vec![0], ..Weights::default() };
    for v in 0..first.len() {
        let from = if first.of(v).len() > 0 { first } else { second };
        merged.push(from.of(v));
    }
    merged
}

/// Notes where the rows that `found` has over `before` come from; returns how many are still empty.
fn note(found: &Weights, before: &Weights, sources: &mut [Source], source: Source) -> usize {
    let mut empty = 0;
    for (v, slot) in sources.iter_mut().enumerate() {
        if found.of(v).len() == 0 {
            empty += 1;
        } else if before.of(v).len() == 0 {
            *slot = source;
        }
    }
    empty
}
