//! Refinement of raw quads to a finished surface: vertices on the field's zero, evenly spread, mirrored, and checked.

use std::collections::BTreeMap;

use glam::{DVec3, dvec3};
use rayon::prelude::*;

use crate::{field::gradient, surface_nets::Quads};

/// Settings of [`settle`].
#[derive(Debug, Clone, Copy)]
pub struct Settle {
    /// Rounds of spreading and projecting.
    pub rounds: usize,
    /// Share of the way to the neighbours' mean that a vertex moves in its tangent plane each round, 0 to 1.
    pub spread: f64,
    /// Longest move of one Newton step, metres; about a cell.
    pub reach: f64,
    /// Step of the numeric gradient, metres.
    pub step: f64,
    /// Rounds of smoothing at the end.
    pub polish: usize,
}

/// Spreads vertices along the surface, as densely as they are in each region, and puts them on the field's zero with
/// Newton steps; then takes out what is finer than the mesh can show. `ring` says how dense the mesh wants to be.
pub fn settle(quads: &mut Quads, ring: &Ring, field: &(impl Fn(DVec3) -> f64 + Sync), how: Settle) {
    for _ in 0..how.rounds {
        let before = quads.points.clone();
        quads.points = (0..before.len())
            .into_par_iter()
            .map(|i| {
                let mut p = before[i];
                let normal = gradient(field, p, how.step).normalize_or_zero();
                let to = ring.mean(&before, i) - p;
                p += (to - normal * to.dot(normal)) * how.spread;
                for _ in 0..2 {
                    let value = field(p);
                    let slope = gradient(field, p, how.step);
                    let move_by = slope * (-value / slope.length_squared().max(0.05));
                    p += move_by.clamp_length_max(how.reach);
                }
                if quads.on_plane[i] {
                    p.x = 0.0;
                }
                p
            })
            .collect();
    }
    // Taubin's filter: in by a third, out by a little more, so that nothing shrinks.
    for factor in [0.33, -0.34].repeat(how.polish) {
        let before = quads.points.clone();
        for i in 0..before.len() {
            let mut p = before[i] + (ring.mean(&before, i) - before[i]) * factor;
            if quads.on_plane[i] {
                p.x = 0.0;
            }
            quads.points[i] = p;
        }
    }
}

/// Neighbours of every vertex with weights that keep the density of the mesh as it is.
pub struct Ring {
    lists: Vec<Vec<u32>>,
    /// The usual edge length around each vertex.
    size: Vec<f64>,
    /// Vertices on the plane of symmetry, and whether a vertex is one.
    on_plane: Vec<bool>,
}

impl Ring {
    /// The neighbours in a mesh, and its edge lengths as the wanted density.
    pub fn new(quads: &Quads) -> Self {
        let lists = neighbours(quads);
        let at = |i: u32| quads.points[i as usize];
        let mut size: Vec<f64> = (0..lists.len())
            .map(|i| lists[i].iter().map(|&j| at(j).distance(at(i as u32))).sum::<f64>() / lists[i].len().max(1) as f64)
            .collect();
        for _ in 0..4 {
            let before = size.clone();
            for (i, list) in lists.iter().enumerate() {
                let sum: f64 = list.iter().map(|&j| before[j as usize]).sum();
                size[i] = (before[i] + sum) / (1.0 + list.len() as f64);
            }
        }
        Self { lists, size, on_plane: quads.on_plane.clone() }
    }

    /// Mean place of the neighbours of a vertex, which pull it there.
    fn mean(&self, points: &[DVec3], i: usize) -> DVec3 {
        let (mut sum, mut total) = (DVec3::ZERO, 0.0);
        for &j in &self.lists[i] {
            let j = j as usize;
            // A neighbour off the plane stands for its mirror image too.
            let twice = if self.on_plane[i] && !self.on_plane[j] { 2.0 } else { 1.0 };
            let weight = twice / (self.size[i] + self.size[j]);
            sum += points[j] * weight;
            total += weight;
        }
        sum / total
    }
}

/// The vertices that share an edge with each vertex, in rising order.
fn neighbours(quads: &Quads) -> Vec<Vec<u32>> {
    let mut lists = vec![Vec::new(); quads.points.len()];
    for face in &quads.faces {
        for k in 0..4 {
            let (a, b) = (face[k], face[(k + 1) % 4]);
            lists[a as usize].push(b);
            lists[b as usize].push(a);
        }
    }
    for list in &mut lists {
        list.sort_unstable();
        list.dedup();
    }
    lists
}

