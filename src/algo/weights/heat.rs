//! Heat equilibrium on the surface: every point is warmed by its own bones and cooled by its neighbours.
//!
//! Solves `(L + M H) w = M H p` for each joint (Baran and Popović 2007, section 4) with the cotangent Laplacian `L`, lumped
//! areas `M`, and the claims `H`, `p`.

use rayon::prelude::*;

use super::{
    claim::Claim,
    laplacian::Graph,
    ldl::{LANES, Ldl, Symmetric},
};

/// Joint weights of every vertex, dense by joint: `weights[slot][vertex]` for the joint `joints[slot]`.
pub(crate) struct Dense {
    pub joints: Vec<u32>,
    /// One block of [`LANES`] joints after another, a row a vertex.
    pub blocks: Vec<Vec<[f64; LANES]>>,
}

/// Solves for all joints that any claim names. Vertices of components without a claim come out with zero everywhere.
/// `None` if the matrix cannot be factorised.
pub(crate) fn solve(graph: &Graph, claims: &[Claim], smoothing: f32) -> Option<Dense> {
    let n = claims.len();
    let mean = graph.areas.iter().map(|&a| f64::from(a)).sum::<f64>() / n.max(1) as f64;
    let floor = mean * 1e-6;
    let area = |v: usize| f64::from(graph.areas[v]).max(floor);
    let sharpness = 1.0 / f64::from(smoothing);
    let warmth = |v: usize| area(v) * f64::from(claims[v].heat) * sharpness;
    let diagonal = (0..n)
        .map(|v| {
            let couple: f64 = graph.of(v).map(|(_, w)| f64::from(w)).sum();
            // A trace of loss keeps components without any claim solvable.
            couple * (1.0 + 1e-12) + warmth(v) + 1e-12
        })
        .collect();
    let matrix = Symmetric {
        starts: graph.starts.clone(),
        columns: graph.columns.clone(),
        values: graph.values.iter().map(|&v| -f64::from(v)).collect(),
        diagonal,
    };
    let factor = Ldl::new(&matrix)?;
    let mut joints: Vec<u32> = claims.iter().flat_map(|c| c.shares).filter(|s| s.1 > 0.0).map(|s| s.0).collect();
    joints.sort_unstable();
    joints.dedup();
    let blocks = joints
        .par_chunks(LANES)
        .map(|group| {
            let mut block = vec![[0f64; LANES]; n];
            for (v, claim) in claims.iter().enumerate() {
                for &(joint, share) in claim.shares.iter().filter(|s| s.1 > 0.0) {
                    if let Ok(lane) = group.binary_search(&joint) {
                        block[v][lane] += warmth(v) * f64::from(share);
                    }
                }
            }
            factor.solve(&mut block);
            block
        })
        .collect();
    Some(Dense { joints, blocks })
}
