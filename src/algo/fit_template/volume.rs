//! Volume: a graph of voxels that holds the inside of a mesh and its thin sheets, and distances through it.
//!
//! Cells are nodes where their centre is inside; cells of the surface layer count only where nothing solid is near (a
//! feather, a cloak), so that an arm beside a hip stays apart from it. Loose components are tied together over the
//! shortest gaps: a robot's forearm, an armour's plates.

use glam::Vec3;

use crate::mesh::voxels::Voxels;

/// Costs of a step over a face, an edge and a corner of a cell.
const COSTS: [u32; 3] = [10, 14, 17];
/// Distance of a node that cannot be reached.
pub(super) const FAR: u32 = u32::MAX;
/// Largest gap between components that are tied, in cells.
const LONGEST_TIE: u32 = 14;
/// Share of all nodes that a component needs to be tied over a gap of more than two cells.
const TIED_SHARE: f32 = 1e-3;
/// Size of a component, as a share of the largest, from which on both may be the body.
const ALIKE: f32 = 0.9;

/// Neighbours of a cell that lie inside, from which on it is inside of something thick.
const DEEP: u32 = 10;

/// Nodes at voxels and their neighbours.
#[derive(Debug, Clone)]
pub(super) struct VoxelGraph {
    /// Centres of the nodes.
    pub(super) centres: Vec<Vec3>,
    /// Edge of a cell.
    pub(super) cell: f32,
    starts: Vec<u32>,
    links: Vec<(u32, u32)>,
    /// Depth of each node under the surface of the volume, in cells.
    pub(super) depth: Vec<u8>,
    /// Nodes that are part of the connected body.
    pub(super) body: Vec<bool>,
    /// Node of each solid cell; `u32::MAX` for a cell of the surface layer of something thick.
    node_of: Vec<u32>,
    /// Components that were tied to the largest one, and those left loose.
    pub(super) tied: usize,
    pub(super) loose: usize,
}

impl VoxelGraph {
    /// Number of nodes.
    pub(super) fn len(&self) -> usize {
        self.centres.len()
    }

    pub(super) fn neighbours(&self, node: u32) -> &[(u32, u32)] {
        &self.links[self.starts[node as usize] as usize..self.starts[node as usize + 1] as usize]
    }

    /// True if the surface at a place belongs to the body; `None` where nothing is solid.
    pub(super) fn is_of_body(&self, voxels: &Voxels, place: Vec3) -> Option<bool> {
        let cell = voxels.cell_at(voxels.to_grid(place))?;
        let of_node = |node: u32| self.body.get(node as usize).copied();
        let own = of_node(self.node_of[voxels.solid_index(cell)?]);
        if own.is_some() {
            return own;
        }
        let mut found = None;
        voxels.neighbours(cell, |next, _, _| {
            if let Some(is_body) = of_node(self.node_of[next]) {
                found = Some(is_body || found == Some(true));
            }
        });
        found
    }

    /// The largest connected part of some nodes as the body; other nodes stay without neighbours.
    pub(super) fn of_nodes(&self, kept: &[bool]) -> Self {
        let (mut starts, mut links) = (vec![0u32], Vec::with_capacity(self.links.len()));
        for node in 0..self.len() {
            if kept[node] {
                links.extend(self.neighbours(node as u32).iter().filter(|(next, _)| kept[*next as usize]));
            }
            starts.push(links.len() as u32);
        }
        // Links are by far the largest part, and are other ones.
        let mut part = Self {
            centres: self.centres.clone(),
            cell: self.cell,
            starts,
            links,
            depth: self.depth.clone(),
            body: self.body.clone(),
            node_of: self.node_of.clone(),
            tied: self.tied,
            loose: self.loose,
        };
        let (component, sizes) = components(&part);
        let largest = (0..sizes.len()).max_by_key(|&c| (sizes[c], std::cmp::Reverse(c))).unwrap_or(0);
        part.body = (0..self.len()).map(|node| kept[node] && component[node] as usize == largest).collect();
        part
    }

    /// Units of length of a cost.
    pub(super) fn length(&self, cost: u32) -> f32 {
        cost as f32 * 0.1 * self.cell
    }

    /// Costs of the shortest paths from `sources` (with a start cost each) to all nodes, by buckets of equal cost.
    pub(super) fn distances(&self, sources: &[(u32, u32)]) -> Vec<u32> {
        let mut distance = vec![FAR; self.len()];
        let widest = self.links.iter().map(|l| l.1).max().unwrap_or(17) as usize + 1;
        let first = sources.iter().map(|s| s.1).min().unwrap_or(0);
        let mut buckets: Vec<Vec<u32>> = vec![Vec::new(); widest];
        let mut later: Vec<(u32, u32)> = sources.to_vec();
        later.sort_unstable_by_key(|&(node, cost)| std::cmp::Reverse((cost, node)));
        let (mut cost, mut waiting) = (first, 0usize);
        while waiting > 0 || !later.is_empty() {
            while let Some(&(node, start)) = later.last().filter(|l| l.1 <= cost) {
                later.pop();
                if start < distance[node as usize] {
                    distance[node as usize] = start;
                    buckets[cost as usize % widest].push(node);
                    waiting += 1;
                }
            }
            let bucket = std::mem::take(&mut buckets[cost as usize % widest]);
            waiting -= bucket.len();
            for node in bucket {
                if distance[node as usize] != cost {
                    continue;
                }
                for &(next, step) in self.neighbours(node) {
                    let reached = cost + step;
                    if reached < distance[next as usize] {
                        distance[next as usize] = reached;
                        buckets[reached as usize % widest].push(next);
                        waiting += 1;
                    }
                }
            }
            cost += 1;
        }
        distance
    }
}

