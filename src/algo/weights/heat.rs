//! Heat equilibrium on the surface: every point is warmed by its own bones and cooled by its neighbours.
//!
//! Solves `(L + M H) w = M H p` for each joint (Baran and Popović 2007, section 4) with the cotangent Laplacian `L`,
//! lumped areas `M`, and the claims `H`, `p`.

use rayon::prelude::*;

use super::{
    claim::Claim,
    laplacian::Graph,
    ldl::{LANES, Ldl, Symmetric},
};
use crate::mesh::{influences::keep_strongest, model::Weights};

/// More joints than this are not solved for one by one.
const MANY_JOINTS: usize = 1024;
/// Steps towards the equilibrium where there are too many joints, or the matrix defies factorisation.
const STEPS: usize = 64;
/// The most influences a vertex keeps.
pub(crate) const KEPT: usize = 12;
/// Weights below this are no influence.
const LEAST: f32 = 1e-4;
/// Vertices handled at a time by one thread.
const CHUNK: usize = 1024;
/// Bytes of the blocks that are solved at the same time, however many threads there are.
const BLOCK_BYTES: usize = 20 << 20;

/// The weights of all vertices in `wanted`; the others, and components without any claim, stay empty. `smoothing`
/// widens blends. Independent of the number of threads.
///
/// Cost: one sparse factorisation and a solve for each joint that has a claim.
pub(crate) fn solve(graph: &Graph, claims: &[Claim], wanted: &[bool], smoothing: f32) -> Weights {
    let mut joints: Vec<u32> =
        claims.iter().filter(|c| c.heat > 0.0).flat_map(|c| c.shares).filter(|s| s.1 > 0.0).map(|s| s.0).collect();
    joints.sort_unstable();
    joints.dedup();
    let factor = if joints.len() > MANY_JOINTS { None } else { Ldl::new(&matrix(graph, claims, smoothing)) };
    let mut rows: Vec<Vec<(u32, f32)>> = vec![Vec::new(); claims.len()];
    if let Some(factor) = factor {
        let floor = floor(graph);
        let solve = |group: &[u32]| {
            let mut block = vec![[0f64; LANES]; claims.len()];
            for (row, &v) in block.iter_mut().zip(factor.order()) {
                let v = v as usize;
                let claim = &claims[v];
                for &(joint, share) in claim.shares.iter().filter(|s| s.1 > 0.0) {
                    if let Ok(lane) = group.binary_search(&joint) {
                        row[lane] += warmth(graph, claims, v, smoothing, floor) * f64::from(share);
                    }
                }
            }
            factor.solve(&mut block);
            block.into_iter().map(|row| row.map(|value| value as f32)).collect::<Vec<[f32; LANES]>>()
        };
        for groups in joints.chunks(LANES * blocks_at_once(claims.len())) {
            let blocks: Vec<Vec<[f32; LANES]>> = groups.par_chunks(LANES).map(solve).collect();
            for (group, block) in groups.chunks(LANES).zip(blocks) {
                for (values, &v) in block.iter().zip(factor.order()).filter(|(_, v)| wanted[**v as usize]) {
                    for (&joint, &value) in group.iter().zip(values).filter(|(_, value)| **value > LEAST) {
                        put(&mut rows[v as usize], joint, value);
                    }
                }
            }
        }
    } else {
        let mut weights = Weights { starts: vec![0], ..Weights::default() };
        for claim in claims {
            weights.push(claim.shares.into_iter().filter(|s| s.1 > 0.0 && claim.heat > 0.0));
        }
        for _ in 0..STEPS {
            weights = step(&weights, graph, smoothing, |v| &claims[v]);
        }
        for (v, row) in rows.iter_mut().enumerate().filter(|(v, _)| wanted[*v]) {
            row.extend(weights.of(v));
        }
    }
    let mut weights = Weights { starts: vec![0], ..Weights::default() };
    for mut row in rows {
        keep_strongest(&mut row, KEPT, 0.0);
        weights.push(row);
    }
    weights
}

/// Blocks of so many vertices that are solved at the same time: each is there in double and in single precision.
fn blocks_at_once(vertices: usize) -> usize {
    (BLOCK_BYTES / (size_of::<[f64; LANES]>() + size_of::<[f32; LANES]>()) / vertices.max(1)).max(4)
}