/// The whole of a half, the mirrored vertices and faces after the given ones.
pub fn mirrored(half: &Quads) -> Quads {
    let mut whole = half.clone();
    let twin: Vec<u32> = (0..half.points.len())
        .map(|i| {
            if half.on_plane[i] {
                return i as u32;
            }
            let p = half.points[i];
            whole.points.push(dvec3(-p.x, p.y, p.z));
            whole.on_plane.push(false);
            whole.points.len() as u32 - 1
        })
        .collect();
    for face in &half.faces {
        let [a, b, c, d] = face.map(|i| twin[i as usize]);
        whole.faces.push([d, c, b, a]);
    }
    whole
}

/// Keeps only the largest shell. Returns how many others were dropped.
pub fn largest_shell(quads: &mut Quads) -> usize {
    let neighbours = neighbours(quads);
    let mut shell = vec![usize::MAX; quads.points.len()];
    let mut sizes = Vec::new();
    for start in 0..shell.len() {
        if shell[start] != usize::MAX {
            continue;
        }
        let name = sizes.len();
        let mut stack = vec![start];
        shell[start] = name;
        let mut size = 0;
        while let Some(i) = stack.pop() {
            size += 1;
            for &j in &neighbours[i] {
                if shell[j as usize] == usize::MAX {
                    shell[j as usize] = name;
                    stack.push(j as usize);
                }
            }
        }
        sizes.push(size);
    }
    let Some(best) = (0..sizes.len()).max_by_key(|&i| sizes[i]) else { return 0 };
    let mut new_index = vec![u32::MAX; shell.len()];
    let mut kept = Quads::default();
    for (i, &name) in shell.iter().enumerate() {
        if name == best {
            new_index[i] = kept.points.len() as u32;
            kept.points.push(quads.points[i]);
            kept.on_plane.push(quads.on_plane[i]);
        }
    }
    for face in &quads.faces {
        if shell[face[0] as usize] == best {
            kept.faces.push(face.map(|i| new_index[i as usize]));
        }
    }
    *quads = kept;
    sizes.len() - 1
}

/// Faults that keep a surface from being a closed manifold; empty if there are none.
pub fn faults(quads: &Quads) -> Vec<String> {
    let mut edges: BTreeMap<(u32, u32), u32> = BTreeMap::new();
    let mut fans: Vec<Vec<(u32, u32)>> = vec![Vec::new(); quads.points.len()];
    for face in &quads.faces {
        for k in 0..4 {
            *edges.entry((face[k], face[(k + 1) % 4])).or_default() += 1;
            fans[face[k] as usize].push((face[(k + 1) % 4], face[(k + 3) % 4]));
        }
    }
    let mut faults = Vec::new();
    for (&(a, b), &count) in &edges {
        if count != 1 || a == b || edges.get(&(b, a)) != Some(&1) {
            faults.push(format!("edge {a} {b} near {} is not shared by two faces", quads.points[a as usize]));
        }
    }
    for (i, fan) in fans.iter().enumerate() {
        let next: BTreeMap<u32, u32> = fan.iter().copied().collect();
        let Some(&(start, _)) = fan.first() else {
            faults.push(format!("vertex {i} has no face"));
            continue;
        };
        let (mut at, mut steps) = (start, 0);
        while let Some(&to) = next.get(&at) {
            at = to;
            steps += 1;
            if at == start || steps > fan.len() {
                break;
            }
        }
        if steps != fan.len() {
            faults.push(format!("the faces around vertex {i} near {} are not one fan", quads.points[i]));
        }
    }
    faults
}

/// Smooth unit normals: sums of face normals weighted by area, exactly mirrored where `half` vertices have a twin.
pub fn normals(half: &Quads) -> Vec<DVec3> {
    let mut sums = vec![DVec3::ZERO; half.points.len()];
    for face in &half.faces {
        let [a, b, c, d] = face.map(|i| half.points[i as usize]);
        let normal = (c - a).cross(d - b);
        for &i in face {
            sums[i as usize] += normal;
        }
    }
    for (sum, &on_plane) in sums.iter_mut().zip(&half.on_plane) {
        if on_plane {
            sum.x = 0.0;
        }
        *sum = sum.normalize_or(DVec3::Y);
    }
    sums
}