/// Builds the graph of `voxels`. Of components that are as large the body is the one nearest to `origin`.
pub(super) fn graph(voxels: &Voxels, origin: Vec3) -> VoxelGraph {
    let cells = voxels.cells();
    let coordinate = |cell: &[u16; 3]| cell.map(usize::from);
    let core: Vec<bool> = cells.iter().map(|c| voxels.is_core(coordinate(c))).collect();
    // Inside a thick part most neighbours are inside, too; a stray cell inside a sheet has few.
    let deep: Vec<bool> = cells
        .iter()
        .zip(&core)
        .map(|(cell, &core)| {
            let mut around = 0;
            if core {
                voxels.neighbours(coordinate(cell), |_, _, core| around += u32::from(core));
            }
            around >= DEEP
        })
        .collect();
    let mut node_of = vec![u32::MAX; cells.len()];
    let mut nodes: Vec<u32> = Vec::new();
    for (index, cell) in cells.iter().enumerate() {
        let mut thin = true;
        if !core[index] {
            voxels.neighbours(coordinate(cell), |next, _, _| thin &= !deep[next]);
        }
        if core[index] || thin {
            node_of[index] = nodes.len() as u32;
            nodes.push(index as u32);
        }
    }
    let (mut starts, mut links) = (vec![0u32], Vec::with_capacity(nodes.len() * 20));
    for &index in &nodes {
        voxels.neighbours(coordinate(&cells[index as usize]), |next, kind, _| {
            if node_of[next] != u32::MAX {
                links.push((node_of[next], COSTS[kind]));
            }
        });
        starts.push(links.len() as u32);
    }
    let centres: Vec<Vec3> = nodes.iter().map(|&i| voxels.center(coordinate(&cells[i as usize]))).collect();
    let mut graph = VoxelGraph {
        body: vec![true; centres.len()],
        depth: depths(&starts, &links),
        centres,
        cell: voxels.cell() as f32,
        starts,
        links,
        node_of,
        tied: 0,
        loose: 0,
    };
    let places: Vec<[u16; 3]> = nodes.iter().map(|&i| cells[i as usize]).collect();
    tie_components(&mut graph, &places, voxels.dims(), origin);
    graph
}

/// Depth of each node: layers from the nodes that miss a neighbour.
fn depths(starts: &[u32], links: &[(u32, u32)]) -> Vec<u8> {
    let count = starts.len() - 1;
    let of = |node: usize| &links[starts[node] as usize..starts[node + 1] as usize];
    let mut depth = vec![0u8; count];
    let mut front: Vec<u32> = (0..count as u32).filter(|&n| of(n as usize).len() < 26).collect();
    front.iter().for_each(|&n| depth[n as usize] = 1);
    let mut layer = 1u8;
    while !front.is_empty() && layer < u8::MAX {
        layer += 1;
        let mut next_front = Vec::new();
        for node in front {
            for &(next, _) in of(node as usize) {
                if depth[next as usize] == 0 {
                    depth[next as usize] = layer;
                    next_front.push(next);
                }
            }
        }
        front = next_front;
    }
    depth
}

/// Numbers the components of the graph; returns the number of each node and the size of each component.
fn components(graph: &VoxelGraph) -> (Vec<u32>, Vec<u32>) {
    let mut component = vec![u32::MAX; graph.len()];
    let mut sizes = Vec::new();
    let mut stack = Vec::new();
    for seed in 0..graph.len() as u32 {
        if component[seed as usize] != u32::MAX {
            continue;
        }
        let number = sizes.len() as u32;
        component[seed as usize] = number;
        stack.push(seed);
        let mut size = 0;
        while let Some(node) = stack.pop() {
            size += 1;
            for &(next, _) in graph.neighbours(node) {
                if component[next as usize] == u32::MAX {
                    component[next as usize] = number;
                    stack.push(next);
                }
            }
        }
        sizes.push(size);
    }
    (component, sizes)
}

