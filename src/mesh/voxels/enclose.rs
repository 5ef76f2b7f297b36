//! Inside test of voxels: a flood of the outside, and votes of straight lines where holes let the flood in.

use glam::Vec3;
use rayon::prelude::*;

use super::{Voxels, raster};

/// Votes of a cell: six half lines, each odd or even, each with a winding number.
const HALF_LINES: i32 = 6;
/// Cells on each side that a vote is averaged over where the mesh leaks; missing faces are a few cells wide.
const BLUR: usize = 2;

/// Sets the grid's solid and core cells from the cells of the surface and the triangles.
pub(super) fn enclose(grid: &mut Voxels, surface: Vec<u64>, points: &[Vec3], triangles: &[[u32; 3]]) {
    let outside = flood(grid, &surface);
    let valid = row_masks(grid);
    let words = grid.words;
    let mut solid: Vec<u64> = outside.iter().enumerate().map(|(i, outside)| !outside & valid[i % words]).collect();
    let (odd, winding) = votes(grid, points, triangles);

    let dims = grid.dims;
    let at = |x: usize, row: usize| row * dims[0] + x;
    // Cells that the flood reached although most lines vote for inside.
    let (mut leaked, mut kept) = (0usize, 0usize);
    for row in 0..dims[1] * dims[2] {
        for x in 0..dims[0] {
            let bit = solid[row * words + x / 64] >> (x % 64) & 1 != 0;
            let inside = i32::from(odd[at(x, row)]) * 2 > HALF_LINES;
            leaked += usize::from(inside && !bit);
            kept += usize::from(inside && bit);
        }
    }
    let leaky = leaked * 50 > kept;
    let blurred = leaky.then(|| (blur(&odd, dims), blur(&winding, dims)));
    let inside = |index: usize| match &blurred {
        None => i32::from(odd[index]) * 2 > HALF_LINES,
        // In a leaky body a share of the lines misses a face. Inside, winding numbers average to that share of one;
        // outside, to zero. Parities are the fallback where triangles face at random.
        Some((odd, winding)) => {
            let full = HALF_LINES * (2 * BLUR as i32 + 1).pow(3);
            i32::from(winding[index]).abs() * 20 > full * 7 || i32::from(odd[index]) * 20 > full * 11
        }
    };
    let mut core = vec![0u64; solid.len()];
    let mut rescued = 0;
    for row in 0..dims[1] * dims[2] {
        for x in 0..dims[0] {
            let (word, bit) = (row * words + x / 64, 1u64 << (x % 64));
            let on_surface = surface[word] & bit != 0;
            if solid[word] & bit != 0 && !on_surface {
                core[word] |= bit;
            } else if (on_surface || leaky) && inside(at(x, row)) {
                rescued += usize::from(solid[word] & bit == 0);
                core[word] |= bit;
                solid[word] |= bit;
            }
        }
    }
    // A mesh that was cut to the grid reaches its border, where cells must be empty: see `Voxels::neighbours`.
    let last = dims[0] - 1;
    for (row, (solid, core)) in solid.chunks_mut(words).zip(core.chunks_mut(words)).enumerate() {
        let (y, z) = (row % dims[1], row / dims[1]);
        let edge = y == 0 || z == 0 || y + 1 == dims[1] || z + 1 == dims[2];
        for bits in [solid, core] {
            if edge {
                bits.fill(0);
            } else {
                bits[0] &= !1;
                bits[last / 64] &= !(1 << (last % 64));
            }
        }
    }
    grid.solid = solid;
    grid.core = core;
    grid.rescued = rescued;
}

/// The bits of each word of a row that are cells.
fn row_masks(grid: &Voxels) -> Vec<u64> {
    (0..grid.words)
        .map(|w| match grid.dims[0] - w * 64 {
            n if n >= 64 => u64::MAX,
            n => (1u64 << n) - 1,
        })
        .collect()
}

