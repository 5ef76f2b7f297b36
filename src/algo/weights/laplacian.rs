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
    /// Cotangents of angles are clamped: a needle would couple its ends without bound, and a negative sum would break
    /// the maximum principle that keeps weights between zero and one. Edges may have any number of triangles. Repeated
    /// corners are skipped.
    pub fn new(points: &[Vec3], triangles: &[[u32; 3]]) -> Self {
        let n = points.len();
        let whole = |t: &[u32; 3]| t[0] != t[1] && t[1] != t[2] && t[2] != t[0];
        let mut room = vec![0u32; n + 1];
        for t in triangles.iter().filter(|t| whole(t)) {
            for &v in t {
                room[v as usize + 1] += 2;
            }
        }
        for i in 0..n {
            room[i + 1] += room[i];
        }
        let mut next = room.clone();
        let mut half_edges = vec![(0u32, 0f32); room[n] as usize];
        let mut areas = vec![0f32; n];
        for t in triangles.iter().filter(|t| whole(t)) {
            let corner = t.map(|i| points[i as usize]);
            let double_area = (corner[1] - corner[0]).cross(corner[2] - corner[0]).length();
            for i in 0..3 {
                let (j, k) = ((i + 1) % 3, (i + 2) % 3);
                let dot = (corner[j] - corner[i]).dot(corner[k] - corner[i]);
                let cotangent =
                    if double_area > 0.0 { (dot / double_area).clamp(-MAX_COTANGENT, MAX_COTANGENT) } else { 0.0 };
                for (from, to) in [(t[j], t[k]), (t[k], t[j])] {
                    half_edges[next[from as usize] as usize] = (to, 0.5 * cotangent);
                    next[from as usize] += 1;
                }
                areas[t[i] as usize] += double_area / 6.0;
            }
        }
        // Rows come out in the order of the triangles, so both halves of an edge are the same sum.
        let mut starts = Vec::with_capacity(n + 1);
        let mut columns = Vec::with_capacity(half_edges.len() / 2 + n);
        let mut values: Vec<f32> = Vec::with_capacity(half_edges.len() / 2 + n);
        starts.push(0);
        for v in 0..n {
            let row = &mut half_edges[room[v] as usize..room[v + 1] as usize];
            row.sort_by_key(|e| e.0);
            let first = columns.len();
            for &(to, weight) in row.iter() {
                if columns.len() > first && columns.last() == Some(&to) {
                    if let Some(value) = values.last_mut() {
                        *value += weight;
                    }
                } else {
                    columns.push(to);
                    values.push(weight);
                }
            }
            for value in &mut values[first..] {
                *value = value.max(MIN_WEIGHT);
            }
            starts.push(columns.len() as u32);
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
