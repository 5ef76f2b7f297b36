//! Branches: the limbs of a volume as arcs of a join tree of distances from its centre.
//!
//! From the most central node, distances grow towards the ends of all limbs. Nodes taken from far to near form
//! components that begin at extremities and join where limbs meet the trunk (a Reeb graph without its loops, so that a
//! hand on a hip makes no ring). An extremity that joins after a short way is a bump, not a branch.

use glam::Vec3;
use rayon::prelude::*;

use super::volume::{FAR, VoxelGraph};

/// Length of a branch below which it is a bump, as a share of the largest distance from the centre.
const BUMP: f32 = 0.075;
/// Length of a bump where short limbs of a long body are looked for, as the same share.
const FINE_BUMP: f32 = 0.05;
/// Length of an arc that is no more than an ear on a head, as a share of the largest distance from the centre.
const SHORT: f32 = 0.62;
/// Length of a child of an arc that is no more than a finger on an arm, as a share of the arc.
const FINGER: f32 = 0.5;
/// Nodes from which distances are averaged to find the centre.
const SAMPLES: usize = 12;
/// Distance between two centres from which on both are tried, as a share of the longest way.
const APART: f32 = 0.06;
/// Width of a slice of a branch, in costs of a step.
const SLICE: u32 = 15;

/// A stretch of a limb or of the trunk between an extremity or a junction and the next junction.
#[derive(Debug, Clone)]
pub(super) struct Arc {
    /// The arc that this one joins, nearer to the centre.
    pub(super) parent: Option<usize>,
    /// Arcs that join here; none at an extremity.
    pub(super) children: Vec<usize>,
    /// Node at the far end and its distance from the centre.
    pub(super) tip: u32,
    pub(super) far: u32,
    /// Distance from the centre of the near end.
    pub(super) near: u32,
    /// Slices from the far end to the near one.
    pub(super) slices: Vec<Slice>,
}

/// Nodes of an arc at about the same distance from the centre.
#[derive(Debug, Clone, Copy)]
pub(super) struct Slice {
    pub(super) centre: Vec3,
    /// Radius of a disc of the slice's size.
    pub(super) radius: f32,
    /// Largest depth under the surface, in cells.
    pub(super) depth: f32,
}

/// The branches of a volume.
#[derive(Debug, Clone)]
pub(super) struct Branches {
    pub(super) arcs: Vec<Arc>,
    /// Arcs that begin at an extremity, longest first.
    pub(super) leaves: Vec<usize>,
    /// Arcs that carry short arcs only, such as a head with ears or an arm with a staff.
    pub(super) bearers: Vec<usize>,
    /// Arc of each node of the body; `u32::MAX` outside of it.
    pub(super) arc_of: Vec<u32>,
    pub(super) centre: u32,
    /// Largest distance from the centre.
    pub(super) reach: u32,
}

impl Branches {
    /// The cost of the way along the tree between two arcs' far ends.
    pub(super) fn way(&self, a: usize, b: usize) -> u32 {
        if a == b {
            return 0;
        }
        // Children come before the arcs that bear them, so of two arcs the one with the lower number goes on.
        let (mut low, mut high) = (a.min(b), a.max(b));
        let mut join = 0;
        while let Some(parent) = self.arcs[low].parent {
            if parent == high {
                join = self.arcs[high].far;
                break;
            }
            (low, high) = (parent.min(high), parent.max(high));
        }
        (self.arcs[a].far.saturating_sub(join)) + (self.arcs[b].far.saturating_sub(join))
    }

    /// True if one of two arcs lies on the way from the other to the centre.
    pub(super) fn on_one_way(&self, a: usize, b: usize) -> bool {
        // Children come before the arcs that bear them.
        let (mut arc, end) = (a.min(b), a.max(b));
        while arc < end {
            let Some(parent) = self.arcs[arc].parent else { return false };
            arc = parent;
        }
        arc == end
    }

    /// Arcs from a leaf to the centre.
    pub(super) fn path(&self, leaf: usize) -> Vec<usize> {
        let mut path = vec![leaf];
        while let Some(parent) = self.arcs[path[path.len() - 1]].parent {
            path.push(parent);
        }
        path
    }

    /// The centre line from a leaf to the centre of the body, over junctions.
    pub(super) fn line(&self, leaf: usize) -> Vec<Slice> {
        self.path(leaf).iter().flat_map(|&arc| self.arcs[arc].slices.iter().copied()).collect()
    }
}