/// Puts the value of a joint into the row of a vertex, which is in the order of [`keep_strongest`] and has no more than it will
/// keep. Joints come in rising order.
fn put(row: &mut Vec<(u32, f32)>, joint: u32, value: f32) {
    let place = row.partition_point(|(_, other)| *other >= value);
    if !value.is_finite() || place >= KEPT {
        return;
    }
    if row.len() == KEPT {
        row.pop();
    }
    row.insert(place, (joint, value));
}

fn matrix(graph: &Graph, claims: &[Claim], smoothing: f32) -> Symmetric {
    let floor = floor(graph);
    let diagonal = (0..claims.len())
        .map(|v| {
            let exchange: f64 = graph.of(v).map(|(_, w)| f64::from(w)).sum();
            // A trace of loss keeps components without any claim solvable.
            exchange * (1.0 + 1e-12) + warmth(graph, claims, v, smoothing, floor) + 1e-12
        })
        .collect();
    Symmetric {
        starts: graph.starts.clone(),
        columns: graph.columns.clone(),
        values: graph.values.iter().map(|&v| -f64::from(v)).collect(),
        diagonal,
    }
}

/// The least area of a vertex: those of degenerate triangles have none.
fn floor(graph: &Graph) -> f64 {
    1e-6 * graph.areas.iter().map(|&a| f64::from(a)).sum::<f64>() / graph.areas.len().max(1) as f64
}

fn warmth(graph: &Graph, claims: &[Claim], v: usize, smoothing: f32, floor: f64) -> f64 {
    f64::from(graph.areas[v]).max(floor) * f64::from(claims[v].heat) / f64::from(smoothing)
}

/// One damped step towards the equilibrium on sparse rows. Vertices without neighbours stay as they are.
pub(crate) fn step<'a>(
    weights: &Weights,
    graph: &Graph,
    smoothing: f32,
    claim: impl Fn(usize) -> &'a Claim + Sync,
) -> Weights {
    let vertices: Vec<usize> = (0..weights.len()).collect();
    let parts: Vec<Weights> = vertices
        .par_chunks(CHUNK)
        .map(|chunk| {
            let mut part = Weights { starts: vec![0], ..Weights::default() };
            let mut row: Vec<(u32, f32)> = Vec::new();
            for &v in chunk {
                let claim = claim(v);
                if graph.of(v).next().is_none() {
                    part.push(weights.of(v));
                    continue;
                }
                // Deep inside one joint's flesh nothing changes.
                if let Some(only) = sole(weights, v)
                    && (claim.heat <= 0.0 || claim.shares[0] == (only, 1.0))
                    && graph.of(v).all(|(n, _)| sole(weights, n) == Some(only))
                {
                    part.push([(only, 1.0)]);
                    continue;
                }
                row.clear();
                let mut total = 0.0;
                for (n, w) in graph.of(v) {
                    total += w;
                    add(&mut row, weights.of(n), w);
                }
                // Half of the old value keeps the steps from swinging.
                add(&mut row, weights.of(v), total);
                let warmth = graph.areas[v] * claim.heat / smoothing;
                add(&mut row, claim.shares.iter().copied().filter(|s| s.1 > 0.0), warmth);
                keep_strongest(&mut row, KEPT, 1e-3);
                part.push(row.iter().copied());
            }
            part
        })
        .collect();
    let mut all = Weights { starts: Vec::with_capacity(weights.len() + 1), ..Weights::default() };
    all.starts.push(0);
    for part in &parts {
        let base = all.joints.len() as u32;
        all.joints.extend_from_slice(&part.joints);
        all.values.extend_from_slice(&part.values);
        all.starts.extend(part.starts[1..].iter().map(|s| s + base));
    }
    all
}

/// The joint of a vertex that has only one.
fn sole(weights: &Weights, v: usize) -> Option<u32> {
    let start = weights.starts[v];
    (weights.starts[v + 1] == start + 1).then(|| weights.joints[start as usize])
}

/// Adds `more` times `factor` to a sparse row.
fn add(row: &mut Vec<(u32, f32)>, more: impl Iterator<Item = (u32, f32)>, factor: f32) {
    for (joint, value) in more {
        match row.iter_mut().find(|e| e.0 == joint) {
            Some(entry) => entry.1 += value * factor,
            None => row.push((joint, value * factor)),
        }
    }
}
