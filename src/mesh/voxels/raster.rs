//! Rasterisation of triangles into the grid: the cells that they touch, and their crossings with lines along the axes.

use std::sync::atomic::{AtomicI8, AtomicU64, Ordering::Relaxed};

use glam::Vec3;
use rayon::prelude::*;

use super::Voxels;

/// Triangles handled at a time by one thread.
const CHUNK: usize = 2048;
/// Offset of lines from the cell centres, so that they do not meet vertices of symmetric models.
const OFF_CENTER: [f64; 2] = [0.013_17, 0.007_91];

/// Corners in grid units, or `None` where a corner is not finite or the triangle is clear of the grid.
fn corners(grid: &Voxels, points: &[Vec3], triangle: &[u32; 3]) -> Option<[[f64; 3]; 3]> {
    let corners = triangle.map(|c| points[c as usize]);
    if !corners.iter().all(|c| c.is_finite()) {
        return None;
    }
    let corners = corners.map(|c| grid.to_grid(c));
    let clear = (0..3).any(|a| {
        let (low, high) = span(&corners, a);
        high < 0.0 || low >= grid.dims[a] as f64
    });
    (!clear).then_some(corners)
}

fn span(corners: &[[f64; 3]; 3], axis: usize) -> (f64, f64) {
    let [a, b, c] = corners.map(|c| c[axis]);
    (a.min(b).min(c), a.max(b).max(c))
}

/// First and one past the last cell that the span touches, inside the grid.
fn cells((low, high): (f64, f64), count: usize) -> (usize, usize) {
    (low.max(0.0) as usize, ((high.max(0.0) as usize) + 1).min(count))
}

fn normal(corners: &[[f64; 3]; 3]) -> [f64; 3] {
    let edge = |i: usize| [0, 1, 2].map(|a| corners[i][a] - corners[0][a]);
    let (u, v) = (edge(1), edge(2));
    [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]]
}

/// An upper estimate of the number of cell columns that [`surface`] and [`crossings`] will visit.
pub(super) fn work(grid: &Voxels, points: &[Vec3], triangles: &[[u32; 3]]) -> f64 {
    let columns = |chunk: &[[u32; 3]]| -> f64 {
        let mut sum = 0.0;
        for corners in chunk.iter().filter_map(|t| corners(grid, points, t)) {
            let [x, y, z] = [0, 1, 2].map(|a| {
                let (first, end) = cells(span(&corners, a), grid.dims[a]);
                end.saturating_sub(first) as f64
            });
            sum += x * y + y * z + z * x;
        }
        sum
    };
    let sums: Vec<f64> = triangles.par_chunks(CHUNK).map(columns).collect();
    sums.iter().sum()
}

/// The cells that any triangle touches, a bit each.
pub(super) fn surface(grid: &Voxels, points: &[Vec3], triangles: &[[u32; 3]]) -> Vec<u64> {
    let bits: Vec<AtomicU64> = (0..grid.words * grid.dims[1] * grid.dims[2]).map(|_| AtomicU64::new(0)).collect();
    let set = |cell: [usize; 3]| {
        let word = &bits[grid.word(cell[1], cell[2]) + cell[0] / 64];
        let bit = 1u64 << (cell[0] % 64);
        if word.load(Relaxed) & bit == 0 {
            word.fetch_or(bit, Relaxed);
        }
    };
    triangles.par_chunks(CHUNK).for_each(|chunk| {
        for triangle in chunk {
            if let Some(corners) = corners(grid, points, triangle) {
                touch(&corners, grid.dims, &set);
            }
        }
    });
    bits.into_iter().map(AtomicU64::into_inner).collect()
}