/// Limbs of a volume that are branches of their own.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Detail {
    /// Limbs; short ones that a long one bears are fingers of a hand.
    Limbs,
    /// Short limbs, too, which a long trunk bears at its ends.
    ShortLimbs,
}

/// Finds the branches of `graph` as seen from a centre.
pub(super) fn branches(graph: &VoxelGraph, centre: u32, detail: Detail) -> Branches {
    let distance = graph.distances(&[(centre, 0)]);
    let reach = distance.iter().zip(&graph.body).filter(|(_, b)| **b).map(|(d, _)| *d).filter(|&d| d != FAR).max();
    let reach = reach.unwrap_or(0);
    let bump = (reach as f32 * if detail == Detail::Limbs { BUMP } else { FINE_BUMP }) as u32;
    let mut order: Vec<u32> =
        (0..graph.len() as u32).filter(|&n| graph.body[n as usize] && distance[n as usize] != FAR).collect();
    order.sort_unstable_by_key(|&n| (std::cmp::Reverse(distance[n as usize]), n));

    let mut arcs: Vec<Arc> = Vec::new();
    // Arcs that turned out to be bumps continue as another arc.
    let mut alias: Vec<usize> = Vec::new();
    let mut group: Vec<u32> = (0..graph.len() as u32).collect();
    let mut arc_of_group = vec![usize::MAX; graph.len()];
    let mut arc_of = vec![u32::MAX; graph.len()];
    let mut met: Vec<u32> = Vec::new();
    for &node in &order {
        let here = distance[node as usize];
        met.clear();
        for &(next, _) in graph.neighbours(node) {
            if arc_of[next as usize] != u32::MAX {
                met.push(find(&mut group, next));
            }
        }
        met.sort_unstable();
        met.dedup();
        let arc = match met.as_slice() {
            [] => {
                arcs.push(Arc { parent: None, children: vec![], tip: node, far: here, near: here, slices: vec![] });
                alias.push(arcs.len() - 1);
                arcs.len() - 1
            }
            [one] => arc_of_group[*one as usize],
            several => {
                let mut joined: Vec<usize> = several.iter().map(|&g| arc_of_group[g as usize]).collect();
                joined.sort_unstable_by_key(|&a| (std::cmp::Reverse(longest_way(&arcs, a)), a));
                let eldest = joined[0];
                let kept: Vec<usize> = joined
                    .iter()
                    .copied()
                    .filter(|&a| !arcs[a].children.is_empty() || arcs[a].far - here >= bump)
                    .collect();
                if kept.len() < 2 {
                    let into = kept.first().copied().unwrap_or(eldest);
                    for &other in joined.iter().filter(|&&a| a != into) {
                        alias[other] = into;
                    }
                    into
                } else {
                    for &other in joined.iter().filter(|a| !kept.contains(a)) {
                        alias[other] = kept[0];
                    }
                    let new = arcs.len();
                    for &child in &kept {
                        arcs[child].parent = Some(new);
                        arcs[child].near = here;
                    }
                    arcs.push(Arc { parent: None, children: kept, tip: node, far: here, near: here, slices: vec![] });
                    alias.push(new);
                    new
                }
            }
        };
        arc_of[node as usize] = arc as u32;
        arcs[arc].near = arcs[arc].near.min(here);
        for &g in &met {
            group[g as usize] = node;
        }
        arc_of_group[node as usize] = arc;
    }
    for arc in &mut arc_of {
        if *arc != u32::MAX {
            let mut a = *arc as usize;
            while alias[a] != a {
                a = alias[a];
            }
            *arc = a as u32;
        }
    }
    fill_slices(graph, &distance, &arc_of, &order, &mut arcs);
    let mut leaves: Vec<usize> = (0..arcs.len()).filter(|&a| alias[a] == a && arcs[a].children.is_empty()).collect();
    leaves.sort_by_key(|&a| (std::cmp::Reverse(arcs[a].far - arcs[a].near), a));
    // The furthest end that each arc bears.
    let mut furthest: Vec<u32> = arcs.iter().map(|arc| arc.far).collect();
    for a in 0..arcs.len() {
        // Children come before the arcs that bear them.
        if let Some(parent) = arcs[a].parent {
            furthest[parent] = furthest[parent].max(furthest[a]);
        }
    }
    let short = |a: usize| furthest[a] - arcs[a].far <= (reach as f32 * SHORT) as u32;
    // Of fingers on a hand, which are short against the arm, the longest one stands for all.
    let mut minor = vec![false; arcs.len()];
    let is_hand =
        |a: usize| detail == Detail::Limbs && alias[a] == a && !arcs[a].children.is_empty() && arcs[a].parent.is_some();
    for hand in (0..arcs.len()).filter(|&a| is_hand(a)) {
        let own = arcs[hand].far.saturating_sub(arcs[hand].near) as f32;
        if (furthest[hand] - arcs[hand].far) as f32 > FINGER * own {
            continue;
        }
        let mut open = arcs[hand].children.clone();
        let mut stands = false;
        while let Some(arc) = open.pop() {
            let longest = arcs[arc].children.is_empty() && furthest[arc] == furthest[hand] && !stands;
            stands |= longest;
            minor[arc] = !longest;
            open.extend(arcs[arc].children.iter().copied());
        }
    }
    let leaves: Vec<usize> = leaves.into_iter().filter(|&a| !minor[a]).collect();
    let bearers = (0..arcs.len())
        .filter(|&a| !minor[a])
        .filter(|&a| alias[a] == a && !arcs[a].children.is_empty() && arcs[a].parent.is_some() && short(a))
        .collect();
    Branches { arcs, leaves, bearers, arc_of, centre, reach }
}

