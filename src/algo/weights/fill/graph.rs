//! The vertex graph: vertices at one place as one node, tied by the edges of the triangles.

use glam::Vec3;

/// Vertices welded by position, with the mesh's edges between them.
pub(crate) struct Graph {
    nodes: Vec<u32>,
    places: Vec<Vec3>,
    starts: Vec<u32>,
    neighbours: Vec<u32>,
}

impl Graph {
    /// Welds equal positions and gathers edges. Points that are not finite have no node; triangles with corners out of
    /// range are ignored.
    pub(crate) fn new(points: &[Vec3], triangles: &[[u32; 3]]) -> Self {
        let key = |i: u32| points[i as usize].to_array();
        let mut order: Vec<u32> = (0..points.len() as u32).filter(|&i| points[i as usize].is_finite()).collect();
        // Finite numbers compare; -0 and 0 are equal, as they should be.
        order.sort_unstable_by(|&a, &b| {
            key(a).partial_cmp(&key(b)).unwrap_or(std::cmp::Ordering::Equal).then(a.cmp(&b))
        });
        // Nodes are numbered by their first vertex, so that the graph has the mesh's locality.
        let mut first: Vec<u32> = vec![u32::MAX; points.len()];
        for group in order.chunk_by(|&a, &b| key(a) == key(b)) {
            for &i in group {
                first[i as usize] = group[0];
            }
        }
        let mut nodes = vec![u32::MAX; points.len()];
        let mut places = Vec::new();
        for (i, &first) in first.iter().enumerate() {
            if first == i as u32 {
                nodes[i] = places.len() as u32;
                places.push(points[i]);
            }
        }
        for (i, &first) in first.iter().enumerate() {
            if first != u32::MAX {
                nodes[i] = nodes[first as usize];
            }
        }
        let mut edges: Vec<(u32, u32)> = Vec::with_capacity(triangles.len() * 6);
        for triangle in triangles {
            let corners = triangle.map(|c| nodes.get(c as usize).copied().unwrap_or(u32::MAX));
            if corners.contains(&u32::MAX) {
                continue;
            }
            for (a, b) in [(0, 1), (1, 2), (2, 0)] {
                if corners[a] != corners[b] {
                    edges.push((corners[a], corners[b]));
                    edges.push((corners[b], corners[a]));
                }
            }
        }
        edges.sort_unstable();
        edges.dedup();
        let mut starts = vec![0u32; places.len() + 1];
        for &(from, _) in &edges {
            starts[from as usize + 1] += 1;
        }
        for i in 0..places.len() {
            starts[i + 1] += starts[i];
        }
        Self { nodes, places, starts, neighbours: edges.into_iter().map(|e| e.1).collect() }
    }

    /// The number of nodes.
    pub(crate) fn len(&self) -> usize {
        self.places.len()
    }

    /// The node of a vertex, `None` if its position is not finite.
    pub(crate) fn node(&self, point: usize) -> Option<usize> {
        let node = self.nodes[point];
        (node != u32::MAX).then_some(node as usize)
    }

    /// The position of a node.
    pub(crate) fn place(&self, node: usize) -> Vec3 {
        self.places[node]
    }

    /// Nodes that share an edge with a node, rising.
    pub(crate) fn neighbours(&self, node: usize) -> &[u32] {
        &self.neighbours[self.starts[node] as usize..self.starts[node + 1] as usize]
    }

    /// The connected parts of the mesh, in the order of their first node.
    pub(crate) fn islands(&self) -> Vec<Vec<u32>> {
        let mut seen = vec![false; self.len()];
        let mut islands = Vec::new();
        for start in 0..self.len() {
            if seen[start] {
                continue;
            }
            seen[start] = true;
            let mut island = vec![start as u32];
            let mut next = 0;
            while let Some(&node) = island.get(next) {
                next += 1;
                for &n in self.neighbours(node as usize) {
                    if !seen[n as usize] {
                        seen[n as usize] = true;
                        island.push(n);
                    }
                }
            }
            islands.push(island);
        }
        islands
    }
}