/// Calls `set` for every cell that the triangle touches.
fn touch(corners: &[[f64; 3]; 3], dims: [usize; 3], set: &impl Fn([usize; 3])) {
    let range = [0, 1, 2].map(|a| cells(span(corners, a), dims[a]));
    if range.iter().any(|(first, end)| first >= end) {
        return;
    }
    if range.iter().filter(|(first, end)| end - first > 1).count() <= 1 {
        // The triangle touches at most a straight row of cells: every one is set.
        for x in range[0].0..range[0].1 {
            for y in range[1].0..range[1].1 {
                for z in range[2].0..range[2].1 {
                    set([x, y, z]);
                }
            }
        }
        return;
    }
    let normal = normal(corners);
    let size = normal.map(f64::abs);
    let w = if size[0] >= size[1] && size[0] >= size[2] {
        0
    } else if size[1] >= size[2] {
        1
    } else {
        2
    };
    if size[w] < 1e-9 {
        return sliver(corners, dims, set);
    }
    let (u, v) = ((w + 1) % 3, (w + 2) % 3);
    // Outlines seen along each axis, each edge as a half plane that a touched cell must reach into.
    let outlines = [outline(corners, &normal, w), outline(corners, &normal, u), outline(corners, &normal, v)];
    // Depth along w of the plane over the corner of a column, and how far the plane spreads inside the column.
    let slope = [normal[u] / normal[w], normal[v] / normal[w]];
    let plane = (0..3).map(|a| normal[a] * corners[0][a]).sum::<f64>() / normal[w];
    let (lift_low, lift_high) =
        ((-slope[0]).min(0.0) + (-slope[1]).min(0.0), (-slope[0]).max(0.0) + (-slope[1]).max(0.0));
    for iu in range[u].0..range[u].1 {
        for iv in range[v].0..range[v].1 {
            if !inside(&outlines[0], iu as f64, iv as f64) {
                continue;
            }
            let depth = plane - slope[0] * iu as f64 - slope[1] * iv as f64;
            let first = (depth + lift_low).max(range[w].0 as f64) as usize;
            let end = ((depth + lift_high).max(0.0) as usize + 1).min(range[w].1);
            for iw in first..end {
                // Seen along u the plane is (v, w), seen along v it is (w, u).
                if inside(&outlines[1], iv as f64, iw as f64) && inside(&outlines[2], iw as f64, iu as f64) {
                    let mut cell = [0; 3];
                    cell[u] = iu;
                    cell[v] = iv;
                    cell[w] = iw;
                    set(cell);
                }
            }
        }
    }
}

/// The edges of a triangle seen along `axis`, as `a*u + b*v + c >= 0` for the low corner `(u, v)` of touched cells.
fn outline(corners: &[[f64; 3]; 3], normal: &[f64; 3], axis: usize) -> [[f64; 3]; 3] {
    let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
    let side = if normal[axis] >= 0.0 { 1.0 } else { -1.0 };
    [0, 1, 2].map(|i| {
        let (from, to) = (corners[i], corners[(i + 1) % 3]);
        let (a, b) = ((from[v] - to[v]) * side, (to[u] - from[u]) * side);
        [a, b, -(a * from[u] + b * from[v]) + a.max(0.0) + b.max(0.0) + 1e-9]
    })
}

fn inside(outline: &[[f64; 3]; 3], u: f64, v: f64) -> bool {
    outline.iter().all(|[a, b, c]| a * u + b * v + c >= 0.0)
}

/// A triangle without area: the cells along its edges.
fn sliver(corners: &[[f64; 3]; 3], dims: [usize; 3], set: &impl Fn([usize; 3])) {
    for i in 0..3 {
        segment(corners[i], corners[(i + 1) % 3], dims, set);
    }
}