fn longest_way(arcs: &[Arc], arc: usize) -> u32 {
    // An arc with children is always kept, so its own far end is enough to order it.
    if arcs[arc].children.is_empty() { arcs[arc].far } else { u32::MAX }
}

fn find(group: &mut [u32], mut g: u32) -> u32 {
    while group[g as usize] != g {
        group[g as usize] = group[group[g as usize] as usize];
        g = group[g as usize];
    }
    g
}

fn fill_slices(graph: &VoxelGraph, distance: &[u32], arc_of: &[u32], order: &[u32], arcs: &mut [Arc]) {
    let mut sums: Vec<Vec<(Vec3, u32, u8)>> = vec![Vec::new(); arcs.len()];
    for &node in order {
        let arc = arc_of[node as usize] as usize;
        let slice = (arcs[arc].far.saturating_sub(distance[node as usize]) / SLICE) as usize;
        let sum = &mut sums[arc];
        if sum.len() <= slice {
            sum.resize(slice + 1, (Vec3::ZERO, 0, 0));
        }
        sum[slice].0 += graph.centres[node as usize];
        sum[slice].1 += 1;
        sum[slice].2 = sum[slice].2.max(graph.depth[node as usize]);
    }
    let cell = graph.cell;
    for (arc, sums) in arcs.iter_mut().zip(&sums) {
        arc.slices = sums
            .iter()
            .filter(|sum| sum.1 > 0)
            .map(|&(sum, count, depth)| {
                let area = count as f32 * cell * cell / (SLICE as f32 * 0.1);
                Slice {
                    centre: sum / count as f32,
                    radius: (area / std::f32::consts::PI).sqrt(),
                    depth: f32::from(depth),
                }
            })
            .collect();
    }
    // Number of each slice among those that are not empty.
    let numbers: Vec<Vec<usize>> = sums
        .iter()
        .map(|sums| {
            let mut next = 0;
            let number = |sum: &(Vec3, u32, u8)| {
                next += usize::from(sum.1 > 0);
                next.saturating_sub(1)
            };
            sums.iter().map(number).collect()
        })
        .collect();
    let mut rings: Vec<Vec<Ring>> = arcs.iter().map(|arc| vec![Ring::default(); arc.slices.len()]).collect();
    for &node in order {
        let arc = arc_of[node as usize] as usize;
        let slice = numbers[arc][(arcs[arc].far.saturating_sub(distance[node as usize]) / SLICE) as usize];
        rings[arc][slice].add(graph.centres[node as usize] - arcs[arc].slices[slice].centre);
    }
    for (arc, rings) in arcs.iter_mut().zip(rings) {
        for (slice, ring) in arc.slices.iter_mut().zip(rings) {
            if let Some((inner, mean)) = ring.hollow(HOLLOW * cell) {
                slice.depth = slice.depth.max(inner / cell);
                slice.radius = slice.radius.max(mean);
            }
        }
    }
}

/// Distance of a slice's centre from its nodes, in cells, from which on it is a ring.
const HOLLOW: f32 = 2.0;
/// Length of the mean direction from a slice's centre to its nodes up to which they lie on all sides of it.
const AROUND: f32 = 0.35;

/// Nodes of a slice around its centre.
#[derive(Debug, Clone, Copy)]
struct Ring {
    directions: Vec3,
    distance: f32,
    least: f32,
    count: u32,
}

impl Default for Ring {
    fn default() -> Self {
        Self { directions: Vec3::ZERO, distance: 0.0, least: f32::INFINITY, count: 0 }
    }
}

