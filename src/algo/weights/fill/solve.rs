//! Laplace's equation on the vertex graph: weights of free nodes from those of known ones.

use faer::{
    Mat, Side,
    linalg::solvers::Solve,
    sparse::{SparseColMat, Triplet},
};

use super::Graph;
use crate::mesh::influences::keep_strongest;

/// Influences of one node: joint and weight.
pub(crate) type Sparse = Vec<(u32, f32)>;

/// More free nodes than this are filled step by step instead of by a factorisation.
const MOST_DIRECT: usize = 250_000;
/// Joints solved for at a time.
const BLOCK: usize = 16;
/// Rounds of averaging after filling step by step.
const ROUNDS: usize = 10;
/// Weights below this share are left out.
const LEAST: f32 = 1e-3;

/// Ties between nodes besides the mesh's edges.
#[derive(Default)]
pub(crate) struct Links {
    ties: Vec<(u32, u32, f32)>,
}

impl Links {
    /// Ties two nodes at a distance.
    pub(crate) fn add(&mut self, a: u32, b: u32, distance: f32) {
        self.ties.push((a, b, distance));
    }
}

/// Adds to a joint's weight.
pub(super) fn add(sum: &mut Sparse, joint: u32, weight: f32) {
    match sum.iter_mut().find(|s| s.0 == joint) {
        Some(found) => found.1 += weight,
        None => sum.push((joint, weight)),
    }
}

/// Sorts influences strongest first, keeps `most`, leaves out traces and makes them sum to one; empty if nothing is
/// positive.
pub(crate) fn prune(mut influences: Sparse, most: usize) -> Sparse {
    keep_strongest(&mut influences, most, LEAST);
    influences
}

/// Weights of all free nodes that hang together with known ones. Known nodes, `settled` ones and nodes without
/// any connection to a known one stay `None`.
pub(crate) fn complete(
    graph: &Graph,
    known: &[Option<Sparse>],
    settled: &[bool],
    links: &Links,
    most: usize,
) -> Vec<Option<Sparse>> {
    let mut result: Vec<Option<Sparse>> = vec![None; graph.len()];
    let mut extra: Vec<(u32, u32, f32)> = links.ties.iter().flat_map(|&(a, b, d)| [(a, b, d), (b, a, d)]).collect();
    extra.sort_unstable_by(|a, b| (a.0, a.1).cmp(&(b.0, b.1)).then(a.2.total_cmp(&b.2)));
    let ties = |node: usize| {
        let from = extra.partition_point(|e| (e.0 as usize) < node);
        let tied = extra[from..].iter().take_while(move |e| e.0 as usize == node).map(|e| (e.1 as usize, e.2));
        let place = graph.place(node);
        graph.neighbours(node).iter().map(move |&n| (n as usize, graph.place(n as usize).distance(place))).chain(tied)
    };
    // Free nodes in the order in which they are reached from known ones.
    let mut reached = vec![false; graph.len()];
    let mut free: Vec<usize> = Vec::new();
    for node in 0..graph.len() {
        if known[node].is_none() && !settled[node] && ties(node).any(|(n, _)| known[n].is_some()) {
            reached[node] = true;
            free.push(node);
        }
    }
    let mut next = 0;
    while let Some(&node) = free.get(next) {
        next += 1;
        for (n, _) in ties(node) {
            if !reached[n] && known[n].is_none() && !settled[n] {
                reached[n] = true;
                free.push(n);
            }
        }
    }
    if free.is_empty() {
        return result;
    }
    // Shorter edges tie more; far shorter than usual counts as short, which keeps the system well conditioned.
    let (mut sum, mut count) = (0.0f64, 0usize);
    for &node in &free {
        for (_, d) in ties(node) {
            sum += f64::from(d);
            count += 1;
        }
    }
    let usual = (sum / count.max(1) as f64).max(f64::MIN_POSITIVE);
    let pull = |d: f32| 1.0 / (f64::from(d) / usual).clamp(1e-3, 1e6);
    let solved = (free.len() <= MOST_DIRECT).then(|| direct(&free, graph.len(), known, &ties, &pull, most)).flatten();
    let solved = solved.unwrap_or_else(|| stepwise(&free, graph.len(), known, &ties, &pull, most));
    for (&node, influences) in free.iter().zip(solved) {
        result[node] = (!influences.is_empty()).then_some(influences);
    }
    result
}

