//! The way from a mesh and joints to weights: which method binds what, and what happens where it fails.

use glam::Vec3;

use super::{
    Method, WeightError, WeightJoint, WeightSettings,
    anatomy::Anatomy,
    bone::BoneSegment,
    bones::{self, Bones},
    claim::{self, Claim},
    coarse::{self, Coarse},
    fill::fill_unweighted,
    heat,
    islands::Islands,
    laplacian::Graph,
    report::Stiffness,
    sight::Sight,
    voxel_bind::{VoxelError, VoxelSettings, geodesic_voxel_weights},
};
use crate::mesh::{adjacency, model::Weights};

/// Origin of a place's weights.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Source {
    Surface,
    Voxels,
    Fill,
    Nearest,
    /// No origin: the place is not bound yet.
    None,
}

/// Weights of all places.
pub(crate) struct BoundSurface {
    /// The place of each point: points at one position share one.
    pub place: Vec<u32>,
    /// Weights of each place.
    pub weights: Weights,
    /// Origin of the weights of each place.
    pub sources: Vec<Source>,
    /// Holders of the parts that move as one.
    pub stiff: Stiffness,
    /// Places of the joints beside the surface.
    pub gaps: Gaps,
}

/// Binds checked input to the joints in `free`. Beside the joints stand two flags of each: whether it claims skin even outside
/// of the surface, and whether it is a slot, which holds no flesh of others.
pub(crate) fn bind(
    points: &[Vec3],
    triangles: &[[u32; 3]],
    (joints, claims, slots): (&[WeightJoint], &[bool], &[bool]),
    free: &[u32],
    settings: &WeightSettings,
    progress: &(dyn Fn(f32) -> bool + Sync),
) -> Result<BoundSurface, WeightError> {
    let step = |share: f32| if progress(share) { Ok(()) } else { Err(WeightError::Cancelled) };
    let (place, count) = adjacency::weld(points);
    let (places, joints, scale) = unit_frame(points, &place, count, joints);
    let mut takes_part = vec![false; joints.len()];
    for &joint in free {
        takes_part[joint as usize] = true;
    }
    let job = Job { joints: &joints, takes_part: &takes_part, claims, slots, settings, progress };
    let triangles: Vec<[u32; 3]> =
        triangles.iter().map(|t| t.map(|p| place[p as usize])).filter(|[a, b, c]| a != b && b != c && c != a).collect();
    let graph = Graph::new(&places, &triangles);
    step(0.1)?;
    let anatomy = Anatomy::new(&joints);
    let (weights, sources, sight, bones) = if count <= coarse::LIMIT {
        let Bound { weights, sources, sight, bones, .. } = job.run(&places, &triangles, &graph)?;
        (weights, sources, sight, bones)
    } else {
        let coarse = Coarse::new(&places, &triangles, &graph);
        let coarse_graph = Graph::new(&coarse.points, &coarse.triangles);
        let Bound { weights, sources, claims, sight, bones } =
            job.run(&coarse.points, &coarse.triangles, &coarse_graph)?;
        let none = Claim::default();
        let bound = |c: usize| if sources[c] == Source::Surface { &claims[c] } else { &none };
        let weights = coarse.spread(&weights, &graph, settings.blend(), bound);
        (weights, coarse.cluster.iter().map(|&c| sources[c as usize]).collect(), sight, bones)
    };
    let weights = anatomy.share(&places, weights);
    let (mut weights, mut stiff) = (weights, Stiffness::default());
    if settings.stiff_parts {
        let bending = settings.bending.iter().cloned().flatten();
        let bending: Vec<u32> = bending.filter_map(|point| place.get(point as usize).copied()).collect();
        (weights, stiff) = Islands::new(&places, &triangles, &joints).stiffened(
            (&places, &triangles),
            &weights,
            slots,
            &bending,
            (&joints, &bones),
        );
    }
    Ok(BoundSurface { place, weights, sources, stiff, gaps: Gaps { sight, joints, scale } })
}

/// Joints and the surface in one frame, which is `scale` times as large as the points are.
pub(crate) struct Gaps {
    sight: Sight,
    joints: Vec<WeightJoint>,
    scale: f32,
}

impl Gaps {
    /// Distance from a joint outside of the surface to the surface, in the unit of the points. Of a mesh that is bound
    /// through a coarser surface, the distance is to that.
    pub fn outside(&self, joint: usize) -> Option<f32> {
        let head = self.joints[joint].head;
        let gap = self.sight.gap(head).filter(|_| !self.sight.encloses(head))?;
        Some(gap / self.scale)
    }

    /// Work to find which pieces belong to which bones.
    pub fn comparisons(&self) -> u64 {
        self.sight.work()
    }
}