impl Ring {
    fn add(&mut self, away: Vec3) {
        let length = away.length();
        self.directions += away.normalize_or_zero();
        self.distance += length;
        self.least = self.least.min(length);
        self.count += 1;
    }

    /// Least and mean radius of nodes that lie around an empty middle, as those of a shell do that is not closed.
    fn hollow(&self, least: f32) -> Option<(f32, f32)> {
        let count = self.count.max(1) as f32;
        let is_ring = self.least >= least && self.directions.length() <= AROUND * count;
        (is_ring && self.count > 0).then(|| (self.least, self.distance / count))
    }
}

/// Node at the middle of the volume, unless the volume bends around it: unlike any choice among nodes it hardly moves when the
/// mesh is given otherwise.
fn middle_of_volume(graph: &VoxelGraph, body: &[u32]) -> Option<u32> {
    let sum: glam::DVec3 = body.iter().map(|&n| graph.centres[n as usize].as_dvec3()).sum();
    let middle = (sum / body.len().max(1) as f64).as_vec3();
    let away = |n: u32| graph.centres[n as usize].distance_squared(middle);
    let nearest = body.iter().copied().min_by(|&a, &b| away(a).total_cmp(&away(b)).then(a.cmp(&b)))?;
    (away(nearest).sqrt() <= graph.cell).then_some(nearest)
}

/// Node that may be the centre of the body.
#[derive(Debug, Clone, Copy)]
pub(super) struct Centre {
    pub(super) node: u32,
    /// True if it is tried for animals whose trunk lies across their legs, and for all others.
    pub(super) is_lying: bool,
    pub(super) is_upright: bool,
}

/// Nodes that may be the centre of the body: the one with the least mean distance to all of the volume and, where that
/// is elsewhere (a large head), the middle of the longest way through the volume. An animal has its trunk about the middle of its
/// volume instead.
pub(super) fn centres(graph: &VoxelGraph) -> Vec<Centre> {
    let body: Vec<u32> = (0..graph.len() as u32).filter(|&n| graph.body[n as usize]).collect();
    if body.is_empty() {
        return vec![];
    }
    // Nodes are sorted by place; a low-discrepancy stride spreads the samples.
    let place = |i: usize| (i as f64 + 0.5) * 0.618_033_988_749_895 % 1.0;
    let samples: Vec<u32> = (0..SAMPLES).map(|i| body[(place(i) * body.len() as f64) as usize]).collect();
    let fields: Vec<Vec<u32>> = samples.par_iter().map(|&s| graph.distances(&[(s, 0)])).collect();
    let sum = |n: u32| fields.iter().map(|f| u64::from(f[n as usize].min(1 << 24))).sum::<u64>();
    let mean = body.iter().copied().min_by_key(|&n| (sum(n), n)).unwrap_or(0);

    let furthest = |field: &[u32]| {
        let key = |n: u32| (field[n as usize], std::cmp::Reverse(n));
        body.iter().copied().filter(|&n| field[n as usize] != FAR).max_by_key(|&n| key(n)).unwrap_or(mean)
    };
    let first = furthest(&graph.distances(&[(mean, 0)]));
    let from_first = graph.distances(&[(first, 0)]);
    let second = furthest(&from_first);
    let from_second = graph.distances(&[(second, 0)]);
    let third = furthest(&from_first.iter().zip(&from_second).map(|(a, b)| (*a).min(*b)).collect::<Vec<_>>());
    let from_third = graph.distances(&[(third, 0)]);
    let worst = |n: u32| {
        let far = from_first[n as usize].max(from_second[n as usize]).max(from_third[n as usize]);
        // Among places that are equally far from the ends, the deepest inside of the body.
        u64::from(far) * 4 + sum(n) / SAMPLES as u64
    };
    let middle = body.iter().copied().min_by_key(|&n| (worst(n), n)).unwrap_or(mean);
    let reach = from_first[second as usize].max(1);
    let is_apart =
        |a: u32, b: u32| graph.centres[a as usize].distance(graph.centres[b as usize]) > APART * graph.length(reach);
    let of_volume = middle_of_volume(graph, &body);
    let lying = of_volume.unwrap_or(mean);
    let all = [
        Centre { node: mean, is_upright: true, is_lying: of_volume.is_none() },
        Centre { node: middle, is_upright: is_apart(middle, mean), is_lying: is_apart(middle, lying) },
        Centre { node: lying, is_upright: false, is_lying: of_volume.is_some() },
    ];
    all.into_iter().filter(|centre| centre.is_upright || centre.is_lying).collect()
}
