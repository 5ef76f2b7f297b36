//! The Laplacian of a welded surface that no triangle can spoil.

use glam::Vec3;

/// Weighted edges in compressed rows, and the area around each vertex.
#[derive(Debug, Clone, Default)]
pub(crate) struct Graph {
    /// One entry a vertex and one more at the end.
    pub starts: Vec<u32>,
    /// The other end of each edge.
    pub columns: Vec<u32>,
    /// Half the sum of the cotangents of the opposite angles, never negative.
    pub values: Vec<f32>,
    /// A third of the areas of the triangles around.
    pub areas: Vec<f32>,
}

impl Graph {
    /// Cotangent weights (Pinkall and Polthier 1993), lumped areas.
    ///
    /// Cotangents of angles are clamped: a needle would couple its ends without bound, and a negative sum would break the
    /// maximum principle that keeps weights between zero and one. Edges may have any number of triangles. Repeated
    /// corners are skipped.
    pub fn new(points: &[Vec3], triangles: &[[u32; 3]]) -> Self {
        let n = points.len();
        let mut areas = vec![0f32; n];
        let mut half_edges: Vec<(u64, f32)> = Vec::with_capacity(triangles.len() * 3);
        for &[a, b, c] in triangles {
            if a == b || b == c || c == a {
                continue;
            }
            let corner = [a, b, c].map(|i| points[i as usize]);
            let double_area = (corner[1] - corner[0]).cross(corner[2] - corner[0]).length();
            for i in 0..3 {
                let (j, k) = ((i + 1) % 3, (i + 2) % 3);
                let dot = (corner[j] - corner[i]).dot(corner[k] - corner[i]);
                let cotangent = if double_area > 0.0 { (dot / double_area).clamp(-MAX_COTANGENT, MAX_COTANGENT) } else { 0.0 };
                let (from, to) = ([a, b, c][j], [a, b, c][k]);
                let key = (u64::from(from.min(to)) << 32) | u64::from(from.max(to));
                half_edges.push((key, 0.5 * cotangent));
                areas[[a, b, c][i] as usize] += double_area / 6.0;
            }
        }
        // A stable sort, so that sums are taken in the order of the triangles.
        half_edges.sort_by_key(|e| e.0);
        let mut edges: Vec<(u32, u32, f32)> = Vec::with_capacity(half_edges.len() / 2);
        for (key, weight) in half_edges {
            let (low, high) = ((key >> 32) as u32, key as u32);
            match edges.last_mut() {
                Some(last) if (last.0, last.1) == (low, high) => last.2 += weight,
                _ => edges.push((low, high, weight)),
            }
        }
        let mut starts = vec![0u32; n + 1];
        for &(low, high, _) in &edges {
            starts[low as usize + 1] += 1;
            starts[high as usize + 1] += 1;
        }
        for i in 0..n {
            starts[i + 1] += starts[i];
        }
        let mut next = starts.clone();
        let mut columns = vec![0u32; edges.len() * 2];
        let mut values = vec![0f32; edges.len() * 2];
        for (low, high, weight) in edges {
            for (from, to) in [(low, high), (high, low)] {
                let slot = next[from as usize] as usize;
                next[from as usize] += 1;
                columns[slot] = to;
                values[slot] = weight.max(MIN_WEIGHT);
            }
        }
        Self { starts, columns, values, areas }
    }

    /// Neighbours of a vertex with the weights of their edges.
    pub fn of(&self, vertex: usize) -> impl Iterator<Item = (usize, f32)> + '_ {
        let range = self.starts[vertex] as usize..self.starts[vertex + 1] as usize;
        self.columns[range.clone()].iter().map(|&c| c as usize).zip(self.values[range].iter().copied())
    }
}

/// The cotangent of about six degrees.
const MAX_COTANGENT: f32 = 10.0;

/// Edges between obtuse angles still conduct a little, so that no vertex is cut off.
const MIN_WEIGHT: f32 = 1e-3;