/// Cells that can be reached from the border of the grid without crossing the surface, whole rows of bits at a time.
fn flood(grid: &Voxels, surface: &[u64]) -> Vec<u64> {
    let [_, ny, nz] = grid.dims;
    let words = grid.words;
    let valid = row_masks(grid);
    let mut outside = vec![0u64; surface.len()];
    let mut waiting = vec![true; ny * nz];
    // The margin is empty, so flooding from the whole border reaches everything that is open.
    for z in 0..nz {
        for y in 0..ny {
            let row = grid.word(y, z);
            if y == 0 || z == 0 || y + 1 == ny || z + 1 == nz {
                for w in 0..words {
                    outside[row + w] = !surface[row + w] & valid[w];
                }
            } else {
                outside[row] |= 1 & !surface[row];
            }
        }
    }
    let mut queue: std::collections::VecDeque<u32> = (0..(ny * nz) as u32).collect();
    while let Some(row) = queue.pop_front() {
        waiting[row as usize] = false;
        let row = row as usize;
        let start = row * words;
        spread(&mut outside[start..start + words], &surface[start..start + words], &valid);
        let (y, z) = (row % ny, row / ny);
        let neighbours = [
            (y > 0).then(|| row - 1),
            (y + 1 < ny).then(|| row + 1),
            (z > 0).then(|| row - ny),
            (z + 1 < nz).then(|| row + ny),
        ];
        for next in neighbours.into_iter().flatten() {
            let mut changed = false;
            for w in 0..words {
                let reached = outside[start + w] & !surface[next * words + w];
                let fresh = reached & !outside[next * words + w];
                outside[next * words + w] |= fresh;
                changed |= fresh != 0;
            }
            if changed && !waiting[next] {
                waiting[next] = true;
                queue.push_back(next as u32);
            }
        }
    }
    outside
}

/// Spreads set bits along a row through cells that are not surface.
fn spread(outside: &mut [u64], surface: &[u64], valid: &[u64]) {
    let mut carry = 0;
    for w in 0..outside.len() {
        let open = !surface[w] & valid[w];
        let mut bits = outside[w] | (carry & open);
        // Doubling steps: after them a bit has reached every open cell of its run above it.
        let mut run = open;
        for shift in [1, 2, 4, 8, 16, 32] {
            bits |= run & (bits << shift);
            run &= run << shift;
        }
        outside[w] = bits;
        carry = bits >> 63;
    }
    carry = 0;
    for w in (0..outside.len()).rev() {
        let open = !surface[w] & valid[w];
        let mut bits = outside[w] | ((carry << 63) & open);
        let mut run = open;
        for shift in [1, 2, 4, 8, 16, 32] {
            bits |= run & (bits >> shift);
            run &= run >> shift;
        }
        outside[w] = bits;
        carry = bits & 1;
    }
}

/// Votes of each cell: the number of its six half lines that cross the surface an odd number of times, and six times
/// the mean of their winding numbers. Dense, x fastest.
fn votes(grid: &Voxels, points: &[Vec3], triangles: &[[u32; 3]]) -> (Vec<i8>, Vec<i8>) {
    let dims = grid.dims;
    let count = dims[0] * dims[1] * dims[2];
    let (mut odd, mut winding) = (vec![0i8; count], vec![0i8; count]);
    let strides = [1, dims[0], dims[0] * dims[1]];
    for axis in 0..3 {
        let sums = raster::crossings(grid, points, triangles, axis);
        let plane = dims[0] * dims[1];
        let tally = |start: usize, odd: &mut [i8], winding: &mut [i8], offset: usize| {
            let stride = strides[axis];
            let total: i32 = (0..dims[axis]).map(|i| i32::from(sums[start + i * stride])).sum();
            let mut before = 0;
            for i in 0..dims[axis] {
                let cell = start + i * stride;
                before += i32::from(sums[cell]);
                let after = total - before;
                odd[cell - offset] += ((before & 1) + (after & 1)) as i8;
                // Clamped, so that a heap of overlapping shells counts as one.
                winding[cell - offset] += (before.clamp(-1, 1) - after.clamp(-1, 1)) as i8;
            }
        };
        if axis == 2 {
            for start in 0..plane {
                tally(start, &mut odd, &mut winding, 0);
            }
        } else {
            odd.par_chunks_mut(plane).zip(winding.par_chunks_mut(plane)).enumerate().for_each(|(z, (odd, winding))| {
                let lines = if axis == 0 { dims[1] } else { dims[0] };
                let step = if axis == 0 { dims[0] } else { 1 };
                for line in 0..lines {
                    tally(z * plane + line * step, odd, winding, z * plane);
                }
            });
        }
    }
    (odd, winding)
}

/// Sums over a cube of cells, one axis after the other. The largest sum is 6 * 5^3, far below the limits of `i16`.
fn blur(values: &[i8], dims: [usize; 3]) -> Vec<i16> {
    let strides = [1, dims[0], dims[0] * dims[1]];
    let mut from: Vec<i16> = values.iter().map(|&v| i16::from(v)).collect();
    for axis in 0..3 {
        let (stride, count) = (strides[axis], dims[axis]);
        let source = &from;
        let to: Vec<i16> = (0..source.len())
            .into_par_iter()
            .with_min_len(1 << 14)
            .map(|cell| {
                let at = cell / stride % count;
                let (low, high) = (at.min(BLUR), (count - 1 - at).min(BLUR));
                (cell - low * stride..=cell + high * stride).step_by(stride).map(|c| source[c]).sum()
            })
            .collect();
        from = to;
    }
    from
}