/// Calls `set` for the cells along a segment in grid units, at steps of half a cell; some twice, corners cut.
pub(super) fn segment(mut from: [f64; 3], mut to: [f64; 3], dims: [usize; 3], mut set: impl FnMut([usize; 3])) {
    // Cut to the grid first: the ends may be very far away.
    for a in 0..3 {
        for (bound, above) in [(0.0, true), (dims[a] as f64 - 1e-6, false)] {
            let out = |p: &[f64; 3]| if above { p[a] < bound } else { p[a] > bound };
            let at = |p: [f64; 3], q: [f64; 3]| {
                let t = (bound - p[a]) / (q[a] - p[a]);
                [0, 1, 2].map(|k| if k == a { bound } else { p[k] + (q[k] - p[k]) * t })
            };
            match (out(&from), out(&to)) {
                (true, true) => return,
                (true, false) => from = at(from, to),
                (false, true) => to = at(to, from),
                (false, false) => {}
            }
        }
    }
    let length = (0..3).map(|a| (to[a] - from[a]).abs()).fold(0.0, f64::max);
    // A segment inside the grid is short; a longer one had coordinates that are not numbers.
    if length.is_nan() || length > 2.0 * super::MAX_RESOLUTION as f64 {
        return;
    }
    let steps = (length * 2.0).ceil().max(1.0) as usize;
    for step in 0..=steps {
        let t = step as f64 / steps as f64;
        let at = [0, 1, 2].map(|a| from[a] + (to[a] - from[a]) * t);
        if (0..3).all(|a| at[a] >= 0.0 && at[a] < dims[a] as f64) {
            set(at.map(|x| x as usize));
        }
    }
}

/// Sums of the crossings between the centre of every cell and the centre before it on the line along `axis`: +1 where
/// the line goes in (against the triangle's normal), -1 where it comes out. Dense, x fastest.
pub(super) fn crossings(grid: &Voxels, points: &[Vec3], triangles: &[[u32; 3]], axis: usize) -> Vec<i8> {
    let dims = grid.dims;
    let sums: Vec<AtomicI8> = (0..dims[0] * dims[1] * dims[2]).map(|_| AtomicI8::new(0)).collect();
    let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
    triangles.par_chunks(CHUNK).for_each(|chunk| {
        for corners in chunk.iter().filter_map(|t| corners(grid, points, t)) {
            let normal = normal(&corners);
            let sign = if normal[axis] > 0.0 {
                -1
            } else if normal[axis] < 0.0 {
                1
            } else {
                continue;
            };
            let (first_u, end_u) = cells(span(&corners, u), dims[u]);
            let (first_v, end_v) = cells(span(&corners, v), dims[v]);
            for iu in first_u..end_u {
                let pu = iu as f64 + 0.5 + OFF_CENTER[0];
                for iv in first_v..end_v {
                    let pv = iv as f64 + 0.5 + OFF_CENTER[1];
                    if !covers(&corners, u, v, pu, pv) {
                        continue;
                    }
                    let rise = normal[u] * (pu - corners[0][u]) + normal[v] * (pv - corners[0][v]);
                    let (low, high) = span(&corners, axis);
                    let depth = (corners[0][axis] - rise / normal[axis]).clamp(low, high);
                    let mut cell = [0; 3];
                    cell[u] = iu;
                    cell[v] = iv;
                    cell[axis] = (depth + 0.5).clamp(0.0, (dims[axis] - 1) as f64) as usize;
                    sums[(cell[2] * dims[1] + cell[1]) * dims[0] + cell[0]].fetch_add(sign, Relaxed);
                }
            }
        }
    });
    sums.into_iter().map(AtomicI8::into_inner).collect()
}

/// Returns `true` if the point lies in the triangle seen along an axis; of two triangles that share an edge exactly one
/// covers it.
fn covers(corners: &[[f64; 3]; 3], u: usize, v: usize, pu: f64, pv: f64) -> bool {
    let mut inside = false;
    for i in 0..3 {
        let (mut a, mut b) = (corners[i], corners[(i + 1) % 3]);
        if (a[v] > pv) == (b[v] > pv) {
            continue;
        }
        // The same order for both triangles at an edge gives the same rounding.
        if (a[v], a[u]) > (b[v], b[u]) {
            std::mem::swap(&mut a, &mut b);
        }
        if pu < a[u] + (pv - a[v]) / (b[v] - a[v]) * (b[u] - a[u]) {
            inside = !inside;
        }
    }
    inside
}
