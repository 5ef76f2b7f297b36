//! Pieces of a bound mesh that one joint holds alone, as helmets and greaves.

use std::ops::Range;

use glam::Vec3;

use crate::mesh::{adjacency, model::Weights};

/// Holder of a piece, as far as its points are known.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Holder {
    None,
    One(u32),
    Several,
}

/// The middle of each point's piece, where one joint holds that piece alone; `None` for points of pieces that bend.
///
/// `points`, of any unit and space, are the corners of `triangles`; points at one place count as one. Pieces with a point in
/// `bending` bend, and so does a mesh of one piece: [`skin_weights`](super::skin_weights) holds nothing else together, either.
/// Near linear time.
pub fn held_pieces(
    points: &[Vec3],
    triangles: &[[u32; 3]],
    weights: &Weights,
    bending: &[Range<u32>],
) -> Vec<Option<Vec3>> {
    let (place, count) = adjacency::weld(points);
    let is_in = |triangle: &&[u32; 3]| triangle.iter().all(|point| (*point as usize) < points.len());
    let triangles: Vec<[u32; 3]> =
        triangles.iter().filter(is_in).map(|triangle| triangle.map(|point| place[point as usize])).collect();
    let (of, count) = adjacency::islands(&triangles, count);
    let piece = |point: usize| of[place[point] as usize] as usize;
    let mut holders = vec![Holder::None; count];
    let (mut sums, mut sizes) = (vec![Vec3::ZERO; count], vec![0usize; count]);
    for (point, position) in points.iter().enumerate() {
        let piece = piece(point);
        let mut row = (point < weights.len()).then(|| weights.of(point)).into_iter().flatten();
        let own = match (row.next(), row.next()) {
            (Some((joint, _)), None) => Holder::One(joint),
            _ => Holder::Several,
        };
        holders[piece] = if holders[piece] == Holder::None || holders[piece] == own { own } else { Holder::Several };
        sums[piece] += *position;
        sizes[piece] += 1;
    }
    let bent = bending.iter().cloned().flatten().filter(|point| (*point as usize) < points.len());
    bent.for_each(|point| holders[piece(point as usize)] = Holder::Several);
    if sizes.iter().filter(|size| **size > 2).count() < 2 {
        return vec![None; points.len()];
    }
    let middle = |point: usize| {
        let piece = piece(point);
        matches!(holders[piece], Holder::One(_)).then(|| sums[piece] / sizes[piece] as f32)
    };
    (0..points.len()).map(middle).collect()
}
