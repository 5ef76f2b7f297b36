//! Decimation by collapsing the shortest edges, as a rough exporter does.

use std::{
    cmp::Reverse,
    collections::{BTreeMap, BTreeSet, BinaryHeap},
};

use bevy::math::Vec3;

/// A mesh with about `wanted` triangles: the shortest edges are collapsed into their middles.
pub fn decimated(points: &[Vec3], triangles: &[[u32; 3]], wanted: usize) -> (Vec<Vec3>, Vec<[u32; 3]>) {
    let mut points = points.to_vec();
    let mut faces: Vec<Option<[u32; 3]>> = triangles.iter().copied().map(Some).collect();
    let mut around: Vec<BTreeSet<u32>> = vec![BTreeSet::new(); points.len()];
    for (number, corners) in triangles.iter().enumerate() {
        corners.iter().for_each(|corner| {
            around[*corner as usize].insert(number as u32);
        });
    }
    let mut left = triangles.len();
    let key = |points: &[Vec3], a: u32, b: u32| {
        (points[a as usize].distance(points[b as usize]).to_bits(), a.min(b), a.max(b))
    };
    let mut edges: BinaryHeap<Reverse<(u32, u32, u32)>> = BinaryHeap::new();
    for corners in triangles {
        for side in 0..3 {
            edges.push(Reverse(key(&points, corners[side], corners[(side + 1) % 3])));
        }
    }
    while left > wanted {
        let Some(Reverse(edge)) = edges.pop() else { break };
        let (length, a, b) = edge;
        let shared: Vec<u32> = around[a as usize].intersection(&around[b as usize]).copied().collect();
        // An edge that is gone, or whose ends have moved since.
        if shared.is_empty() || key(&points, a, b).0 != length {
            continue;
        }
        points[a as usize] = points[a as usize].midpoint(points[b as usize]);
        for face in shared {
            if let Some(corners) = faces[face as usize].take() {
                left -= 1;
                corners.iter().for_each(|corner| {
                    around[*corner as usize].remove(&face);
                });
            }
        }
        for face in std::mem::take(&mut around[b as usize]) {
            if let Some(corners) = &mut faces[face as usize] {
                corners.iter_mut().filter(|corner| **corner == b).for_each(|corner| *corner = a);
                around[a as usize].insert(face);
            }
        }
        let near: BTreeSet<u32> = around[a as usize]
            .iter()
            .filter_map(|face| faces[*face as usize])
            .flatten()
            .filter(|corner| *corner != a)
            .collect();
        near.into_iter().for_each(|other| edges.push(Reverse(key(&points, a, other))));
    }
    let mut places = BTreeMap::new();
    let mut kept = Vec::new();
    let faces = faces.into_iter().flatten().map(|corners| {
        corners.map(|corner| {
            *places.entry(corner).or_insert_with(|| {
                kept.push(points[corner as usize]);
                kept.len() as u32 - 1
            })
        })
    });
    let faces = faces.collect();
    (kept, faces)
}
