//! Weights of the skin: patches of bones that heat spreads into one another.

use std::{cmp::Reverse, collections::BinaryHeap};

use rayon::prelude::*;

use super::{
    FIRST, Face, FaceWeightsError, HEAD, NECK, Row,
    sides::{Rim, Sides, inset},
    smooth,
};
use crate::algo::{
    face::bones::FaceBoneKind,
    weights::ldl::{LANES, Lane, Ldl, Symmetric},
};

/// Width of a heat step, as a share of the distance of neighbouring bones.
const WIDTH: f32 = 0.36;
/// Largest distance of bones that counts, as a share of the face's scale.
const WIDEST: f32 = 0.22;
/// Distance behind the visible part of lips and lids, as a share of the face's scale, over which hidden skin follows their bones:
/// where the eye sees the rim end is another place at each vertex.
const ROLL: f32 = 0.08;
/// The largest share of the jaw in the skin.
const JAW: f32 = 0.5;

/// Rows of all welded vertices that are skin; the others stay empty.
pub(crate) fn rows(
    face: &Face,
    sides: &Sides,
    progress: &(dyn Fn(f32) -> bool + Sync),
) -> Result<Vec<Row>, FaceWeightsError> {
    let n = face.places.len();
    let mut rows: Vec<Row> = vec![Row::new(); n];
    let bones: Vec<usize> = (0..face.bones.len()).filter(|&b| face.bones[b].kind == FaceBoneKind::Skin).collect();
    let spacing = spacings(face, sides, &bones);
    let widest = spacing.iter().copied().fold(0.0, f32::max);
    let (active, inwards) = around(face, widest);
    let index: Vec<u32> = {
        let mut index = vec![u32::MAX; n];
        for (i, &v) in active.iter().enumerate() {
            index[v as usize] = i as u32;
        }
        index
    };
    // The nearest bone of each vertex, and the width of its heat step.
    let start: Vec<(usize, f32)> = active
        .par_iter()
        .map(|&v| {
            let v = v as usize;
            let mut best = (f32::INFINITY, 0, false);
            for (i, &bone) in bones.iter().enumerate() {
                let distance = face.places[v].distance_squared(face.bones[bone].position);
                let allowed = sides.allows(v, bone);
                if (allowed && !best.2) || (allowed == best.2 && distance < best.0) {
                    best = (distance, i, allowed);
                }
            }
            let width = spacing.get(best.1).copied().unwrap_or(0.0);
            let follows = face.mask[v] || (inwards[v] <= ROLL * face.map.scale && sides.is_rim(v));
            (if follows && !bones.is_empty() { best.1 } else { bones.len() + inner(face, v) }, width)
        })
        .collect();
    if !progress(0.2) {
        return Err(FaceWeightsError::Cancelled);
    }
    let heat = spread(face, &active, &index, &start, bones.len() + 2, progress)?;
    for (i, &v) in active.iter().enumerate() {
        let v = v as usize;
        let row = &mut rows[v];
        for (column, solved) in heat.iter().enumerate() {
            let value = solved[i];
            if value < 1e-4 {
                continue;
            }
            match bones.get(column) {
                Some(&bone) => {
                    let value = value * sides.keep(face, v, bone);
                    if value > 0.0 {
                        row.push((FIRST + bone as u32, value));
                    }
                }
                None if column == bones.len() + 1 => {
                    // Between the corners, inner walls that follow the jaw end at the upper lip.
                    let upper = if sides.lip(v) == Rim::None { 0.0 } else { 1.0 - sides.lower_lip(v) };
                    let kept = 1.0 - upper * inset(face, 0, face.places[v]);
                    row.push((face.jaw.unwrap_or(HEAD), value * kept));
                }
                None => row.push((HEAD, value)),
            }
        }
    }
    rows.par_iter_mut().enumerate().filter(|(v, _)| face.skin[*v]).for_each(|(v, row)| settle(face, sides, v, row));
    Ok(rows)
}

