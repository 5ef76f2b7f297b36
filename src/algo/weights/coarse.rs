//! A coarser surface for large meshes: weights vary over a limb's width, not from vertex to vertex, so a mesh of a
//! million points is bound through some ten thousand and the result is spread back.

use glam::Vec3;

use super::{claim::Claim, heat, laplacian::Graph};
use crate::mesh::model::Weights;

/// Meshes up to this many points are bound as they are.
pub(crate) const LIMIT: usize = 40_000;
/// Approximate number of clusters that a larger mesh becomes.
const CLUSTERS: usize = 20_000;
/// Number of times that weights are averaged with their neighbours while they are spread back.
const STEPS: usize = 5;

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
                let beside = members
                    .iter()
                    .flat_map(|&v| graph.of(v as usize))
                    .map(|(n, _)| cluster[n])
                    .find(|&c| c != count && c != FREE);
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

    /// Spreads the weights of clusters to the fine vertices, by some steps towards the equilibrium on the fine surface.
    ///
    /// Where `claim` has no heat, as where voxels bound, steps between clusters are only smoothed.
    pub fn spread<'a>(
        &self,
        coarse: &Weights,
        graph: &Graph,
        smoothing: f32,
        claim: impl Fn(usize) -> &'a Claim + Sync,
    ) -> Weights {
        let influences: usize = self.cluster.iter().map(|c| coarse.of(*c as usize).len()).sum();
        let mut weights = Weights {
            starts: Vec::with_capacity(self.cluster.len() + 1),
            joints: Vec::with_capacity(influences),
            values: Vec::with_capacity(influences),
        };
        weights.starts.push(0);
        for &c in &self.cluster {
            weights.push(coarse.of(c as usize));
        }
        for _ in 0..STEPS {
            weights = heat::step(&weights, graph, smoothing, |v| claim(self.cluster[v] as usize));
        }
        weights
    }
}
