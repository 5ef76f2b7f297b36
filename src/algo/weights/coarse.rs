//! A coarser surface for large meshes: weights vary over a limb's width, not from vertex to vertex, so a mesh of a million
//! points is bound through some ten thousand and the result is spread back.

use glam::Vec3;
use rayon::prelude::*;

use super::{claim::Claim, finish::shape, laplacian::Graph};
use crate::mesh::model::Weights;

/// Meshes up to this many points are bound as they are.
pub(crate) const LIMIT: usize = 40_000;
/// About how many clusters a larger mesh becomes.
const CLUSTERS: usize = 20_000;
/// How many times weights are averaged with their neighbours while they are spread back.
const SWEEPS: usize = 5;
/// Points handled at a time by one thread.
const CHUNK: usize = 1024;

/// Connected clusters of vertices, each standing for one coarse vertex.
pub(crate) struct Coarse {
    /// The cluster of each fine vertex.
    pub cluster: Vec<u32>,
    pub points: Vec<Vec3>,
    pub triangles: Vec<[u32; 3]>,
}

impl Coarse {
    /// Grows clusters of equal size breadth first over the edges of `graph`.
    pub fn new(points: &[Vec3], triangles: &[[u32; 3]], graph: &Graph) -> Self {
        const FREE: u32 = u32::MAX;
        let size = points.len().div_ceil(CLUSTERS).max(1);
        let mut cluster = vec![FREE; points.len()];
        let mut count = 0u32;
        let mut members: Vec<u32> = Vec::with_capacity(size);
        // Where the next clusters start: beside the ones that are done, so that no slivers stay between them.
        let mut front = std::collections::VecDeque::new();
        for start in 0..points.len() {
            front.push_back(start as u32);
            while let Some(seed) = front.pop_front() {
                if cluster[seed as usize] != FREE {
                    continue;
                }
                members.clear();
                members.push(seed);
                cluster[seed as usize] = count;
                let mut next = 0;
                while next < members.len() {
                    let v = members[next] as usize;
                    next += 1;
                    for (n, _) in graph.of(v) {
                        if cluster[n] == FREE {
                            if members.len() < size {
                                cluster[n] = count;
                                members.push(n as u32);
                            } else {
                                front.push_back(n as u32);
                            }
                        }
                    }
                }
                let beside = members.iter().flat_map(|&v| graph.of(v as usize)).map(|(n, _)| cluster[n]).find(|&c| c != count && c != FREE);
                match beside {
                    // A remnant joins its neighbour.
                    Some(other) if members.len() * 3 < size => {
                        for &v in &members {
                            cluster[v as usize] = other;
                        }
                    }
                    _ => count += 1,
                }
            }
        }
        let mut sums = vec![(Vec3::ZERO, 0f32); count as usize];
        for (&c, &point) in cluster.iter().zip(points) {
            let sum = &mut sums[c as usize];
            sum.0 += point;
            sum.1 += 1.0;
        }
        let triangles = triangles
            .iter()
            .map(|t| t.map(|v| cluster[v as usize]))
            .filter(|[a, b, c]| a != b && b != c && c != a)
            .collect();
        Self { cluster, points: sums.into_iter().map(|(sum, n)| sum / n).collect(), triangles }
    }

    /// Spreads the weights of clusters to the fine vertices: the same equilibrium, a few steps of it.
    ///
    /// Clusters without a claim keep their weights to themselves.
    pub fn spread(&self, coarse: &Weights, claims: &[Claim], graph: &Graph, smoothing: f32) -> Weights {
        let mut weights = Weights { starts: Vec::with_capacity(self.cluster.len() + 1), ..Weights::default() };
        weights.starts.push(0);
        for &c in &self.cluster {
            weights.push(coarse.of(c as usize));
        }
        for _ in 0..SWEEPS {
            weights = self.sweep(&weights, claims, graph, 1.0 / smoothing);
        }
        weights
    }

    fn sweep(&self, weights: &Weights, claims: &[Claim], graph: &Graph, sharpness: f32) -> Weights {
        let vertices: Vec<u32> = (0..self.cluster.len() as u32).collect();
        let parts: Vec<Weights> = vertices
            .par_chunks(CHUNK)
            .map(|chunk| {
                let mut part = Weights { starts: vec![0], ..Weights::default() };
                let mut row: Vec<(u32, f32)> = Vec::new();
                for &v in chunk {
                    let v = v as usize;
                    let claim = &claims[self.cluster[v] as usize];
                    if claim.heat <= 0.0 {
                        part.push(weights.of(v));
                        continue;
                    }
                    // Deep inside one joint's flesh nothing changes.
                    if let Some(only) = sole(weights, v)
                        && claim.shares[0] == (only, 1.0)
                        && graph.of(v).all(|(n, _)| sole(weights, n) == Some(only))
                    {
                        part.push([(only, 1.0)]);
                        continue;
                    }
                    row.clear();
                    let mut total = 0.0;
                    for (n, w) in graph.of(v) {
                        total += w;
                        add(&mut row, weights.of(n), w);
                    }
                    // Half of the old value keeps the steps from swinging.
                    add(&mut row, weights.of(v), total);
                    let warmth = graph.areas[v] * claim.heat * sharpness;
                    add(&mut row, claim.shares.iter().copied().filter(|s| s.1 > 0.0), warmth);
                    shape(&mut row, 8, 1e-3);
                    part.push(row.iter().copied());
                }
                part
            })
            .collect();
        let mut all = Weights { starts: Vec::with_capacity(self.cluster.len() + 1), ..Weights::default() };
        all.starts.push(0);
        for part in &parts {
            let base = all.joints.len() as u32;
            all.joints.extend_from_slice(&part.joints);
            all.values.extend_from_slice(&part.values);
            all.starts.extend(part.starts[1..].iter().map(|s| s + base));
        }
        all
    }
}

/// The joint of a vertex that has only one.
fn sole(weights: &Weights, v: usize) -> Option<u32> {
    let start = weights.starts[v];
    (weights.starts[v + 1] == start + 1).then(|| weights.joints[start as usize])
}

/// Adds `more` times `factor` to a sparse row.
fn add(row: &mut Vec<(u32, f32)>, more: impl Iterator<Item = (u32, f32)>, factor: f32) {
    for (joint, value) in more {
        match row.iter_mut().find(|e| e.0 == joint) {
            Some(entry) => entry.1 += value * factor,
            None => row.push((joint, value * factor)),
        }
    }
}