/// Divides the head's share between head and neck, and gives the jaw its share.
fn settle(face: &Face, sides: &Sides, v: usize, row: &mut Row) {
    if row.is_empty() {
        row.push((HEAD, 1.0));
    }
    let total: f32 = row.iter().map(|e| e.1).sum();
    let share = jaw_share(face, sides, v);
    let neck = face.neck_share(face.places[v]);
    let mut others: Row = Vec::with_capacity(2);
    for e in row.iter_mut() {
        e.1 /= total;
        // Inner walls that follow the jaw keep their weight.
        if Some(e.0) != face.jaw {
            if share > 0.0
                && let Some(jaw) = face.jaw
            {
                others.push((jaw, e.1 * share));
                e.1 *= 1.0 - share;
            }
            if e.0 == HEAD && neck > 0.0 {
                others.push((NECK, e.1 * neck));
                e.1 *= 1.0 - neck;
            }
        }
    }
    for (joint, value) in others {
        match row.iter_mut().find(|e| e.0 == joint) {
            Some(e) => e.1 += value,
            None => row.push((joint, value)),
        }
    }
}

/// Share of the jaw in the skin at a vertex.
fn jaw_share(face: &Face, sides: &Sides, v: usize) -> f32 {
    if face.jaw.is_none() || !face.map.trusted {
        return 0.0;
    }
    let e = face.map.scale;
    let p = face.places[v];
    let (half, q) = face.map.fold(p);
    let below = face.below_lips(p);
    let mut share = smooth(-0.1 * e, 0.25 * e, below);
    // Between the corners the slit separates the skin that follows the jaw from the rest.
    let corner = half.lip_corner();
    let near = inset(face, 0, p) * smooth(0.35 * e, 0.05 * e, below.abs());
    let own = match sides.lip(v) {
        Rim::Upper | Rim::Lower => sides.lower_lip(v),
        Rim::None if q.z < corner.z - 0.3 * e => share,
        Rim::None => f32::from(u8::from(below > 0.0)),
    };
    share += (own - share) * near;
    let chin = half.jaw[0];
    let forward = (p.z - face.pivot.z) / (chin.z - face.pivot.z).max(0.1 * e);
    JAW * share * smooth(0.05, 0.45, forward) * smooth(face.chin - 0.35 * e, face.chin - 0.02 * e, p.y)
}

/// Column of a vertex outside the bones' patches: 1 for inner walls that follow the jaw, 0 for all else.
fn inner(face: &Face, v: usize) -> usize {
    let (half, p) = face.map.fold(face.places[v]);
    let corner = half.lip_corner();
    let mouth = face.map.trusted
        && face.jaw.is_some()
        && p.x < 1.4 * corner.x
        && (p.y - corner.y).abs() < 0.45 * face.map.scale
        && p.z > face.pivot.z
        && p.z < half.lip_line()[0].z;
    // Inner walls do not lie in front of the chin's own skin.
    usize::from(mouth && p.y > face.chin + 0.05 * face.map.scale && face.below_lips(face.places[v]) > 0.0)
}

/// The distance of each bone from its neighbours: the mean of the three nearest on its side of lips and lids.
fn spacings(face: &Face, sides: &Sides, bones: &[usize]) -> Vec<f32> {
    bones
        .iter()
        .map(|&bone| {
            let at = face.bones[bone].position;
            let mut near: Vec<f32> = bones
                .iter()
                .filter(|&&b| b != bone && !sides.are_apart(b, bone))
                .map(|&b| face.bones[b].position.distance(at))
                .filter(|&d| d > 1e-4 * face.map.scale)
                .collect();
            near.sort_by(f32::total_cmp);
            near.truncate(3);
            let mean =
                if near.is_empty() { 0.5 * face.map.scale } else { near.iter().sum::<f32>() / near.len() as f32 };
            // The limit keeps few bones from blurring a whole face.
            mean.min(WIDEST * face.map.scale)
        })
        .collect()
}

