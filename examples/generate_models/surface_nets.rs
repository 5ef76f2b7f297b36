//! Quads from a field by dual contouring without features ("surface nets").
//!
//! Each cell of a grid gets a vertex for every sheet of the surface that passes through it, so that the quads around
//! the crossed grid edges form a manifold. The grid may be graded and warped: cells are small where detail is wanted.

use glam::{DVec3, dvec3};
use rayon::prelude::*;

/// A grid of nodes: graded coordinates on each axis, then a warp of space.
pub struct Grid<'a> {
    /// Rising coordinates of the nodes. For symmetric grids the first two in X are `-h` and `h`.
    pub nodes: [Vec<f64>; 3],
    /// Grid coordinates to the field's space. Keeps the plane X = 0 and its sides where the surface meets it.
    pub warp: &'a (dyn Fn(DVec3) -> DVec3 + Sync),
    /// The field is even in X and only the half `x >= 0` is wanted.
    pub symmetric: bool,
}

/// Quads over points.
#[derive(Debug, Clone, Default)]
pub struct Quads {
    /// Vertices.
    pub points: Vec<DVec3>,
    /// Counter-clockwise seen from outside.
    pub faces: Vec<[u32; 4]>,
    /// True for vertices that stay on the plane of symmetry.
    pub on_plane: Vec<bool>,
}

/// Coordinates from the first key to the last, with cells as large as the keys `(coordinate, size)` say there.
pub fn graded(keys: &[(f64, f64)]) -> Vec<f64> {
    let size_at = |x: f64| {
        let i = keys.partition_point(|k| k.0 <= x).clamp(1, keys.len() - 1);
        let (a, b) = (keys[i - 1], keys[i]);
        a.1 + (b.1 - a.1) * ((x - a.0) / (b.0 - a.0)).clamp(0.0, 1.0)
    };
    let end = keys[keys.len() - 1].0;
    let mut nodes = vec![keys[0].0];
    let mut x = keys[0].0;
    while x < end {
        let half = size_at(x) / 2.0;
        x += size_at(x + half);
        nodes.push(x);
    }
    nodes
}

/// Coordinates as [`graded`] makes them from 0 up, with the first cell astride the plane 0.
pub fn graded_symmetric(keys: &[(f64, f64)]) -> Vec<f64> {
    let half = keys[0].1 / 2.0;
    let mut nodes = graded(keys);
    for x in &mut nodes {
        *x += half;
    }
    nodes.insert(0, -half);
    nodes
}

/// Edge `axis * 4 + b + 2 * c` of a cell, `b` and `c` the offsets along the next two axes, as its two corners
/// (bits x, y, z).
fn edge_corners(edge: usize) -> [usize; 2] {
    let (a, b, c) = (edge / 4, edge % 2, edge / 2 % 2);
    let low = (b << ((a + 1) % 3)) | (c << ((a + 2) % 3));
    [low, low | (1 << a)]
}

/// Sheet of every edge (`u8::MAX` if it is not crossed), for each pattern of inside corners, and how many there are.
fn sheets() -> Vec<([u8; 12], u8)> {
    (0..256usize)
        .map(|inside| {
            let is_in = |corner: usize| inside >> corner & 1 == 1;
            let crossed = |e: usize| {
                let [a, b] = edge_corners(e);
                is_in(a) != is_in(b)
            };
            let mut group: [usize; 12] = std::array::from_fn(|e| e);
            let mut join = |a: usize, b: usize| {
                let (from, to) = (group[a].max(group[b]), group[a].min(group[b]));
                group.iter_mut().filter(|g| **g == from).for_each(|g| *g = to);
            };
            for axis in 0..3 {
                for side in 0..2 {
                    let on_face = |corner: usize| corner >> axis & 1 == side;
                    let edges: Vec<usize> =
                        (0..12).filter(|&e| edge_corners(e).iter().all(|&c| on_face(c)) && crossed(e)).collect();
                    if edges.len() == 2 {
                        join(edges[0], edges[1]);
                    } else if edges.len() == 4 {
                        // Two opposite corners are inside: each keeps to itself, in both cells that share the face.
                        for corner in (0..8).filter(|&c| on_face(c) && is_in(c)) {
                            let mine: Vec<usize> =
                                edges.iter().copied().filter(|&e| edge_corners(e).contains(&corner)).collect();
                            join(mine[0], mine[1]);
                        }
                    }
                }
            }
            let mut names: Vec<usize> = Vec::new();
            let sheet = std::array::from_fn(|e| {
                if !crossed(e) {
                    return u8::MAX;
                }
                let i = names.iter().position(|&n| n == group[e]).unwrap_or_else(|| {
                    names.push(group[e]);
                    names.len() - 1
                });
                i as u8
            });
            (sheet, names.len() as u8)
        })
        .collect()
}

