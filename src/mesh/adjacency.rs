//! Connectivity of triangles: points at one position, edges, and loose islands.
//!
//! Mesh files split points at seams, and many share no points between triangles. Connectivity is therefore decided by
//! position: two points are one when their coordinates are exactly equal.

use std::hash::{BuildHasherDefault, Hasher};

use glam::Vec3;

/// Gives points of exactly equal position one number.
///
/// Returns for each point the number of its position and how many positions there are; numbers count up in the order
/// in which positions first occur. `-0.0` equals `0.0`, and coordinates that are not numbers equal those with the same
/// bits. Linear time.
pub fn weld(points: &[Vec3]) -> (Vec<u32>, usize) {
    let mut numbers =
        std::collections::HashMap::<[u32; 3], u32, BuildHasherDefault<PositionHasher>>::with_capacity_and_hasher(
            points.len(),
            BuildHasherDefault::default(),
        );
    let welded = points
        .iter()
        .map(|point| {
            let next = numbers.len() as u32;
            // Adding zero turns -0.0 into 0.0 and changes no other number.
            *numbers.entry(point.to_array().map(|c| (c + 0.0).to_bits())).or_insert(next)
        })
        .collect();
    (welded, numbers.len())
}

/// Mixes the three words of a position; fixed, so that speed does not vary from run to run.
#[derive(Default)]
struct PositionHasher(u64);

impl Hasher for PositionHasher {
    fn write(&mut self, bytes: &[u8]) {
        for word in bytes.chunks(4) {
            let word = word.iter().rev().fold(0, |word, &byte| word << 8 | u64::from(byte));
            self.0 = (self.0.rotate_left(23) ^ word).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        }
    }

    fn write_usize(&mut self, _: usize) {}

    fn finish(&self) -> u64 {
        self.0 ^ self.0 >> 32
    }
}

/// Edge between two points, with the number of triangles that use it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct Edge {
    /// The two points, the smaller index first.
    pub points: [u32; 2],
    /// Number of triangles that use the edge: 1 at a border, 2 inside a manifold, more elsewhere.
    pub triangles: u32,
}

/// The unique edges of `triangles`, sorted by their points.
///
/// Pass welded triangles to see neighbours across seams. Edges from a point to itself are left out.
/// O(n log n) for n triangles.
pub fn edges(triangles: &[[u32; 3]]) -> Vec<Edge> {
    let mut sides: Vec<[u32; 2]> = triangles
        .iter()
        .flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]])
        .filter(|[a, b]| a != b)
        .map(|[a, b]| [a.min(b), a.max(b)])
        .collect();
    sides.sort_unstable();
    sides.chunk_by(|a, b| a == b).map(|same| Edge { points: same[0], triangles: same.len() as u32 }).collect()
}

/// Numbers the connected islands of `count` points: two points of one triangle are on the same island.
///
/// Returns the island of each point and the number of islands, counted in the order of their first points; a point
/// without triangles is an island of its own. Corners past `count` are ignored. Near linear time.
pub fn islands(triangles: &[[u32; 3]], count: usize) -> (Vec<u32>, usize) {
    let mut parents: Vec<u32> = (0..count as u32).collect();
    for &[a, b, c] in triangles {
        for (a, b) in [(a, b), (b, c)] {
            if (a as usize) < count && (b as usize) < count {
                let (a, b) = (root(&mut parents, a), root(&mut parents, b));
                // The smaller index stays the root, so that numbering in point order meets every root first.
                parents[a.max(b) as usize] = a.min(b);
            }
        }
    }
    let mut numbers = vec![0; count];
    let mut found = 0;
    for point in 0..count {
        let root = root(&mut parents, point as u32) as usize;
        numbers[point] = if root == point {
            found += 1;
            found - 1
        } else {
            numbers[root]
        };
    }
    (numbers, found as usize)
}

/// Finds the root of `point` and halves the path on the way.
fn root(parents: &mut [u32], mut point: u32) -> u32 {
    while parents[point as usize] != point {
        let above = parents[parents[point as usize] as usize];
        parents[point as usize] = above;
        point = above;
    }
    point
}