/// Input of a binding that a mesh and its coarse stand-in share.
struct Job<'a> {
    joints: &'a [WeightJoint],
    takes_part: &'a [bool],
    claims: &'a [bool],
    slots: &'a [bool],
    settings: &'a WeightSettings,
    progress: &'a (dyn Fn(f32) -> bool + Sync),
}

/// Result of a binding for each place of a surface, and what it was bound to.
struct Bound {
    weights: Weights,
    sources: Vec<Source>,
    claims: Vec<Claim>,
    sight: Sight,
    /// Bones of joints that may hold flesh.
    bones: Vec<BoneSegment>,
}

impl Job<'_> {
    fn step(&self, share: f32) -> Result<(), WeightError> {
        if (self.progress)(share) { Ok(()) } else { Err(WeightError::Cancelled) }
    }

    /// Binds a surface without duplicate points, of unit size.
    fn run(&self, places: &[Vec3], triangles: &[[u32; 3]], graph: &Graph) -> Result<Bound, WeightError> {
        let method = self.settings.method;
        let islands = Islands::new(places, triangles, self.joints);
        let sight = Sight::new(places, triangles, &islands);
        self.step(0.2)?;
        let bones = bones::build(self.joints, self.takes_part, (self.claims, self.slots), places, &graph.areas, &sight);
        self.step(0.25)?;
        let mut weights = empty(places.len());
        let mut sources = vec![Source::None; places.len()];
        let mut claims = Vec::new();
        if method != Method::Voxel {
            claims = claim::claims(places, triangles, &bones, graph, &sight);
            self.step(0.5)?;
            let trusted = islands.trusted(graph, &claims, method);
            if trusted.contains(&true) {
                weights = heat::solve(graph, &claims, &trusted, self.settings.blend());
            }
            mark(&weights, &mut sources, Source::Surface);
            self.step(0.7)?;
        }
        // Small and loose things are better moved by what is around them than by voxels of their own size.
        let large = |v: usize| method == Method::Voxel || !islands.is_small(v);
        if method != Method::Heat && (0..places.len()).any(|v| weights.of(v).len() == 0 && large(v)) {
            let found = self.by_voxels(places, triangles, &bones)?;
            weights = merge(&weights, &found, large);
            mark(&weights, &mut sources, Source::Voxels);
        }
        self.step(0.9)?;
        let fleshed = bones.without_slots();
        // Without bones only neighbours count, so that the two can be told apart.
        for (bones, source) in [(&[][..], Source::Fill), (&fleshed[..], Source::Nearest)] {
            if (0..places.len()).any(|v| weights.of(v).len() == 0) {
                weights = fill_unweighted(places, triangles, &weights, bones).0;
                mark(&weights, &mut sources, source);
            }
        }
        Ok(Bound { weights, sources, claims, sight, bones: fleshed })
    }

    /// Weights of all places by voxels; none if the mesh has no volume to speak of.
    fn by_voxels(&self, places: &[Vec3], triangles: &[[u32; 3]], bones: &Bones) -> Result<Weights, WeightError> {
        let settings = VoxelSettings { resolution: self.settings.voxel_resolution, ..VoxelSettings::default() };
        match geodesic_voxel_weights(places, triangles, &bones.without_slots(), &settings, &|share| {
            (self.progress)(0.7 + 0.2 * share)
        }) {
            Ok(weights) => Ok(weights),
            Err(VoxelError::Cancelled) => Err(WeightError::Cancelled),
            Err(_) => Ok(empty(places.len())),
        }
    }
}

/// Moves everything to the origin and the longest side to length 2, so that no tolerance depends on the unit. Returns the
/// places, the joints and the scale.
fn unit_frame(
    points: &[Vec3],
    place: &[u32],
    count: usize,
    joints: &[WeightJoint],
) -> (Vec<Vec3>, Vec<WeightJoint>, f32) {
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
    let joints = joints.iter().map(|j| WeightJoint { head: fit(j.head), tail: j.tail.map(fit), ..*j }).collect();
    (places, joints, scale)
}

fn empty(count: usize) -> Weights {
    Weights { starts: vec![0; count + 1], ..Weights::default() }
}

/// `first`, with the rows of `second` where it is empty and they are wanted.
fn merge(first: &Weights, second: &Weights, wanted: impl Fn(usize) -> bool) -> Weights {
    let mut merged = Weights { starts: vec![0], ..Weights::default() };
    for v in 0..first.len() {
        let from = if first.of(v).len() == 0 && wanted(v) { second } else { first };
        merged.push(from.of(v));
    }
    merged
}

/// Notes where rows come from that were empty so far.
fn mark(weights: &Weights, sources: &mut [Source], source: Source) {
    for (v, slot) in sources.iter_mut().enumerate() {
        if *slot == Source::None && weights.of(v).len() > 0 {
            *slot = source;
        }
    }
}