/// Flips the node nearest to the surface wherever the four nodes of a grid face have alternating signs. Two sheets that
/// touch in such a face would otherwise share an edge.
fn clear_saddles(values: &mut [f64], n: [usize; 3], symmetric: bool) {
    let strides = [1, n[0], n[0] * n[1]];
    for _ in 0..8 {
        let mut flips = Vec::new();
        for axis in 0..3 {
            let (b, c) = (strides[(axis + 1) % 3], strides[(axis + 2) % 3]);
            for i in 0..values.len() {
                let at = [i % n[0], i / n[0] % n[1], i / n[0] / n[1]];
                if at[(axis + 1) % 3] + 1 == n[(axis + 1) % 3] || at[(axis + 2) % 3] + 1 == n[(axis + 2) % 3] {
                    continue;
                }
                let corners = [i, i + b, i + b + c, i + c];
                let inside = corners.map(|k| values[k] < 0.0);
                if inside[0] == inside[2] && inside[1] == inside[3] && inside[0] != inside[1] {
                    let near = corners.iter().fold(i, |m, &k| if values[k].abs() < values[m].abs() { k } else { m });
                    flips.push(near);
                }
            }
        }
        if flips.is_empty() {
            return;
        }
        flips.sort_unstable();
        flips.dedup();
        for i in flips {
            if symmetric && i % n[0] == 0 {
                continue;
            }
            values[i] = -values[i];
            if symmetric && i % n[0] == 1 {
                values[i - 1] = values[i];
            }
        }
    }
}

/// The surface where the field is zero. Vertices are the means of the crossings of their cell.
pub fn extract(grid: &Grid, field: &(impl Fn(DVec3) -> f64 + Sync)) -> Quads {
    let n = grid.nodes.each_ref().map(Vec::len);
    let index = |c: [usize; 3]| (c[2] * n[1] + c[1]) * n[0] + c[0];
    let place = |c: [usize; 3]| (grid.warp)(dvec3(grid.nodes[0][c[0]], grid.nodes[1][c[1]], grid.nodes[2][c[2]]));
    let total = n[0] * n[1] * n[2];
    let mut values: Vec<f64> = (0..total)
        .into_par_iter()
        .map(|i| {
            let mut x = i % n[0];
            if grid.symmetric && x == 0 {
                x = 1;
            }
            let value = field(place([x, i / n[0] % n[1], i / n[0] / n[1]]));
            if value == 0.0 { 1e-12 } else { value }
        })
        .collect();
    clear_saddles(&mut values, n, grid.symmetric);
    let table = sheets();
    let corner = |c: [usize; 3], k: usize| [c[0] + (k & 1), c[1] + (k >> 1 & 1), c[2] + (k >> 2)];
    let pattern =
        |c: [usize; 3]| (0..8).filter(|&k| values[index(corner(c, k))] < 0.0).fold(0usize, |bits, k| bits | 1 << k);
    let mut quads = Quads::default();
    let mut first = vec![u32::MAX; total];
    for z in 0..n[2] - 1 {
        for y in 0..n[1] - 1 {
            for x in 0..n[0] - 1 {
                let c = [x, y, z];
                let bits = pattern(c);
                let (sheet, count) = &table[bits];
                if *count == 0 {
                    continue;
                }
                first[index(c)] = quads.points.len() as u32;
                for s in 0..*count {
                    let (mut sum, mut weight) = (DVec3::ZERO, 0.0);
                    for e in (0..12).filter(|&e| sheet[e] == s) {
                        let [a, b] = edge_corners(e).map(|k| corner(c, k));
                        let (va, vb) = (values[index(a)], values[index(b)]);
                        sum += place(a).lerp(place(b), va / (va - vb));
                        weight += 1.0;
                    }
                    let mut p = sum / weight;
                    let on_plane = grid.symmetric && x == 0;
                    if on_plane {
                        p.x = 0.0;
                    }
                    quads.points.push(p);
                    quads.on_plane.push(on_plane);
                }
            }
        }
    }
    for z in 0..n[2] {
        for y in 0..n[1] {
            for x in usize::from(grid.symmetric)..n[0] {
                let c = [x, y, z];
                for axis in 0..3 {
                    let (b, d) = ((axis + 1) % 3, (axis + 2) % 3);
                    if c[axis] + 1 >= n[axis] || c[b] == 0 || c[d] == 0 || c[b] + 1 >= n[b] || c[d] + 1 >= n[d] {
                        continue;
                    }
                    let mut next = c;
                    next[axis] += 1;
                    let inside = [values[index(c)] < 0.0, values[index(next)] < 0.0];
                    if inside[0] == inside[1] {
                        continue;
                    }
                    let mut quad = [(1, 1), (0, 1), (0, 0), (1, 0)].map(|(ob, od)| {
                        let mut cell = c;
                        cell[b] -= ob;
                        cell[d] -= od;
                        let (sheet, _) = &table[pattern(cell)];
                        first[index(cell)] + u32::from(sheet[axis * 4 + ob + 2 * od])
                    });
                    if inside[1] {
                        quad.reverse();
                    }
                    quads.faces.push(quad);
                }
            }
        }
    }
    quads
}