/// Ties components over the shortest gaps, as a spanning tree, and marks what stays loose.
fn tie_components(graph: &mut VoxelGraph, places: &[[u16; 3]], dims: [usize; 3], origin: Vec3) {
    let (component, sizes) = components(graph);
    if sizes.len() < 2 {
        return;
    }
    // Fronts grow through the empty cells from all components at once; where two meet is a gap.
    let at = |p: [u16; 3]| (p[2] as usize * dims[1] + p[1] as usize) * dims[0] + p[0] as usize;
    let mut owner = vec![u32::MAX; dims[0] * dims[1] * dims[2]];
    let mut depth = vec![0u8; owner.len()];
    let mut front: Vec<u32> = Vec::new();
    for (node, &place) in places.iter().enumerate() {
        owner[at(place)] = node as u32;
        front.push(at(place) as u32);
    }
    let steps = [1usize, dims[0], dims[0] * dims[1]];
    let mut gaps: Vec<(u32, u32, u32)> = Vec::new();
    for layer in 1..=(LONGEST_TIE / 2) as u8 {
        let mut next_front = Vec::new();
        for &cell in &front {
            let from = owner[cell as usize];
            let x = cell as usize % dims[0];
            let y = cell as usize / dims[0] % dims[1];
            let z = cell as usize / steps[2];
            let ways = [
                (x > 0).then(|| cell as usize - steps[0]),
                (x + 1 < dims[0]).then(|| cell as usize + steps[0]),
                (y > 0).then(|| cell as usize - steps[1]),
                (y + 1 < dims[1]).then(|| cell as usize + steps[1]),
                (z > 0).then(|| cell as usize - steps[2]),
                (z + 1 < dims[2]).then(|| cell as usize + steps[2]),
            ];
            for way in ways.into_iter().flatten() {
                let there = owner[way];
                if there == u32::MAX {
                    owner[way] = from;
                    depth[way] = layer;
                    next_front.push(way as u32);
                } else if component[there as usize] != component[from as usize] {
                    gaps.push((u32::from(depth[way]) + u32::from(depth[cell as usize]), from, there));
                }
            }
        }
        front = next_front;
    }
    let gap_cost = |a: u32, b: u32| {
        let length = graph.centres[a as usize].distance(graph.centres[b as usize]) / graph.cell;
        (length * 10.0) as u32 + 1
    };
    let mut ties: Vec<(u32, u32, u32)> = gaps.iter().map(|&(_, a, b)| (gap_cost(a, b), a.min(b), a.max(b))).collect();
    ties.sort_unstable();
    ties.dedup();
    let mut group: Vec<u32> = (0..sizes.len() as u32).collect();
    let least = (graph.len() as f32 * TIED_SHARE) as u32;
    let mut extra = Vec::new();
    for (cost, a, b) in ties {
        let (ca, cb) = (component[a as usize], component[b as usize]);
        if cost > 30 && sizes[ca as usize].min(sizes[cb as usize]) < least {
            continue;
        }
        let (ga, gb) = (find(&mut group, ca), find(&mut group, cb));
        if ga != gb {
            group[ga.max(gb) as usize] = ga.min(gb);
            extra.push((a, b, cost));
        }
    }
    graph.tied = extra.len();
    add_links(graph, &extra);
    let (component, sizes) = components(graph);
    let main = main_component(graph, &component, &sizes, origin);
    graph.loose = sizes.len() - 1;
    graph.body = component.iter().map(|&c| c as usize == main).collect();
}

/// The largest component; of those nearly as large, such as figures side by side, the one nearest to `origin`.
fn main_component(graph: &VoxelGraph, component: &[u32], sizes: &[u32], origin: Vec3) -> usize {
    let mut sums = vec![Vec3::ZERO; sizes.len()];
    for (&c, centre) in component.iter().zip(&graph.centres) {
        sums[c as usize] += *centre;
    }
    let largest = sizes.iter().copied().max().unwrap_or(0) as f32;
    let away = |c: usize| (sums[c] / sizes[c].max(1) as f32).distance(origin);
    let large = (0..sizes.len()).filter(|&c| sizes[c] as f32 >= ALIKE * largest);
    large.min_by(|&a, &b| away(a).total_cmp(&away(b)).then(a.cmp(&b))).unwrap_or(0)
}

fn find(group: &mut [u32], mut c: u32) -> u32 {
    while group[c as usize] != c {
        group[c as usize] = group[group[c as usize] as usize];
        c = group[c as usize];
    }
    c
}

fn add_links(graph: &mut VoxelGraph, extra: &[(u32, u32, u32)]) {
    let mut all: Vec<Vec<(u32, u32)>> = Vec::new();
    all.resize(graph.len(), Vec::new());
    for &(a, b, cost) in extra {
        all[a as usize].push((b, cost));
        all[b as usize].push((a, cost));
    }
    let (mut starts, mut links) = (vec![0u32], Vec::with_capacity(graph.links.len() + 2 * extra.len()));
    for (node, more) in all.iter().enumerate() {
        links.extend_from_slice(graph.neighbours(node as u32));
        links.extend_from_slice(more);
        starts.push(links.len() as u32);
    }
    (graph.starts, graph.links) = (starts, links);
}