/// The vertices of the skin within `reach` of the mask, along the surface, in order, and the distance of all vertices.
fn around(face: &Face, reach: f32) -> (Vec<u32>, Vec<f32>) {
    let n = face.places.len();
    let mut distance = vec![f32::INFINITY; n];
    let mut heap = BinaryHeap::new();
    for v in (0..n).filter(|&v| face.mask[v]) {
        distance[v] = 0.0;
        if face.graph.of(v).any(|(other, _)| !face.mask[other]) {
            heap.push(Reverse((0u32, v as u32)));
        }
    }
    while let Some(Reverse((d, v))) = heap.pop() {
        let v = v as usize;
        if d != distance[v].to_bits() {
            continue;
        }
        for (other, _) in face.graph.of(v) {
            let to = distance[v] + face.places[v].distance(face.places[other]);
            if face.skin[other] && to <= reach && to < distance[other] {
                distance[other] = to;
                heap.push(Reverse((to.to_bits(), other as u32)));
            }
        }
    }
    ((0..n as u32).filter(|&v| distance[v as usize].is_finite()).collect(), distance)
}

/// Lets the patches spread: `(A + t L) w = A w₀`, twice, where `t` follows the distance of the bones.
///
/// Returns a column for each patch with a value for each vertex of `active`; the last but one column is the head's,
/// which also surrounds the patches. The values of a vertex sum to one.
fn spread(
    face: &Face,
    active: &[u32],
    index: &[u32],
    start: &[(usize, f32)],
    columns: usize,
    progress: &(dyn Fn(f32) -> bool + Sync),
) -> Result<Vec<Vec<f32>>, FaceWeightsError> {
    let n = active.len();
    let head = columns - 2;
    let mean: f64 = active.iter().map(|&v| f64::from(face.graph.areas[v as usize])).sum::<f64>() / n.max(1) as f64;
    let areas: Vec<f64> =
        active.iter().map(|&v| f64::from(face.graph.areas[v as usize]).max(1e-3 * mean).max(1e-30)).collect();
    let mut matrix = Symmetric { starts: vec![0], columns: Vec::new(), values: Vec::new(), diagonal: Vec::new() };
    let mut lost = vec![0f64; n];
    for (i, &v) in active.iter().enumerate() {
        let own = start[i].1;
        let mut diagonal = areas[i];
        for (other, weight) in face.graph.of(v as usize) {
            if !face.skin[other] {
                continue;
            }
            let j = index[other];
            let width = start.get(j as usize).map_or(own, |s| s.1.min(own)) * WIDTH;
            let flow = f64::from(width) * f64::from(width) * f64::from(weight);
            diagonal += flow;
            if j == u32::MAX {
                lost[i] += flow;
            } else {
                matrix.columns.push(j);
                matrix.values.push(-flow);
            }
        }
        matrix.starts.push(matrix.columns.len() as u32);
        matrix.diagonal.push(diagonal);
    }
    let unsolved = || {
        (0..columns).map(|c| start.iter().map(|s| f32::from(u8::from(s.0 == c))).collect()).collect::<Vec<Vec<f32>>>()
    };
    let Some(factor) = Ldl::new(&matrix) else { return Ok(unsolved()) };
    drop(matrix);
    if !progress(0.5) {
        return Err(FaceWeightsError::Cancelled);
    }
    let blocks: Vec<Vec<Vec<f32>>> = (0..columns.div_ceil(LANES))
        .into_par_iter()
        .map(|block| {
            let order = factor.order();
            let row = |&at: &u32| {
                let patch = start[at as usize].0;
                std::array::from_fn(|l| f64::from(u8::from(patch == block * LANES + l)))
            };
            let mut lanes: Vec<Lane> = order.iter().map(row).collect();
            for _ in 0..2 {
                for (lane, &at) in lanes.iter_mut().zip(order) {
                    for value in lane.iter_mut() {
                        *value *= areas[at as usize];
                    }
                    if head / LANES == block {
                        lane[head % LANES] += lost[at as usize];
                    }
                }
                factor.solve(&mut lanes);
            }
            // Single precision, column by column, takes half of the memory of the lanes.
            let mut own = vec![vec![0f32; n]; LANES.min(columns - block * LANES)];
            for (lane, &at) in lanes.iter().zip(order) {
                for (column, value) in own.iter_mut().zip(lane) {
                    column[at as usize] = *value as f32;
                }
            }
            own
        })
        .collect();
    if !progress(0.9) {
        return Err(FaceWeightsError::Cancelled);
    }
    Ok(blocks.into_iter().flatten().collect())
}