/// Number of each node among those that are free; `usize::MAX` for the others.
fn numbers(free: &[usize], nodes: usize) -> Vec<usize> {
    let mut numbers = vec![usize::MAX; nodes];
    for (number, &node) in free.iter().enumerate() {
        numbers[node] = number;
    }
    numbers
}

/// One sparse Cholesky factorisation, then a solve for each joint. `None` if the factorisation fails.
fn direct<I: Iterator<Item = (usize, f32)>>(
    free: &[usize],
    nodes: usize,
    known: &[Option<Sparse>],
    ties: &impl Fn(usize) -> I,
    pull: &impl Fn(f32) -> f64,
    most: usize,
) -> Option<Vec<Sparse>> {
    let index = numbers(free, nodes);
    let mut entries = Vec::new();
    let mut joints: Vec<u32> = Vec::new();
    for (i, &node) in free.iter().enumerate() {
        let mut diagonal = 0.0;
        for (n, d) in ties(node) {
            let j = index[n];
            if j == usize::MAX && known[n].is_none() {
                continue;
            }
            diagonal += pull(d);
            if j == usize::MAX {
                joints.extend(known[n].iter().flatten().map(|k| k.0));
            } else if j < i {
                entries.push(Triplet::new(i, j, -pull(d)));
            }
        }
        entries.push(Triplet::new(i, i, diagonal));
    }
    joints.sort_unstable();
    joints.dedup();
    let matrix = SparseColMat::<usize, f64>::try_new_from_triplets(free.len(), free.len(), &entries).ok()?;
    drop(entries);
    let factor = matrix.sp_cholesky(Side::Lower).ok()?;
    let mut result = vec![Sparse::new(); free.len()];
    for block in joints.chunks(BLOCK) {
        let mut values = Mat::<f64>::zeros(free.len(), block.len());
        for (i, &node) in free.iter().enumerate() {
            for (n, d) in ties(node) {
                for &(joint, weight) in known[n].iter().flatten() {
                    if let Ok(column) = block.binary_search(&joint) {
                        values[(i, column)] += pull(d) * f64::from(weight);
                    }
                }
            }
        }
        factor.solve_in_place(&mut values);
        for (i, influences) in result.iter_mut().enumerate() {
            for (column, &joint) in block.iter().enumerate() {
                let value = values[(i, column)];
                if !value.is_finite() {
                    return None;
                }
                if value > 1e-5 {
                    influences.push((joint, value as f32));
                }
            }
        }
    }
    let result: Vec<Sparse> = result.into_iter().map(|influences| prune(influences, most)).collect();
    result.iter().all(|influences| !influences.is_empty()).then_some(result)
}

/// Fills nodes in the order in which they are reached, each with the mean of what is known around it, then averages a
/// few rounds.
fn stepwise<I: Iterator<Item = (usize, f32)>>(
    free: &[usize],
    nodes: usize,
    known: &[Option<Sparse>],
    ties: &impl Fn(usize) -> I,
    pull: &impl Fn(f32) -> f64,
    most: usize,
) -> Vec<Sparse> {
    let index = numbers(free, nodes);
    let mut result = vec![Sparse::new(); free.len()];
    for _ in 0..=ROUNDS {
        for (i, &node) in free.iter().enumerate() {
            let mut sum = Sparse::new();
            for (n, d) in ties(node) {
                let around = match index[n] {
                    usize::MAX => known[n].as_deref().unwrap_or(&[]),
                    j => &result[j],
                };
                for &(joint, weight) in around {
                    add(&mut sum, joint, weight * pull(d) as f32);
                }
            }
            result[i] = prune(sum, most);
        }
    }
    result
}
